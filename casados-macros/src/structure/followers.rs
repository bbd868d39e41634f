//! States such as `q` in `q̇ = v`, which follow another one in every iteration of Newton's method: `casados_core::model::Follower`.

use super::Model;
use super::elimination::Plan;
use crate::graph::{Degree, Entry, Point};

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
    let (mut followers, mut leads) = (vec![None; nx as usize], vec![false; nx as usize]);
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
        if leader < nx {
            if leader == column || followers[leader as usize].is_some() {
                continue;
            }
            leads[leader as usize] = true;
        }
        let [entry, first, end] = [entry as u32, place(nx + column), place(nx + column + 1)];
        followers[column as usize] = Some(Follower { entry, first, end, asked: is_asked(column) });
    }
    followers
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
