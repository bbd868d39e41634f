//! A problem on a horizon, with its data, its iterate and its QP.

mod accessors;
mod check;
pub(in crate::ocp) mod construction;
pub(in crate::ocp) mod data;
pub(in crate::ocp) mod inner_points;
#[cfg(feature = "alloc")]
pub(in crate::ocp) mod rebuild;

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::free_parameters::{FreeParameters, FreeParametersView};
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::functions::dynamics::Nodes;
use crate::ocp::formulation::functions::node_evaluation::AvailableVariables;
use crate::ocp::formulation::horizon::Horizon;
use crate::ocp::formulation::instance::data::{
    Data, Layout, path_row_count, split_data, stage_variable_count,
};
use crate::ocp::formulation::instance::inner_points::InnerPoints;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::element::set;
use crate::qp::{Qp, Solution, SolutionStage, StageDims, copy_common, padded_len, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// The kind of initial state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::ocp) enum InitialState {
    /// Not set.
    Unknown,
    Fixed,
    /// Fixed, except for linear controls.
    PartlyFixed,
    Free,
}

/// A problem of optimal control on a horizon, discretised by multiple shooting.
///
/// ```text
/// min  Σ_k l(x_k, u_k) + e(x_N)     x_{k+1} = φ(x_k, u_k)     lb ≤ (x_k, u_k) ≤ ub     lg ≤ g(x_k, u_k) ≤ ug
/// ```
///
/// It has the data of every stage, an iterate with multipliers, and the QP that [`Ocp::linearise`]
/// writes at the iterate. The variables of this QP are states and controls, not steps. Bounds are
/// therefore written to it once, its solution is the next iterate, and its optimality conditions at
/// the iterate are those of the problem.
///
/// With the feature `alloc`, `Problem::on` allocates the memory; [`Problem::on_horizon`] uses given
/// memory.
///
/// `println!("{ocp}")` prints formulas, names, bounds and sizes. A clone on the heap has the same
/// bounds, data and iterate, and its own integrators.
///
/// # Example
/// ```
/// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Problem};
/// use casados::prelude::*;
///
/// /// A cart on a rail that is pushed: position m, velocity m/s; acceleration m/s².
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
///
/// const N: usize = 20;
/// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
///     .running_cost(GeneralCost::<Effort>::new())
///     .on(Horizon::uniform(N, 0.05))?;
/// // Bounds by the names of the model, stages by ranges: from rest to rest in a second.
/// ocp.fix_initial_state(&[0.0, 0.0])?;
/// ocp.bound("x[0]", N.., 1.0, 1.0)?.bound("x[1]", N.., 0.0, 0.0)?.bound("u", .., -8.0, 8.0)?;
/// ocp.guess(&[0.0, 0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// // The best push falls linearly from 6 to −6, and so do its samples, about as much.
/// let solution = ocp.solution()?;
/// assert!((solution.control("u")?[0] - 6.0).abs() < 0.5);
/// assert!((solution.state("x[0]")?[N / 2] - 0.5).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Ocp<P, T, D, M> {
    pub(in crate::ocp) problem: P,
    pub(in crate::ocp) initial_state: InitialState,
    pub(in crate::ocp) qp: Qp<T, D, M>,
    pub(in crate::ocp) iterate: Solution<T, D, M>,
    pub(in crate::ocp) data: M,
    /// The objective at the last linearisation, without penalties.
    pub(in crate::ocp) objective: T,
    /// The sum and the maximum of the residuals of stage equations at the last evaluation.
    pub(in crate::ocp) stage_residuals: [T; 2],
    pub(in crate::ocp) free: FreeParameters,
    pub(in crate::ocp) inner_points: InnerPoints<T>,
    /// The step length, see [`Nodes`].
    pub(in crate::ocp) step_length: Option<T>,
    /// Whether the algebraic states of the last evaluation belong to the iterate.
    pub(in crate::ocp) algebraic_is_current: bool,
}

