//! The Riccati recursion: Newton's equations of a horizon, stage by stage from its end.
//!
//! ```text
//! min  Σ ½ Δᵀ (H + weights) Δ + gᵀ Δ     Δx₊ = [A B] Δ + r
//! M = H + diag(w) + [A B]ᵀ P₊ [A B] + [C D]ᵀ diag(w) [C D]
//! M_uu = L Lᵀ,   K = M_xu L⁻ᵀ,   P = M_xx − K Kᵀ
//! ```
//!
//! `(K; L)` is stored for each stage: a panel with a column for each control. With few controls
//! this classical form takes fewer operations than the square-root form.

use super::cholesky::{eliminate, substitute};
use super::kernels::{Columns, PADDING_COLUMNS, add, add_transposed, copy, copy_negative, subtract};
use super::shared::Shared;
use crate::qp::error::QpError;
use crate::qp::layout::{
    StageDims, StageOffsets, StageOffsetsIter, copy_common, end, padded_len, part, part_mut, take_mut,
};
use crate::qp::problem::QpView;
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// How the first state is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialStateKind {
    /// It is fixed.
    Fixed,
    /// It is eliminated like controls.
    Free,
    /// It is solved for together with the couplings.
    Coupled,
}

/// Memory of the recursion.
pub struct Riccati<'a, T> {
    /// `M` of the current stage.
    pub m: &'a mut [T],
    /// `−[A B]ᵀ P₊` and `−[C D]ᵀ diag(w)`
    pub w: &'a mut [T],
    /// `P`
    pub p: &'a mut [T],
    /// `(K; L)` of all stages, then the factor of `P` at the start.
    pub panels: &'a mut [T],
    /// Reciprocals of pivots.
    pub inverse: &'a mut [T],
    /// Increases of pivots.
    pub added: &'a mut [T],
    /// `L⁻¹ g_u`
    pub y: &'a mut [T],
    /// `−P₊ r`
    offset: &'a mut [T],
    /// The gradient of the current stage.
    pub g: &'a mut [T],
    /// `−(p₊ + P₊ r)`, and the negative gradient of general constraints.
    pub minus: &'a mut [T],
    /// The number of increased pivots.
    pub regularised: usize,
    /// The number of negative pivots, if these are accepted.
    pub negative: usize,
    /// The largest element of the diagonals so far, which bounds the subtracted terms.
    pub largest: T,
    /// The offsets after the last stage.
    pub end: StageOffsets,
}

/// The largest dimensions of a horizon, and the offsets after its last stage.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// The maximum number of variables of a stage.
    pub n: usize,
    /// The maximum stride of columns of a stage.
    pub ld: usize,
    /// The maximum number of states of a stage.
    pub nx: usize,
    next_and_ng: usize,
    pub end: StageOffsets,
}

impl Extent {
    pub const fn of<T>(dims: &[StageDims]) -> Self {
        let end = end::<T>(dims);
        let (mut largest, mut rest) = (Self { n: 0, ld: 0, nx: 0, next_and_ng: 0, end }, dims);
        while let Some((&first, after)) = rest.split_first() {
            let next = match after.first() {
                Some(next) => next.nx,
                None => 0,
            };
            largest.n = larger_index(largest.n, first.nx + first.nu);
            largest.nx = larger_index(largest.nx, first.nx);
            largest.next_and_ng = larger_index(largest.next_and_ng, next + first.ng);
            rest = after;
        }
        largest.ld = padded_len::<T>(largest.n);
        largest
    }
}

const fn larger_index(a: usize, b: usize) -> usize {
    if a > b { a } else { b }
}

impl<'a, T: Real> Riccati<'a, T> {
    /// Returns the length of the memory.
    pub const fn memory(dims: &[StageDims]) -> usize {
        let Extent { n, ld, nx, next_and_ng, end } = Extent::of::<T>(dims);
        let matrices = ld * (n + PADDING_COLUMNS)
            + ld * (next_and_ng + PADDING_COLUMNS)
            + padded_len::<T>(nx) * (nx + PADDING_COLUMNS);
        matrices + end.factor + 3 * end.v + end.dynamics + ld + padded_len::<T>(next_and_ng)
    }
    /// A recursion in memory that is zero.
    pub fn new(extent: &Extent, memory: &mut &'a mut [T]) -> Self {
        let Extent { n, ld, nx, next_and_ng, end } = *extent;
        Self {
            m: take_mut(memory, ld * (n + PADDING_COLUMNS)),
            w: take_mut(memory, ld * (next_and_ng + PADDING_COLUMNS)),
            p: take_mut(memory, padded_len::<T>(nx) * (nx + PADDING_COLUMNS)),
            panels: take_mut(memory, end.factor),
            inverse: take_mut(memory, end.v),
            added: take_mut(memory, end.v),
            y: take_mut(memory, end.v),
            offset: take_mut(memory, end.dynamics),
            g: take_mut(memory, ld),
            minus: take_mut(memory, padded_len::<T>(next_and_ng)),
            regularised: 0,
            negative: 0,
            largest: T::ZERO,
            end,
        }
    }
}

/// Newton's equations.
#[derive(Clone, Copy)]
pub struct Equations<'a, T> {
    pub qp: QpView<'a, T>,
    pub first: InitialStateKind,
    /// Whether the Hessian counts.
    pub objective: bool,
    /// Whether controls may have pivots of either sign, since only the inertia of the whole system
    /// counts.
    pub indefinite: bool,
    /// Weights of bounds and general constraints.
    pub weights: &'a [T],
    /// The gradient, over variables and general constraints.
    pub gradient: &'a [T],
    /// `r`
    pub dynamics: &'a [T],
}

