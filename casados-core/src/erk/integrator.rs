//! An explicit integrator: construction, settings, simulation. Its derivatives are in
//! `sensitivities`.

use super::engine::Engine;
use super::scheme::Grid;
use crate::error::{Argument, Error};
use crate::integrator::Integrator as _;
#[cfg(feature = "alloc")]
use crate::memory::Heap;
use crate::memory::{Fallback, Inline, Memory};
use crate::model::{Ode, VectorP, VectorU, VectorX};
use crate::options::Options;
use crate::result::Nominal;
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use crate::statistics::Statistics;
use crate::tableau::{Custom, Method, Tableau};
use core::marker::PhantomData;

/// An explicit Runge-Kutta integrator of model `M` with method `B`, which has `S` stages.
///
/// An interval of length `h` is divided into [`Options::steps`] equal steps. Derivatives are those
/// of the discrete map, exact to rounding.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::{Vector1, vector};
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
///     [x[1], u]
/// }
///
/// let mut erk = Erk::<Cart, Rk4>::new(Options { steps: 2, ..Default::default() })?;
/// let step = erk.forward(&vector![0.0, 1.0], &Vector1::new(2.0), 0.5)?;
/// assert!((step.x - vector![0.75, 2.0]).norm() < 1e-14);
/// assert!((step.dx_du - vector![0.125, 0.5]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
pub struct Integrator<M: Ode, B, const S: usize, T: Real, W: Memory> {
    pub(super) engine: Engine<M, T, S, W>,
    pub(super) options: Options,
    pub(super) start_time: T,
    pub(super) parameters_set: bool,
    method: PhantomData<fn() -> B>,
}

#[cfg(feature = "alloc")]
impl<M: Ode, B: Method<S>, const S: usize, T: Real> Integrator<M, B, S, T, Heap> {
    /// Returns an integrator with its memory on the heap.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    pub fn new(options: Options) -> Result<Self, Error> {
        const { assert!(B::TABLEAU.is_explicit(), "the tableau of this method is not explicit") };
        Self::build(options, &B::TABLEAU)
    }
}

#[cfg(feature = "alloc")]
impl<M: Ode, const S: usize, T: Real> Integrator<M, Custom<S>, S, T, Heap> {
    /// Returns an integrator for a user-defined tableau, with its memory on the heap.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]; [`Error::NotExplicit`] if the tableau is implicit.
    pub fn with_tableau(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Self::build(options, &tableau)
    }
}

impl<M: Ode, B: Method<S>, const S: usize, T: Real, Mode: 'static, const STEPS: usize, F: Fallback>
    Integrator<M, B, S, T, Inline<Mode, STEPS, F>>
where
    Inline<Mode, STEPS, F>: Memory,
{
    /// Returns an integrator that contains its memory, for at most `STEPS` steps.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    pub fn inline(options: Options) -> Result<Self, Error> {
        const { assert!(B::TABLEAU.is_explicit(), "the tableau of this method is not explicit") };
        Self::build(options, &B::TABLEAU)
    }
}

impl<M: Ode, const S: usize, T: Real, Mode: 'static, const STEPS: usize, F: Fallback>
    Integrator<M, Custom<S>, S, T, Inline<Mode, STEPS, F>>
where
    Inline<Mode, STEPS, F>: Memory,
{
    /// Returns an integrator for a user-defined tableau that contains its memory, for at most
    /// `STEPS` steps.
    ///
    /// # Errors
    /// As `with_tableau`.
    pub fn inline_with_tableau(options: Options, tableau: Tableau<S>) -> Result<Self, Error> {
        Self::build(options, &tableau)
    }
}

/// Copies options, parameters and time. The copy has its own memory, which is empty until its first
/// call. Parameters that cannot be allocated are as if never set.
#[cfg(feature = "alloc")]
impl<M: Ode, B, const S: usize, T: Real> Clone for Integrator<M, B, S, T, Heap> {
    fn clone(&self) -> Self {
        let mut engine: Engine<M, T, S, Heap> = Engine::with_scheme(self.engine.scheme.clone());
        let source = self.engine.workspace.get().filter(|_| self.parameters_set && M::Shape::NP > 0);
        let mut parameters_set = M::Shape::NP == 0;
        if let (Some(from), Ok(to)) = (source, <Heap>::nominal(&mut engine.workspace)) {
            to.point.v = from.point.v;
            parameters_set = true;
        }
        Self {
            engine,
            options: self.options,
            start_time: self.start_time,
            parameters_set,
            method: PhantomData,
        }
    }
}

