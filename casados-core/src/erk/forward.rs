//! First-order sensitivities along with the step: the variational equations of the stages.

use super::step::{Base, Grid, Point, Record, Scheme, add};
use crate::error::{Error, Place};
use crate::model::{ArrayX, Dae, Ode};
use crate::result::Seeds;
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Shape};
use bytemuck::Zeroable;
use core::ops::Range;

/// Derivatives of the state in the directions of the columns: `R` is the longest row, of which the
/// first `columns` elements are used.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct Variation<M: Ode, T: Real, R: Array<T>, const S: usize> {
    pub jacobian: M::Jacobian<T>,
    /// `dx_n`
    pub dx: ArrayX<M, R>,
    /// `dξ_i` of the current stage.
    pub dxi: ArrayX<M, R>,
    /// `dk_i`
    pub dk: [ArrayX<M, R>; S],
}

/// Directions in the space of `w = (x₀, u, p)`.
pub(super) trait Directions<M: Ode, T: Real>: Copy {
    /// How many.
    fn columns(self) -> usize;
    /// `row += coefficient · (direction of w_i)`
    fn add(self, i: usize, coefficient: T, row: &mut [T]);
}

/// All unit vectors.
#[derive(Clone, Copy)]
pub(super) struct Unit;

impl<M: Ode, T: Real> Directions<M, T> for Unit {
    #[inline(always)]
    fn columns(self) -> usize {
        M::Shape::NW
    }
    #[inline(always)]
    fn add(self, i: usize, coefficient: T, row: &mut [T]) {
        if let Some(element) = row.get_mut(i) {
            *element = *element + coefficient;
        }
    }
}

/// Columns of a seed matrix, from `first`.
pub(super) struct Seeded<'a, M: Ode, T: Real, const C: usize> {
    pub seeds: &'a Seeds<M, T, C>,
    pub first: usize,
    pub columns: usize,
}

impl<M: Ode, T: Real, const C: usize> Clone for Seeded<'_, M, T, C> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Ode, T: Real, const C: usize> Copy for Seeded<'_, M, T, C> {}

