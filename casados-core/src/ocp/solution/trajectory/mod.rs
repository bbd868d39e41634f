//! Solutions by the names of their variables, independent of the problem.
//!
//! | | |
//! | --- | --- |
//! | `from_iterate` | the iterate of a problem as a trajectory |
//! | `dense_solution` | the iterate with points between the nodes |
//! | `read` | a trajectory from a file, checked |
//! | `restore` | a trajectory as the iterate of a problem, or as its guess |
//! | `csv` | a table for other programs |
//! | `series` | one quantity over time |
//! | `violations` | violated bounds of a trajectory |

mod csv;
mod dense_solution;
mod error;
mod from_iterate;
#[cfg(feature = "serde")]
mod read;
mod restore;
mod series;
mod violations;

pub use csv::Csv;
pub use error::TrajectoryError;
pub(in crate::ocp) use from_iterate::constraint_names;
pub use series::{Kind, Series};
pub use violations::Violation;

use crate::record::Record;
use crate::scalar::Real;
use alloc::string::String;
use alloc::vec::Vec;

/// A solution over time: states, algebraic states, controls, parameters and constraints by names,
/// with bounds and multipliers. It is created by [`Ocp::solution`](crate::ocp::Ocp::solution).
///
/// It owns its data: it may outlive the problem, be compared, be written to a file (feature
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
    /// The unit of the times; empty if it is unknown.
    time_unit: String,
    series: Vec<Series<T>>,
}

impl<T: Real> Trajectory<T> {
    /// Creates the trajectory of a model, with the unit of its times.
    pub(in crate::ocp) fn from_series(
        (model, time_unit): (&str, &str),
        times: Vec<T>,
        series: Vec<Series<T>>,
    ) -> Self {
        Self { model: model.into(), times, time_unit: time_unit.into(), series }
    }

    /// The last time: the end of the horizon, which may have been
    /// [optimised](crate::ocp::Horizon::free).
    #[must_use]
    pub fn end_time(&self) -> T {
        self.times.last().copied().unwrap_or(T::ZERO)
    }

    /// The name of the model.
    #[must_use]
    pub fn model(&self) -> &str {
        &self.model
    }

    /// The unit of the times; empty if it is unknown.
    #[must_use]
    pub fn time_unit(&self) -> &str {
        &self.time_unit
    }

    /// Sets the unit of all quantities with a name, or of the times for the name `t`, for plots.
    /// Units in doc comments of the model need no such call.
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
        let mut matching_series = self.series.iter_mut().filter(|series| series.matches(name)).peekable();
        if matching_series.peek().is_none() {
            drop(matching_series);
            // This error lists the names.
            self.get(name)?;
            return Ok(self);
        }
        matching_series.for_each(|series| series.unit = unit.into());
        Ok(self)
    }

    /// The times of all points.
    #[must_use]
    pub fn times(&self) -> &[T] {
        &self.times
    }

    /// All series, in the order of [`Kind`], then of the model.
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

    /// Returns a quantity by its name. The name without index (`x` for `x[0]`) suffices if there is
    /// only one element, and `speed` suffices for `x.speed`. If quantities of several [`Kind`]s
    /// match, those of the first kind are considered.
    ///
    /// # Errors
    /// [`TrajectoryError::Unknown`], [`TrajectoryError::Ambiguous`]
    pub fn get(&self, name: &str) -> Result<&Series<T>, TrajectoryError> {
        let kind = self.series.iter().find(|series| series.matches(name)).map(|series| series.kind);
        self.find_series(name, |series| kind.is_none_or(|kind| series.kind == kind))
    }

    /// Returns all quantities of a kind at one time, as a struct of the model; `None` if values are
    /// missing.
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

    fn series_of_kind(&self, name: &str, kind: Kind) -> Result<&Series<T>, TrajectoryError> {
        self.find_series(name, |series| series.kind == kind)
    }

    fn find_series(
        &self,
        name: &str,
        is_candidate: impl Fn(&Series<T>) -> bool,
    ) -> Result<&Series<T>, TrajectoryError> {
        let candidates = || self.series.iter().filter(|series| is_candidate(series));
        let mut found = candidates().filter(|series| series.matches(name));
        let names = |series: &Series<T>| series.name.clone();
        match (found.next(), found.next()) {
            (Some(series), None) => Ok(series),
            (Some(_), Some(_)) => Err(TrajectoryError::Ambiguous {
                name: name.into(),
                found: candidates().filter(|series| series.matches(name)).map(names).collect(),
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
    /// The errors of [`Trajectory::get`].
    pub fn state(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::State)?.values)
    }

    /// An algebraic state at every point except the last.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn algebraic(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Algebraic)?.values)
    }

    /// A control at every point except the last; a linear control at every point.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn control(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Control)?.values)
    }

    /// A Bernstein coefficient of a polynomial control in every interval: `u[0]`, the value at the
    /// start, to `u[d]`, the value at the end.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn coefficient(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Coefficient)?.values)
    }

    /// The rate of a linear control in every interval: `du` of `u`.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn rate(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Rate)?.values)
    }

    /// An integral from the start to every node.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn integral(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Integral)?.values)
    }

    /// A parameter at every node.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn parameter(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Parameter)?.values)
    }

    /// An output of the path constraints at every node except the last.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn constraint(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Path)?.values)
    }

    /// An output of the terminal constraints.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn terminal(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Terminal)?.values)
    }

    /// A path constraint or a bounded variable at a point inside every interval, named by its
    /// fraction of the interval: `Speed@0.5`.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn inside(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::Inside)?.values)
    }

    /// `λ_upper − λ_lower` of the bounds of a state, control or constraint at every node: positive
    /// if the upper bound is active.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn multiplier(&self, name: &str) -> Result<Vec<T>, TrajectoryError> {
        Ok(self.get(name)?.multipliers())
    }

    /// The multipliers `π_{k+1}` of the dynamics of a state, one for each interval: the derivative
    /// of the objective with respect to this state at the end of the interval.
    ///
    /// # Errors
    /// The errors of [`Trajectory::get`].
    pub fn costate(&self, name: &str) -> Result<&[T], TrajectoryError> {
        Ok(&self.series_of_kind(name, Kind::State)?.costates)
    }
}
