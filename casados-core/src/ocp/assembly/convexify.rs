//! Convexification of the Hessians of stages, each separately: the structure for the Riccati
//! recursion is unchanged.

use crate::ocp::formulation::program::curvature::Convexification;
use crate::qp::part_mut;
use crate::scalar::Real;

/// The smallest eigenvalue, relative to the largest element.
const MIN_RELATIVE_EIGENVALUE: f64 = 1e-6;
/// The largest number of sweeps of Jacobi's method, which converges quadratically.
const MAX_JACOBI_SWEEPS: usize = 30;

/// Makes a matrix positive definite, given by the columns of its lower triangle at a distance of
/// `ld`. `scratch` has memory for two such matrices and a vector.
pub(in crate::ocp) fn convexify<T: Real>(
    method: Convexification,
    h: &mut [T],
    ld: usize,
    n: usize,
    scratch: &mut [T],
) {
    if matches!(method, Convexification::None | Convexification::Reduced) || n == 0 {
        return;
    }
    let mut largest = T::ZERO;
    for (j, column) in h.chunks_exact(ld.max(1)).take(n).enumerate() {
        for &value in column.get(j..n).unwrap_or_default() {
            largest = value.abs().max(largest);
        }
    }
    let min_eigenvalue =
        T::from_f64(MIN_RELATIVE_EIGENVALUE) * if largest > T::ZERO { largest } else { T::ONE };
    let (work, rest) = scratch.split_at_mut_checked(n * ld).unwrap_or_default();
    if is_positive_definite(h, ld, n, min_eigenvalue, work) {
        return;
    }
    if method == Convexification::LevenbergMarquardt {
        let mut shift = min_eigenvalue;
        // The shift is at most the sum of a row, and therefore `n` times the largest element.
        while !is_shifted_positive_definite(h, ld, n, min_eigenvalue, shift, work) {
            shift = shift * T::from_f64(4.0);
            if !shift.is_finite() {
                return;
            }
        }
        for j in 0..n {
            if let Some(d) = h.get_mut(j * ld + j) {
                *d = *d + shift;
            }
        }
        return;
    }
    let vectors = part_mut(rest, 0, n * ld);
    for (j, (column, to)) in h.chunks_exact(ld).take(n).zip(work.chunks_exact_mut(ld)).enumerate() {
        for (to, &value) in to.iter_mut().zip(column).skip(j) {
            *to = value;
        }
    }
    for j in 0..n {
        for i in 0..j {
            let value = get(work, ld, j, i);
            set(work, ld, i, j, value);
        }
    }
    vectors.fill(T::ZERO);
    (0..n).for_each(|j| set(vectors, ld, j, j, T::ONE));
    diagonalise(work, vectors, ld, n);
    for (j, column) in h.chunks_exact_mut(ld).take(n).enumerate() {
        for target in column.iter_mut().take(n).skip(j) {
            *target = T::ZERO;
        }
    }
    for k in 0..n {
        let value = get(work, ld, k, k);
        let value = if method == Convexification::Mirror { value.abs() } else { value };
        let value = if value > min_eigenvalue { value } else { min_eigenvalue };
        let vector = vectors.get(k * ld..).unwrap_or_default();
        for (j, (column, &vj)) in h.chunks_exact_mut(ld).zip(vector.iter().take(n)).enumerate() {
            for (target, &vi) in column.iter_mut().zip(vector).take(n).skip(j) {
                *target = *target + value * vi * vj;
            }
        }
    }
}

#[inline(always)]
fn get<T: Real>(a: &[T], ld: usize, row: usize, column: usize) -> T {
    a.get(column * ld + row).copied().unwrap_or(T::ZERO)
}

#[inline(always)]
fn set<T: Real>(a: &mut [T], ld: usize, row: usize, column: usize, value: T) {
    if let Some(element) = a.get_mut(column * ld + row) {
        *element = value;
    }
}

fn is_positive_definite<T: Real>(h: &[T], ld: usize, n: usize, min_eigenvalue: T, work: &mut [T]) -> bool {
    is_shifted_positive_definite(h, ld, n, min_eigenvalue, T::ZERO, work)
}

/// Whether the pivots of the Cholesky factorisation of `H + shift I` exceed half of
/// `min_eigenvalue`.
fn is_shifted_positive_definite<T: Real>(
    h: &[T],
    ld: usize,
    n: usize,
    min_eigenvalue: T,
    shift: T,
    work: &mut [T],
) -> bool {
    for (j, (column, to)) in h.chunks_exact(ld).take(n).zip(work.chunks_exact_mut(ld)).enumerate() {
        for (i, (to, &value)) in to.iter_mut().zip(column).enumerate().take(n).skip(j) {
            *to = if i == j { value + shift } else { value };
        }
    }
    for k in 0..n {
        let pivot = get(work, ld, k, k);
        // A pivot is at least the smallest eigenvalue; the factor of a half allows for rounding
        // errors.
        let pivot_is_positive = pivot > T::from_f64(0.5) * min_eigenvalue;
        if !pivot_is_positive {
            return false;
        }
        let Some((left, right)) = work.split_at_mut_checked((k + 1) * ld) else { return true };
        let column = left.get(k * ld..).unwrap_or_default();
        for (j, target) in right.chunks_exact_mut(ld).enumerate().take(n - k - 1) {
            let j = k + 1 + j;
            let factor = column.get(j).map_or(T::ZERO, |&c| c / pivot);
            if factor == T::ZERO {
                continue;
            }
            for (target, &c) in target.iter_mut().zip(column).take(n).skip(j) {
                *target = *target - factor * c;
            }
        }
    }
    true
}

