//! The tables of `casados_core::model::Elimination` as data: `emit/elimination.rs` emits them. A
//! slot is an unknown and the equation that is its pivot.

use super::elimination::Plan;
use super::kinematic::Kinematic;
use super::samples::{NewtonEntry, Term};
use super::supernodes;
use std::collections::{HashMap, HashSet};

/// A row of each table, in the order of its fields.
pub struct Tables {
    pub pivots: Vec<Pivot>,
    /// For each block the slot at its other end.
    pub slots: Vec<u32>,
    /// The blocks of `L` with their slots, pivot by pivot.
    pub left: Vec<[u32; 2]>,
    pub updates: Vec<Update>,
    pub assembly: Vec<Assembly>,
    pub slot_of_equation: Vec<u32>,
    /// The first pivot of each supernode, and its number of pivots.
    pub supernodes: Vec<[u32; 2]>,
    /// For each state `(equation, entry, velocity)`; empty if no state is kinematic.
    pub kinematic: Vec<[u32; 3]>,
    pub dependents: Vec<KinematicDependence>,
}

/// `casados_core::model::Pivot`
pub struct Pivot {
    pub slot: u32,
    pub equation: u32,
    /// The offsets of its blocks and of those of `U`, and their end.
    pub range: [u32; 3],
    /// Its range of the table `left`.
    pub left: [u32; 2],
    pub identity: bool,
}

/// `casados_core::model::Update`; the block is empty before the `first` one.
pub struct Update {
    pub block: u32,
    pub first: bool,
}

/// `casados_core::model::Assembly`
pub struct Assembly {
    pub block: u32,
    pub term: Term,
    pub first: bool,
}

/// `casados_core::model::Dependent`
pub struct KinematicDependence {
    pub entry: u32,
    pub state: u32,
    pub first: bool,
    pub last: bool,
}

/// The tables of a plan for these numbers of equations and states.
pub fn of(
    plan: &Plan,
    positions: &[NewtonEntry],
    identity: &[bool],
    kinematic: &[Kinematic],
    [equations, nx]: [usize; 2],
) -> Tables {
    let mut slot_of_equation = vec![0; equations];
    let determined = kinematic.iter().map(|of| (of.equation, of.state)).chain(plan.pivots.iter().copied());
    for (equation, slot) in determined {
        slot_of_equation[equation as usize] = slot;
    }
    let slots = slots(plan, &slot_of_equation);
    let counts = supernodes::find(plan);
    let (pivots, left) = pivots(plan, &slots, identity);
    let positions: HashMap<_, _> =
        positions.iter().map(|position| ((position.row, position.column), position)).collect();
    Tables {
        pivots,
        left,
        supernodes: (0..).zip(&counts).filter(|of| *of.1 > 0).map(|(first, &count)| [first, count]).collect(),
        updates: updates(plan, &positions),
        assembly: assembly(plan, &positions),
        kinematic: rows_of_states(nx, kinematic),
        dependents: kinematic_dependences(kinematic),
        slots,
        slot_of_equation,
    }
}

/// For a block of `L` the slot of its equation, for a block of `U` that of its unknown.
fn slots(plan: &Plan, slot_of_equation: &[u32]) -> Vec<u32> {
    let slot = |index: u32, upper: u32| {
        let (equation, unknown) = plan.blocks[index as usize];
        if index < upper { slot_of_equation[equation as usize] } else { unknown }
    };
    let ranges = plan.ranges.iter();
    ranges.flat_map(|&[block, upper, end]| (block..end).map(move |index| slot(index, upper))).collect()
}

/// The pivots, and the blocks of `L` row by row.
fn pivots(plan: &Plan, slots: &[u32], identity: &[bool]) -> (Vec<Pivot>, Vec<[u32; 2]>) {
    let mut rows: HashMap<u32, Vec<[u32; 2]>> = HashMap::new();
    for (&(_, slot), &[block, upper, _]) in plan.pivots.iter().zip(&plan.ranges) {
        for block in block + 1..upper {
            rows.entry(slots[block as usize]).or_default().push([block, slot]);
        }
    }
    let (mut pivots, mut left) = (Vec::new(), Vec::new());
    for (index, (&(equation, slot), &range)) in plan.pivots.iter().zip(&plan.ranges).enumerate() {
        let begin = left.len() as u32;
        left.extend(rows.get(&slot).into_iter().flatten());
        let identity = identity[index];
        pivots.push(Pivot { slot, equation, range, left: [begin, left.len() as u32], identity });
    }
    (pivots, left)
}

/// The terms of the blocks, contiguous by kind, fill first, so that loops have no unpredictable
/// branches.
fn assembly(plan: &Plan, positions: &HashMap<(u32, u32), &NewtonEntry>) -> Vec<Assembly> {
    let mut rows = Vec::new();
    for (place, block) in plan.blocks.iter().zip(0u32..) {
        let terms = positions.get(place).map_or(&[][..], |position| &position.terms);
        if terms.is_empty() {
            rows.push((None, true, block));
        }
        rows.extend(terms.iter().enumerate().map(|(index, &term)| (Some(term), index == 0, block)));
    }
    rows.sort_by_key(|&(term, first, block)| {
        (term.map(|term| (term.order, term.by.is_some())), !first, block)
    });
    let none = Term { entry: u32::MAX, by: None, order: 0 };
    rows.into_iter()
        .map(|(term, first, block)| Assembly { block, term: term.unwrap_or(none), first })
        .collect()
}

/// For each update its block, and whether the block is empty before.
fn updates(plan: &Plan, positions: &HashMap<(u32, u32), &NewtonEntry>) -> Vec<Update> {
    let is_empty = |block: &u32| !positions.contains_key(&plan.blocks[*block as usize]);
    let mut empty: HashSet<u32> = (0..plan.blocks.len() as u32).filter(is_empty).collect();
    plan.updates.iter().map(|&block| Update { block, first: empty.remove(&block) }).collect()
}

/// A row for each state; none if no state is kinematic.
fn rows_of_states(nx: usize, kinematic: &[Kinematic]) -> Vec<[u32; 3]> {
    let states = 0..if kinematic.is_empty() { 0 } else { nx as u32 };
    let row = |state: u32| {
        let of = kinematic.iter().find(|of| of.state == state);
        of.map_or([u32::MAX; 3], |of| [of.equation, of.entry, of.velocity])
    };
    states.map(row).collect()
}

/// The entries by which other equations depend on kinematic states, ordered by velocity.
fn kinematic_dependences(kinematic: &[Kinematic]) -> Vec<KinematicDependence> {
    let of_state = |of: &Kinematic| {
        let (state, count) = (of.state, of.dependents.len());
        let row = move |(index, &entry): (usize, &u32)| KinematicDependence {
            entry,
            state,
            first: index == 0,
            last: index + 1 == count,
        };
        of.dependents.iter().enumerate().map(row).collect::<Vec<_>>()
    };
    let mut by_velocity: Vec<_> = kinematic.iter().collect();
    by_velocity.sort_by_key(|of| of.velocity);
    by_velocity.into_iter().flat_map(of_state).collect()
}
