//! One quantity over time.

use crate::scalar::Real;
use crate::structure::name_matches;
use alloc::string::String;
use alloc::vec::Vec;

/// The kind of a [`Series`].
///
/// ```
/// # use casados::ocp::{HeapSqp, Horizon, Kind, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// ocp.bound("u", .., -0.5, 0.5)?;
/// HeapSqp::new(&ocp)?.solve(&mut ocp)?;
/// let solution = ocp.solution()?;
/// let controls = solution.series().iter().filter(|series| series.kind == Kind::Control);
/// assert_eq!(controls.map(|series| series.name.as_str()).collect::<Vec<_>>(), ["u"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Kind {
    /// A state, at every node.
    State,
    /// An algebraic state, at the start of every interval.
    Algebraic,
    /// A control, constant in every interval; a linear control, at every node; a polynomial
    /// control, at the start of every interval.
    Control,
    /// A parameter, at every node.
    Parameter,
    /// An output of a path constraint, at the start of every interval.
    Path,
    /// An output of a terminal constraint, at the last node.
    Terminal,
    /// A path constraint or a bounded variable at a point inside every interval
    /// ([`Ocp::inside`](crate::ocp::Ocp::inside)): `Speed@0.5`.
    Inside,
    /// The rate of a linear control.
    Rate,
    /// An integral from the start to every node.
    Integral,
    /// A Bernstein coefficient of a polynomial control, in every interval: `u[0]` is its value at
    /// the start, and the last coefficient its value at the end.
    Coefficient,
}

/// One quantity over time. Lists of missing data are empty.
///
/// ```
/// # use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// ocp.bound("u", .., -0.5, 0.5)?;
/// HeapSqp::new(&ocp)?.solve(&mut ocp)?;
/// let solution = ocp.solution()?;
/// let push = solution.get("u")?;
/// assert_eq!((push.values.len(), push.lower[0], push.upper[9]), (10, Some(-0.5), Some(0.5)));
/// // From one it is pushed as hard as the bound allows; later the bound has no force.
/// assert!(push.is_active(0, 1e-6) && !push.is_active(5, 1e-6));
/// assert!(push.lower_multipliers[0] > 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Series<T = f64> {
    /// The kind of the quantity.
    pub kind: Kind,
    /// The name: `x[1]`, `cart.position`; the function of a constraint, with the output if it has
    /// several: `Distance`, `Corner[2]`; the fraction of the interval for points inside intervals:
    /// `Distance@0.5`.
    pub name: String,
    /// The unit, from the doc comments of the model ([`Units`](crate::structure::Units)) or from
    /// [`set_unit`](super::Trajectory::set_unit); empty if unknown.
    #[cfg_attr(feature = "serde", serde(default))]
    pub unit: String,
    /// The index of the time of the first value.
    pub first: usize,
    /// The values.
    pub values: Vec<T>,
    /// Lower bounds of the values, if any.
    pub lower: Vec<Option<T>>,
    /// Upper bounds of the values, if any.
    pub upper: Vec<Option<T>>,
    /// Multipliers of the lower bounds, at least zero.
    pub lower_multipliers: Vec<T>,
    /// Multipliers of the upper bounds, at least zero.
    pub upper_multipliers: Vec<T>,
    /// The multipliers `π_{k+1}` of the dynamics of a state, one for each interval.
    pub costates: Vec<T>,
}

impl<T: Real> Series<T> {
    pub(in crate::ocp) fn new(kind: Kind, name: impl Into<String>, first: usize, values: Vec<T>) -> Self {
        Self {
            kind,
            name: name.into(),
            unit: String::new(),
            first,
            values,
            lower: Vec::new(),
            upper: Vec::new(),
            lower_multipliers: Vec::new(),
            upper_multipliers: Vec::new(),
            costates: Vec::new(),
        }
    }

    /// Sets the unit.
    pub(in crate::ocp) fn with_unit(self, unit: impl Into<String>) -> Self {
        Self { unit: unit.into(), ..self }
    }

    /// Whether a name matches; `cart.position` matches `x.cart.position`.
    pub(super) fn matches(&self, name: &str) -> bool {
        let field = ["x.", "z.", "u.", "p."].iter().find_map(|argument| self.name.strip_prefix(argument));
        name_matches(name, &self.name) || field.is_some_and(|field| name_matches(name, field))
    }

    /// `λ_upper − λ_lower` of every value: positive if the upper bound is active.
    #[must_use]
    pub fn multipliers(&self) -> Vec<T> {
        self.upper_multipliers.iter().zip(&self.lower_multipliers).map(|(&u, &l)| u - l).collect()
    }

    /// The violation of every value, zero inside the bounds; for soft bounds this is the slack with
    /// a penalty.
    #[must_use]
    pub fn violations(&self) -> Vec<T> {
        let violation = |k: usize, value: T| {
            let below = bound_at(&self.lower, k).map_or(T::ZERO, |bound| bound - value);
            let above = bound_at(&self.upper, k).map_or(T::ZERO, |bound| value - bound);
            let larger = if below < above { above } else { below };
            if T::ZERO < larger { larger } else { T::ZERO }
        };
        self.values.iter().enumerate().map(|(k, &value)| violation(k, value)).collect()
    }

    /// Whether a value is within a distance of one of its bounds, or violates it.
    #[must_use]
    pub fn is_active(&self, index: usize, distance: T) -> bool {
        let Some(&value) = self.values.get(index) else { return false };
        bound_at(&self.lower, index).is_some_and(|bound| value - bound <= distance)
            || bound_at(&self.upper, index).is_some_and(|bound| bound - value <= distance)
    }
}

pub(super) fn bound_at<T: Real>(bounds: &[Option<T>], index: usize) -> Option<T> {
    bounds.get(index).copied().flatten()
}
