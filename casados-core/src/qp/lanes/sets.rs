//! Active sets, and residuals of the optimality conditions.

use super::cells::{Cell, Matrix, assign_negated, subtract, subtract_transposed};
use super::group::{Group, Size};
use crate::qp::layout::{part, part_mut};
use crate::scalar::{Lanes, Scalar};

/// The residuals of the problems of a group, by lanes.
pub struct LaneResiduals<E> {
    /// The gradient of the Lagrangian with nonnegative multipliers, including those of the
    /// dynamics.
    pub stationarity: E,
    pub dynamics: E,
    /// The largest violation of bounds.
    pub inequalities: E,
    pub objective: E,
}

impl<C: Copy> Group<'_, C> {
    /// Updates the active sets: controls become active if they violate a bound, and inactive if its
    /// multiplier is negative, both by more than the tolerance. Returns the number of changes; NaN
    /// for non-finite numbers.
    #[inline(always)]
    pub fn update_active_sets<E: Lanes<Cell = C>>(&mut self, tolerance: E) -> E {
        let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
        let (Size { nx, nu, .. }, n) = (self.size, self.size.n());
        let (mut changes, mut sum) = (zero, zero);
        let stages = self.active.chunks_exact_mut(nu.max(1)).zip(self.slope.chunks_exact(nu.max(1)));
        let bounds = self.lower.chunks_exact(nu.max(1)).zip(self.upper.chunks_exact(nu.max(1)));
        for (((active, slope), (lower, upper)), v) in stages.zip(bounds).zip(self.v.chunks_exact(n.max(1))) {
            let points = part(v, nx, nu).iter().zip(slope);
            for ((active, (u, slope)), (lower, upper)) in
                active.iter_mut().zip(points).zip(lower.iter().zip(upper))
            {
                let (before, u, slope) = (E::load(active), E::load(u), E::load(slope));
                let (lower, upper) = (E::load(lower), E::load(upper));
                let at_upper = E::select(E::lt(upper + tolerance, u), one, zero);
                let of_free = E::select(E::lt(u, lower - tolerance), -one, at_upper);
                // The multiplier of a lower bound is the slope, of an upper bound the negative
                // slope.
                let pulls = E::lt(tolerance, before * slope);
                let of_active = E::select(pulls, zero, before);
                let after = E::select(Scalar::eq(before, zero), of_free, of_active);
                changes = changes + E::select(Scalar::eq(before, after), zero, one);
                sum = sum + (u.abs() + slope.abs());
                after.store(active);
            }
        }
        E::select(sum.is_finite(), changes, E::from_f64(f64::NAN))
    }

    /// Returns the residuals of the optimality conditions, evaluated from the data, and the
    /// objective.
    #[inline(always)]
    pub fn residuals<E: Lanes<Cell = C>>(&mut self) -> LaneResiduals<E> {
        let zero = E::from_f64(0.0);
        let (Size { nx, nu, intervals }, n) = (self.size, self.size.n());
        let (mut stationarity, mut dynamics, mut inequalities, mut objective) = (zero, zero, zero, zero);
        for k in 0..=intervals {
            let v = part(self.v, k * n, n);
            let variables = if k < intervals { n } else { nx };
            // `H v`
            for g in &mut *self.g {
                zero.store(g);
            }
            assign_negated::<E>(self.minus, v);
            let hessian = Matrix { data: part(self.hessian, k * n * n, n * n), ld: n };
            subtract::<E>(self.g, hessian, self.minus, [n, variables]);
            let gradient = part(self.gradient, k * n, n);
            let half = E::from_f64(0.5);
            for ((g, v), gradient) in self.g.iter_mut().zip(v).zip(gradient).take(variables) {
                let (quadratic, linear) = (E::load(g), E::load(gradient));
                objective = objective + E::load(v) * (half * quadratic + linear);
                (quadratic + linear).store(g);
            }
            if k < intervals {
                let matrix = Matrix { data: part(self.dynamics, k * n * nx, n * nx), ld: n };
                assign_negated::<E>(part_mut(self.minus, 0, nx), part(self.multipliers, (k + 1) * nx, nx));
                subtract::<E>(self.g, matrix, self.minus, [n, nx]);
                // `x₊ − b − A x − B u`
                let gap = part_mut(self.minus, 0, nx);
                let next = part(self.v, (k + 1) * n, nx).iter().zip(part(self.offset, k * nx, nx));
                for (gap, (next, offset)) in gap.iter_mut().zip(next) {
                    (E::load(next) - E::load(offset)).store(gap);
                }
                subtract_transposed::<E>(gap, matrix, v);
                dynamics = gap.iter().fold(dynamics, |most, gap| E::load(gap).abs().max(most));
                let controls = part(v, nx, nu).iter().zip(part(self.g, nx, nu));
                let bounds = part(self.lower, k * nu, nu).iter().zip(part(self.upper, k * nu, nu));
                let active = part(self.active, k * nu, nu);
                for (((u, slope), (lower, upper)), active) in controls.zip(bounds).zip(active) {
                    let slope = E::load(slope);
                    let [below, above] = forces::<E>(active, slope);
                    stationarity = (slope - below + above).abs().max(stationarity);
                    let (u, lower, upper) = (E::load(u), E::load(lower), E::load(upper));
                    inequalities = (lower - u).max(inequalities);
                    inequalities = (u - upper).max(inequalities);
                }
            }
            let of_states = part(self.g, 0, nx).iter().zip(part(self.multipliers, k * nx, nx));
            for (g, multiplier) in of_states {
                stationarity = (E::load(g) - E::load(multiplier)).abs().max(stationarity);
            }
        }
        LaneResiduals { stationarity, dynamics, inequalities, objective }
    }

    /// Replaces bounds of at least the magnitude `no_bound` by infinite ones.
    #[inline(always)]
    pub fn remove_absent_bounds<E: Lanes<Cell = C>>(&mut self, no_bound: E) {
        let infinity = E::from_f64(f64::INFINITY);
        for (to_lower, to_upper) in self.lower.iter_mut().zip(&mut *self.upper) {
            let (lower, upper) = (E::load(to_lower), E::load(to_upper));
            E::select(E::le(lower, -no_bound), -infinity, lower).store(to_lower);
            E::select(E::le(no_bound, upper), infinity, upper).store(to_upper);
        }
    }
}

/// Returns the nonnegative multipliers of both bounds of a control.
#[inline(always)]
pub fn forces<E: Lanes>(active: &Cell<E>, slope: E) -> [E; 2] {
    let (zero, active) = (E::from_f64(0.0), E::load(active));
    let (below, above) = (slope.max(zero), (-slope).max(zero));
    [E::select(E::lt(active, zero), below, zero), E::select(E::lt(zero, active), above, zero)]
}