/// A problem with its memory on the heap.
///
/// `problem.on(horizon)` creates it; [`Ocp`] has its methods, and an example.
///
/// Functions return it as a type with the required traits:
///
/// ```
/// use casados::ocp::{ExactFormulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, OcpError, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
///
/// /// To a place in a second. `ExactFormulation` is what solvers with exact Hessians take.
/// fn travel(place: f64) -> Result<HeapOcp<impl ExactFormulation<f64>>, OcpError> {
///     let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?)
///         .running_cost(GeneralCost::<Effort>::new())
///         .on(Horizon::uniform(10, 0.1))?;
///     ocp.fix_initial_state(&[0.0; 2])?.bound("x[0]", 10.., place, place)?.guess(&[0.0; 2], &[0.0])?;
///     Ok(ocp)
/// }
///
/// let (mut one, mut other) = (travel(1.0)?, travel(1.0)?);
/// let by_sqp = HeapSqp::new(&one)?.solve(&mut one)?;
/// let by_ipm = HeapIpm::new(&other)?.solve(&mut other)?;
/// assert!((by_sqp.objective - by_ipm.objective).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "alloc")]
pub type HeapOcp<P, T = f64> = Ocp<P, T, Vec<StageDims>, Vec<T>>;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    pub(in crate::ocp) fn build(
        mut problem: P,
        horizon: Horizon<'_, T>,
        mut qp: Qp<T, D, M>,
        iterate: Solution<T, D, M>,
        mut data: M,
    ) -> Result<Self, OcpError> {
        let intervals = horizon.intervals();
        if intervals == 0 {
            return Err(OcpError::Missing { part: Part::Times, stage: 0 });
        }
        let Problem { dynamics, stage_cost, terminal_cost, path, terminal, running } = problem.parts();
        let degrees = if *running { <P::Dynamics as Dynamics<T>>::NAMES.degrees } else { &[] };
        let z = P::Dynamics::ALGEBRAIC;
        let (inside, at_end) = (
            AvailableVariables { z, u: true, stage: 0, t: true, degrees: &[] },
            AvailableVariables { z: false, u: false, stage: intervals, t: true, degrees: &[] },
        );
        dynamics.check()?;
        stage_cost.check(AvailableVariables { degrees, ..inside })?;
        terminal_cost.check(at_end)?;
        path.check(inside)?;
        terminal.check(at_end)?;
        let layout = Layout::new(intervals, P::Terminal::INITIAL_STATE_COPIES);
        let Data { times, p, lower, upper, references, .. } = split_data::<P, T>(data.as_mut(), layout);
        horizon.write_times(times)?;
        // NaN marks parameters that are not set.
        p.fill(T::from_f64(f64::NAN));
        write_interval_parameters(&<P::Dynamics as Dynamics<T>>::NAMES, times, p);
        references.fill(T::ZERO);
        for (k, mut stage) in qp.stages_mut().enumerate() {
            let (begin, first_copy_row) = (k * path_row_count::<P, T>(layout), P::Path::ROWS);
            let rows = if k < intervals { P::Path::ROWS } else { P::Terminal::ROWS };
            if k < intervals && first_copy_row < path_row_count::<P, T>(layout) {
                // Copies of the first state are equal to it at its stage.
                let bound = if k == 0 { T::ZERO } else { T::from_f64(f64::INFINITY) };
                let links = [&mut *lower, &mut *upper].into_iter().zip([T::ZERO - bound, bound]);
                links.for_each(|(to, bound)| {
                    part_mut(to, begin + first_copy_row, path_row_count::<P, T>(layout) - first_copy_row)
                        .fill(bound);
                });
            }
            let bounds = stage.g_bounds_mut();
            let limits = [
                part_mut(lower, begin, rows),
                part_mut(upper, begin, rows),
                &mut *bounds.lower_linear,
                &mut *bounds.lower_quadratic,
            ];
            if k < intervals {
                path.bounds(limits)
            } else {
                terminal.bounds(limits)
            }
            copy_common(bounds.upper_linear, bounds.lower_linear);
            copy_common(bounds.upper_quadratic, bounds.lower_quadratic);
        }
        for copy in 0..P::Terminal::INITIAL_STATE_COPIES {
            qp.share(copy);
        }
        // Integrals start at zero.
        let integrals = P::Shape::NX - <P::Dynamics as Dynamics<T>>::NAMES.integrals..P::Shape::NX;
        if let Some(mut first) = qp.stage_mut(0) {
            integrals.for_each(|i| first.x_bounds_mut().set(i, T::ZERO, T::ZERO));
        }
        Ok(Self {
            problem,
            initial_state: InitialState::Unknown,
            qp,
            iterate,
            data,
            objective: T::ZERO,
            stage_residuals: [T::ZERO; 2],
            free: FreeParameters::with_initial_state_copies(P::Terminal::INITIAL_STATE_COPIES),
            inner_points: InnerPoints::default(),
            step_length: None,
            algebraic_is_current: false,
        })
    }

    /// Returns the dimensions of the problem.
    #[inline(always)]
    pub(crate) fn layout(&self) -> Layout {
        Layout {
            inner_rows: self.inner_points.row_count::<P>(),
            has_algebraic_bounds: self.inner_points.has_algebraic_bounds::<P>(),
            ..Layout::new(self.intervals(), self.free.count())
        }
    }

    /// Returns a stage of the iterate.
    ///
    /// # Errors
    /// [`OcpError::NoSuchStage`]
    pub fn stage(&self, stage: usize) -> Result<SolutionStage<'_, T>, OcpError> {
        let stages = self.intervals() + 1;
        match self.iterate.stage(stage) {
            Some(point) => Ok(without_free_parameters(point, self.free.count())),
            None => Err(OcpError::NoSuchStage { part: Part::States, stage, stages }),
        }
    }

    /// Sets the iterate to a state and a control at every stage, with zero multipliers.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`]
    pub fn guess(&mut self, x: &[T], u: &[T]) -> Result<&mut Self, OcpError> {
        Labels::states::<P, T>(Part::States, 0).check_vector(x, self.names().model_state_count())?;
        Labels::controls::<P, T>(Part::Controls, 0).check_vector(u, self.names().model_control_count())?;
        let has_linear = !self.names().linear.is_empty();
        for k in 0..=self.intervals() {
            self.guess_stage(k, x, if k < self.intervals() || has_linear { u } else { &[] })?;
        }
        Ok(self)
    }

    /// Sets the iterate to a state and a control at one stage, with zero multipliers. The last
    /// stage has no controls but the linear ones. Rates of linear controls become zero, integrals
    /// are unchanged, and polynomial controls are constant in the interval.
    ///
    /// # Errors
    /// [`OcpError::NoSuchStage`], [`OcpError::Length`], [`OcpError::InvalidValue`]
    pub fn guess_stage(&mut self, stage: usize, x: &[T], u: &[T]) -> Result<&mut Self, OcpError> {
        let (last, free) = (self.intervals(), self.free.count());
        let Some(stage_iterate) = self.iterate.stage_mut(stage) else {
            return Err(OcpError::NoSuchStage { part: Part::States, stage, stages: last + 1 });
        };
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let model_controls = stage_iterate.u.get_mut(free..).unwrap_or_default();
        let controls = if stage == last && !u.is_empty() && !model_names.linear.is_empty() {
            model_names.model_control_count()
        } else if model_controls.is_empty() {
            0
        } else {
            model_names.model_control_count()
        };
        Labels::states::<P, T>(Part::States, stage).check_vector(x, model_names.model_state_count())?;
        Labels::controls::<P, T>(Part::Controls, stage).check_vector(u, controls)?;
        copy_common(stage_iterate.x, x);
        for (&value, (first, degree)) in u.iter().zip(model_names.model_controls()) {
            let is_linear = |linear: &u32| *linear as usize == first;
            if let Some(position) = model_names.linear.iter().position(is_linear) {
                set(stage_iterate.x, model_names.model_state_count() + position, value);
                set(model_controls, first, T::ZERO);
            } else {
                part_mut(model_controls, first, degree + 1).fill(value);
            }
        }
        for multipliers in [
            stage_iterate.dynamics,
            stage_iterate.x_lower,
            stage_iterate.x_upper,
            stage_iterate.u_lower,
            stage_iterate.u_upper,
            stage_iterate.g_lower,
            stage_iterate.g_upper,
        ] {
            multipliers.fill(T::ZERO);
        }
        if stage == 0 {
            self.update_initial_state_copies();
        }
        Ok(self)
    }

    /// Sets the copies of the first state to its values.
    pub(in crate::ocp) fn update_initial_state_copies(&mut self) {
        for copy_index in 0..P::Terminal::INITIAL_STATE_COPIES {
            let first = self.iterate.stages().next();
            let value = first.and_then(|first| first.x.get(P::Terminal::copied_state(copy_index)).copied());
            self.write_free_parameter(copy_index, value.unwrap_or(T::ZERO));
        }
    }

    /// Writes a shared variable of the iterate.
    pub(in crate::ocp) fn write_free_parameter(&mut self, w: usize, value: T) {
        for k in 0..=self.intervals() {
            if let Some(element) = self.iterate.stage_mut(k).and_then(|stage| stage.u.get_mut(w)) {
                *element = value;
            }
        }
    }

    /// Returns the name of a free parameter; for a copy of the first state, the name of its
    /// element.
    pub(in crate::ocp) fn free_parameter_name(&self, index: usize) -> &'static str {
        if index < P::Terminal::INITIAL_STATE_COPIES {
            return self.names().x.get(P::Terminal::copied_state(index)).copied().unwrap_or("");
        }
        let parameter = self.free.model_parameter(index);
        parameter.and_then(|parameter| self.names().p.get(parameter).copied()).unwrap_or("")
    }

    /// Shifts the iterate by one interval, as the guess for the next sampling instant.
    pub fn shift(&mut self) {
        self.iterate.shift();
    }
}

