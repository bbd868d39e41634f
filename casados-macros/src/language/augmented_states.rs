//! Augmented states: linear controls, `linear = u`, and integrals, `integrals(energy = u * u)`.
//!
//! ```text
//! ẋ = f(x, c, u, p, t)        ċ = r        q̇ = l(x, c, u, p, t)
//! ```
//!
//! The states become `(x, c, q)`, and the rate `r` of a linear control `c` replaces it among the
//! controls. A function with the arguments of the model has the same variables: there `u` is `c`,
//! and it may have the rates as an argument `du`, and the integrals as an argument `q`.

use super::model::count_in_words;
use super::polynomial_controls::{self, PolynomialControls};
use super::units::Units;
use super::{Model, Variables};
use crate::graph::{Binary, Node};
use proc_macro2::{Ident, Span, TokenStream};
use std::collections::BTreeMap;
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::{Error, Expr, FnArg, ItemFn, Pat, Result, Token};

/// The index of a missing rate.
const ABSENT_RATE: usize = u32::MAX as usize;

/// The linear controls, polynomial controls and integrals of a model's attribute.
#[derive(Clone, Default)]
pub struct AugmentedStates {
    /// The controls that are polynomials in every interval.
    pub polynomials: PolynomialControls,
    /// The names of linear controls, as written.
    pub linear: Vec<(String, Span)>,
    /// The integrals.
    pub integrals: Vec<Integral>,
}

/// An integral, with its integrand if the attribute is that of a model.
#[derive(Clone)]
pub struct Integral {
    pub name: Ident,
    rate: Option<Expr>,
}

/// The augmented states of a model.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Extra {
    /// The indices of linear controls, in the order of the states.
    pub linear: Vec<u32>,
    /// The number of integrals.
    pub integrals: usize,
    /// The degree of each control as written; empty without polynomial controls.
    pub degrees: Vec<u32>,
    /// Whether a function depends on the time other than by polynomial controls.
    pub is_timed: bool,
}

impl Parse for Integral {
    fn parse(input: ParseStream) -> Result<Self> {
        let name = input.parse()?;
        let rate = match input.parse::<Option<Token![=]>>()? {
            Some(_) => Some(input.parse()?),
            None => None,
        };
        Ok(Self { name, rate })
    }
}

/// The arguments of a model, without the underscores of unused ones.
fn arguments(model: &ItemFn) -> Punctuated<FnArg, Token![,]> {
    let mut inputs = model.sig.inputs.clone();
    for input in &mut inputs {
        if let FnArg::Typed(input) = input
            && let Pat::Ident(pattern) = &mut *input.pat
        {
            let name = pattern.ident.to_string();
            pattern.ident = Ident::new(name.trim_start_matches('_'), pattern.ident.span());
        }
    }
    inputs
}

