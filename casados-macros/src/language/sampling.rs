//! Nominal values and ranges of variables, from the attribute.
//!
//! - `nominal(x = [0.0, 3.0], u = 10.0)`: a value for each number of an argument, or one for all;
//! - `range(x = [-1.0..=1.0, 0.0..=6.3], p = 0.5..=2.0)`: an interval for each, or one for all.

use super::Variables;
use super::mistakes::CollectedErrors;
use super::model::count_in_words;
use super::signature::Role;
use proc_macro2::{Ident, Span};
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{Error, Expr, Lit, RangeLimits, Result, Token, UnOp};

/// The nominal value and range of a variable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sampling {
    /// A typical value.
    pub nominal: Option<f64>,
    /// The range.
    pub range: Option<(f64, f64)>,
}

/// `nominal` or `range`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Nominal,
    Range,
}

impl Kind {
    /// The kind of a keyword.
    pub fn of(word: &Ident) -> Option<Self> {
        match word.to_string().as_str() {
            "nominal" => Some(Self::Nominal),
            "range" => Some(Self::Range),
            _ => None,
        }
    }
    fn name(self) -> &'static str {
        if self == Self::Nominal { "nominal" } else { "range" }
    }
}

/// One setting `x = [0.0, 3.0]`. A nominal value is an interval of one point.
pub(super) struct Setting {
    pub kind: Kind,
    name: Ident,
    role: Role,
    values: Values,
    span: Span,
}

enum Values {
    /// One for all numbers of the argument.
    All((f64, f64)),
    /// One for each.
    Each(Vec<(f64, f64)>),
}

impl Setting {
    /// Parses the settings after the keyword.
    pub fn list(kind: Kind, input: ParseStream) -> Result<Vec<Self>> {
        let pair = |input: ParseStream| -> Result<(Ident, Expr)> {
            let name = Ident::parse(input).map_err(|error| {
                Error::new(
                    error.span(),
                    "expected the name of an argument: `xdot`, `x`, `z`, `u`, `p` or `t`",
                )
            })?;
            input.parse::<Token![=]>()?;
            Ok((name, input.parse()?))
        };
        let mut mistakes = CollectedErrors::default();
        let mut settings = Vec::new();
        for (name, value) in Punctuated::<_, Token![,]>::parse_terminated_with(input, pair)? {
            match Self::new(kind, name, &value) {
                Ok(setting) => settings.push(setting),
                Err(error) => mistakes.note(error),
            }
        }
        mistakes.into_result()?;
        Ok(settings)
    }

    fn new(kind: Kind, name: Ident, value: &Expr) -> Result<Self> {
        let role = Role::of(&name).ok_or_else(|| {
            let message =
                format!("`{name}` is no argument of a model; they are `xdot`, `x`, `z`, `u`, `p` and `t`");
            Error::new(name.span(), message)
        })?;
        let values = match value {
            Expr::Array(list) => {
                Values::Each(list.elems.iter().map(|value| interval(kind, value)).collect::<Result<_>>()?)
            }
            one => Values::All(interval(kind, one)?),
        };
        Ok(Self { kind, name, role, values, span: value.span() })
    }

    /// The error if both set the same argument.
    pub fn duplicate_error(&self, other: &Self) -> Option<Error> {
        (self.kind == other.kind && self.role == other.role).then(|| {
            let message = format!("`{}` of `{}` is given twice", self.kind.name(), self.role.name());
            Error::new(self.name.span(), message)
        })
    }

    /// The source position.
    pub fn span(&self) -> Span {
        self.name.span()
    }
}

