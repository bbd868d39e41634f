//! States whose `dk` nobody solves for: it is [implied](crate::model::Steady::implied) by what is there.
//!
//! For `ẋ − c v = 0` with a state `v`
//!
//! ```text
//! dk_i = c (V_v + h Σ_l a_il dk_lv)        Σ_i w_i dk_i = c ((Σ_i w_i) V_v + h Σ_l (Σ_i w_i a_il) dk_lv)
//! ```
//!
//! with `V_v` at the start of the step; with a control or a parameter `c dv` at all stages. Only where numbers are registers: who asks for
//! single stages (dense output, integrals, refinement) has plain ones.

use super::directions::Directions;
use super::evaluate::entry;
use super::record::Coefficients;
use crate::linalg::{Arithmetic, Packet, implied, is_implied};
use crate::model::Dae;
use crate::scalar::Lanes;
use crate::shape::{Plain, Shape};

/// What an implied state follows.
#[derive(Clone, Copy)]
pub(super) struct Leader<E> {
    /// `−c`
    pub minus_c: E,
    /// The variable `v`.
    pub variable: usize,
}

impl<E> Leader<E> {
    /// The state that it is, if it is one.
    #[inline(always)]
    pub fn state<M: Dae>(&self) -> Option<usize> {
        let nx = M::Shape::NX;
        if self.variable < 2 * nx { self.variable.checked_sub(nx) } else { None }
    }
}

/// What an unknown follows, if it is implied.
#[inline(always)]
pub(super) fn leader<M: Dae, E: Plain, const S: usize>(
    jacobian: &M::Jacobian<[E; S]>,
    unknown: usize,
) -> Option<Leader<E>> {
    let (_, variable, values) = entry::<M, _>(jacobian, implied::<M, E, S>(unknown)?.entry as usize)?;
    Some(Leader { minus_c: *values.first()?, variable })
}

impl<E: Lanes> Leader<E> {
    /// `row + factor c V_v` of a state, in registers.
    #[inline(always)]
    pub fn add_state<A: Arithmetic, M: Dae, const W: usize>(
        &self,
        row: &mut [E; W],
        factor: E,
        v: &[[E; W]],
    ) {
        if let Some(v) = self.state::<M>().and_then(|state| v.get(state)) {
            A::subtract_row(row, factor * self.minus_c, v);
        }
    }

    /// `row + factor c dv` of a control or a parameter, in memory: which columns have any is found when the program runs.
    #[inline(always)]
    pub fn add_input<M: Dae, D: Directions<E>, const W: usize>(
        &self,
        row: &mut [E; W],
        factor: E,
        directions: &D,
        column: usize,
    ) {
        if self.state::<M>().is_none() {
            let index = self.variable - M::Shape::NX - M::Shape::NZ;
            directions.add(index, -(factor * self.minus_c), column, row);
        }
    }
}

/// Whether all unknowns are found.
pub(super) const fn is_found<M: Dae, E, const S: usize>() -> bool {
    let steady = M::STRUCTURE.elimination.steady;
    let mut index = 0;
    while index < steady.len() {
        if is_implied::<E, S>(&steady[index]) {
            return false;
        }
        index += 1;
    }
    true
}

/// Sums `Σ_i w_i dk_i` over the stages.
#[derive(Clone, Copy)]
pub(super) struct Weighted<'a, M: Dae, E: Plain, D, const S: usize> {
    /// `−w_i`
    minus_weights: [E; S],
    /// Those of unknowns that are implied, if these are not there.
    implied: Option<OfImplied<'a, M, E, D, S>>,
}

#[derive(Clone, Copy)]
struct OfImplied<'a, M: Dae, E: Plain, D, const S: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    directions: &'a D,
    /// `Σ_i w_i`
    total: E,
    /// `h Σ_i w_i a_il`
    lever: [E; S],
}

impl<'a, M: Dae, E: Lanes, D: Directions<E>, const S: usize> Weighted<'a, M, E, D, S> {
    /// All unknowns are there.
    #[inline(always)]
    pub fn of_all(weights: &[E; S]) -> Self {
        let mut minus_weights = *weights;
        for weight in &mut minus_weights {
            *weight = -*weight;
        }
        Self { minus_weights, implied: None }
    }

    /// `h b_i`, without unknowns that are implied.
    #[inline(always)]
    pub fn of_step(
        jacobian: &'a M::Jacobian<[E; S]>,
        (coefficients, h): (&Coefficients<E, S>, E),
        directions: &'a D,
    ) -> Self {
        let mut weights = coefficients.b;
        for weight in &mut weights {
            *weight = h * *weight;
        }
        let mut all = Self::of_all(&weights);
        if const { is_found::<M, E, S>() } {
            return all;
        }
        let (mut total, mut lever) = (E::from_f64(0.0), [E::from_f64(0.0); S]);
        for (&weight, a) in weights.iter().zip(&coefficients.a) {
            total = total + weight;
            for (lever, &a) in lever.iter_mut().zip(a) {
                *lever = *lever + weight * (h * a);
            }
        }
        all.implied = Some(OfImplied { jacobian, directions, total, lever });
        all
    }

    /// `row + Σ_i w_i dk_i` of an unknown, implied or not, with `V` at the start of the step, but for what [inputs](Self::add_input) add.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub fn add<A: Arithmetic, const W: usize>(
        &self,
        row: &mut [E; W],
        (unknown, dk): (usize, &Packet<E, S, W>),
        (v, dy): (&[[E; W]], &[Packet<E, S, W>]),
    ) {
        if let Some(OfImplied { jacobian, total, lever, .. }) = &self.implied
            && let Some(leader) = leader::<M, E, S>(jacobian, unknown)
        {
            leader.add_state::<A, M, W>(row, *total, v);
            if let Some(dk) = leader.state::<M>().and_then(|state| dy.get(state)) {
                for (&lever, dk) in lever.iter().zip(dk) {
                    A::subtract_row(row, leader.minus_c * lever, dk);
                }
            }
            return;
        }
        for (&weight, dk) in self.minus_weights.iter().zip(dk) {
            A::subtract_row(row, weight, dk);
        }
    }

    /// Whether an unknown is implied by a control or a parameter.
    #[inline(always)]
    pub fn has_input(&self, unknown: usize) -> bool {
        let Some(OfImplied { jacobian, .. }) = &self.implied else { return false };
        matches!(leader::<M, E, S>(jacobian, unknown), Some(leader) if leader.state::<M>().is_none())
    }

    /// What inputs that an implied unknown follows add to its row, in memory.
    #[inline(always)]
    pub fn add_input<const W: usize>(&self, row: &mut [E; W], unknown: usize, column: usize) {
        if let Some(OfImplied { jacobian, directions, total, .. }) = &self.implied
            && let Some(leader) = leader::<M, E, S>(jacobian, unknown)
        {
            leader.add_input::<M, D, W>(row, *total, *directions, column);
        }
    }
}
