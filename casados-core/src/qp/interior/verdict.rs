//! What is said of a problem that has no solution, and why that is true.

use super::iterate::Iterate;
use super::vector::{dot, largest_size};
use crate::qp::error::{QpError, Side};
use crate::qp::layout::{Places, part};
use crate::qp::problem::{QpView, Row};
use crate::qp::solution::SolutionView;
use crate::qp::statistics::larger;
use crate::scalar::{Packed, Real};

/// Of double precision `ε` is below.
const FINE: f64 = 1e-10;

impl<T: Real> Iterate<'_, T> {
    /// Whether the multipliers are a certificate (Farkas' lemma). Without objective the Lagrangian
    /// `L(v) = Σ π (A v + b − v₊) − Σ λ d(v)` is not positive at any point that satisfies all
    /// constraints, and differs from what it is here by its gradient `g` times the distance: where
    /// `g` vanishes and `L` is positive there is none. With a `g` that is small there is none but
    /// where numbers are 1e5 times (of single precision a hundred times) as large as here.
    #[inline(always)]
    pub fn is_infeasible<E: Packed<T>>(&mut self, multipliers: &mut [T]) -> bool {
        let _ = self.evaluate::<E>(multipliers);
        let count = self.sides.counts.sides();
        let (forces, distances) = (part(self.sides.multiplier, 0, count), part(self.sides.scratch, 0, count));
        let mut lagrangian = dot::<T, E>(multipliers, self.dynamics) - dot::<T, E>(forces, distances);
        if let Some(coupling) = &self.coupling {
            lagrangian = lagrangian + dot::<T, E>(coupling.theta, coupling.residual);
        }
        let gradient = largest_size::<T, E>(self.stationarity);
        let rounding = T::from_f64(64.0 * T::EPSILON) * self.terms.forces;
        let gradient = larger(gradient * T::from_f64(if T::EPSILON < FINE { 1e5 } else { 1e2 }), rounding);
        lagrangian > gradient * (T::ONE + self.terms.values)
    }
}

/// The largest violation of a hard bound, if it is larger than a tolerance.
pub fn worst<T: Real>(qp: QpView<'_, T>, solution: &SolutionView<'_, T>, tolerance: f64) -> Option<QpError> {
    let mut worst = (tolerance, None);
    for place in Places::<T>::new(qp.dims) {
        let data = part(qp.data, place.data, place.data_len());
        let v = part(solution.v, place.v, place.ld);
        let vector = |row| part(data, place.row_data(row), place.rows);
        for index in (0..place.n).chain(place.ld..place.ld + place.ng) {
            let value = if index < place.n {
                v.get(index).map_or(0.0, |v| v.to_f64())
            } else {
                let column = part(data, (place.next + index - place.ld) * place.ld, place.n);
                column.iter().zip(v).map(|(c, v)| c.to_f64() * v.to_f64()).sum()
            };
            let at = |row| vector(row).get(index).map_or(0.0, |b| b.to_f64());
            let sides = [
                (Side::Lower, at(Row::Lower), at(Row::LowerLinear), 1.0),
                (Side::Upper, at(Row::Upper), at(Row::UpperLinear), -1.0),
            ];
            for (side, bound, penalty, sign) in sides {
                let violation = sign * (bound - value);
                if penalty.is_infinite() && violation > worst.0 {
                    let (field, index) = place.name(index);
                    let stage = place.stage;
                    worst = (violation, Some(QpError::Infeasible { field, stage, index, side, violation }));
                }
            }
        }
    }
    worst.1
}
