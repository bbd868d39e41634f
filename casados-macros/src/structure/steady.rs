//! States such as `q` in `q̇ = v`, whose right-hand sides in forward sensitivities are the same at all stages: `casados_core::model::Steady`.

use super::elimination::Plan;
use crate::graph::Entry;

/// For each of `nx` states, if it is such: the entry of the Jacobian that its right-hand sides are made of, and where in the entries by
/// column those of its `f_x` begin and end. Pivots are `scaled`: with fewer equations below them there is nothing to be gained.
pub fn find(
    nx: u32,
    (jacobian, blocks): (&[Entry], [usize; 6]),
    trivial: &[u32],
    plan: &Plan,
    scaled: &[bool],
) -> Vec<Option<[u32; 3]>> {
    // Nothing was subtracted from its own equation.
    let is_free = |row: u32| {
        let mut lower = plan.ranges.iter().flat_map(|&[block, upper, _]| block + 1..upper);
        lower.all(|block| plan.blocks[block as usize].0 != row)
    };
    let place =
        |variable: u32| jacobian[blocks[1]..].iter().filter(|entry| entry.1 < variable).count() as u32;
    let mut steady = vec![None; nx as usize];
    for (k, (&(row, column), &[block, upper, _])) in plan.pivots.iter().zip(&plan.ranges).enumerate() {
        let Some(to) = steady.get_mut(column as usize) else { continue };
        if !(scaled[k] && trivial.contains(&row) && is_free(row)) {
            continue;
        }
        // What its equation consists of beside the derivative: a state, a control or a parameter.
        let mut others = (blocks[1]..blocks[5]).filter(|&entry| jacobian[entry].0 == row);
        let Some(entry) = others.next().filter(|entry| !(blocks[2]..blocks[3]).contains(entry)) else {
            continue;
        };
        // All that is below its pivot feels the state.
        let variable = nx + column;
        let is_done = |row: u32| plan.pivots[..k].iter().any(|pivot| pivot.0 == row);
        let felt = jacobian[blocks[1]..blocks[2]].iter().filter(|entry| entry.1 == variable);
        let later = felt.filter(|entry| !is_done(entry.0)).count();
        if (upper - block - 1) as usize == later {
            *to = Some([entry as u32, place(variable), place(variable + 1)]);
        }
    }
    steady
}
