//! Warnings about likely mistakes in a problem, before it is solved.

use crate::linalg::dot;
use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::instance::{HeapOcp, InitialState};
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::FirstOrder;
use crate::qp::element::get;
use crate::qp::{Bounds, QpField, Side, StageOffsetsIter, part};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;
use core::fmt;

/// The ratio of magnitudes of two variables above which there is a warning: double precision and
/// one tolerance do not suit both.
const MAX_SIZE_RATIO: f64 = 1e8;
/// A gradient counts as vanishing if the change of each variable by its size, or by one, changes
/// the constraint by at most this fraction of its violation.
const VANISHING_GRADIENT_RATIO: f64 = 1e-8;

/// A likely mistake in a problem: [`Ocp::warnings`].
///
/// [`Ocp::warnings`]: crate::ocp::Ocp::warnings
///
/// ```
/// use casados::ocp::{Constraint, Horizon, Map, Problem, Warning};
/// use casados::prelude::*;
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn square(x: f64, _u: f64) -> f64 { x * x }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .path_constraints(Constraint::<Square>::new([1.0], [1.0]))
///     .on(Horizon::uniform(3, 1.0))?;
/// ocp.free_initial_state().guess(&[0.0], &[2.0])?.bound("u", .., -1.0, 1.0)?;
/// let warnings = ocp.warnings()?;
/// for warning in &warnings {
///     println!("{warning}");
/// }
/// assert!(matches!(warnings[0], Warning::GuessOutsideBounds { .. }));
/// assert!(matches!(warnings[1], Warning::VanishingGradient { .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The guess of a variable violates its bounds; the stage is that of the largest violation.
    /// Solvers move the guess inside.
    GuessOutsideBounds {
        /// The bound.
        bound: ConstraintName,
        /// The guess.
        value: f64,
        /// The value of the bound.
        limit: f64,
    },
    /// A constraint is violated at the guess, and its gradient vanishes there, so that its
    /// linearisation has no solution. The stage is the first one. Solvers perturb such a guess.
    VanishingGradient {
        /// The constraint, with the violated side.
        constraint: ConstraintName,
        /// The violation.
        violation: f64,
    },
    /// A bound at the end of the horizon is unreachable: the end of the linearisation at the guess
    /// violates it, whatever the controls, the free initial state and the free parameters.
    UnreachableEnd {
        /// The bound.
        bound: ConstraintName,
        /// The value at the end of the linearisation.
        value: f64,
        /// The value of the bound.
        limit: f64,
    },
    /// The magnitudes of two variables, from guesses and bounds, differ by a factor above 1e8;
    /// rescale them.
    FarUnits {
        /// The name and the magnitude of the smallest variable.
        small: (&'static str, f64),
        /// The name and the magnitude of the largest variable.
        large: (&'static str, f64),
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::GuessOutsideBounds { bound, value, limit } => {
                write!(f, "the guess {value:e} violates {bound}, {limit:e}; solvers move it inside")
            }
            Self::VanishingGradient { constraint, violation } => write!(
                f,
                "{constraint} is violated by {violation:.1e} at the guess, where its gradient is zero: perturb the guess"
            ),
            Self::UnreachableEnd { bound, value, limit } => write!(
                f,
                "{bound}, {limit:e}, is unreachable in the linearisation at the guess, which ends at {value:e} whatever \
                 the controls, initial state and parameters: take another guess, or check that a control acts on it"
            ),
            Self::FarUnits { small: (small, size), large: (large, other) } => write!(
                f,
                "`{small}` is of size {size:.0e}, `{large}` of size {other:.0e} (by guesses and bounds): scale both to \
                 about one"
            ),
        }
    }
}

impl<P: Formulation<T>, T: Real> HeapOcp<P, T> {
    /// Returns warnings about likely mistakes: guesses outside their bounds; constraints that are
    /// violated at the guess and have a vanishing gradient there; unreachable ends; magnitudes of
    /// variables that differ by a factor above 1e8. Writes the QP at the iterate.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`](crate::ocp::Ocp::linearise)
    pub fn warnings(&mut self) -> Result<Vec<Warning>, OcpError> {
        self.linearise(FirstOrder)?;
        let mut found = Vec::new();
        self.warn_guesses_outside_bounds(&mut found);
        self.warn_vanishing_gradients(&mut found);
        self.warn_unreachable_ends(&mut found);
        self.warn_different_magnitudes(&mut found);
        Ok(found)
    }

