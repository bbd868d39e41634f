//! The interface of an integrator beyond its calls.

use crate::adaptive::{self, AdaptiveOptions};
use crate::batch::vector;
use crate::error::Error;
use crate::integrator::Integrator;
use crate::memory::Heap;
use crate::model::{ArrayK, Dae, Ode, VectorU, VectorX};
use crate::options::Options;
use crate::result::Forward;
use crate::shape::Matrix;
use crate::tableau::Method;
use crate::{erk, irk};
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// An integrator of one interval: `Irk`, `Erk` and `Adaptive` of `f64` on the heap.
#[doc(hidden)]
pub trait Interval: Integrator<Number = f64, Memory = Heap> + Sized + Send + 'static {
    /// Its options.
    type Options: Default + Clone + Send + Sync + 'static;
    /// The stages of all steps.
    type Tape: Default + Clone + Send + 'static;

    /// Creates an integrator with these options.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    fn build(options: &Self::Options) -> Result<Self, Error>;
    /// The number of successive model evaluations, if it is independent of the equations.
    fn depth(options: &Self::Options) -> Option<usize>;
    /// Whether steps have to be chosen before the first call: see [`Interval::choose`].
    const CHOOSES: bool = false;
    /// Chooses the steps of all later calls.
    ///
    /// # Errors
    /// Those of the integrator.
    fn choose_steps(&mut self, at: &IntervalStart<Self::Model>) -> Result<(), Error> {
        let _ = at;
        Ok(())
    }
    /// Whether it computes algebraic states that are consistent with a state.
    const FINDS_ALGEBRAIC_STATES: bool = false;
    /// Computes algebraic states `ζ(x, u, p)` that are consistent with a state, and derivatives: of
    /// first order, and of second order of `νᵀζ` if `nu` is not empty.
    ///
    /// # Errors
    /// Those of the integrator.
    fn consistent(
        &mut self,
        at: &IntervalStart<Self::Model>,
        nu: &[f64],
        to: &mut Consistent,
    ) -> Result<(), Error> {
        let _ = (at, nu, to);
        Err(Error::NoInterpolation)
    }

    /// Whether stages can be recorded: those of implicit methods.
    const RECORDS: bool = false;
    /// Copies the stages of the last call, if they can be recorded.
    ///
    /// # Errors
    /// [`Error::NoResult`]
    fn record_stages(&mut self, tape: &mut Self::Tape) -> Result<bool, Error> {
        let _ = tape;
        Ok(false)
    }
    /// Discards restored stages after an error.
    fn discard_stages(&mut self) {}
    /// Restores stages: the next call only differentiates them.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn restore_stages(&mut self, tape: &Self::Tape) -> Result<(), Error> {
        let _ = tape;
        Ok(())
    }
}

/// Algebraic states `ζ(x, u, p)`, and their derivatives with respect to `(x, u, p)`.
#[derive(Clone, Debug, Default)]
pub struct Consistent {
    /// `ζ`
    pub z: Vec<f64>,
    /// `∂ζ/∂(x, u, p)`, column by column.
    pub jacobian: Vec<f64>,
    /// `∇²(νᵀζ)`
    pub hessian: Vec<f64>,
}

/// The start of an interval, its control and its length.
pub struct IntervalStart<M: Dae> {
    /// The state at the start.
    pub x0: VectorX<M, f64>,
    /// The control.
    pub u: VectorU<M, f64>,
    /// The length.
    pub h: f64,
}

impl<M: Dae, B: Method<S> + 'static, const S: usize> Interval for irk::Integrator<M, B, S, f64, Heap> {
    type Options = Options;
    type Tape = Vec<ArrayK<M, [f64; S]>>;

    fn build(options: &Options) -> Result<Self, Error> {
        Self::new(*options)
    }
    fn depth(_: &Options) -> Option<usize> {
        None
    }

    const RECORDS: bool = true;
    fn record_stages(&mut self, tape: &mut Self::Tape) -> Result<bool, Error> {
        tape.resize(self.options().steps, Zeroable::zeroed());
        self.copy_stages(tape).map(|()| true)
    }
    fn restore_stages(&mut self, tape: &Self::Tape) -> Result<(), Error> {
        self.set_solution(tape)
    }
    fn discard_stages(&mut self) {
        self.reset();
    }

    const FINDS_ALGEBRAIC_STATES: bool = true;
    /// All stages of an interval of length zero are at its start.
    fn consistent(&mut self, at: &IntervalStart<M>, nu: &[f64], to: &mut Consistent) -> Result<(), Error> {
        let copy = |to: &mut Consistent, result: &Forward<M>| {
            to.z.clear();
            to.z.extend(result.z0.as_slice());
            to.jacobian.clear();
            for block in [result.dz0_dx0.as_slice(), result.dz0_du.as_slice(), result.dz0_dp.as_slice()] {
                to.jacobian.extend(block);
            }
        };
        if nu.is_empty() {
            let result = self.forward(&at.x0, &at.u, 0.0)?;
            copy(to, result);
        } else {
            let result = self.hessian_with_z0(&at.x0, &at.u, 0.0, &Zeroable::zeroed(), &vector(nu))?;
            copy(to, result);
            to.hessian.resize(super::blocks::second::<M>().len(), 0.0);
            super::blocks::concatenate(&result.second_derivative_blocks(), &mut to.hessian);
        }
        Ok(())
    }
}

impl<M: Ode, B: Method<S> + 'static, const S: usize> Interval for erk::Integrator<M, B, S, f64, Heap> {
    type Options = Options;
    type Tape = ();

    fn build(options: &Options) -> Result<Self, Error> {
        Self::new(*options)
    }
    fn depth(options: &Options) -> Option<usize> {
        Some(S.saturating_mul(options.steps))
    }
}

// `Engine` is sealed, and its integrators are `Send` only if their states are.
impl<M: Dae, B: adaptive::Engine<M, f64> + 'static> Interval for adaptive::Integrator<M, B, f64>
where
    Self: Send,
{
    type Options = AdaptiveOptions;
    type Tape = ();
    const CHOOSES: bool = true;

    fn build(options: &AdaptiveOptions) -> Result<Self, Error> {
        Self::new(*options)
    }
    fn depth(_: &AdaptiveOptions) -> Option<usize> {
        None
    }
    fn choose_steps(&mut self, at: &IntervalStart<M>) -> Result<(), Error> {
        self.solve(&at.x0, &at.u, at.h)?;
        self.freeze()
    }
}
