//! Calls: closures, functions that the macro sees, methods of the user's types, built-in functions.

use super::arithmetic::Operator;
use super::closure::Body;
use super::environment::{Names, Scope};
use super::evaluator::{At, Evaluated, Evaluator, Flow, error, opaque, unsupported};
use super::methods::{self, Call, Receiver};
use super::path::Named;
use super::pattern::Subject;
use super::place::Place;
use super::types::Type;
use super::value::{Builtin, Calls, Function, Generic, Struct, Value};
use std::rc::Rc;
use syn::punctuated::Punctuated;
use syn::{Expr, Result, Token};

/// Arguments of a call.
enum Arguments<'a> {
    /// Values.
    Values(Vec<Value>),
    /// The receiver, if it is a method call, and expressions.
    Written(Option<Value>, &'a Punctuated<Expr, Token![,]>),
}

impl Arguments<'_> {
    fn len(&self) -> usize {
        match self {
            Arguments::Values(values) => values.len(),
            Arguments::Written(receiver, expressions) => usize::from(receiver.is_some()) + expressions.len(),
        }
    }
}

impl Evaluator {
    /// Calls a closure, a function or a constructor.
    pub fn call(&mut self, function: &Value, arguments: Vec<Value>, at: At) -> Result<Value> {
        self.call_expecting(function, arguments, &Type::Unknown, at)
    }

    /// Calls something of which the context expects a type.
    pub fn call_expecting(
        &mut self,
        function: &Value,
        arguments: Vec<Value>,
        expected: &Type,
        at: At,
    ) -> Result<Value> {
        let result = self.deeper(at, |evaluator| evaluator.call_value(function, arguments, expected, at));
        self.finished(result, at)
    }

    fn call_value(&mut self, function: &Value, arguments: Vec<Value>, expected: &Type, at: At) -> Evaluated {
        match function {
            Value::Closure(closure) => self.call_closure(closure, arguments, expected, at),
            Value::Function(function) => {
                self.call_function(function, Arguments::Values(arguments), expected, at)
            }
            Value::Constructor(ty, variant) => Ok(self.construct(ty, *variant, arguments, at)?),
            Value::Builtin(builtin) => self.call_builtin(builtin, arguments, expected, at),
            Value::Reference(place) => {
                let function = self.read(place, at)?;
                self.call_value(&function, arguments, expected, at)
            }
            Value::Opaque(_) => Err(opaque(at, "a function").into()),
            other => Err(error(at, format!("{} cannot be called", other.kind())).into()),
        }
    }

    pub(super) fn call_expression(&mut self, call: &syn::ExprCall, expected: &Type) -> Evaluated {
        let callee = match &*call.func {
            Expr::Path(path) => match self.named(path)? {
                Named::Variable(cell) => {
                    let value = cell.borrow().clone();
                    value
                }
                Named::Value(value) => value,
                Named::Builtin(builtin) => {
                    let hint = argument_hint(&builtin, expected);
                    let mut arguments = Vec::with_capacity(call.args.len());
                    for argument in &call.args {
                        arguments.push(self.expression(argument, &hint)?);
                    }
                    return self.call_builtin(&builtin, arguments, expected, call);
                }
            },
            other => self.expression(other, &Type::Unknown)?,
        };
        match self.load(callee, call)? {
            Value::Function(function) => {
                self.call_function(&function, Arguments::Written(None, &call.args), expected, call)
            }
            Value::Constructor(ty, variant) => {
                let ty = match (&ty, expected) {
                    (Type::Struct(a, known), Type::Struct(b, _)) if Rc::ptr_eq(a, b) && known.is_empty() => {
                        expected.clone()
                    }
                    _ => ty,
                };
                let types = match &ty {
                    Type::Struct(definition, arguments) => {
                        self.field_types(definition, variant, arguments)?
                    }
                    _ => Vec::new(),
                };
                let mut arguments = Vec::with_capacity(call.args.len());
                for (index, argument) in call.args.iter().enumerate() {
                    let hint = types.get(index).cloned().unwrap_or_default();
                    arguments.push(self.expression(argument, &hint)?);
                }
                Ok(self.construct(&ty, variant, arguments, call)?)
            }
            Value::Closure(closure) => {
                let mut arguments = Vec::with_capacity(call.args.len());
                for (index, argument) in call.args.iter().enumerate() {
                    let hint = match closure.closure.inputs.get(index) {
                        Some(syn::Pat::Type(pattern)) => self.resolve(&pattern.ty, &closure.scope)?,
                        _ => Type::Unknown,
                    };
                    arguments.push(self.expression(argument, &hint)?);
                }
                self.call_closure(&closure, arguments, expected, call)
            }
            callee => {
                let mut arguments = Vec::with_capacity(call.args.len());
                for argument in &call.args {
                    arguments.push(self.expression(argument, &Type::Unknown)?);
                }
                self.call_value(&callee, arguments, expected, call)
            }
        }
    }

