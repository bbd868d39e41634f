//! States such as `q` in `q̇ = v`, which follow another one in every iteration of Newton's method: `casados_core::model::Follower`.

use super::elimination::Plan;
use super::{Model, Position};
use crate::graph::{Degree, Entry, Point};
use std::collections::HashMap;

/// A state that follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Follower {
    /// The entry of the Jacobian by which it follows.
    pub entry: u32,
    /// Where in the entries by column those of its `f_x` begin,
    pub first: u32,
    /// and end.
    pub end: u32,
    /// Whether another pivot has a block of `U` in its column.
    pub asked: bool,
    /// Whether its column goes into that of whom it follows where the elimination leaves it out: nobody asks for it, and whom it follows nobody
    /// else has gone into before. (Of controls and parameters there is no column.)
    pub absorbed: bool,
}

/// What a block of the matrix without states that are [absorbed](Follower::absorbed) is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Led {
    /// The block.
    pub block: u32,
    /// The entries of `f_ẋ` or `f_z`, and of `f_x`.
    pub own: [Option<u32>; 2],
    /// What its column has from one that has gone into it.
    pub through: Option<Through>,
}

/// `c (diag(direct) + h diag(state) A) hA`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Through {
    /// The entry that is `−c`.
    pub by: u32,
    /// The entries of `f_ẋ` and `f_x` of the state that has gone.
    pub of: [Option<u32>; 2],
}

/// For each state whether it follows. Nothing may be subtracted from its equation by the pivots before its own. Who is followed does not follow.
pub fn find(
    model: &Model,
    (jacobian, blocks): (&[Entry], [usize; 6]),
    trivial: &[u32],
    plan: &Plan,
    identity: &[bool],
) -> Vec<Option<Follower>> {
    let nx = model.variables.x.len() as u32;
    let homogeneous = homogeneous(model, trivial);
    let lower: Vec<u32> = plan.ranges.iter().flat_map(|&[block, upper, _]| block + 1..upper).collect();
    let upper: Vec<u32> = plan.ranges.iter().flat_map(|&[_, upper, end]| upper..end).collect();
    let is_free = |row: u32| lower.iter().all(|&block| plan.blocks[block as usize].0 != row);
    let is_asked = |column: u32| upper.iter().any(|&block| plan.blocks[block as usize].1 == column);
    let place =
        |variable: u32| jacobian[blocks[1]..].iter().filter(|entry| entry.1 < variable).count() as u32;
    let mut followers = vec![None; nx as usize];
    let (mut leads, mut absorbs) = (vec![false; nx as usize], vec![false; nx as usize]);
    for (&(row, column), &identity) in plan.pivots.iter().zip(identity) {
        let is_trivial = identity && homogeneous.contains(&row) && is_free(row);
        if column >= nx || !is_trivial || leads[column as usize] {
            continue;
        }
        // What its equation consists of beside the derivative: a state, a control or a parameter.
        let mut others = (blocks[1]..blocks[5]).filter(|&entry| jacobian[entry].0 == row);
        let Some(entry) = others.next().filter(|entry| !(blocks[2]..blocks[3]).contains(entry)) else {
            continue;
        };
        let leader = jacobian[entry].1 - nx;
        let asked = is_asked(column);
        let mut absorbed = !asked;
        if leader < nx {
            if leader == column || followers[leader as usize].is_some() {
                continue;
            }
            leads[leader as usize] = true;
            absorbed &= !std::mem::replace(&mut absorbs[leader as usize], !asked);
        }
        let [entry, first, end] = [entry as u32, place(nx + column), place(nx + column + 1)];
        followers[column as usize] = Some(Follower { entry, first, end, asked, absorbed });
    }
    followers
}

/// The blocks that are left where absorbed states are not in the matrix. Their `Δk = c hA Δk_v` is part of what multiplies whom they follow.
pub fn led(
    nx: u32,
    jacobian: &[Entry],
    plan: &Plan,
    positions: &[Position],
    followers: &[Option<Follower>],
) -> Vec<Led> {
    let absorbed = |slot: u32| {
        followers.get(slot as usize).copied().flatten().filter(|follower: &Follower| follower.absorbed)
    };
    let places: HashMap<_, _> =
        positions.iter().map(|position| ((position.row, position.column), position)).collect();
    let absorbs: HashMap<u32, (u32, Follower)> = (0..nx)
        .filter_map(|state| absorbed(state).map(|by| (jacobian[by.entry as usize].1 - nx, (state, by))))
        .collect();
    let owned = plan.pivots.iter().zip(&plan.ranges).filter(|&(&(_, slot), _)| absorbed(slot).is_none());
    owned
        .flat_map(|(_, &[begin, _, end])| begin..end)
        .map(|block| {
            let (row, column) = plan.blocks[block as usize];
            let own = places.get(&(row, column));
            let through = absorbs.get(&column).and_then(|&(state, by)| {
                let of = places.get(&(row, state))?;
                Some(Through { by: by.entry, of: [of.direct, of.state] })
            });
            Led { block, own: [own.and_then(|own| own.direct), own.and_then(|own| own.state)], through }
        })
        .collect()
}

/// Of trivial rows those that are `c ẋ + c′ v`, without a function of time or a constant.
fn homogeneous(model: &Model, trivial: &[u32]) -> Vec<u32> {
    let Model { graph, residual, variables, opaque, .. } = model;
    let [x, z, u, p] = [&variables.x, &variables.z, &variables.u, &variables.p].map(|names| names.len());
    let time = 2 * x + z + u + p;
    // Constants that are not known here are anything.
    let (point, opaque) = (vec![0.0; time + 1], vec![0.75; opaque.len()]);
    let values = graph.evaluate(residual, Point { variables: &point, opaque: &opaque, seeds: &[] });
    let degrees = graph.degrees(residual, |variable| variable as usize == time);
    let is_homogeneous =
        |&row: &u32| values[row as usize] == 0.0 && degrees[row as usize] == Degree::Constant;
    trivial.iter().copied().filter(is_homogeneous).collect()
}
