//! Verification of an iterate by an integrator with error control.

use crate::integrator::Integrator;
use crate::model::{Dae, VectorX};
use crate::ocp::dynamics::interval_setup::{IntervalSetup, in_interval};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::dynamics::{Dynamics, Interval, vector};
use crate::ocp::formulation::instance::data::{Node, path_row_count, split_data};
use crate::ocp::formulation::instance::{HeapOcp, interval_nodes};
use crate::ocp::formulation::labels::output_name;
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::element::get;
use crate::qp::{Bounds, Side, SolutionStage, part, zeros};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use bytemuck::Zeroable;
use core::cmp::Ordering;
use core::fmt;

/// The number of pieces of an interval at whose ends bounds are checked.
const PIECES_PER_INTERVAL: usize = 8;

/// The accuracy of an iterate, measured by an integrator with error control: [`Ocp::verify`].
///
/// [`Ocp::verify`]: crate::ocp::Ocp::verify
///
/// ```
/// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u - 9.81 * x[0].sin()] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { u * u }
///
/// // One step of order two in each interval is too little.
/// let mut ocp = Problem::new(Erk::<Pendulum, Heun>::new(Options::default())?)
///     .running_cost(GeneralCost::<Effort>::new())
///     .on(Horizon::uniform(10, 0.2))?;
/// ocp.fix_initial_state(&[1.0, 0.0])?.bound("x", 10.., 0.0, 0.0)?.guess(&[0.5, 0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// let mut adaptive = Adaptive::<Pendulum, Radau>::new(AdaptiveOptions::default())?;
/// let verification = ocp.verify(&mut adaptive)?;
/// println!("{verification}");
/// assert!(verification.largest_defect().ok_or("no defect")?.relative > 1e-3);
/// assert!(!verification.intervals(1e-3).is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Verification<T = f64> {
    /// The defects `φ(x_k, u_k) − x_{k+1}`, by intervals, relative to the magnitude of the state.
    defects: Vec<Defect<T>>,
    violations: Vec<InnerViolation<T>>,
    intervals: usize,
}

/// The defect of a state: the end of an interval minus the start of the next one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Defect<T = f64> {
    /// The name of the state.
    pub state: &'static str,
    /// The index of the interval.
    pub interval: usize,
    /// The end state of the integrator with error control minus the state of the next node.
    pub amount: T,
    /// The absolute defect relative to the largest magnitude of the state at any node, at least
    /// one.
    pub relative: T,
}

/// A bound that is violated between two nodes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct InnerViolation<T = f64> {
    /// The name of the state, or of the output of a path constraint.
    pub name: String,
    /// The index of the interval.
    pub interval: usize,
    /// The time of the largest violation.
    pub time: T,
    /// The violated side.
    pub side: Side,
    /// The largest violation in this interval.
    pub amount: T,
    /// The violation relative to the magnitude of the bound, at least one.
    pub relative: T,
}

impl<T: Real> Verification<T> {
    /// All defects of states, by intervals.
    #[must_use]
    pub fn defects(&self) -> &[Defect<T>] {
        &self.defects
    }

    /// The largest relative defect.
    #[must_use]
    pub fn largest_defect(&self) -> Option<Defect<T>> {
        self.defects.iter().copied().reduce(|a, b| if b.relative > a.relative { b } else { a })
    }

    /// The largest violation of each bound in each interval, between the nodes, in descending order
    /// of relative violations.
    #[must_use]
    pub fn violations(&self) -> &[InnerViolation<T>] {
        &self.violations
    }

    /// Returns the intervals with a relative defect or violation above a tolerance, in ascending
    /// order, for [`Horizon::refined`](crate::ocp::Horizon::refined).
    #[must_use]
    pub fn intervals(&self, tolerance: T) -> Vec<usize> {
        let of_defects = self.defects.iter().map(|defect| (defect.interval, defect.relative));
        let of_bounds = self.violations.iter().map(|violation| (violation.interval, violation.relative));
        let mut found: Vec<usize> =
            of_defects.chain(of_bounds).filter(|(_, part)| *part > tolerance).map(|(k, _)| k).collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

impl<T: Real> fmt::Display for Verification<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.largest_defect() {
            Some(Defect { state, interval, amount, relative }) => writeln!(
                f,
                "largest defect: {:.2e} of `{state}` in interval {interval} of {} (relative {:.1e})",
                amount.to_f64(),
                self.intervals,
                relative.to_f64()
            )?,
            None => writeln!(f, "no defects")?,
        }
        match self.violations.first() {
            Some(InnerViolation { name, interval, time, side, amount, .. }) => {
                let side = if *side == Side::Lower { "lower" } else { "upper" };
                write!(
                    f,
                    "largest violation between nodes: {:.2e} of the {side} bound of `{name}` in interval {interval}, \
                     t = {}",
                    amount.to_f64(),
                    time.to_f64()
                )
            }
            None => write!(f, "no bound is violated between nodes"),
        }
    }
}