/// Jacobi's method: diagonalises a symmetric matrix by rotations. The columns of `vectors` are its
/// eigenvectors.
pub(in crate::ocp) fn diagonalise<T: Real>(a: &mut [T], vectors: &mut [T], ld: usize, n: usize) {
    let relative_tolerance = T::from_f64(T::EPSILON);
    for _ in 0..MAX_JACOBI_SWEEPS {
        let mut max_off_diagonal = T::ZERO;
        let mut max_diagonal = T::ZERO;
        for j in 0..n {
            max_diagonal = get(a, ld, j, j).abs().max(max_diagonal);
            for i in 0..j {
                max_off_diagonal = get(a, ld, i, j).abs().max(max_off_diagonal);
            }
        }
        let is_not_diagonal = max_off_diagonal > relative_tolerance * max_diagonal;
        if !is_not_diagonal {
            return;
        }
        for q in 1..n {
            for p in 0..q {
                let apq = get(a, ld, p, q);
                if apq == T::ZERO {
                    continue;
                }
                let theta = (get(a, ld, q, q) - get(a, ld, p, p)) / (apq + apq);
                let t = T::ONE / (theta.abs() + (theta * theta + T::ONE).sqrt());
                let t = if theta < T::ZERO { -t } else { t };
                let c = T::ONE / (t * t + T::ONE).sqrt();
                rotate_columns(a, ld, n, [p, q], [c, t * c]);
                rotate_rows(a, ld, n, [p, q], [c, t * c]);
                rotate_columns(vectors, ld, n, [p, q], [c, t * c]);
            }
        }
    }
}

fn rotate_columns<T: Real>(a: &mut [T], ld: usize, n: usize, [p, q]: [usize; 2], [c, s]: [T; 2]) {
    let Some((left, right)) = a.split_at_mut_checked(q * ld) else { return };
    let first = left.get_mut(p * ld..).unwrap_or_default();
    for (x, y) in first.iter_mut().zip(right).take(n) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

fn rotate_rows<T: Real>(a: &mut [T], ld: usize, n: usize, [p, q]: [usize; 2], [c, s]: [T; 2]) {
    for column in a.chunks_exact_mut(ld).take(n) {
        let (Some(&x), Some(&y)) = (column.get(p), column.get(q)) else { return };
        if let Some(target) = column.get_mut(p) {
            *target = c * x - s * y;
        }
        if let Some(target) = column.get_mut(q) {
            *target = s * x + c * y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SMatrix;

    const N: usize = 5;
    const LD: usize = 8;

    /// A symmetric matrix with given eigenvalues.
    fn symmetric_matrix(values: [f64; N]) -> SMatrix<f64, N, N> {
        let a = SMatrix::<f64, N, N>::from_fn(|i, j| ((3 * i + 7 * j * j + 1) as f64).sin());
        let q = a.qr().q();
        q * SMatrix::from_diagonal(&values.into()) * q.transpose()
    }

    fn convexified(method: Convexification, a: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
        // Elements outside the lower triangle must not be read.
        let mut h = [f64::NAN; N * LD];
        for j in 0..N {
            for i in j..N {
                h[j * LD + i] = a[(i, j)];
            }
        }
        let mut scratch = [0.0; (2 * N + 1) * LD];
        convexify(method, &mut h, LD, N, &mut scratch);
        SMatrix::from_fn(|i, j| h[i.min(j) * LD + i.max(j)])
    }

    /// Rounding errors of rotations of 5×5 matrices of size 4: some hundred times 1e-15.
    const TOLERANCE: f64 = 1e-13;

    #[test]
    fn positive_definite_matrices_stay_as_they_are() {
        let a = symmetric_matrix([4.0, 3.0, 2.0, 1.0, 0.5]);
        for method in [Convexification::Project, Convexification::Mirror, Convexification::LevenbergMarquardt]
        {
            // The given matrix is symmetric up to rounding errors.
            let lower = SMatrix::<f64, N, N>::from_fn(|i, j| a[(i.max(j), i.min(j))]);
            assert_eq!(convexified(method, &a), lower);
        }
    }

    #[test]
    fn eigenvalues_are_projected_mirrored_or_shifted() {
        let values = [4.0, -2.0, 1.0, 0.0, -0.5];
        let a = symmetric_matrix(values);
        let least = MIN_RELATIVE_EIGENVALUE * a.amax();
        let projected = symmetric_matrix(values.map(|value| value.max(least)));
        let mirrored = symmetric_matrix(values.map(|value: f64| value.abs().max(least)));
        assert!((convexified(Convexification::Project, &a) - projected).amax() < TOLERANCE);
        assert!((convexified(Convexification::Mirror, &a) - mirrored).amax() < TOLERANCE);
        let shifted = convexified(Convexification::LevenbergMarquardt, &a) - a;
        let shift = shifted[(0, 0)];
        // The shift is at most four times as large as required.
        assert!(shift > 2.0 && shift < 4.0 * 2.1);
        assert!((shifted - SMatrix::identity() * shift).amax() < TOLERANCE);
        assert!((convexified(Convexification::None, &a) - a).amax() < TOLERANCE);
    }
}
