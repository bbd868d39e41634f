//! Calls of an integrator whose types are chosen by the name of a case.

use crate::case::{Case, Family, Mode, Values};
use crate::models::{Awe, Chain, Pendulum};
use casados::model::{VectorU, VectorX};
use casados::prelude::*;
use casados::result::{Adjoint, Forward, Hessian, Nominal};
use casados::shape::{Matrix, Shape};
use casados::{Batch, BatchError, Error, Integrator, Intervals, Statistics, batch};
use std::hint::black_box;

/// An integrator with its inputs in place.
pub trait Calls {
    /// One call with an input of the case.
    ///
    /// # Errors
    /// Those of the integrator.
    fn call(&mut self, mode: Mode, input: usize) -> Result<(), Error>;
    /// One call with every input, whose results are kept: what a batch is compared with, which
    /// keeps them too.
    ///
    /// # Errors
    /// Those of the integrator.
    fn call_all(&mut self, mode: Mode) -> Result<(), Error>;
    /// What one call gives.
    ///
    /// # Errors
    /// Those of the integrator.
    fn values(&mut self, mode: Mode, input: usize) -> Result<Values, Error>;
    /// What the last call did.
    fn statistics(&self) -> Statistics;
}

/// Options as in the tables: iterations end at a tolerance for the whole interval, zero for
/// rounding.
#[must_use]
pub fn options(case: &Case, tolerance: f64, start: Start) -> Options {
    let newton = Newton { tolerance: tolerance / case.steps as f64, ..Default::default() };
    Options { steps: case.steps, newton, start, ..Default::default() }
}

/// All intervals of a case in one call of a batch, from zero.
pub trait Together {
    /// The call.
    ///
    /// # Errors
    /// Those of the batch.
    fn call(&mut self, mode: Mode) -> Result<(), BatchError>;
    /// What it gives for the first interval.
    ///
    /// # Errors
    /// Those of the batch.
    fn values(&mut self, mode: Mode) -> Result<Values, BatchError>;
}

/// The batch of a case, if its method has one.
///
/// # Errors
/// The error of the batch.
pub fn open_batch(case: &Case, options: Options) -> Result<Option<Box<dyn Together>>, String> {
    use Family::{Gauss as G, Radau};
    macro_rules! choose {
        ($($model:literal, $nx:literal, $family:pat, $stages:pat => $type:ty, $method:ty;)*) => {
            match (case.model, case.nx, case.family, case.stages) {
                $(($model, $nx, $family, $stages) => {
                    let batch = Batch::<$type, $method>::new(options).map_err(|e| e.to_string())?;
                    Ok(Some(Box::new(Side::new(case, batch))))
                })*
                _ => Ok(None),
            }
        };
    }
    choose! {
        "pendulum", 4, G, 2 => Pendulum, Gauss<2>;
        "pendulum", 4, G, 4 => Pendulum, Gauss<4>;
        "awe", 23, Radau, 4 => Awe, RadauIIA<4>;
        "chain", 9, G, 2 => Chain<9>, Gauss<2>;
        "chain", 9, G, 4 => Chain<9>, Gauss<4>;
        "chain", 21, G, 2 => Chain<21>, Gauss<2>;
        "chain", 21, G, 4 => Chain<21>, Gauss<4>;
        "chain", 33, G, 2 => Chain<33>, Gauss<2>;
        "chain", 33, G, 4 => Chain<33>, Gauss<4>;
        "chain", 45, G, 2 => Chain<45>, Gauss<2>;
        "chain", 45, G, 4 => Chain<45>, Gauss<4>;
        "chain", 189, G, 2 => Chain<189>, Gauss<2>;
        "chain", 189, G, 4 => Chain<189>, Gauss<4>;
    }
}

