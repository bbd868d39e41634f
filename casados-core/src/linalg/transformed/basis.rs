//! The Newton matrix of stages that share one Jacobian, in the eigenbasis of the tableau.
//!
//! With one Jacobian for all stages the Newton matrix is `I ⊗ [f_ẋ | f_z] + h A ⊗ [f_x | 0]`. From
//! `A = V diag(μ) V⁻¹` it falls into `S` systems of the size of the model,
//!
//! ```text
//! [f_ẋ + hμ_l f_x | f_z] ŷ_l = b̂_l        b̂ = V⁻¹ b        y = V ŷ
//! ```
//!
//! of which complex conjugate ones need to be solved only once (J. C. Butcher 1976; E. Hairer, G.
//! Wanner, Solving Ordinary Differential Equations II, section IV.8). All have the pattern and the
//! elimination plan of the model, so they are solved side by side: `⌊S/2⌋` complex numbers and a
//! real one if `S` is odd. Where registers are to be filled, a real eigenvalue takes part as a
//! complex one, and what is left of a register repeats the last.

use super::complex::Complex;
use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::scalar::Lanes;
use crate::tableau::Tableau;
use core::array::from_fn;

/// `A = V diag(μ) V⁻¹` of a tableau with at most one real eigenvalue, such as those of Gauss and
/// Radau, all in real numbers: one for each part of what is complex.
#[derive(Clone, Copy, Debug)]
pub struct Eigenbasis<T, const S: usize, const N: usize> {
    /// `μ`; of conjugate ones that with the positive imaginary part. A real one is the real number
    /// at the end, or the first of the complex ones if there is no such.
    pub(in crate::linalg) values: Complex<T, N>,
    /// Columns of `V⁻¹`, one for each stage.
    left: [Complex<T, N>; S],
    /// Columns of `V`, one for each part, with a factor of two where they stand for a conjugate
    /// too.
    right: [[T; S]; N],
}

impl<T: Lanes, const S: usize, const N: usize> Eigenbasis<T, S, N> {
    /// `None` if `A` has no such basis, or one so skew that it reproduces `A` only to more than
    /// `1e-10`.
    pub fn new(tableau: &Tableau<S>) -> Option<Self> {
        const {
            assert!(
                N == S || (N.is_multiple_of(2) && N > S),
                "a part for each stage, or complex numbers alone"
            )
        };
        let basis = Eigenbasis::<f64, S, N>::compute(tableau.a())?;
        let cast = |z: Complex<f64, N>| Complex { parts: z.parts.map(T::from_f64) };
        Some(Self {
            values: cast(basis.values),
            left: basis.left.map(cast),
            right: basis.right.map(|column| column.map(T::from_f64)),
        })
    }

    #[cfg(feature = "alloc")]
    /// The eigenvalues `μ` of `A`: of each complex pair there is one.
    pub fn values(&self) -> &Complex<T, N> {
        &self.values
    }

    #[cfg(feature = "alloc")]
    /// Columns of `V⁻¹`, one for each stage.
    pub fn left(&self) -> &[Complex<T, N>; S] {
        &self.left
    }

    #[cfg(feature = "alloc")]
    /// Columns of `V`, one for each part: `y = Σ_l right_l ŷ_l`.
    pub fn right(&self) -> &[[T; S]; N] {
        &self.right
    }

    /// `b̂ = V⁻¹ b`
    #[inline(always)]
    pub fn split<A: Arithmetic>(&self, b: &[T; S]) -> Complex<T, N> {
        let mut sum = Complex::<T, N>::zero();
        for (left, &b) in self.left.iter().zip(b) {
            A::subtract_row(&mut sum.parts, -b, &left.parts);
        }
        sum
    }

    /// `y = V ŷ`
    #[inline(always)]
    pub fn join<A: Arithmetic>(&self, y: &Complex<T, N>) -> [T; S] {
        let mut sum = [T::from_f64(0.0); S];
        for (column, &part) in self.right.iter().zip(&y.parts) {
            A::subtract_row(&mut sum, -part, column);
        }
        sum
    }
}

/// One complex number.
type Number = Complex<f64, 2>;

