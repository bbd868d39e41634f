//! `index_reduction` among the arguments of `#[dae(...)]`: index reduction, and the stabilisation
//! of the invariants.
//!
//! - `index_reduction`: each constraint is replaced by its highest derivative;
//! - `index_reduction(projection)`: also emits the equations of the projection onto the invariants;
//! - `index_reduction(baumgarte = 2.0)`, `index_reduction(baumgarte = [2.0, 1.0])`: Baumgarte's
//!   stabilisation, with these decay rates of the constraint errors.

use super::sampling::parse_number;
use proc_macro2::{Ident, Span};
use syn::parse::ParseStream;
use syn::spanned::Spanned;
use syn::{Error, Expr, Result, Token};

/// The possible arguments of `index_reduction`.
const POSSIBLE_ARGUMENTS: &str = "write `index_reduction`, `index_reduction(baumgarte = [2.0, 1.0])` with a decay rate for the \
    constraint and each of its derivatives, `index_reduction(baumgarte = 2.0)` with one rate, or \
    `index_reduction(projection)`";

/// The index reduction of a model.
#[derive(Clone, Debug)]
pub struct Reduction {
    /// The place of the argument.
    pub span: Span,
    /// Decay rates of constraint errors; none without stabilisation.
    pub rates: Rates,
    /// Whether the projection of states is emitted.
    pub projection: bool,
}

/// Decay rates of Baumgarte's stabilisation.
#[derive(Clone, Debug, PartialEq)]
pub enum Rates {
    /// No stabilisation.
    None,
    /// One rate for all derivatives.
    All(f64),
    /// One rate for each derivative.
    Each(Vec<f64>),
}

impl Reduction {
    /// Parses the arguments.
    pub fn read(span: Span, input: ParseStream) -> Result<Self> {
        if !input.peek(syn::token::Paren) {
            if !input.is_empty() && !input.peek(Token![,]) {
                return Err(Error::new(input.span(), POSSIBLE_ARGUMENTS));
            }
            return Ok(Self { span, rates: Rates::None, projection: false });
        }
        let content;
        syn::parenthesized!(content in input);
        let word: Ident = content.parse().map_err(|error| Error::new(error.span(), POSSIBLE_ARGUMENTS))?;
        if word == "projection" && content.is_empty() {
            return Ok(Self { span, rates: Rates::None, projection: true });
        }
        if word != "baumgarte" {
            return Err(Error::new(word.span(), POSSIBLE_ARGUMENTS));
        }
        content.parse::<Token![=]>().map_err(|error| Error::new(error.span(), POSSIBLE_ARGUMENTS))?;
        let rates = match content.parse::<Expr>()? {
            Expr::Array(list) if list.elems.is_empty() => {
                return Err(Error::new(list.span(), POSSIBLE_ARGUMENTS));
            }
            Expr::Array(list) => Rates::Each(list.elems.iter().map(rate).collect::<Result<_>>()?),
            one => Rates::All(rate(&one)?),
        };
        content.parse::<Option<Token![,]>>()?;
        if !content.is_empty() {
            return Err(Error::new(content.span(), POSSIBLE_ARGUMENTS));
        }
        Ok(Self { span, rates, projection: false })
    }
}

/// A decay rate.
fn rate(value: &Expr) -> Result<f64> {
    let rate = parse_number(value)?;
    if rate > 0.0 {
        return Ok(rate);
    }
    let message = format!("the rate {rate:?} must be positive: take about the fastest rate of the motion");
    Err(Error::new(value.span(), message))
}
