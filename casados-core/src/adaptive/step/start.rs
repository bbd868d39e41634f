//! The start of a run: consistent initial values, and the size of the first step.

use crate::adaptive::point::{ModelPoint, variable_of_unknown, write_inputs};
use crate::adaptive::step::{Run, Span, Workspace};
use crate::adaptive::step_size::first_step_size;
use crate::adaptive::tolerances::norm;
use crate::error::Error;
use crate::model::{ArrayK, Dae, VectorX};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use bytemuck::Zeroable;

/// Exponent of the first step size of all implicit methods: with `1/(s+1)` the errors of five Gauss
/// stages do not follow the tolerance.
const FIRST_STEP_EXPONENT: f64 = 0.25;

impl<M: Dae, T: Real> Run<'_, M, T> {
    /// Prepares a run at the start of the interval.
    pub(super) fn prepare_run(&mut self, x0: &VectorX<M, T>, span: Span<T>) -> Result<(), Error> {
        let Workspace {
            start,
            start_guess: given,
            u,
            parameters,
            jacobian,
            jacobian_constants_written: ready,
            ..
        } = &mut *self.workspace;
        if !*ready {
            M::jacobian_constants::<T>(jacobian);
            *ready = true;
        }
        *start = *given;
        let at = ModelPoint { x: x0, u, p: parameters, t: span.start };
        match self.consistent.solve_with_diagnosis(&at, start) {
            Ok(points) => self.statistics.residuals += points,
            // A model without `z` may have a singular `f_ẋ` and still solvable equations.
            Err(Error::InconsistentStart { singular: true, .. }) if M::Shape::NZ == 0 => {
                *start = Zeroable::zeroed()
            }
            Err(error) => return Err(error),
        }
        let start = *start;
        self.write_start(x0, &start, span.start);
        Ok(())
    }

    /// Solves for consistent `ẋ` and `z` at the current time, from the present values.
    pub(super) fn make_consistent(&mut self, t: T) -> Result<(), Error> {
        let nx = M::Shape::NX;
        let Workspace { point, u, parameters, .. } = &mut *self.workspace;
        let mut x = VectorX::<M, T>::zeroed();
        let mut y = ArrayK::<M, T>::zeroed();
        for (index, y) in y.as_mut().iter_mut().enumerate() {
            *y = point[variable_of_unknown::<M>(index)];
        }
        x.as_mut_slice().copy_from_slice(&point.as_ref()[nx..2 * nx]);
        match self.consistent.solve(&ModelPoint { x: &x, u, p: parameters, t }, &mut y) {
            Ok(points) => self.statistics.residuals += points,
            // Singular `f_ẋ`, as at the start.
            Err(Error::InconsistentStart { singular: true, .. }) if M::Shape::NZ == 0 => return Ok(()),
            Err(error) => return Err(error),
        }
        for (index, y) in y.as_ref().iter().enumerate() {
            point[variable_of_unknown::<M>(index)] = *y;
        }
        Ok(())
    }

    /// Writes the variables at the start, with the consistent `(ẋ, z)`.
    pub fn write_start(&mut self, x0: &VectorX<M, T>, start: &ArrayK<M, T>, t: T) {
        let nx = M::Shape::NX;
        let Workspace { point, u, parameters, result, .. } = &mut *self.workspace;
        let numbers = point.as_mut();
        for (index, value) in start.as_ref().iter().enumerate() {
            numbers[variable_of_unknown::<M>(index)] = *value;
        }
        numbers[nx..2 * nx].copy_from_slice(x0.as_slice());
        write_inputs::<M, T>(numbers, u, parameters);
        if let Some(time) = numbers.last_mut() {
            *time = t;
        }
        result.z0.as_mut_slice().copy_from_slice(&start.as_ref()[nx..]);
    }

    /// Writes the solution at the end.
    pub fn write_result(&mut self) {
        let nx = M::Shape::NX;
        let Workspace { point, result, .. } = &mut *self.workspace;
        let states = &point.as_ref()[nx..];
        result.x.as_mut_slice().copy_from_slice(&states[..nx]);
        result.z.as_mut_slice().copy_from_slice(&states[nx..nx + M::Shape::NZ]);
    }

    /// The size of the first step.
    pub(super) fn initial_step_size(&mut self, span: Span<T>, longest: f64) -> Result<f64, Error> {
        if let Some(step) = self.options.initial_step {
            return Ok(step.min(longest));
        }
        let nx = M::Shape::NX;
        let Workspace { point, tolerances, parameters, u, start, .. } = &mut *self.workspace;
        let states = &point.as_ref()[nx..2 * nx];
        tolerances.update_user_scales(states);
        let scale = &tolerances.scale.as_ref()[..nx];
        let xdot = &start.as_ref()[..nx];
        let (size, slope) = (norm(states, scale), norm(xdot, scale));
        let length = first_step_size([size, slope], longest, FIRST_STEP_EXPONENT, |step| {
            // A second point, if consistent values exist there.
            let h = T::from_f64(if span.end < span.start { -step } else { step });
            let mut x = VectorX::<M, T>::zeroed();
            for ((to, x), xdot) in x.as_mut_slice().iter_mut().zip(states).zip(xdot) {
                *to = *x + h * *xdot;
            }
            let mut y = *start;
            let at = ModelPoint { x: &x, u, p: parameters, t: span.start + h };
            let solved = self.consistent.solve(&at, &mut y);
            self.statistics.residuals += solved.as_ref().copied().unwrap_or(0);
            if solved.is_err() {
                return 0.0;
            }
            for (y, xdot) in y.as_mut().iter_mut().zip(xdot) {
                *y = *y - *xdot;
            }
            norm(&y.as_ref()[..nx], scale)
        });
        self.update_scales();
        Ok(length)
    }
}