/// The integrator of a case.
///
/// # Errors
/// A case that was not compiled in; or the error of the integrator.
pub fn open(case: &Case, options: Options) -> Result<Box<dyn Calls>, String> {
    use Family::{Gauss as G, Radau, Rk4 as Explicit};
    macro_rules! choose {
        ($($model:literal, $nx:literal, $family:pat, $stages:pat => $type:ty, $integrator:ty;)*) => {
            match (case.model, case.nx, case.family, case.stages) {
                $(($model, $nx, $family, $stages) => {
                    let integrator = <$integrator>::new(options).map_err(|e| e.to_string())?;
                    Ok(Box::new(Typed::<$type, _>::new(case, integrator)))
                })*
                _ => Err(format!("{} is not compiled in", case.name)),
            }
        };
    }
    choose! {
        "pendulum", 4, G, 2 => Pendulum, Irk<Pendulum, Gauss<2>>;
        "pendulum", 4, G, 4 => Pendulum, Irk<Pendulum, Gauss<4>>;
        "pendulum", 4, Explicit, _ => Pendulum, Erk<Pendulum, casados::Rk4>;
        "awe", 23, Radau, 4 => Awe, Irk<Awe, RadauIIA<4>>;
        "chain", 9, G, 2 => Chain<9>, Irk<Chain<9>, Gauss<2>>;
        "chain", 9, G, 4 => Chain<9>, Irk<Chain<9>, Gauss<4>>;
        "chain", 21, G, 1 => Chain<21>, Irk<Chain<21>, Gauss<1>>;
        "chain", 21, G, 2 => Chain<21>, Irk<Chain<21>, Gauss<2>>;
        "chain", 21, G, 3 => Chain<21>, Irk<Chain<21>, Gauss<3>>;
        "chain", 21, G, 4 => Chain<21>, Irk<Chain<21>, Gauss<4>>;
        "chain", 21, G, 5 => Chain<21>, Irk<Chain<21>, Gauss<5>>;
        "chain", 21, Explicit, _ => Chain<21>, Erk<Chain<21>, casados::Rk4>;
        "chain", 33, G, 2 => Chain<33>, Irk<Chain<33>, Gauss<2>>;
        "chain", 33, G, 4 => Chain<33>, Irk<Chain<33>, Gauss<4>>;
        "chain", 45, G, 2 => Chain<45>, Irk<Chain<45>, Gauss<2>>;
        "chain", 45, G, 4 => Chain<45>, Irk<Chain<45>, Gauss<4>>;
        "chain", 45, Explicit, _ => Chain<45>, Erk<Chain<45>, casados::Rk4>;
        "chain", 69, G, 2 => Chain<69>, Irk<Chain<69>, Gauss<2>>;
        "chain", 69, G, 4 => Chain<69>, Irk<Chain<69>, Gauss<4>>;
        "chain", 93, G, 2 => Chain<93>, Irk<Chain<93>, Gauss<2>>;
        "chain", 93, G, 4 => Chain<93>, Irk<Chain<93>, Gauss<4>>;
        "chain", 189, G, 2 => Chain<189>, Irk<Chain<189>, Gauss<2>>;
        "chain", 189, G, 4 => Chain<189>, Irk<Chain<189>, Gauss<4>>;
        "chain", 381, G, 2 => Chain<381>, Irk<Chain<381>, Gauss<2>>;
        "chain", 381, G, 4 => Chain<381>, Irk<Chain<381>, Gauss<4>>;
    }
}

struct Typed<M: Dae, I> {
    integrator: I,
    inputs: Vec<(VectorX<M, f64>, VectorU<M, f64>)>,
    lambda: VectorX<M, f64>,
    h: f64,
    results: Results<M>,
}

/// Places of results, one for each input, once they are asked for.
struct Results<M: Dae> {
    nominal: Vec<Nominal<M>>,
    forward: Vec<Forward<M>>,
    adjoint: Vec<Adjoint<M>>,
    hessian: Vec<Hessian<M>>,
}

impl<M: Dae> Results<M> {
    const NONE: Self =
        Self { nominal: Vec::new(), forward: Vec::new(), adjoint: Vec::new(), hessian: Vec::new() };
}

/// So many places.
fn places<R: Default>(results: &mut Vec<R>, count: usize) -> &mut [R] {
    results.resize_with(count, Default::default);
    results
}

/// A vector of the model's own type.
fn vector<V: Matrix<f64>>(numbers: &[f64]) -> V {
    let mut vector = V::zeroed();
    vector.as_mut_slice().copy_from_slice(numbers);
    vector
}

/// The elements by rows.
fn rows<V: Matrix<f64>>(matrix: &V, row: usize) -> impl Iterator<Item = f64> {
    (0..V::COLUMNS).map(move |j| matrix[(row, j)])
}

impl<M: Dae, I: Integrator<Model = M, Number = f64, Memory = Heap>> Typed<M, I> {
    fn new(case: &Case, integrator: I) -> Self {
        let inputs = case.inputs.iter().map(|(x0, u)| (vector(x0), vector(u))).collect();
        Self { integrator, inputs, lambda: vector(&case.lambda), h: case.t, results: Results::NONE }
    }
}