/// The nominal values and ranges of all variables `(ẋ, x, z, u, p, t)`.
pub(super) fn resolve(settings: &[Setting], variables: &Variables) -> Result<Vec<Sampling>> {
    let Variables { x, z, u, p } = variables;
    let time = [String::from("t")];
    let blocks = [
        (Role::Xdot, x.as_slice()),
        (Role::X, x),
        (Role::Z, z),
        (Role::U, u),
        (Role::P, p),
        (Role::T, &time),
    ];
    let mut samplings = Vec::new();
    let mut mistakes = CollectedErrors::default();
    for (role, names) in blocks {
        let begin = samplings.len();
        samplings.resize(begin + names.len(), Sampling::default());
        let samplings = &mut samplings[begin..];
        for setting in settings.iter().filter(|setting| setting.role == role) {
            if let Err(error) = setting.apply(names, samplings) {
                mistakes.note(error);
            }
        }
        for (name, sampling) in names.iter().zip(samplings) {
            if let Sampling { nominal: Some(nominal), range: Some((low, high)) } = *sampling
                && !(low..=high).contains(&nominal)
                && let Some(setting) = settings.iter().find(|s| s.role == role && s.kind == Kind::Nominal)
            {
                let of = if role == Role::Xdot { "the derivative of " } else { "" };
                let message = format!(
                    "the nominal value {nominal:?} of {of}`{name}` is outside of its range {low:?}..={high:?}"
                );
                mistakes.note(Error::new(setting.span, message));
                break;
            }
        }
    }
    mistakes.into_result()?;
    Ok(samplings)
}

impl Setting {
    /// Applies the setting to the variables of its argument.
    fn apply(&self, names: &[String], samplings: &mut [Sampling]) -> Result<()> {
        let name = self.role.name();
        if names.is_empty() {
            return Err(Error::new(self.name.span(), format!("the model has no argument `{name}`")));
        }
        let values = match &self.values {
            Values::All(value) => vec![*value; names.len()],
            Values::Each(values) => values.clone(),
        };
        if values.len() != names.len() {
            let message =
                format!("`{name}` has {}, but {} are given", count_in_words(names.len()), values.len());
            return Err(Error::new(self.span, message));
        }
        for (sampling, (low, high)) in samplings.iter_mut().zip(values) {
            match self.kind {
                Kind::Nominal => sampling.nominal = Some(low),
                Kind::Range => sampling.range = Some((low, high)),
            }
        }
        Ok(())
    }
}

/// One value, or both ends of a range.
fn interval(kind: Kind, value: &Expr) -> Result<(f64, f64)> {
    match (kind, value) {
        (_, Expr::Paren(inner)) => interval(kind, &inner.expr),
        (Kind::Nominal, value) => parse_number(value).map(|value| (value, value)),
        (Kind::Range, Expr::Range(range)) => {
            let (Some(low), Some(high), RangeLimits::Closed(_)) = (&range.start, &range.end, &range.limits)
            else {
                return Err(Error::new_spanned(range, "a range is written `low..=high`"));
            };
            let (low, high) = (parse_number(low)?, parse_number(high)?);
            if low > high {
                return Err(Error::new_spanned(
                    range,
                    "the range is empty: its start is larger than its end",
                ));
            }
            Ok((low, high))
        }
        (Kind::Range, other) => Err(Error::new(other.span(), "a range is written `low..=high`")),
    }
}

/// A literal, with or without a sign.
pub(super) fn parse_number(value: &Expr) -> Result<f64> {
    let literal = match value {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Float(number) => Some(number.base10_parse::<f64>()?),
            Lit::Int(number) => Some(number.base10_parse::<f64>()?),
            _ => None,
        },
        Expr::Paren(inner) => return parse_number(&inner.expr),
        Expr::Unary(unary) if matches!(unary.op, UnOp::Neg(_)) => Some(-parse_number(&unary.expr)?),
        _ => None,
    };
    match literal {
        Some(number) if number.is_finite() => Ok(number),
        Some(_) => Err(Error::new(value.span(), "this number is too large for an `f64`")),
        None => Err(Error::new(
            value.span(),
            "expected a number: the attribute is read before constants are known",
        )),
    }
}
