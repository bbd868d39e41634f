//! The Riccati recursion: Newton's equations of a horizon, stage by stage from its end.
//!
//! ```text
//! min  Σ ½ Δᵀ (H + weights) Δ + gᵀ Δ     Δx₊ = [A B] Δ + r
//! M = H + diag(w) + [A B]ᵀ P₊ [A B] + [C D]ᵀ diag(w) [C D]
//! M_uu = L Lᵀ,   K = M_xu L⁻ᵀ,   P = M_xx − K Kᵀ
//! ```
//!
//! `(K; L)` is what is kept of a stage: a panel with a column for each control. The controls of a
//! stage are few, so that this classical form needs less than the one with the square root of `P`.

use super::cholesky::{Pivots, cholesky, eliminate, substitute, unit};
use super::kernels::{Columns, MORE, Part, Source, add_transposed, mirror, product, subtract, symmetric};
use super::vector::larger;
use crate::qp::error::QpError;
use crate::qp::layout::{Place, Places, StageDims, assign, end, pad, part, part_mut, take_mut};
use crate::qp::problem::QpView;
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// How the first state is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum First {
    /// It is given.
    Fixed,
    /// It is eliminated like controls.
    Free,
    /// It is tied to the state at the end, and is found with the multipliers of that. Controls may
    /// then have pivots of either sign: what counts is the inertia of the whole.
    Tied,
}

/// Memory of the recursion.
pub struct Riccati<'a, T> {
    /// `M` of the stage at work.
    m: &'a mut [T],
    /// `−[A B]ᵀ P₊` and `−[C D]ᵀ diag(w)`
    w: &'a mut [T],
    /// `P`
    pub p: &'a mut [T],
    /// `(K; L)` of all stages, then the factor of `P` at the start.
    pub panels: &'a mut [T],
    /// Reciprocals of pivots.
    pub inverse: &'a mut [T],
    /// What was added to pivots.
    pub added: &'a mut [T],
    /// `L⁻¹ g_u`
    pub y: &'a mut [T],
    /// `−P₊ r`
    offset: &'a mut [T],
    /// The gradient of the stage at work.
    pub g: &'a mut [T],
    /// `−(p₊ + P₊ r)`, and the negative gradient of general constraints.
    pub minus: &'a mut [T],
    /// Pivots that were made larger.
    pub regularised: usize,
    /// Negative pivots, where these are allowed.
    pub negative: usize,
    /// The largest element of the diagonals so far: what elimination has subtracted was as large as
    /// that.
    largest: T,
    /// Behind the last stage.
    pub end: Place,
}

/// The largest dimensions.
#[derive(Default)]
struct Largest {
    n: usize,
    ld: usize,
    nx: usize,
    next_and_ng: usize,
}

impl Largest {
    const fn of<T>(dims: &[StageDims]) -> Self {
        let (mut largest, mut rest) = (Self { n: 0, ld: 0, nx: 0, next_and_ng: 0 }, dims);
        while let Some((&first, after)) = rest.split_first() {
            let next = match after.first() {
                Some(next) => next.nx,
                None => 0,
            };
            largest.n = max(largest.n, first.nx + first.nu);
            largest.nx = max(largest.nx, first.nx);
            largest.next_and_ng = max(largest.next_and_ng, next + first.ng);
            rest = after;
        }
        largest.ld = pad::<T>(largest.n);
        largest
    }
}

const fn max(a: usize, b: usize) -> usize {
    if a > b { a } else { b }
}

impl<'a, T: Real> Riccati<'a, T> {
    /// How many numbers it takes.
    pub const fn memory(dims: &[StageDims]) -> usize {
        let (largest, end) = (Largest::of::<T>(dims), end::<T>(dims));
        let Largest { n, ld, nx, next_and_ng } = largest;
        let matrices = ld * (n + MORE) + ld * (next_and_ng + MORE) + pad::<T>(nx) * (nx + MORE);
        matrices + end.factor + 3 * end.v + end.dynamics + ld + pad::<T>(next_and_ng)
    }
    /// In memory that is zero.
    pub fn new(dims: &[StageDims], memory: &mut &'a mut [T]) -> Self {
        let (Largest { n, ld, nx, next_and_ng }, end) = (Largest::of::<T>(dims), end::<T>(dims));
        Self {
            m: take_mut(memory, ld * (n + MORE)),
            w: take_mut(memory, ld * (next_and_ng + MORE)),
            p: take_mut(memory, pad::<T>(nx) * (nx + MORE)),
            panels: take_mut(memory, end.factor),
            inverse: take_mut(memory, end.v),
            added: take_mut(memory, end.v),
            y: take_mut(memory, end.v),
            offset: take_mut(memory, end.dynamics),
            g: take_mut(memory, ld),
            minus: take_mut(memory, pad::<T>(next_and_ng)),
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
    pub first: First,
    /// Whether the Hessian counts.
    pub objective: bool,
    /// Weights of bounds and general constraints.
    pub weights: &'a [T],
    /// Gradient, over variables and general constraints.
    pub gradient: &'a [T],
    /// `r`
    pub dynamics: &'a [T],
}

/// A solve as a function of its own.
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
        *result = riccati.backward::<E>(&equations, factor, step);
        if result.is_ok() {
            riccati.forward::<E>(&equations, step);
        }
    }
}