/// Parses `u`, `u[1]`, `u.thrust`, or a list of these.
pub fn names(span: Span, value: &Expr) -> Vec<(String, Span)> {
    let text = |value: &Expr| {
        let tokens = quote::quote!(#value) as TokenStream;
        tokens.to_string().chars().filter(|c| !c.is_whitespace()).collect::<String>()
    };
    match value {
        Expr::Array(list) => list.elems.iter().map(|one| (text(one), span)).collect(),
        one => vec![(text(one), span)],
    }
}

/// The indices of the controls with a name: `u` denotes `u[0]`, `u[1]`, ….
pub fn indices_of_name(name: &str, span: Span, controls: &[String]) -> Result<Vec<u32>> {
    let is_denoted = |control: &String| {
        let rest = control.strip_prefix(name);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    let found: Vec<u32> = (0..).zip(controls).filter(|(_, c)| is_denoted(c)).map(|(i, _)| i).collect();
    if found.is_empty() {
        let known = match controls {
            [] => "it has none".to_owned(),
            names => format!("these are `{}`", names.join("`, `")),
        };
        return Err(Error::new(span, format!("`{name}` is no control of the model: {known}")));
    }
    Ok(found)
}

impl AugmentedStates {
    /// Whether there are no linear controls, polynomial controls and integrals.
    pub fn is_empty(&self) -> bool {
        self.linear.is_empty() && self.integrals.is_empty() && self.polynomials.is_empty()
    }

    /// These, or those of the module's model if there are none.
    pub fn or(&self, other: &Self) -> Self {
        if self.is_empty() { other.clone() } else { self.clone() }
    }

    /// The integrands as functions with the arguments of the model.
    pub fn integrands(&self, model: &ItemFn) -> Result<Vec<ItemFn>> {
        let function = |integral: &Integral| {
            let Integral { name, rate: Some(rate) } = integral else {
                let message =
                    format!("the integrand of `{0}` is missing: `integrals({0} = u * u)`", integral.name);
                return Err(Error::new(integral.name.span(), message));
            };
            let inputs = arguments(model);
            let generics = &model.sig.generics;
            syn::parse2(quote::quote!(fn #name #generics (#inputs) -> f64 { #rate }))
        };
        self.integrals.iter().map(function).collect()
    }

    /// The indices of the linear controls.
    fn linear(&self, controls: &[String]) -> Result<Vec<u32>> {
        let mut linear = Vec::new();
        for (name, span) in &self.linear {
            let found = indices_of_name(name, *span, controls)?;
            if found.iter().any(|control| linear.contains(control)) {
                return Err(Error::new(*span, format!("`{name}` is linear already")));
            }
            linear.extend(found);
        }
        linear.sort_unstable();
        Ok(linear)
    }

    /// Adds the states and the rates to a model or to a function of its variables. The variables of
    /// a function are followed, after the time, by its arguments `du` and `q` with these lengths.
    pub fn add_states(&self, model: &mut Model, rates: &[Node], [of_du, of_q]: [usize; 2]) -> Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        let Variables { x, z, u, p } = &model.variables;
        let linear = self.linear(u)?;
        let degrees = self.polynomials.degrees(u, &linear)?;
        let [nx, nz, nu, np, more] = [x.len(), z.len(), u.len(), p.len(), linear.len()];
        let integrals = self.integrals.len();
        let states = nx + more + integrals;
        let (of_u, graph) = (2 * nx + nz, &mut model.graph);
        let mut by = BTreeMap::new();
        let mut put = |graph: &mut crate::graph::Graph, from: usize, to: usize| {
            by.insert(from as u32, graph.variable(to as u32));
        };
        (0..nx).for_each(|i| put(graph, nx + i, states + i));
        (0..nz).for_each(|i| put(graph, 2 * nx + i, 2 * states + i));
        let after = 2 * states + nz;
        for control in 0..nu {
            let place = linear.iter().position(|&other| other as usize == control);
            put(graph, of_u + control, place.map_or(after + control, |place| states + nx + place));
            if control < of_du {
                let to = match degrees.get(control) {
                    _ if place.is_some() => after + control,
                    Some(1..) => polynomial_controls::RATES as usize + control,
                    _ => ABSENT_RATE,
                };
                put(graph, of_u + nu + np + 1 + control, to);
            }
        }
        (0..=np).for_each(|i| put(graph, of_u + nu + i, after + nu + i));
        (0..of_q).for_each(|i| put(graph, of_u + nu + np + 1 + of_du + i, states + nx + more + i));
        let is_model = !rates.is_empty() || model.is_model;
        let rates = graph.substitute(rates, &by);
        model.residual = graph.substitute(&model.residual, &by);
        let none = graph.variable(ABSENT_RATE as u32);
        if graph.reachable(&model.residual).contains(&none) {
            let message = "an element of `du` is the rate of a piecewise constant control: list this control in `linear = ..` or `degree(..)`";
            return Err(Error::new(model.name.span(), message));
        }
        if is_model {
            let of_linear = linear.iter().map(|&control| graph.variable((after + control as usize) as u32));
            let of_linear: Vec<Node> = of_linear.collect();
            for (i, rate) in of_linear.into_iter().chain(rates).enumerate() {
                let derivative = graph.variable((nx + i) as u32);
                model.residual.push(graph.binary(Binary::Sub, derivative, rate));
                model.spans.push(model.name.span());
            }
        }
        self.name(model, &linear);
        model.extra = Extra { linear, integrals, degrees, is_timed: false };
        Ok(())
    }

    /// Sets names and units.
    fn name(&self, model: &mut Model, linear: &[u32]) {
        let (Variables { x, u, .. }, Units { x: of_x, u: of_u, t, .. }) =
            (&mut model.variables, &mut model.units);
        let own = x.len();
        for &control in linear {
            let rate = format!("d{}", u[control as usize]);
            x.push(std::mem::replace(&mut u[control as usize], rate));
        }
        x.extend(self.integrals.iter().map(|integral| integral.name.to_string()));
        if !of_x.is_empty() || !of_u.is_empty() {
            of_x.resize(own, String::new());
            of_u.resize(u.len(), String::new());
            for &control in linear {
                let unit = of_u[control as usize].clone();
                let known = !unit.is_empty() && !t.is_empty();
                of_u[control as usize] = if known { format!("{unit}/{t}") } else { String::new() };
                of_x.push(unit);
            }
            of_x.resize(x.len(), String::new());
        }
    }

    /// Checks that the arguments `du` and `q` of a function have the lengths of rates and
    /// integrals.
    pub fn check(&self, function: &ItemFn, controls: usize, [of_du, of_q]: [usize; 2]) -> Result<()> {
        let name = &function.sig.ident;
        if of_du > 0 && self.linear.is_empty() && self.polynomials.is_empty() {
            let message = "`du` are rates of controls that are linear: say which ones, as in `linear = u`";
            return Err(Error::new(name.span(), message));
        }
        if of_du > 0 && of_du != controls {
            let message =
                format!("`du` has {} and `u` has {}", count_in_words(of_du), count_in_words(controls));
            return Err(Error::new(name.span(), message));
        }
        if of_q > 0 && of_q != self.integrals.len() {
            let message =
                format!("`q` has {}, and there are {} integrals", count_in_words(of_q), self.integrals.len());
            return Err(Error::new(name.span(), message));
        }
        Ok(())
    }
}
