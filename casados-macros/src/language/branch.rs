//! Branches: `if`, `match`, and jumps: `return`, `break`.

use super::evaluator::{Evaluated, Evaluator, Flow, Target, TokenSpan, error};
use super::methods::Receiver;
use super::pattern::{Subject, Truth};
use super::types::Type;
use super::value::Value;
use syn::{Expr, Result};

impl Evaluator {
    /// `if`: the branch taken for a known condition; otherwise a selection between both.
    pub(super) fn if_expression(&mut self, branch: &syn::ExprIf, expected: &Type) -> Evaluated {
        let saved = self.scope.clone();
        let truth = self.condition(&branch.cond);
        let truth = match truth {
            Ok(truth) => truth,
            Err(flow) => {
                self.scope = saved;
                return Err(flow);
            }
        };
        match truth {
            Truth::Known(true) => {
                let value = self.block(&branch.then_branch, expected);
                self.scope = saved;
                value
            }
            Truth::Known(false) => {
                self.scope = saved;
                match &branch.else_branch {
                    Some((_, otherwise)) => self.expression(otherwise, expected),
                    None => Ok(Value::unit()),
                }
            }
            Truth::When(node) => {
                let then = self.branch(|evaluator| evaluator.block(&branch.then_branch, expected));
                self.scope = saved;
                let (then, then_changes) = then?;
                let (otherwise, else_changes) = match &branch.else_branch {
                    Some((_, otherwise)) => {
                        self.branch(|evaluator| evaluator.expression(otherwise, expected))?
                    }
                    None => (Value::unit(), Vec::new()),
                };
                self.merge(node, then_changes, else_changes, &branch.cond)?;
                let at: TokenSpan = match (&branch.else_branch, branch.then_branch.stmts.last()) {
                    (Some(_), Some(last)) => last,
                    _ => &branch.cond,
                };
                Ok(self.select(node, &then, &otherwise, at)?)
            }
        }
    }

    /// The condition of `if` and `while`; variables declared by `let` in it enter the scope.
    pub(super) fn condition(&mut self, expression: &Expr) -> Evaluated<Truth> {
        match expression {
            Expr::Let(inner) => {
                let subject = match self.place(&inner.expr, false)? {
                    Receiver::Place(place) => Subject::Place(place, false),
                    Receiver::Value(value) => Subject::Value(value),
                };
                let mut bindings = Vec::new();
                let truth = self.matches(&inner.pat, subject, &mut bindings)?;
                if truth != Truth::Known(false) {
                    self.declare(bindings);
                }
                Ok(truth)
            }
            Expr::Binary(binary) if matches!(binary.op, syn::BinOp::And(_)) && has_let(expression) => {
                match self.condition(&binary.left)? {
                    Truth::Known(false) => Ok(Truth::Known(false)),
                    Truth::Known(true) => self.condition(&binary.right),
                    Truth::When(left) => Ok(match self.condition(&binary.right)? {
                        Truth::Known(true) => Truth::When(left),
                        Truth::Known(false) => Truth::Known(false),
                        Truth::When(right) => Truth::When(self.graph.and(left, right)),
                    }),
                }
            }
            _ => {
                let value = self.expression(expression, &Type::Bool)?;
                self.truth(&value, expression)
            }
        }
    }

    pub(super) fn match_expression(&mut self, choice: &syn::ExprMatch, expected: &Type) -> Evaluated {
        let subject = match self.place(&choice.expr, false)? {
            Receiver::Place(place) => Subject::Place(place, false),
            Receiver::Value(value) => Subject::Value(value),
        };
        self.match_arms(choice, &choice.arms, &subject, expected)
    }

    fn match_arms(
        &mut self,
        choice: &syn::ExprMatch,
        arms: &[syn::Arm],
        subject: &Subject,
        expected: &Type,
    ) -> Evaluated {
        let mut arms = arms;
        while let [arm, rest @ ..] = arms {
            arms = rest;
            let mut bindings = Vec::new();
            let mut truth = self.matches(&arm.pat, subject.clone(), &mut bindings)?;
            // The arms of a `match` are exhaustive: the last one is taken if no other matches.
            if rest.is_empty() && matches!(truth, Truth::When(_)) && !matches!(arm.pat, syn::Pat::Guard(_)) {
                truth = Truth::Known(true);
            }
            if truth == Truth::Known(false) {
                continue;
            }
            let saved = self.scope.clone();
            if let Truth::When(node) = truth {
                let then = self.branch(|evaluator| {
                    evaluator.declare(bindings);
                    evaluator.expression(&arm.body, expected)
                });
                self.scope = saved;
                let (then, then_changes) = then?;
                let (otherwise, else_changes) = self.branch(|evaluator| {
                    evaluator
                        .deeper(choice, |evaluator| evaluator.match_arms(choice, rest, subject, expected))
                })?;
                self.merge(node, then_changes, else_changes, arm)?;
                return Ok(self.select(node, &then, &otherwise, arm)?);
            }
            self.declare(bindings);
            let value = self.expression(&arm.body, expected);
            self.scope = saved;
            return value;
        }
        Err(error(&choice.expr, "no arm of this `match` is for this value").into())
    }

    pub(super) fn return_expression(&mut self, inner: &syn::ExprReturn) -> Evaluated {
        let expected = self.returns.clone();
        let value = match &inner.expr {
            Some(expression) => self.expression(expression, &expected)?,
            None => Value::unit(),
        };
        self.check_return(inner)?;
        Err(Flow::Return(value))
    }

    /// Rejects a `return` that depends on model variables.
    pub(super) fn check_return(&mut self, at: TokenSpan) -> Result<()> {
        if self.open_branch_count() > self.function_branches {
            return Err(error(
                at,
                "this early `return` depends on model variables: write the condition as `if ... { a } else { b }` with \
                 the value as its result",
            ));
        }
        Ok(())
    }

    pub(super) fn break_expression(&mut self, inner: &syn::ExprBreak) -> Evaluated {
        let value = match &inner.expr {
            Some(expression) => self.expression(expression, &Type::Unknown)?,
            None => Value::unit(),
        };
        let label = inner.label.as_ref().map(|label| label.ident.to_string());
        self.check_target(label, inner)?;
        Err(Flow::Break(inner.label.clone(), value))
    }

    /// Rejects a `break` or `continue` that depends on model variables.
    pub(super) fn check_target(&mut self, label: Option<String>, at: TokenSpan) -> Result<()> {
        let target = self.targets.iter().rev().find(|(name, target, _)| match &label {
            Some(_) => *name == label,
            None => *target == Target::Loop,
        });
        match target {
            None => Err(error(at, "there is no loop around this")),
            Some((.., branches)) if self.open_branch_count() > *branches => Err(error(
                at,
                "how often the loop runs depends on model variables: let it run a fixed number of times and \
                 choose the results by `if ... { a } else { b }`",
            )),
            Some(_) => Ok(()),
        }
    }
}

fn has_let(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) if matches!(binary.op, syn::BinOp::And(_)) => {
            has_let(&binary.left) || has_let(&binary.right)
        }
        _ => false,
    }
}
