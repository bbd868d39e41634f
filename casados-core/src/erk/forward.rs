//! First-order sensitivities: the variational equations of the stages, integrated with the state.

use super::non_finite::NonFiniteLanes;
use super::scheme::{Grid, Scheme, is_zero};
use super::step::{StagePoint, StepRecord, StepWorkspace, UnitStride, add};
use super::tiles::{self, ColumnKernel, for_each_tile};
use crate::error::{Error, Place};
use crate::linalg::{Arithmetic, kernels, run_plain};
use crate::model::{ArrayX, Ode};
use crate::result::Seeds;
use crate::scalar::{Lanes, Real};
use crate::shape::{Array, InBounds, Matrix, Shape, copy};
use bytemuck::Zeroable;
use core::marker::PhantomData;
use core::ops::Range;

/// Derivatives of the state in the directions of the columns. `R` is a row of maximal length, of
/// which the first `columns` elements are used.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Variation<M: Ode, E: Lanes, R: Array<E>, const S: usize> {
    pub jacobian: M::Jacobian<[E; 1]>,
    /// `dx_n`
    pub dx: ArrayX<M, R>,
    /// `dξ_i` of the current stage.
    pub dxi: ArrayX<M, R>,
    /// `dk_i`
    pub dk: [ArrayX<M, R>; S],
}

/// Directions in the space of `w = (x₀, u, p)`.
pub(crate) trait Directions<M: Ode, E: Lanes>: Copy {
    /// Number of directions.
    fn columns(self) -> usize;
    /// `row += coefficient · (row i of the directions)`
    fn add_scaled(self, i: usize, coefficient: E, row: &mut [E]);
}

/// All unit vectors.
#[derive(Clone, Copy)]
pub(super) struct UnitDirections;

impl<M: Ode, E: Lanes> Directions<M, E> for UnitDirections {
    #[inline(always)]
    fn columns(self) -> usize {
        M::Shape::NW
    }
    #[inline(always)]
    fn add_scaled(self, i: usize, coefficient: E, row: &mut [E]) {
        if let Some(element) = row.get_mut(i).in_bounds() {
            *element = *element + coefficient;
        }
    }
}

/// Columns of a seed matrix, from `first` on.
pub(super) struct SeedDirections<'a, M: Ode, T: Real, const C: usize> {
    pub seeds: &'a Seeds<M, T, C>,
    pub first: usize,
    pub columns: usize,
}

copy!(['a, M: Ode, T: Real, const C: usize] SeedDirections<'a, M, T, C>);

impl<M: Ode, T: Real, const C: usize> Directions<M, T> for SeedDirections<'_, M, T, C> {
    #[inline(always)]
    fn columns(self) -> usize {
        self.columns
    }
    #[inline(always)]
    fn add_scaled(self, i: usize, coefficient: T, row: &mut [T]) {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        for (column, value) in row.iter_mut().enumerate() {
            let column = self.first + column;
            let Seeds { x0, u, p } = self.seeds;
            let seed = if i < nx {
                x0.as_slice().get(column * nx + i)
            } else if i < nx + nu {
                u.as_slice().get(column * nu + i - nx)
            } else {
                p.as_slice().get(column * M::Shape::NP + i - nx - nu)
            };
            if let Some(&seed) = seed {
                *value = *value + coefficient * seed;
            }
        }
    }
}

