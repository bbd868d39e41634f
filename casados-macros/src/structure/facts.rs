//! Facts that let the engine skip work: unused, constant and linear entries.

use crate::graph::{Degree, Entry, Graph, Node};
use std::collections::BTreeSet;

/// The facts of `casados_core::model::Structure` that are no derivatives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// The entries of `f_ẋ, f_x, f_z` do not depend on `(ẋ, x, z)`.
    pub linear_in_state: bool,
    /// Nor do they depend on `t`.
    pub constant_matrix: bool,
    /// Nothing depends on `t`.
    pub autonomous: bool,
    /// Equations whose entries in `f_ẋ, f_x, f_z` are constant.
    pub constant_rows: Vec<bool>,
    /// Equations `c ẋ_j + c′ v + c″(t) = 0`.
    pub trivial: Vec<u32>,
    /// States on which no equation depends.
    pub quadratures: Vec<u32>,
    /// Directions `(x₀, u, p)` on which an equation depends.
    pub directions: Vec<u32>,
    /// Nonlinear variables: those in the Hessian, except those of the next list.
    pub curved: Vec<u32>,
    /// Diagonal entries of a control or a parameter without other entries: the entry, and the
    /// direction.
    pub diagonal_controls: Vec<(u32, u32)>,
}

/// Derives the facts from the derivatives. `ends` are the ends of `ẋ, x, z, u, p` among the
/// variables.
pub fn find(
    graph: &Graph,
    residual: &[Node],
    (jacobian, blocks, constant): (&[Entry], [usize; 6], &[bool]),
    hessian: &[Entry],
    linear: &[bool],
    ends: [u32; 5],
) -> Facts {
    let [nx, end_x, end_z, _, time] = ends;
    let matrix: Vec<Node> = jacobian[..blocks[3]].iter().map(|entry| entry.2).collect();
    let independent = |set: &dyn Fn(u32) -> bool| {
        graph.degrees(&matrix, set).iter().all(|&degree| degree == Degree::Constant)
    };
    let mut constant_rows = vec![true; linear.len()];
    let mut terms = vec![(0, 0, true); linear.len()];
    for (entry, (&(row, variable, _), &constant)) in jacobian.iter().zip(constant).enumerate() {
        let (derivatives, others, all) = &mut terms[row as usize];
        *(if variable < nx { derivatives } else { others }) += 1;
        *all &= constant;
        constant_rows[row as usize] &= constant || entry >= blocks[3];
    }
    let trivial = |&(row, &(derivatives, others, constant)): &(u32, &(u32, u32, bool))| {
        linear[row as usize] && derivatives == 1 && others <= 1 && constant
    };
    let used: BTreeSet<u32> = jacobian.iter().map(|entry| entry.1).collect();
    // Directions are (x, u, p): the variables from x on, without z.
    let direction = |&variable: &u32| {
        let outside = (nx..end_x).contains(&variable) || variable >= end_z;
        outside.then(|| if variable < end_x { variable - nx } else { variable - end_z + nx })
    };
    let trivial: Vec<u32> = (0..).zip(&terms).filter(trivial).map(|(row, _)| row).collect();
    let curved = NonlinearVariables::find(hessian, ends);
    Facts {
        linear_in_state: independent(&|variable| variable < end_z),
        constant_matrix: independent(&|variable| variable < end_z || variable == time),
        autonomous: graph
            .degrees(residual, |variable| variable == time)
            .iter()
            .all(|&d| d == Degree::Constant),
        trivial,
        constant_rows,
        quadratures: (0..nx).filter(|state| !used.contains(&(state + nx))).collect(),
        directions: used.iter().filter_map(direction).collect(),
        curved: curved.variables.into_iter().collect(),
        diagonal_controls: curved.diagonal_controls,
    }
}

/// The variables with second derivatives.
struct NonlinearVariables {
    variables: BTreeSet<u32>,
    diagonal_controls: Vec<(u32, u32)>,
}

impl NonlinearVariables {
    fn find(hessian: &[Entry], ends: [u32; 5]) -> Self {
        let [nx, end_x, end_z, ..] = ends;
        let mut variables: BTreeSet<u32> = hessian.iter().flat_map(|entry| [entry.0, entry.1]).collect();
        // The diagonal entry, if it is the only one.
        let alone = |variable: u32| {
            let mut own = (0..).zip(hessian).filter(|(_, e)| e.0 == variable || e.1 == variable);
            let (index, entry) = own.next()?;
            (own.next().is_none() && entry.0 == entry.1).then_some(index)
        };
        let inputs: Vec<u32> = variables.range(end_z..).copied().collect();
        let mut diagonal_controls = Vec::new();
        for variable in inputs {
            if let Some(entry) = alone(variable) {
                variables.remove(&variable);
                diagonal_controls.push((entry, variable - end_z + end_x - nx));
            }
        }
        Self { variables, diagonal_controls }
    }
}
