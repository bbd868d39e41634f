//! One step of an explicit method: the stages one after the other, and the end.

use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, Kernel, are_finite, dispatch, dot_compensated, moved};
use crate::model::{ArrayK, ArrayV, ArrayW, ArrayX, Ode};
use crate::quadrature::{Along, Integrand};
use crate::result::Nominal;
use crate::scalar::Real;
use crate::scalar::lanes::REGISTERS;
use crate::shape::{Array, Shape};
use crate::tableau::Tableau;
use bytemuck::Zeroable;

/// Which state an equation determines: `ẋ_state = factor · f` where `f` is its residual at `ẋ = 0`.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub(crate) struct Row<T> {
    pub state: usize,
    pub factor: T,
}

/// What is the same in every call: the method in the number type, and the form of the model.
pub(crate) struct Scheme<M: Ode, T: Real, const S: usize> {
    pub a: [[T; S]; S],
    pub b: [T; S],
    pub c: [T; S],
    /// Of each equation.
    pub rows: ArrayK<M, Row<T>>,
    /// Of each direction `w`: whether the model has a second derivative with respect to its
    /// variable.
    pub curved: ArrayW<M, bool>,
}

impl<M: Ode, T: Real, const S: usize> Scheme<M, T, S> {
    pub fn new(tableau: &Tableau<S>) -> Self {
        let mut rows = ArrayK::<M, Row<T>>::from_fn(|_| Row { state: 0, factor: T::ZERO });
        for (state, &(row, coefficient)) in M::ROWS.iter().enumerate() {
            if let Some(row) = rows.as_mut().get_mut(row as usize) {
                *row = Row { state, factor: T::from_f64(-1.0 / coefficient) };
            }
        }
        let mut curved = ArrayW::<M, bool>::from_fn(|_| false);
        for entry in 0..M::STRUCTURE.hessian.len() {
            let directions = directions::<M>(entry).map(|(row, column)| [row, column]);
            for direction in directions.into_iter().flatten() {
                if let Some(curved) = curved.as_mut().get_mut(direction) {
                    *curved = true;
                }
            }
        }
        Self {
            a: tableau.a().map(|row| row.map(T::from_f64)),
            b: tableau.b().map(T::from_f64),
            c: tableau.c().map(T::from_f64),
            rows,
            curved,
        }
    }
}

/// The directions `w` of an entry of the Hessian: `x`, `u`, `p` are numbered alike among the
/// variables and the directions. `None` for an entry of `ẋ`, which occurs linearly.
pub(super) fn directions<M: Ode>(entry: usize) -> Option<(usize, usize)> {
    let (row, column) = M::STRUCTURE.hessian.at(entry);
    Some((row.checked_sub(M::Shape::NX)?, column.checked_sub(M::Shape::NX)?))
}

/// Equal steps from `start`.
#[derive(Clone, Copy)]
pub(crate) struct Grid<T> {
    pub start: T,
    /// Of one step.
    pub h: T,
    pub steps: usize,
    /// Whether sums over the steps are compensated.
    pub compensated: bool,
}

/// One step: its start and the derivatives at its stages.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Record<M: Ode, T: Real, const S: usize> {
    pub x: ArrayX<M, T>,
    pub k: [ArrayX<M, T>; S],
}

/// Variables and residual of the model at one stage. `ẋ` is zero, always.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Point<M: Ode, T: Real> {
    pub v: ArrayV<M, T>,
    pub f: ArrayK<M, T>,
    pub counts: Counts,
}

/// What the last call did.
#[derive(Clone, Copy, Default, Zeroable)]
pub(crate) struct Counts {
    pub steps: usize,
    pub residuals: usize,
    pub jacobians: usize,
}

