//! `index_reduction` in the brackets of `#[dae(...)]`: that equations may be differentiated in
//! time, and how what they say is held.
//!
//! - `index_reduction`: the constraints' highest derivatives take their place;
//! - `index_reduction(projection)`: the equations of the projection onto them are written, too;
//! - `index_reduction(baumgarte = 2.0)`, `index_reduction(baumgarte = [2.0, 1.0])`: what the
//!   constraints are off by decays with these rates.

use super::sampling::parse_number;
use proc_macro2::{Ident, Span};
use syn::parse::ParseStream;
use syn::spanned::Spanned;
use syn::{Error, Expr, Result, Token};

/// What the brackets of `index_reduction` can say.
const POSSIBLE: &str = "write `index_reduction`, `index_reduction(baumgarte = [2.0, 1.0])` with a decay rate for the \
    constraint and each of its derivatives, `index_reduction(baumgarte = 2.0)` with one rate, or \
    `index_reduction(projection)`";

/// How the index of a model is reduced.
#[derive(Clone, Debug)]
pub struct Reduction {
    /// Where it is asked for.
    pub span: Span,
    /// Rates of decay of errors of the constraints; none without stabilisation.
    pub rates: Rates,
    /// Whether states are to be projected.
    pub projection: bool,
}

/// Rates of decay of Baumgarte's stabilisation.
#[derive(Clone, Debug, PartialEq)]
pub enum Rates {
    /// Constraints are not stabilised.
    None,
    /// One for all derivatives.
    All(f64),
    /// One for each derivative.
    Each(Vec<f64>),
}

impl Reduction {
    /// Reads what follows the word.
    pub fn read(span: Span, input: ParseStream) -> Result<Self> {
        if !input.peek(syn::token::Paren) {
            if !input.is_empty() && !input.peek(Token![,]) {
                return Err(Error::new(input.span(), POSSIBLE));
            }
            return Ok(Self { span, rates: Rates::None, projection: false });
        }
        let content;
        syn::parenthesized!(content in input);
        let word: Ident = content.parse().map_err(|error| Error::new(error.span(), POSSIBLE))?;
        if word == "projection" && content.is_empty() {
            return Ok(Self { span, rates: Rates::None, projection: true });
        }
        if word != "baumgarte" {
            return Err(Error::new(word.span(), POSSIBLE));
        }
        content.parse::<Token![=]>().map_err(|error| Error::new(error.span(), POSSIBLE))?;
        let rates = match content.parse::<Expr>()? {
            Expr::Array(list) if list.elems.is_empty() => return Err(Error::new(list.span(), POSSIBLE)),
            Expr::Array(list) => Rates::Each(list.elems.iter().map(rate).collect::<Result<_>>()?),
            one => Rates::All(rate(&one)?),
        };
        content.parse::<Option<Token![,]>>()?;
        if !content.is_empty() {
            return Err(Error::new(content.span(), POSSIBLE));
        }
        Ok(Self { span, rates, projection: false })
    }
}

/// A rate of decay.
fn rate(value: &Expr) -> Result<f64> {
    let rate = parse_number(value)?;
    if rate > 0.0 {
        return Ok(rate);
    }
    let message = format!("the rate {rate:?} must be positive: take about the fastest rate of the motion");
    Err(Error::new(value.span(), message))
}
