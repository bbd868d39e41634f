//! The arguments of `#[dae(...)]`, `#[ode(...)]` and `#[function(...)]`.
//!
//! - `NX = [9, 15]`, `NX = 1..=5`, `NX = 9`: the values of a const parameter for which models are
//!   generated;
//! - `(M, N) = [(1, 2), (3, 4)]`: values of several parameters;
//! - `name = Ident`: another name of the model's type;
//! - `crate = path`: the path of casados;
//! - `duration = p.duration`: the parameter that scales time;
//! - `linear = u.thrust`, `linear = [u[0], u[2]]`: piecewise linear controls;
//! - `degree(u.thrust = 2)`: polynomials in every interval, with jumps;
//! - `integrals(energy = u * u)`: integrals by name;
//! - `nominal(x = [0.0, 3.0])`, `range(x = -1.0..=1.0)`: nominal values and ranges;
//! - `index_reduction`, `index_reduction(baumgarte = [2.0, 1.0])`: index reduction.

use super::augmented_states::{self, AugmentedStates, Integral};
use super::duration::Duration;
use super::mistakes::CollectedErrors;
use super::polynomial_controls::PolynomialControl;
use super::reduction::Reduction;
use super::sampling::{self, Kind, Sampling, Setting};
use super::{Instance, Variables};
use proc_macro2::{Ident, Span, TokenStream};
use syn::parse::{Parse, ParseStream, Parser};
use syn::spanned::Spanned;
use syn::{Error, Expr, GenericParam, Generics, Lit, Result, Token};

/// The possible arguments of an attribute.
const POSSIBLE: &str = "the attribute takes values of const parameters (`N = [1, 2]`, `N = 1..=4`, \
    `(M, N) = [(1, 2), (3, 4)]`), `name = Type`, `crate = path`, `duration = p.duration`, `linear = u`, `degree(u = 1)`, `integrals(name = ..)`, `nominal(x = ..)`, \
    `range(x = ..)` and \
    `index_reduction`";

/// Maximum number of models in one attribute; more are considered a mistake.
const MAX_INSTANCES: usize = 1000;

/// The arguments of an attribute.
pub struct Arguments {
    /// The path of the crate, if given.
    pub krate: Option<syn::Path>,
    /// Another name of the model's type.
    pub name: Option<Ident>,
    /// The index reduction, if requested.
    pub reduction: Option<Reduction>,
    /// The parameter that scales time.
    pub duration: Option<Duration>,
    /// Linear controls and integrals.
    pub extension: AugmentedStates,
    /// Groups of const parameters with their joint values.
    values: Vec<Values>,
    /// Nominal values and ranges.
    settings: Vec<Setting>,
}

/// Const parameters and their joint values.
struct Values {
    names: Vec<Ident>,
    rows: Vec<Vec<u64>>,
}

impl Arguments {
    /// Parses the arguments.
    pub fn read(tokens: TokenStream) -> Result<Self> {
        let mut arguments = Self {
            krate: None,
            name: None,
            reduction: None,
            duration: None,
            extension: AugmentedStates::default(),
            values: Vec::new(),
            settings: Vec::new(),
        };
        let entries = syn::punctuated::Punctuated::<Entry, Token![,]>::parse_terminated.parse2(tokens)?;
        let mut mistakes = CollectedErrors::default();
        for entry in entries {
            match entry {
                Entry::Crate(span, path) => {
                    if arguments.krate.replace(path).is_some() {
                        mistakes.note(Error::new(span, "`crate` is given twice"));
                    }
                }
                Entry::Name(span, name) => {
                    if arguments.name.replace(name).is_some() {
                        mistakes.note(Error::new(span, "`name` is given twice"));
                    }
                }
                Entry::Reduction(reduction) => {
                    let span = reduction.span;
                    if arguments.reduction.replace(reduction).is_some() {
                        mistakes.note(Error::new(span, "`index_reduction` is given twice"));
                    }
                }
                Entry::Duration(duration) => {
                    let span = duration.span;
                    if arguments.duration.replace(duration).is_some() {
                        mistakes.note(Error::new(span, "`duration` is given twice"));
                    }
                }
                Entry::Linear(names) => arguments.extension.linear.extend(names),
                Entry::Degrees(controls) => arguments.extension.polynomials.list.extend(controls),
                Entry::Integrals(integrals) => {
                    for integral in integrals {
                        let name = &integral.name;
                        if arguments.extension.integrals.iter().any(|other| other.name == *name) {
                            mistakes.note(Error::new(name.span(), format!("`{name}` is given twice")));
                        }
                        arguments.extension.integrals.push(integral);
                    }
                }
                Entry::Values(values) => {
                    for name in &values.names {
                        if arguments.values.iter().any(|other| other.names.contains(name)) {
                            mistakes.note(Error::new(name.span(), format!("`{name}` is given twice")));
                        }
                    }
                    arguments.values.push(values);
                }
                Entry::Settings(settings) => {
                    for setting in settings {
                        let repeated =
                            arguments.settings.iter().find_map(|other| setting.duplicate_error(other));
                        repeated.into_iter().for_each(|error| mistakes.note(error));
                        arguments.settings.push(setting);
                    }
                }
            }
        }
        mistakes.into_result()?;
        Ok(arguments)
    }

