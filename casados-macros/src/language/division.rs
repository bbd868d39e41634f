//! Warns about `(1 / 2) as f64`, which is zero: a division of two integer literals with a
//! remainder, converted to a real number.

use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::quote;
use syn::Expr;
use syn::visit::{self, Visit};

/// Items that cause a compiler warning at each such division: on stable toolchains a macro can warn
/// only by the use of deprecated items.
pub fn warnings(item: &syn::Item) -> TokenStream {
    let mut divisions = LossyDivisions(Vec::new());
    divisions.visit_item(item);
    divisions.0.into_iter().map(warning).collect()
}

/// A division: its operator and its operands.
type LossyDivision = (Span, i128, i128);

fn warning((operator, a, b): LossyDivision) -> TokenStream {
    let quotient = a / b;
    let note =
        format!("`{a} / {b}` is a division of integers, whose value is {quotient}: write `{a}.0 / {b}.0`");
    let (name, note) = (Ident::new("integer_division", operator), Literal::string(&note));
    quote! {
        const _: () = {
            #[deprecated(note = #note)]
            #[allow(non_upper_case_globals)]
            const integer_division: () = ();
            #name
        };
    }
}

struct LossyDivisions(Vec<LossyDivision>);

impl<'ast> Visit<'ast> for LossyDivisions {
    fn visit_expr_cast(&mut self, cast: &'ast syn::ExprCast) {
        if let syn::Type::Path(ty) = &*cast.ty
            && ty.path.is_ident("f64")
            && let Expr::Binary(binary) = without_parentheses(&cast.expr)
            && let syn::BinOp::Div(operator) = &binary.op
            && let (Some(a), Some(b)) = (integer(&binary.left), integer(&binary.right))
            && a.checked_rem(b).is_some_and(|rest| rest != 0)
        {
            self.0.push((operator.spans[0], a, b));
        }
        visit::visit_expr_cast(self, cast);
    }
}

/// An expression without enclosing parentheses.
fn without_parentheses(expression: &Expr) -> &Expr {
    match expression {
        Expr::Paren(inner) => without_parentheses(&inner.expr),
        Expr::Group(inner) => without_parentheses(&inner.expr),
        other => other,
    }
}

/// The value of an integer literal.
fn integer(expression: &Expr) -> Option<i128> {
    match without_parentheses(expression) {
        Expr::Lit(syn::ExprLit { lit: syn::Lit::Int(literal), .. }) if !literal.suffix().starts_with('f') => {
            literal.base10_parse().ok()
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divisions_that_lose_a_remainder_are_found() {
        let of = |body: &str| {
            let item = syn::parse_str(&format!("fn m(x: f64) -> f64 {{ {body} }}")).unwrap();
            warnings(&item).to_string()
        };
        assert!(of("(1 / 2) as f64 * x").contains("whose value is 0: write `1.0 / 2.0`"));
        assert_eq!(of("x + { let a = ((7_u8) / 2) as f64; a }").matches("deprecated").count(), 1);
        for fine in
            ["(4 / 2) as f64", "1.0 / 2.0", "(1 / 2) as usize", "(1f64 / 2f64) as f64", "(1 / 0) as f64"]
        {
            assert_eq!(of(fine), "", "{fine}");
        }
        // No warning if the conversion is a separate statement, or for an index.
        assert_eq!(of("let half = 7 / 2; half as f64 + (0..3).map(|i| (i / 2) as f64).sum::<f64>()"), "");
    }
}
