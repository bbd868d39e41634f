//! The model at the stages of a step.

use super::record::{Coefficients, Work};
use crate::error::{Error, Place, Quantity};
use crate::linalg::slot;
use crate::model::{ArrayK, ArrayX, Dae, Pattern};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

impl<M: Dae, T: Real, const S: usize> Work<M, T, S> {
    /// Writes `u` and `p`, which are the same at all points of an interval.
    pub(crate) fn place_inputs(&mut self) {
        let u = 2 * M::Shape::NX + M::Shape::NZ;
        let p = u + M::Shape::NU;
        for point in &mut self.points {
            let point = point.as_mut();
            point[u..p].copy_from_slice(self.inputs.u.as_slice());
            point[p..p + M::Shape::NP].copy_from_slice(self.inputs.p.as_slice());
        }
    }

    /// Writes `(k_i, ξ_i, z_i, t_i)` with `ξ_i = x + h Σ_j a_ij k_j`.
    #[inline]
    pub(crate) fn place(
        &mut self,
        coefficients: &Coefficients<T, S>,
        step: usize,
        x: &ArrayX<M, T>,
        y: &ArrayK<M, [T; S]>,
    ) {
        let (nx, h) = (M::Shape::NX, self.inputs.time.step);
        let start = T::from_f64(step as f64);
        for (i, point) in self.points.iter_mut().enumerate() {
            let (a, point) = (&coefficients.a[i], point.as_mut());
            for (j, (k, x)) in y.as_ref().iter().zip(x.as_ref()).enumerate() {
                point[j] = k[i];
                point[nx + j] = *x + h * dot(a, k);
            }
            for (z, y) in point[2 * nx..].iter_mut().zip(&y.as_ref()[nx..]) {
                *z = y[i];
            }
            if let Some(t) = point.last_mut() {
                *t = self.inputs.time.start + h * (start + coefficients.c[i]);
            }
        }
    }

    /// The residual at all stages.
    ///
    /// # Errors
    /// An element that is not finite.
    pub(crate) fn evaluate_residual(&mut self, step: usize, iteration: usize) -> Result<(), Error> {
        for stage in 0..S {
            M::residual::<T>(&self.points[stage], &mut self.f);
            self.store_residual(Place { step, stage, iteration })?;
        }
        Ok(())
    }

    /// The residual and the Jacobian at all stages.
    ///
    /// # Errors
    /// An element that is not finite.
    pub(crate) fn evaluate_jacobian(&mut self, step: usize, iteration: usize) -> Result<(), Error> {
        for stage in 0..S {
            let jacobian = &mut self.linear.jacobian[stage];
            M::residual_jacobian::<T>(&self.points[stage], &mut self.f, jacobian);
            let at = Place { step, stage, iteration };
            if let Some((entry, value)) = not_finite(jacobian.as_ref()) {
                // The residual may well be finite; if it is not, it is the better message.
                self.store_residual(at)?;
                let equation = M::STRUCTURE.jacobian.at(entry).0;
                return Err(Error::NonFiniteModel { quantity: Quantity::Jacobian, equation, value, at });
            }
            self.store_residual(at)?;
        }
        Ok(())
    }

    fn store_residual(&mut self, at: Place) -> Result<(), Error> {
        if let Some((equation, value)) = not_finite(self.f.as_ref()) {
            return Err(Error::NonFiniteModel { quantity: Quantity::Residual, equation, value, at });
        }
        for (equation, f) in self.f.as_ref().iter().enumerate() {
            self.residual[slot::<M>(equation)][at.stage] = [*f];
        }
        Ok(())
    }

    /// The largest residual relative to the magnitude of its terms, `|f_r| / Σ_c |∂f_r/∂v_c v_c|`, and its
    /// equation and stage. Rounding errors of the model are a few ε of this, however equations and
    /// variables are scaled.
    pub(crate) fn relative_residual(&mut self) -> (T, usize, usize) {
        let Pattern { rows, columns } = M::STRUCTURE.jacobian;
        let mut largest = (T::ZERO, 0, 0);
        for stage in 0..S {
            let point = self.points[stage].as_ref();
            let magnitude = self.magnitude.as_mut();
            magnitude.fill(T::ZERO);
            for ((row, column), entry) in rows.iter().zip(columns).zip(self.linear.jacobian[stage].as_ref()) {
                let term = (*entry * point[*column as usize]).abs();
                magnitude[*row as usize] = magnitude[*row as usize] + term;
            }
            for (r, magnitude) in magnitude.iter().enumerate() {
                let [f] = self.residual[slot::<M>(r)][stage];
                // A residual of zero is zero even where all terms are. Terms that overflow say nothing.
                let relative = if f == T::ZERO {
                    T::ZERO
                } else if magnitude.is_finite() {
                    f.abs() / *magnitude
                } else {
                    T::ONE
                };
                if relative > largest.0 || !relative.is_finite() {
                    largest = (relative, r, stage);
                }
            }
        }
        largest
    }
}

/// The entries from `begin` to `end` of a Jacobian: row, column, value.
#[inline(always)]
pub(crate) fn entries<M: Dae, T: Real>(
    jacobian: &M::Jacobian<T>,
    begin: usize,
    end: usize,
) -> impl Iterator<Item = (usize, usize, T)> {
    let Pattern { rows, columns } = M::STRUCTURE.jacobian;
    let places = rows[begin..end].iter().zip(&columns[begin..end]);
    places
        .zip(&jacobian.as_ref()[begin..end])
        .map(|((row, column), value)| (*row as usize, *column as usize, *value))
}

/// `Σ_j a_j b_j`
#[inline(always)]
pub(crate) fn dot<T: Real, const S: usize>(a: &[T; S], b: &[T; S]) -> T {
    let mut sum = T::ZERO;
    for (a, b) in a.iter().zip(b) {
        sum = sum + *a * *b;
    }
    sum
}

/// The first element that is infinite or NaN.
#[inline]
pub(crate) fn not_finite<T: Real>(values: &[T]) -> Option<(usize, f64)> {
    // Without an early exit, so that it is a SIMD loop.
    if values.iter().fold(true, |finite, value| finite & value.is_finite()) {
        return None;
    }
    values.iter().position(|value| !value.is_finite()).map(|index| (index, values[index].to_f64()))
}