    /// The path of the crate.
    pub fn path(&self) -> syn::Path {
        self.krate.clone().unwrap_or_else(|| syn::parse_quote!(::casados))
    }

    /// Rejects arguments for the model of a module in which every model has its own attribute.
    pub fn reject_model_arguments(&self, module: &Ident) -> Result<()> {
        let settings = self.name.is_some()
            || self.reduction.is_some()
            || self.duration.is_some()
            || !self.extension.is_empty();
        if settings || !self.values.is_empty() || !self.settings.is_empty() {
            return Err(Error::new(
                module.span(),
                "every model of this module has an attribute of its own: say there what belongs to it",
            ));
        }
        Ok(())
    }

    /// The nominal value and range of each of the variables `(ẋ, x, z, u, p, t)`.
    pub fn samplings(&self, variables: &Variables) -> Result<Vec<Sampling>> {
        sampling::resolve(&self.settings, variables)
    }

    /// Rejects nominal values and ranges of functions, which have no unknowns and no plan.
    pub fn reject_settings(&self, what: &str) -> Result<()> {
        let message = format!("nominal values and ranges have no effect for {what}: remove them");
        self.settings.first().map_or(Ok(()), |setting| Err(Error::new(setting.span(), message)))
    }

    /// The instances of a model: every combination of the values of the const parameters of
    /// `generics`; a single one without const parameters.
    pub fn instances(&self, generics: &Generics) -> Result<Vec<Vec<Instance>>> {
        let mut parameters = Vec::new();
        for parameter in &generics.params {
            match parameter {
                GenericParam::Const(parameter) => parameters.push(parameter),
                GenericParam::Lifetime(_) => {}
                GenericParam::Type(parameter) => {
                    return Err(Error::new_spanned(
                        parameter,
                        "a graph model is written with `f64` and has no type parameters; a dual model has exactly one, \
                         `T: DualNum + Copy`",
                    ));
                }
            }
        }
        let mut mistakes = CollectedErrors::default();
        for values in &self.values {
            for name in &values.names {
                if !parameters.iter().any(|parameter| parameter.ident == *name) {
                    mistakes.note(Error::new(
                        name.span(),
                        format!("the model has no const parameter `{name}`; {POSSIBLE}"),
                    ));
                }
            }
        }
        mistakes.into_result()?;
        let mut mistakes = CollectedErrors::default();
        for missing in parameters
            .iter()
            .filter(|parameter| !self.values.iter().any(|values| values.names.contains(&parameter.ident)))
        {
            mistakes.note(Error::new_spanned(
                missing,
                format!(
                    "no values for `{0}`: list them in the attribute, as in `{0} = [1, 2]`",
                    missing.ident
                ),
            ));
        }
        mistakes.into_result()?;
        let mut combinations: Vec<Vec<(&Ident, u64)>> = vec![Vec::new()];
        for values in &self.values {
            if combinations.len().saturating_mul(values.rows.len()) > MAX_INSTANCES {
                return Err(Error::new(
                    values.names[0].span(),
                    format!("these are more than {MAX_INSTANCES} models; list fewer values"),
                ));
            }
            combinations = combinations
                .iter()
                .flat_map(|prefix| {
                    values.rows.iter().map(move |row| {
                        let mut combination = prefix.clone();
                        combination.extend(values.names.iter().zip(row.iter().copied()));
                        combination
                    })
                })
                .collect();
        }
        Ok(combinations
            .into_iter()
            .map(|combination| {
                parameters
                    .iter()
                    .filter_map(|parameter| {
                        let (_, value) = combination.iter().find(|(name, _)| **name == parameter.ident)?;
                        Some(Instance {
                            name: parameter.ident.clone(),
                            ty: parameter.ty.clone(),
                            value: *value,
                        })
                    })
                    .collect()
            })
            .collect())
    }
}

/// One argument.
enum Entry {
    Crate(Span, syn::Path),
    Name(Span, Ident),
    Values(Values),
    Settings(Vec<Setting>),
    Reduction(Reduction),
    Duration(Duration),
    Linear(Vec<(String, Span)>),
    Degrees(Vec<PolynomialControl>),
    Integrals(Vec<Integral>),
}

