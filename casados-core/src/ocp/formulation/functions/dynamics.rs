//! Dynamics: the map from one node of a horizon to the next.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::cost::TermWriter;
pub use crate::ocp::formulation::functions::result::{IntegralTerms, IntervalResult};
use crate::ocp::formulation::functions::sparsity::DynamicsStructure;
use crate::ocp::formulation::names::Names;
use crate::qp::nan_max;
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape};
use core::fmt;

/// The data of one interval.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Interval<'a, T> {
    /// The state at its start.
    pub x: &'a [T],
    /// The control, constant over the interval.
    pub u: &'a [T],
    /// The set parameters.
    pub(in crate::ocp) p: &'a [T],
    /// The free parameters and their positions.
    pub(in crate::ocp) w: &'a [T],
    pub(in crate::ocp) free: FreeParametersView<'a>,
    /// The multipliers `π` of the state at its end.
    pub multipliers: &'a [T],
    /// The weights `ν` of the algebraic states at its start, for second derivatives; empty if no
    /// function depends on algebraic states.
    pub nu: &'a [T],
    /// The time at its start.
    pub t: T,
    /// Its length.
    pub h: T,
}

impl<T: Real> Interval<'_, T> {
    /// Returns the parameters, with free ones in their places.
    #[inline(always)]
    pub(in crate::ocp) fn parameters<V: Matrix<T>>(&self) -> V {
        let mut p: V = vector(self.p);
        self.free.write_parameters(p.as_mut_slice(), self.w);
        p
    }
}

/// The intervals of a horizon at the current iterate.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Nodes<'a, T> {
    pub(in crate::ocp) v: &'a [T],
    pub(in crate::ocp) multipliers: &'a [T],
    pub(in crate::ocp) weights: &'a [T],
    pub(in crate::ocp) p: &'a [T],
    pub(in crate::ocp) free: FreeParametersView<'a>,
    pub(in crate::ocp) times: &'a [T],
    /// `NX`, `NU`, `NP`, `NZ`
    pub(in crate::ocp) dims: [usize; 4],
    /// The strides of stages in `v` and in `multipliers`.
    pub(in crate::ocp) ld: [usize; 2],
    /// The step length of the last step, from solvers that treat [stages](Dynamics::LIFTED) as
    /// variables, which have their memory on the heap.
    #[cfg_attr(not(feature = "alloc"), allow(dead_code))]
    pub(in crate::ocp) step_length: Option<T>,
    /// The start and the end of the current piece of every interval, as fractions of the interval;
    /// none for whole intervals.
    pub(in crate::ocp) piece: Option<[T; 2]>,
}

impl<'a, T: Real> Nodes<'a, T> {
    /// Returns the number of intervals.
    #[must_use]
    pub fn len(&self) -> usize {
        self.times.len().saturating_sub(1)
    }
    /// Returns whether there is no interval.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Returns all intervals, in order.
    pub fn iter(&self) -> impl Iterator<Item = Interval<'a, T>> + use<'a, T> {
        let Self {
            v,
            multipliers,
            weights,
            p,
            free,
            times,
            piece,
            dims: [nx, nu, np, nz],
            ld: [ld, ld_next],
            ..
        } = *self;
        let part = crate::qp::part::<T>;
        times.windows(2).enumerate().map(move |(k, times)| {
            let [start, end] = [0, 1].map(|i| times.get(i).copied().unwrap_or(T::ZERO));
            let length = end - start;
            let (t, h) = match piece {
                None => (start, length),
                Some([from, to]) => (start + from * length, (to - from) * length),
            };
            Interval {
                x: part(v, k * ld, nx),
                u: part(v, k * ld + nx + free.count(), nu),
                p: part(p, k * np, np),
                w: part(v, k * ld + nx, free.count()),
                free,
                multipliers: part(multipliers, k * ld_next, nx),
                nu: part(weights, k * nz, nz),
                t,
                h,
            }
        })
    }
}

/// An action on stages that are variables.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StageAction<T> {
    /// Takes this fraction of their step.
    Step(T),
    /// Stores them as the stages of the best iterate.
    StoreBest,
    /// Restores the stages of the best iterate.
    RestoreBest,
}

/// Receives the results of the intervals, in order.
#[doc(hidden)]
pub type Sink<'a, T> = &'a mut dyn FnMut(usize, &IntervalResult<'_, T>);

/// The dynamics between two nodes: `x_{k+1} = φ(x_k, u_k, p_k)`.
///
/// Dynamics are: integrators of single intervals, implicit or explicit, with memory inline or on
/// the heap, also wrapped ([`Projected`](crate::Projected), [`Divided`](crate::Divided));
/// [`WithIntegral`](crate::ocp::WithIntegral), an integrator with an integral cost;
/// [`Map`](crate::ocp::Map), a function that is `φ` itself; `Shooting`, a batch that integrates all
/// intervals at once; and `ReturnMap`, dynamics whose last interval ends with a map.
///
/// ```
/// use casados::ocp::{Dynamics, Horizon, HeapOcp, Formulation, OcpError, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
///
/// /// A problem without costs, of any dynamics.
/// fn still<D: Dynamics<f64>>(dynamics: D) -> Result<HeapOcp<impl Formulation<f64>>, OcpError> {
///     Problem::new(dynamics).on(Horizon::uniform(10, 0.1))
/// }
/// let one = still(Irk::<Cart, Gauss<2>>::new(Options::default())?)?;
/// let other = still(Erk::<Cart, Rk4>::new(Options::default())?)?;
/// assert_eq!(one.times(), other.times());
/// # Ok::<(), OcpError>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not say what happens between two nodes of a horizon",
    note = "`Irk`, `Erk`, `Projected`, `Divided`, `Shooting` (over a `Batch`), `WithIntegral`, `ReturnMap` and `Map` do; an integrator with `Inline` memory needs `mode::Forward` or `mode::Hessian`"
)]
pub trait Dynamics<T: Real> {
    /// Dimensions.
    type Shape: Shape;
    /// Names of the variables.
    const NAMES: Names;
    /// Whether [`IntervalResult::z`] has the algebraic states at nodes.
    const ALGEBRAIC: bool = false;
    /// Whether `φ` is the flow of a differential equation.
    #[doc(hidden)]
    const IS_FLOW: bool = true;
    /// Whether there are integral costs.
    #[doc(hidden)]
    const INTEGRAL: bool = false;
    /// The functions that determine the sparsity of `φ`.
    #[doc(hidden)]
    const STRUCTURE: DynamicsStructure = DynamicsStructure::Unknown;
    /// Whether stages of intervals are variables, which a solver updates with its iterate by
    /// `initialise_stages`, `expand_stage_steps` and `apply_stage_action`.
    const LIFTED: bool = false;

