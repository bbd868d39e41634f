//! Index reduction: constraints are differentiated in time until the model has index 1.
//!
//! [`signature`] determines the number of differentiations of each equation. Equations that define
//! a derivative explicitly, as `q̇ = v`, are [`rules`]: they are not differentiated, since `d/dt`
//! of a function of `q` contains `v` instead of `q̇`. The others are constraints `g(x, p, t) = 0`.
//! Each is replaced by its highest derivative ([`constraints`]); all states remain, and the lower
//! derivatives are the invariants. [`rank`] tests the result at sample points.
//!
//! With the rates `r_m` of Baumgarte's stabilisation a constraint is replaced by
//! `Π_m (d/dt + r_m) g` (J. Baumgarte, Stabilization of constraints and integrals of motion in
//! dynamical systems, 1972).

mod constraints;
mod projection;
pub mod rank;
mod rules;
mod signature;

use crate::graph::Node;
use crate::language::{Model, Rates, Variables};
use crate::structure::index::{self, MatchingErrorText};
use constraints::Constraint;
use quote::format_ident;

/// The result of the index reduction of a model.
pub struct ReducedModel {
    /// The differentiated equations, with the number of differentiations.
    pub differentiated: Vec<(u32, u32)>,
    /// The rates of Baumgarte's stabilisation, for as many derivatives as exist.
    pub rates: Vec<f64>,
    /// Constraints and their lower derivatives, equation by equation, as a function of the model's
    /// variables.
    pub invariants: Model,
    /// The equations of the projection onto the invariants, if requested.
    pub projection: Option<Model>,
}

/// Reduces the index if requested and necessary.
pub fn reduce(model: &mut Model) -> syn::Result<Option<ReducedModel>> {
    let Some(reduction) = model.reduction.clone() else { return Ok(None) };
    let rows = signature(model);
    let Some(offsets) = signature::offsets(&rows) else { return Err(undetermined_error(model, &rows)) };
    if offsets.equations.iter().all(|&times| times == 0) {
        return Ok(None);
    }
    let rules = rules::find(model, &rows, &offsets)?;
    let mut constraints = Vec::new();
    for (equation, &times) in offsets.equations.iter().enumerate() {
        if times > 0 && !rules.equations.contains(&equation) {
            constraints.push(constraints::differentiate(model, &rules.rates, equation, times)?);
        }
    }
    let most = constraints.iter().map(Constraint::differentiation_count).max().unwrap_or(0);
    let rates = match reduction.rates {
        Rates::None => Vec::new(),
        Rates::All(rate) => vec![rate; most],
        Rates::Each(rates) if rates.len() == most => rates,
        Rates::Each(rates) => {
            let message = format!(
                "a constraint is differentiated {}, but there {} of decay: one for each derivative, or one for all",
                times(most),
                if rates.len() == 1 { "is 1 rate".into() } else { format!("are {} rates", rates.len()) },
            );
            return Err(syn::Error::new(reduction.span, message));
        }
    };
    for constraint in &constraints {
        model.residual[constraint.equation] = constraint.stabilised(&mut model.graph, &rates);
    }
    let differentiated = constraints
        .iter()
        .map(|constraint| (constraint.equation as u32, constraint.differentiation_count() as u32))
        .collect();
    let invariants = invariants(model, &constraints);
    let projection = reduction.projection.then(|| projection::of(&invariants));
    Ok(Some(ReducedModel { differentiated, rates, invariants, projection }))
}

/// `once`, `twice`, `3 times`
pub fn times(count: usize) -> String {
    match count {
        1 => "once".into(),
        2 => "twice".into(),
        _ => format!("{count} times"),
    }
}

/// The signature matrix with the unknowns `(x, z)`.
fn signature(model: &Model) -> Vec<signature::Row> {
    let (nx, nz) = (model.variables.x.len() as u32, model.variables.z.len() as u32);
    let row = |variables: Vec<u32>| {
        let mut row = Vec::new();
        for unknown in 0..nx + nz {
            let order = match unknown {
                state if state < nx && variables.binary_search(&state).is_ok() => Some(1),
                _ => variables.binary_search(&(nx + unknown)).ok().map(|_| 0),
            };
            row.extend(order.map(|order| (unknown as usize, order)));
        }
        row
    };
    model.graph.dependencies(&model.residual).into_iter().map(row).collect()
}

/// The error about equations that leave unknowns undetermined after any number of differentiations.
fn undetermined_error(model: &Model, rows: &[signature::Row]) -> syn::Error {
    let nx = model.variables.x.len();
    let pattern: Vec<Vec<usize>> = rows.iter().map(|row| row.iter().map(|entry| entry.0).collect()).collect();
    let words = MatchingErrorText {
        name: &|unknown| match model.variables.x.get(unknown) {
            Some(name) => format!("`{name}`"),
            None => format!("`{}`", model.variables.z[unknown - nx]),
        },
        nothing: "no state",
        conclusion: "the model is singular: no derivatives of these equations determine all states. Remove redundant \
                     equations and add the missing ones",
    };
    let other = || syn::Error::new(model.name.span(), words.conclusion);
    index::matching(model, &pattern, &words).err().unwrap_or_else(other)
}

/// The name of a variable `(ẋ, x, z, u, p, t)`.
fn variable_name(names: &Variables, index: u32) -> String {
    let Variables { x, z, u, p } = names;
    let mut index = index as usize;
    if let Some(name) = x.get(index) {
        return format!("the derivative of `{name}`");
    }
    index -= x.len();
    for block in [x, z, u, p] {
        if let Some(name) = block.get(index) {
            return format!("`{name}`");
        }
        index -= block.len();
    }
    "`t`".into()
}

/// The function of the invariants.
fn invariants(model: &Model, constraints: &[Constraint]) -> Model {
    let mut spans = Vec::new();
    let mut outputs: Vec<Node> = Vec::new();
    for constraint in constraints {
        for level in &constraint.levels[..constraint.differentiation_count()] {
            outputs.push(*level);
            spans.extend(model.spans.get(constraint.equation));
        }
    }
    let name = &model.name;
    let text = format!(
        " Constraints of [`{name}`] and their derivatives, as its equations have them: invariants, zero on every \
         solution."
    );
    Model {
        name: format_ident!("{name}Invariants"),
        visibility: model.visibility.clone(),
        documentation: vec![syn::parse_quote!(#[doc = #text])],
        instance: model.instance.clone(),
        variables: model.variables.clone(),
        units: model.units.clone(),
        samplings: Vec::new(),
        reduction: None,
        duration: None,
        extra: crate::language::Extra::default(),
        is_model: false,
        graph: model.graph.clone(),
        residual: outputs,
        spans,
        opaque: model.opaque.clone(),
        tables: model.tables.clone(),
        uses: model.uses.clone(),
        krate: model.krate.clone(),
    }
}
