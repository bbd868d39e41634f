//! Whether the defect of a step is that of a smooth solution.
//!
//! The polynomial `u` of a step leaves the defect `d(τ) = u̇ − f(u)`. It is zero at the nodes, and
//! of a smooth solution `d(τ) = ℓ(τ) (d₀ + d₁ τ + …)` with `ℓ(τ) = Π_i (τ − c_i)`, where each term
//! is smaller than the last by a factor like the step size. The error at the end of the step is the
//! integral of the defect, in which all but high terms cancel: so it is of order `2s − 1` or `2s`,
//! and the estimate, of order `s`, may be a thousand tolerances. Where a force jumps inside the
//! step, or one of its derivatives, nothing cancels, and the estimate may be close to the error.
//! The defect at one or two points more tells them apart (W. H. Enright, Continuous numerical
//! methods for ODEs with defect control, J. Comput. Appl. Math. 125 (2000), on defects whose shape
//! is known).

use super::*;

/// A defect is suspected to be rough where it differs by this part from what the one that the
/// estimate looked at lets expect,
const SUSPECTED: f64 = 0.2;
/// or by this part over the root of the growth of errors;
const SUSPECTED_GROWING: f64 = 0.4;
/// and is rough where, at another point, it differs by this part over `1 + log₁₀` of the growth
/// from what both let expect.
const ROUGH: f64 = 0.2;

impl<M: Dae, T: Real, const S: usize, const G: usize> Collocation<M, T, S, G> {
    /// The largest defect that was looked at, filtered, relative to what the estimate tolerates;
    /// zero where it is that of a smooth solution. Of Gauss methods the estimate looks at the end
    /// of the step and the first further point is next to it: that one tells, where the estimate
    /// is larger than foreseen.
    pub(super) fn roughness(
        &mut self,
        start: &StepContext<'_, M, T>,
        growth: f64,
        check: DefectCheck,
        residuals: &mut usize,
    ) -> Result<f64, Failure> {
        let after_rejection = check != DefectCheck::Suspicious;
        if S < 3 || !after_rejection && !self.scheme.stiffly_accurate && growth <= 1.0 {
            return Ok(0.0);
        }
        let (scheme, radau) = (&self.scheme, self.scheme.stiffly_accurate);
        let (seen, near, far) = (if radau { 0.0 } else { 1.0 }, scheme.middle(S - 1), scheme.middle(S / 2));
        let [at_seen, at_near, at_far] = [scheme.nodes(seen), scheme.nodes(near), scheme.nodes(far)];
        let known = self.memory.error;
        let first = self.defect_at(near, start, residuals)?;
        let expected = scaled_sum::<M, T>(at_near / at_seen, &known, 0.0, &known);
        let difference = unlike::<M, T>(&first, &expected, start);
        let largest = size::<M, T>(&known, start).max(size::<M, T>(&first, start));
        if !after_rejection
            && difference <= SUSPECTED
            && difference * Scalar::sqrt(growth) <= SUSPECTED_GROWING
        {
            return Ok(0.0);
        }
        if !after_rejection && !radau {
            return Ok(largest);
        }
        let second = self.defect_at(far, start, residuals)?;
        let share = (far - seen) / (near - seen);
        let (a, b) = ((1.0 - share) / at_seen * at_far, share / at_near * at_far);
        let difference = unlike::<M, T>(&second, &scaled_sum::<M, T>(a, &known, b, &first), start);
        let decades = Scalar::ln(growth) / core::f64::consts::LN_10;
        let rough = check >= DefectCheck::SplineKnot || difference * (1.0 + decades) > ROUGH;
        Ok(if rough { largest.max(size::<M, T>(&second, start)) } else { 0.0 })
    }

    /// The filtered defect of the polynomial at a point of the step.
    fn defect_at(
        &mut self,
        tau: f64,
        start: &StepContext<'_, M, T>,
        residuals: &mut usize,
    ) -> Result<ArrayK<M, T>, Failure> {
        self.memory.point = *start.point;
        let Memory { point, y, .. } = &mut *self.memory;
        let (values, integrals) = (self.scheme.values(tau), self.scheme.integrals(tau));
        evaluate_polynomial::<M, T, S, G>(y, [&values, &integrals], start.h, point);
        if let Some(time) = point.as_mut().last_mut() {
            *time = *time + start.h * T::from_f64(tau);
        }
        self.evaluate_point(residuals)?;
        let mut defect = self.memory.f_point;
        self.filter(start.h, &mut defect);
        Ok(defect)
    }
}

/// `a x + b y`.
fn scaled_sum<M: Dae, T: Real>(a: f64, x: &ArrayK<M, T>, b: f64, y: &ArrayK<M, T>) -> ArrayK<M, T> {
    let mut sum = ArrayK::<M, T>::zeroed();
    for ((sum, x), y) in sum.as_mut().iter_mut().zip(x.as_ref()).zip(y.as_ref()) {
        *sum = T::from_f64(a) * *x + T::from_f64(b) * *y;
    }
    sum
}

/// The size of a defect of the states.
fn size<M: Dae, T: Real>(defect: &ArrayK<M, T>, start: &StepContext<'_, M, T>) -> f64 {
    norm(&defect.as_ref()[..M::Shape::NX], start.scale.as_ref())
}

/// The difference of two defects as a part of both: from zero to one.
fn unlike<M: Dae, T: Real>(a: &ArrayK<M, T>, b: &ArrayK<M, T>, start: &StepContext<'_, M, T>) -> f64 {
    let difference = scaled_sum::<M, T>(1.0, a, -1.0, b);
    // Written so that nothing over nothing is no difference.
    (size::<M, T>(&difference, start) / (size::<M, T>(a, start) + size::<M, T>(b, start))).max(0.0)
}
