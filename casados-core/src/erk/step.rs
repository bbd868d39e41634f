//! One step of an explicit method: its stages, and its end.

use super::non_finite::{CHECK_EACH_VALUE, NonFiniteLanes};
use super::scheme::{Grid, Scheme, is_zero};
use super::stage_integrand::StageIntegrand;
use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, axpy_compensated, dispatch, dot_compensated, kernels, run_plain};
use crate::model::{ArrayK, ArrayV, ArrayX, Ode};
use crate::result::Nominal;
use crate::scalar::{Lanes, Strided};
use crate::shape::{InBounds, Shape};
use bytemuck::Zeroable;

/// A number or a SIMD register in the arrays of the model, with stride one.
pub(crate) type UnitStride<E> = Strided<E, 1>;

/// One step: its initial state and the derivatives at its stages.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct StepRecord<M: Ode, E: Lanes, const S: usize> {
    pub x: ArrayX<M, E>,
    pub k: [ArrayX<M, E>; S],
}

/// Variables and residual of the model at one stage. `ẋ` is always zero.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct StagePoint<M: Ode, E: Lanes> {
    pub v: ArrayV<M, [E; 1]>,
    pub f: ArrayK<M, [E; 1]>,
    pub non_finite: NonFiniteLanes<E>,
    pub counts: EvaluationCounts,
}

/// Numbers of steps and evaluations of the last call.
#[derive(Clone, Copy, Default, Zeroable)]
pub(crate) struct EvaluationCounts {
    pub steps: usize,
    pub residuals: usize,
    pub jacobians: usize,
}

impl<M: Ode, E: Lanes> StagePoint<M, E> {
    /// The variables.
    pub fn variables(&self) -> &[E] {
        self.v.as_ref().as_flattened()
    }

    /// The variables.
    pub fn variables_mut(&mut self) -> &mut [E] {
        self.v.as_mut().as_flattened_mut()
    }

    /// Moves to stage `i`: `ξ_i = x_n + h Σ_{j<i} a_ij k_j` at `t_n + c_i h`.
    pub fn move_to_stage<const S: usize>(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        record: &StepRecord<M, E, S>,
        at: Place,
    ) -> Result<(), Error> {
        let error = |index| Error::Overflow { step: at.step, index };
        if let Some(index) = place(scheme, grid, record, at, &mut self.v) {
            return Err(error(index));
        }
        if const { CHECK_EACH_VALUE && E::LANES == 1 } {
            return Ok(());
        }
        let state = &self.v.as_ref()[M::Shape::NX..2 * M::Shape::NX];
        self.non_finite.check(state.as_flattened(), |index, _| error(index))
    }

    /// Evaluates `k = g` at this point.
    pub fn derivative<const S: usize>(
        &mut self,
        scheme: &Scheme<M, E, S>,
        k: &mut ArrayX<M, E>,
        at: Place,
    ) -> Result<(), Error> {
        self.counts.residuals += 1;
        M::residual::<UnitStride<E>>(&self.v, &mut self.f);
        self.check_residual(at)?;
        assign(scheme, &self.f, k);
        Ok(())
    }

    /// Evaluates `k = g` at this point, and the Jacobian of the residual.
    pub fn derivative_jacobian<const S: usize>(
        &mut self,
        scheme: &Scheme<M, E, S>,
        k: &mut ArrayX<M, E>,
        jacobian: &mut M::Jacobian<[E; 1]>,
        at: Place,
    ) -> Result<(), Error> {
        self.jacobian(jacobian, at)?;
        assign(scheme, &self.f, k);
        Ok(())
    }

    /// Evaluates the residual and its Jacobian at this point.
    pub fn jacobian(&mut self, jacobian: &mut M::Jacobian<[E; 1]>, at: Place) -> Result<(), Error> {
        self.counts.jacobians += 1;
        M::residual_jacobian::<UnitStride<E>>(&self.v, &mut self.f, jacobian);
        self.check_residual(at)?;
        // The entries of `ẋ`, which come first, are constants in an explicit model.
        let first = M::STRUCTURE.blocks[1];
        let entries = jacobian.as_ref().as_flattened().get(first..).in_bounds().unwrap_or_default();
        self.check(entries, Quantity::Jacobian, at, |entry| M::STRUCTURE.jacobian.at(first + entry).0)
    }