impl<const S: usize, const N: usize> Eigenbasis<f64, S, N> {
    fn compute(a: &[[f64; S]; S]) -> Option<Self> {
        let mut basis = Self { values: Complex::zero(), left: [Complex::zero(); S], right: [[0.0; S]; N] };
        // Where the real one is no number of its own it is the first of the complex ones.
        let first = usize::from(S % 2 == 1 && N.is_multiple_of(2));
        let (mut reals, mut pairs) = (0, first);
        for root in eigenvalues(a) {
            let is_real = root.parts[1].abs() <= 1e-8 * root.parts[0].abs();
            if !is_real && root.parts[1] < 0.0 {
                continue;
            }
            let start = if is_real { Complex::real(root.parts[0]) } else { root };
            let (value, left, right) = eigenvectors(a, start)?;
            if is_real && (S.is_multiple_of(2) || reals == 1) || !is_real && pairs == first + S / 2 {
                return None;
            }
            if is_real && first == 0 {
                reals += 1;
                basis.values.parts[N - 1] = value.parts[0];
                for stage in 0..S {
                    basis.left[stage].parts[N - 1] = left[stage].parts[0];
                    basis.right[N - 1][stage] = right[stage].parts[0];
                }
                continue;
            }
            let lane = if is_real { 0 } else { pairs };
            let (counter, weight) = if is_real { (&mut reals, 1.0) } else { (&mut pairs, 2.0) };
            *counter += 1;
            basis.values.set(lane, value.get(0));
            for stage in 0..S {
                basis.left[stage].set(lane, left[stage].get(0));
                let (re, im) = right[stage].scaled(weight).get(0);
                // The real part of a product.
                (basis.right[lane][stage], basis.right[N / 2 + lane][stage]) = (re, -im);
            }
        }
        // What is left of a register repeats the last.
        for lane in pairs..N / 2 {
            basis.values.set(lane, basis.values.get(pairs.saturating_sub(1)));
        }
        (reals == S % 2 && pairs == first + S / 2 && basis.reproduces(a)).then_some(basis)
    }

    /// Whether `V diag(μ) V⁻¹` is `A`.
    fn reproduces(&self, a: &[[f64; S]; S]) -> bool {
        let largest = a.iter().flatten().fold(0.0, |m: f64, a| m.max(a.abs()));
        (0..S).all(|j| {
            let column = self.values * self.left[j];
            (0..S).all(|i| {
                let sum: f64 = self.right.iter().zip(column.parts).map(|(right, part)| right[i] * part).sum();
                (sum - a[i][j]).abs() <= 1e-10 * largest
            })
        })
    }
}

/// All eigenvalues, to half the digits at least: the zeros of the characteristic polynomial (D. K.
/// Faddeev), all at once by the iteration of Durand and Kerner.
fn eigenvalues<const S: usize>(a: &[[f64; S]; S]) -> [Number; S] {
    // p(μ) = μˢ + c_{S−1} μ^{S−1} + … + c_0
    let mut coefficients = [0.0; S];
    let mut product = [[0.0; S]; S];
    for k in 1..=S {
        let shift = if k == 1 { 1.0 } else { coefficients[S + 1 - k] };
        let mut next = [[0.0; S]; S];
        for (next, a) in next.iter_mut().zip(a) {
            for (j, next) in next.iter_mut().enumerate() {
                *next = a[j] * shift + a.iter().zip(&product).map(|(a, row)| a * row[j]).sum::<f64>();
            }
        }
        product = next;
        let trace: f64 = (0..S).map(|i| product[i][i]).sum();
        coefficients[S - k] = -trace / k as f64;
    }
    // All zeros are of the size of the geometric mean of them; the start values lie around it, not
    // symmetric.
    let size = if S == 0 { 1.0 } else { root_of(coefficients[0].abs(), S) };
    let turn = Complex { parts: [0.4, 0.9] };
    let mut power = Complex::real(size);
    let mut roots = from_fn(|_| {
        power = power * turn;
        power
    });
    for _ in 0..200 {
        for i in 0..S {
            let root = roots[i];
            let mut value = Complex::real(1.0);
            for c in coefficients.iter().rev() {
                value = value * root + Complex::real(*c);
            }
            let mut others = Complex::real(1.0);
            for (j, other) in roots.iter().enumerate() {
                if j != i {
                    others = others * (root - *other);
                }
            }
            roots[i] = root - value / others;
        }
    }
    roots
}

/// `a^(1/n)` by bisection: no elementary functions are needed for it.
fn root_of(a: f64, n: usize) -> f64 {
    let (mut low, mut high) = (0.0, 1.0f64.max(a));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let power = (0..n).fold(1.0, |power, _| power * middle);
        if power < a { low = middle } else { high = middle }
    }
    high
}

/// From an approximate eigenvalue: the eigenvalue, and the left and the right eigenvector with
/// product one. Two-sided inverse iteration with the quotient of Rayleigh (A. M. Ostrowski 1959).
fn eigenvectors<const S: usize>(
    a: &[[f64; S]; S],
    start: Number,
) -> Option<(Number, [Number; S], [Number; S])> {
    let one = Complex::real(1.0);
    let (mut value, mut left, mut right) = (start, [one; S], [one; S]);
    for _ in 0..6 {
        // Beside the eigenvalue, so that the matrix is regular.
        let shift = value.scaled(1.0 + 1e-10);
        let matrix: [[Number; S]; S] =
            from_fn(|i| from_fn(|j| Complex::real(a[i][j]) - if i == j { shift } else { Complex::zero() }));
        right = direction(matrix, right)?;
        left = direction(from_fn(|i| from_fn(|j| matrix[j][i])), left)?;
        let mut overlap = Complex::zero();
        let mut quotient = Complex::zero();
        for i in 0..S {
            let mut product = Complex::zero();
            for j in 0..S {
                product = product + right[j].scaled(a[i][j]);
            }
            overlap = overlap + left[i] * right[i];
            quotient = quotient + left[i] * product;
        }
        left = left.map(|l| over(l, overlap));
        value = over(quotient, overlap);
        if start.parts[1] == 0.0 {
            value.parts[1] = 0.0;
        }
    }
    value.is_finite().then_some((value, left, right))
}

