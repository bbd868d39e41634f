//! Where a model changes its branch at once: an algebraic state that jumps has a Jacobian on each
//! side, and Newton's method, which has one for all stages, converges in no step over the border,
//! however short it is.

use super::state::StepState;
use super::*;
use crate::adaptive::discontinuity::Branches;
use crate::adaptive::point::variable_of_unknown;

/// A step of so many roundoff errors of the interval is as short as any: what an Euler step misses
/// there is far below rounding.
const SHORTEST_STEP_ROUNDOFFS: f64 = 1e3;

/// The length of a step that is as short as any.
pub(super) fn shortest_step<T: Real>(span: Span<T>, t: T) -> T {
    T::from_f64(SHORTEST_STEP_ROUNDOFFS * T::EPSILON) * (span.end - span.start).abs().max(t.abs())
}

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Goes over a border that a step ends at whose iteration did not converge however short it
    /// was: `x` by `h ẋ`, and from there on as from the start of an interval.
    ///
    /// Where there is no solution behind it the step fails as before.
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
        // The step that failed last was at most twice as long.
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

    /// The point that an explicit Euler step leads to, with consistent `(ẋ, z)`.
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