    /// Warns about each variable, at the stage of its largest violation.
    fn warn_guesses_outside_bounds(&self, found: &mut Vec<Warning>) {
        // The largest violation of every variable so far.
        let mut worst: Vec<(QpField, usize, f64, Warning)> = Vec::new();
        let fixed_stages =
            usize::from(matches!(self.initial_state, InitialState::Fixed | InitialState::PartlyFixed));
        for (stage, (view, point)) in self.qp().stages().zip(self.iterate().stages()).enumerate() {
            let states = (QpField::StateBounds, point.x, view.x_bounds());
            let controls = (QpField::ControlBounds, point.u, view.u_bounds());
            for (field, values, bounds) in [states, controls] {
                if field == QpField::StateBounds && stage < fixed_stages {
                    continue;
                }
                for (index, &value) in values.iter().enumerate() {
                    let [lower, upper] = [bounds.lower, bounds.upper].map(|list| get(list, index));
                    let (side, limit, excess) = if value < lower {
                        (Side::Lower, lower, lower - value)
                    } else if value > upper {
                        (Side::Upper, upper, value - upper)
                    } else {
                        continue;
                    };
                    let bound = self.name(field, stage, index, side);
                    let (excess, value, limit) = (excess.to_f64(), value.to_f64(), limit.to_f64());
                    let warning = Warning::GuessOutsideBounds { bound, value, limit };
                    match worst.iter_mut().find(|(other, i, ..)| *other == field && *i == index) {
                        Some(known) if known.2 >= excess => {}
                        Some(known) => *known = (field, index, excess, warning),
                        None => worst.push((field, index, excess, warning)),
                    }
                }
            }
        }
        found.extend(worst.into_iter().map(|(.., warning)| warning));
    }

    /// Warns about each constraint, at its first stage.
    fn warn_vanishing_gradients(&self, found: &mut Vec<Warning>) {
        let (qp, (v, _)) = (self.qp(), self.iterate().variables_and_costates());
        for (place, stage) in StageOffsetsIter::<T>::new(qp.dims()).zip(qp.stages()) {
            let (view, here) = (stage.arrays(), part(v, place.v, place.ld));
            let Bounds { lower, upper, .. } = stage.g_bounds();
            for (i, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
                let row = part(view.matrix, (place.next + i) * place.ld, place.ld);
                let value = dot(row, here);
                let (side, violation) =
                    if value < lower { (Side::Lower, lower - value) } else { (Side::Upper, value - upper) };
                let changes = row.iter().zip(here).map(|(&g, &v)| g.abs() * v.abs().max(T::ONE));
                let largest = changes.fold(T::ZERO, |largest, change| largest.max(change));
                if violation > T::ZERO && largest <= T::from_f64(VANISHING_GRADIENT_RATIO) * violation {
                    let constraint = self.name(QpField::GeneralBounds, place.stage, i, side);
                    let is_known = found.iter().any(|warning| {
                        matches!(warning, Warning::VanishingGradient { constraint: known, .. }
                            if known.name == constraint.name && known.output == constraint.output)
                    });
                    if !is_known {
                        found.push(Warning::VanishingGradient { constraint, violation: violation.to_f64() });
                    }
                }
            }
        }
    }

    /// Warns about each bound of states and terminal constraints at the last stage.
    fn warn_unreachable_ends(&self, found: &mut Vec<Warning>) {
        let (qp, last, nx) = (self.qp(), self.intervals(), P::Shape::NX);
        let Some(stage) = qp.stage(last) else { return };
        let view = stage.arrays();
        let (states, rows) = (stage.x_bounds(), stage.g_bounds());
        let mut coefficients: Vec<T> = Vec::new();
        let of_states = (0..nx).map(|i| (QpField::StateBounds, i, &states));
        let of_rows = (0..rows.lower.len()).map(|i| (QpField::GeneralBounds, i, &rows));
        for (field, index, bounds) in of_states.chain(of_rows) {
            let [lower, upper] = [bounds.lower, bounds.upper].map(|list| get(list, index));
            let [soft_below, soft_above] =
                [bounds.lower_linear, bounds.upper_linear].map(|list| get(list, index).is_finite());
            coefficients.clear();
            if field == QpField::StateBounds {
                coefficients.extend((0..view.n).map(|i| if i == index { T::ONE } else { T::ZERO }));
            } else {
                coefficients.extend(part(view.matrix, (view.next + index) * view.ld, view.n));
            }
            if !(lower.is_finite() || upper.is_finite()) {
                continue;
            }
            let Some(value) = self.unique_end_value(&coefficients) else { continue };
            let (side, limit, soft) = if value < lower {
                (Side::Lower, lower, soft_below)
            } else {
                (Side::Upper, upper, soft_above)
            };
            let violation = if side == Side::Lower { lower - value } else { value - upper };
            let size = limit.abs().max(T::ONE);
            if !soft && violation > T::from_f64(VANISHING_GRADIENT_RATIO) * size {
                let bound = self.name(field, last, index, side);
                let (value, limit) = (value.to_f64(), limit.to_f64());
                found.push(Warning::UnreachableEnd { bound, value, limit });
            }
        }
    }