    fn check_residual(&mut self, at: Place) -> Result<(), Error> {
        let Self { f, non_finite, .. } = self;
        check(non_finite, f.as_ref().as_flattened(), Quantity::Residual, at, |equation| equation)
    }

    /// Checks values of the model: a non-finite one is an error, or for SIMD lanes marks its lane.
    pub fn check(
        &mut self,
        values: &[E],
        quantity: Quantity,
        at: Place,
        equation: impl FnOnce(usize) -> usize,
    ) -> Result<(), Error> {
        check(&mut self.non_finite, values, quantity, at, equation)
    }
}

fn check<E: Lanes>(
    non_finite: &mut NonFiniteLanes<E>,
    values: &[E],
    quantity: Quantity,
    at: Place,
    equation: impl FnOnce(usize) -> usize,
) -> Result<(), Error> {
    non_finite.check(values, |index, value| Error::NonFiniteModel {
        quantity,
        equation: equation(index),
        value,
        at,
    })
}

kernels! { by run_plain;
    /// Writes the state and the time of a stage. Returns the first non-finite state, if scalars are
    /// checked one by one.
    fn place [M: Ode, E: Lanes, const S: usize] [M, E, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        grid: &'k Grid<E>,
        record: &'k StepRecord<M, E, S>,
        at: Place,
        v: &'k mut ArrayV<M, [E; 1]>,
    ) -> Option<usize> {
        let nx = M::Shape::NX;
        let v = v.as_mut().as_flattened_mut();
        let (a, c) = (scheme.a.get(at.stage)?, scheme.c.get(at.stage)?);
        let state = &mut v[nx..2 * nx];
        state.fill(E::zeroed());
        for (&a, k) in a.iter().take(at.stage).zip(&record.k) {
            if !is_zero(a) {
                add::<A, E>(a, k.as_ref(), state);
            }
        }
        for (index, (xi, &x)) in state.iter_mut().zip(record.x.as_ref()).enumerate() {
            *xi = A::add(x, grid.h, *xi);
            if const { CHECK_EACH_VALUE && E::LANES == 1 } && !E::all(xi.is_finite()) {
                return Some(index);
            }
        }
        let time = E::from_whole(at.step) + *c;
        v[M::Shape::NV - 1] = A::add(grid.start_time, grid.h, time);
        None
    }

    /// Computes the derivatives from the residuals.
    fn assign [M: Ode, E: Lanes, const S: usize] [M, E, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        f: &'k ArrayK<M, [E; 1]>,
        k: &'k mut ArrayX<M, E>,
    ) {
        for (row, &[f]) in scheme.equations.as_ref().iter().zip(f.as_ref()) {
            if let Some(k) = k.as_mut().get_mut(row.state).in_bounds() {
                *k = row.factor * f;
            }
        }
    }

    /// `x_{n+1} = x_n + h Σ_i b_i k_i`
    fn advance [M: Ode, E: Lanes, const S: usize] [M, E, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        h: &'k E,
        record: &'k StepRecord<M, E, S>,
        end: &'k mut ArrayX<M, E>,
    ) {
        end.as_mut().fill(E::zeroed());
        for (&b, k) in scheme.b.iter().zip(&record.k) {
            add::<A, E>(b, k.as_ref(), end.as_mut());
        }
        for (end, &x) in end.as_mut().iter_mut().zip(record.x.as_ref()) {
            *end = A::add(x, *h, *end);
        }
    }
}

