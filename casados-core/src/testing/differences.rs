//! Central differences of order 8 with an error estimate: they need nothing of a model but its values.

use super::bounded::Bounded;
use std::vec::Vec;

/// `f'(a) ≈ Σ w_m (f(a + mh) − f(a − mh)) / h`
/// (Fornberg, "Generation of finite difference formulas on arbitrarily spaced grids", 1988).
const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];

/// Step sizes `2^-k` times the size of the variable, at least one.
const STEPS: core::ops::RangeInclusive<i32> = 2..=10;

/// The derivative of each output at `a`, with its error: that of rounding (carried through the function
/// by running error analysis) and that of truncation (the difference between two successive step sizes, which is
/// 255 times the truncation error of the smaller one). The step size is the one with the smallest error.
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
    let mut last: Option<Vec<Bounded>> = None;
    for k in STEPS {
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
            let (right, left) = (moved(m), moved(-m));
            for ((sum, right), left) in estimate.iter_mut().zip(right).zip(left) {
                *sum = *sum + Bounded::exact(weight) * (right - left);
            }
        }
        for sum in &mut estimate {
            *sum = *sum / Bounded::exact(h);
        }
        if let Some(last) = &last {
            for ((best, now), last) in best.iter_mut().zip(&estimate).zip(last) {
                let error = now.error + (now.value - last.value).abs();
                // An estimate that is not finite has left the domain of the function.
                if now.value.is_finite() && error < best.error {
                    *best = Bounded { value: now.value, error };
                }
            }
        }
        last = Some(estimate);
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

    /// Outside of the domain there is no derivative, rather than a wrong one.
    #[test]
    fn outside_of_the_domain() {
        let d = derivative(-5.0, 1, |x| vec![x.ln()]);
        assert!(d[0].value.is_nan());
    }
}
