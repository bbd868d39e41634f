//! Central differences of order 8 with an error estimate: they use only values of a model.

use super::bounded::Bounded;
use std::vec::Vec;

/// `f'(a) ≈ Σ w_m (f(a + mh) − f(a − mh)) / h`
/// (Fornberg, "Generation of finite difference formulas on arbitrarily spaced grids", 1988).
const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];

/// Step sizes `2^-k` times the magnitude of the variable, at least one.
const STEP_EXPONENTS: core::ops::RangeInclusive<i32> = 2..=12;

/// Minimum ratio of successive differences between estimates, unless these are rounding errors: 256
/// in the asymptotic range. At a kink, or if the function is not resolved, it is smaller, and the
/// estimate is discarded.
const MIN_SHRINK_FACTOR: f64 = 16.0;

/// The derivative of each output at `a` with its error: the rounding error, propagated by running
/// error analysis, plus the truncation error, the difference between two successive step sizes (255
/// times the truncation error of the smaller one). The step size with the smallest error is
/// selected; the error is infinite if the estimates do not converge.
pub(super) fn derivative(
    a: f64,
    outputs: usize,
    mut function: impl FnMut(Bounded) -> Vec<Bounded>,
) -> Vec<Bounded> {
    let size = a.abs().max(1.0);
    // A power of two, so that the steps are exact.
    let size = (2.0_f64).powi(size.log2().floor() as i32);
    let mut best: Vec<Bounded> =
        core::iter::repeat_n(Bounded { value: f64::NAN, error: f64::INFINITY }, outputs).collect();
    let mut last: Vec<(f64, f64)> = Vec::new();
    for k in STEP_EXPONENTS {
        let h = size * (2.0_f64).powi(-k);
        let mut moved = |m: f64| {
            let value = a + m * h;
            // The rounding error of the sum: exact by Sterbenz's lemma or one more subtraction.
            let error = ((value - a) - m * h).abs().max((value - m * h - a).abs());
            function(Bounded { value, error })
        };
        let mut estimate: Vec<Bounded> = core::iter::repeat_n(Bounded::exact(0.0), outputs).collect();
        for (i, &weight) in WEIGHTS.iter().enumerate() {
            let m = (i + 1) as f64;
            // The weights are not binary fractions.
            let weight = Bounded { value: weight, error: f64::EPSILON * weight.abs() };
            let (right, left) = (moved(m), moved(-m));
            for ((sum, right), left) in estimate.iter_mut().zip(right).zip(left) {
                *sum = *sum + weight * (right - left);
            }
        }
        for sum in &mut estimate {
            *sum = *sum / Bounded::exact(h);
        }
        // The estimate, and its change.
        let changes = estimate.iter().enumerate().map(|(i, now)| {
            let (value, change) = last.get(i).copied().unwrap_or((f64::NAN, f64::NAN));
            let latest = (now.value - value).abs();
            let error = now.error + latest;
            // NaN, outside of the domain, fails the comparison.
            let converges = latest <= now.error || latest * MIN_SHRINK_FACTOR <= change;
            if converges && error < best[i].error {
                best[i] = Bounded { value: now.value, error };
            }
            (now.value, latest)
        });
        last = changes.collect();
        // Smaller steps only lose digits.
        if last.iter().zip(&estimate).all(|(last, now)| last.1 <= now.error) {
            break;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Scalar;
    use std::vec;

    /// Against the closed form: the error is within its estimate, and the estimate is small.
    #[test]
    fn estimate_holds_and_is_small() {
        for a in [-3.0, -0.7, 0.0, 0.3, 1.0, 20.0] {
            let d = derivative(a, 3, |x| vec![x.sin(), (x * x) * x, x.atan()]);
            let exact = [f64::cos(a), 3.0 * a * a, 1.0 / (1.0 + a * a)];
            for (d, exact) in d.iter().zip(exact) {
                assert!((d.value - exact).abs() <= d.error + f64::EPSILON * exact.abs(), "{d:?} {exact}");
                assert!(d.error <= 1e-10 * exact.abs().max(1.0), "{d:?}");
            }
        }
    }

    /// At a kink the error is infinite, or bounds the deviation of the estimate.
    #[test]
    fn kinks() {
        for distance in [1e-9, 1e-6, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3] {
            let d = derivative(distance, 2, |x| vec![x.abs(), x.abs() * x.exp()]);
            let exact = [1.0, f64::exp(distance) * (1.0 + distance)];
            for (d, exact) in d.iter().zip(exact) {
                assert!(!d.error.is_finite() || (d.value - exact).abs() <= d.error, "{distance}: {d:?}");
            }
        }
    }

    /// Outside of the domain there is no derivative, rather than a wrong one.
    #[test]
    fn no_estimate_outside_domain() {
        let d = derivative(-5.0, 1, |x| vec![x.ln()]);
        assert!(d[0].value.is_nan());
    }
}
