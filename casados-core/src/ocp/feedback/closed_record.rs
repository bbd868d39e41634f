//! Records of closed loops.

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::functions::node_evaluation::write_variables;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::instance::data::{Node, depends_on_algebraic, split_data};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::ocp::solution::trajectory::{Kind, Series, Trajectory, constraint_names};
use crate::qp::{Bounds, part, part_mut, try_reserve, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::string::ToString;
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// The record of a closed loop; see [`closed_loop`](crate::ocp::closed_loop).
///
/// ```
/// # use casados::ocp::{HeapRealTime, Horizon, LeastSquaresCost, Map, Problem, closed_loop};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 1.0))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[0.0], &[0.0])?;
/// # let mut controller = HeapRealTime::new(ocp)?;
/// # let plant = |_, u: &[f64], x: &mut [f64]| {
/// #     x[0] += u[0];
/// #     Ok(())
/// # };
/// let run = closed_loop(&mut controller, plant, |_, _| {}, &[1.0], 30)?;
/// let (x, u) = (run.trajectory.state("x")?, run.trajectory.control("u")?);
/// assert!(x.len() == 31 && u.len() == 30 && x[30].abs() < 1e-6);
/// // The cost of the linear-quadratic regulator, ½ · 1.618 x₀².
/// assert!((run.cost() - 0.809).abs() < 1e-3);
/// let slowest = run.durations.iter().copied().fold(0.0, f64::max);
/// println!("{slowest} s at most, of {} samples without a control", run.failures.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ClosedLoop<T = f64> {
    /// States at the start of every sample and at the end, controls, and path constraints, by
    /// names, with the bounds of the controller's problem: for plots, files and violations. Times
    /// start at zero.
    pub trajectory: Trajectory<T>,
    /// The stage cost of each sample.
    pub costs: Vec<T>,
    /// The computation times of the controller in seconds, for each sample; zero without a clock
    /// (without the feature `std`).
    pub durations: Vec<f64>,
    /// The samples in which the controller failed and the last control was held, with the errors.
    pub failures: Vec<(usize, OcpError)>,
}

impl<T: Real> ClosedLoop<T> {
    /// The sum of all costs.
    #[must_use]
    pub fn cost(&self) -> T {
        self.costs.iter().fold(T::ZERO, |sum, &cost| sum + cost)
    }
}

/// The recorder of a running closed loop.
pub struct Recorder<T> {
    /// The length of a sample.
    pub sample_length: T,
    /// Rows of states of all samples and of the end, of controls, and of path constraints.
    x: Vec<T>,
    u: Vec<T>,
    g: Vec<T>,
    costs: Vec<T>,
    durations: Vec<f64>,
    failures: Vec<(usize, OcpError)>,
}

impl<T: Real> Recorder<T> {
    /// Creates a recorder for a number of samples from a state.
    ///
    /// # Errors
    /// [`OcpError::Length`], [`OcpError::InvalidValue`], [`OcpError::Unsupported`],
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Formulation<T>>(
        ocp: &mut HeapOcp<P, T>,
        x0: &[T],
        samples: usize,
    ) -> Result<Self, OcpError> {
        Labels::states::<P, T>(Part::InitialState, 0).check_vector(x0, P::Shape::NX)?;
        if depends_on_algebraic::<P, T>() || ocp.free.count() > 0 {
            let what = "closed loops with algebraic states in costs or constraints, or with free parameters";
            let remedy = "Write them in states, controls and parameters that are set";
            return Err(OcpError::Unsupported { what, remedy });
        }
        let times = ocp.times();
        let length = times.get(1).copied().unwrap_or(T::ONE) - times.first().copied().unwrap_or(T::ZERO);
        let mut recorder = Self {
            sample_length: length,
            x: Vec::new(),
            u: Vec::new(),
            g: zeros(P::Path::ROWS)?,
            costs: Vec::new(),
            durations: Vec::new(),
            failures: Vec::new(),
        };
        try_reserve(&mut recorder.x, (samples.saturating_add(1)).saturating_mul(P::Shape::NX))?;
        try_reserve(&mut recorder.u, samples.saturating_mul(P::Shape::NU))?;
        try_reserve(&mut recorder.g, samples.saturating_mul(P::Path::ROWS))?;
        recorder.g.clear();
        try_reserve(&mut recorder.costs, samples)?;
        try_reserve(&mut recorder.durations, samples)?;
        Ok(recorder)
    }

