//! Transfer of problems into SIMD lanes, and of solutions back.

use super::group::{Group, Size};
use super::sets::forces;
use crate::qp::layout::{StageOffsets, StageOffsetsIter, copy_common, part, part_mut};
use crate::qp::solution::SolutionView;
use crate::qp::stage::ConstraintVector;
use crate::qp::{StageDims, element::set};
use crate::scalar::{Packed, Real};

/// An upper bound of the number of lanes.
pub const MAX_LANES: usize = 16;

/// Copies elements of several slices from `begin` on, one slice for each lane: whole registers are
/// read from each, and transposed.
#[inline(always)]
fn gather<T: Real, E: Packed<T>>(from: &[&[T]; MAX_LANES], begin: usize, to: &mut [E::Cell]) {
    for (block, to) in to.chunks_mut(E::LANES).enumerate() {
        let at = begin + block * E::LANES;
        let (mut registers, mut tile) = ([E::from_f64(0.0); MAX_LANES], [zero::<T, E>(); MAX_LANES]);
        let (Some(registers), Some(tile)) = (registers.get_mut(..E::LANES), tile.get_mut(..E::LANES)) else {
            return;
        };
        for (register, from) in registers.iter_mut().zip(from) {
            match E::cells(part(from, at, E::LANES)) {
                [cell] => *register = E::load(cell),
                _ => {
                    // Elements beyond the end are zero.
                    let mut cell = zero::<T, E>();
                    for (i, value) in from.get(at..).unwrap_or_default().iter().take(E::LANES).enumerate() {
                        E::set_lane(&mut cell, i, value.to_f64());
                    }
                    *register = E::load(&cell);
                }
            }
        }
        E::transpose(registers, tile);
        copy_common(to, tile);
    }
}

#[inline(always)]
fn zero<T: Real, E: Packed<T>>() -> E::Cell {
    let mut cell: E::Cell = bytemuck::Zeroable::zeroed();
    E::from_f64(0.0).store(&mut cell);
    cell
}

impl<C: Copy> Group<'_, C> {
    /// Writes problems of these dimensions, given by their data, into lanes, with no active bound.
    #[inline(always)]
    pub fn write<T: Real, E: Packed<T, Cell = C>>(
        &mut self,
        dims: &[StageDims],
        data: &[&[T]; MAX_LANES],
        no_bound: f64,
    ) {
        let (Size { nx, nu, intervals }, n) = (self.size, self.size.n());
        for (k, place) in StageOffsetsIter::<T>::new(dims).enumerate() {
            let begin = place.data;
            let variables = if k < intervals { n } else { nx };
            let hessian = part_mut(self.hessian, k * n * n, n * n);
            for j in 0..variables {
                let column = part_mut(hessian, j * n + j, variables - j);
                gather::<T, E>(data, begin + place.matrix() + j * place.ld + j, column);
            }
            for j in 0..variables {
                for i in j + 1..variables {
                    let Some(&below) = hessian.get(j * n + i) else { return };
                    set(hessian, i * n + j, below);
                }
            }
            gather::<T, E>(data, begin + place.gradient(), part_mut(self.gradient, k * n, variables));
            if k == 0 {
                gather::<T, E>(
                    data,
                    begin + place.constraint_vector_begin(ConstraintVector::Lower),
                    part_mut(self.v, 0, nx),
                );
            }
            if k == intervals {
                break;
            }
            for j in 0..nx {
                let column = part_mut(self.dynamics, (k * nx + j) * n, n);
                gather::<T, E>(data, begin + j * place.ld, column);
            }
            gather::<T, E>(data, begin + place.offset(), part_mut(self.offset, k * nx, nx));
            for (row, to) in
                [(ConstraintVector::Lower, &mut *self.lower), (ConstraintVector::Upper, &mut *self.upper)]
            {
                gather::<T, E>(
                    data,
                    begin + place.constraint_vector_begin(row) + nx,
                    part_mut(to, k * nu, nu),
                );
            }
        }
        for active in &mut *self.active {
            E::from_f64(0.0).store(active);
        }
        self.remove_absent_bounds::<E>(E::from_f64(no_bound));
    }

    /// Writes an active set into a lane; bounds that do not exist are left out.
    #[inline(always)]
    pub fn load_active_set<T: Real, E: Packed<T, Cell = C>>(
        &mut self,
        lane: usize,
        of: impl Iterator<Item = i8>,
    ) {
        let bounds = self.lower.iter().zip(&*self.upper);
        for ((active, (lower, upper)), of) in self.active.iter_mut().zip(bounds).zip(of) {
            let bound = if of < 0 { lower } else { upper };
            E::set_lane(active, lane, if E::lane(bound, lane).is_finite() { of.into() } else { 0.0 });
        }
    }

    /// Reads the active set of a lane.
    #[inline(always)]
    pub fn store_active_set<T: Real, E: Packed<T, Cell = C>>(&self, lane: usize, to: &mut [i8]) {
        for (to, active) in to.iter_mut().zip(&*self.active) {
            let active = E::lane(active, lane);
            *to = i8::from(active > 0.0) - i8::from(active < 0.0);
        }
    }

    /// Reads the point of a lane, and its multipliers.
    #[inline(always)]
    pub fn read<T: Real, E: Packed<T, Cell = C>>(&self, lane: usize, solution: &mut SolutionView<'_, T>) {
        let (Size { nx, nu, intervals }, n) = (self.size, self.size.n());
        let number = |cell: &C| T::from_f64(E::lane(cell, lane));
        let copy = |to: &mut [T], from: &[C]| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = number(from));
        };
        solution.lower.fill(T::ZERO);
        solution.upper.fill(T::ZERO);
        for (k, place) in StageOffsetsIter::<T>::new(solution.dims).enumerate() {
            let StageOffsets { v, dynamics, row, .. } = place;
            let variables = if k < intervals { n } else { nx };
            copy(part_mut(solution.v, v, variables), part(self.v, k * n, variables));
            if k == 0 {
                // The initial state is fixed: its multiplier has either sign.
                for (i, force) in part(self.multipliers, 0, nx).iter().enumerate() {
                    let force = number(force);
                    set(solution.lower, row + i, force.max(T::ZERO));
                    set(solution.upper, row + i, (-force).max(T::ZERO));
                }
            }
            if k == intervals {
                break;
            }
            copy(part_mut(solution.dynamics, dynamics, nx), part(self.multipliers, (k + 1) * nx, nx));
            for i in k * nu..(k + 1) * nu {
                let (Some(active), Some(slope)) = (self.active.get(i), self.slope.get(i)) else { return };
                let both = forces::<E>(active, E::load(slope));
                for (to, force) in [&mut *solution.lower, &mut *solution.upper].into_iter().zip(both) {
                    let mut cell = zero::<T, E>();
                    force.store(&mut cell);
                    set(to, row + nx + i - k * nu, number(&cell));
                }
            }
        }
    }
}
