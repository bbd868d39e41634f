//! Methods and operators implemented by the user.

use super::arithmetic::Operator;
use super::call::Arguments;
use super::environment::{Names, Scope};
use super::evaluator::{Evaluated, Evaluator, TokenSpan, error};
use super::implementation::Implementation;
use super::items::Symbol;
use super::methods::{self, Receiver};
use super::place::Place;
use super::types::Type;
use super::value::{Builtin, Function, Generic, Value};
use std::rc::Rc;
use syn::Result;

impl Evaluator {
    /// The user's method with this name for a receiver, and the receiver as its first argument.
    pub(super) fn user_function(
        &mut self,
        receiver: &Receiver,
        name: &str,
        turbofish: &[Generic],
        at: TokenSpan,
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
        let hidden = self.is_hidden(&ty, name);
        // Methods of numbers take `self`, those of matrices `&self`: a trait's `self` takes
        // precedence.
        let by_reference = matches!(ty, Type::Matrix(..));
        if hidden && !by_reference {
            return Ok(None);
        }
        let found = self.trait_function(receiver, (ty, symbol), turbofish, at)?;
        Ok(found.filter(|(function, _)| {
            !hidden
                || matches!(
                    function.item.sig.inputs.first(),
                    Some(syn::FnArg::Receiver(own)) if !matches!(own.kind, syn::ReceiverKind::Reference(..))
                )
        }))
    }

    /// Whether a value has an inherent method of this name, which hides those of traits. If the
    /// type is a parameter, or `Self` of a trait, only those of traits exist.
    pub(super) fn is_hidden(&self, ty: &Type, name: &str) -> bool {
        let is_generic = |scope: &Rc<Scope>| match &scope.names {
            Names::Types(types) => !types.is_empty(),
            Names::SelfType(_, written) => written.is_none(),
            _ => false,
        };
        methods::is_inherent(ty, name) && !self.scope.enclosing_scopes().any(is_generic)
    }

