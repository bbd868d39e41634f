//! Operators: arithmetic, comparisons, `&&` and `||`.

use super::arithmetic::{Comparison, Operator};
use super::evaluator::{Evaluated, Evaluator, unsupported};
use super::pattern::Truth;
use super::types::Type;
use super::value::{Integer, Value};
use syn::Expr;

impl Evaluator {
    /// Sums of many terms nest to the left: they are evaluated in a loop.
    pub(super) fn binary_expression(&mut self, binary: &syn::ExprBinary, expected: &Type) -> Evaluated {
        let mut spine = vec![binary];
        while let Expr::Binary(left) = &*spine[spine.len() - 1].left {
            if operator(&left.op).is_none() || operator(&spine[spine.len() - 1].op).is_none() {
                break;
            }
            spine.push(left);
        }
        let innermost = spine[spine.len() - 1];
        if operator(&innermost.op).is_none() {
            return self.comparison_or_assignment(innermost);
        }
        let expected = expected.scalar();
        let mut value = self.expression(&innermost.left, &expected)?;
        for binary in spine.into_iter().rev() {
            self.count_steps(1, binary)?;
            let operator = operator(&binary.op).unwrap_or(Operator::Add);
            let shift = matches!(operator, Operator::Shl | Operator::Shr);
            let hint = match (&value, &expected) {
                _ if shift => Type::Unknown,
                (Value::Integer(Integer { ty: Some(ty), .. }), _) => Type::Integer(*ty),
                _ => expected.clone(),
            };
            let right = self.expression(&binary.right, &hint)?;
            value = self.binary(operator, &value, &right, binary)?;
        }
        Ok(value)
    }

    /// Comparisons, `&&`, `||`, compound assignments.
    fn comparison_or_assignment(&mut self, binary: &syn::ExprBinary) -> Evaluated {
        if let Some(operator) = assignment_operator(&binary.op) {
            return self.compound_assignment(operator, binary);
        }
        let comparison = match &binary.op {
            syn::BinOp::And(_) | syn::BinOp::Or(_) => return self.logical(binary),
            syn::BinOp::Eq(_) => Comparison::Eq,
            syn::BinOp::Ne(_) => Comparison::Ne,
            syn::BinOp::Lt(_) => Comparison::Lt,
            syn::BinOp::Le(_) => Comparison::Le,
            syn::BinOp::Gt(_) => Comparison::Gt,
            syn::BinOp::Ge(_) => Comparison::Ge,
            _ => return Err(unsupported(binary, "this operator").into()),
        };
        let left = self.expression(&binary.left, &Type::Unknown)?;
        let hint = self.type_of(&left).scalar();
        let right = self.expression(&binary.right, &hint)?;
        Ok(self.compare(comparison, &left, &right, binary)?)
    }

    fn logical(&mut self, binary: &syn::ExprBinary) -> Evaluated {
        let and = matches!(binary.op, syn::BinOp::And(_));
        let left = self.expression(&binary.left, &Type::Bool)?;
        match self.truth(&left, &binary.left)? {
            Truth::Known(known) if known != and => Ok(Value::Bool(known)),
            Truth::Known(_) => {
                let right = self.expression(&binary.right, &Type::Bool)?;
                Ok(self.follow_value(right, &binary.right)?)
            }
            Truth::When(node) => {
                // The right side is executed depending on the left one, and so are its changes.
                let saved = self.scope.clone();
                let result = self.branch(|evaluator| evaluator.expression(&binary.right, &Type::Bool));
                self.scope = saved;
                let (right, changes) = result?;
                let right = self.follow_value(right, &binary.right)?;
                let taken = if and { node } else { self.graph.not(node) };
                self.merge(taken, changes, Vec::new(), binary)?;
                let left = Value::Condition(node);
                Ok(if and { self.and(&left, &right, binary)? } else { self.or(&left, &right, binary)? })
            }
        }
    }

    pub(super) fn unary_expression(&mut self, unary: &syn::ExprUnary, expected: &Type) -> Evaluated {
        match unary.op {
            syn::UnOp::Neg(_) => {
                let value = self.expression(&unary.expr, &expected.scalar())?;
                Ok(self.negate(&value, unary)?)
            }
            syn::UnOp::Not(_) => {
                let value = self.expression(&unary.expr, expected)?;
                Ok(self.invert(&value, unary)?)
            }
            syn::UnOp::Deref(_) => match self.expression(&unary.expr, expected)? {
                Value::Reference(place) => Ok(self.read(&place, unary)?),
                value => Ok(value),
            },
            _ => Err(unsupported(unary, "this operator").into()),
        }
    }
}

/// The operators that return numbers.
pub(super) fn operator(op: &syn::BinOp) -> Option<Operator> {
    Some(match op {
        syn::BinOp::Add(_) => Operator::Add,
        syn::BinOp::Sub(_) => Operator::Sub,
        syn::BinOp::Mul(_) => Operator::Mul,
        syn::BinOp::Div(_) => Operator::Div,
        syn::BinOp::Rem(_) => Operator::Rem,
        syn::BinOp::BitXor(_) => Operator::BitXor,
        syn::BinOp::BitAnd(_) => Operator::BitAnd,
        syn::BinOp::BitOr(_) => Operator::BitOr,
        syn::BinOp::Shl(_) => Operator::Shl,
        syn::BinOp::Shr(_) => Operator::Shr,
        _ => return None,
    })
}

fn assignment_operator(op: &syn::BinOp) -> Option<Operator> {
    Some(match op {
        syn::BinOp::AddAssign(_) => Operator::Add,
        syn::BinOp::SubAssign(_) => Operator::Sub,
        syn::BinOp::MulAssign(_) => Operator::Mul,
        syn::BinOp::DivAssign(_) => Operator::Div,
        syn::BinOp::RemAssign(_) => Operator::Rem,
        syn::BinOp::BitXorAssign(_) => Operator::BitXor,
        syn::BinOp::BitAndAssign(_) => Operator::BitAnd,
        syn::BinOp::BitOrAssign(_) => Operator::BitOr,
        syn::BinOp::ShlAssign(_) => Operator::Shl,
        syn::BinOp::ShrAssign(_) => Operator::Shr,
        _ => return None,
    })
}
