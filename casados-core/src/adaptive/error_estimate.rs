//! The second estimate of the error of a step: what the linear part of the equations makes of the
//! defect.
//!
//! The polynomial `u` of a collocation step leaves the defect `u̇ − f(u) ≈ d ℓ(τ)` with `ℓ` zero at
//! the nodes and one where `d` is looked at. By the formula of variation of constants the end of
//! the step is wrong by
//!
//! ```text
//! h φ(hJ) d        φ(z) = ∫₀¹ exp(z (1 − τ)) ℓ(τ) dτ
//! ```
//!
//! At small `z` that is of order `z^(s−1)`, which is why a tolerance may be taken for granted there
//! that the estimate of order `s` does not reach; on the imaginary axis beyond it is `1/|z|` and no
//! smaller than that estimate. So oscillations whose periods are not much longer than the steps,
//! and components that are stiff, lose the order that other ones have: order reduction (A.
//! Prothero, A. Robinson, Math. Comp. 28 (1974); E. Hairer, G. Wanner, Solving Ordinary
//! Differential Equations II, section IV.15). In place of `φ` stands
//!
//! ```text
//! r(z) = q z^(s−1) / Q(z)        Q(z) = Π_i (1 − μ_i z) = 1 + … + q z^s
//! ```
//!
//! with the eigenvalues `μ_i` of `A`: `1/z` at infinity; of Radau IIA methods twice `φ` at zero,
//! and along the imaginary axis between 0.6 and 2 times. As `r(z) = Σ_i c_i / (1 − μ_i z)`, one
//! solve with the factors that Newton's method has gives it. The same solve gives `r(z)/z²`: of an
//! oscillation it points against the error, of a decay along it.

use super::step_size::fractional_power;
use super::tolerances::ORDER_REDUCTION_RATIO;
use crate::linalg::{COMPLEX_PARTS, Complex};
use crate::scalar::Scalar;

/// Errors of components that decay are damped by the steps that follow: no more than one of them is
/// there at a time, and it may be some tolerances.
const DAMPED_ERROR_WEIGHT: f64 = 0.2;
/// The errors of oscillations add up, over more steps the more accurate these are: from where the
/// second estimate says little to where it says all, they count so often.
const ACCUMULATION_FACTORS: [f64; 2] = [4.0, 12.0];

/// A complex number.
type ComplexNumber = Complex<f64, 2>;

/// Sums over the states of errors relative to the tolerance that was asked for, and of `(hJ)⁻²`
/// times them.
#[derive(Default)]
pub struct RelativeErrors {
    error_square_sum: f64,
    mixed_product_sum: f64,
    filtered_square_sum: f64,
    count: usize,
}

impl RelativeErrors {
    /// An error, and what is `(hJ)⁻²` times it.
    pub fn add(&mut self, error: f64, divided: f64) {
        self.error_square_sum += error * error;
        self.mixed_product_sum += error * divided;
        self.filtered_square_sum += divided * divided;
        self.count += 1;
    }
}

/// The filter of a method, and how what it lets pass is judged.
#[derive(Clone, Copy, Debug)]
pub struct DefectFilter {
    /// `c`, as factors of the parts of a solution; and those of `r(z)/z²`.
    weights: [[f64; COMPLEX_PARTS]; 2],
    /// The estimate of lower order behaves like this power of what is estimated here.
    lower_order_exponent: f64,
}

impl DefectFilter {
    /// From the eigenvalues of a method with so many stages; of complex conjugate ones there is
    /// one, and a real one is the first.
    pub fn new(values: Complex<f64, COMPLEX_PARTS>, stages: usize) -> Self {
        let value = |l: usize| {
            let (re, im) = values.get(l);
            ComplexNumber { parts: [re, im] }
        };
        let conjugate = |z: ComplexNumber| ComplexNumber { parts: [z.parts[0], -z.parts[1]] };
        let one = ComplexNumber::real(1.0);
        let (count, real) = (stages.div_ceil(2), stages % 2);
        let mut weights = [[0.0; COMPLEX_PARTS]; 2];
        for lane in 0..count {
            let own = value(lane);
            let mut coefficient = own.scaled(-1.0);
            for other in 0..count {
                for (copy, value) in [value(other), conjugate(value(other))].into_iter().enumerate() {
                    if (other, copy) != (lane, 0) && (copy == 0 || other >= real) {
                        // −μ_j / (1 − μ_j/μ_i)
                        coefficient = coefficient * value.scaled(-1.0) / (one - value / own);
                    }
                }
            }
            // z = 1/μ_i
            let z = one / own;
            let highest = (1..stages).fold(coefficient, |product, _| product * z);
            let twice = if lane < real { 1.0 } else { 2.0 };
            // Of two stages there is no such: then everything is kept.
            let divided = if stages < 3 { highest.scaled(-1.0) } else { highest * own * own };
            for (weights, number) in weights.iter_mut().zip([highest, divided]) {
                // The real part of a product.
                (weights[lane], weights[COMPLEX_PARTS / 2 + lane]) =
                    (twice * number.parts[0], -twice * number.parts[1]);
            }
        }
        let s = stages as f64;
        Self { weights, lower_order_exponent: (s + 1.0) / (2.0 * s) }
    }

    /// Factors of the parts of a solution.
    pub fn weights(&self) -> &[[f64; COMPLEX_PARTS]; 2] {
        &self.weights
    }

    /// The estimate of lower order or, if that is larger, the power of this one that behaves like
    /// it; the tolerance of the first is `tolerance_ratio` times the one that was asked for.
    pub fn max_estimate(&self, first: f64, tolerance_ratio: f64, relative: &RelativeErrors) -> f64 {
        let RelativeErrors {
            error_square_sum: square,
            mixed_product_sum: product,
            filtered_square_sum: divided_square,
            count,
        } = *relative;
        // The square of the cosine between them, where they point against each other.
        let against = if product < 0.0 { product / square * (product / divided_square) } else { 0.0 };
        let needed = Scalar::powi((tolerance_ratio / ORDER_REDUCTION_RATIO).min(1.0), 4);
        let kept = ACCUMULATION_FACTORS[0] + (ACCUMULATION_FACTORS[1] - ACCUMULATION_FACTORS[0]) * needed;
        let share = needed * (DAMPED_ERROR_WEIGHT + (kept - DAMPED_ERROR_WEIGHT) * against);
        let second = share * Scalar::sqrt(square / count.max(1) as f64);
        // Written so that NaN stays.
        if first.is_nan() || second <= first && second <= 1.0 {
            return first;
        }
        let second = fractional_power(second, self.lower_order_exponent);
        if second <= first { first } else { second }
    }
}
