//! Folds: points at which `∂f/∂(ẋ, z)` becomes singular along an algebraic state.
//!
//! At a fold two branches of solutions meet and end. The determinant has opposite signs on the
//! branches, and is zero at the fold (W. C. Rheinboldt, Methods for Solving Systems of Nonlinear
//! Equations, 1998, chapter 9). Beyond a fold Newton's method alternates between the two sides.

use super::dense_fallback::unknown_name;
use crate::error::Error;
use crate::irk::coefficients::Coefficients;
use crate::irk::workspace::StageWorkspace;
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae, Pattern};
use crate::scalar::{Real, Scalar};
use crate::shape::{InBounds, Shape};
use crate::statistics::Statistics;
use alloc::vec::Vec;

/// Number of further Newton iterations that may find the opposite sign of the determinant: each
/// changes the side of the fold or not.
const MAX_SIGN_CHANGE_ITERATIONS: usize = 16;
/// Number of bisections between two points on opposite sides.
const BISECTIONS: usize = 40;

/// Result of complete pivoting of `∂f/∂(ẋ, z)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PivotAnalysis {
    /// Whether the determinant is negative.
    pub negative: bool,
    /// Smallest pivot relative to the largest, of the terms `∂f_r/∂v_c v_c` relative to the largest
    /// term of their equation.
    pub smallest: f64,
    /// The algebraic state (as an unknown) with the largest component of the approximate null
    /// vector.
    pub unknown: Option<usize>,
}

impl PivotAnalysis {
    /// Whether the matrix is singular up to rounding. A solution that is known to a few ε is at a
    /// distance of `√ε` from the other branch at a fold; the bound is the square root of that,
    /// `ε^¼`.
    pub fn is_singular<T: Real>(&self) -> bool {
        self.smallest <= Scalar::sqrt(Scalar::sqrt(T::EPSILON))
    }
}

impl<M: Dae, T: Real, const S: usize, F: Fallback> StageWorkspace<M, T, S, F> {
    /// Returns the error of a step whose iteration led from `start` to `y`, with the algebraic
    /// state along which `∂f/∂(ẋ, z)` becomes singular in between, if there is one.
    #[cold]
    pub(in crate::irk) fn explain_fold(
        &mut self,
        error: Error,
        coefficients: &Coefficients<T, S>,
        step: (usize, &ArrayX<M, T>),
        start: &ArrayK<M, [T; S]>,
        y: &mut ArrayK<M, [T; S]>,
    ) -> Error {
        let Error::NotConverged { at, .. } = error else {
            return error;
        };
        if const { M::Shape::NZ == 0 } {
            return error;
        }
        let singular = self.find_sign_change(coefficients, step, start, y).and_then(|side| {
            let (mut inside, mut outside) = (*start, *y);
            let mut found = None;
            for _ in 0..BISECTIONS {
                let mut middle = inside;
                let half = T::from_f64(0.5);
                let other = outside.as_ref().as_flattened();
                for (to, &other) in middle.as_mut().as_flattened_mut().iter_mut().zip(other) {
                    *to = half * (*to + other);
                }
                let elimination = self.analyse_pivots_at(coefficients, step, &middle)?;
                *(if elimination.negative == side { &mut inside } else { &mut outside }) = middle;
                found = elimination.unknown;
            }
            found
        });
        singular.map_or(error, |index| Error::SingularAlgebraic { unknown: unknown_name::<M>(index), at })
    }

    /// Returns whether the determinant is negative at the start, if it has the opposite sign at `y`
    /// or after a few more iterations from `y`.
    fn find_sign_change(
        &mut self,
        coefficients: &Coefficients<T, S>,
        (n, x): (usize, &ArrayX<M, T>),
        start: &ArrayK<M, [T; S]>,
        y: &mut ArrayK<M, [T; S]>,
    ) -> Option<bool> {
        let start_is_negative = self.analyse_pivots_at(coefficients, (n, x), start)?.negative;
        for iteration in 0..MAX_SIGN_CHANGE_ITERATIONS {
            if self.analyse_pivots_at(coefficients, (n, x), y)?.negative != start_is_negative {
                return Some(start_is_negative);
            }
            self.factor_dense(coefficients, n, iteration, &mut Statistics::default()).ok()?;
            self.solve_dense(coefficients);
            for (y, delta) in y.as_mut().iter_mut().zip(self.increment.as_ref()) {
                for (y, [delta]) in y.iter_mut().zip(delta) {
                    *y = *y - *delta;
                }
            }
        }
        None
    }

    /// Analyses `∂f/∂(ẋ, z)` at the last stage.
    fn analyse_pivots_at(
        &mut self,
        coefficients: &Coefficients<T, S>,
        (n, x): (usize, &ArrayX<M, T>),
        y: &ArrayK<M, [T; S]>,
    ) -> Option<PivotAnalysis> {
        self.place_stages(coefficients, n, x, y);
        self.evaluate_jacobian();
        let (entries, points) = (self.linearization.jacobian.as_ref(), self.points.as_ref());
        let last =
            |of: &[[T; S]], at: usize| of.get(at).and_then(|of| of.last()).map_or(f64::NAN, |v| v.to_f64());
        analyse_pivots::<M>(|entry| last(entries, entry), |variable| last(points, variable))
    }
}

