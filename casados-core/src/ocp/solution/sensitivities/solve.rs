//! Solves of the KKT system by the factors of the recursion and the bordered system.

use super::active_constraints::WithForces;
use super::bordered_system::BorderedSystem;
use super::factors::SolutionFactors;
use super::kkt_direction::{KktDirection, RightHandSide, solve_controls};
use crate::linalg::{axpy, dot};
use crate::ocp::formulation::error::OcpError;
use crate::qp::element::{get, set};
use crate::qp::{QpError, Solution, StageDims, Symmetric, copy_common, part, part_mut};
use crate::scalar::Real;

impl<T: Real> BorderedSystem<T> {
    /// Solves for a right-hand side, and once more with the forces of active constraints.
    pub fn solve<R: RightHandSide<T>>(
        &self,
        factors: &SolutionFactors<T>,
        right_hand_side: &R,
        direction: &mut KktDirection<T>,
    ) {
        self.solve_with_springs(factors, right_hand_side, direction);
        let active = &factors.active;
        active.write_multipliers(right_hand_side, direction);
        if active.is_empty() {
            return;
        }
        let multipliers = core::mem::take(&mut direction.constraint_multipliers);
        let forces = WithForces { right_hand_side, active, multipliers: &multipliers };
        self.solve_with_springs(factors, &forces, direction);
        direction.constraint_multipliers = multipliers;
    }

    /// Solves for a right-hand side: a sweep with all unknowns zero gives the residuals of the
    /// bordered system, whose solution is used in a second sweep.
    fn solve_with_springs<R: RightHandSide<T>>(
        &self,
        factors: &SolutionFactors<T>,
        right_hand_side: &R,
        direction: &mut KktDirection<T>,
    ) {
        direction.reset(self.unknown_count());
        sweep(factors, right_hand_side, direction);
        if self.unknown_count() > 0 {
            let (matrix, exchanged) = (&self.factors, &self.pivot_exchanges);
            let KktDirection { border_unknowns: border, border_residual: residual, .. } = &mut *direction;
            border.iter_mut().zip(&*residual).for_each(|(unknown, &left)| *unknown = -left);
            Symmetric::new(matrix, self.unknown_count(), exchanged).solve(border);
            sweep(factors, right_hand_side, direction);
        }
    }

    /// Factorises the system, column by column.
    ///
    /// # Errors
    /// [`QpError::NotConvex`] if the point is no minimum.
    pub fn factorise(
        factors: &mut SolutionFactors<T>,
        direction: &mut KktDirection<T>,
    ) -> Result<(), OcpError> {
        let mut border = core::mem::take(&mut factors.bordered_system);
        let n = border.unknown_count();
        let mut matrix = core::mem::take(&mut border.factors);
        factors.bordered_system = border;
        direction.reset(n);
        for unknown in 0..n {
            set(&mut direction.border_unknowns, unknown, T::ONE);
            sweep(factors, &ZeroRightHandSide, direction);
            set(&mut direction.border_unknowns, unknown, T::ZERO);
            copy_common(part_mut(&mut matrix, unknown * n, n), &direction.border_residual);
        }
        let border = &mut factors.bordered_system;
        border.factors = matrix;
        let noise = T::from_f64(T::EPSILON);
        let pivots = Symmetric::factor(&mut border.factors, n, &mut border.pivot_exchanges, noise);
        let negative = pivots.negative + factors.negative_pivots;
        let conditions = border.periodic_states.len();
        if negative > conditions || negative + pivots.vanished < conditions {
            return Err(OcpError::Qp(QpError::NotConvex { stage: 0, index: 0, pivot: -1.0 }));
        }
        Ok(())
    }
}

/// The zero right-hand side.
pub(super) struct ZeroRightHandSide;

impl<T: Real> RightHandSide<T> for ZeroRightHandSide {
    fn gradient(&self, _: usize, _: &mut [T]) {}
    fn dynamics_constant(&self, _: usize) -> &[T] {
        &[]
    }
    fn constraint_slope(&self, _: usize, _: usize) -> T {
        T::ZERO
    }
}

/// The right-hand side of a parameter.
struct ParameterRightHandSide<'a, T>(&'a SolutionFactors<T>, usize);

impl<T: Real> RightHandSide<T> for ParameterRightHandSide<'_, T> {
    fn gradient(&self, k: usize, q: &mut [T]) {
        let [nx, nu, _] = self.0.dims;
        copy_common(q, part(self.0.parameter_derivatives.gradient_jacobian(k), self.1 * (nx + nu), q.len()));
    }
    fn dynamics_constant(&self, k: usize) -> &[T] {
        let [nx, _, _] = self.0.dims;
        part(self.0.parameter_derivatives.end_jacobian(k), self.1 * nx, nx)
    }
    fn constraint_slope(&self, stage: usize, row: usize) -> T {
        self.0.parameter_derivatives.constraint_slope(stage, row, self.1)
    }
}

/// A right-hand side with a gradient over states and controls.
struct SeedRightHandSide<'a, T, D, M>(&'a Solution<T, D, M>);

impl<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> RightHandSide<T>
    for SeedRightHandSide<'_, T, D, M>
{
    fn gradient(&self, k: usize, q: &mut [T]) {
        let Some(stage) = self.0.stage(k) else { return };
        q.iter_mut().zip(stage.x.iter().chain(stage.u)).for_each(|(q, &value)| *q = value);
    }
    fn dynamics_constant(&self, _: usize) -> &[T] {
        &[]
    }
    fn constraint_slope(&self, _: usize, _: usize) -> T {
        T::ZERO
    }
}

