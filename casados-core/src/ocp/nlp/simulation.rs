//! States that follow from the controls of a point.

use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::{Places, Solution, StageDims, part, part_mut};
use crate::scalar::Real;

/// A run begins again at a simulation that violates less than this part of what its iterate does.
pub(in crate::ocp) const RESTART_GAIN: f64 = 0.5;
/// It asks for one after so many steps in a row that lead nowhere.
pub(in crate::ocp) const RESTART_AFTER: usize = 16;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Makes a guess the iterate, moved into its bounds, with the states that follow from its
    /// controls; what was the iterate is in `guess` then. Whether these have values: otherwise the
    /// iterate stays.
    pub(in crate::ocp) fn simulate_guess(&mut self, guess: &mut Solution<T, D, M>, ends: &mut [T]) -> bool {
        core::mem::swap(&mut self.iterate, guess);
        self.clip();
        core::mem::swap(&mut self.iterate, guess);
        let has_values = self.simulate(guess, ends, &[], f64::INFINITY);
        if has_values {
            core::mem::swap(&mut self.iterate, guess);
            self.join_controls();
            self.join_states();
        }
        has_values
    }

    /// Moves the states of a point to the ends of the intervals before them, until all gaps are
    /// closed. Whether that has values, and ends no farther away than `far` times the gaps that
    /// there were, in `units` if there are any.
    pub(in crate::ocp) fn simulate(
        &mut self,
        at: &mut Solution<T, D, M>,
        ends: &mut [T],
        units: &[T],
        far: f64,
    ) -> bool {
        self.has_algebraic = false;
        let (mut farthest, mut gaps) = (0.0, 0.0);
        for pass in 0..=self.intervals() {
            if self.evaluate(at, ends).is_err() {
                return false;
            }
            let mut moved = 0.0;
            let v = at.view_mut().v;
            for (k, place) in Places::<T>::new(self.qp().dims).enumerate().skip(1) {
                let ends = part(ends, (k - 1) * place.nx, place.nx);
                for (i, (x, &end)) in part_mut(v, place.v, place.nx).iter_mut().zip(ends).enumerate() {
                    let unit = units.get(place.row + i).copied().unwrap_or(T::ONE);
                    moved += ((end - *x) / unit).abs().to_f64();
                    *x = end;
                }
            }
            if pass == 0 {
                gaps = moved;
            }
            farthest += moved;
            if farthest > far * gaps || !farthest.is_finite() {
                return false;
            }
            if moved == 0.0 {
                break;
            }
        }
        true
    }
}