/// `a / b` with divisions where `Div`, which has to be fast, multiplies by reciprocals.
fn over(a: Number, b: Number) -> Number {
    let ([a_re, a_im], [b_re, b_im]) = (a.parts, b.parts);
    let size = b_re.abs().max(b_im.abs());
    let (re, im) = (b_re / size, b_im / size);
    let square = b_re * re + b_im * im;
    Number { parts: [(a_re * re + a_im * im) / square, (a_im * re - a_re * im) / square] }
}

/// `M⁻¹ b`, divided by its largest element. Gauss elimination with partial pivoting.
fn direction<const S: usize>(mut matrix: [[Number; S]; S], mut b: [Number; S]) -> Option<[Number; S]> {
    let size = |z: Number| z.parts[0].abs() + z.parts[1].abs();
    for k in 0..S {
        let best =
            (k..S).fold(k, |best, i| if size(matrix[i][k]) > size(matrix[best][k]) { i } else { best });
        matrix.swap(k, best);
        b.swap(k, best);
        for i in k + 1..S {
            let row = matrix[k];
            let factor = over(matrix[i][k], row[k]);
            for (element, above) in matrix[i].iter_mut().zip(row) {
                *element = *element - factor * above;
            }
            b[i] = b[i] - factor * b[k];
        }
    }
    for k in (0..S).rev() {
        for j in k + 1..S {
            b[k] = b[k] - matrix[k][j] * b[j];
        }
        b[k] = over(b[k], matrix[k][k]);
    }
    let largest = b.iter().fold(0.0, |m: f64, z| m.max(size(*z)));
    let scaled = b.map(|z| z.scaled(1.0 / largest));
    scaled.iter().all(Complex::is_finite).then_some(scaled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tableau::{Gauss, Method, RadauIIA};

    /// Whether the systems of the basis are those of `A`: `V μ V⁻¹ b = A b`. Errors are those of
    /// eigenvectors, ε times the condition of the basis, which is the size of the terms of the sum.
    fn check<const S: usize, const N: usize>(tableau: &Tableau<S>) {
        let basis = Eigenbasis::<f64, S, N>::new(tableau).expect("a basis");
        for column in 0..S {
            let unit = from_fn(|j| if j == column { 1.0 } else { 0.0 });
            let image = *basis.values() * basis.split::<crate::linalg::kernel::arithmetic::Separate>(&unit);
            let found = basis.join::<crate::linalg::kernel::arithmetic::Separate>(&image);
            for (stage, found) in found.into_iter().enumerate() {
                let size = |parts: &[f64; N], l: usize| parts[l].hypot(parts[N / 2 + l]);
                let right: [f64; N] = from_fn(|part| basis.right[part][stage]);
                let mut terms: f64 = (0..N / 2).map(|l| size(&right, l) * size(&image.parts, l)).sum();
                if N % 2 == 1 {
                    terms += (right[N - 1] * image.parts[N - 1]).abs();
                }
                let error = (found - tableau.a()[stage][column]).abs();
                // The elimination that finds an eigenvector, and the sums of `split` and `join`,
                // round S² times.
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

    /// The real eigenvalue of the three-stage Radau IIA method: 1/γ with γ = (6 + 81^(1/3) −
    /// 9^(1/3)) / 30 … its inverse `3 + 3^(2/3) − 3^(1/3)` is published in Hairer and Wanner,
    /// section IV.8.
    #[test]
    fn published_eigenvalue() {
        let basis = Eigenbasis::<f64, 3, 3>::new(&RadauIIA::<3>::TABLEAU).expect("a basis");
        let gamma = 3.0 + 3.0f64.powf(2.0 / 3.0) - 3.0f64.powf(1.0 / 3.0);
        assert!((1.0 / basis.values().parts[2] - gamma).abs() <= 32.0 * f64::EPSILON * gamma);
    }

    /// A diagonally implicit tableau has one eigenvalue twice, and no basis.
    #[test]
    fn defective_tableaux_have_none() {
        let gamma = 1.0 - 0.5f64.sqrt();
        let a = [[gamma, 0.0], [1.0 - gamma, gamma]];
        let tableau = Tableau::new(a, [1.0 - gamma, gamma], [gamma, 1.0]).expect("a tableau");
        assert!(Eigenbasis::<f64, 2, 2>::new(&tableau).is_none());
    }
}
