//! Calls: closures, functions in the macro's input, methods of the user's types, built-in
//! functions.

use super::evaluator::{Evaluated, Evaluator, TokenSpan, error, opaque_value_error, unsupported};
use super::methods::{self, Call, Receiver};
use super::path::PathMeaning;
use super::types::Type;
use super::value::{Builtin, Function, Struct, Value};
use std::rc::Rc;
use syn::punctuated::Punctuated;
use syn::{Expr, Result, Token};

/// Arguments of a call.
pub(super) enum Arguments<'a> {
    /// Values.
    Values(Vec<Value>),
    /// The receiver of a method call, and expressions.
    Written(Option<Value>, &'a Punctuated<Expr, Token![,]>),
}

impl Arguments<'_> {
    pub(super) fn len(&self) -> usize {
        match self {
            Arguments::Values(values) => values.len(),
            Arguments::Written(receiver, expressions) => usize::from(receiver.is_some()) + expressions.len(),
        }
    }
}

impl Evaluator {
    /// Calls a closure, a function or a constructor.
    pub fn call(&mut self, function: &Value, arguments: Vec<Value>, at: TokenSpan) -> Result<Value> {
        self.call_expecting(function, arguments, &Type::Unknown, at)
    }

    /// As [`Evaluator::call`], with the type that the context expects.
    pub fn call_expecting(
        &mut self,
        function: &Value,
        arguments: Vec<Value>,
        expected: &Type,
        at: TokenSpan,
    ) -> Result<Value> {
        let result = self.deeper(at, |evaluator| evaluator.call_value(function, arguments, expected, at));
        self.require_value(result, at)
    }