/// Solves for the derivative with respect to an element of a given first state.
pub(super) fn solve_initial_state<T: Real>(
    factors: &SolutionFactors<T>,
    element: usize,
    direction: &mut KktDirection<T>,
) {
    set(&mut direction.initial_state, element, T::ONE);
    factors.bordered_system.solve(factors, &ZeroRightHandSide, direction);
    set(&mut direction.initial_state, element, T::ZERO);
}

/// Solves for the derivative with respect to a parameter.
pub(super) fn solve_parameter<T: Real>(
    factors: &SolutionFactors<T>,
    p: usize,
    direction: &mut KktDirection<T>,
) {
    factors.bordered_system.solve(factors, &ParameterRightHandSide(factors, p), direction);
}

impl<T: Real> SolutionFactors<T> {
    /// Solves for a right-hand side, in the direction of the factors.
    pub(in crate::ocp) fn solve<R: RightHandSide<T>>(&mut self, right_hand_side: &R) {
        let mut direction = core::mem::take(&mut self.direction);
        self.bordered_system.solve(self, right_hand_side, &mut direction);
        self.direction = direction;
    }
}

/// Solves for a gradient over states and controls.
pub(super) fn solve_seed<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    factors: &SolutionFactors<T>,
    seed: &Solution<T, D, M>,
    direction: &mut KktDirection<T>,
) {
    factors.bordered_system.solve(factors, &SeedRightHandSide(seed), direction);
}

/// Solves for given first state, multipliers `θ` of periodic states and shared controls `w`, and
/// computes the residuals of the conditions of the bordered system.
///
/// With `t = s_{k+1} + P_{k+1} e_k`, backward `q += [A B]ᵀ t + M_{·w} w`, `κ = −M_uu⁻¹ q_u`,
/// `s_k = q_x + Kᵀ q_u`; then forward `u = K x + κ`, `x₊ = A x + B u + e`, `π = P x + s`.
pub(super) fn sweep<T: Real, R: RightHandSide<T>>(
    factors: &SolutionFactors<T>,
    right_hand_side: &R,
    direction: &mut KktDirection<T>,
) {
    direction.border_residual.fill(T::ZERO);
    backward_sweep(factors, right_hand_side, direction);
    forward_sweep(factors, right_hand_side, direction);
    factors.bordered_system.evaluate_conditions(factors.intervals, direction);
}

fn backward_sweep<T: Real, R: RightHandSide<T>>(
    factors: &SolutionFactors<T>,
    right_hand_side: &R,
    direction: &mut KktDirection<T>,
) {
    let [nx, nu, _] = factors.dims;
    let (size, n) = (nx + nu, factors.intervals);
    let KktDirection { u, pi, work, border_unknowns: unknowns, border_residual: residual, .. } = direction;
    let (q, t) = work.split_at_mut_checked(size).unwrap_or_default();
    for k in (0..=n).rev() {
        q.fill(T::ZERO);
        if k < n {
            right_hand_side.gradient(k, q);
            copy_common(t, part(pi, (k + 1) * nx, nx));
            factors
                .cost_to_go(k + 1)
                .zip(right_hand_side.dynamics_constant(k))
                .for_each(|(column, &end)| axpy(end, column, t));
            factors.dynamics_rows(k).zip(&*t).for_each(|(row, &t)| axpy(t, row, q));
            factors.bordered_system.add_shared_control_gradient(k, unknowns, q, residual);
            let controls = part(&factors.control_factors, k * nu * nu, nu * nu);
            solve_controls(controls, part(q, nx, nu), part_mut(u, k * nu, nu));
        } else {
            right_hand_side.gradient(k, q);
            factors.bordered_system.add_periodic_multipliers(unknowns, q);
            factors.bordered_system.add_shared_control_gradient(k, unknowns, q, residual);
        }
        for (j, s) in part_mut(pi, k * nx, nx).iter_mut().enumerate() {
            let of_controls = if k < n { dot(factors.gain_column(k, j), part(q, nx, nu)) } else { T::ZERO };
            *s = get(q, j) + of_controls;
        }
    }
}

fn forward_sweep<T: Real, R: RightHandSide<T>>(
    factors: &SolutionFactors<T>,
    right_hand_side: &R,
    direction: &mut KktDirection<T>,
) {
    let [nx, nu, _] = factors.dims;
    let KktDirection {
        x,
        u,
        pi,
        initial_state: start,
        border_unknowns: unknowns,
        border_residual: residual,
        ..
    } = direction;
    factors.bordered_system.write_initial_state(start, unknowns, part_mut(x, 0, nx));
    for k in 0..=factors.intervals {
        let (before, after) = x.split_at_mut_checked((k + 1) * nx).unwrap_or_default();
        let state = part(before, k * nx, nx);
        let multipliers = part_mut(pi, k * nx, nx);
        factors.cost_to_go(k).zip(state).for_each(|(column, &x)| axpy(x, column, multipliers));
        let control = part_mut(u, k * nu, nu);
        if k == factors.intervals {
            control.fill(T::ZERO);
            factors.bordered_system.set_shared_controls(k, state, control, unknowns, residual);
            break;
        }
        for (j, &x) in state.iter().enumerate() {
            axpy(x, factors.gain_column(k, j), control);
        }
        factors.bordered_system.set_shared_controls(k, state, control, unknowns, residual);
        for (i, (next, row)) in part_mut(after, 0, nx).iter_mut().zip(factors.dynamics_rows(k)).enumerate() {
            *next = dot(part(row, 0, nx), state)
                + dot(part(row, nx, nu), control)
                + get(right_hand_side.dynamics_constant(k), i);
        }
    }
}
