//! Elastic mode: bounds of states and constraints get linear penalties, so that a QP has a
//! solution.

use crate::ocp::instance::{Initial, Ocp};
use crate::ocp::problem::Formulation;
use crate::qp::{Bounds, Field, Side, StageDims, part, part_mut};
use crate::scalar::Real;

/// The bound that is violated most, and by how much.
#[derive(Clone, Copy, Debug)]
pub(super) struct Worst {
    pub field: Field,
    pub stage: usize,
    pub index: usize,
    pub side: Side,
    pub violation: f64,
}

/// How many numbers remember the linear penalties.
pub(super) const fn memory(dims: &[StageDims]) -> usize {
    let (mut length, mut rest) = (0_usize, dims);
    while let Some((first, others)) = rest.split_first() {
        length = length.saturating_add(rows(*first).saturating_mul(2));
        rest = others;
    }
    length
}

const fn rows(dims: StageDims) -> usize {
    dims.nx.saturating_add(dims.nu).saturating_add(dims.ng)
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Remembers all linear penalties.
    pub(super) fn remember_penalties(&self, memory: &mut [T]) {
        let mut begin = 0;
        for stage in self.qp().stages() {
            for bounds in [stage.x_bounds(), stage.u_bounds(), stage.g_bounds()] {
                for penalties in [bounds.lower_linear, bounds.upper_linear] {
                    part_mut(memory, begin, penalties.len()).copy_from_slice(penalties);
                    begin += penalties.len();
                }
            }
        }
    }

    /// Writes them as they were, or with a number in place of infinite ones: of states but those at
    /// the start, and of constraints.
    pub(super) fn set_penalties(&mut self, memory: &[T], elastic: Option<T>) {
        let mut begin = 0;
        for (k, mut stage) in self.qp.stages_mut().enumerate() {
            for kind in 0..3 {
                let bounds = match kind {
                    0 => stage.x_bounds_mut(),
                    1 => stage.u_bounds_mut(),
                    _ => stage.g_bounds_mut(),
                };
                let elastic = elastic.filter(|_| kind == 2 || (kind == 0 && k > 0));
                for penalties in [bounds.lower_linear, bounds.upper_linear] {
                    let given = part(memory, begin, penalties.len());
                    begin += penalties.len();
                    for (penalty, &given) in penalties.iter_mut().zip(given) {
                        *penalty = match elastic {
                            Some(weight) if !given.is_finite() => weight,
                            _ => given,
                        };
                    }
                }
            }
        }
    }

    /// Zero as the linear penalty of all bounds but equations.
    pub(super) fn ignore_inequalities(&mut self) {
        for mut stage in self.qp.stages_mut() {
            for kind in 0..3 {
                let bounds = match kind {
                    0 => stage.x_bounds_mut(),
                    1 => stage.u_bounds_mut(),
                    _ => stage.g_bounds_mut(),
                };
                let penalties = bounds.lower_linear.iter_mut().zip(bounds.upper_linear);
                let limits = bounds.lower.iter().zip(&*bounds.upper);
                for ((below, above), _) in penalties.zip(limits).filter(|(_, (lower, upper))| lower < upper) {
                    (*below, *above) = (T::ZERO, T::ZERO);
                }
            }
        }
    }

    /// The largest violation of a bound that is hard, by the penalties that are remembered, and the
    /// sum of all of them.
    pub(super) fn worst(&self, memory: &[T]) -> (Option<Worst>, f64) {
        let (mut worst, mut sum): (Option<Worst>, f64) = (None, 0.0);
        let mut begin = 0;
        let fixed = self.initial == Initial::Fixed;
        for (k, (stage, point)) in self.qp().stages().zip(self.iterate().stages()).enumerate() {
            let kinds = [
                (Field::StateBounds, stage.x_bounds()),
                (Field::ControlBounds, stage.u_bounds()),
                (Field::GeneralBounds, stage.g_bounds()),
            ];
            for (field, bounds) in kinds {
                let length = bounds.lower.len();
                let lower_penalties = part(memory, begin, length);
                let upper_penalties = part(memory, begin + length, length);
                begin += 2 * length;
                if fixed && k == 0 && field == Field::StateBounds {
                    continue;
                }
                for index in 0..length {
                    let value = match field {
                        Field::StateBounds => point.x.get(index).copied().unwrap_or(T::ZERO),
                        Field::ControlBounds => point.u.get(index).copied().unwrap_or(T::ZERO),
                        _ => general(&stage, &point, index),
                    };
                    let Bounds { lower, upper, .. } = bounds;
                    let is_hard = |penalties: &[T]| penalties.get(index).is_some_and(|p| !p.is_finite());
                    let at = |bounds: &[T]| bounds.get(index).copied().unwrap_or(T::ZERO);
                    for (side, violation, hard) in [
                        (Side::Lower, at(lower) - value, is_hard(lower_penalties)),
                        (Side::Upper, value - at(upper), is_hard(upper_penalties)),
                    ] {
                        let violation = violation.to_f64();
                        if hard && violation > 0.0 {
                            sum += violation;
                        }
                        if hard && violation > worst.map_or(0.0, |w| w.violation) {
                            worst = Some(Worst { field, stage: k, index, side, violation });
                        }
                    }
                }
            }
        }
        (worst, sum)
    }
}

/// A row of `C x + D u`.
fn general<T: Real>(
    stage: &crate::qp::Stage<'_, T>,
    point: &crate::qp::SolutionStage<'_, T>,
    row: usize,
) -> T {
    let (c, d) = (stage.c(), stage.d());
    let x = point.x.iter().enumerate().map(|(j, &x)| c.get(row, j).unwrap_or(T::ZERO) * x);
    let u = point.u.iter().enumerate().map(|(j, &u)| d.get(row, j).unwrap_or(T::ZERO) * u);
    x.chain(u).fold(T::ZERO, |sum, term| sum + term)
}