impl<T: Real> Riccati<'_, T> {
    /// Solves Newton's equations, for a new matrix or for that of the last time and its `r`. `step`
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

    /// The next solve with the same matrix has other residuals of the dynamics: none, but for
    /// rounding.
    pub fn no_dynamics(&mut self) {
        self.offset.fill(T::ZERO);
    }

    #[inline(always)]
    pub fn backward<E: Packed<T>>(
        &mut self,
        equations: &Equations<'_, T>,
        factor: bool,
        scratch: &mut [T],
    ) -> Result<(), QpError> {
        let Equations { qp, first, gradient, dynamics, .. } = *equations;
        if factor {
            self.regularised = 0;
            self.negative = 0;
            self.largest = T::ZERO;
        }
        for place in Places::<T>::ending(qp.dims, self.end).rev() {
            let Place { nx, nu, n, ng, ld, next, ld_next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            // −(p₊ + P₊ r), behind the end of the horizon nothing; then the general constraints.
            let offset = part_mut(self.offset, place.dynamics, ld_next);
            if factor {
                offset.fill(T::ZERO);
                let p = Columns { data: &*self.p, ld: ld_next };
                subtract::<T, E>(offset, p, part(dynamics, place.dynamics, next), next, next);
            }
            for (minus, &offset) in self.minus.iter_mut().zip(part(offset, 0, next)) {
                *minus = *minus + offset;
            }
            let general = part(gradient, place.row + ld, ng);
            for (minus, &general) in part_mut(self.minus, next, ng).iter_mut().zip(general) {
                *minus = -general;
            }
            if factor {
                self.factor_stage::<E>(&place, equations, data, scratch)?;
            }
            let g = part_mut(self.g, 0, ld);
            assign(g, part(gradient, place.row, ld));
            subtract::<T, E>(g, matrix, self.minus, n, next + ng);
            let panel = part(self.panels, place.factor, ld * place.pivots);
            let inverse = part(self.inverse, place.v, ld);
            let y = part_mut(self.y, place.v, ld);
            eliminate::<T, E>(g, panel, ld, part(inverse, nx, nu), part_mut(y, nx, nu), nx);
            if place.stage == 0 {
                if first == First::Free {
                    let panel = panel.get(nu * ld..).unwrap_or_default();
                    eliminate::<T, E>(g, panel, ld, part(inverse, 0, nx), part_mut(y, 0, nx), 0);
                }
                break;
            }
            for (minus, &g) in part_mut(self.minus, 0, nx).iter_mut().zip(&*g) {
                *minus = -g;
            }
        }
        Ok(())
    }

    /// `M`, its factors, and `P`.
    #[inline(always)]
    fn factor_stage<E: Packed<T>>(
        &mut self,
        place: &Place,
        equations: &Equations<'_, T>,
        data: &[T],
        scratch: &mut [T],
    ) -> Result<(), QpError> {
        let Place { nx, nu, n, ng, ld, next, ld_next, stage, .. } = *place;
        let Equations { qp, first, objective, .. } = *equations;
        let weights = part(equations.weights, place.row, place.rows);
        let matrix = Columns { data: part(data, 0, place.matrix()), ld };
        let hessian = if objective { part(data, place.matrix(), place.hessian()) } else { &[] };
        let source = Source::Matrix(Columns { data: hessian, ld });
        let p = Columns { data: &*self.p, ld: ld_next };
        product::<T, E>(self.w, ld, Source::Zero, matrix, p, (n, 0..next, next), Part::Full);
        for (i, &weight) in part(weights, ld, ng).iter().enumerate() {
            let column = (next + i) * ld;
            for (w, &c) in part_mut(self.w, column, ld).iter_mut().zip(part(matrix.data, column, ld)) {
                *w = -c * weight;
            }
        }
        let w = Columns { data: &*self.w, ld };
        // Columns are computed four at a time. The first with a control among them are needed
        // whole.
        let whole = nx / 4 * 4;
        if stage > 0 || first != First::Fixed {
            product::<T, E>(self.m, ld, source, matrix, w, (nx, 0..whole, next + ng), Part::Lower);
        }
        product::<T, E>(self.m, ld, source, matrix, w, (n, whole..n, next + ng), Part::Full);
        // Of the Hessian only the lower triangle is there: above are controls times states.
        let mixed = part_mut(self.m, nx * ld, nu * ld).chunks_exact_mut(ld.max(1));
        for (j, column) in mixed.enumerate() {
            let row = hessian.get(nx + j..).unwrap_or_default();
            for (m, &s) in column.iter_mut().zip(row.iter().step_by(ld.max(1))).take(nx) {
                *m = *m + s;
            }
        }
        let mut largest = self.largest;
        for (diagonal, &weight) in self.m.iter_mut().step_by((ld + 1).max(1)).zip(weights).take(n) {
            *diagonal = *diagonal + weight;
            largest = diagonal.abs().max(largest);
        }
        self.largest = largest;

        let inverse = part_mut(self.inverse, place.v, ld);
        let added = part_mut(self.added, place.v, ld);
        let panel = part_mut(self.m, nx * ld, nu * ld);
        let indefinite = first == First::Tied;
        let (inverse, added) = (part_mut(inverse, nx, nu), part_mut(added, nx, nu));
        let pivots = Pivots { inverse, added, largest, indefinite };
        let (regularised, negative) = cholesky::<T, E>(panel, ld, nx, n, pivots);
        self.regularised += regularised;
        let kept = part_mut(self.panels, place.factor, ld * place.pivots);
        assign(part_mut(kept, 0, nu * ld), panel);
        match negative {
            Some((index, pivot)) if indefinite => {
                return Err(QpError::NotConvex { stage, index, pivot: pivot.to_f64() });
            }
            Some(found) => self.verify(qp, place, found, scratch)?,
            None => {}
        }
        let kept = part_mut(self.panels, place.factor, ld * place.pivots);
        let (before, _) = self.m.split_at_checked(nx * ld).unwrap_or_default();
        if stage == 0 && first == First::Fixed {
            return Ok(());
        }
        let panel = Columns { data: part(kept, 0, nu * ld), ld };
        let ld_x = pad::<T>(nx);
        let source = Source::Matrix(Columns { data: before, ld });
        product::<T, E>(self.p, ld_x, source, panel, panel, (nx, 0..nx, nu), Part::Lower);
        if indefinite {
            // What has a negative pivot was subtracted, and is to be added.
            let inverse = part(self.inverse, place.v + nx, nu);
            let columns = panel.data.chunks_exact(ld.max(1)).zip(inverse);
            for (column, _) in columns.filter(|(_, inverse)| **inverse < T::ZERO) {
                self.negative += 1;
                for (p, &factor) in self.p.chunks_exact_mut(ld_x.max(1)).zip(column).take(nx) {
                    let twice = factor + factor;
                    for (p, &c) in p.iter_mut().zip(column).take(nx) {
                        *p = *p + twice * c;
                    }
                }
            }
        }
        if stage > 0 || indefinite {
            mirror(self.p, ld_x, nx);
            return Ok(());
        }
        let start = part_mut(kept, nu * ld, nx * ld);
        for (start, p) in start.chunks_exact_mut(ld.max(1)).zip(self.p.chunks_exact(ld_x.max(1))) {
            for (start, &p) in start.iter_mut().zip(p) {
                *start = p;
            }
        }
        let (inverse, added) = (part_mut(self.inverse, place.v, nx), part_mut(self.added, place.v, nx));
        let (regularised, negative) =
            cholesky::<T, E>(start, ld, 0, nx, Pivots { inverse, added, largest, indefinite: false });
        self.regularised += regularised;
        match negative {
            Some((index, pivot)) => self.verify(qp, place, (nu + index, pivot), scratch),
            None => Ok(()),
        }
    }

    /// An error if the Hessian curves downwards along the direction in which a pivot is negative:
    /// that of one control (behind the controls, of a state at the start), with which the ones
    /// before it and all that come later move such that the rest of `dᵀ M d` vanishes. Otherwise
    /// the pivot is rounding.
    fn verify(
        &mut self,
        qp: QpView<'_, T>,
        from: &Place,
        (index, pivot): (usize, T),
        direction: &mut [T],
    ) -> Result<(), QpError> {
        let (mut curvature, mut size) = (T::ZERO, T::ZERO);
        let mut rest = direction.get_mut(from.row..).unwrap_or_default();
        for place in Places::<T>::new(qp.dims).skip(from.stage) {
            let Place { nx, nu, n, ld, next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let (panel, inverse) =
                (part(self.panels, place.factor, ld * place.pivots), part(self.inverse, place.v, ld));
            let v = part_mut(take_mut(&mut rest, place.rows), 0, ld);
            let state = index.checked_sub(nu);
            let (begin, from_here) = (if state.is_some() { 0 } else { nx }, place.stage == from.stage);
            // The state comes from the stage before.
            let given = if from_here { 0 } else { nx };
            v.iter_mut().skip(given).for_each(|v| *v = T::ZERO);
            if from_here {
                let columns = panel.get(if state.is_some() { nu * ld } else { 0 }..).unwrap_or_default();
                unit(
                    part_mut(v, begin, ld - begin),
                    columns,
                    ld,
                    begin,
                    part(inverse, begin, ld - begin),
                    state.unwrap_or(index),
                );
            }
            if !from_here || state.is_some() {
                let u = part_mut(self.g, 0, nu);
                u.fill(T::ZERO);
                add_transposed::<T, T>(u, Columns { data: panel, ld }, v, nx, nu);
                substitute(u, panel, ld, nx, part(inverse, nx, nu));
                assign(part_mut(v, nx, nu), u);
            }
            let coming = part_mut(rest, 0, next);
            coming.fill(T::ZERO);
            add_transposed::<T, T>(coming, matrix, v, n, next);
            let product = part_mut(self.g, 0, ld);
            product.fill(T::ZERO);
            let hessian = part(data, place.matrix(), place.hessian());
            symmetric::<T, T>(product, hessian, ld, v, n);
            let largest = larger::<T, T>(T::ZERO, hessian);
            for (&v, &product) in v.iter().zip(&*product) {
                curvature = curvature + v * product;
                size = size + largest * v * v;
            }
        }
        let rounding = T::from_f64(64.0 * T::EPSILON) * size;
        if pivot.is_finite() && curvature.is_finite() && curvature < -rounding {
            return Err(QpError::NotConvex { stage: from.stage, index, pivot: pivot.to_f64() });
        }
        Ok(())
    }

    #[inline(always)]
    pub fn forward<E: Packed<T>>(&mut self, equations: &Equations<'_, T>, step: &mut [T]) {
        let Equations { qp, first, dynamics, .. } = *equations;
        let mut rest = step;
        for place in Places::<T>::new(qp.dims) {
            let Place { nx, nu, n, ng, ld, next, .. } = place;
            let here = take_mut(&mut rest, place.rows);
            let matrix = Columns { data: part(qp.data, place.data, place.matrix()), ld };
            let panel = part(self.panels, place.factor, ld * place.pivots);
            let inverse = part(self.inverse, place.v, ld);
            let y = part(self.y, place.v, ld);
            let (v, general) = here.split_at_mut_checked(ld).unwrap_or_default();
            if place.stage == 0 {
                v.fill(T::ZERO);
                if first != First::Fixed {
                    assign(part_mut(v, 0, nx), part(y, 0, nx));
                }
                if first == First::Free {
                    let panel = panel.get(nu * ld..).unwrap_or_default();
                    substitute(part_mut(v, 0, nx), panel, ld, 0, part(inverse, 0, nx));
                }
            }
            part_mut(v, nx, nu).fill(T::ZERO);
            let u = part_mut(self.g, 0, nu);
            assign(u, part(y, nx, nu));
            add_transposed::<T, E>(u, Columns { data: panel, ld }, v, nx, nu);
            substitute(u, panel, ld, nx, part(inverse, nx, nu));
            assign(part_mut(v, nx, nu), u);
            let coming = part_mut(rest, 0, next);
            assign(coming, part(dynamics, place.dynamics, next));
            add_transposed::<T, E>(coming, matrix, v, n, next);
            let general = part_mut(general, 0, ng);
            general.fill(T::ZERO);
            add_transposed::<T, E>(general, matrix.skip(next), v, n, ng);
        }
    }
}
