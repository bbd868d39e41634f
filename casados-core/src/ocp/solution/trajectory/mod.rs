//! A solution by the names of its variables, with nothing of the problem that it is of.
//!
//! | | |
//! | --- | --- |
//! | `collect` | the iterate of a problem as a trajectory |
//! | `between` | the same with points between the nodes |
//! | `read` | a trajectory from a file, checked |
//! | `restore` | a trajectory as the iterate of a problem, or as its guess |
//! | `csv` | a table for other programs |
//! | `violations` | which bounds a trajectory is beyond |

mod between;
mod collect;
mod csv;
mod error;
#[cfg(feature = "serde")]
mod read;
mod restore;
mod violations;

pub(in crate::ocp) use collect::names;
pub use csv::Csv;
pub use error::TrajectoryError;
pub use violations::Violation;

use crate::record::Record;
use crate::scalar::Real;
use crate::structure::means;
use alloc::string::String;
use alloc::vec::Vec;

/// A solution over time: states, algebraic states, controls, parameters and constraints, each by
/// its name, with bounds and multipliers. [`Ocp::solution`](crate::ocp::Ocp::solution) makes one.
///
/// It owns all that it has: it may outlive the problem, be compared, be written to a file (feature
/// `serde`, or [`Trajectory::csv`]), and become the iterate of a problem again by
/// [`Ocp::restore`](crate::ocp::Ocp::restore).
///
/// # Example
/// ```
/// use casados::ocp::{Constraint, HeapIpm, Horizon, LeastSquaresCost, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// #[function]
/// fn speed(x: [f64; 2], _u: f64) -> f64 { x[1] }
///
/// let erk = Erk::<Cart, Rk4>::new(Options::default())?;
/// let mut ocp = Problem::new(erk)
///     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
///     .path_constraints(Constraint::<Speed>::new([-1.2], [1.2]))
///     .on(Horizon::uniform(10, 0.1))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0; 2], &[0.0])?;
/// ocp.bound("x[0]", 10.., 1.0, 1.0)?.bound("x[1]", 10.., 0.0, 0.0)?;
/// assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
///
/// let solution = ocp.solution()?;
/// let (time, position) = (solution.times(), solution.state("x[0]")?);
/// assert!((position[10] - 1.0).abs() < 1e-6 && (time[10] - 1.0).abs() < 1e-12);
/// // The fastest stages are at the bound of the speed, which pushes there and nowhere else.
/// let (speed, push) = (solution.constraint("Speed")?, solution.multiplier("Speed")?);
/// assert!(speed[5] > 1.2 - 1e-4 && push[5] > 0.1 && push[0].abs() < 1e-6);
/// // `u` is the name of the only control.
/// println!("{:?}\n{}", solution.control("u")?, solution.csv());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "read::Unchecked<T>", bound(deserialize = "T: Real + serde::Deserialize<'de>"))
)]
pub struct Trajectory<T = f64> {
    model: String,
    times: Vec<T>,
    /// The unit of the times, or an empty text.
    time_unit: String,
    series: Vec<Series<T>>,
}

/// What a [`Series`] is of.
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
    /// A state: at every node.
    State,
    /// An algebraic state, at the start of every interval.
    Algebraic,
    /// A control, constant over every interval.
    Control,
    /// A parameter: at every node.
    Parameter,
    /// An output of a path constraint, at the start of every interval.
    Path,
    /// An output of a terminal constraint: at the last node.
    Terminal,
}

/// One quantity over time. Lists of what it has not are empty.
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
    /// What it is of.
    pub kind: Kind,
    /// Its name: `x[1]`, `cart.position`; the function of a constraint, with the output if it has
    /// several: `Distance`, `Corner[2]`.
    pub name: String,
    /// Its unit as the doc comments of the model say it
    /// ([`Units`](crate::structure::Units)), or [`Trajectory::set_unit`] did; empty if nobody did.
    #[cfg_attr(feature = "serde", serde(default))]
    pub unit: String,
    /// Which time is that of the first value.
    pub first: usize,
    /// The values.
    pub values: Vec<T>,
    /// Lower bounds of the values, where there are some.
    pub lower: Vec<Option<T>>,
    /// Upper bounds.
    pub upper: Vec<Option<T>>,
    /// Multipliers of the lower bounds, from zero on.
    pub lower_multipliers: Vec<T>,
    /// Multipliers of the upper bounds, from zero on.
    pub upper_multipliers: Vec<T>,
    /// Of a state the multipliers `π_{k+1}` of the dynamics, one for each interval.
    pub costates: Vec<T>,
}

