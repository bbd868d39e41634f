//! The inequalities (sides) of all constraints, in one list over the whole horizon.
//!
//! A side is a row (a variable, or a general constraint) and a sign: `σ (c v − bound) + e = s ≥ 0`
//! with a multiplier `λ ≥ 0`. Lower sides precede upper ones. A soft side has a violation `e ≥ 0`
//! with its own multiplier `ν ≥ 0`; the pairs `(e, ν)` follow the pairs `(s, λ)`, so that
//! operations on all pairs need no distinction. Two equal hard bounds are an equation, with a
//! multiplier of either sign.

use super::units::Units;
use crate::qp::element::set;
use crate::qp::layout::{StageOffsetsIter, part, take_mut};
use crate::qp::problem::QpView;
use crate::qp::stage::ConstraintVector;
use crate::scalar::Real;

/// The penalties of violations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PenaltyMode {
    /// Those of the problem.
    Given,
    /// Hard bounds get a linear penalty of one per unit, bounds of controls, which are more often
    /// physical limits, ten; soft bounds are ignored.
    Hard,
}

/// The interpretation of constraints.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintInterpretation<T> {
    /// Whether the initial state is fixed, and no constraint.
    pub fixed: bool,
    pub penalties: PenaltyMode,
    /// Bounds of at least this magnitude are no bounds.
    pub no_bound: T,
}

/// Numbers of sides and equations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Lower sides.
    pub lower: usize,
    /// Upper sides.
    pub upper: usize,
    /// Soft sides.
    pub soft: usize,
    /// Equations.
    pub equations: usize,
}

impl Counts {
    /// Returns the number of all sides.
    pub const fn sides(&self) -> usize {
        self.lower + self.upper
    }
    /// Returns the number of all pairs of complementary variables.
    pub const fn pair_count(&self) -> usize {
        self.sides() + self.soft
    }
    /// Returns the length of the arrays.
    pub const fn memory_len(&self) -> usize {
        8 * self.pair_count() + 3 * self.sides() + 4 * self.equations + 2 * self.soft
    }
    /// Returns the length of the lists of indices.
    pub const fn indices(&self) -> usize {
        2 * self.sides() + self.equations + self.soft
    }
}

/// A row with its bounds and penalties.
struct Constraint<T> {
    row: usize,
    control: bool,
    lower: T,
    upper: T,
    /// Linear and quadratic penalty.
    lower_penalty: (T, T),
    upper_penalty: (T, T),
}

/// The kind of a side.
enum Kind<T> {
    Absent,
    Hard,
    Soft(T, T),
}

fn kind<T: Real>(penalty: Option<T>, (linear, quadratic): (T, T), absent: bool) -> Kind<T> {
    if absent {
        return Kind::Absent;
    }
    match penalty {
        // A violation without cost is allowed.
        None if linear.is_finite() && linear == T::ZERO && quadratic == T::ZERO => Kind::Absent,
        None if linear.is_finite() => Kind::Soft(linear, quadratic),
        None => Kind::Hard,
        Some(_) if linear.is_finite() => Kind::Absent,
        Some(weight) => Kind::Soft(weight, T::ZERO),
    }
}

/// Returns whether the initial state is fixed: hard and equal bounds of every component.
pub fn is_initial_state_fixed<T: Real>(qp: QpView<'_, T>) -> bool {
    let Some(stage) = qp.stage(0) else { return true };
    let b = stage.x_bounds();
    let equal = b.lower.iter().zip(b.upper).all(|(l, u)| l == u);
    equal && b.lower_linear.iter().chain(b.upper_linear).all(|p| !p.is_finite())
}

