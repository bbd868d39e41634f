//! Active constraints of a solution. The recursion has them as springs, whose compliance is `∛ε`;
//! a step of the method of multipliers removes it.
//!
//! ```text
//! H v + cᵀ y + … = −q        c v + s = 0
//! (H + σ cᵀc) v₁ + σ s cᵀ + … = −q             y = σ (c v₁ + s)
//! (H + σ cᵀc) v₂ + σ s cᵀ + cᵀ y + … = −q
//! ```
//!
//! D. P. Bertsekas, *Constrained Optimization and Lagrange Multiplier Methods* (1982), section 2.2.

use super::kkt_direction::{KktDirection, RightHandSide};
use crate::linalg::{axpy, dot};
use crate::qp::element::{add, get, set};
use crate::qp::part;
use crate::scalar::Real;
use alloc::vec::Vec;

/// The active constraints.
#[derive(Clone, Debug, Default)]
pub(in crate::ocp) struct ActiveConstraints<T> {
    list: Vec<ActiveConstraint<T>>,
    /// Gradients of constraint rows over the padded variables of their stages.
    gradients: Vec<T>,
}

/// An active bound of a variable, or an active constraint row.
#[derive(Clone, Copy, Debug)]
struct ActiveConstraint<T> {
    stage: usize,
    stiffness: T,
    gradient: Gradient,
}

#[derive(Clone, Copy, Debug)]
enum Gradient {
    /// The unit vector of a variable.
    Variable(usize),
    /// The gradient of a row, which begins here among all gradients.
    Row { row: usize, begin: usize },
}

impl<T: Real> ActiveConstraints<T> {
    pub fn clear(&mut self) {
        self.list.clear();
        self.gradients.clear();
    }
    pub fn add_variable(&mut self, stage: usize, variable: usize, stiffness: T) {
        self.list.push(ActiveConstraint { stage, stiffness, gradient: Gradient::Variable(variable) });
    }
    /// Adds a row, whose gradient over `size` variables has these elements.
    pub fn add_row(
        &mut self,
        [stage, row]: [usize; 2],
        stiffness: T,
        size: usize,
        elements: impl Iterator<Item = (usize, T)>,
    ) {
        let begin = self.gradients.len();
        self.gradients.resize(begin + size, T::ZERO);
        elements.for_each(|(i, value)| set(&mut self.gradients, begin + i, value));
        self.list.push(ActiveConstraint { stage, stiffness, gradient: Gradient::Row { row, begin } });
    }

    /// Computes the multipliers `y = σ (c v + s)` at a direction.
    fn multipliers<R: RightHandSide<T>>(
        &self,
        right_hand_side: &R,
        direction: &KktDirection<T>,
        multipliers: &mut [T],
    ) {
        for (to, active) in multipliers.iter_mut().zip(&self.list) {
            let (x, u) = (direction.state(active.stage), direction.control(active.stage));
            let value = match active.gradient {
                Gradient::Variable(i) => i.checked_sub(x.len()).map_or(get(x, i), |control| get(u, control)),
                Gradient::Row { row, begin } => {
                    dot(part(&self.gradients, begin, x.len()), x)
                        + dot(part(&self.gradients, begin + x.len(), u.len()), u)
                        + right_hand_side.constraint_slope(active.stage, row)
                }
            };
            *to = active.stiffness * value;
        }
    }

    /// Returns `Σ s y` of all rows, with the derivatives `s` of rows by a parameter.
    pub fn product(&self, multipliers: &[T], slope: impl Fn(usize, usize) -> T) -> T {
        let terms = self.list.iter().zip(multipliers).map(|(active, &y)| match active.gradient {
            Gradient::Variable(_) => T::ZERO,
            Gradient::Row { row, .. } => slope(active.stage, row) * y,
        });
        terms.fold(T::ZERO, |sum, term| sum + term)
    }

    /// Writes the multipliers at a direction to it.
    pub fn write_multipliers<R: RightHandSide<T>>(
        &self,
        right_hand_side: &R,
        direction: &mut KktDirection<T>,
    ) {
        let mut multipliers = core::mem::take(&mut direction.constraint_multipliers);
        multipliers.resize(self.list.len(), T::ZERO);
        self.multipliers(right_hand_side, direction, &mut multipliers);
        direction.constraint_multipliers = multipliers;
    }

    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
}

/// A right-hand side with the forces `cᵀ y` of active constraints.
pub(super) struct WithForces<'a, T, R> {
    pub right_hand_side: &'a R,
    pub active: &'a ActiveConstraints<T>,
    pub multipliers: &'a [T],
}

impl<T: Real, R: RightHandSide<T>> RightHandSide<T> for WithForces<'_, T, R> {
    fn gradient(&self, k: usize, q: &mut [T]) {
        self.right_hand_side.gradient(k, q);
        // The list is in the order of the backward sweep.
        let first = self.active.list.partition_point(|active| active.stage > k);
        let of_stage = self.active.list.iter().zip(self.multipliers).skip(first);
        for (active, &y) in of_stage.take_while(|(active, _)| active.stage == k) {
            match active.gradient {
                Gradient::Variable(i) => add(q, i, y),
                Gradient::Row { begin, .. } => axpy(y, part(&self.active.gradients, begin, q.len()), q),
            }
        }
    }
    fn dynamics_constant(&self, k: usize) -> &[T] {
        self.right_hand_side.dynamics_constant(k)
    }
    fn constraint_slope(&self, stage: usize, row: usize) -> T {
        self.right_hand_side.constraint_slope(stage, row)
    }
}