impl<T: Real> Series<T> {
    pub(in crate::ocp) fn new(
        kind: Kind,
        name: impl Into<String>,
        first: usize,
        values: Vec<T>,
    ) -> Self {
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

    /// With a unit.
    pub(in crate::ocp) fn with_unit(self, unit: impl Into<String>) -> Self {
        Self { unit: unit.into(), ..self }
    }

    /// Whether a name means it; of `x.cart.position` also `cart.position`.
    fn is_meant(&self, name: &str) -> bool {
        let field = ["x.", "z.", "u.", "p."].iter().find_map(|argument| self.name.strip_prefix(argument));
        means(name, &self.name) || field.is_some_and(|field| means(name, field))
    }

    /// `λ_upper − λ_lower` of every value: positive where the upper bound holds it back.
    #[must_use]
    pub fn multipliers(&self) -> Vec<T> {
        self.upper_multipliers.iter().zip(&self.lower_multipliers).map(|(&u, &l)| u - l).collect()
    }

    /// By how much every value is beyond its bounds, zero inside of them: of soft bounds this is
    /// the slack, which has a penalty.
    #[must_use]
    pub fn violations(&self) -> Vec<T> {
        let beyond = |k: usize, value: T| {
            let below = side(&self.lower, k).map_or(T::ZERO, |bound| bound - value);
            let above = side(&self.upper, k).map_or(T::ZERO, |bound| value - bound);
            let most = if below < above { above } else { below };
            if T::ZERO < most { most } else { T::ZERO }
        };
        self.values.iter().enumerate().map(|(k, &value)| beyond(k, value)).collect()
    }

    /// Whether a value is at one of its bounds, to a distance, or beyond it.
    #[must_use]
    pub fn is_active(&self, index: usize, distance: T) -> bool {
        let Some(&value) = self.values.get(index) else { return false };
        side(&self.lower, index).is_some_and(|bound| value - bound <= distance)
            || side(&self.upper, index).is_some_and(|bound| bound - value <= distance)
    }
}

fn side<T: Real>(bounds: &[Option<T>], index: usize) -> Option<T> {
    bounds.get(index).copied().flatten()
}

impl<T: Real> Trajectory<T> {
    /// Of a model, with the unit of its times.
    pub(in crate::ocp) fn of_series(
        (model, time_unit): (&str, &str),
        times: Vec<T>,
        series: Vec<Series<T>>,
    ) -> Self {
        Self { model: model.into(), times, time_unit: time_unit.into(), series }
    }

    /// The last of the times: the end of the horizon, which may have been
    /// [found](crate::ocp::Horizon::free).
    ///
    /// [Horizon::free]: crate::ocp::Horizon::free
    #[must_use]
    pub fn end_time(&self) -> T {
        self.times.last().copied().unwrap_or(T::ZERO)
    }

    /// The name of the model.
    #[must_use]
    pub fn model(&self) -> &str {
        &self.model
    }

    /// The unit of the times, if it is known.
    #[must_use]
    pub fn time_unit(&self) -> &str {
        &self.time_unit
    }

    /// Says the unit of all that a name means, or with the name `t` that of the times: pictures
    /// show it. Units in doc comments of the model are there without this call.
    ///
    /// ```
    /// # use casados::ocp::{Horizon, Problem};
    /// # use casados::prelude::*;
    /// # #[ode]
    /// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
    /// # let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
    /// # ocp.fix_initial_state(&[0.0, 1.0])?.guess(&[0.0; 2], &[0.0])?;
    /// let mut solution = ocp.solution()?;
    /// solution.set_unit("x[0]", "m")?.set_unit("x[1]", "m/s")?.set_unit("t", "s")?;
    /// assert_eq!(solution.get("x[1]")?.unit, "m/s");
    /// assert!(solution.set_unit("y", "m").is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`TrajectoryError::Unknown`]
    pub fn set_unit(&mut self, name: &str, unit: &str) -> Result<&mut Self, TrajectoryError> {
        if name == "t" {
            self.time_unit = unit.into();
            return Ok(self);
        }
        let mut meant = self.series.iter_mut().filter(|series| series.is_meant(name)).peekable();
        if meant.peek().is_none() {
            drop(meant);
            // The error that lists the names.
            self.get(name)?;
            return Ok(self);
        }
        meant.for_each(|series| series.unit = unit.into());
        Ok(self)
    }

    /// The times of all points.
    #[must_use]
    pub fn times(&self) -> &[T] {
        &self.times
    }