    fn call_value(
        &mut self,
        function: &Value,
        arguments: Vec<Value>,
        expected: &Type,
        at: TokenSpan,
    ) -> Evaluated {
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
            Value::Opaque(_) => Err(opaque_value_error(at, "a function").into()),
            other => Err(error(at, format!("{} cannot be called", other.description())).into()),
        }
    }

    pub(super) fn call_expression(&mut self, call: &syn::ExprCall, expected: &Type) -> Evaluated {
        let callee = match &*call.func {
            Expr::Path(path) => match self.path_meaning(path)? {
                PathMeaning::Variable(cell) => cell.borrow().clone(),
                PathMeaning::Value(value) => value,
                PathMeaning::Builtin(builtin) => {
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
        match self.follow_value(callee, call)? {
            Value::Function(function) => {
                self.call_with_expressions(&function, None, &call.args, expected, call)
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
    fn construct(
        &mut self,
        ty: &Type,
        variant: usize,
        arguments: Vec<Value>,
        at: TokenSpan,
    ) -> Result<Value> {
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
        at: TokenSpan,
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
        if self.is_method(builtin) && !arguments.is_empty() {
            let first = arguments.remove(0);
            let receiver = self.dereferenced(Receiver::Value(first), at)?;
            if let Some(value) = self.call_method(&receiver, builtin, arguments, expected, at)? {
                return Ok(value);
            }
        }
        let full = builtin.path.join("::");
        if let Some(instead) = builtin.path.iter().rev().nth(1).and_then(|ty| replacement_hint(ty)) {
            return Err(unsupported(at, format!("`{full}` ({instead})")).into());
        }
        Err(error(
            at,
            format!(
                "the macro does not see the function `{full}`: nest it in the body, or put it beside the model in \
                 a `#[dae] mod`"
            ),
        )
        .into())
    }

    /// Whether a path denotes a method: of a known type, or of a trait of the language, of a known
    /// crate, or in the macro's input. Functions of modules outside of the input are no methods.
    fn is_method(&self, builtin: &Builtin) -> bool {
        let is_seen = |name: &String| {
            let mut traits = self.implementations.iter().filter_map(|implementation| {
                implementation.of.as_ref().and_then(|path| path.segments.last())
            });
            traits.any(|of| of.ident == name)
        };
        match builtin.path.as_slice() {
            _ if builtin.owner.is_some() => true,
            [first, _, ..] if METHOD_CRATES.contains(&first.as_str()) => true,
            [of, _] if METHOD_TRAITS.contains(&of.as_str()) => true,
            [.., of, _] => is_seen(of),
            _ => false,
        }
    }

    /// A method called by its path: the user's methods first, then built-in ones.
    fn call_method(
        &mut self,
        receiver: &Receiver,
        builtin: &Builtin,
        arguments: Vec<Value>,
        expected: &Type,
        at: TokenSpan,
    ) -> Evaluated<Option<Value>> {
        let (name, turbofish) = (builtin.path.last().map_or("", String::as_str), &builtin.turbofish);
        let function = match builtin.owner {
            Some(_) => self.user_function(receiver, name, turbofish, at)?,
            None => self.function_of_trait(receiver, builtin, at)?,
        };
        if let Some((function, receiver)) = function {
            let mut values = vec![receiver];
            values.extend(arguments);
            return self.call_function(&function, Arguments::Values(values), expected, at).map(Some);
        }
        let call = Call { name, turbofish, arguments, expected, at };
        Ok(methods::method(self, receiver, &call)?)
    }

    /// Calls a function with unevaluated arguments; of several implementations the one whose
    /// arguments fit.
    fn call_with_expressions(
        &mut self,
        function: &Function,
        receiver: Option<Value>,
        written: &Punctuated<Expr, Token![,]>,
        expected: &Type,
        at: TokenSpan,
    ) -> Evaluated {
        let several = self.implementations_of_trait(function);
        if several.len() < 2 {
            return self.call_function(function, Arguments::Written(receiver, written), expected, at);
        }
        let mut arguments: Vec<_> = receiver.into_iter().collect();
        for argument in written {
            arguments.push(self.expression(argument, &Type::Unknown)?);
        }
        let function = self.choose(several, &arguments, at)?;
        self.call_function(&function, Arguments::Values(arguments), expected, at)
    }

    pub(super) fn method_call(&mut self, call: &syn::ExprMethodCall, expected: &Type) -> Evaluated {
        let name = call.method.to_string();
        // A closure in a field is no method, so that `(self.f)(x)` is handled elsewhere.
        let receiver = self.place_of_type(&call.receiver, true, &receiver_hint(call, &name, expected))?;
        let receiver = self.dereferenced(receiver, &call.receiver)?;
        let turbofish = match &call.turbofish {
            Some(arguments) => {
                let scope = self.scope.clone();
                self.turbofish(arguments, &scope)?
            }
            None => Vec::new(),
        };
        if let Some((function, first)) = self.user_function(&receiver, &name, &turbofish, call)? {
            return self.call_with_expressions(&function, Some(first), &call.args, expected, call);
        }
        if name == "into"
            && let Some(value) = self.user_conversion(&receiver, expected, call)?
        {
            return Ok(value);
        }
        // Numbers are copied before the arguments are evaluated.
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
        let at = &call.method;
        let request = Call { name: &name, turbofish: &turbofish, arguments, expected, at };
        if let Some(value) = methods::method(self, &receiver, &request)? {
            return Ok(value);
        }
        let value = receiver.value(self, call)?;
        Err(unsupported(at, format!("the method `{name}` of {}", value.description())).into())
    }
}

/// Crates whose functions are treated as methods.
const METHOD_CRATES: &[&str] =
    &["core", "std", "alloc", "nalgebra", "na", "simba", "num_traits", "num_dual", "libm", "casados"];

/// Traits of the language and of those crates whose methods are called by path.
#[rustfmt::skip]
const METHOD_TRAITS: &[&str] = &[
    "Add", "Sub", "Mul", "Div", "Rem", "Neg", "Not", "AddAssign", "SubAssign", "MulAssign", "DivAssign",
    "RemAssign", "Index", "IndexMut", "PartialEq", "PartialOrd", "Eq", "Ord", "Clone", "Copy", "Default",
    "From", "Into", "TryFrom", "TryInto", "AsRef", "AsMut", "Borrow", "ToOwned", "Iterator", "IntoIterator",
    "DoubleEndedIterator", "ExactSizeIterator", "Sum", "Product", "Float", "FloatCore", "ComplexField",
    "RealField", "DualNum",
];

/// The expected type of the arguments, from the context of a call: `Some(x)` passes it on.
fn argument_hint(builtin: &Builtin, expected: &Type) -> Type {
    match (builtin.path.last(), expected) {
        (Some(name), Type::Option(inner)) if name == "Some" => (**inner).clone(),
        _ => Type::Unknown,
    }
}

/// The expected type of the receiver, from the context of a call: `n.try_into().unwrap()` passes it
/// on.
fn receiver_hint(call: &syn::ExprMethodCall, name: &str, expected: &Type) -> Type {
    match &*call.receiver {
        Expr::MethodCall(inner)
            if inner.method == "try_into"
                && (name == "expect" || name.starts_with("unwrap"))
                && !matches!(expected, Type::Unknown) =>
        {
            Type::Option(Rc::new(expected.clone()))
        }
        _ => Type::Unknown,
    }
}

/// The replacement of a nalgebra type that graph models do not support.
fn replacement_hint(ty: &str) -> Option<&'static str> {
    Some(match ty {
        "Quaternion" | "UnitQuaternion" | "UnitDualQuaternion" | "DualQuaternion" => {
            "use four numbers of the state, and a helper function for their product"
        }
        "Rotation2" | "Rotation3" | "Isometry2" | "Isometry3" | "Similarity2" | "Similarity3"
        | "UnitComplex" => "use a matrix of fixed size",
        "Complex" => "use two numbers",
        "DVector" | "DMatrix" | "RowDVector" => {
            "use vectors and matrices of fixed size: `SVector`, `SMatrix`"
        }
        _ => return None,
    })
}
