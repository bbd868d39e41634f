//! Numbers and functions as Rust text.

use crate::graph::{Binary, Unary};

/// The text of a number that is parsed to the same bits.
pub fn number_text(value: f64) -> String {
    if value.is_finite() {
        format!("{value:?}")
    } else if value.is_nan() {
        format!("f64::from_bits({:#x})", value.to_bits())
    } else if value > 0.0 {
        String::from("f64::INFINITY")
    } else {
        String::from("f64::NEG_INFINITY")
    }
}

/// The operator or the method of a function of two arguments.
pub fn binary_text(function: Binary) -> &'static str {
    match function {
        Binary::Add => "+",
        Binary::Sub => "-",
        Binary::Mul => "*",
        Binary::Div => "/",
        Binary::Powf => "powf",
        Binary::Atan2 => "atan2",
        Binary::Hypot => "hypot",
        Binary::Table(_) => "partial",
    }
}

/// The method of a function of one argument.
pub fn unary(function: Unary) -> &'static str {
    match function {
        Unary::Neg => "neg",
        Unary::Sqrt => "sqrt",
        Unary::Cbrt => "cbrt",
        Unary::Exp => "exp",
        Unary::Exp2 => "exp2",
        Unary::ExpM1 => "exp_m1",
        Unary::Ln => "ln",
        Unary::Ln1p => "ln_1p",
        Unary::Log2 => "log2",
        Unary::Log10 => "log10",
        Unary::Sin => "sin",
        Unary::Cos => "cos",
        Unary::Tan => "tan",
        Unary::Asin => "asin",
        Unary::Acos => "acos",
        Unary::Atan => "atan",
        Unary::Sinh => "sinh",
        Unary::Cosh => "cosh",
        Unary::Tanh => "tanh",
        Unary::Asinh => "asinh",
        Unary::Acosh => "acosh",
        Unary::Atanh => "atanh",
        Unary::Abs => "abs",
        Unary::Signum => "signum",
        Unary::Table(_) => "partial",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_bits() {
        let list =
            [0.0, -0.0, 0.1, -1.0 / 3.0, 1e300, 5e-324, f64::MIN_POSITIVE, f64::MAX, 1e22, 123456789.0];
        for value in list {
            let text = number_text(value);
            let expression: syn::Expr = syn::parse_str(&text).unwrap();
            let (sign, literal) = match &expression {
                syn::Expr::Unary(unary) => (-1.0, &*unary.expr),
                other => (1.0, other),
            };
            let syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Float(literal), .. }) = literal else {
                panic!("`{text}` is no number of floating point");
            };
            let read: f64 = sign * literal.base10_parse::<f64>().unwrap();
            assert_eq!(read.to_bits(), value.to_bits(), "{text}");
        }
        assert_eq!(number_text(f64::INFINITY), "f64::INFINITY");
        assert_eq!(number_text(f64::NEG_INFINITY), "f64::NEG_INFINITY");
        assert_eq!(number_text(f64::from_bits(0x7ff8_0000_0000_0001)), "f64::from_bits(0x7ff8000000000001)");
    }
}
