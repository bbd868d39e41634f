//! Least-squares multipliers, where costs leave controls without curvature.
//!
//! ```text
//! min_π  ‖∇f + Jᵀπ‖        J: dynamics and equations        by        min_d  ½ ε ‖d‖² + ∇fᵀd        c + J d = 0
//! ```
//!
//! The multipliers of the second problem are the least-squares multipliers up to an error of `ε`
//! (A. Wächter, L. T. Biegler, Math. Program. 106, 2006, section 3.6). Without initial multipliers
//! the first QP would be a linear program, whose Hessian lacks the dynamics and whose solution is
//! far away.

use super::Sqp;
use super::run_state::RunState;
use super::scaling::{ScalingDirection, saved_penalties_mut};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::{Arrays, QpSolver, QpStart, StageDims, add_symmetric_product, part};
use crate::scalar::Real;

/// `ε`
const PROXIMAL_WEIGHT: f64 = 1e-6;
/// The largest initial multiplier; if one is larger, all are discarded.
const CONSTR_MULT_INIT_MAX: f64 = 1e3;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Writes least-squares multipliers to the linearised iterate if it has no multipliers, and
    /// linearises it again.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`].
    pub(super) fn least_squares_multipliers<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &RunState<'_, T>,
    ) -> Result<(), OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let has_multipliers = ocp.iterate.multipliers_mut().iter().any(|&m| m != T::ZERO);
        if has_multipliers || ocp.controls_have_curvature() {
            return Ok(());
        }
        self.scale_qp_and_points(ocp, state, ScalingDirection::Scale);
        ocp.save_penalties(saved_penalties_mut(self.workspace.as_mut(), ocp));
        ocp.ignore_inequalities();
        ocp.set_proximal_objective(T::from_f64(PROXIMAL_WEIGHT), T::ONE);
        self.qp_solution.copy_from(&ocp.iterate);
        self.qp_solver.permit(self.options.tolerance);
        let result = self.qp_solver.solve(ocp.qp(), QpStart::Warm, self.qp_solution.view_mut());
        ocp.set_penalties(self.saved_penalties(ocp), None, &[]);
        let multipliers = self.qp_solution.multipliers_mut();
        if result.is_ok() && multipliers.iter().all(|m| m.abs() <= T::from_f64(CONSTR_MULT_INIT_MAX)) {
            ocp.iterate.multipliers_mut().copy_from_slice(multipliers);
        }
        self.scale_qp_and_points(ocp, state, ScalingDirection::Unscale);
        ocp.linearise(self.curvature)
    }
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Whether the Hessian has positive diagonal elements at all controls.
    fn controls_have_curvature(&self) -> bool {
        self.qp.view().stages().all(|stage| {
            let r = stage.r();
            (0..stage.dims().nu).all(|i| r.get(i, i).is_some_and(|value| value > T::ZERO))
        })
    }

    /// Sets the objective of the QP at the iterate `v̄` to `½ ε ‖v − v̄‖²`.
    pub(super) fn set_pure_proximal_objective(&mut self, weight: T) {
        self.set_proximal_objective(weight, T::ZERO);
    }

    /// Sets the objective of the QP at the iterate `v̄` to `½ ε ‖v − v̄‖² + s ∇fᵀv`.
    fn set_proximal_objective(&mut self, weight: T, gradient_factor: T) {
        let (v, _) = self.iterate.variables_and_costates();
        let mut begin = 0;
        for mut stage in self.qp.stages_mut() {
            let Arrays { n, ld, hessian, gradient, .. } = stage.arrays();
            let stage_variables = part(v, begin, ld);
            begin += ld;
            add_symmetric_product(gradient, hessian, ld, stage_variables, n);
            gradient.iter_mut().for_each(|g| *g = gradient_factor * *g);
            hessian.fill(T::ZERO);
            let diagonal = hessian.iter_mut().step_by(ld + 1).take(n);
            for ((h, gradient), &v) in diagonal.zip(gradient).zip(stage_variables) {
                *h = weight;
                *gradient = *gradient - weight * v;
            }
        }
    }
}
