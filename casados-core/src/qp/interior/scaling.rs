//! Units of a QP: typical sizes of variables, general constraints and the objective.
//!
//! ```text
//! f     objective      mean of √gain, squared: h² / m of what a variable gains, m d² of what it costs
//! u     variable       √(f / m), with the curvature m
//! r     constraint     |c| u
//! ```
//!
//! `m` is the diagonal of the Hessian, or of `[A B]ᵀ M₊ [A B]` where the diagonal is zero, and `d`
//! the distance of the bounds from zero. A state without curvature has the size of its dynamics. If
//! all sizes are near one all units are one.
//!
//! The data of the QP is not scaled: units are the reference of comparisons. Initial slacks are `u`
//! and multipliers `f / u`, the dual regularisation of a row is `√ε u² / f`, and residuals are
//! measured in units. A QP in other units therefore has the same iterates in other units: the
//! Riccati recursion is invariant, as the Cholesky factor is (N. J. Higham, "Accuracy and Stability
//! of Numerical Algorithms", SIAM 2002, section 10.1).

use super::sides::ConstraintInterpretation;
use crate::qp::element::set;
use crate::qp::layout::{StageOffsets, StageOffsetsIter, part, part_mut};
use crate::qp::problem::QpView;
use crate::qp::stage::ConstraintVector;
use crate::scalar::Real;

/// The units are one if each item has a size between the inverse of this and this, or sizes on both
/// sides of this range.
const WELL_SCALED_RANGE: f64 = 32.0;
/// The largest unit, and the inverse of the smallest.
const MAX_UNIT: f64 = 1e12;
/// The largest ratio of a unit to the range between bounds.
const MAX_UNIT_PER_RANGE: f64 = 4.0;

/// The smallest and the largest size of an item.
struct SizeRange<T> {
    least: T,
    most: T,
}

impl<T: Real> SizeRange<T> {
    fn new() -> Self {
        Self { least: T::from_f64(f64::INFINITY), most: T::ZERO }
    }

    /// Adds a size; zero and non-finite sizes are ignored.
    fn add(&mut self, size: T) {
        if size > T::ZERO && size.is_finite() {
            self.least = size.min(self.least);
            self.most = size.max(self.most);
        }
    }

    /// Returns whether all sizes are far from one, on the same side.
    fn needs_scaling(&self) -> bool {
        let near = T::from_f64(WELL_SCALED_RANGE);
        self.most > T::ZERO && (self.least > near || self.most * near < T::ONE)
    }
}

/// Returns a size as a unit, limited to a range around one; one for an unknown size.
fn unit<T: Real>(size: T) -> T {
    let farthest = T::from_f64(MAX_UNIT);
    if size > T::ZERO && size.is_finite() { size.min(farthest).max(T::ONE / farthest) } else { T::ONE }
}

/// A mean of sizes.
struct MeanSize<T> {
    sum: T,
    count: usize,
}

impl<T: Real> MeanSize<T> {
    const NO_SIZES: Self = Self { sum: T::ZERO, count: 0 };

    fn add(&mut self, size: T) {
        if size > T::ZERO && size.is_finite() {
            self.sum = self.sum + size;
            self.count += 1;
        }
    }

    fn squared_mean(&self) -> T {
        let mean = self.sum / T::from_whole(self.count.max(1));
        mean * mean
    }
}

/// The bounds of a row.
struct ScalingBounds<T> {
    lower: T,
    upper: T,
    /// Whether both bounds are hard; soft bounds may be far away.
    hard: bool,
    no_bound: T,
}

impl<T: Real> ScalingBounds<T> {
    fn bound_range(&self) -> T {
        if self.hard && self.lower > -self.no_bound && self.upper < self.no_bound {
            self.upper - self.lower
        } else {
            T::from_f64(f64::INFINITY)
        }
    }
    /// Returns the distance of the bounds from zero.
    fn distance(&self) -> T {
        self.lower.max(-self.upper).max(T::ZERO)
    }
    fn sizes(&self) -> [T; 3] {
        let size = |bound: T| if self.hard && bound.abs() < self.no_bound { bound.abs() } else { T::ZERO };
        [self.bound_range(), size(self.lower), size(self.upper)]
    }
}

