//! The first multipliers, where costs leave controls without curvature.
//!
//! ```text
//! min_π  ‖∇f + Jᵀπ‖        J: dynamics and equations        by        min_d  ½ ε ‖d‖² + ∇fᵀd        c + J d = 0
//! ```
//!
//! whose multipliers are those of least squares but for a part `ε` that `c` adds (A. Wächter, L. T.
//! Biegler, Math. Program. 106, 2006, section 3.6). Without them the first QP would be a linear
//! program: its Hessian would know nothing of the dynamics, and its solution is far away.

use super::Sqp;
use super::scaled::{Way, penalties_mut};
use super::state::State;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::program::Program;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::{Arrays, QpSolver, QpStart, StageDims, add_symmetric, part};
use crate::scalar::Real;

/// `ε`
const SMALL: f64 = 1e-6;
/// First multipliers that are larger are discarded.
const LARGEST: f64 = 1e3;

impl<S: QpSolver<T>, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Writes them to the iterate that was linearised, if it has none, and linearises it again.
    ///
    /// # Errors
    /// Those of [`Ocp::linearise`].
    pub(super) fn first_multipliers<P: Program<T>>(
        &mut self,
        ocp: &mut Ocp<P, T, D, M>,
        state: &State<'_, T>,
    ) -> Result<(), OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        let given = ocp.iterate.multipliers_mut().iter().any(|&m| m != T::ZERO);
        if given || ocp.controls_have_curvature() {
            return Ok(());
        }
        self.scale(ocp, state, Way::Into);
        ocp.remember_penalties(penalties_mut(self.work.as_mut(), ocp));
        ocp.ignore_inequalities();
        ocp.flatten(T::from_f64(SMALL), T::ONE);
        self.solution.copy_from(&ocp.iterate);
        self.qp_solver.permit(self.options.tolerance);
        let result = self.qp_solver.solve(ocp.qp(), QpStart::Warm, self.solution.view_mut());
        ocp.set_penalties(self.penalties(ocp), None, &[]);
        let multipliers = self.solution.multipliers_mut();
        if result.is_ok() && multipliers.iter().all(|m| m.abs() <= T::from_f64(LARGEST)) {
            ocp.iterate.multipliers_mut().copy_from_slice(multipliers);
        }
        self.scale(ocp, state, Way::Back);
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

    /// `½ ε ‖v − v̄‖²` as the objective of the QP at the iterate `v̄`.
    pub(super) fn forget_objective(&mut self, small: T) {
        self.flatten(small, T::ZERO);
    }

    /// `½ ε ‖v − v̄‖² + s ∇fᵀv` as the objective of the QP at the iterate `v̄`.
    fn flatten(&mut self, small: T, share: T) {
        let (v, _) = self.iterate.variables_and_costates();
        let mut begin = 0;
        for mut stage in self.qp.stages_mut() {
            let Arrays { n, ld, hessian, gradient, .. } = stage.arrays();
            let here = part(v, begin, ld);
            begin += ld;
            add_symmetric(gradient, hessian, ld, here, n);
            gradient.iter_mut().for_each(|g| *g = share * *g);
            hessian.fill(T::ZERO);
            let diagonal = hessian.iter_mut().step_by(ld + 1).take(n);
            for ((h, gradient), &v) in diagonal.zip(gradient).zip(here) {
                *h = small;
                *gradient = *gradient - small * v;
            }
        }
    }
}