/// Writes start and length of every interval, the last parameters of models with polynomial
/// controls; the last node has those of the last interval.
fn write_interval_parameters<T: Real>(names: &Names, times: &[T], p: &mut [T]) {
    if names.degrees.is_empty() {
        return;
    }
    for (k, p) in p.chunks_exact_mut(names.p.len()).enumerate() {
        let start = k.min(times.len().saturating_sub(2));
        let [start, end] = [start, start + 1].map(|node| times.get(node).copied().unwrap_or(T::ZERO));
        set(p, names.model_parameter_count(), start);
        set(p, names.model_parameter_count() + 1, end - start);
    }
}

/// Returns a stage without the free parameters among its controls.
pub(in crate::ocp) fn without_free_parameters<T>(
    stage: SolutionStage<'_, T>,
    free: usize,
) -> SolutionStage<'_, T> {
    let [u, u_lower, u_upper] =
        [stage.u, stage.u_lower, stage.u_upper].map(|list| list.get(free..).unwrap_or_default());
    SolutionStage { u, u_lower, u_upper, ..stage }
}

/// Returns the intervals at a point; weights of algebraic states may be empty.
pub(in crate::ocp) fn interval_nodes<'a, S: Shape, T: Real>(
    v: &'a [T],
    multipliers: &'a [T],
    weights: &'a [T],
    (p, free): (&'a [T], FreeParametersView<'a>),
    times: &'a [T],
) -> Nodes<'a, T> {
    let dims = [S::NX, S::NU, S::NP, S::NZ];
    let ld = [padded_len::<T>(stage_variable_count::<S>(free.count())), padded_len::<T>(S::NX)];
    Nodes { v, multipliers, weights, p, free, times, dims, ld, step_length: None, piece: None }
}
