//! The interface of an optimal control problem as a nonlinear program.

use super::entries::Blocks;
use super::pattern::{StagePattern, stage_pattern};
use crate::ocp::{
    Convexification, Curvature, Dynamics, Exact, Formulation, GaussNewton, HeapOcp, OcpError, SecondOrder,
};
use crate::qp::{Bounds, QpView, Solution, StageDims, marked_indices};
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// An optimal control problem with the variables and constraints
///
/// ```text
/// x = (x₀, u₀, x₁, u₁, …, x_N, e)        g = (φ(x₀, u₀) − x₁, g₀, φ(x₁, u₁) − x₂, g₁, …, g_N, soft bounds)
/// ```
///
/// Shared controls are part of `u₀` only, periodic states of `x₀` only, and soft sides have slack
/// variables `e`.
pub trait Program: Send {
    /// The dimensions of the stages.
    fn dims(&self) -> Vec<StageDims>;
    /// The names of states and controls.
    fn names(&self) -> [&'static [&'static str]; 2];
    /// The indices of periodic states, and of shared controls.
    fn couplings(&self) -> [Vec<usize>; 2];
    /// The sparsity patterns of the matrices of a stage.
    fn pattern(&mut self, stage: usize) -> StagePattern;
    /// The bounds of the states and controls of a stage.
    fn bounds(&self, stage: usize) -> Vec<[SoftBound; 2]>;
    /// The bounds of the constraints of a stage.
    fn limits(&self, stage: usize) -> Vec<[SoftBound; 2]>;
    /// Checks that the problem is complete.
    ///
    /// # Errors
    /// A text that describes the problem.
    fn check(&mut self) -> Result<(), String>;
    /// The states and controls of the iterate, stage by stage.
    fn point(&self) -> Vec<f64>;
    /// Keeps the stages of later calls; with `known` those of the last call are reused, since it
    /// succeeded at the same point. Returns whether intervals are not integrated again.
    fn keep_stages(&mut self, known: bool) -> bool;
    /// Computes the objective, and writes `φ` of every interval and `g` of every stage to `ends`;
    /// `room` is memory for a point.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn value(&mut self, v: &[f64], room: &mut Trial, ends: &mut Vec<f64>) -> Result<f64, OcpError>;
    /// As [`Program::value`], with derivatives.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn first(&mut self, v: &[f64], ends: &mut Vec<f64>, to: Derivatives<'_>) -> Result<f64, OcpError>;
    /// As [`Program::first`], with the Hessian of the Lagrangian; `multipliers` are those of `φ`
    /// and `g`.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn second(
        &mut self,
        v: &[f64],
        multipliers: &[f64],
        ends: &mut Vec<f64>,
        to: Derivatives<'_>,
    ) -> Result<f64, OcpError>;
    /// Derivatives of costs and constraints at the last point: Jacobians, Hessians, and the
    /// gradient of the objective.
    fn qp(&self) -> QpView<'_, f64>;
}

/// Receives the derivatives that are not in [`Program::qp`].
pub struct Derivatives<'a> {
    /// Sets the terms of the Hessian at a node to zero.
    pub clear: &'a dyn Fn(usize, &mut [f64]),
    /// Receives the derivatives of every interval.
    pub interval: &'a mut dyn FnMut(usize, &Blocks<'_>),
}

/// A point of all stages.
pub type Trial = Solution<f64, Vec<StageDims>, Vec<f64>>;

/// One side of a bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftBound {
    /// The bound; infinite if there is none.
    pub value: f64,
    /// The linear and the quadratic penalty of a violation; none for a hard bound.
    pub penalty: Option<[f64; 2]>,
}

impl SoftBound {
    /// A side with its penalties; infinite ones are hard.
    fn new(value: f64, linear: f64, quadratic: f64) -> Self {
        let is_soft = value.is_finite() && linear.is_finite();
        Self { value, penalty: is_soft.then_some([linear, quadratic]) }
    }
}

/// Both sides of all bounds, with these values.
fn constraint_bounds<'a>(
    bounds: &Bounds<'a, f64>,
    values: impl Iterator<Item = [f64; 2]> + 'a,
) -> Vec<[SoftBound; 2]> {
    let lower = bounds.lower_linear.iter().zip(bounds.lower_quadratic);
    let upper = bounds.upper_linear.iter().zip(bounds.upper_quadratic);
    let sides = values.zip(lower.zip(upper));
    let limits = sides.map(|([lower, upper], ((&l, &q), (&linear, &quadratic)))| {
        [SoftBound::new(lower, l, q), SoftBound::new(upper, linear, quadratic)]
    });
    limits.collect()
}

