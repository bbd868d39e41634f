//! The equations of the projection onto invariants `y(x, p, t)`.
//!
//! `F = (x − x̂ + Gᵀν, y)` as a function of `(x, ν, x̂, p, t)`, with `G = ∂y/∂x`: `ν` is stored as
//! `z` and `x̂` as `u`.

use crate::graph::{Binary, Node, gradient};
use crate::language::units::Units;
use crate::language::{Model, Variables};
use quote::format_ident;
use std::collections::BTreeMap;

/// The function `F` of the invariants.
pub fn of(invariants: &Model) -> Model {
    let Variables { x, z, u, p } = &invariants.variables;
    let count = invariants.residual.len();
    let mut graph = invariants.graph.clone();
    // Parameters and time have other indices among the variables.
    let (old, new) = (2 * x.len() + z.len() + u.len(), 2 * x.len() + count + x.len());
    let moved: BTreeMap<u32, Node> =
        (0..=p.len()).map(|index| ((old + index) as u32, graph.variable((new + index) as u32))).collect();
    let outputs = graph.substitute(&invariants.residual, &moved);
    let seeded: Vec<(Node, Node)> = outputs
        .iter()
        .enumerate()
        .map(|(index, &output)| (output, graph.variable((2 * x.len() + index) as u32)))
        .collect();
    let gradient = gradient(&mut graph, &seeded, 2 * x.len() as u32);
    let mut residual: Vec<Node> = (0..x.len())
        .map(|state| {
            let nearest = graph.variable((x.len() + state) as u32);
            let given = graph.variable((2 * x.len() + count + state) as u32);
            let change = graph.binary(Binary::Sub, nearest, given);
            graph.binary(Binary::Add, change, gradient[x.len() + state])
        })
        .collect();
    residual.extend(outputs);
    let text = " The equations of the projection onto the invariants.";
    let name = invariants.name.to_string();
    let name = name.strip_suffix("Invariants").unwrap_or(&name);
    Model {
        name: format_ident!("{name}Projection", span = invariants.name.span()),
        documentation: vec![syn::parse_quote!(#[doc = #text])],
        visibility: invariants.visibility.clone(),
        instance: invariants.instance.clone(),
        variables: Variables {
            x: x.clone(),
            z: (0..count).map(|index| format!("multiplier[{index}]")).collect(),
            u: x.iter().map(|name| format!("given {name}")).collect(),
            p: p.clone(),
        },
        units: Units::default(),
        samplings: Vec::new(),
        reduction: None,
        duration: None,
        extra: crate::language::Extra::default(),
        is_model: false,
        graph,
        residual,
        spans: Vec::new(),
        opaque: invariants.opaque.clone(),
        tables: invariants.tables.clone(),
        uses: invariants.uses.clone(),
        krate: invariants.krate.clone(),
    }
}
