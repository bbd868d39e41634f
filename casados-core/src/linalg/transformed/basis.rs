//! The Newton matrix of stages that share one Jacobian, in the eigenbasis of the tableau (Butcher
//! transformation).
//!
//! With one Jacobian for all stages the Newton matrix is `I ⊗ [f_ẋ | f_z] + h A ⊗ [f_x | 0]`. With
//! `A = V diag(μ) V⁻¹` it decomposes into `S` systems of the size of the model,
//!
//! ```text
//! [f_ẋ + hμ_l f_x | f_z] ŷ_l = b̂_l        b̂ = V⁻¹ b        y = V ŷ
//! ```
//!
//! of which one per complex conjugate pair is solved (J. C. Butcher 1976; E. Hairer, G. Wanner,
//! Solving Ordinary Differential Equations II, section IV.8). All have the sparsity pattern and the
//! elimination plan of the model, so they are solved together: `⌊S/2⌋` complex numbers and a real
//! one if `S` is odd. To fill registers, a real eigenvalue may be stored as a complex one, and the
//! last eigenvalue may be repeated.

use super::complex::Complex;
use super::decomposition::{DecompositionMemory, EigenbasisParts, decompose};
use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::scalar::Lanes;
use crate::tableau::Tableau;

/// `A = V diag(μ) V⁻¹` of a tableau with at most one real eigenvalue, such as those of Gauss and
/// Radau methods, in real arithmetic: `N` real parts for the complex numbers.
#[derive(Clone, Copy, Debug)]
pub struct Eigenbasis<T, const S: usize, const N: usize> {
    /// `μ`; for a conjugate pair the eigenvalue with positive imaginary part. A real eigenvalue is
    /// the real number at the end, or without one the first complex number.
    pub(in crate::linalg) eigenvalues: Complex<T, N>,
    /// Columns of `V⁻¹`, one per stage.
    left_vectors: [Complex<T, N>; S],
    /// Columns of `V`, one per part, with a factor of two for conjugate pairs.
    right_vectors: [[T; S]; N],
}

impl<T: Lanes, const S: usize, const N: usize> Eigenbasis<T, S, N> {
    /// Returns `None` if `A` has no such basis, or one so ill-conditioned that it reproduces `A`
    /// with an error above `1e-10`. Not inlined, since inlining would scalarise every number in the
    /// caller.
    #[cfg_attr(feature = "std", inline(never))]
    pub fn new(tableau: &Tableau<S>) -> Option<Self> {
        const {
            assert!(
                N == S || (N.is_multiple_of(2) && N > S),
                "a part for each stage, or complex numbers alone"
            )
        };
        let (mut values, mut left, mut right) = ([0.0; N], [[0.0; N]; S], [[0.0; S]; N]);
        let parts = EigenbasisParts {
            eigenvalues: &mut values,
            left_vectors: left.as_flattened_mut(),
            right_vectors: right.as_flattened_mut(),
        };
        let zero = Complex::<f64, 2>::zero();
        let (mut matrix, mut powers) = ([[zero; S]; S], [[[0.0; S]; S]; 2]);
        let mut memory = DecompositionMemory {
            roots: &mut [zero; S],
            vectors: [&mut [zero; S], &mut [zero; S]],
            matrix: matrix.as_flattened_mut(),
            coefficients: &mut [0.0; S],
            powers: powers.each_mut().map(|power| power.as_flattened_mut()),
        };
        if !decompose(tableau.a().as_flattened(), parts, &mut memory) {
            return None;
        }
        let cast = |parts: [f64; N]| Complex { parts: parts.map(T::from_f64) };
        Some(Self {
            eigenvalues: cast(values),
            left_vectors: left.map(cast),
            right_vectors: right.map(|column| column.map(T::from_f64)),
        })
    }

    #[cfg(feature = "alloc")]
    /// The eigenvalues `μ` of `A`, one per conjugate pair.
    pub fn eigenvalues(&self) -> &Complex<T, N> {
        &self.eigenvalues
    }

    #[cfg(feature = "alloc")]
    /// Columns of `V⁻¹`, one per stage.
    pub fn left_vectors(&self) -> &[Complex<T, N>; S] {
        &self.left_vectors
    }

    #[cfg(feature = "alloc")]
    /// Columns of `V`, one per part: `y = Σ_l right_l ŷ_l`.
    pub fn right_vectors(&self) -> &[[T; S]; N] {
        &self.right_vectors
    }

    /// `b̂ = V⁻¹ b`
    #[inline(always)]
    pub fn transform<A: Arithmetic>(&self, b: &[T; S]) -> Complex<T, N> {
        let mut sum = Complex::<T, N>::zero();
        for (left, &b) in self.left_vectors.iter().zip(b) {
            A::subtract_row(&mut sum.parts, -b, &left.parts);
        }
        sum
    }