    /// Records a sample: state, control, result and computation time of the controller.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    pub fn record<P: Formulation<T>>(
        &mut self,
        ocp: &mut HeapOcp<P, T>,
        [x, u]: [&[T]; 2],
        (result, duration): (Result<(), OcpError>, f64),
    ) -> Result<(), OcpError> {
        if let Err(error) = result {
            self.failures.push((self.costs.len(), error));
        }
        self.x.extend_from_slice(x);
        self.u.extend_from_slice(u);
        self.durations.push(duration);
        let layout = ocp.layout();
        let data = split_data::<P, T>(&mut ocp.data, layout);
        let Problem { stage_cost, path, running, .. } = ocp.problem.parts();
        let given = [&*data.times, &*data.p, &*data.references];
        let node = Node::new::<P>(0, layout.intervals, *running, given);
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        write_variables::<P::Shape, T>(&mut point, [x, &[], u, node.p], node.time);
        self.costs.push(stage_cost.value(&point, node.reference, 0)? * node.factor);
        let begin = self.g.len();
        self.g.resize(begin + P::Path::ROWS, T::ZERO);
        let rows = part_mut(&mut self.g, begin, P::Path::ROWS);
        path.value(&point, rows, ConstraintContext::new(0, FreeParametersView::default(), &[]))
    }

    /// Returns the record of the closed loop.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn finish<P: Formulation<T>>(
        mut self,
        ocp: &mut HeapOcp<P, T>,
        x: &[T],
    ) -> Result<ClosedLoop<T>, OcpError> {
        self.x.extend_from_slice(x);
        let samples = self.costs.len();
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let times = (0..=samples).map(|k| T::from_whole(k) * self.sample_length).collect();
        let qp = ocp.qp.view();
        let mut series = Vec::new();
        let column = |rows: &[T], width: usize, i: usize| {
            rows.chunks_exact(width.max(1)).filter_map(|row| row.get(i).copied()).collect()
        };
        // The first state is given; the bounds of states are those of the next stage.
        let bounds = [qp.stage(1).map(|stage| stage.x_bounds()), qp.stage(0).map(|stage| stage.u_bounds())];
        let all = [
            (Kind::State, model_names.x, model_names.units.x, &self.x),
            (Kind::Control, model_names.u, model_names.units.u, &self.u),
        ];
        for ((kind, names, units, rows), bounds) in all.into_iter().zip(bounds) {
            for (i, &name) in names.iter().enumerate() {
                let unit = units.get(i).copied().unwrap_or_default();
                let unbounded = Series::new(kind, name, 0, column(rows, names.len(), i)).with_unit(unit);
                series.push(match bounds {
                    Some(Bounds { lower, upper, .. }) => with_bounds(unbounded, [lower, upper], i),
                    None => unbounded,
                });
            }
        }
        let layout = ocp.layout();
        let data = split_data::<P, T>(&mut ocp.data, layout);
        let (lower, upper) = (part(data.lower, 0, P::Path::ROWS), part(data.upper, 0, P::Path::ROWS));
        for (row, name) in constraint_names::<P::Path, _, T>().enumerate() {
            let values = column(&self.g, P::Path::ROWS, row);
            let unbounded =
                Series::new(Kind::Path, name.to_string(), 0, values).with_unit(P::Path::unit(row));
            series.push(with_bounds(unbounded, [lower, upper], row));
        }
        let trajectory = Trajectory::from_series((model_names.model, model_names.units.t), times, series);
        let Self { costs, durations, failures, .. } = self;
        Ok(ClosedLoop { trajectory, costs, durations, failures })
    }
}

/// Adds the bounds of an element to a series, constant over all times.
fn with_bounds<T: Real>(mut series: Series<T>, bounds: [&[T]; 2], element: usize) -> Series<T> {
    let [lower, upper] = bounds.map(|list| list.get(element).copied().filter(|bound| bound.is_finite()));
    if lower.is_some() || upper.is_some() {
        series.lower.resize(series.values.len(), lower);
        series.upper.resize(series.values.len(), upper);
    }
    series
}