impl<P: Formulation<T>, T: Real> HeapOcp<P, T> {
    /// Integrates every interval of the iterate from its node by another integrator of the same
    /// model, with error control. Returns the differences from the next nodes, and the violations
    /// of bounds of states and path constraints at eighths between the nodes. The bounds of a state
    /// are the wider ones of both ends of an interval.
    ///
    /// The accuracy is that of the integrator: choose its tolerances a hundredth of the relevant
    /// errors.
    ///
    /// # Errors
    /// [`OcpError::Integration`], [`OcpError::NonFiniteFunction`]; [`OcpError::Unsupported`] for
    /// maps and return maps, which are not the flow of a model; the errors of
    /// [`Ocp::check`](crate::ocp::Ocp::check)
    pub fn verify<I>(&mut self, integrator: &mut I) -> Result<Verification<T>, OcpError>
    where
        I: Integrator<Model: Dae<Shape = P::Shape>, Number = T>,
    {
        self.check()?;
        if !P::Dynamics::IS_FLOW {
            let what = "the verification of maps, which have no flow between nodes";
            return Err(OcpError::Unsupported {
                what,
                remedy: "Take the integrator of an `#[ode]` or a `#[dae]`",
            });
        }
        let (layout, free) = (self.layout(), self.free.view());
        let data = split_data::<P, T>(&mut self.data, layout);
        let Problem { path, .. } = self.problem.parts();
        let (v, _) = self.iterate.variables_and_costates();
        let nodes = interval_nodes::<P::Shape, T>(v, &[], &[], (data.p, free), data.times);
        let sizes = state_magnitudes::<T>(self.iterate.stages(), P::Shape::NX)?;
        let mut interval_violations = IntervalViolations::new::<P>()?;
        let names = <P::Dynamics as Dynamics<T>>::NAMES.x;
        let (mut defects, mut violations) = (Vec::new(), Vec::new());
        let mut stages = self.qp.view().stages().zip(self.iterate.stages()).peekable();
        for (k, interval) in nodes.iter().enumerate() {
            let Some((stage, point)) = stages.next() else { break };
            let next = stages.peek();
            let mut x: VectorX<I::Model, T> = vector(interval.x);
            interval_violations.reset();
            for piece in 1..=PIECES_PER_INTERVAL {
                let h = interval.h / T::from_whole(PIECES_PER_INTERVAL);
                let start = interval.t + T::from_whole(piece - 1) * h;
                in_interval(k, integrator.begin(&Interval { t: start, ..interval }))?;
                let end = in_interval(k, integrator.solve(&x, &vector(interval.u), h))?;
                x = end.x;
                if piece == PIECES_PER_INTERVAL {
                    break;
                }
                let time = start + h;
                let node = Node {
                    time,
                    p: part(data.p, k * P::Shape::NP, P::Shape::NP),
                    reference: &[],
                    factor: T::ONE,
                };
                let inner_stage = SolutionStage { x: x.as_slice(), ..point };
                node.write_variables::<P::Shape>(
                    &mut interval_violations.point,
                    &inner_stage,
                    end.z.as_slice(),
                    free,
                );
                path.value(
                    &interval_violations.point,
                    &mut interval_violations.g,
                    ConstraintContext::new(k, free, &[]),
                )?;
                let states = next.map(|(next, _)| [stage.x_bounds(), next.x_bounds()]);
                interval_violations.check_states(x.as_slice(), states, time);
                let rows =
                    |limits: &[T]| part(limits, k * path_row_count::<P, T>(layout), P::Path::ROWS).to_vec();
                interval_violations.check_constraints([rows(data.lower), rows(data.upper)], time);
            }
            for (i, &end) in x.as_slice().iter().enumerate() {
                let (state, size) = (names.get(i).copied().unwrap_or(""), get(&sizes, i));
                let amount = end - next.map_or(end, |(_, next)| get(next.x, i));
                defects.push(Defect { state, interval: k, amount, relative: amount.abs() / size });
            }
            let duration = free.duration(point.u);
            interval_violations.append_violations::<P>(k, duration, &mut violations);
        }
        let by_relative_amount =
            |a: &InnerViolation<T>, b: &InnerViolation<T>| b.relative.partial_cmp(&a.relative);
        violations.sort_by(|a, b| by_relative_amount(a, b).unwrap_or(Ordering::Equal));
        Ok(Verification { defects, violations, intervals: layout.intervals })
    }
}