impl<M: Ode, T: Real> Point<M, T> {
    /// Goes to stage `i`: `ξ_i = x_n + h Σ_{j<i} a_ij k_j` at `t_n + c_i h`.
    pub fn go<const S: usize>(
        &mut self,
        scheme: &Scheme<M, T, S>,
        grid: Grid<T>,
        record: &Record<M, T, S>,
        at: Place,
    ) -> Result<(), Error> {
        let nx = M::Shape::NX;
        let (Some(a), Some(&c)) = (scheme.a.get(at.stage), scheme.c.get(at.stage)) else { return Ok(()) };
        let state = &mut self.v.as_mut()[nx..2 * nx];
        state.fill(T::ZERO);
        for (&a, k) in a.iter().take(at.stage).zip(&record.k) {
            if a != T::ZERO {
                add(a, k.as_ref(), state);
            }
        }
        for (index, (xi, &x)) in state.iter_mut().zip(record.x.as_ref()).enumerate() {
            *xi = x + grid.h * *xi;
            if ONE_BY_ONE && !xi.is_finite() {
                return Err(Error::Overflow { step: at.step, index });
            }
        }
        if !ONE_BY_ONE && let Some(index) = not_finite(state) {
            return Err(Error::Overflow { step: at.step, index });
        }
        let time = T::from_whole(at.step) + c;
        self.v[M::Shape::NV - 1] = grid.start + grid.h * time;
        Ok(())
    }

    /// `k = g` at this point.
    pub fn derivative<const S: usize>(
        &mut self,
        scheme: &Scheme<M, T, S>,
        k: &mut ArrayX<M, T>,
        at: Place,
    ) -> Result<(), Error> {
        self.counts.residuals += 1;
        M::residual::<T>(&self.v, &mut self.f);
        check(self.f.as_ref(), Quantity::Residual, at, |equation| equation)?;
        self.assign(scheme, k);
        Ok(())
    }

    /// `k = g` at this point, and the Jacobian of the residual.
    pub fn derivative_jacobian<const S: usize>(
        &mut self,
        scheme: &Scheme<M, T, S>,
        k: &mut ArrayX<M, T>,
        jacobian: &mut M::Jacobian<T>,
        at: Place,
    ) -> Result<(), Error> {
        self.jacobian(jacobian, at)?;
        self.assign(scheme, k);
        Ok(())
    }

    /// The residual and its Jacobian at this point.
    pub fn jacobian(&mut self, jacobian: &mut M::Jacobian<T>, at: Place) -> Result<(), Error> {
        self.counts.jacobians += 1;
        M::residual_jacobian::<T>(&self.v, &mut self.f, jacobian);
        check(self.f.as_ref(), Quantity::Residual, at, |equation| equation)?;
        check(jacobian.as_ref(), Quantity::Jacobian, at, |entry| M::STRUCTURE.jacobian.at(entry).0)
    }

    /// The variables to where an integrand takes them from.
    pub fn show(&self, integrand: &mut dyn Integrand<M, T>) {
        for (to, from) in integrand.point().0.iter_mut().zip(self.v.as_ref()) {
            *to = *from;
        }
    }

    fn assign<const S: usize>(&self, scheme: &Scheme<M, T, S>, k: &mut ArrayX<M, T>) {
        for (row, &f) in scheme.rows.as_ref().iter().zip(self.f.as_ref()) {
            if let Some(k) = k.as_mut().get_mut(row.state) {
                *k = row.factor * f;
            }
        }
    }
}

impl<M: Ode, T: Real, const S: usize> Record<M, T, S> {
    /// All stages of the step.
    pub fn stages(
        &mut self,
        scheme: &Scheme<M, T, S>,
        grid: Grid<T>,
        point: &mut Point<M, T>,
        step: usize,
        along: &mut Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        for stage in 0..S {
            let at = Place { step, stage, iteration: 0 };
            point.go(scheme, grid, self, at)?;
            point.derivative(scheme, &mut self.k[stage], at)?;
            if let Some(integrand) = along {
                point.show(&mut **integrand);
                integrand.value(grid.h * scheme.b[stage], at)?;
            }
        }
        Ok(())
    }