    /// A tuple struct or variant.
    fn construct(&mut self, ty: &Type, variant: usize, arguments: Vec<Value>, at: At) -> Result<Value> {
        let Type::Struct(definition, generics) = ty else {
            return Err(error(at, "this cannot be called"));
        };
        let types = self.field_types(definition, variant, generics)?;
        if types.len() != arguments.len() {
            return Err(error(at, format!("expected {} arguments, found {}", types.len(), arguments.len())));
        }
        let mut fields = Vec::with_capacity(types.len());
        for (ty, value) in types.iter().zip(arguments) {
            fields.push(self.coerce(value, ty, at)?);
        }
        Ok(Value::Struct(Rc::new(Struct { definition: definition.clone(), variant, fields })))
    }

    fn call_builtin(
        &mut self,
        builtin: &Builtin,
        mut arguments: Vec<Value>,
        expected: &Type,
        at: At,
    ) -> Evaluated {
        let name = builtin.path.last().cloned().unwrap_or_default();
        if name == "Some" && arguments.len() == 1 {
            return Ok(Value::Option(arguments.pop().map(Box::new)));
        }
        let call = Call { name: &name, turbofish: &builtin.turbofish, arguments, expected, at };
        if let Some(value) = methods::function(self, builtin, &call)? {
            return Ok(value);
        }
        let mut arguments = call.arguments;
        // `f64::sqrt(x)` and `Trait::method(x)` are method calls.
        if (builtin.owner.is_some() || builtin.path.len() > 1) && !arguments.is_empty() {
            let first = arguments.remove(0);
            let receiver = self.dereferenced(Receiver::Value(first), at)?;
            if let Some(value) =
                self.call_method(&receiver, &name, &builtin.turbofish, arguments, expected, at)?
            {
                return Ok(value);
            }
        }
        let full = builtin.path.join("::");
        Err(error(
            at,
            format!(
                "the macro does not see the function `{full}`: nest it in the body, or put it beside the model in \
                 a `#[dae] mod`"
            ),
        )
        .into())
    }

    /// A method by name: the user's first, then built-in ones.
    fn call_method(
        &mut self,
        receiver: &Receiver,
        name: &str,
        turbofish: &[Generic],
        arguments: Vec<Value>,
        expected: &Type,
        at: At,
    ) -> Evaluated<Option<Value>> {
        if let Some((function, receiver)) = self.user_function(receiver, name, turbofish, at)? {
            let mut values = vec![receiver];
            values.extend(arguments);
            return self.call_function(&function, Arguments::Values(values), expected, at).map(Some);
        }
        let call = Call { name, turbofish, arguments, expected, at };
        Ok(methods::method(self, receiver, &call)?)
    }

    /// The user's method of a name for a receiver, and the receiver as its first argument.
    fn user_function(
        &mut self,
        receiver: &Receiver,
        name: &str,
        turbofish: &[Generic],
        at: At,
    ) -> Result<Option<(Function, Value)>> {
        if self.implementations.is_empty() {
            return Ok(None);
        }
        let symbol = self.symbol_of(name);
        if !self.implementations.iter().any(|implementation| implementation.functions.contains_key(&symbol)) {
            return Ok(None);
        }
        let value = receiver.value(self, at)?;
        let ty = self.type_of(&value);
        if matches!(ty, Type::Unknown) {
            return Ok(None);
        }
        let Some((implementation, item)) = self.find_function(symbol, &ty) else { return Ok(None) };
        let Some(syn::FnArg::Receiver(own)) = item.sig.inputs.first() else { return Ok(None) };
        let mutable = matches!(&own.kind, syn::ReceiverKind::Reference(_, _, Some(_)));
        let first = match (mutable, receiver) {
            (true, Receiver::Place(place)) => Value::Reference(place.clone()),
            (true, Receiver::Value(value)) => Value::Reference(Place::new(value.clone())),
            (false, _) => value,
        };
        let scope = implementation.scope.clone();
        let function =
            Function { item, scope, turbofish: turbofish.to_vec(), owner: Some((implementation, ty)) };
        Ok(Some((function, first)))
    }

