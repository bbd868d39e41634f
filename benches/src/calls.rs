//! Calls of an integrator whose types are chosen by the name of a case.

mod batched;
mod results;
mod single;

use crate::case::{Case, Family, Mode, Values};
use crate::models::{Awe, Chain, Pendulum};
use batched::BatchOfCalls;
use casados::prelude::*;
use casados::{Batch, BatchError, Error, Statistics};
use single::SingleCalls;

/// An integrator with its inputs in place.
pub trait IntegratorCalls {
    /// One call with an input of the case.
    ///
    /// # Errors
    /// Those of the integrator.
    fn call_input(&mut self, mode: Mode, input: usize) -> Result<(), Error>;
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
    fn results_of(&mut self, mode: Mode, input: usize) -> Result<Values, Error>;
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
pub trait BatchCalls {
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
pub fn open_batch(case: &Case, options: Options) -> Result<Option<Box<dyn BatchCalls>>, String> {
    use Family::{Gauss as G, Radau};
    macro_rules! choose {
        ($($model:literal, $nx:literal, $family:pat, $stages:pat => $type:ty, $method:ty;)*) => {
            match (case.model, case.nx, case.family, case.stages) {
                $(($model, $nx, $family, $stages) => {
                    let batch = Batch::<$type, $method>::new(options).map_err(|e| e.to_string())?;
                    Ok(Some(Box::new(BatchOfCalls::new(case, batch))))
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
pub fn open_calls(case: &Case, options: Options) -> Result<Box<dyn IntegratorCalls>, String> {
    use Family::{Gauss as G, Radau, Rk4 as Explicit};
    macro_rules! choose {
        ($($model:literal, $nx:literal, $family:pat, $stages:pat => $type:ty, $integrator:ty;)*) => {
            match (case.model, case.nx, case.family, case.stages) {
                $(($model, $nx, $family, $stages) => {
                    let integrator = <$integrator>::new(options).map_err(|e| e.to_string())?;
                    Ok(Box::new(SingleCalls::<$type, _>::new(case, integrator)))
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
