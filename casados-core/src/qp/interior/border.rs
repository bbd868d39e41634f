//! Newton's equations with the parameters `q = (θ, w)`, a bordered system: multipliers of periodic
//! states, and shared controls.
//!
//! ```text
//! cost to go of stage k   ½ xᵀPx + xᵀΓq + ½ qᵀSq + pᵀx + sᵀq        Γ_N = (−E, 0)
//! at the first stage      [P₀  Γ₀ + E] [x₀]     [p₀   ]
//!                         [ ·    S   ] [q ] = − [s + c]            c = (x₀ − x_N, 0)
//! ```
//!
//! Each parameter is a further right-hand side of the backward sweep; there is one forward sweep.
//! Parameters are stored side by side for SIMD: `Γ` is stored transposed, a column for each
//! variable. `E` has a column for each periodic state; a shared control has its columns of `M` at
//! every stage. Inertia is additive (E. V. Haynsworth, Linear Algebra Appl. 1, 1968): the step is
//! that of a minimum if the pivots of controls and of the border together have as many negative
//! signs as there are periodicity conditions.

use super::coupling::Coupling;
use super::kernels::{Columns, Part, Source, product, subtract};
use super::riccati::{Equations, Riccati};
use super::shared::Shared;
use super::symmetric::Symmetric;
use super::units::Units;
use super::vector::{add_scaled, dot, scale_vector};
use crate::qp::element::{add, set};
use crate::qp::error::QpError;
use crate::qp::layout::{StageOffsets, StageOffsetsIter, copy_common, padded_len, part, part_mut};
use crate::qp::{QpView, marked_indices};
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;

/// Solves Newton's equations with the parameters; see [`Riccati::solve`].
///
/// # Errors
/// [`QpError::NotConvex`] if the inertia is not that of a minimum.
pub fn solve<T: Real, E: Packed<T>>(
    coupling: &mut Coupling<'_, T>,
    riccati: &mut Riccati<'_, T>,
    (equations, units): (Equations<'_, T>, Units<'_, T>),
    factor: bool,
    step: &mut [T],
) -> Result<(), QpError> {
    let mut result = Ok(());
    let register = PhantomData::<E>;
    E::vectorize(Solve { coupling, riccati, equations, units, factor, step, result: &mut result, register });
    result
}

/// The arguments of [`solve`].
struct Solve<'s, 'a, 'c, T, E> {
    coupling: &'s mut Coupling<'c, T>,
    riccati: &'s mut Riccati<'a, T>,
    equations: Equations<'s, T>,
    units: Units<'s, T>,
    factor: bool,
    step: &'s mut [T],
    result: &'s mut Result<(), QpError>,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for Solve<'_, '_, '_, T, E> {
    #[inline(always)]
    fn run(self) {
        let Self { coupling, riccati, equations, units, factor, step, result, .. } = self;
        let mut apart = Shared::new(coupling.shared, coupling.columns, riccati.end.v);
        *result = riccati.backward::<E>(&equations, factor, step, &mut apart);
        if result.is_err() {
            return;
        }
        let Equations { qp, dynamics, .. } = equations;
        copy_common(coupling.first, riccati.g);
        if factor {
            coupling.eliminate::<E>(qp, riccati, dynamics);
        }
        coupling.gather(qp, riccati);
        *result = coupling.solve_bordered_system(riccati, units, factor);
        if result.is_ok() {
            coupling.distribute_parameter_step::<E>(qp, riccati);
            riccati.forward::<E>(&equations, step);
        }
    }
}