    /// All that there is, in the order of [`Kind`], and of the model.
    #[must_use]
    pub fn series(&self) -> &[Series<T>] {
        &self.series
    }

    /// The times of the values of a series.
    #[must_use]
    pub fn times_of(&self, series: &Series<T>) -> &[T] {
        let times = self.times.get(series.first..).unwrap_or_default();
        times.get(..series.values.len()).unwrap_or_default()
    }

    /// A quantity by its name. That of several (`x` of `x[0]` and `x[1]`) is enough where there is
    /// one, and so is `speed` of `x.speed`. Where something of more than one [`Kind`] is called so,
    /// the first is meant.
    ///
    /// # Errors
    /// [`TrajectoryError::Unknown`], [`TrajectoryError::Ambiguous`]
    pub fn get(&self, name: &str) -> Result<&Series<T>, TrajectoryError> {
        let kind = self.series.iter().find(|series| series.is_meant(name)).map(|series| series.kind);
        self.find(name, |series| kind.is_none_or(|kind| series.kind == kind))
    }

    /// Everything of a kind at one of the times, as a struct of the model; `None` where there is
    /// nothing, or not as much.
    ///
    /// ```
    /// use casados::ocp::{Horizon, Kind, Problem};
    /// use casados::prelude::*;
    /// use casados::Record;
    ///
    /// #[ode]
    /// mod cart {
    ///     #[derive(Debug, PartialEq, casados::Record)]
    ///     pub struct State { pub place: f64, pub speed: f64 }
    ///     pub fn cart(x: &State, u: f64) -> State { State { place: x.speed, speed: u } }
    /// }
    ///
    /// let start = cart::State { place: 0.0, speed: 1.0 };
    /// let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
    /// ocp.fix_initial_state(&start.numbers())?.guess(&start.numbers(), &[0.0])?;
    /// let solution = ocp.solution()?;
    /// assert_eq!(solution.record(Kind::State, 2), Some(start));
    /// assert_eq!(solution.state("x.speed")?, [1.0; 3]);
    /// assert_eq!(solution.state("speed")?, solution.state("x.speed")?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn record<R: Record>(&self, kind: Kind, time: usize) -> Option<R> {
        let of_kind = self.series.iter().filter(|series| series.kind == kind);
        let at = |series: &Series<T>| series.values.get(time.checked_sub(series.first)?).copied();
        let values: Option<Vec<T>> = of_kind.map(at).collect();
        R::from_slice(&values?)
    }

    fn of(&self, name: &str, kind: Kind) -> Result<&Series<T>, TrajectoryError> {
        self.find(name, |series| series.kind == kind)
    }

    fn find(&self, name: &str, among: impl Fn(&Series<T>) -> bool) -> Result<&Series<T>, TrajectoryError> {
        let candidates = || self.series.iter().filter(|series| among(series));
        let mut found = candidates().filter(|series| series.is_meant(name));
        let names = |series: &Series<T>| series.name.clone();
        match (found.next(), found.next()) {
            (Some(series), None) => Ok(series),
            (Some(_), Some(_)) => Err(TrajectoryError::Ambiguous {
                name: name.into(),
                found: candidates().filter(|series| series.is_meant(name)).map(names).collect(),
            }),
            (None, _) => Err(TrajectoryError::Unknown {
                model: self.model.clone(),
                name: name.into(),
                known: candidates().map(names).collect(),
            }),
        }
    }

    /// A state at every point.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn state(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.of(name, Kind::State)?.values)
    }

    /// An algebraic state at every point but the last.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn algebraic(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.of(name, Kind::Algebraic)?.values)
    }

    /// A control at every point but the last.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn control(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.of(name, Kind::Control)?.values)
    }

    /// A parameter at every node.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn parameter(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.of(name, Kind::Parameter)?.values)
    }

    /// An output of the path constraints at every node but the last.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn constraint(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.of(name, Kind::Path)?.values)
    }

    /// An output of the terminal constraints.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn terminal(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.of(name, Kind::Terminal)?.values)
    }

    /// `λ_upper − λ_lower` of the bounds of a state, control or constraint at every node that has
    /// one: positive where the upper bound holds it back.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn multiplier(&self, name: &str) -> Result<Vec<T>, TrajectoryError> {
        Ok(self.get(name)?.multipliers())
    }

    /// The multipliers `π_{k+1}` of the dynamics of a state, one for each interval: what a unit of
    /// this state more at the end of the interval adds to the objective.
    ///
    /// # Errors
    /// As [`Trajectory::get`].
    pub fn costate(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.of(name, Kind::State)?.costates)
    }
}