    /// The user's method for a receiver of this type.
    fn trait_function(
        &mut self,
        receiver: &Receiver,
        (ty, symbol): (Type, Symbol),
        turbofish: &[Generic],
        at: TokenSpan,
    ) -> Result<Option<(Function, Value)>> {
        let value = receiver.value(self, at)?;
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

    /// The user's method that a path names by its trait, `Trait::method(x)`.
    pub(super) fn function_of_trait(
        &mut self,
        receiver: &Receiver,
        builtin: &Builtin,
        at: TokenSpan,
    ) -> Result<Option<(Function, Value)>> {
        let value = receiver.value(self, at)?;
        let ty = self.type_of(&value);
        let symbol = self.symbol_of(builtin.path.last().map_or("", String::as_str));
        if matches!(ty, Type::Unknown) {
            return Ok(None);
        }
        self.trait_function(receiver, (ty, symbol), &builtin.turbofish, at)
    }

    /// The implementations of a generic trait for one type, of which the arguments of a call select
    /// one: `impl From<A> for X` and `impl From<B> for X`. Only the function itself if the trait is
    /// not generic.
    pub(super) fn implementations_of_trait(&mut self, function: &Function) -> Vec<Function> {
        let Some((implementation, ty)) = &function.owner else { return Vec::new() };
        let generic = |implementation: &Implementation| {
            let last = implementation.of.as_ref()?.segments.last()?;
            matches!(last.arguments, syn::PathArguments::AngleBracketed(_)).then(|| last.ident.clone())
        };
        let Some(of) = generic(implementation) else { return Vec::new() };
        let symbol = self.symbol(&function.item.sig.ident);
        let mut several = Vec::new();
        for other in self.implementations.clone() {
            if let Some(item) = other.functions.get(&symbol)
                && generic(&other).is_some_and(|name| name == of)
                && self.matching_impl_scope(&other, ty).is_some()
            {
                several.push(Function {
                    item: item.clone(),
                    scope: other.scope.clone(),
                    turbofish: function.turbofish.clone(),
                    owner: Some((other.clone(), ty.clone())),
                });
            }
        }
        several
    }

    /// The only one of several functions that takes these arguments.
    pub(super) fn choose(
        &mut self,
        several: Vec<Function>,
        arguments: &[Value],
        at: TokenSpan,
    ) -> Result<Function> {
        let mut fitting = Vec::new();
        for function in several {
            if self.takes(&function, arguments) {
                fitting.push(function);
            }
        }
        match (fitting.pop(), fitting.is_empty()) {
            (Some(function), true) => Ok(function),
            _ => Err(error(
                at,
                "the macro cannot tell which implementation of the trait is meant: give the function another name",
            )),
        }
    }

    /// Whether the types of arguments match a function, as far as they are known.
    fn takes(&mut self, function: &Function, arguments: &[Value]) -> bool {
        let Some((implementation, ty)) = &function.owner else { return false };
        let Some(scope) = self.matching_impl_scope(implementation, ty) else { return false };
        let scope = Scope::child_scope(&scope, Names::SelfType(ty.clone(), implementation.self_type.clone()));
        let inputs = &function.item.sig.inputs;
        inputs.len() == arguments.len()
            && inputs.iter().zip(arguments).all(|(input, value)| match input {
                syn::FnArg::Receiver(_) => true,
                syn::FnArg::Typed(input) => {
                    let found = self.type_of(value);
                    self.unify(&input.ty, &found, &scope)
                }
            })
    }

    /// The result of `into` by the user's `From`, if it exists for the value and the expected type.
    pub(super) fn user_conversion(
        &mut self,
        receiver: &Receiver,
        expected: &Type,
        at: TokenSpan,
    ) -> Evaluated<Option<Value>> {
        let symbol = self.symbol_of("from");
        if !self.implementations.iter().any(|implementation| implementation.functions.contains_key(&symbol)) {
            return Ok(None);
        }
        let value = vec![receiver.value(self, at)?];
        let mut fitting = Vec::new();
        for implementation in self.implementations.clone() {
            let Some(item) = implementation.functions.get(&symbol) else { continue };
            if self.matching_impl_scope(&implementation, expected).is_none() {
                continue;
            }
            let function = Function {
                item: item.clone(),
                scope: implementation.scope.clone(),
                turbofish: Vec::new(),
                owner: Some((implementation.clone(), expected.clone())),
            };
            if self.takes(&function, &value) {
                fitting.push(function);
            }
        }
        match (expected, fitting.pop()) {
            (_, None) => Ok(None),
            (Type::Unknown, Some(_)) => Err(error(
                at,
                "the macro does not see what type `into` makes here: write `Type::from(..)`, or give the variable its type",
            )
            .into()),
            (_, Some(function)) => self.call_function(&function, Arguments::Values(value), expected, at).map(Some),
        }
    }

    /// The user's implementation of an operator.
    pub(super) fn user_operator(
        &mut self,
        operator: Operator,
        a: &Value,
        b: &Value,
        at: TokenSpan,
    ) -> Result<Option<Value>> {
        let (of, method) = operator.method();
        self.user_method(of, method, a, vec![b.clone()], at)
    }

    /// A method of a trait (or an inherent one of the same name) that the user implemented for `a`;
    /// of several implementations the one whose generic argument matches the first of the other
    /// arguments.
    pub(super) fn user_method(
        &mut self,
        of: &str,
        method: &str,
        a: &Value,
        arguments: Vec<Value>,
        at: TokenSpan,
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
            let Some(scope) = self.matching_impl_scope(implementation, &own) else { continue };
            let scope =
                Scope::child_scope(&scope, Names::SelfType(own.clone(), implementation.self_type.clone()));
            let right = match &last.arguments {
                syn::PathArguments::AngleBracketed(written) => {
                    written.args.iter().find_map(|argument| match argument {
                        syn::GenericArgument::Type(ty) => Some(ty.clone()),
                        _ => None,
                    })
                }
                _ => None,
            };
            let right = right.or_else(|| implementation.self_type.as_deref().cloned());
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
            return self.require_value(result, at).map(Some);
        }
        Ok(None)
    }
}