    pub(super) fn method_call(&mut self, call: &syn::ExprMethodCall, expected: &Type) -> Evaluated {
        let name = call.method.to_string();
        // A closure in a field is no method, so the receiver of `(self.f)(x)` does not come here.
        let receiver = self.place(&call.receiver, true)?;
        let receiver = self.dereferenced(receiver, &call.receiver)?;
        let turbofish = match &call.turbofish {
            Some(arguments) => {
                let scope = self.scope.clone();
                self.turbofish(arguments, &scope)?
            }
            None => Vec::new(),
        };
        if let Some((function, first)) = self.user_function(&receiver, &name, &turbofish, call)? {
            return self.call_function(
                &function,
                Arguments::Written(Some(first), &call.args),
                expected,
                call,
            );
        }
        // Numbers are copied before the arguments are executed.
        let receiver = match &receiver {
            Receiver::Place(place) => match self.read(place, call)? {
                value @ (Value::Real(_) | Value::Integer(_) | Value::Bool(_) | Value::Condition(_)) => {
                    Receiver::Value(value)
                }
                Value::Uninitialised => {
                    return Err(error(&call.receiver, "this variable has no value here").into());
                }
                _ => receiver,
            },
            _ => receiver,
        };
        let hint = match &receiver {
            Receiver::Value(value) => self.type_of(value).scalar(),
            Receiver::Place(_) => Type::Unknown,
        };
        let hint = if let Type::Integer(_) = hint { hint } else { Type::Unknown };
        let hint = if name == "pow" || name.starts_with("sh") { Type::Unknown } else { hint };
        let mut arguments = Vec::with_capacity(call.args.len());
        for argument in &call.args {
            arguments.push(self.expression(argument, &hint)?);
        }
        let request = Call { name: &name, turbofish: &turbofish, arguments, expected, at: call };
        if let Some(value) = methods::method(self, &receiver, &request)? {
            return Ok(value);
        }
        let value = receiver.value(self, call)?;
        let (kind, method) = (value.kind(), &call.method);
        Err(unsupported(method, format!("the method `{name}` of {kind}")).into())
    }