    /// `x_{n+1} = x_n + h Σ_i b_i k_i`; `rest` is what was rounded off from `x_n`, if sums are
    /// compensated.
    pub fn end(
        &self,
        scheme: &Scheme<M, T, S>,
        grid: Grid<T>,
        step: usize,
        end: &mut ArrayX<M, T>,
        rest: Option<&mut ArrayX<M, T>>,
    ) -> Result<(), Error> {
        match rest {
            None => {
                end.as_mut().fill(T::ZERO);
                for (&b, k) in scheme.b.iter().zip(&self.k) {
                    add(b, k.as_ref(), end.as_mut());
                }
                for (end, &x) in end.as_mut().iter_mut().zip(self.x.as_ref()) {
                    *end = x + grid.h * *end;
                }
            }
            Some(rest) => {
                if step == 0 {
                    rest.as_mut().fill(T::ZERO);
                }
                let (end, rest) = (end.as_mut(), rest.as_mut());
                dispatch(EndCompensated { end, rest, record: self, b: &scheme.b, h: grid.h });
            }
        }
        match not_finite(end.as_ref()) {
            Some(index) => Err(Error::Overflow { step, index }),
            None => Ok(()),
        }
    }
}

/// `end + rest ← x + rest + h Σ_i b_i k_i`, where `rest` is less than `x` has digits for.
struct EndCompensated<'a, M: Ode, T: Real, const S: usize> {
    end: &'a mut [T],
    rest: &'a mut [T],
    record: &'a Record<M, T, S>,
    b: &'a [T; S],
    h: T,
}

impl<M: Ode, T: Real, const S: usize> Kernel for EndCompensated<'_, M, T, S> {
    type Number = T;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { end, rest, record, b, h } = self;
        let x = record.x.as_ref().iter();
        for (index, ((end, rest), &x)) in end.iter_mut().zip(rest).zip(x).enumerate() {
            let slopes = record.k.iter().filter_map(|k| k.as_ref().get(index));
            [*end, *rest] = moved::<A, T>([x, *rest], h, dot_compensated::<A, T>(b.iter().zip(slopes)));
        }
    }
}

/// What every call needs.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct Base<M: Ode, T: Real, const S: usize> {
    pub point: Point<M, T>,
    pub record: Record<M, T, S>,
    /// The state at the end of the step.
    pub x: ArrayX<M, T>,
    /// What was rounded off from it, if sums are compensated.
    pub rest: ArrayX<M, T>,
    pub result: Nominal<M, T>,
}

impl<M: Ode, T: Real, const S: usize> Base<M, T, S> {
    /// All steps, from `x` to `x`, with an integrand or without.
    pub fn run(
        &mut self,
        scheme: &Scheme<M, T, S>,
        grid: Grid<T>,
        along: &mut Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        for step in 0..grid.steps {
            self.record.x = self.x;
            self.record.stages(scheme, grid, &mut self.point, step, along)?;
            self.record.end(scheme, grid, step, &mut self.x, grid.compensated.then_some(&mut self.rest))?;
            self.point.counts.steps += 1;
        }
        Ok(())
    }

    /// All steps, from `x` to `x`, each of them kept; with an integrand or without.
    pub fn record(
        &mut self,
        scheme: &Scheme<M, T, S>,
        grid: Grid<T>,
        records: &mut [Record<M, T, S>],
        along: &mut Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        for (step, record) in records.iter_mut().enumerate() {
            record.x = self.x;
            record.stages(scheme, grid, &mut self.point, step, along)?;
            record.end(scheme, grid, step, &mut self.x, grid.compensated.then_some(&mut self.rest))?;
            self.point.counts.steps += 1;
        }
        Ok(())
    }
}

/// `sum += a y`
#[inline(always)]
pub(super) fn add<T: Real>(a: T, y: &[T], sum: &mut [T]) {
    for (sum, &y) in sum.iter_mut().zip(y) {
        *sum = *sum + a * y;
    }
}

/// Whether numbers are looked at one by one. Where registers take several of them all are, without
/// a branch for each.
const ONE_BY_ONE: bool = !REGISTERS;

/// The first value that is infinite or NaN.
#[inline(always)]
fn not_finite<T: Real>(values: &[T]) -> Option<usize> {
    if !ONE_BY_ONE && are_finite(values) { None } else { values.iter().position(|value| !value.is_finite()) }
}

/// The first value that is not finite is an error.
pub(super) fn check<T: Real>(
    values: &[T],
    quantity: Quantity,
    at: Place,
    equation: impl FnOnce(usize) -> usize,
) -> Result<(), Error> {
    match not_finite(values) {
        None => Ok(()),
        Some(i) => {
            Err(Error::NonFiniteModel { quantity, equation: equation(i), value: values[i].to_f64(), at })
        }
    }
}
