//! All intervals in one call of a batch.

use super::BatchCalls;
use super::results::{
    Results, allocate, values_of_adjoint, values_of_forward, values_of_hessian, values_of_nominal, vector,
};
use crate::case::{Case, Mode, Values};
use casados::batch::Single;
use casados::model::{VectorU, VectorX};
use casados::{BatchError, Intervals, batch};
use std::hint::black_box;

/// A batch with its intervals and its results in place.
pub(super) struct BatchOfCalls<I: Single<Number = f64>> {
    batch: batch::Integrator<I>,
    x0: Vec<VectorX<I::Model, f64>>,
    u: Vec<VectorU<I::Model, f64>>,
    lambda: Vec<VectorX<I::Model, f64>>,
    h: f64,
    results: Results<I::Model>,
}

impl<I: Single<Number = f64>> BatchOfCalls<I> {
    pub(super) fn new(case: &Case, batch: batch::Integrator<I>) -> Self {
        Self {
            batch,
            x0: case.inputs.iter().map(|(x0, _)| vector(x0)).collect(),
            u: case.inputs.iter().map(|(_, u)| vector(u)).collect(),
            lambda: vec![vector(&case.lambda); case.inputs.len()],
            h: case.t,
            results: Results::NONE,
        }
    }
}

impl<I: Single<Number = f64>> BatchCalls for BatchOfCalls<I> {
    fn call(&mut self, mode: Mode) -> Result<(), BatchError> {
        let Self { batch, x0, u, lambda, h, results } = self;
        let count = x0.len();
        let intervals = Intervals {
            x0: black_box(x0),
            u: black_box(u),
            h: core::slice::from_ref(h),
            ..Default::default()
        };
        match mode {
            Mode::Simulation => {
                let nominal = allocate(&mut results.nominal, count);
                batch.solve(&intervals, nominal)?;
                black_box(nominal);
            }
            Mode::Forward => {
                let forward = allocate(&mut results.forward, count);
                batch.forward(&intervals, forward)?;
                black_box(forward);
            }
            Mode::Adjoint => {
                let adjoint = allocate(&mut results.adjoint, count);
                batch.adjoint(&intervals, lambda, adjoint)?;
                black_box(adjoint);
            }
            Mode::Hessian => {
                let hessian = allocate(&mut results.hessian, count);
                batch.hessian(&intervals, lambda, hessian)?;
                black_box(hessian);
            }
        }
        Ok(())
    }

    fn values(&mut self, mode: Mode) -> Result<Values, BatchError> {
        self.call(mode)?;
        let mut values = Values::default();
        match mode {
            Mode::Simulation => values_of_nominal(&self.results.nominal[0], &mut values),
            Mode::Forward => values_of_forward(&self.results.forward[0], &mut values),
            Mode::Adjoint => values_of_adjoint(&self.results.adjoint[0], &mut values),
            Mode::Hessian => values_of_hessian(&self.results.hessian[0], &mut values),
        }
        Ok(values)
    }
}
