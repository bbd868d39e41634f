//! Time derivatives of a constraint.

use super::variable_name;
use crate::graph::{Binary, Graph, Node, tangent};
use crate::language::Model;
use std::collections::BTreeMap;
use syn::{Error, Result};

/// A constraint with its derivatives.
pub struct Constraint {
    /// Its equation.
    pub equation: usize,
    /// `g`, `dg/dt`, …; the last one replaces the equation.
    pub levels: Vec<Node>,
}

impl Constraint {
    /// The number of differentiations.
    pub fn differentiation_count(&self) -> usize {
        self.levels.len() - 1
    }

    /// `Π_m (d/dt + r_m) g`, with one rate for each differentiation.
    pub fn stabilised(&self, graph: &mut Graph, rates: &[f64]) -> Node {
        // The coefficients of the polynomial, the constant one first.
        let mut coefficients = vec![1.0];
        for rate in rates.iter().take(self.differentiation_count()) {
            let mut product = vec![0.0; coefficients.len() + 1];
            for (power, coefficient) in coefficients.iter().enumerate() {
                product[power] += rate * coefficient;
                product[power + 1] += coefficient;
            }
            coefficients = product;
        }
        let mut sum: Option<Node> = None;
        for (level, coefficient) in self.levels.iter().rev().zip(coefficients.iter().rev()) {
            let coefficient = graph.constant(*coefficient);
            let term = graph.binary(Binary::Mul, coefficient, *level);
            sum = Some(sum.map_or(term, |sum| graph.binary(Binary::Add, sum, term)));
        }
        sum.unwrap_or(self.levels[0])
    }
}

/// Differentiates the constraint of an equation.
///
/// # Errors
/// A control, a derivative or an algebraic state that would have to be differentiated.
pub fn differentiate(
    model: &mut Model,
    rates: &BTreeMap<u32, Node>,
    equation: usize,
    times: u32,
) -> Result<Constraint> {
    let names = &model.variables;
    let nx = names.x.len() as u32;
    let time = 2 * nx + (names.z.len() + names.u.len() + names.p.len()) as u32;
    let mut levels = model.graph.substitute(&[model.residual[equation]], rates);
    let one = model.graph.constant(1.0);
    let xdot: Vec<Node> = (0..nx)
        .map(|state| rates.get(&state).copied().unwrap_or_else(|| model.graph.variable(state)))
        .collect();
    let rate = |index: u32| match index {
        state if (nx..2 * nx).contains(&state) => Some(xdot[(state - nx) as usize]),
        other => (other == time).then_some(one),
    };
    for level in 0..times {
        let Some(&last) = levels.last() else { break };
        check(model, last, (equation, level))?;
        levels.push(tangent(&mut model.graph, &[last], rate)[0]);
    }
    Ok(Constraint { equation, levels })
}

/// Checks that a derivative that is differentiated once more depends on states, parameters and time
/// only.
fn check(model: &Model, level: Node, (equation, order): (usize, u32)) -> Result<()> {
    let names = &model.variables;
    let (nx, nz, nu) = (names.x.len() as u32, names.z.len() as u32, names.u.len() as u32);
    let depends = model.graph.dependencies(&[level]).swap_remove(0);
    let states = |index: &u32| (nx..2 * nx).contains(index) || *index >= 2 * nx + nz + nu;
    let Some(&culprit) = depends.iter().find(|index| !states(index)) else { return Ok(()) };
    let name = variable_name(names, culprit);
    let of = match order {
        0 => format!("equation {equation}"),
        1 => format!("the derivative of equation {equation}"),
        _ => format!("derivative {order} of equation {equation}"),
    };
    let way_out = if culprit >= 2 * nx + nz {
        "a control may jump: make it a state, with its rate as the control"
    } else {
        "solve the equations for what is differentiated, or differentiate the constraint by hand"
    };
    let message =
        format!("{of} must be differentiated but contains {name}; {way_out} (equations are counted from 0)");
    Err(Error::new(model.spans.get(equation).copied().unwrap_or_else(|| model.name.span()), message))
}
