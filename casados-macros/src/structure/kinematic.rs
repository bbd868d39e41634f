//! Kinematic states: `q` with an equation `q̇ − c v = 0`, where `v` is a state that is not
//! kinematic itself, a control or a parameter. Their derivatives follow from those of `v` at every
//! stage, so that the elimination condenses them: `casados_core::model::Kinematic`.

use super::Model;
use super::samples::{NewtonEntry, Term};
use crate::graph::{Degree, Entry};
use std::collections::BTreeMap;

/// A kinematic state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kinematic {
    /// The state `q`.
    pub state: u32,
    /// Its equation.
    pub equation: u32,
    /// The entry of the Jacobian that is `−c`.
    pub entry: u32,
    /// The variable `v`.
    pub velocity: u32,
    /// The entries of the Jacobian by which other equations depend on `q̇` and `q`.
    pub dependents: Vec<u32>,
}

/// The kinematic states, ascending: a maximum set.
pub fn find(model: &Model, (jacobian, blocks): (&[Entry], [usize; 6]), trivial: &[u32]) -> Vec<Kinematic> {
    let nx = model.variables.x.len() as u32;
    let mut candidates: BTreeMap<u32, Kinematic> = BTreeMap::new();
    for row in homogeneous(model, trivial) {
        let own = jacobian[..blocks[1]].iter().find(|entry| entry.0 == row);
        let unit = own.filter(|entry| model.graph.value(entry.2) == Some(1.0));
        let other = (blocks[1]..blocks[5]).find(|&entry| jacobian[entry].0 == row);
        let (Some(&(_, state, _)), Some(entry)) = (unit, other) else { continue };
        let velocity = jacobian[entry].1;
        if (blocks[2]..blocks[3]).contains(&entry) || velocity == nx + state {
            continue;
        }
        let of_state = |&entry: &u32| {
            let (other, variable, _) = jacobian[entry as usize];
            other != row && (variable == state || variable == nx + state)
        };
        let dependents = (0..blocks[2] as u32).filter(of_state).collect();
        candidates
            .insert(state, Kinematic { state, equation: row, entry: entry as u32, velocity, dependents });
    }
    independent(nx, candidates)
}

/// A largest set of candidates of which none is the velocity of another. Each has one velocity, so
/// that they are a forest except for cycles: a candidate that is no velocity of another is
/// selected, and its velocity is removed.
fn independent(nx: u32, mut candidates: BTreeMap<u32, Kinematic>) -> Vec<Kinematic> {
    let mut taken = BTreeMap::new();
    while let Some(&first) = candidates.keys().next() {
        let is_velocity = |state: &u32| candidates.values().any(|other| other.velocity == nx + state);
        let state = candidates.keys().copied().find(|state| !is_velocity(state)).unwrap_or(first);
        if let Some(kinematic) = candidates.remove(&state) {
            candidates.remove(&kinematic.velocity.wrapping_sub(nx));
            // In a cycle every candidate is a velocity.
            candidates.retain(|_, other| other.velocity != nx + state);
            taken.insert(state, kinematic);
        }
    }
    taken.into_values().collect()
}

/// The Newton matrix without the equations and the derivatives of kinematic states: by
/// `k_q = c (x_v + hA k_v)` the column of `q`, multiplied by `c hA`, is added to that of `v`.
pub fn condense(nx: u32, kinematic: &[Kinematic], positions: Vec<NewtonEntry>) -> Vec<NewtonEntry> {
    let mut left: BTreeMap<(u32, u32), NewtonEntry> = BTreeMap::new();
    for NewtonEntry { row, column, terms } in positions {
        if kinematic.iter().any(|of| of.equation == row) {
            continue;
        }
        let (column, terms) = match kinematic.iter().find(|of| of.state == column) {
            Some(of) if of.velocity >= 2 * nx => continue,
            Some(of) => {
                let through = |term: Term| Term { by: Some(of.entry), order: term.order + 1, ..term };
                (of.velocity - nx, terms.into_iter().map(through).collect())
            }
            None => (column, terms),
        };
        let position = left.entry((row, column)).or_insert(NewtonEntry { row, column, terms: Vec::new() });
        position.terms.extend(terms);
        position.terms.sort_by_key(|term| (term.order, term.by, term.entry));
    }
    left.into_values().collect()
}

/// The trivial rows of the form `c ẋ + c′ v`, without a function of time or a constant.
fn homogeneous(model: &Model, trivial: &[u32]) -> Vec<u32> {
    let Model { graph, residual, variables, .. } = model;
    let [x, z, u, p] = [&variables.x, &variables.z, &variables.u, &variables.p].map(|names| names.len());
    let time = 2 * x + z + u + p;
    // Constants from outside and tables may have any value: with all variables zero, the rest of
    // the equation has to be zero for all of them.
    let mut at_zero = graph.clone();
    let zero = at_zero.constant(0.0);
    let by = (0..=time as u32).map(|variable| (variable, zero)).collect();
    let rest = at_zero.substitute(residual, &by);
    let vanishes = |row: u32| at_zero.value(rest[row as usize]) == Some(0.0);
    let degrees = graph.degrees(residual, |variable| variable as usize == time);
    let is_homogeneous = |&row: &u32| vanishes(row) && degrees[row as usize] == Degree::Constant;
    trivial.iter().copied().filter(is_homogeneous).collect()
}
