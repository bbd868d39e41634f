//! Execution of functions in the macro's input: arguments, generic parameters, the body.

use super::call::Arguments;
use super::closure::Body;
use super::environment::{Names, Scope};
use super::evaluator::{Evaluated, Evaluator, Flow, TokenSpan, error};
use super::pattern::Subject;
use super::place::Place;
use super::types::Type;
use super::value::{CallStack, Function, Value};
use std::rc::Rc;

impl Evaluator {
    /// Calls a function in the macro's input.
    pub(super) fn call_function(
        &mut self,
        function: &Function,
        arguments: Arguments,
        expected: &Type,
        at: TokenSpan,
    ) -> Evaluated {
        let item = &function.item;
        let name = &item.sig.ident;
        self.check_recursion(item, name, at)?;
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
            around = Scope::child_scope(
                &generics,
                Names::SelfType(owner.clone(), implementation.self_type.clone()),
            );
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
        let values = self.arguments_of(item, arguments, &scope, generic, at)?;
        self.check_known(generics, &scope, name, at)?;
        if let (Some((implementation, _)), Some(around)) = (&function.owner, &block_scope) {
            self.check_known(&implementation.generics, around, name, at)?;
        }
        // Arguments have determined all parameters: `Self` is complete.
        let mut inside = scope;
        if let (Some((implementation, owner)), Some(generics)) = (&function.owner, &block_scope) {
            let own = match &implementation.self_type {
                Some(pattern) => self.resolve(pattern, generics)?,
                None => owner.clone(),
            };
            inside = Scope::child_scope(&inside, Names::SelfType(own, implementation.self_type.clone()));
        }
        let returns = match &item.sig.output {
            syn::ReturnType::Type(_, ty) => self.resolve(ty, &inside)?,
            syn::ReturnType::Default => Type::Tuple(Rc::new(Vec::new())),
        };
        let calls = Some(Rc::new(CallStack { function: item.clone(), parent: self.calls.clone() }));
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
            _ => self.follow_value(value, at)?,
        };
        Ok(self.coerce(value, &returns, at)?)
    }

    /// The values of the arguments of a call; they determine the parameters of a generic function.
    fn arguments_of(
        &mut self,
        item: &syn::ItemFn,
        arguments: Arguments,
        scope: &Rc<Scope>,
        generic: bool,
        at: TokenSpan,
    ) -> Evaluated<Vec<Value>> {
        let name = &item.sig.ident;
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
                syn::FnArg::Typed(input) => self.resolve(&input.ty, scope)?,
                syn::FnArg::Receiver(_) => Type::Unknown,
            };
            let value = match (given.0[index].take(), given.1) {
                (Some(value), _) => value,
                (None, Some((skip, expressions))) => self.expression(&expressions[index - skip], &hint)?,
                (None, None) => Value::Uninitialised,
            };
            let scope = generic.then_some(scope);
            values.push(self.argument(input, value, &hint, (name, index), scope, at)?);
        }
        Ok(values)
    }

    /// Rejects recursion: the graph would be infinite.
    fn check_recursion(&self, item: &Rc<syn::ItemFn>, name: &syn::Ident, at: TokenSpan) -> Evaluated<()> {
        let mut frame = self.calls.clone();
        while let Some(calls) = frame {
            if Rc::ptr_eq(&calls.function, item) {
                return Err(error(
                    at,
                    format!("recursion is not supported: `{name}` calls itself; write a loop"),
                )
                .into());
            }
            frame = calls.parent.clone();
        }
        Ok(())
    }

    /// The value of one argument, with the type of the function; `scope` is that of its generic
    /// parameters, if any.
    fn argument(
        &mut self,
        input: &syn::FnArg,
        value: Value,
        hint: &Type,
        (name, index): (&syn::Ident, usize),
        scope: Option<&Rc<Scope>>,
        at: TokenSpan,
    ) -> Evaluated {
        Ok(match input {
            syn::FnArg::Typed(input) => {
                let value = match (&*input.ty, value) {
                    (syn::Type::Reference(ty), value) if ty.mutability.is_some() => value,
                    (syn::Type::Path(_) | syn::Type::ImplTrait(_), value)
                        if matches!(hint, Type::Unknown) =>
                    {
                        value
                    }
                    (_, value) => self.follow_value(value, at)?,
                };
                let value = self.coerce(value, hint, at)?;
                if let Some(scope) = scope {
                    let ty = self.type_of(&value);
                    if !self.unify(&input.ty, &ty, scope) {
                        return Err(error(
                            at,
                            format!(
                                "argument {} of `{name}` is {}, which does not fit its type",
                                index + 1,
                                value.description()
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
                _ => self.follow_value(value, at)?,
            },
        })
    }

    /// Executes the body of a function or closure: `return` ends it.
    pub(super) fn execute(
        &mut self,
        scope: Rc<Scope>,
        calls: Option<Rc<CallStack>>,
        returns: Type,
        body: impl FnOnce(&mut Self) -> Evaluated,
    ) -> Evaluated {
        let branches = self.open_branch_count();
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
}
