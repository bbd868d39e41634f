//! Crossing of switching surfaces: if an algebraic state jumps, the Jacobians of both sides differ,
//! and Newton's method, with one Jacobian for all stages, converges in no step across the surface.

use super::state::StepState;
use super::*;
use crate::adaptive::discontinuity::Branches;
use crate::adaptive::point::variable_of_unknown;

/// Shortest step size, in roundoff errors of the interval or the time: the error of an explicit
/// Euler step of this length is far below rounding.
const SHORTEST_STEP_ROUNDOFFS: f64 = 1e3;

/// The shortest step size.
pub(super) fn shortest_step<T: Real>(span: Span<T>, t: T) -> T {
    T::from_f64(SHORTEST_STEP_ROUNDOFFS * T::EPSILON) * (span.end - span.start).abs().max(t.abs())
}

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Crosses a switching surface ahead of a step that fails to converge at the shortest step
    /// size: an explicit Euler step `x + h ẋ`, and a restart from consistent `(ẋ, z)`.
    ///
    /// Without a solution beyond the surface the step fails as before.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub(super) fn cross_switching_surface(
        &mut self,
        state: &mut StepState<T>,
        span: Span<T>,
    ) -> Result<(), Error> {
        if const { M::BRANCHES == 0 } || !state.is_unsolved() {
            return Ok(());
        }
        let shortest = shortest_step(span, state.t);
        let left = (span.end - state.t).abs();
        if state.h.abs() >= shortest || left <= T::from_f64(4.0) * shortest {
            return Ok(());
        }
        // The last failed step was at most twice as long.
        let over = T::from_f64(4.0) * shortest;
        let end = state.t + if span.end < span.start { -over } else { over };
        let before = self.workspace.point;
        if self.euler_step(end).is_err() {
            self.workspace.point = before;
            return Ok(());
        }
        let branches = Branches::at_point::<M, T>(&before);
        if branches.change_to(Branches::at_point::<M, T>(&self.workspace.point)).is_none() {
            self.workspace.point = before;
            return Ok(());
        }
        let first = self.initial_step_size(Span { start: end, end: span.end }, state.max_step)?;
        state.restart(end, first);
        Ok(())
    }

    /// Moves to the end of an explicit Euler step, with consistent `(ẋ, z)`.
    fn euler_step(&mut self, end: T) -> Result<(), Error> {
        let nx = M::Shape::NX;
        let Workspace { point, start, u, parameters, .. } = &mut *self.workspace;
        let h = end - point.as_ref().last().copied().unwrap_or(end);
        let mut x = VectorX::<M, T>::zeroed();
        for (index, x) in x.as_mut_slice().iter_mut().enumerate() {
            *x = point[nx + index] + h * point[index];
        }
        for (index, y) in start.as_mut().iter_mut().enumerate() {
            *y = point[variable_of_unknown::<M>(index)];
        }
        let at = ModelPoint { x: &x, u, p: parameters, t: end };
        self.statistics.residuals += self.consistent.solve_with_diagnosis(&at, start)?;
        for (index, y) in start.as_ref().iter().enumerate() {
            point[variable_of_unknown::<M>(index)] = *y;
        }
        point.as_mut()[nx..2 * nx].copy_from_slice(x.as_slice());
        if let Some(time) = point.as_mut().last_mut() {
            *time = end;
        }
        Ok(())
    }
}