/// Calls `f` for every constraint of the horizon except a fixed initial state.
fn constraints<T: Real>(qp: QpView<'_, T>, fixed: bool, mut f: impl FnMut(Constraint<T>)) {
    for place in StageOffsetsIter::<T>::new(qp.dims) {
        let data = part(qp.data, place.data, place.data_len());
        let vector = |row| part(data, place.constraint_vector_begin(row), place.rows);
        let bounds = vector(ConstraintVector::Lower).iter().zip(vector(ConstraintVector::Upper));
        let lower =
            vector(ConstraintVector::LowerLinear).iter().zip(vector(ConstraintVector::LowerQuadratic));
        let upper =
            vector(ConstraintVector::UpperLinear).iter().zip(vector(ConstraintVector::UpperQuadratic));
        let skipped = if place.stage == 0 && fixed { place.nx } else { 0 };
        for (i, ((bounds, lower), upper)) in bounds.zip(lower).zip(upper).enumerate().skip(skipped) {
            f(Constraint {
                row: place.row + i,
                control: (place.nx..place.n).contains(&i),
                lower: *bounds.0,
                upper: *bounds.1,
                lower_penalty: (*lower.0, *lower.1),
                upper_penalty: (*upper.0, *upper.1),
            });
        }
    }
}

impl<T: Real> Constraint<T> {
    /// Returns whether it is an equation, and otherwise the kinds of its sides.
    fn equation_or_sides(&self, reading: &ConstraintInterpretation<T>) -> (bool, Kind<T>, Kind<T>) {
        let ten = T::from_f64(10.0);
        let penalty = match reading.penalties {
            PenaltyMode::Given => None,
            PenaltyMode::Hard => Some(if self.control { ten } else { T::ONE }),
        };
        // NaN is no bound; the data is checked before.
        let (is_lower, is_upper) = (self.lower > -reading.no_bound, self.upper < reading.no_bound);
        let lower = kind(penalty, self.lower_penalty, !is_lower);
        let upper = kind(penalty, self.upper_penalty, !is_upper);
        let equation = matches!((&lower, &upper), (Kind::Hard, Kind::Hard)) && self.lower == self.upper;
        (equation, lower, upper)
    }
}

/// Returns the numbers of sides and equations.
pub fn count<T: Real>(qp: QpView<'_, T>, reading: &ConstraintInterpretation<T>) -> Counts {
    let mut counts = Counts::default();
    constraints(qp, reading.fixed, |constraint| {
        let (equation, lower, upper) = constraint.equation_or_sides(reading);
        if equation {
            counts.equations += 1;
            return;
        }
        counts.lower += usize::from(!matches!(lower, Kind::Absent));
        counts.upper += usize::from(!matches!(upper, Kind::Absent));
        counts.soft += usize::from(matches!(lower, Kind::Soft(..)));
        counts.soft += usize::from(matches!(upper, Kind::Soft(..)));
    });
    counts
}

/// All inequalities, and the data of the interior point for each.
pub struct Inequalities<'a, T> {
    pub counts: Counts,
    /// The dual regularisation `δ`, in units: the change of the distance of a side or equation per
    /// change of its multiplier.
    pub dual_regularisation: T,
    /// Rows of sides.
    pub rows: &'a mut [u32],
    /// Rows of equations.
    pub equations: &'a mut [u32],
    /// The soft sides.
    pub soft: &'a mut [u32],
    /// The activity of the sides, for active sets.
    pub activity: &'a mut [u32],
    /// Slacks `s` of sides, then violations `e`.
    pub slack: &'a mut [T],
    /// Multipliers `λ`, then `ν`.
    pub multiplier: &'a mut [T],
    /// `σ (c v − bound) + e − s`; zero for violations.
    pub residual: &'a mut [T],
    /// Changes of slacks.
    pub slack_step: &'a mut [T],
    /// Changes of multipliers.
    pub multiplier_step: &'a mut [T],
    /// `1 / (s + δ λ)`, with `δ = 0` for violations.
    pub inverse: &'a mut [T],
    /// The target of `s Δλ + λ Δs`, over `s + δ λ`.
    pub target: &'a mut [T],
    /// Workspace.
    pub scratch: &'a mut [T],
    /// The weights of the sides in the Hessian.
    pub weight: &'a mut [T],
    /// The factor of `δ` for each side: the square of its unit over that of the objective.
    pub regularisation_scale: &'a mut [T],
    /// Bounds.
    pub bound: &'a mut [T],
    /// Linear penalties of soft sides.
    pub linear: &'a mut [T],
    /// Quadratic penalties of soft sides.
    pub quadratic: &'a mut [T],
    /// Multipliers of equations, of either sign.
    pub equation_multipliers: &'a mut [T],
    /// `c v − bound` of equations.
    pub equation_residual: &'a mut [T],
    /// Right-hand sides of equations.
    pub equation_bound: &'a mut [T],
    /// The factor of `1 / δ` for each equation.
    pub stiffness_scale: &'a mut [T],
    /// Changes of multipliers of equations, for iterative refinement: Newton's equations with the
    /// dual regularisation are solved again from these.
    pub equation_multiplier_steps: &'a mut [T],
}