impl<P: Formulation<f64> + Send> Program for HeapOcp<P, f64>
where
    P::Dynamics: SecondOrder<f64>,
{
    fn dims(&self) -> Vec<StageDims> {
        HeapOcp::qp(self).dims().to_vec()
    }

    fn names(&self) -> [&'static [&'static str]; 2] {
        let names = HeapOcp::names(self);
        [names.x, names.u]
    }

    fn couplings(&self) -> [Vec<usize>; 2] {
        let qp = HeapOcp::qp(self);
        [marked_indices(qp.periodic()).collect(), marked_indices(qp.shared()).collect()]
    }

    fn pattern(&mut self, stage: usize) -> StagePattern {
        let rows = HeapOcp::qp(self).dims().get(stage).map_or(0, |dims| dims.ng);
        let is_last = stage == self.intervals();
        let mut pattern = stage_pattern(self.problem(), is_last, rows);
        if stage == 0 && self.has_arrival_cost() {
            let nx = self.names().x.len();
            (0..nx).for_each(|i| (0..nx).for_each(|j| pattern.node.set(i, j)));
        }
        pattern
    }

    fn bounds(&self, stage: usize) -> Vec<[SoftBound; 2]> {
        let Some(stage) = HeapOcp::qp(self).stages().nth(stage) else { return Vec::new() };
        let of = |bounds: Bounds<'_, f64>| {
            let values = bounds.lower.iter().zip(bounds.upper).map(|(&lower, &upper)| [lower, upper]);
            constraint_bounds(&bounds, values)
        };
        [of(stage.x_bounds()), of(stage.u_bounds())].concat()
    }

    fn limits(&self, stage: usize) -> Vec<[SoftBound; 2]> {
        let Some(view) = HeapOcp::qp(self).stages().nth(stage) else { return Vec::new() };
        let values = (0..).map(|row| HeapOcp::given_bounds(self, stage, row));
        constraint_bounds(&view.g_bounds(), values)
    }

    fn check(&mut self) -> Result<(), String> {
        if self.layout().free_count > 0 {
            return Err(OcpError::FreeParameters.to_string());
        }
        if self.layout().inner_rows > 0 {
            let what = "CasADi functions of problems with constraints at points inside intervals, or bounds of \
                algebraic states";
            let remedy = "Write these as path constraints at nodes";
            return Err(OcpError::Unsupported { what, remedy }.to_string());
        }
        HeapOcp::check(self).map_err(|error| error.to_string())
    }

    fn point(&self) -> Vec<f64> {
        self.iterate().stages().flat_map(|stage| stage.x.iter().chain(stage.u).copied()).collect()
    }

    fn keep_stages(&mut self, known: bool) -> bool {
        self.problem().parts().dynamics.keep_stages(known) && known
    }

    fn value(&mut self, v: &[f64], room: &mut Trial, ends: &mut Vec<f64>) -> Result<f64, OcpError> {
        ends.clear();
        ends.resize(HeapOcp::ends(self), 0.0);
        write(room, v, &[]);
        self.evaluate(room, ends)
    }

    fn first(&mut self, v: &[f64], ends: &mut Vec<f64>, to: Derivatives<'_>) -> Result<f64, OcpError> {
        write(self.iterate_mut(), v, &[]);
        linearise(self, GaussNewton { convexification: Convexification::None }, ends, to)
    }

    fn second(
        &mut self,
        v: &[f64],
        multipliers: &[f64],
        ends: &mut Vec<f64>,
        to: Derivatives<'_>,
    ) -> Result<f64, OcpError> {
        write(self.iterate_mut(), v, multipliers);
        linearise(self, Exact { convexification: Convexification::None }, ends, to)
    }

    fn qp(&self) -> QpView<'_, f64> {
        HeapOcp::qp(self)
    }
}

/// Computes derivatives at the iterate: the objective, and `φ` and `g` in `ends`.
fn linearise<P: Formulation<f64>, C: Curvature<P::Dynamics, f64>>(
    ocp: &mut HeapOcp<P, f64>,
    curvature: C,
    ends: &mut Vec<f64>,
    Derivatives { clear, interval }: Derivatives<'_>,
) -> Result<f64, OcpError> {
    ends.clear();
    ocp.linearise_separately(curvature, clear, &mut |k, step| {
        ends.extend(step.x);
        let [xx, xu, uu] = step.hessian;
        interval(k, &[step.dx, step.du, xx, xu, uu]);
    })?;
    let phi = ends.len();
    ends.resize(ocp.ends(), 0.0);
    ocp.evaluate_constraints(ends.get_mut(phi..).unwrap_or_default())
}

/// Copies states, controls and multipliers to the point of the problem.
fn write(to: &mut Trial, mut v: &[f64], mut multipliers: &[f64]) {
    let take = |from: &mut &[f64], to: &mut [f64]| {
        let (here, behind) = from.split_at(to.len().min(from.len()));
        *from = behind;
        let (to, rest) = to.split_at_mut(here.len());
        to.copy_from_slice(here);
        rest.fill(0.0);
    };
    to.each_stage_mut(|stage| {
        take(&mut v, stage.x);
        take(&mut v, stage.u);
        take(&mut multipliers, stage.dynamics);
        take(&mut multipliers, stage.g_upper);
        stage.g_lower.fill(0.0);
    });
}