impl<M: Ode, E: Lanes, R: Array<E>, const S: usize> Variation<M, E, R, S> {
    /// Integrates over all steps with the derivatives; updates the state of the workspace. Calls
    /// `on_stage` at each stage with its `dξ_i`.
    pub fn integrate(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        workspace: &mut StepWorkspace<M, E, S>,
        directions: impl Directions<M, E>,
        mut on_stage: impl FnMut(&mut StagePoint<M, E>, &ArrayX<M, R>, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        M::jacobian_constants::<UnitStride<E>>(&mut self.jacobian);
        begin::<M, E, R, _>(E::from_f64(1.0), &mut self.dx, directions);
        for step in 0..grid.steps {
            let StepWorkspace { point, record, x, compensation: rest, .. } = &mut *workspace;
            record.x = *x;
            self.stages(scheme, grid, (point, record), step, directions, &mut on_stage)?;
            record.advance(scheme, grid, step, x, grid.compensated.then_some(rest), &mut point.non_finite)?;
            self.advance(scheme, &grid.h, directions);
            point.counts.steps += 1;
        }
        Ok(())
    }

    /// Computes the stages of one step and their derivatives.
    fn stages(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        (point, record): (&mut StagePoint<M, E>, &mut StepRecord<M, E, S>),
        step: usize,
        directions: impl Directions<M, E>,
        on_stage: &mut impl FnMut(&mut StagePoint<M, E>, &ArrayX<M, R>, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        for stage in 0..S {
            let at = Place { step, stage, iteration: 0 };
            point.move_to_stage(scheme, grid, record, at)?;
            point.derivative_jacobian(scheme, &mut record.k[stage], &mut self.jacobian, at)?;
            self.stage_state(scheme, &grid.h, stage, directions);
            on_stage(point, &self.dxi, at)?;
            let Self { dk, dxi, jacobian, .. } = self;
            if let Some(dk) = dk.get_mut(stage).in_bounds() {
                stage_derivative::<M, E, R, _, S>(scheme, jacobian, dxi, directions, dk);
            }
        }
        Ok(())
    }

    /// Computes `dk_i` with a given Jacobian.
    #[cfg(feature = "alloc")]
    pub fn stage_derivative(
        &mut self,
        scheme: &Scheme<M, E, S>,
        jacobian: &M::Jacobian<[E; 1]>,
        stage: usize,
        directions: impl Directions<M, E>,
    ) {
        if let Some(dk) = self.dk.get_mut(stage).in_bounds() {
            stage_derivative::<M, E, R, _, S>(scheme, jacobian, &self.dxi, directions, dk);
        }
    }

    /// `dξ_i = dx_n + h Σ_{j<i} a_ij dk_j`
    pub fn stage_state(
        &mut self,
        scheme: &Scheme<M, E, S>,
        h: &E,
        stage: usize,
        directions: impl Directions<M, E>,
    ) {
        let weights = &scheme.a[stage][..stage];
        combine::<M, E, R, _>(&self.dx, h, weights, &self.dk, directions, &mut self.dxi);
    }

    /// `dx_n ← dx_n + h Σ_i b_i dk_i`
    pub fn advance(&mut self, scheme: &Scheme<M, E, S>, h: &E, directions: impl Directions<M, E>) {
        combine::<M, E, R, _>(&self.dx, h, &scheme.b, &self.dk, directions, &mut self.dxi);
        self.dx.as_mut().copy_from_slice(self.dxi.as_ref());
    }
}

kernels! { by run_plain;
    /// Sets `dx` to the directions, one row per state.
    pub fn begin [M: Ode, E: Lanes, R: Array<E>, D: Directions<M, E>] [M, E, R, D] <A>(
        one: E,
        dx: &'k mut ArrayX<M, R>,
        directions: D,
    ) {
        let columns = directions.columns();
        for (i, row) in dx.as_mut().iter_mut().enumerate() {
            let row = &mut row.as_mut()[..columns];
            row.fill(E::zeroed());
            directions.add_scaled(i, one, row);
        }
    }

    /// `dk_i = g_x dξ_i + g_w dw`
    fn stage_derivative [M: Ode, E: Lanes, R: Array<E>, D: Directions<M, E>, const S: usize] [M, E, R, D, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        jacobian: &'k M::Jacobian<[E; 1]>,
        dxi: &'k ArrayX<M, R>,
        directions: D,
        dk: &'k mut ArrayX<M, R>,
    ) {
        let columns = directions.columns();
        if const { E::LANES == 1 } {
            for row in dk.as_mut() {
                row.as_mut()[..columns].fill(E::zeroed());
            }
            return add_entries::<A, M, E, R, D, S>(M::STRUCTURE.blocks[1], scheme, jacobian, dxi, directions, dk);
        }
        // Entries of states are in row order.
        let mut begin = M::STRUCTURE.blocks[1];
        for (equation, row) in scheme.equations.as_ref().iter().enumerate() {
            let is_other = |&entry: &usize| M::STRUCTURE.jacobian.at(entry).0 != equation;
            let end = M::STRUCTURE.blocks[2];
            let entries = begin..(begin..end).find(is_other).unwrap_or(end);
            begin = entries.end;
            let Some(dk) = dk.as_mut().get_mut(row.state).in_bounds() else { continue };
            let (factor, dk) = (row.factor, dk.as_mut());
            for_each_tile::<A, _, 4>(0, columns, &mut JacobianRowProduct::<M, E, R> { entries, jacobian, factor, dxi, dk });
        }
        add_entries::<A, M, E, R, D, S>(begin, scheme, jacobian, dxi, directions, dk);
    }

    /// `sum = start + h Σ_j weights_j rates_j`, row by row.
    fn combine [M: Ode, E: Lanes, R: Array<E>, D: Directions<M, E>] [M, E, R, D] <A>(
        start: &'k ArrayX<M, R>,
        h: &'k E,
        weights: &'k [E],
        rates: &'k [ArrayX<M, R>],
        directions: D,
        sum: &'k mut ArrayX<M, R>,
    ) {
        let columns = directions.columns();
        if const { E::LANES == 1 } {
            return combine_numbers::<A, M, E, R>(start, *h, weights, rates, columns, sum);
        }
        for (row, (sum, start)) in sum.as_mut().iter_mut().zip(start.as_ref()).enumerate() {
            let (sum, start) = (&mut sum.as_mut()[..columns], start.as_ref());
            for_each_tile::<A, _, 4>(0, columns, &mut RowCombination { start, h: *h, weights, rates, row, sum, row_type: PhantomData });
        }
    }

    /// See [`copy_to_columns`].
    fn copy [E: Lanes, R: Array<E>, K: Matrix<E>] [E, R, K] <A>(
        rows: &'k [R],
        source: Range<usize>,
        target: &'k mut K,
        first: usize,
        non_finite: &'k mut NonFiniteLanes<E>,
    ) {
        let mut finite = non_finite.finite_lanes();
        for (r, row) in rows.iter().enumerate() {
            for (column, &value) in row.as_ref()[source.clone()].iter().enumerate() {
                finite = E::and(finite, value.is_finite());
                target[(r, first + column)] = value;
            }
        }
        non_finite.set_finite_lanes(finite);
    }
}

/// Adds the entries of the Jacobian from `first` on to `dk_i`.
#[inline(always)]
fn add_entries<A: Arithmetic, M: Ode, E: Lanes, R: Array<E>, D: Directions<M, E>, const S: usize>(
    first: usize,
    scheme: &Scheme<M, E, S>,
    jacobian: &M::Jacobian<[E; 1]>,
    dxi: &ArrayX<M, R>,
    directions: D,
    dk: &mut ArrayX<M, R>,
) {
    let (nx, columns) = (M::Shape::NX, directions.columns());
    for entry in first..M::STRUCTURE.blocks[5] {
        let (equation, variable) = M::STRUCTURE.jacobian.at(entry);
        let (Some(&[value]), Some(row)) =
            (jacobian.as_ref().get(entry).in_bounds(), scheme.equations.as_ref().get(equation).in_bounds())
        else {
            continue;
        };
        let Some(sum) = dk.as_mut().get_mut(row.state).in_bounds() else { continue };
        let (coefficient, sum, w) = (row.factor * value, &mut sum.as_mut()[..columns], variable - nx);
        if let (true, Some(dxi)) = (w < nx, dxi.as_ref().get(w)) {
            add::<A, E>(coefficient, dxi.as_ref(), sum);
        } else {
            directions.add_scaled(w, coefficient, sum);
        }
    }
}

/// [`combine`] for scalars: compiled once for the stages and the end of the step.
#[inline]
fn combine_numbers<A: Arithmetic, M: Ode, E: Lanes, R: Array<E>>(
    start: &ArrayX<M, R>,
    h: E,
    weights: &[E],
    rates: &[ArrayX<M, R>],
    columns: usize,
    sum: &mut ArrayX<M, R>,
) {
    for (row, (sum, start)) in sum.as_mut().iter_mut().zip(start.as_ref()).enumerate() {
        let sum = &mut sum.as_mut()[..columns];
        sum.fill(E::zeroed());
        for (&weight, rate) in weights.iter().zip(rates) {
            if !is_zero(weight) {
                add::<A, E>(weight, rate[row].as_ref(), sum);
            }
        }
        for (sum, &start) in sum.iter_mut().zip(start.as_ref()) {
            *sum = A::add(start, h, *sum);
        }
    }
}

/// A row of the product of the Jacobian with `dξ`.
struct JacobianRowProduct<'a, M: Ode, E: Lanes, R: Array<E>> {
    entries: Range<usize>,
    jacobian: &'a M::Jacobian<[E; 1]>,
    factor: E,
    dxi: &'a ArrayX<M, R>,
    dk: &'a mut [E],
}

impl<M: Ode, E: Lanes, R: Array<E>> ColumnKernel for JacobianRowProduct<'_, M, E, R> {
    #[inline(always)]
    fn process_columns<A: Arithmetic, const W: usize>(&mut self, first: usize) {
        let mut sum = [E::zeroed(); W];
        for entry in self.entries.clone() {
            let w = M::STRUCTURE.jacobian.at(entry).1 - M::Shape::NX;
            if let (Some(&[value]), Some(dxi)) =
                (self.jacobian.as_ref().get(entry).in_bounds(), self.dxi.as_ref().get(w).in_bounds())
            {
                tiles::add::<A, E, W>(&mut sum, self.factor * value, dxi.as_ref(), first);
            }
        }
        tiles::store(&sum, self.dk, first);
    }
}