impl<'a, T: Real> Inequalities<'a, T> {
    /// The arrays in memory, whose contents are kept.
    pub fn new(counts: Counts, numbers: &mut &'a mut [T], indices: &mut &'a mut [u32]) -> Self {
        let (pairs, sides) = (counts.pair_count(), counts.sides());
        Self {
            counts,
            dual_regularisation: T::ZERO,
            rows: take_mut(indices, sides),
            equations: take_mut(indices, counts.equations),
            soft: take_mut(indices, counts.soft),
            activity: take_mut(indices, sides),
            slack: take_mut(numbers, pairs),
            multiplier: take_mut(numbers, pairs),
            residual: take_mut(numbers, pairs),
            slack_step: take_mut(numbers, pairs),
            multiplier_step: take_mut(numbers, pairs),
            inverse: take_mut(numbers, pairs),
            target: take_mut(numbers, pairs),
            scratch: take_mut(numbers, pairs),
            weight: take_mut(numbers, sides),
            regularisation_scale: take_mut(numbers, sides),
            bound: take_mut(numbers, sides),
            linear: take_mut(numbers, counts.soft),
            quadratic: take_mut(numbers, counts.soft),
            equation_multipliers: take_mut(numbers, counts.equations),
            equation_residual: take_mut(numbers, counts.equations),
            equation_bound: take_mut(numbers, counts.equations),
            stiffness_scale: take_mut(numbers, counts.equations),
            equation_multiplier_steps: &mut [],
        }
    }

    /// Lists the sides of a problem: rows, bounds and penalties.
    pub fn list(&mut self, qp: QpView<'_, T>, reading: &ConstraintInterpretation<T>) {
        let list = self;
        let (mut lower, mut upper, mut soft, mut equations) = (0, list.counts.lower, 0, 0);
        constraints(qp, reading.fixed, |constraint| {
            let row = constraint.row as u32;
            let (equation, lower_kind, upper_kind) = constraint.equation_or_sides(reading);
            if equation {
                set(list.equations, equations, row);
                set(list.equation_bound, equations, constraint.lower);
                set(list.stiffness_scale, equations, T::ONE);
                equations += 1;
                return;
            }
            for (kind, at, bound) in
                [(lower_kind, &mut lower, constraint.lower), (upper_kind, &mut upper, constraint.upper)]
            {
                if let Kind::Soft(linear, quadratic) = kind {
                    set(list.soft, soft, *at as u32);
                    set(list.quadratic, soft, quadratic);
                    set(list.linear, soft, linear);
                    soft += 1;
                }
                if !matches!(kind, Kind::Absent) {
                    set(list.rows, *at, row);
                    set(list.bound, *at, bound);
                    set(list.regularisation_scale, *at, T::ONE);
                    *at += 1;
                }
            }
        });
    }

    /// Scales the dual regularisation by the units, and with `own_penalties` also the penalties of
    /// [`PenaltyMode::Hard`].
    pub fn set_units(&mut self, units: Units<'_, T>, own_penalties: bool) {
        if units.rows.is_empty() {
            return;
        }
        for (softness, &row) in self.regularisation_scale.iter_mut().zip(&*self.rows) {
            let unit = units.of(row as usize);
            *softness = unit * unit / units.objective;
        }
        for (stiffness, &row) in self.stiffness_scale.iter_mut().zip(&*self.equations) {
            let unit = units.of(row as usize);
            *stiffness = units.objective / (unit * unit);
        }
        if own_penalties {
            for (linear, &side) in self.linear.iter_mut().zip(&*self.soft) {
                let row = self.rows.get(side as usize).map_or(usize::MAX, |&row| row as usize);
                *linear = *linear / units.of(row);
            }
        }
    }
}