/// The largest magnitude of every state at any node, at least one.
fn state_magnitudes<'a, T: Real + 'a>(
    stages: impl Iterator<Item = SolutionStage<'a, T>>,
    nx: usize,
) -> Result<Vec<T>, OcpError> {
    let mut sizes = zeros(nx)?;
    sizes.fill(T::ONE);
    for stage in stages {
        for (size, x) in sizes.iter_mut().zip(stage.x) {
            *size = size.max(x.abs());
        }
    }
    Ok(sizes)
}

/// The largest violations inside an interval: of states, then of path constraints.
struct IntervalViolations<V, T> {
    point: V,
    g: Vec<T>,
    /// Amount, time and bound for both sides.
    largest_violations: Vec<[LargestViolation<T>; 2]>,
    states: usize,
}

#[derive(Clone, Copy)]
struct LargestViolation<T> {
    amount: T,
    time: T,
    bound: T,
}

impl<V: Zeroable, T: Real> IntervalViolations<V, T> {
    fn new<P: Formulation<T>>() -> Result<Self, OcpError> {
        Ok(Self {
            point: V::zeroed(),
            g: zeros(P::Path::ROWS)?,
            largest_violations: Vec::new(),
            states: P::Shape::NX,
        })
    }

    fn reset(&mut self) {
        let none = LargestViolation { amount: T::ZERO, time: T::ZERO, bound: T::ZERO };
        self.largest_violations.clear();
        self.largest_violations.resize(self.states + self.g.len(), [none; 2]);
    }

    /// Compares a value with its bounds.
    fn update_largest(&mut self, index: usize, value: T, [lower, upper]: [T; 2], time: T) {
        let Some(worst) = self.largest_violations.get_mut(index) else { return };
        for (worst, (amount, bound)) in worst.iter_mut().zip([(lower - value, lower), (value - upper, upper)])
        {
            if amount > worst.amount {
                *worst = LargestViolation { amount, time, bound };
            }
        }
    }

    fn check_states(&mut self, x: &[T], bounds: Option<[Bounds<'_, T>; 2]>, time: T) {
        let Some([here, next]) = bounds else { return };
        for (i, &x) in x.iter().enumerate() {
            let [low, other_low] = [here.lower, next.lower].map(|bounds| get(bounds, i));
            let [high, other_high] = [here.upper, next.upper].map(|bounds| get(bounds, i));
            let lower = if other_low < low { other_low } else { low };
            let upper = if other_high > high { other_high } else { high };
            self.update_largest(i, x, [lower, upper], time);
        }
    }

    fn check_constraints(&mut self, [lower, upper]: [Vec<T>; 2], time: T) {
        for row in 0..self.g.len() {
            let (value, bounds) = (get(&self.g, row), [get(&lower, row), get(&upper, row)]);
            self.update_largest(self.states + row, value, bounds, time);
        }
    }

    /// Appends the violations by name; times are multiplied by the duration.
    fn append_violations<P: Formulation<T>>(
        &self,
        interval: usize,
        duration: T,
        to: &mut Vec<InnerViolation<T>>,
    ) {
        let states = <P::Dynamics as Dynamics<T>>::NAMES.x;
        for (i, worst) in self.largest_violations.iter().enumerate() {
            for (&LargestViolation { amount, time, bound }, side) in
                worst.iter().zip([Side::Lower, Side::Upper])
            {
                if amount > T::ZERO {
                    let name = match i.checked_sub(self.states) {
                        None => states.get(i).map_or_else(String::new, |name| name.to_string()),
                        Some(row) => output_name::<P::Path, P::Shape, T>(row).to_string(),
                    };
                    let (time, relative) = (duration * time, amount / bound.abs().max(T::ONE));
                    to.push(InnerViolation { name, interval, time, side, amount, relative });
                }
            }
        }
    }
}
