//! Consistent `ẋ` and `z` at a point: the solution of `f(ẋ, x, u, z, p, t) = 0` for given `x`.
//!
//! It is one stage of the explicit Euler method, whose stage is at the start of the step.

use crate::error::Error;
use crate::irk::{Coefficients, From, Step, Work};
use crate::model::{ArrayK, Dae, VectorP, VectorU};
use crate::options::Options;
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use crate::statistics::Statistics;
use crate::tableau::{Euler, Method};
use alloc::boxed::Box;
use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_box;

/// Solves for `(ẋ, z)`.
pub(super) struct Consistent<M: Dae, T: Real> {
    coefficients: Coefficients<T, 1>,
    memory: Option<Box<Memory<M, T>>>,
}

#[derive(Zeroable)]
#[zeroable(bound = "")]
struct Memory<M: Dae, T: Real> {
    work: Work<M, T, 1>,
    step: [Step<M, T, 1>; 1],
}

impl<M: Dae, T: Real> Default for Consistent<M, T> {
    fn default() -> Self {
        Self { coefficients: Coefficients::new(Euler::TABLEAU), memory: None }
    }
}

impl<M: Dae, T: Real> Consistent<M, T> {
    /// From the start values in `y`: `(ẋ, z)` there.
    ///
    /// # Errors
    /// Those of Newton's method, which name the equation or the unknown.
    pub fn solve(
        &mut self,
        x: &[T],
        u: &VectorU<M, T>,
        p: &VectorP<M, T>,
        t: T,
        y: &mut ArrayK<M, T>,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        let out_of_memory = Error::OutOfMemory { bytes: size_of::<Memory<M, T>>() };
        if self.memory.is_none() {
            self.memory = Some(try_zeroed_box().map_err(|()| out_of_memory)?);
        }
        let Memory { work, step } = self.memory.as_deref_mut().ok_or(out_of_memory)?;
        work.prepare();
        work.inputs.u = *u;
        work.inputs.p = *p;
        work.inputs.time.start = t;
        work.inputs.time.interval = T::ZERO;
        work.inputs.time.step = T::ZERO;
        work.given = *y;
        work.x.as_mut().copy_from_slice(x);
        let options = Options::default();
        work.integrate(&self.coefficients, &options, &From::Given, step, statistics, |_, _, _, _, _| Ok(()))?;
        for (to, [from]) in y.as_mut().iter_mut().zip(step[0].y.as_ref()) {
            *to = *from;
        }
        Ok(())
    }
}

/// Whether `u` and `p` of a model lie where they should: after `(ẋ, x, z)`.
pub(super) fn place_inputs<M: Dae, T: Real>(point: &mut [T], u: &VectorU<M, T>, p: &VectorP<M, T>) {
    let begin = 2 * M::Shape::NX + M::Shape::NZ;
    for (to, from) in point.iter_mut().skip(begin).zip(u.as_slice().iter().chain(p.as_slice())) {
        *to = *from;
    }
}