/// A row of [`combine`].
struct RowCombination<'a, E, R, X> {
    start: &'a [E],
    h: E,
    weights: &'a [E],
    rates: &'a [X],
    row: usize,
    sum: &'a mut [E],
    row_type: PhantomData<R>,
}

impl<E: Lanes, R: Array<E>, X: Array<R>> ColumnKernel for RowCombination<'_, E, R, X> {
    #[inline(always)]
    fn process_columns<A: Arithmetic, const W: usize>(&mut self, first: usize) {
        let mut sum = [E::zeroed(); W];
        for (&weight, rate) in self.weights.iter().zip(self.rates) {
            if let (false, Some(rate)) = (is_zero(weight), rate.as_ref().get(self.row)) {
                tiles::add::<A, E, W>(&mut sum, weight, rate.as_ref(), first);
            }
        }
        for (sum, start) in sum.iter_mut().zip(tiles::load::<E, W>(self.start, first)) {
            *sum = A::add(start, self.h, *sum);
        }
        tiles::store(&sum, self.sum, first);
    }
}

/// Copies row-major `rows` to columns of a matrix of the result. A non-finite value is an error, or
/// for SIMD lanes marks its lane.
pub(super) fn copy_to_columns<E: Lanes, R: Array<E>>(
    rows: &[R],
    source: Range<usize>,
    target: &mut impl Matrix<E>,
    first: usize,
    step: usize,
    non_finite: &mut NonFiniteLanes<E>,
) -> Result<(), Error> {
    if const { E::LANES > 1 } {
        copy(rows, source, target, first, non_finite);
        return Ok(());
    }
    for (r, row) in rows.iter().enumerate() {
        for (column, &value) in row.as_ref()[source.clone()].iter().enumerate() {
            if !E::all(value.is_finite()) {
                return Err(Error::Overflow { step, index: r });
            }
            target[(r, first + column)] = value;
        }
    }
    Ok(())
}