impl Parse for Entry {
    fn parse(input: ParseStream) -> Result<Self> {
        let span = input.span();
        if input.peek(Token![crate]) {
            input.parse::<Token![crate]>()?;
            input.parse::<Token![=]>()?;
            return Ok(Self::Crate(span, input.call(syn::Path::parse_mod_style)?));
        }
        let names = if input.peek(syn::token::Paren) {
            let content;
            syn::parenthesized!(content in input);
            content.parse_terminated(Ident::parse, Token![,])?.into_iter().collect()
        } else {
            vec![input.parse::<Ident>().map_err(|_| Error::new(span, POSSIBLE))?]
        };
        if let [name] = &names[..]
            && let Some(kind) = Kind::of(name)
            && input.peek(syn::token::Paren)
        {
            let content;
            syn::parenthesized!(content in input);
            return Ok(Self::Settings(Setting::list(kind, &content)?));
        }
        if let [name] = &names[..]
            && name == "integrals"
            && input.peek(syn::token::Paren)
        {
            let content;
            syn::parenthesized!(content in input);
            let list = content.parse_terminated(Integral::parse, Token![,])?;
            return Ok(Self::Integrals(list.into_iter().collect()));
        }
        if let [name] = &names[..]
            && name == "degree"
            && input.peek(syn::token::Paren)
        {
            let content;
            syn::parenthesized!(content in input);
            let list = content.parse_terminated(PolynomialControl::parse, Token![,])?;
            return Ok(Self::Degrees(list.into_iter().collect()));
        }
        if let [name] = &names[..]
            && name == "index_reduction"
        {
            return Ok(Self::Reduction(Reduction::read(name.span(), input)?));
        }
        if names.is_empty() {
            return Err(Error::new(span, POSSIBLE));
        }
        if !input.peek(Token![=]) {
            return Err(Error::new(span, POSSIBLE));
        }
        input.parse::<Token![=]>()?;
        if names.len() == 1 && names[0] == "name" {
            return Ok(Self::Name(span, input.parse()?));
        }
        if names.len() == 1 && names[0] == "duration" {
            return Ok(Self::Duration(Duration::read(span, &input.parse()?)));
        }
        if names.len() == 1 && names[0] == "linear" {
            return Ok(Self::Linear(augmented_states::names(span, &input.parse()?)));
        }
        let rows = rows(&input.parse()?, names.len())?;
        if rows.is_empty() {
            return Err(Error::new(span, "the list of values is empty: no model would be made"));
        }
        for (i, row) in rows.iter().enumerate() {
            if rows[..i].contains(row) {
                let row = row.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
                return Err(Error::new(span, format!("the value {row} is listed twice")));
            }
        }
        Ok(Self::Values(Values { names, rows }))
    }
}

/// The values of a list or a range; each row has `width` of them.
fn rows(values: &Expr, width: usize) -> Result<Vec<Vec<u64>>> {
    match values {
        Expr::Array(list) => list.elems.iter().map(|row| self::row(row, width)).collect(),
        Expr::Range(range) if width == 1 => {
            let (Some(start), Some(end)) = (&range.start, &range.end) else {
                return Err(Error::new_spanned(range, "a range of values needs a start and an end"));
            };
            let (start, end) = (integer(start)?, integer(end)?);
            let end = match range.limits {
                syn::RangeLimits::HalfOpen(_) => end,
                syn::RangeLimits::Closed(_) => end.saturating_add(1),
            };
            if end.saturating_sub(start) > MAX_INSTANCES as u64 {
                return Err(Error::new_spanned(
                    range,
                    format!("these are more than {MAX_INSTANCES} models; list fewer values"),
                ));
            }
            Ok((start..end).map(|value| vec![value]).collect())
        }
        single => Ok(vec![row(single, width)?]),
    }
}

fn row(values: &Expr, width: usize) -> Result<Vec<u64>> {
    match values {
        Expr::Tuple(tuple) if width > 1 && tuple.elems.len() == width => {
            tuple.elems.iter().map(integer).collect()
        }
        single if width == 1 => Ok(vec![integer(single)?]),
        other => Err(Error::new(other.span(), format!("expected a tuple of {width} integers"))),
    }
}

fn integer(value: &Expr) -> Result<u64> {
    if let Expr::Lit(literal) = value
        && let Lit::Int(literal) = &literal.lit
    {
        return literal.base10_parse();
    }
    Err(Error::new(value.span(), format!("expected an integer literal; {POSSIBLE}")))
}
