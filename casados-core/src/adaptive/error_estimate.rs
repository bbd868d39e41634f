//! The second error estimate: the defect of a step, filtered by a rational function of `hJ`.
//!
//! The collocation polynomial `u` has the defect `u̇ − f(u) ≈ d ℓ(τ)`, where `ℓ` is zero at the
//! nodes and one at the point at which `d` is evaluated. By the variation-of-constants formula the
//! error at the end of the step is
//!
//! ```text
//! h φ(hJ) d        φ(z) = ∫₀¹ exp(z (1 − τ)) ℓ(τ) dτ
//! ```
//!
//! For small `z` this is of order `z^(s−1)`, which justifies the coarser tolerance of the first
//! estimate, of order `s`. On the imaginary axis beyond, it is `1/|z|`, as large as that estimate.
//! Oscillations with periods close to the step size, and stiff components, therefore suffer order
//! reduction (A. Prothero, A. Robinson, Math. Comp. 28 (1974); E. Hairer, G. Wanner, Solving
//! Ordinary Differential Equations II, section IV.15). The estimate replaces `φ` by
//!
//! ```text
//! r(z) = q z^(s−1) / Q(z)        Q(z) = Π_i (1 − μ_i z) = 1 + … + q z^s
//! ```
//!
//! with the eigenvalues `μ_i` of `A`. It is `1/z` at infinity; for Radau IIA methods twice `φ` at
//! zero and 0.6 to 2 times `φ` on the imaginary axis. Since `r(z) = Σ_i c_i / (1 − μ_i z)`, one
//! solve with the factors of Newton's method evaluates it. The same solve evaluates `r(z)/z²`,
//! which has the opposite direction of the error for an oscillation and the same direction for a
//! decay.

use super::step_size::fractional_power;
use super::tolerances::ORDER_REDUCTION_RATIO;
use crate::linalg::{COMPLEX_PARTS, Complex};
use crate::scalar::Scalar;

/// Weight of errors of decaying components: later steps damp them, so that at most one local error
/// is present at a time, which may be a few tolerances.
const DAMPED_ERROR_WEIGHT: f64 = 0.2;
/// Weights of errors of oscillations, which accumulate: for a second estimate with little weight
/// (large tolerances) and with full weight. More accurate runs have more steps.
const ACCUMULATION_FACTORS: [f64; 2] = [4.0, 12.0];

/// A complex number.
type ComplexNumber = Complex<f64, 2>;

/// Sums over the states of errors relative to the user's tolerance, and of `(hJ)⁻²` times these
/// errors.
#[derive(Default)]
pub struct RelativeErrors {
    error_square_sum: f64,
    mixed_product_sum: f64,
    filtered_square_sum: f64,
    count: usize,
}

impl RelativeErrors {
    /// Adds an error and `(hJ)⁻²` times it.
    pub fn add(&mut self, error: f64, divided: f64) {
        self.error_square_sum += error * error;
        self.mixed_product_sum += error * divided;
        self.filtered_square_sum += divided * divided;
        self.count += 1;
    }
}

/// The defect filter of a method, with the weights of its result.
#[derive(Clone, Copy, Debug)]
pub struct DefectFilter {
    /// The coefficients `c` of `r(z)`, and those of `r(z)/z²`, for the real and imaginary parts of
    /// a solution.
    weights: [[f64; COMPLEX_PARTS]; 2],
    /// The lower-order estimate is proportional to this power of the second estimate.
    lower_order_exponent: f64,
}

impl DefectFilter {
    /// The filter of a method with `stages` stages and the eigenvalues `values`: one of each
    /// complex conjugate pair, a real one first.
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
            // With two stages `r(z)/z²` has a pole at zero; the errors then have full weight.
            let divided = if stages < 3 { highest.scaled(-1.0) } else { highest * own * own };
            for (weights, number) in weights.iter_mut().zip([highest, divided]) {
                // The real part of the product.
                (weights[lane], weights[COMPLEX_PARTS / 2 + lane]) =
                    (twice * number.parts[0], -twice * number.parts[1]);
            }
        }
        let s = stages as f64;
        Self { weights, lower_order_exponent: (s + 1.0) / (2.0 * s) }
    }

    /// The coefficients for the parts of a solution.
    pub fn weights(&self) -> &[[f64; COMPLEX_PARTS]; 2] {
        &self.weights
    }

    /// The lower-order estimate `first` or, if larger, the power of the second estimate with the
    /// same order; `tolerance_ratio` is the ratio of the estimator tolerance and the user's.
    pub fn max_estimate(&self, first: f64, tolerance_ratio: f64, relative: &RelativeErrors) -> f64 {
        let RelativeErrors {
            error_square_sum: square,
            mixed_product_sum: product,
            filtered_square_sum: divided_square,
            count,
        } = *relative;
        // The squared cosine of their angle, if they have opposite directions.
        let against = if product < 0.0 { product / square * (product / divided_square) } else { 0.0 };
        let needed = Scalar::powi((tolerance_ratio / ORDER_REDUCTION_RATIO).min(1.0), 4);
        let kept = ACCUMULATION_FACTORS[0] + (ACCUMULATION_FACTORS[1] - ACCUMULATION_FACTORS[0]) * needed;
        let share = needed * (DAMPED_ERROR_WEIGHT + (kept - DAMPED_ERROR_WEIGHT) * against);
        let second = share * Scalar::sqrt(square / count.max(1) as f64);
        // NaN is returned.
        if first.is_nan() || second <= first && second <= 1.0 {
            return first;
        }
        let second = fractional_power(second, self.lower_order_exponent);
        if second <= first { first } else { second }
    }
}