fn jacobian<M: Dae>(result: &Forward<M>) -> Vec<f64> {
    (0..M::Shape::NX).flat_map(|i| rows(&result.dx_dx0, i).chain(rows(&result.dx_du, i))).collect()
}

fn triangle<M: Dae>(result: &Hessian<M>) -> Vec<f64> {
    let (nx, nw) = (M::Shape::NX, M::Shape::NX + M::Shape::NU);
    let lower = |i: usize, j: usize| match (i < nx, j < nx) {
        (true, _) => result.h_xx[(i, j)],
        (false, true) => result.h_xu[(j, i - nx)],
        (false, false) => result.h_uu[(i - nx, j - nx)],
    };
    (0..nw).flat_map(|i| (0..=i).map(move |j| lower(i, j))).collect()
}

/// A batch with its intervals and its results in place.
struct Side<M: Dae, B, const S: usize> {
    batch: batch::Integrator<M, B, S, f64>,
    x0: Vec<VectorX<M, f64>>,
    u: Vec<VectorU<M, f64>>,
    lambda: Vec<VectorX<M, f64>>,
    h: f64,
    results: Results<M>,
}

impl<M: Dae, B, const S: usize> Side<M, B, S> {
    fn new(case: &Case, batch: batch::Integrator<M, B, S, f64>) -> Self {
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

impl<M: Dae, B: Send + Sync, const S: usize> Together for Side<M, B, S> {
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
                let nominal = places(&mut results.nominal, count);
                batch.solve(&intervals, nominal)?;
                black_box(nominal);
            }
            Mode::Forward => {
                let forward = places(&mut results.forward, count);
                batch.forward(&intervals, forward)?;
                black_box(forward);
            }
            Mode::Adjoint => {
                let adjoint = places(&mut results.adjoint, count);
                batch.adjoint(&intervals, lambda, adjoint)?;
                black_box(adjoint);
            }
            Mode::Hessian => {
                let hessian = places(&mut results.hessian, count);
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
            Mode::Simulation => of_nominal(&self.results.nominal[0], &mut values),
            Mode::Forward => of_forward(&self.results.forward[0], &mut values),
            Mode::Adjoint => of_adjoint(&self.results.adjoint[0], &mut values),
            Mode::Hessian => of_hessian(&self.results.hessian[0], &mut values),
        }
        Ok(values)
    }
}

fn of_nominal<M: Dae>(result: &Nominal<M>, values: &mut Values) {
    values.x = result.x.as_slice().to_vec();
}

fn of_forward<M: Dae>(result: &Forward<M>, values: &mut Values) {
    of_nominal(result, values);
    values.forward = jacobian(result);
}

fn of_adjoint<M: Dae>(result: &Adjoint<M>, values: &mut Values) {
    of_nominal(result, values);
    values.adjoint = [result.grad_x0.as_slice(), result.grad_u.as_slice()].concat();
}

fn of_hessian<M: Dae>(result: &Hessian<M>, values: &mut Values) {
    of_forward(result, values);
    values.adjoint = [result.grad_x0.as_slice(), result.grad_u.as_slice()].concat();
    values.hessian = triangle(result);
}

impl<M: Dae, I: Integrator<Model = M, Number = f64, Memory = Heap>> Calls for Typed<M, I> {
    fn call(&mut self, mode: Mode, input: usize) -> Result<(), Error> {
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
                for (place, ($x0, $u)) in places(&mut results.$results, inputs.len()).iter_mut().zip(inputs) {
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

    fn values(&mut self, mode: Mode, input: usize) -> Result<Values, Error> {
        let (x0, u) = &self.inputs[input];
        let mut values = Values::default();
        match mode {
            Mode::Simulation => of_nominal(self.integrator.solve(x0, u, self.h)?, &mut values),
            Mode::Forward => of_forward(self.integrator.forward(x0, u, self.h)?, &mut values),
            Mode::Adjoint => of_adjoint(self.integrator.adjoint(x0, u, self.h, &self.lambda)?, &mut values),
            Mode::Hessian => of_hessian(self.integrator.hessian(x0, u, self.h, &self.lambda)?, &mut values),
        }
        Ok(values)
    }

    fn statistics(&self) -> Statistics {
        self.integrator.statistics()
    }
}
