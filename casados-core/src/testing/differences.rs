//! Central differences of order 8 with an error estimate: they need nothing of a model but its
//! values.

use super::bounded::Bounded;
use std::vec::Vec;

/// `f'(a) ≈ Σ w_m (f(a + mh) − f(a − mh)) / h`
/// (Fornberg, "Generation of finite difference formulas on arbitrarily spaced grids", 1988).
const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];

/// Step sizes `2^-k` times the size of the variable, at least one.
const STEP_EXPONENTS: core::ops::RangeInclusive<i32> = 2..=12;

/// By how much two successive differences between estimates must shrink, unless they are rounding:
/// 256 where the order is reached. At a kink, or where the function is not resolved, they do not,
/// and nothing is known.
const MIN_SHRINK_FACTOR: f64 = 16.0;

/// The derivative of each output at `a`, with its error: that of rounding (carried through the
/// function by running error analysis) and that of truncation (the difference between two
/// successive step sizes, which is 255 times the truncation error of the smaller one). The step
/// size is the one with the smallest error; where the estimates do not converge the error is
/// infinite.
pub(super) fn derivative(
    a: f64,
    outputs: usize,
    mut function: impl FnMut(Bounded) -> Vec<Bounded>,
) -> Vec<Bounded> {
    let size = a.abs().max(1.0);
    // A power of two: the steps themselves are exact.
    let size = (2.0_f64).powi(size.log2().floor() as i32);
    let mut best: Vec<Bounded> =
        core::iter::repeat_n(Bounded { value: f64::NAN, error: f64::INFINITY }, outputs).collect();
    let mut last: Vec<(f64, f64)> = Vec::new();
    for k in STEP_EXPONENTS {
        let h = size * (2.0_f64).powi(-k);
        let mut moved = |m: f64| {
            let value = a + m * h;
            // What the sum has rounded: exact by Sterbenz or one more subtraction.
            let error = ((value - a) - m * h).abs().max((value - m * h - a).abs());
            function(Bounded { value, error })
        };
        let mut estimate: Vec<Bounded> = core::iter::repeat_n(Bounded::exact(0.0), outputs).collect();
        for (i, &weight) in WEIGHTS.iter().enumerate() {
            let m = (i + 1) as f64;
            // The weights are no binary fractions.
            let weight = Bounded { value: weight, error: f64::EPSILON * weight.abs() };
            let (right, left) = (moved(m), moved(-m));
            for ((sum, right), left) in estimate.iter_mut().zip(right).zip(left) {
                *sum = *sum + weight * (right - left);
            }
        }
        for sum in &mut estimate {
            *sum = *sum / Bounded::exact(h);
        }
        // The estimate, and by how much it has changed.
        let changes = estimate.iter().enumerate().map(|(i, now)| {
            let (value, change) = last.get(i).copied().unwrap_or((f64::NAN, f64::NAN));
            let latest = (now.value - value).abs();
            let error = now.error + latest;
            // A NaN has left the domain of the function and passes no comparison.
            let converges = latest <= now.error || latest * MIN_SHRINK_FACTOR <= change;
            if converges && error < best[i].error {
                best[i] = Bounded { value: now.value, error };
            }
            (now.value, latest)
        });
        last = changes.collect();
        // Smaller steps would only lose digits.
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

    /// Against the closed form: inside the estimate, and the estimate is small.
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

    /// Across a kink nothing is claimed; so near that no step stays on one side, and in the middle
    /// of the steps.
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