    /// Checks the weights of integral costs.
    ///
    /// # Errors
    /// [`OcpError::InvalidWeight`]
    fn check(&self) -> Result<(), OcpError> {
        Ok(())
    }

    /// Returns whether intervals may be integrated in pieces, one after the other.
    #[doc(hidden)]
    fn has_pieces(&self) -> bool {
        Self::IS_FLOW && !Self::LIFTED
    }

    /// Prints integral costs as formulas.
    ///
    /// # Errors
    /// The errors of `show`.
    #[doc(hidden)]
    fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
        let _ = show;
        Ok(())
    }

    /// Enables storing the stages of intervals, where that saves work. If `solved`, the following
    /// calls are at the point of the last call, which was successful. Returns whether stages are
    /// stored.
    #[doc(hidden)]
    fn keep_stages(&mut self, solved: bool) -> bool {
        let _ = solved;
        false
    }

    /// Evaluates the ends of all intervals, and integral costs.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;

    /// Evaluates the ends of all intervals and their first derivatives.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;

    /// Evaluates states and algebraic states at these fractions of every interval, interval by
    /// interval. Returns false for maps, which have none.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    #[cfg(feature = "alloc")]
    #[doc(hidden)]
    fn inside(&mut self, nodes: &Nodes<'_, T>, parts: &[T], sink: Sink<'_, T>) -> Result<bool, OcpError> {
        let _ = (nodes, parts, sink);
        Ok(false)
    }

    /// Initialises stages at a guess.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    fn initialise_stages(&mut self, _nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        Ok(())
    }

    /// Expands a step of states and controls to the stages, with the linearisation at these nodes.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn expand_stage_steps(&mut self, _nodes: &Nodes<'_, T>, _steps: &Nodes<'_, T>) -> Result<(), OcpError> {
        Ok(())
    }

    /// Applies an action to the stages.
    fn apply_stage_action(&mut self, _action: StageAction<T>) {}
}

/// Dynamics with second derivatives.
///
/// Generic functions require it in bounds, or [`ExactFormulation`](crate::ocp::ExactFormulation) of
/// a whole problem.
///
/// ```
/// use casados::ocp::{HeapIpm, Horizon, OcpError, Problem, SecondOrder};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
///
/// /// Whether a state is reached within a second, of any dynamics that an interior point takes.
/// fn is_reached<D: SecondOrder<f64>>(dynamics: D, end: f64) -> Result<bool, OcpError> {
///     let mut ocp = Problem::new(dynamics).on(Horizon::uniform(10, 0.1))?;
///     ocp.fix_initial_state(&[0.0; 2])?.bound("x[0]", 10.., end, end)?.bound("u", .., -1.0, 1.0)?;
///     Ok(HeapIpm::new(&ocp)?.solve(ocp.guess(&[0.0; 2], &[0.0])?)?.is_converged())
/// }
/// let erk = || Erk::<Cart, Rk4>::new(Options::default());
/// assert!(is_reached(erk()?, 0.4)? && !is_reached(erk()?, 0.6)?);
/// # Ok::<(), OcpError>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no second derivatives",
    note = "integrators with `Heap` or `Inline<mode::Hessian>` memory have them",
    note = "sequential quadratic programming needs none after `Sqp::gauss_newton`"
)]
pub trait SecondOrder<T: Real>: Dynamics<T> {
    /// Evaluates the ends of all intervals, their first derivatives, and `∇²(πᵀφ + νᵀζ + integral)`
    /// with the multipliers `π` and the weights `ν` of the [`Interval`].
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;
}

/// Returns the sum and the maximum of two pairs of stage residuals.
pub(in crate::ocp) fn add_stage_residuals<T: Real>(
    [sum, largest]: [T; 2],
    [other_sum, other_largest]: [T; 2],
) -> [T; 2] {
    [sum + other_sum, nan_max(largest, other_largest)]
}

/// Returns a vector with these elements.
pub(in crate::ocp) fn vector<T: Plain, V: Matrix<T>>(elements: &[T]) -> V {
    let mut vector = V::zeroed();
    for (to, from) in vector.as_mut_slice().iter_mut().zip(elements) {
        *to = *from;
    }
    vector
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stage_residuals_keep_nan() {
        let first = add_stage_residuals([1.0, f64::NAN], [1.0, 2.0]);
        let second = add_stage_residuals([1.0, 2.0], [1.0, f64::NAN]);
        assert!(first[1].is_nan() && second[1].is_nan());
        assert_eq!(add_stage_residuals([1.0, 2.0], [1.0, 3.0]), [2.0, 3.0]);
    }
}
