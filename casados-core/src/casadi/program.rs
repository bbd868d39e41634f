//! A problem of optimal control as a nonlinear program: what is asked of it.

use crate::ocp::{Convexification, Exact, GaussNewton, HeapOcp, OcpError, SecondOrder};
use crate::ocp::{Formulation, Part};
use crate::qp::{QpView, Solution, StageDims};
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
    /// [`OcpError::Missing`]; [`OcpError::InvalidValue`] of a penalty.
    fn check(&mut self) -> Result<(), OcpError>;
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
        self.coupling().0.iter().enumerate().filter(|(_, tied)| **tied != 0.0).map(|(i, _)| i).collect()
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        let stages = self.qp().stages();
        let bounds = stages.flat_map(|stage| [stage.x_bounds(), stage.u_bounds()]);
        bounds.flat_map(|bounds| bounds.lower.iter().copied().zip(bounds.upper.iter().copied())).collect()
    }

    fn limits(&self, stage: usize, row: usize) -> [f64; 2] {
        HeapOcp::limits(self, stage, row)
    }

    fn check(&mut self) -> Result<(), OcpError> {
        HeapOcp::check(self)?;
        for (stage, bounds) in self.qp().stages().enumerate() {
            for bounds in [bounds.x_bounds(), bounds.u_bounds(), bounds.g_bounds()] {
                let sides = [(bounds.lower, bounds.lower_linear), (bounds.upper, bounds.upper_linear)];
                for (bounds, penalties) in sides {
                    for (index, (bound, &value)) in bounds.iter().zip(penalties).enumerate() {
                        if bound.is_finite() && value.is_finite() {
                            return Err(OcpError::InvalidValue { part: Part::Penalty, stage, index, value });
                        }
                    }
                }
            }
        }
        Ok(())
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