/// Computes the units of all rows and returns that of the objective; none if all sizes are near
/// one.
#[inline(never)]
pub fn find<T: Real>(qp: QpView<'_, T>, reading: &ConstraintInterpretation<T>, rows: &mut [T]) -> Option<T> {
    let objective = objective_unit(qp, reading, rows)?;
    let mut far = SizeRange { least: objective, most: objective }.needs_scaling();
    let root = objective.sqrt();
    for place in StageOffsetsIter::<T>::new(qp.dims) {
        let (here, next) = rows.split_at_mut_checked(place.row + place.rows).unwrap_or_default();
        let (variables, general) =
            part_mut(here, place.row, place.rows).split_at_mut_checked(place.ld).unwrap_or_default();
        for (row, limits) in variables.iter_mut().zip(stage_bounds(qp, &place, reading)) {
            let size = root / *row;
            let mut sizes = SizeRange::new();
            sizes.add(size);
            limits.sizes().into_iter().for_each(|size| sizes.add(size));
            far |= sizes.needs_scaling();
            // A variable without curvature has the size of a narrow range between its bounds.
            let (size, room) = (if size.is_finite() { size } else { T::ONE }, limits.bound_range());
            let room = T::from_f64(MAX_UNIT_PER_RANGE) * room;
            *row = unit(if T::ZERO < room && room < size { room } else { size });
        }
        part_mut(variables, place.n, place.ld - place.n).fill(T::ONE);
        general.fill(T::ONE);
        let matrix = part(qp.data, place.data + place.next * place.ld, place.ng * place.ld);
        for (row, column) in general.iter_mut().zip(matrix.chunks_exact(place.ld.max(1))) {
            let terms = column.iter().zip(&*variables);
            let size = terms.fold(T::ZERO, |most, (c, &unit)| (c.abs() * unit).max(most));
            far |= SizeRange { least: size, most: size }.needs_scaling();
            *row = unit(size);
        }
        // A state without any cost has the size of its dynamics.
        let dynamics = part(qp.data, place.data, place.next * place.ld);
        let states = next.iter_mut().zip(dynamics.chunks_exact(place.ld.max(1)));
        for (root_of_state, column) in states.filter(|(root, _)| **root == T::ZERO) {
            let terms = column.iter().zip(&*variables);
            let reach = terms.fold(T::ZERO, |most, (a, &unit)| (a.abs() * unit).max(most));
            if reach > T::ZERO {
                *root_of_state = root / reach;
            }
        }
    }
    far.then_some(objective)
}

/// Returns the unit of the objective, and writes the square roots of all curvatures; none for a
/// linear program.
fn objective_unit<T: Real>(
    qp: QpView<'_, T>,
    reading: &ConstraintInterpretation<T>,
    rows: &mut [T],
) -> Option<T> {
    let (mut gains, mut rooms) = (MeanSize::NO_SIZES, SizeRange::new());
    let mut any = false;
    for place in StageOffsetsIter::<T>::new(qp.dims).rev() {
        any |= curvatures(qp, &place, rows, &mut gains);
        let sqrt_curvatures = part(rows, place.row, place.n);
        for ((limits, &root), slope) in
            stage_bounds(qp, &place, reading).zip(sqrt_curvatures).zip(slopes(qp, &place))
        {
            let room = limits.bound_range();
            rooms.add(root * room);
            gains.add(root * limits.distance());
            if slope != T::ZERO {
                let is_bounded = slope > root * root * room;
                gains.add(if is_bounded { (slope * room).sqrt() } else { slope / root });
            }
        }
    }
    // At a stationary point the gain is small: then the unit is the cost of the narrowest range, at
    // most one.
    let gain = gains.squared_mean();
    let most = gain.max(if rooms.most > T::ZERO { rooms.least * rooms.least } else { T::ZERO });
    any.then(|| unit(gain.max(most.min(T::ONE))))
}

/// Writes the square roots of the curvatures of a stage, and returns whether there is one; offsets
/// of the dynamics have a cost at the next stage.
fn curvatures<T: Real>(
    qp: QpView<'_, T>,
    place: &StageOffsets,
    rows: &mut [T],
    objective_gains: &mut MeanSize<T>,
) -> bool {
    let StageOffsets { n, ld, row, .. } = *place;
    let data = part(qp.data, place.data, place.data_len());
    let (here, behind) = rows.split_at_mut_checked(row + place.rows).unwrap_or_default();
    let (roots, mut any) = (part(behind, 0, place.next), false);
    for j in 0..n {
        let mut curvature = data.get(place.matrix() + j * (ld + 1)).copied().unwrap_or(T::ZERO);
        if curvature <= T::ZERO {
            let slopes = data.get(j..).unwrap_or_default().iter().step_by(ld.max(1));
            curvature =
                slopes.zip(roots).fold(T::ZERO, |sum, (&slope, &root)| sum + (slope * root) * (slope * root));
        }
        any |= curvature > T::ZERO;
        set(here, row + j, curvature.sqrt());
    }
    for (&offset, &root) in part(data, place.offset(), place.next).iter().zip(roots) {
        objective_gains.add(offset.abs() * root);
    }
    any
}

/// Returns the bounds of the variables of a stage.
fn stage_bounds<T: Real>(
    qp: QpView<'_, T>,
    place: &StageOffsets,
    reading: &ConstraintInterpretation<T>,
) -> impl Iterator<Item = ScalingBounds<T>> {
    let no_bound = reading.no_bound;
    let bound = |row| part(qp.data, place.data + place.constraint_vector_begin(row), place.n).iter();
    let bounds = bound(ConstraintVector::Lower).zip(bound(ConstraintVector::Upper));
    let penalties = bound(ConstraintVector::LowerLinear).zip(bound(ConstraintVector::UpperLinear));
    bounds.zip(penalties).map(move |((&lower, &upper), (of_lower, of_upper))| {
        let hard = !of_lower.is_finite() && !of_upper.is_finite();
        ScalingBounds { lower, upper, hard, no_bound }
    })
}

/// Returns the magnitudes of the gradient of a stage.
fn slopes<'a, T: Real>(qp: QpView<'a, T>, place: &StageOffsets) -> impl Iterator<Item = T> + use<'a, T> {
    part(qp.data, place.data + place.gradient(), place.n).iter().map(|slope| slope.abs())
}
