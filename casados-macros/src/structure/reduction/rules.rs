//! Equations that define an unknown explicitly: `q̇ = v`, or `z = h(x)`.

use super::signature::{Offsets, Row};
use super::{times, variable_name};
use crate::graph::{Degree, Node, tangent};
use crate::language::Model;
use std::collections::{BTreeMap, BTreeSet};
use syn::{Error, Result};

/// Replacements of unknowns whose derivatives would be needed.
pub struct Rules {
    /// The expression for a variable `ẋ_j` or `z_k`, in variables without a rule.
    pub rates: BTreeMap<u32, Node>,
    /// The equations of the rules.
    pub equations: BTreeSet<usize>,
}

/// The rules of all states with more than one derivative, and of algebraic states with any.
pub fn find(model: &mut Model, rows: &[Row], offsets: &Offsets) -> Result<Rules> {
    let nx = model.variables.x.len();
    let mut rules = Rules { rates: BTreeMap::new(), equations: BTreeSet::new() };
    for (unknown, &highest) in offsets.unknowns.iter().enumerate() {
        let order = u32::from(unknown < nx);
        if highest <= order {
            continue;
        }
        let variable = if unknown < nx { unknown } else { nx + unknown } as u32;
        let gives = |row: &usize| {
            offsets.equations[*row] + order == highest && rows[*row].contains(&(unknown, order))
        };
        let matched = offsets.transversal[unknown];
        let mut candidates: Vec<usize> = (0..rows.len()).filter(gives).collect();
        candidates.sort_by_key(|&row| (rows[row].len(), row != matched));
        let mut rule = None;
        for row in candidates {
            if !rules.equations.contains(&row) {
                rule = explicit(model, row, variable).map(|expression| (row, expression));
            }
            if rule.is_some() {
                break;
            }
        }
        let Some((row, expression)) = rule else {
            return Err(not_explicit_error(model, variable, matched, highest - order));
        };
        rules.rates.insert(variable, expression);
        rules.equations.insert(row);
    }
    resolve(model, &mut rules.rates)?;
    Ok(rules)
}

/// `v = −f|_{v=0} / c`, if the equation is `c v + f|_{v=0} = 0` with a `c` that depends on
/// parameters and constants only.
fn explicit(model: &mut Model, row: usize, variable: u32) -> Option<Node> {
    let (equation, graph) = (model.residual[row], &mut model.graph);
    if graph.degrees(&[equation], |index| index == variable) != [Degree::Linear] {
        return None;
    }
    let one = graph.constant(1.0);
    let coefficient = tangent(graph, &[equation], |index| (index == variable).then_some(one))[0];
    let names = &model.variables;
    let parameters = (2 * names.x.len() + names.z.len() + names.u.len()) as u32;
    let parameters = parameters..parameters + names.p.len() as u32;
    if !graph.dependencies(&[coefficient])[0].iter().all(|index| parameters.contains(index)) {
        return None;
    }
    let zero = graph.constant(0.0);
    let rest = graph.substitute(&[equation], &BTreeMap::from([(variable, zero)]))[0];
    let rest = graph.unary(crate::graph::Unary::Neg, rest);
    Some(graph.binary(crate::graph::Binary::Div, rest, coefficient))
}

/// Resolves rules to variables without a rule.
fn resolve(model: &mut Model, rates: &mut BTreeMap<u32, Node>) -> Result<()> {
    for _ in 0..=rates.len() {
        let expressions: Vec<Node> = rates.values().copied().collect();
        let dependent = model.graph.dependencies(&expressions);
        if dependent.iter().flatten().all(|variable| !rates.contains_key(variable)) {
            return Ok(());
        }
        let expressions = model.graph.substitute(&expressions, rates);
        rates.values_mut().zip(expressions).for_each(|(rate, expression)| *rate = expression);
    }
    let names: Vec<String> = rates.keys().map(|&index| variable_name(&model.variables, index)).collect();
    let message = format!(
        "{} are given by equations that contain each other, and have to be differentiated: solve these equations for \
         them",
        names.join(", ")
    );
    Err(Error::new(model.name.span(), message))
}

fn not_explicit_error(model: &Model, unknown: u32, row: usize, missing: u32) -> Error {
    let algebraic = unknown as usize >= model.variables.x.len();
    let way_out = if algebraic && missing == 1 {
        "make it a state: then the differentiated equations give its derivative; or solve one of them for it, so that it \
         stands there with a constant factor"
    } else {
        "solve one of them for it, so that it stands there with a constant factor, as `xdot[0]` in `xdot[0] - x[2]`, or \
         differentiate the constraint by hand"
    };
    let message = format!(
        "{} must be differentiated {}, because equation {row} is, but no equation gives it explicitly: {way_out} \
         (equations are counted from 0)",
        variable_name(&model.variables, unknown),
        times(missing as usize)
    );
    Error::new(model.spans.get(row).copied().unwrap_or_else(|| model.name.span()), message)
}