    /// Calls a function that the macro sees.
    fn call_function(
        &mut self,
        function: &Function,
        arguments: Arguments,
        expected: &Type,
        at: At,
    ) -> Evaluated {
        let item = &function.item;
        let name = &item.sig.ident;
        let mut frame = self.calls.clone();
        while let Some(calls) = frame {
            if Rc::ptr_eq(&calls.function, item) {
                return Err(error(
                    at,
                    format!(
                        "`{name}` calls itself, and a graph has no end then: write the recursion as a loop"
                    ),
                )
                .into());
            }
            frame = calls.parent.clone();
        }
        if item.sig.inputs.len() != arguments.len() {
            let (expected, found) = (item.sig.inputs.len(), arguments.len());
            return Err(
                error(at, format!("`{name}` takes {expected} arguments, but {found} are given")).into()
            );
        }
        // Generic parameters of the `impl` block and of the function.
        let mut around = function.scope.clone();
        let mut block_scope = None;
        if let Some((implementation, owner)) = &function.owner {
            let generics = self.generic_scope(&implementation.generics, &implementation.scope);
            if let Some(pattern) = &implementation.self_type {
                self.unify(pattern, owner, &generics);
            }
            around =
                Scope::inside(&generics, Names::SelfType(owner.clone(), implementation.self_type.clone()));
            block_scope = Some(generics);
        }
        let generics = &item.sig.generics;
        let scope = self.generic_scope(generics, &around);
        self.bind_turbofish(generics, &function.turbofish, &scope);
        let generic = !generics.params.is_empty()
            || function.owner.as_ref().is_some_and(|(block, _)| !block.generics.params.is_empty());
        if generic && let syn::ReturnType::Type(_, ty) = &item.sig.output {
            self.unify(ty, expected, &scope);
        }
        // Arguments.
        let mut values = Vec::with_capacity(arguments.len());
        let mut given = match arguments {
            Arguments::Values(values) => (values.into_iter().map(Some).collect::<Vec<_>>(), None),
            Arguments::Written(receiver, expressions) => {
                let mut values: Vec<_> = receiver.into_iter().map(Some).collect();
                let skip = values.len();
                values.resize_with(skip + expressions.len(), || None);
                (values, Some((skip, expressions)))
            }
        };
        for (index, input) in item.sig.inputs.iter().enumerate() {
            let hint = match input {
                syn::FnArg::Typed(input) => self.resolve(&input.ty, &scope)?,
                syn::FnArg::Receiver(_) => Type::Unknown,
            };
            let value = match (given.0[index].take(), given.1) {
                (Some(value), _) => value,
                (None, Some((skip, expressions))) => self.expression(&expressions[index - skip], &hint)?,
                (None, None) => Value::Uninitialised,
            };
            let value = match input {
                syn::FnArg::Typed(input) => {
                    let value = match (&*input.ty, value) {
                        (syn::Type::Reference(ty), value) if ty.mutability.is_some() => value,
                        (syn::Type::Path(_) | syn::Type::ImplTrait(_), value)
                            if matches!(hint, Type::Unknown) =>
                        {
                            value
                        }
                        (_, value) => self.load(value, at)?,
                    };
                    let value = self.coerce(value, &hint, at)?;
                    if generic {
                        let ty = self.type_of(&value);
                        if !self.unify(&input.ty, &ty, &scope) {
                            return Err(error(
                                at,
                                format!(
                                    "argument {} of `{name}` is {}, which does not fit its type",
                                    index + 1,
                                    value.kind()
                                ),
                            )
                            .into());
                        }
                    }
                    value
                }
                syn::FnArg::Receiver(receiver) => match &receiver.kind {
                    syn::ReceiverKind::Reference(_, _, Some(_)) => match value {
                        value @ Value::Reference(_) => value,
                        value => Value::Reference(Place::new(value)),
                    },
                    _ => self.load(value, at)?,
                },
            };
            values.push(value);
        }
        self.check_known(generics, &scope, name, at)?;
        if let (Some((implementation, _)), Some(around)) = (&function.owner, &block_scope) {
            self.check_known(&implementation.generics, around, name, at)?;
        }
        // Now all parameters are known that arguments can tell: `Self` is complete.
        let mut inside = scope;
        if let (Some((implementation, owner)), Some(generics)) = (&function.owner, &block_scope) {
            let own = match &implementation.self_type {
                Some(pattern) => self.resolve(pattern, generics)?,
                None => owner.clone(),
            };
            inside = Scope::inside(&inside, Names::SelfType(own, implementation.self_type.clone()));
        }
        let returns = match &item.sig.output {
            syn::ReturnType::Type(_, ty) => self.resolve(ty, &inside)?,
            syn::ReturnType::Default => Type::Tuple(Rc::new(Vec::new())),
        };
        let calls = Some(Rc::new(Calls { function: item.clone(), parent: self.calls.clone() }));
        let inputs = item.sig.inputs.iter().zip(values);
        let result = self.execute(inside, calls, returns.clone(), |evaluator| {
            for (input, value) in inputs {
                let bindings = match input {
                    syn::FnArg::Typed(input) => evaluator.bind(&input.pat, Subject::Value(value))?,
                    syn::FnArg::Receiver(_) => vec![(evaluator.symbol_of("self"), value)],
                };
                evaluator.declare(bindings);
            }
            evaluator.deeper(name, |evaluator| evaluator.block(&item.block, &returns))
        });
        let value = result?;
        let value = match &item.sig.output {
            syn::ReturnType::Type(_, ty) if matches!(&**ty, syn::Type::Reference(ty) if ty.mutability.is_some()) => {
                value
            }
            _ if matches!(returns, Type::Unknown) => value,
            _ => self.load(value, at)?,
        };
        Ok(self.coerce(value, &returns, at)?)
    }