impl<M: Ode, B, const S: usize, T: Real, W: Memory> core::fmt::Debug for Integrator<M, B, S, T, W> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let model = M::STRUCTURE.name;
        f.debug_struct("Erk").field("model", &model).field("options", &self.options).finish_non_exhaustive()
    }
}

impl<M: Ode, B, const S: usize, T: Real, W: Memory> Integrator<M, B, S, T, W> {
    /// Size of the integrator in bytes. With [`Inline`] memory this is its total memory.
    pub const SIZE: usize = size_of::<Self>();

    pub(crate) fn build(options: Options, tableau: &Tableau<S>) -> Result<Self, Error> {
        options.check()?;
        if let Some(stage) = tableau.first_implicit_stage() {
            return Err(Error::NotExplicit { stage });
        }
        if options.steps > W::STEPS {
            return Err(Error::InvalidOption {
                option: "steps",
                value: options.steps as f64,
                reason: "`Inline<_, STEPS>` has memory for fewer steps: raise `STEPS`",
            });
        }
        Ok(Self {
            engine: Engine::new(tableau),
            options,
            start_time: T::ZERO,
            parameters_set: M::Shape::NP == 0,
            method: PhantomData,
        })
    }

    /// Returns the options.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// Returns the statistics of the last call.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        self.engine.statistics()
    }

    /// Sets the parameters of all following calls.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last parameters remain valid.
    pub fn set_parameters(&mut self, p: &VectorP<M, T>) -> Result<(), Error> {
        check_finite_input::<M, T>(p.as_slice(), Argument::P)?;
        let base = W::nominal(&mut self.engine.workspace)?;
        let first = 2 * M::Shape::NX + M::Shape::NU;
        base.point.variables_mut()[first..first + M::Shape::NP].copy_from_slice(p.as_slice());
        self.parameters_set = true;
        Ok(())
    }

    /// Sets the time at the start of the interval for all following calls; the default is zero.
    ///
    /// # Errors
    /// [`Error::NonFiniteInput`]; the last time remains valid.
    pub fn set_time(&mut self, t0: T) -> Result<(), Error> {
        check_finite_input::<M, T>(&[t0], Argument::T)?;
        self.start_time = t0;
        Ok(())
    }

    /// Returns the state at the end of an interval of length `h`.
    ///
    /// # Errors
    /// Non-finite inputs or model values, parameters that were never set, overflow;
    /// [`Error::OutOfMemory`] in the first call of a mode.
    pub fn solve(&mut self, x0: &VectorX<M, T>, u: &VectorU<M, T>, h: T) -> Result<&Nominal<M, T>, Error> {
        self.solve_with_quadrature(x0, u, h, None)
    }

    /// Checks the inputs, and sets the state to the start of the interval.
    pub(super) fn begin_call(
        &mut self,
        x0: &VectorX<M, T>,
        u: &VectorU<M, T>,
        h: T,
    ) -> Result<Grid<T>, Error> {
        let [state, variables] = self.engine.begin()?;
        if !self.parameters_set {
            return Err(Error::ParametersNotSet);
        }
        check_finite_input::<M, T>(x0.as_slice(), Argument::X0)?;
        check_finite_input::<M, T>(u.as_slice(), Argument::U)?;
        check_finite_input::<M, T>(&[h], Argument::H)?;
        state.copy_from_slice(x0.as_slice());
        let first = 2 * M::Shape::NX;
        variables[first..first + M::Shape::NU].copy_from_slice(u.as_slice());
        let Options { steps, compensated, .. } = self.options;
        Ok(Grid { start_time: self.start_time, h: h / T::from_whole(steps), steps, compensated })
    }
}

/// [`check_model_input`](crate::finite::check_model_input) with a loop over single numbers: shorter
/// code on targets without SIMD registers, such as firmware.
///
/// # Errors
/// [`Error::NonFiniteInput`]
pub(super) fn check_finite_input<M: Ode, T: Real>(values: &[T], argument: Argument) -> Result<(), Error> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => {
            let (name, value) = (crate::finite::element_name::<M>(argument, index), values[index].to_f64());
            Err(Error::NonFiniteInput { argument, index, name, value })
        }
    }
}
