//! A problem of optimal control as a nonlinear program: what is asked of it.

use crate::ocp::{ConstraintName, Formulation};
use crate::ocp::{Convexification, Exact, GaussNewton, HeapOcp, OcpError, SecondOrder};
use crate::qp::{Field, QpView, Side, Solution, StageDims, marked};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// A problem of optimal control, whose variables and constraints are
///
/// ```text
/// x = (x₀, u₀, x₁, u₁, …, x_N)        g = (φ(x₀, u₀) − x₁, g₀, φ(x₁, u₁) − x₂, g₁, …, g_N, x₀ − x_N where periodic)
/// ```
pub trait Program: Send {
    /// Dimensions of the stages.
    fn dims(&self) -> Vec<StageDims>;
    /// Which states are periodic.
    fn periodic(&mut self) -> Vec<usize>;
    /// Bounds of the variables.
    fn bounds(&self) -> Vec<(f64, f64)>;
    /// Bounds of a general constraint.
    fn limits(&self, stage: usize, row: usize) -> [f64; 2];
    /// Whether all that was to be said was, and all bounds are hard.
    ///
    /// # Errors
    /// What is wrong, as a text.
    fn check(&mut self) -> Result<(), String>;
    /// The variables of the iterate.
    fn point(&self, to: &mut [f64]);
    /// The objective, and `φ` of every interval and `g` of every stage in `ends`.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn value(&mut self, x: &[f64], ends: &mut Vec<f64>) -> Result<f64, OcpError>;
    /// The problem linearised at a point.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn first(&mut self, x: &[f64]) -> Result<QpView<'_, f64>, OcpError>;
    /// The same, with the Hessian of the Lagrangian, where `multipliers` are those of `g`.
    ///
    /// # Errors
    /// Those of functions and integrators.
    fn second(&mut self, x: &[f64], multipliers: &[f64]) -> Result<QpView<'_, f64>, OcpError>;
}

impl<P: Formulation<f64> + Send> Program for HeapOcp<P, f64>
where
    P::Dynamics: SecondOrder<f64>,
{
    fn dims(&self) -> Vec<StageDims> {
        self.qp().dims().to_vec()
    }

    fn periodic(&mut self) -> Vec<usize> {
        marked(self.qp().periodic()).collect()
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        let stages = self.qp().stages();
        let bounds = stages.flat_map(|stage| [stage.x_bounds(), stage.u_bounds()]);
        bounds.flat_map(|bounds| bounds.lower.iter().copied().zip(bounds.upper.iter().copied())).collect()
    }

    fn limits(&self, stage: usize, row: usize) -> [f64; 2] {
        HeapOcp::limits(self, stage, row)
    }

    fn check(&mut self) -> Result<(), String> {
        HeapOcp::check(self).map_err(|error| error.to_string())?;
        if let Some(control) = marked(self.qp().shared()).next() {
            let name = self.names().u.get(control).copied().unwrap_or_default();
            return Err(format!(
                "the control `{name}` is shared, which the program of CasADi does not say: make it a state of \
                 derivative zero"
            ));
        }
        match soft(self) {
            None => Ok(()),
            Some(bound) => Err(format!(
                "{bound} is soft, and the program of CasADi has no slack variables: write the penalty as a cost, \
                 or leave `soften` out"
            )),
        }
    }

    fn point(&self, to: &mut [f64]) {
        let values = self.iterate().stages().flat_map(|stage| stage.x.iter().chain(stage.u));
        for (to, from) in to.iter_mut().zip(values) {
            *to = *from;
        }
    }

    fn value(&mut self, x: &[f64], ends: &mut Vec<f64>) -> Result<f64, OcpError> {
        ends.clear();
        ends.resize(HeapOcp::ends(self), 0.0);
        let mut at = Solution::new(self.qp().dims())?;
        write(&mut at, x, &[]);
        self.evaluate(&at, ends)
    }

    fn first(&mut self, x: &[f64]) -> Result<QpView<'_, f64>, OcpError> {
        write(self.iterate_mut(), x, &[]);
        self.linearise(GaussNewton { convexification: Convexification::None })?;
        Ok(self.qp())
    }

    fn second(&mut self, x: &[f64], multipliers: &[f64]) -> Result<QpView<'_, f64>, OcpError> {
        write(self.iterate_mut(), x, multipliers);
        self.linearise(Exact { convexification: Convexification::None })?;
        Ok(self.qp())
    }
}

/// A bound that is soft, if there is one.
fn soft<P: Formulation<f64>>(ocp: &HeapOcp<P, f64>) -> Option<ConstraintName> {
    for (at, stage) in ocp.qp().stages().enumerate() {
        let fields = [
            (Field::StateBounds, stage.x_bounds()),
            (Field::ControlBounds, stage.u_bounds()),
            (Field::GeneralBounds, stage.g_bounds()),
        ];
        for (field, bounds) in fields {
            let sides = [
                (Side::Lower, bounds.lower, bounds.lower_linear),
                (Side::Upper, bounds.upper, bounds.upper_linear),
            ];
            for (side, bounds, penalties) in sides {
                let is_soft = |(bound, penalty): (&f64, &f64)| bound.is_finite() && penalty.is_finite();
                if let Some(index) = bounds.iter().zip(penalties).position(is_soft) {
                    return Some(ocp.name(field, at, index, side));
                }
            }
        }
    }
    None
}

/// Variables and multipliers of `g` to where the problem reads them.
fn write(to: &mut Solution<f64, Vec<StageDims>, Vec<f64>>, x: &[f64], multipliers: &[f64]) {
    let (mut x, mut multipliers) = (x.iter(), multipliers.iter());
    let stages = to.dims().len();
    for stage in 0..stages {
        let Some(stage) = to.stage_mut(stage) else { return };
        for to in stage.x.iter_mut().chain(stage.u) {
            *to = x.next().copied().unwrap_or(0.0);
        }
        for to in stage.dynamics.iter_mut().chain(stage.g_upper) {
            *to = multipliers.next().copied().unwrap_or(0.0);
        }
        stage.g_lower.fill(0.0);
    }
}