kernels! { by dispatch;
    /// `end + rest ← x + rest + h Σ_i b_i k_i`, with the compensation `rest` below the last digit
    /// of `x`.
    fn advance_compensated [M: Ode, E: Lanes, const S: usize] [M, E, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        h: &'k E,
        record: &'k StepRecord<M, E, S>,
        end: &'k mut [E],
        rest: &'k mut [E],
    ) {
        let x = record.x.as_ref().iter();
        for (index, ((end, rest), &x)) in end.iter_mut().zip(rest).zip(x).enumerate() {
            let slopes = record.k.iter().filter_map(|k| k.as_ref().get(index));
            let slope = dot_compensated::<A, E>(scheme.b.iter().zip(slopes));
            [*end, *rest] = axpy_compensated::<A, E>([x, *rest], *h, slope);
        }
    }
}

impl<M: Ode, E: Lanes, const S: usize> StepRecord<M, E, S> {
    /// Computes all stages of the step.
    pub fn stages(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        point: &mut StagePoint<M, E>,
        step: usize,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> Result<(), Error> {
        for stage in 0..S {
            let at = Place { step, stage, iteration: 0 };
            point.move_to_stage(scheme, grid, self, at)?;
            point.derivative(scheme, &mut self.k[stage], at)?;
            integrand.add_value(point.variables(), [grid.h, scheme.b[stage]], at)?;
        }
        Ok(())
    }

    /// `x_{n+1} = x_n + h Σ_i b_i k_i`, with an optional compensation of `x_n`.
    pub fn advance(
        &self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        step: usize,
        end: &mut ArrayX<M, E>,
        compensation: Option<&mut ArrayX<M, E>>,
        non_finite: &mut NonFiniteLanes<E>,
    ) -> Result<(), Error> {
        match compensation {
            None => advance(scheme, &grid.h, self, end),
            Some(rest) => {
                if step == 0 {
                    rest.as_mut().fill(E::zeroed());
                }
                advance_compensated(scheme, &grid.h, self, end.as_mut(), rest.as_mut());
            }
        }
        non_finite.check(end.as_ref(), |index, _| Error::Overflow { step, index })
    }
}

/// The workspace of all calls.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct StepWorkspace<M: Ode, E: Lanes, const S: usize> {
    pub point: StagePoint<M, E>,
    pub record: StepRecord<M, E, S>,
    /// State at the end of the step.
    pub x: ArrayX<M, E>,
    /// Compensation of `x`, if sums are compensated.
    pub compensation: ArrayX<M, E>,
    pub result: Nominal<M, E>,
}

impl<M: Ode, E: Lanes, const S: usize> StepWorkspace<M, E, S> {
    /// Integrates over all steps; updates `x`.
    pub fn integrate(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> Result<(), Error> {
        let Self { point, record, x, compensation: rest, .. } = self;
        for step in 0..grid.steps {
            record.x = *x;
            record.stages(scheme, grid, point, step, integrand)?;
            let rest = grid.compensated.then_some(&mut *rest);
            record.advance(scheme, grid, step, x, rest, &mut point.non_finite)?;
            point.counts.steps += 1;
        }
        Ok(())
    }

    /// Integrates over all steps and records each of them; updates `x`.
    pub fn record_steps(
        &mut self,
        scheme: &Scheme<M, E, S>,
        grid: &Grid<E>,
        records: &mut [StepRecord<M, E, S>],
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> Result<(), Error> {
        let Self { point, x, compensation: rest, .. } = self;
        for (step, record) in records.iter_mut().enumerate() {
            record.x = *x;
            record.stages(scheme, grid, point, step, integrand)?;
            let rest = grid.compensated.then_some(&mut *rest);
            record.advance(scheme, grid, step, x, rest, &mut point.non_finite)?;
            point.counts.steps += 1;
        }
        Ok(())
    }
}

/// `sum += a y`
#[inline(always)]
pub(super) fn add<A: Arithmetic, E: Lanes>(a: E, y: &[E], sum: &mut [E]) {
    for (sum, &y) in sum.iter_mut().zip(y) {
        *sum = A::add(*sum, a, y);
    }
}
