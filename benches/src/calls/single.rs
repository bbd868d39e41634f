//! One interval in each call.

use super::IntegratorCalls;
use super::results::{
    Results, allocate, values_of_adjoint, values_of_forward, values_of_hessian, values_of_nominal, vector,
};
use crate::case::{Case, Mode, Values};
use casados::model::{VectorU, VectorX};
use casados::prelude::*;
use casados::{Error, Integrator, Statistics};
use std::hint::black_box;

/// An integrator with its inputs and results.
pub(super) struct SingleCalls<M: Dae, I> {
    integrator: I,
    inputs: Vec<(VectorX<M, f64>, VectorU<M, f64>)>,
    lambda: VectorX<M, f64>,
    h: f64,
    results: Results<M>,
}

impl<M: Dae, I: Integrator<Model = M, Number = f64, Memory = Heap>> SingleCalls<M, I> {
    pub(super) fn new(case: &Case, integrator: I) -> Self {
        let inputs = case.inputs.iter().map(|(x0, u)| (vector(x0), vector(u))).collect();
        Self { integrator, inputs, lambda: vector(&case.lambda), h: case.t, results: Results::NONE }
    }
}

impl<M: Dae, I: Integrator<Model = M, Number = f64, Memory = Heap>> IntegratorCalls for SingleCalls<M, I> {
    fn call_input(&mut self, mode: Mode, input: usize) -> Result<(), Error> {
        let (x0, u) = black_box(&self.inputs[input]);
        let lambda = black_box(&self.lambda);
        match mode {
            Mode::Simulation => drop(black_box(self.integrator.solve(x0, u, self.h)?)),
            Mode::Forward => drop(black_box(self.integrator.forward(x0, u, self.h)?)),
            Mode::Adjoint => drop(black_box(self.integrator.adjoint(x0, u, self.h, lambda)?)),
            Mode::Hessian => drop(black_box(self.integrator.hessian(x0, u, self.h, lambda)?)),
        }
        Ok(())
    }

    fn call_all(&mut self, mode: Mode) -> Result<(), Error> {
        let Self { integrator, inputs, lambda, h, results } = self;
        let (inputs, lambda, h) = (black_box(&**inputs), black_box(&*lambda), *h);
        macro_rules! keep {
            ($results:ident, |$x0:ident, $u:ident| $call:expr) => {{
                for (place, ($x0, $u)) in allocate(&mut results.$results, inputs.len()).iter_mut().zip(inputs)
                {
                    place.clone_from($call?);
                }
                black_box(&results.$results);
            }};
        }
        match mode {
            Mode::Simulation => keep!(nominal, |x0, u| integrator.solve(x0, u, h)),
            Mode::Forward => keep!(forward, |x0, u| integrator.forward(x0, u, h)),
            Mode::Adjoint => keep!(adjoint, |x0, u| integrator.adjoint(x0, u, h, lambda)),
            Mode::Hessian => keep!(hessian, |x0, u| integrator.hessian(x0, u, h, lambda)),
        }
        Ok(())
    }

    fn results_of(&mut self, mode: Mode, input: usize) -> Result<Values, Error> {
        let (x0, u) = &self.inputs[input];
        let mut values = Values::default();
        match mode {
            Mode::Simulation => values_of_nominal(self.integrator.solve(x0, u, self.h)?, &mut values),
            Mode::Forward => values_of_forward(self.integrator.forward(x0, u, self.h)?, &mut values),
            Mode::Adjoint => {
                values_of_adjoint(self.integrator.adjoint(x0, u, self.h, &self.lambda)?, &mut values)
            }
            Mode::Hessian => {
                values_of_hessian(self.integrator.hessian(x0, u, self.h, &self.lambda)?, &mut values)
            }
        }
        Ok(values)
    }

    fn statistics(&self) -> Statistics {
        self.integrator.statistics()
    }
}