    /// Executes the body of a function or closure: `return` leads to its end.
    pub(super) fn execute(
        &mut self,
        scope: Rc<Scope>,
        calls: Option<Rc<Calls>>,
        returns: Type,
        body: impl FnOnce(&mut Self) -> Evaluated,
    ) -> Evaluated {
        let branches = self.branches();
        let saved = Body {
            scope: std::mem::replace(&mut self.scope, scope),
            calls: std::mem::replace(&mut self.calls, calls),
            returns: std::mem::replace(&mut self.returns, returns),
            targets: std::mem::take(&mut self.targets),
            branches: std::mem::replace(&mut self.function_branches, branches),
        };
        let result = body(self);
        self.scope = saved.scope;
        self.calls = saved.calls;
        self.returns = saved.returns;
        self.targets = saved.targets;
        self.function_branches = saved.branches;
        match result {
            Err(Flow::Return(value)) => Ok(value),
            other => other,
        }
    }

    /// The user's implementation of an operator.
    pub(super) fn user_operator(
        &mut self,
        operator: Operator,
        a: &Value,
        b: &Value,
        at: At,
    ) -> Result<Option<Value>> {
        let (of, method) = operator.method();
        self.user_method(of, method, a, vec![b.clone()], at)
    }

    /// A method of a trait (or an inherent one of the same name) that the user implemented for `a`; of
    /// several implementations the one whose generic argument fits the first of the other arguments.
    pub(super) fn user_method(
        &mut self,
        of: &str,
        method: &str,
        a: &Value,
        arguments: Vec<Value>,
        at: At,
    ) -> Result<Option<Value>> {
        if self.implementations.is_empty() {
            return Ok(None);
        }
        let symbol = self.symbol_of(method);
        let own = self.type_of(a);
        let other = arguments.first().map(|value| self.type_of(value)).unwrap_or_default();
        for implementation in self.implementations.clone().iter().rev() {
            let Some(item) = implementation.functions.get(&symbol) else { continue };
            let Some(last) = implementation.of.as_ref().and_then(|path| path.segments.last()) else {
                continue;
            };
            if last.ident != of && !(of == "Index" && last.ident == "IndexMut") {
                continue;
            }
            let Some(scope) = self.fitting(implementation, &own) else { continue };
            let scope = Scope::inside(&scope, Names::SelfType(own.clone(), implementation.self_type.clone()));
            let right = match &last.arguments {
                syn::PathArguments::AngleBracketed(written) => {
                    written.args.iter().find_map(|argument| match argument {
                        syn::GenericArgument::Type(ty) => Some(ty.clone()),
                        _ => None,
                    })
                }
                _ => None,
            };
            let right = right.or_else(|| implementation.self_type.clone());
            if let Some(right) = right
                && !arguments.is_empty()
                && !self.unify(&right, &other, &scope)
            {
                continue;
            }
            let function = Function {
                item: item.clone(),
                scope: implementation.scope.clone(),
                turbofish: Vec::new(),
                owner: Some((implementation.clone(), own)),
            };
            let mut values = vec![a.clone()];
            values.extend(arguments);
            let result = self.deeper(at, |evaluator| {
                evaluator.call_function(&function, Arguments::Values(values), &Type::Unknown, at)
            });
            return self.finished(result, at).map(Some);
        }
        Ok(None)
    }

    /// Executes a model function with the values of its arguments. The spans are those of the
    /// elements of its result, where they are written one by one, and of the result otherwise.
    pub fn run(
        &mut self,
        item: &Rc<syn::ItemFn>,
        scope: &Rc<Scope>,
        turbofish: Vec<Generic>,
        arguments: Vec<Value>,
    ) -> Result<Value> {
        let function = Function { item: item.clone(), scope: scope.clone(), turbofish, owner: None };
        let result =
            self.call_function(&function, Arguments::Values(arguments), &Type::Unknown, &item.sig.ident);
        self.finished(result, &item.sig.ident)
    }
}

/// What the context of a call tells about its arguments: `Some(x)` hands its type down.
fn argument_hint(builtin: &Builtin, expected: &Type) -> Type {
    match (builtin.path.last(), expected) {
        (Some(name), Type::Option(inner)) if name == "Some" => (**inner).clone(),
        _ => Type::Unknown,
    }
}