/// The arguments of [`Riccati::solve`].
struct Solve<'s, 'a, T, E> {
    riccati: &'s mut Riccati<'a, T>,
    equations: Equations<'s, T>,
    factor: bool,
    step: &'s mut [T],
    result: &'s mut Result<(), QpError>,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for Solve<'_, '_, T, E> {
    #[inline(always)]
    fn run(self) {
        let Self { riccati, equations, factor, step, result, .. } = self;
        *result = riccati.backward::<E>(&equations, factor, step, &mut Shared::without_shared_controls());
        if result.is_ok() {
            riccati.forward::<E>(&equations, step);
        }
    }
}

impl<T: Real> Riccati<'_, T> {
    /// Solves Newton's equations, for a new matrix, or for the previous matrix and its `r`. `step`
    /// is `Δ`, with the changes of the general constraints.
    ///
    /// # Errors
    /// [`QpError::NotConvex`]
    pub fn solve<E: Packed<T>>(
        &mut self,
        equations: Equations<'_, T>,
        factor: bool,
        step: &mut [T],
    ) -> Result<(), QpError> {
        let mut result = Ok(());
        let register = PhantomData::<E>;
        E::vectorize(Solve { riccati: self, equations, factor, step, result: &mut result, register });
        result
    }

    /// Sets the dynamics residuals of the next solve with the same matrix to zero.
    pub fn clear_dynamics_residuals(&mut self) {
        self.offset.fill(T::ZERO);
    }

    #[inline(always)]
    pub fn backward<E: Packed<T>>(
        &mut self,
        equations: &Equations<'_, T>,
        factor: bool,
        scratch: &mut [T],
        shared: &mut Shared<'_, T>,
    ) -> Result<(), QpError> {
        let Equations { qp, first, gradient, dynamics, .. } = *equations;
        if factor {
            self.regularised = 0;
            self.negative = 0;
            self.largest = T::ZERO;
        }
        for place in StageOffsetsIter::<T>::with_known_end(qp.dims, self.end).rev() {
            let StageOffsets { nx, nu, n, ng, ld, next, ld_next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            // `−(p₊ + P₊ r)`, empty at the end of the horizon; then the general constraints.
            let offset = part_mut(self.offset, place.dynamics, ld_next);
            if factor {
                offset.fill(T::ZERO);
                let p = Columns { data: &*self.p, ld: ld_next };
                subtract::<T, E>(offset, p, part(dynamics, place.dynamics, next), next, next);
            }
            add::<T, E>(self.minus, offset);
            let general = part(gradient, place.row + ld, ng);
            for (minus, &general) in part_mut(self.minus, next, ng).iter_mut().zip(general) {
                *minus = -general;
            }
            if factor {
                self.factor_stage::<E>(&place, equations, scratch, shared)?;
            }
            let g = part_mut(self.g, 0, ld);
            copy::<T, E>(g, part(gradient, place.row, ld));
            subtract::<T, E>(g, matrix, self.minus, n, next + ng);
            let panel = part(self.panels, place.factor, ld * place.pivots);
            let inverse = part(self.inverse, place.v, ld);
            let y = part_mut(self.y, place.v, ld);
            eliminate::<T, E>(g, panel, ld, part(inverse, nx, nu), part_mut(y, nx, nu), nx);
            if place.stage == 0 {
                if first == InitialStateKind::Free {
                    let panel = panel.get(nu * ld..).unwrap_or_default();
                    eliminate::<T, E>(g, panel, ld, part(inverse, 0, nx), part_mut(y, 0, nx), 0);
                }
                break;
            }
            copy_negative::<T, E>(part_mut(self.minus, 0, padded_len::<T>(nx)), g);
        }
        Ok(())
    }

    #[inline(always)]
    pub fn forward<E: Packed<T>>(&mut self, equations: &Equations<'_, T>, step: &mut [T]) {
        let Equations { qp, first, dynamics, .. } = *equations;
        let mut rest = step;
        for place in StageOffsetsIter::<T>::new(qp.dims) {
            let StageOffsets { nx, nu, n, ng, ld, next, .. } = place;
            let here = take_mut(&mut rest, place.rows);
            let matrix = Columns { data: part(qp.data, place.data, place.matrix()), ld };
            let panel = part(self.panels, place.factor, ld * place.pivots);
            let inverse = part(self.inverse, place.v, ld);
            let y = part(self.y, place.v, ld);
            let (v, general) = here.split_at_mut_checked(ld).unwrap_or_default();
            if place.stage == 0 {
                v.fill(T::ZERO);
                if first != InitialStateKind::Fixed {
                    copy_common(part_mut(v, 0, nx), part(y, 0, nx));
                }
                if first == InitialStateKind::Free {
                    let panel = panel.get(nu * ld..).unwrap_or_default();
                    substitute(part_mut(v, 0, nx), panel, ld, 0, part(inverse, 0, nx));
                }
            }
            part_mut(v, nx, nu).fill(T::ZERO);
            let u = part_mut(self.g, 0, nu);
            copy_common(u, part(y, nx, nu));
            add_transposed::<T, E>(u, Columns { data: panel, ld }, v, nx, nu);
            substitute(u, panel, ld, nx, part(inverse, nx, nu));
            copy_common(part_mut(v, nx, nu), u);
            let coming = part_mut(rest, 0, next);
            copy_common(coming, part(dynamics, place.dynamics, next));
            add_transposed::<T, E>(coming, matrix, v, n, next);
            let general = part_mut(general, 0, ng);
            general.fill(T::ZERO);
            add_transposed::<T, E>(general, matrix.skip(next), v, n, ng);
        }
    }
}
