//! What happens between two nodes of a horizon.

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

/// What is given of one interval.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Interval<'a, T> {
    /// The state at its start.
    pub x: &'a [T],
    /// The control, constant over the interval.
    pub u: &'a [T],
    /// The parameters that were set.
    pub(in crate::ocp) p: &'a [T],
    /// The free ones, and where they are.
    pub(in crate::ocp) w: &'a [T],
    pub(in crate::ocp) free: FreeParametersView<'a>,
    /// The multipliers `π` of its end.
    pub multipliers: &'a [T],
    /// The weights `ν` of the algebraic states at its start, for second derivatives; empty if
    /// nothing depends on these.
    pub nu: &'a [T],
    /// The time at its start.
    pub t: T,
    /// Its length.
    pub h: T,
}

impl<T: Real> Interval<'_, T> {
    /// The parameters.
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
    /// Distances of stages in `v`, and in `multipliers`.
    pub(in crate::ocp) ld: [usize; 2],
    /// The part of the last step after which they are, of a solver that knows
    /// [stages](Dynamics::LIFTED): these have their memory on the heap.
    #[cfg_attr(not(feature = "alloc"), allow(dead_code))]
    pub(in crate::ocp) step_length: Option<T>,
    /// Where in every interval a piece of it begins and ends, if it is not the whole: as parts of
    /// the interval.
    pub(in crate::ocp) piece: Option<[T; 2]>,
}

impl<'a, T: Real> Nodes<'a, T> {
    /// How many intervals.
    #[must_use]
    pub fn len(&self) -> usize {
        self.times.len().saturating_sub(1)
    }
    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// All intervals, in order.
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

/// What happens to stages that are variables.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StageAction<T> {
    /// They go a part of their step.
    Step(T),
    /// They are those of the best iterate.
    StoreBest,
    /// They are what they were at the best iterate.
    RestoreBest,
}

/// What takes the results of the intervals, in order.
#[doc(hidden)]
pub type Sink<'a, T> = &'a mut dyn FnMut(usize, &IntervalResult<'_, T>);

/// What happens between two nodes: `x_{k+1} = φ(x_k, u_k, p_k)`.
///
/// Integrators of single intervals are dynamics, implicit and explicit ones, with static memory or
/// on the heap, and those that wrap them ([`Projected`](crate::Projected),
/// [`Divided`](crate::Divided)); [`WithIntegral`](crate::ocp::WithIntegral) is one with an integral
/// cost, [`Map`](crate::ocp::Map) a function that is `φ` itself, `Shooting` a batch that takes all
/// intervals at once, and `ReturnMap` dynamics whose last interval ends with a map.
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
    /// Whether [`IntervalResult::z`] says what the algebraic states are at nodes.
    const ALGEBRAIC: bool = false;
    /// Whether the end of an interval is that of the equations of a model.
    #[doc(hidden)]
    const IS_FLOW: bool = true;
    /// Whether there are integral costs.
    #[doc(hidden)]
    const INTEGRAL: bool = false;
    /// What the ends of intervals follow from.
    #[doc(hidden)]
    const STRUCTURE: DynamicsStructure = DynamicsStructure::Unknown;
    /// Whether stages of intervals are variables, which a solver moves with its iterate: by
    /// `initialise_stages`, `expand_stage_steps` and `apply_stage_action`.
    const LIFTED: bool = false;

    /// Whether weights of integral costs make sense.
    ///
    /// # Errors
    /// [`OcpError::InvalidWeight`]
    fn check(&self) -> Result<(), OcpError> {
        Ok(())
    }

    /// Whether intervals may be integrated in pieces, one after the other.
    #[doc(hidden)]
    fn has_pieces(&self) -> bool {
        Self::IS_FLOW && !Self::LIFTED
    }

    /// Shows integral costs as mathematics.
    ///
    /// # Errors
    /// Those of what shows them.
    #[doc(hidden)]
    fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
        let _ = show;
        Ok(())
    }

    /// From now on stages of intervals are remembered, if that saves anything. With `solved` the
    /// following calls are at the point of the last one, which was successful. Whether they are.
    #[doc(hidden)]
    fn keep_stages(&mut self, solved: bool) -> bool {
        let _ = solved;
        false
    }

    /// The ends of all intervals, and integral costs.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;

    /// The ends of all intervals and their first derivatives.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;

    /// States and algebraic states at these parts of every interval, of all of one after those of
    /// the other. Whether there are any: of maps there are none.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    #[cfg(feature = "alloc")]
    #[doc(hidden)]
    fn inside(&mut self, nodes: &Nodes<'_, T>, parts: &[T], sink: Sink<'_, T>) -> Result<bool, OcpError> {
        let _ = (nodes, parts, sink);
        Ok(false)
    }

    /// Stages begin anew, at a guess.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    fn initialise_stages(&mut self, _nodes: &Nodes<'_, T>) -> Result<(), OcpError> {
        Ok(())
    }

    /// The step of stages that belongs to one of states and controls, as it was linearised at these
    /// nodes.
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn expand_stage_steps(&mut self, _nodes: &Nodes<'_, T>, _steps: &Nodes<'_, T>) -> Result<(), OcpError> {
        Ok(())
    }

    /// What happens to stages.
    fn apply_stage_action(&mut self, _action: StageAction<T>) {}
}

/// Dynamics with second derivatives.
///
/// Users write it in bounds, or [`ExactFormulation`](crate::ocp::ExactFormulation) of a whole
/// problem.
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
    /// The ends of all intervals, their first derivatives, and `∇²(πᵀφ + νᵀζ + integral)` with the
    /// multipliers `π` and the weights `ν` of the [`Interval`].
    ///
    /// # Errors
    /// [`OcpError::Integration`]
    fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError>;
}

/// Sum and largest of what is left of the equations of stages.
pub(in crate::ocp) fn add_stage_residuals<T: Real>(
    [sum, largest]: [T; 2],
    [other_sum, other_largest]: [T; 2],
) -> [T; 2] {
    [sum + other_sum, nan_max(largest, other_largest)]
}

/// A vector of these elements.
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