impl<T: Real> Coupling<'_, T> {
    /// Sweeps backward over all parameters: computes their rows of `Γᵀ`, the Schur complement `S`,
    /// and the terms of dynamics residuals in `s`.
    #[inline(always)]
    fn eliminate<E: Packed<T>>(&mut self, qp: QpView<'_, T>, riccati: &Riccati<'_, T>, dynamics: &[T]) {
        let (count, ld) = (self.count, padded_len::<T>(self.count));
        for zero in [&mut *self.schur, self.offset] {
            zero.fill(T::ZERO);
        }
        for place in StageOffsetsIter::<T>::with_known_end(qp.dims, riccati.end).rev() {
            let StageOffsets { nx, nu, n, next, .. } = place;
            let minus = Columns { data: &*self.minus, ld };
            let matrix = Columns { data: part(qp.data, place.data, place.matrix()), ld: place.ld };
            product::<T, E>(self.gamma, ld, Source::Zero, minus, matrix, (count, 0..n, next), Part::Full);
            // `Γ₊ᵀ r`
            subtract::<T, E>(self.offset, minus, part(dynamics, place.dynamics, next), count, next);
            self.add_stage_columns(&place, qp.dims.len(), riccati.end.v);
            self.eliminate_controls(&place, riccati);
            let (states, controls) = self.gamma.split_at_mut_checked(nx * ld).unwrap_or_default();
            let signed = Columns { data: &*controls, ld };
            let own = Columns { data: part(self.eliminated, (place.v + nx) * ld, nu * ld), ld };
            let size = (count, 0..count, nu);
            product::<T, E>(self.schur, ld, Source::Target, signed, own, size, Part::Lower);
            let panel = Columns { data: part(riccati.panels, place.factor, place.ld * nu), ld: place.ld };
            product::<T, E>(states, ld, Source::Target, signed, panel, (count, 0..nx, nu), Part::Full);
            for (minus, &gamma) in self.minus.iter_mut().zip(&*states) {
                *minus = -gamma;
            }
        }
    }

    /// Adds the terms of the parameters at a stage: `−E` at the last one, and columns of `M`, each
    /// of `length` elements over all stages.
    #[inline(always)]
    fn add_stage_columns(&mut self, place: &StageOffsets, stages: usize, length: usize) {
        let ld = padded_len::<T>(self.count);
        if place.stage + 1 == stages {
            for (c, state) in marked_indices(self.periodic).enumerate() {
                set(self.gamma, state * ld + c, -T::ONE);
            }
        }
        for (w, column) in self.columns.chunks_exact(length.max(1)).enumerate() {
            for (i, &element) in part(column, place.v, place.n).iter().enumerate() {
                add(self.gamma, i * ld + self.conditions + w, element);
            }
        }
    }

    /// Computes `Y = L⁻¹ Γ_u` of a stage. `Γ_u` is replaced by `Y` with the signs of pivots, and
    /// the terms of shared controls are added to `S`.
    #[inline(always)]
    fn eliminate_controls(&mut self, place: &StageOffsets, riccati: &Riccati<'_, T>) {
        let (StageOffsets { nx, nu, .. }, ld) = (*place, padded_len::<T>(self.count));
        let begin = place.v + nx;
        let panel = part(riccati.panels, place.factor, place.ld * nu);
        let controls = part_mut(self.gamma, nx * ld, nu * ld);
        for (i, &inverse) in part(riccati.inverse, begin, nu).iter().enumerate() {
            let (own, below) = controls.split_at_mut_checked((i + 1) * ld).unwrap_or_default();
            let signed = part_mut(own, i * ld, ld);
            scale_vector(signed, inverse);
            let y = part_mut(self.eliminated, (begin + i) * ld, ld);
            copy_common(y, signed);
            if inverse < T::ZERO {
                scale_vector(y, -T::ONE);
            }
            let factors = part(panel, i * place.ld + nx + i + 1, nu - i - 1);
            for (below, &factor) in below.chunks_exact_mut(ld.max(1)).zip(factors) {
                add_scaled(below, -factor, signed);
            }
        }
        // The rows of shared controls were not eliminated: they belong to `S`, whose other half
        // comes with the other column. Elements of `M` for two shared controls count once.
        for (w, j) in marked_indices(self.shared).enumerate().take_while(|(_, j)| *j < nu) {
            let (other, y) = (self.conditions + w, part_mut(self.eliminated, (begin + j) * ld, ld));
            for (c, &value) in y.iter().enumerate().take(self.count) {
                let control = c.checked_sub(self.conditions).map(|control| control * riccati.end.v);
                let of_both = control.and_then(|column| self.columns.get(column + begin + j).copied());
                let of_both = of_both.unwrap_or(T::ZERO);
                let value = if c < other { value - of_both } else { value };
                let value = if c == other { value + value - of_both } else { value };
                add(self.schur, c.min(other) * ld + c.max(other), value);
            }
            y.fill(T::ZERO);
            part_mut(controls, j * ld, ld).fill(T::ZERO);
        }
    }

    /// Computes `s` from the results of the backward sweep.
    fn gather(&mut self, qp: QpView<'_, T>, riccati: &mut Riccati<'_, T>) {
        copy_common(self.linear, self.offset);
        let ld = padded_len::<T>(self.count);
        for place in StageOffsetsIter::<T>::new(qp.dims) {
            let (begin, nu) = (place.v + place.nx, place.nu);
            let y = part_mut(riccati.y, begin, nu);
            for (w, j) in marked_indices(self.shared).enumerate().take_while(|(_, j)| *j < nu) {
                add(self.linear, self.conditions + w, y.get(j).copied().unwrap_or(T::ZERO));
                set(y, j, T::ZERO);
            }
            let own = part(self.eliminated, begin * ld, nu * ld).chunks_exact(ld.max(1));
            for ((own, &y), &inverse) in own.zip(&*y).zip(part(riccati.inverse, begin, nu)) {
                add_scaled(self.linear, if inverse < T::ZERO { y } else { -y }, own);
            }
        }
    }

    /// Solves for the first state and the changes of the parameters.
    fn solve_bordered_system(
        &mut self,
        riccati: &Riccati<'_, T>,
        units: Units<'_, T>,
        factor: bool,
    ) -> Result<(), QpError> {
        let (nx, n) = (self.free, self.free + self.count);
        if factor {
            self.write_bordered_matrix(riccati);
        }
        for (right, &p) in self.right.iter_mut().zip(&*self.first).take(nx) {
            *right = -p;
        }
        for (c, &linear) in self.linear.iter().enumerate() {
            let gap = self.residual.get(c).copied().unwrap_or(T::ZERO);
            set(self.right, nx + c, -(linear + gap));
        }
        let noise = T::from_f64(T::EPSILON);
        let is_scaled = !units.rows.is_empty();
        if is_scaled {
            self.scale_bordered_system(units, factor);
        }
        if factor {
            let inertia = Symmetric::factor(self.matrix, n, self.exchanged, noise);
            let negative = inertia.negative + riccati.negative;
            if negative > self.conditions || negative + inertia.vanished < self.conditions {
                return Err(QpError::NotConvex { stage: 0, index: 0, pivot: -1.0 });
            }
        }
        Symmetric::new(self.matrix, n, self.exchanged).solve(part_mut(self.right, 0, n));
        if is_scaled {
            self.scale_bordered_system(units, false);
        }
        copy_common(self.step, self.right.get(nx..).unwrap_or_default());
        Ok(())
    }

    /// Scales right-hand side and matrix of the bordered system: variables by their units,
    /// multipliers of periodic states by units of multipliers. Vanishing pivots are detected by
    /// their relative sizes.
    fn scale_bordered_system(&mut self, units: Units<'_, T>, matrix: bool) {
        let (nx, n) = (self.free, self.free + self.count);
        let first = self.first.len();
        for (right, unit) in
            self.right.iter_mut().zip(bordered_unknown_units(units, nx, first, self.periodic, self.shared))
        {
            *right = *right * unit;
        }
        if matrix {
            let columns = self.matrix.chunks_exact_mut(n.max(1));
            for (column, unit) in
                columns.zip(bordered_unknown_units(units, nx, first, self.periodic, self.shared))
            {
                for (element, other) in column.iter_mut().zip(bordered_unknown_units(
                    units,
                    nx,
                    first,
                    self.periodic,
                    self.shared,
                )) {
                    *element = *element * unit * other;
                }
            }
        }
    }

    /// Writes the lower triangle of `[P₀  Γ₀ + E; · S]`.
    fn write_bordered_matrix(&mut self, riccati: &Riccati<'_, T>) {
        let (nx, count) = (self.free, self.count);
        let (n, ld, ld_q) = (nx + count, padded_len::<T>(self.first.len()), padded_len::<T>(count));
        self.matrix.fill(T::ZERO);
        for j in 0..nx {
            let p = riccati.p.get(j * ld..).unwrap_or_default();
            for (i, &p) in p.iter().enumerate().take(nx).skip(j) {
                set(self.matrix, j * n + i, p);
            }
            for c in 0..count {
                let gamma = self.gamma.get(j * ld_q + c).copied().unwrap_or(T::ZERO);
                set(self.matrix, j * n + nx + c, gamma);
            }
        }
        for (c, i) in marked_indices(self.periodic).enumerate().filter(|_| nx > 0) {
            add(self.matrix, i * n + nx + c, T::ONE);
        }
        for b in 0..count {
            for c in b..count {
                let s = self.schur.get(b * ld_q + c).copied().unwrap_or(T::ZERO);
                set(self.matrix, (nx + b) * n + nx + c, s);
            }
        }
    }

    /// Distributes the first state and the step of the parameters for the forward sweep.
    #[inline(always)]
    fn distribute_parameter_step<E: Packed<T>>(&self, qp: QpView<'_, T>, riccati: &mut Riccati<'_, T>) {
        let ld = padded_len::<T>(self.count);
        let controls = self.step.get(self.conditions..).unwrap_or_default();
        for place in StageOffsetsIter::<T>::new(qp.dims) {
            let begin = place.v + place.nx;
            let y = part_mut(riccati.y, begin, place.nu);
            let own = part(self.eliminated, begin * ld, place.nu * ld).chunks_exact(ld.max(1));
            for (y, own) in y.iter_mut().zip(own) {
                *y = *y + dot::<T, E>(part(own, 0, self.count), self.step);
            }
            // The last stage has no controls.
            if place.nu > 0 {
                for (j, &step) in marked_indices(self.shared).zip(controls) {
                    set(y, j, -step);
                }
            }
        }
        copy_common(part_mut(riccati.y, 0, self.free), self.right);
    }
}

/// Returns the units of the first state, of multipliers of periodic states, and of shared controls.
fn bordered_unknown_units<'a, T: Real>(
    units: Units<'a, T>,
    free: usize,
    first: usize,
    periodic: &'a [T],
    shared: &'a [T],
) -> impl Iterator<Item = T> + use<'a, T> {
    let states = (0..free).map(move |i| units.of(i));
    let conditions = marked_indices(periodic).map(move |i| units.objective / units.of(i));
    states.chain(conditions).chain(marked_indices(shared).map(move |j| units.of(first + j)))
}
