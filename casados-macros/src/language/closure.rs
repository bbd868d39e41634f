//! Closures.

use super::environment::{Names, Scope};
use super::evaluator::{Evaluated, Evaluator, Target, TokenSpan, error, unsupported};
use super::items::Symbol;
use super::pattern::Subject;
use super::types::Type;
use super::value::{CallStack, Closure, Value};
use proc_macro2::{TokenStream, TokenTree};
use quote::ToTokens;
use std::cell::RefCell;
use std::rc::Rc;

/// The state saved during the execution of a function body.
pub(super) struct Body {
    pub scope: Rc<Scope>,
    pub calls: Option<Rc<CallStack>>,
    pub returns: Type,
    pub targets: Vec<(Option<String>, Target, usize)>,
    pub branches: usize,
}

impl Evaluator {
    pub(super) fn closure_expression(&mut self, closure: &syn::ExprClosure) -> Evaluated {
        if closure.asyncness.is_some() {
            return Err(unsupported(closure, "asynchronous code").into());
        }
        let scope = match &closure.capture {
            Some(_) => self.captured_scope(closure.body.to_token_stream()),
            None => self.scope.clone(),
        };
        let calls = self.calls.clone();
        Ok(Value::Closure(Rc::new(Closure { closure: Rc::new(closure.clone()), scope, calls })))
    }

    /// A scope with copies of the variables that occur in the tokens.
    fn captured_scope(&mut self, tokens: TokenStream) -> Rc<Scope> {
        let mut names = Vec::new();
        self.collect_mentioned(tokens, &mut names);
        let mut copies = Vec::new();
        for name in names {
            if copies.iter().all(|(known, _)| *known != name)
                && let Some(cell) = self.scope.variable(name)
            {
                let value = cell.borrow().clone();
                copies.push((name, Rc::new(RefCell::new(value))));
            }
        }
        Scope::child_scope(&self.scope, Names::Variables(copies))
    }

    fn collect_mentioned(&mut self, tokens: TokenStream, names: &mut Vec<Symbol>) {
        for token in tokens {
            match token {
                TokenTree::Ident(ident) => names.push(self.symbol(&ident)),
                TokenTree::Group(group) => self.collect_mentioned(group.stream(), names),
                _ => {}
            }
        }
    }

    pub(super) fn call_closure(
        &mut self,
        closure: &Rc<Closure>,
        arguments: Vec<Value>,
        expected: &Type,
        at: TokenSpan,
    ) -> Evaluated {
        let written = &closure.closure;
        if written.inputs.len() != arguments.len() {
            let (expected, found) = (written.inputs.len(), arguments.len());
            return Err(
                error(at, format!("this closure takes {expected} arguments, but {found} are given")).into()
            );
        }
        let returns = match &written.output {
            syn::ReturnType::Type(_, ty) => self.resolve(ty, &closure.scope)?,
            syn::ReturnType::Default => expected.clone(),
        };
        let value =
            self.execute(closure.scope.clone(), closure.calls.clone(), returns.clone(), |evaluator| {
                for (pattern, value) in written.inputs.iter().zip(arguments) {
                    let bindings = evaluator.bind(pattern, Subject::Value(value))?;
                    evaluator.declare(bindings);
                }
                evaluator.expression(&written.body, &returns)
            })?;
        Ok(self.coerce(value, &returns, at)?)
    }
}