    /// `y = V ŷ`
    #[inline(always)]
    pub fn transform_back<A: Arithmetic>(&self, y: &Complex<T, N>) -> [T; S] {
        let mut sum = [T::from_f64(0.0); S];
        for (column, &part) in self.right_vectors.iter().zip(&y.parts) {
            A::subtract_row(&mut sum, -part, column);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tableau::{Gauss, Method, RadauIIA};
    use core::array::from_fn;

    /// Checks that the systems of the basis are those of `A`: `V μ V⁻¹ b = A b`. Errors of
    /// eigenvectors are ε times the condition number of the basis, which is the magnitude of the
    /// terms of the sum.
    fn check<const S: usize, const N: usize>(tableau: &Tableau<S>) {
        let basis = Eigenbasis::<f64, S, N>::new(tableau).expect("a basis");
        for column in 0..S {
            let unit = from_fn(|j| if j == column { 1.0 } else { 0.0 });
            let image =
                *basis.eigenvalues() * basis.transform::<crate::linalg::kernel::arithmetic::Unfused>(&unit);
            let found = basis.transform_back::<crate::linalg::kernel::arithmetic::Unfused>(&image);
            for (stage, found) in found.into_iter().enumerate() {
                let size = |parts: &[f64; N], l: usize| parts[l].hypot(parts[N / 2 + l]);
                let right: [f64; N] = from_fn(|part| basis.right_vectors[part][stage]);
                let mut terms: f64 = (0..N / 2).map(|l| size(&right, l) * size(&image.parts, l)).sum();
                if N % 2 == 1 {
                    terms += (right[N - 1] * image.parts[N - 1]).abs();
                }
                let error = (found - tableau.a()[stage][column]).abs();
                // The elimination for an eigenvector, and the sums of `transform` and
                // `transform_back`, take S² rounding errors.
                let roundings = f64::max(64.0, (S * S) as f64);
                assert!(
                    error <= roundings * f64::EPSILON * terms,
                    "{S} stages, ({stage}, {column}): {error:e} of {terms:e}"
                );
            }
        }
    }

    #[test]
    fn bases_reproduce_their_tableaux() {
        check::<1, 1>(&Gauss::<1>::TABLEAU);
        check::<2, 2>(&Gauss::<2>::TABLEAU);
        check::<3, 3>(&Gauss::<3>::TABLEAU);
        check::<4, 4>(&Gauss::<4>::TABLEAU);
        check::<5, 5>(&Gauss::<5>::TABLEAU);
        check::<6, 6>(&Gauss::<6>::TABLEAU);
        check::<7, 7>(&Gauss::<7>::TABLEAU);
        check::<8, 8>(&Gauss::<8>::TABLEAU);
        check::<9, 9>(&Gauss::<9>::TABLEAU);
        check::<1, 1>(&RadauIIA::<1>::TABLEAU);
        check::<2, 2>(&RadauIIA::<2>::TABLEAU);
        check::<3, 3>(&RadauIIA::<3>::TABLEAU);
        check::<4, 4>(&RadauIIA::<4>::TABLEAU);
        check::<5, 5>(&RadauIIA::<5>::TABLEAU);
        check::<6, 6>(&RadauIIA::<6>::TABLEAU);
        check::<7, 7>(&RadauIIA::<7>::TABLEAU);
        check::<3, 8>(&RadauIIA::<3>::TABLEAU);
        check::<5, 8>(&RadauIIA::<5>::TABLEAU);
        check::<7, 8>(&RadauIIA::<7>::TABLEAU);
        check::<8, 8>(&RadauIIA::<8>::TABLEAU);
        check::<9, 9>(&RadauIIA::<9>::TABLEAU);
    }

    /// The real eigenvalue of the three-stage Radau IIA method, `(6 + 81^(1/3) − 9^(1/3)) / 30`.
    /// Hairer and Wanner, section IV.8, publish its inverse `γ = 3 + 3^(2/3) − 3^(1/3)`.
    #[test]
    fn published_eigenvalue() {
        let basis = Eigenbasis::<f64, 3, 3>::new(&RadauIIA::<3>::TABLEAU).expect("a basis");
        let gamma = 3.0 + 3.0f64.powf(2.0 / 3.0) - 3.0f64.powf(1.0 / 3.0);
        assert!((1.0 / basis.eigenvalues().parts[2] - gamma).abs() <= 32.0 * f64::EPSILON * gamma);
    }

    /// A diagonally implicit tableau has a double eigenvalue and no eigenbasis.
    #[test]
    fn defective_tableaux_have_none() {
        let gamma = 1.0 - 0.5f64.sqrt();
        let a = [[gamma, 0.0], [1.0 - gamma, gamma]];
        let tableau = Tableau::new(a, [1.0 - gamma, gamma], [gamma, 1.0]).expect("a tableau");
        assert!(Eigenbasis::<f64, 2, 2>::new(&tableau).is_none());
    }
}