    /// Returns the value of a linear function of the last stage, if it is the same for all
    /// solutions of the linearisation.
    fn unique_end_value(&self, coefficients: &[T]) -> Option<T> {
        let (qp, nx) = (self.qp(), P::Shape::NX);
        let (of_states, of_others) = coefficients.split_at_checked(nx)?;
        let tolerance = T::from_f64(VANISHING_GRADIENT_RATIO);
        let is_zero = |slopes: &[T], size: T| slopes.iter().all(|slope| slope.abs() <= tolerance * size);
        let largest = |list: &[T]| list.iter().fold(T::ZERO, |largest, value| largest.max(value.abs()));
        let mut slopes = of_states.to_vec();
        let mut value = T::ZERO;
        if !is_zero(of_others, largest(&slopes)) {
            return None;
        }
        let stages: Vec<_> = qp.stages().take(self.intervals()).collect();
        for (k, stage) in stages.iter().enumerate().rev() {
            let (view, bounds) = (stage.arrays(), stage.u_bounds());
            let size = largest(&slopes);
            value = value + dot(&slopes, part(view.offset, 0, nx));
            let mut previous_slopes: Vec<T> = (0..view.n).map(|_| T::ZERO).collect();
            for (row, &slope) in view.matrix.chunks_exact(view.ld.max(1)).zip(&slopes) {
                previous_slopes.iter_mut().zip(row).for_each(|(to, &by)| *to = *to + slope * by);
            }
            for (j, &slope) in previous_slopes.iter().skip(nx).enumerate() {
                // A fixed control cannot change the end.
                let [lower, upper] = [bounds.lower, bounds.upper].map(|list| get(list, j));
                if slope.abs() > tolerance * size && lower < upper {
                    return None;
                }
                value = value + if lower < upper { T::ZERO } else { slope * lower };
            }
            previous_slopes.truncate(nx);
            slopes = previous_slopes;
            if k == 0 {
                let bounds = stage.x_bounds();
                for (i, &slope) in slopes.iter().enumerate() {
                    let [lower, upper] = [bounds.lower, bounds.upper].map(|list| get(list, i));
                    if slope.abs() > tolerance * size && lower < upper {
                        return None;
                    }
                    value = value + if lower < upper { T::ZERO } else { slope * lower };
                }
            }
        }
        Some(value)
    }

    /// Warns about the smallest and the largest variable.
    fn warn_different_magnitudes(&self, found: &mut Vec<Warning>) {
        let mut sizes: Vec<(&'static str, f64)> = Vec::new();
        let mut add = |name: &'static str, values: &[T]| {
            let sizes_of = values.iter().map(|value| value.abs().to_f64()).filter(|size| size.is_finite());
            let size = sizes_of.fold(0.0, f64::max);
            match sizes.iter_mut().find(|(known, _)| *known == name) {
                Some((_, known)) => *known = known.max(size),
                None => sizes.push((name, size)),
            }
        };
        for (stage, (view, point)) in self.qp().stages().zip(self.iterate().stages()).enumerate() {
            let states = (QpField::StateBounds, point.x, view.x_bounds());
            let controls = (QpField::ControlBounds, point.u, view.u_bounds());
            for (field, values, bounds) in [states, controls] {
                for (index, &value) in values.iter().enumerate() {
                    let name = self.name(field, stage, index, Side::Lower).name;
                    add(name, &[value, get(bounds.lower, index), get(bounds.upper, index)]);
                }
            }
        }
        // Variables that are zero everywhere are ignored.
        let known = || sizes.iter().copied().filter(|(_, size)| *size > 0.0);
        let small = known().reduce(|a, b| if b.1 < a.1 { b } else { a });
        let large = known().reduce(|a, b| if b.1 > a.1 { b } else { a });
        if let (Some(small), Some(large)) = (small, large)
            && large.1 > MAX_SIZE_RATIO * small.1
        {
            found.push(Warning::FarUnits { small, large });
        }
    }
}