/// Analyses `∂f/∂(ẋ, z)` of a model from the entries of its Jacobian and its variables. Returns
/// `None` if values are not finite or memory is missing.
#[cold]
pub(crate) fn analyse_pivots<M: Dae>(
    entry: impl Fn(usize) -> f64,
    variable: impl Fn(usize) -> f64,
) -> Option<PivotAnalysis> {
    let (n, nx) = (M::Shape::NK, M::Shape::NX);
    let [mut matrix, mut terms] = [zeros(n * n)?, zeros(n)?];
    let Pattern { rows, columns } = M::STRUCTURE.jacobian;
    for (index, (&row, &column)) in rows.iter().zip(columns).enumerate() {
        let (row, column, entry) = (row as usize, column as usize, entry(index));
        let size = terms.get_mut(row)?;
        *size = size.max((entry * variable(column)).abs());
        let unknown = match column {
            slope if slope < nx => slope,
            column if (2 * nx..nx + n).contains(&column) => column - nx,
            _ => continue,
        };
        *matrix.get_mut(row * n + unknown)? += entry;
    }
    for (row, size) in matrix.chunks_exact_mut(n).zip(terms) {
        let size = if size > 0.0 { size } else { row.iter().fold(0.0f64, |size, a| size.max(a.abs())) };
        row.iter_mut().for_each(|a| *a /= size);
    }
    for unknown in 0..n {
        let value = variable(if unknown < nx { unknown } else { unknown + nx }).abs();
        let largest = matrix.iter().skip(unknown).step_by(n).fold(0.0f64, |size, a| size.max(a.abs()));
        let size = if value > 0.0 { value } else { 1.0 / largest };
        matrix.iter_mut().skip(unknown).step_by(n).for_each(|a| *a *= size);
    }
    complete_pivoting(&mut matrix, n, nx)
}

fn zeros(count: usize) -> Option<Vec<f64>> {
    let mut list = Vec::new();
    list.try_reserve_exact(count).ok()?;
    list.resize(count, 0.0);
    Some(list)
}

/// Eliminates with complete pivoting; the null vector is scaled to one in its last unknown.
fn complete_pivoting(a: &mut [f64], n: usize, nx: usize) -> Option<PivotAnalysis> {
    if a.iter().any(|a| !a.is_finite()) {
        return None;
    }
    let mut order = Vec::new();
    order.try_reserve_exact(n).ok()?;
    order.extend(0..n);
    let (mut negative, mut largest, mut smallest) = (false, 0.0f64, f64::INFINITY);
    for k in 0..n {
        let candidates = (k..n).flat_map(|row| (k..n).map(move |column| (row, column)));
        let (row, column) = candidates.max_by(|(i, j), (k, l)| {
            let [first, second] =
                [i * n + j, k * n + l].map(|at| a.get(at).in_bounds().map_or(0.0, |a| a.abs()));
            first.total_cmp(&second)
        })?;
        negative ^= (row != k) ^ (column != k);
        (0..n).for_each(|j| a.swap(row * n + j, k * n + j));
        (0..n).for_each(|i| a.swap(i * n + column, i * n + k));
        order.swap(column, k);
        let pivot = *a.get(k * n + k)?;
        negative ^= pivot < 0.0;
        (largest, smallest) = (largest.max(pivot.abs()), smallest.min(pivot.abs()));
        if pivot == 0.0 {
            break;
        }
        for i in k + 1..n {
            let factor = *a.get(i * n + k)? / pivot;
            for j in k..n {
                *a.get_mut(i * n + j)? -= factor * *a.get(k * n + j)?;
            }
        }
    }
    let mut vector = zeros(n)?;
    *vector.last_mut()? = 1.0;
    for i in (0..n.saturating_sub(1)).rev() {
        let sum = (i + 1..n).map(|j| Some(a.get(i * n + j)? * vector.get(j)?)).sum::<Option<f64>>()?;
        let pivot = *a.get(i * n + i)?;
        *vector.get_mut(i)? = if pivot == 0.0 { 0.0 } else { -sum / pivot };
    }
    let algebraic = vector.iter().zip(&order).filter(|(_, unknown)| **unknown >= nx);
    let unknown = algebraic.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).map(|(_, unknown)| *unknown);
    Some(PivotAnalysis { negative, smallest: smallest / largest, unknown })
}

#[cfg(test)]
mod tests {
    use super::complete_pivoting;

    /// The sign of the determinant, and the null vector of a singular matrix.
    #[test]
    fn signs_and_directions() {
        for (matrix, negative) in [([0.0, 1.0, 1.0, 0.0], true), ([0.0, -3.0, 1.0, 0.0], false)] {
            let found = complete_pivoting(&mut matrix.clone(), 2, 0).unwrap();
            assert_eq!(found.negative, negative);
        }
        // Null vector (1, 0, −2): in the first equation the coefficient of the first unknown is
        // twice that of the third.
        let mut matrix = [2.0, 0.0, 1.0, 0.0, 5.0, 0.0, 4.0, 1.0, 2.0];
        let found = complete_pivoting(&mut matrix, 3, 0).unwrap();
        assert!(found.smallest < 1e-15 && found.unknown != Some(1), "{found:?}");
    }
}