impl<M: Ode, T: Real, const C: usize> Directions<M, T> for Seeded<'_, M, T, C> {
    #[inline(always)]
    fn columns(self) -> usize {
        self.columns
    }
    #[inline(always)]
    fn add(self, i: usize, coefficient: T, row: &mut [T]) {
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

impl<M: Ode, T: Real, R: Array<T>, const S: usize> Variation<M, T, R, S> {
    /// All steps, from `x` to `x`, with the derivatives; `at_stage` sees each stage when `k_i` and
    /// `dξ_i` are known.
    pub fn run(
        &mut self,
        scheme: &Scheme<M, T, S>,
        grid: Grid<T>,
        base: &mut Base<M, T, S>,
        directions: impl Directions<M, T>,
        mut at_stage: impl FnMut(&Point<M, T>, &ArrayX<M, R>, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let columns = directions.columns();
        M::jacobian_constants::<T>(&mut self.jacobian);
        for (i, row) in self.dx.as_mut().iter_mut().enumerate() {
            let row = &mut row.as_mut()[..columns];
            row.fill(T::ZERO);
            directions.add(i, T::ONE, row);
        }
        for step in 0..grid.steps {
            let Base { point, record, x, rest, .. } = &mut *base;
            record.x = *x;
            self.stages(scheme, grid, (point, record), step, directions, &mut at_stage)?;
            record.end(scheme, grid, step, x, grid.compensated.then_some(rest))?;
            self.end(scheme, grid.h, columns);
            point.counts.steps += 1;
        }
        Ok(())
    }

    /// The stages of one step with their derivatives.
    fn stages(
        &mut self,
        scheme: &Scheme<M, T, S>,
        grid: Grid<T>,
        (point, record): (&mut Point<M, T>, &mut Record<M, T, S>),
        step: usize,
        directions: impl Directions<M, T>,
        at_stage: &mut impl FnMut(&Point<M, T>, &ArrayX<M, R>, Place) -> Result<(), Error>,
    ) -> Result<(), Error> {
        for stage in 0..S {
            let at = Place { step, stage, iteration: 0 };
            point.go(scheme, grid, record, at)?;
            point.derivative_jacobian(scheme, &mut record.k[stage], &mut self.jacobian, at)?;
            self.stage_state(scheme, grid.h, stage, directions.columns());
            at_stage(point, &self.dxi, at)?;
            self.stage_derivative(scheme, stage, directions);
        }
        Ok(())
    }

    /// `dξ_i = dx_n + h Σ_{j<i} a_ij dk_j`
    fn stage_state(&mut self, scheme: &Scheme<M, T, S>, h: T, stage: usize, columns: usize) {
        combine::<M, T, R>(&self.dx, h, &scheme.a[stage][..stage], &self.dk, columns, &mut self.dxi);
    }

    /// `dk_i = g_x dξ_i + g_w dw`
    fn stage_derivative(
        &mut self,
        scheme: &Scheme<M, T, S>,
        stage: usize,
        directions: impl Directions<M, T>,
    ) {
        let (nx, columns) = (M::Shape::NX, directions.columns());
        let Self { dk, dxi, jacobian, .. } = self;
        let Some(dk) = dk.get_mut(stage) else { return };
        for row in dk.as_mut() {
            row.as_mut()[..columns].fill(T::ZERO);
        }
        for entry in M::STRUCTURE.blocks[1]..M::STRUCTURE.blocks[5] {
            let (equation, variable) = M::STRUCTURE.jacobian.at(entry);
            let (Some(&value), Some(row)) =
                (jacobian.as_ref().get(entry), scheme.rows.as_ref().get(equation))
            else {
                continue;
            };
            let Some(sum) = dk.as_mut().get_mut(row.state) else { continue };
            let (coefficient, sum, w) = (row.factor * value, &mut sum.as_mut()[..columns], variable - nx);
            if let (true, Some(dxi)) = (w < nx, dxi.as_ref().get(w)) {
                add(coefficient, dxi.as_ref(), sum);
            } else {
                directions.add(w, coefficient, sum);
            }
        }
    }

    /// `dx_{n+1} = dx_n + h Σ_i b_i dk_i`, in the place of `dx_n`.
    fn end(&mut self, scheme: &Scheme<M, T, S>, h: T, columns: usize) {
        combine::<M, T, R>(&self.dx, h, &scheme.b, &self.dk, columns, &mut self.dxi);
        self.dx.as_mut().copy_from_slice(self.dxi.as_ref());
    }
}

/// Copies row-major `rows` to columns of a matrix of the result. A value that is not finite is an
/// error.
pub(super) fn write<T: Real, R: Array<T>>(
    rows: &[R],
    source: Range<usize>,
    target: &mut impl Matrix<T>,
    first: usize,
    step: usize,
) -> Result<(), Error> {
    for (r, row) in rows.iter().enumerate() {
        for (column, &value) in row.as_ref()[source.clone()].iter().enumerate() {
            if !value.is_finite() {
                return Err(Error::Overflow { step, index: r });
            }
            target[(r, first + column)] = value;
        }
    }
    Ok(())
}

/// `sum = start + h Σ_j weights_j rates_j`, row by row.
fn combine<M: Dae, T: Real, R: Array<T>>(
    start: &ArrayX<M, R>,
    h: T,
    weights: &[T],
    rates: &[ArrayX<M, R>],
    columns: usize,
    sum: &mut ArrayX<M, R>,
) {
    for (row, (sum, start)) in sum.as_mut().iter_mut().zip(start.as_ref()).enumerate() {
        let sum = &mut sum.as_mut()[..columns];
        sum.fill(T::ZERO);
        for (&weight, rate) in weights.iter().zip(rates) {
            if weight != T::ZERO {
                add(weight, rate[row].as_ref(), sum);
            }
        }
        for (sum, &start) in sum.iter_mut().zip(start.as_ref()) {
            *sum = start + h * *sum;
        }
    }
}
