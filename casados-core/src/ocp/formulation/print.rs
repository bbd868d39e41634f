//! Display of a problem: formulas, names, bounds and sizes.

use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::data::node_row_count;
use crate::ocp::formulation::instance::data::{constraint_bounds, path_row_count};
use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::labels::output_name;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::get;
use crate::qp::{Bounds, Stage, StageDims, marked_indices};
use crate::scalar::Real;
use crate::shape::Shape;
use core::fmt::{self, Display, Formatter};
use core::ops::Range;

/// The largest number of names in a list.
const MAX_LISTED_NAMES: usize = 8;
/// The largest number of different bounds of one variable over the stages in a list.
const MAX_LISTED_BOUNDS: usize = 4;

/// Prints the objective, the dynamics, bounds and constraints by name, with their stages and the
/// penalties of soft ones, and the dimensions of the problem.
///
/// ```
/// use casados::ocp::{Constraint, Horizon, LeastSquaresCost, Map, Problem};
/// use casados::prelude::*;
///
/// #[function]
/// fn walk(x: [f64; 2], u: f64) -> [f64; 2] { [x[0] + x[1], x[1] + u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// #[function]
/// fn square(x: [f64; 2], _u: f64) -> f64 { x[0] * x[0] }
///
/// let mut ocp = Problem::new(Map::<Walk, f64>::new())
///     .stage_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
///     .terminal_constraints(Constraint::<Square>::new([4.0], [4.0]))
///     .on(Horizon::uniform(10, 1.0))?;
/// ocp.fix_initial_state(&[1.0, 0.0])?.bound("u", .., -0.5, 0.5)?;
/// ocp.bound("x[1]", 1.., f64::NEG_INFINITY, 0.7)?.soften("x[1]", 1.., 100.0, 0.0)?;
/// assert_eq!(ocp.to_string(), "\
/// Walk: 10 intervals, t from 0 to 10
///   min    Σ ½‖Effort − r‖²_W
///   over   2 states x[0], x[1]; 1 control u
///   s.t.   x₊ = φ(x, u)
///          x[0] = 1 at stage 0
///          x[1] = 0 at stage 0
///          x[1] ≤ 0.7 at stages 1..=10, soft: 100 e
///          -0.5 ≤ u ≤ 0.5 at stages 0..=9
///          Square = 4 at stage 10
///   size   32 variables, 20 equations of dynamics, 3 other ones, 30 bounds, 10 of them soft
/// ");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Display
    for Ocp<P, T, D, M>
{
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (names, intervals, times) = (self.names(), self.intervals(), self.times());
        let [start, end] = [0, intervals].map(|node| get(times, node).to_f64());
        let plural = if intervals == 1 { "" } else { "s" };
        write!(f, "{}: {intervals} interval{plural}, t from {start} to ", names.model)?;
        match self.free.view().end_time_index() {
            Some(w) => writeln!(f, "{}, which is free", self.free_parameter_name(w))?,
            None => writeln!(f, "{end}")?,
        }
        self.print_objective(f)?;
        self.print_variables(f, &names)?;
        let arguments = [("x", names.x.len()), ("u", names.u.len()), ("p", names.p.len())];
        f.write_str("  s.t.   x₊ = φ(")?;
        for (i, (name, _)) in arguments.iter().filter(|(_, count)| *count > 0).enumerate() {
            write!(f, "{}{name}", if i == 0 { "" } else { ", " })?;
        }
        f.write_str(")")?;
        if P::Dynamics::ALGEBRAIC && !names.z.is_empty() {
            f.write_str(", with algebraic states ")?;
            print_names(f, names.z)?;
        }
        writeln!(f)?;
        if self.initial_state == InitialState::Unknown {
            writeln!(f, "         (initial state not said: `fix_initial_state` or `free_initial_state`)")?;
        }
        let mut count = ConstraintCounts::default();
        self.print_bounds(f, &names, &mut count)?;
        let view = self.qp.view();
        for i in marked_indices(view.periodic()) {
            let name = names.x.get(i).copied().unwrap_or_default();
            writeln!(f, "         {name} at stage 0 = {name} at stage {intervals}")?;
        }
        for j in marked_indices(view.shared()).filter_map(|j| j.checked_sub(self.free.count())) {
            let name = names.u.get(j).copied().unwrap_or_default();
            writeln!(f, "         {name} the same at all stages")?;
        }
        let [nx, nu, free] = [P::Shape::NX, P::Shape::NU, self.free.count()];
        let (variables, dynamics) = (intervals * (nx + nu) + nx + free, intervals * nx);
        write!(f, "  size   {variables} variables, {dynamics} equations of dynamics")?;
        if count.equations > 0 {
            write!(f, ", {} other ones", count.equations)?;
        }
        write!(f, ", {} bounds", count.bounds)?;
        if count.soft > 0 {
            write!(f, ", {} of them soft", count.soft)?;
        }
        writeln!(f)
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    fn print_objective(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let problem = self.problem.parts_ref();
        let stage_sum_prefix = if problem.running { "Σ h " } else { "Σ " };
        f.write_str("  min    ")?;
        let mut is_first = true;
        let mut show = |prefix: &str, term: fmt::Arguments<'_>| {
            let plus = if core::mem::take(&mut is_first) { "" } else { " + " };
            write!(f, "{plus}{prefix}{term}")
        };
        problem.dynamics.terms(&mut |term| show("Σ ", term))?;
        problem.stage_cost.terms(&mut |term| show(stage_sum_prefix, term))?;
        problem.terminal_cost.terms(&mut |term| show("", term))?;
        if self.has_arrival_cost() {
            show("", format_args!("½‖x₀ − x̄‖²_W"))?;
        }
        if is_first {
            f.write_str("0")?;
        }
        writeln!(f)
    }

    fn print_variables(&self, f: &mut Formatter<'_>, names: &Names) -> fmt::Result {
        f.write_str("  over   ")?;
        let (model_states, more) = names.x.split_at(names.model_state_count());
        let (linear, integrals) = more.split_at(names.linear.len());
        let kinds = [
            ("state", model_states),
            ("linear control", linear),
            ("integral", integrals),
            ("control", names.u),
        ];
        for (i, (kind, names)) in kinds.into_iter().filter(|(_, names)| !names.is_empty()).enumerate() {
            let separator = if i == 0 { "" } else { "; " };
            let plural = if names.len() == 1 { "" } else { "s" };
            write!(f, "{separator}{} {kind}{plural} ", names.len())?;
            print_names(f, names)?;
        }
        let (copies, free) =
            (P::Terminal::INITIAL_STATE_COPIES, self.free.count() - P::Terminal::INITIAL_STATE_COPIES);
        if free > 0 {
            let plural = if free == 1 { "" } else { "s" };
            write!(f, "; {free} free parameter{plural} ")?;
            for w in 0..free {
                write!(f, "{}{}", if w == 0 { "" } else { ", " }, self.free_parameter_name(copies + w))?;
            }
        }
        writeln!(f)
    }

    fn print_bounds(
        &self,
        f: &mut Formatter<'_>,
        names: &Names,
        count: &mut ConstraintCounts,
    ) -> fmt::Result {
        let (intervals, view, free) = (self.intervals(), self.qp.view(), self.free.count());
        for (i, name) in names.x.iter().enumerate() {
            print_bounds_over_stages(f, name, 0..intervals + 1, count, |k| {
                view.stage(k)
                    .map_or(BoundPair::UNBOUNDED, |stage| BoundPair::from_bounds(&stage.x_bounds(), i))
            })?;
        }
        for (j, name) in names.u.iter().enumerate() {
            print_bounds_over_stages(f, name, 0..intervals, count, |k| {
                view.stage(k)
                    .map_or(BoundPair::UNBOUNDED, |stage| BoundPair::from_bounds(&stage.u_bounds(), free + j))
            })?;
        }
        for w in P::Terminal::INITIAL_STATE_COPIES..free {
            let sides = view
                .stage(0)
                .map_or(BoundPair::UNBOUNDED, |stage| BoundPair::from_bounds(&stage.u_bounds(), w));
            sides.add_to_counts(count);
            if sides.finite_sides() != [false; 2] {
                f.write_str("         ")?;
                sides.print(f, &self.free_parameter_name(w))?;
                sides.print_penalties(f)?;
                writeln!(f)?;
            }
        }
        // The QP has the bounds of the linearised constraints; these are the bounds as given.
        let layout = self.layout();
        let [lower, upper] = constraint_bounds::<P, T>(self.data.as_ref(), layout);
        let constraint = |k: usize, row: usize| {
            let row_index = k * path_row_count::<P, T>(layout) + row;
            let [lower, upper] = [lower, upper].map(|bounds| get(bounds, row_index).to_f64());
            let with_given_bounds = |stage: Stage<'_, T>| BoundPair {
                lower,
                upper,
                ..BoundPair::from_bounds(&stage.g_bounds(), row)
            };
            view.stage(k).map_or(BoundPair::UNBOUNDED, with_given_bounds)
        };
        for row in 0..P::Path::ROWS {
            let name = output_name::<P::Path, P::Shape, T>(row);
            print_bounds_over_stages(f, &name, 0..intervals, count, |k| constraint(k, row))?;
        }
        #[cfg(feature = "alloc")]
        for index in 0..layout.inner_rows {
            let name = self.inner_row_name_and_unit(index).0;
            print_bounds_over_stages(f, &name, 0..intervals, count, |k| {
                constraint(k, node_row_count::<P, T>() + index)
            })?;
        }
        for row in 0..P::Terminal::ROWS {
            let name = output_name::<P::Terminal, P::Shape, T>(row);
            print_bounds_over_stages(f, &name, intervals..intervals + 1, count, |k| constraint(k, row))?;
        }
        Ok(())
    }
}

/// Numbers of constraints other than the dynamics.
#[derive(Default)]
struct ConstraintCounts {
    equations: usize,
    bounds: usize,
    soft: usize,
}

/// The bounds of one variable at one stage, and their penalties.
#[derive(Clone, Copy, PartialEq)]
struct BoundPair {
    lower: f64,
    upper: f64,
    /// Linear and quadratic penalty.
    lower_penalty: [f64; 2],
    upper_penalty: [f64; 2],
}

impl BoundPair {
    const UNBOUNDED: Self = Self {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        lower_penalty: [f64::INFINITY, 0.0],
        upper_penalty: [f64::INFINITY, 0.0],
    };

    fn from_bounds<T: Real>(bounds: &Bounds<'_, T>, index: usize) -> Self {
        let at = |list: &[T]| get(list, index).to_f64();
        Self {
            lower: at(bounds.lower),
            upper: at(bounds.upper),
            lower_penalty: [at(bounds.lower_linear), at(bounds.lower_quadratic)],
            upper_penalty: [at(bounds.upper_linear), at(bounds.upper_quadratic)],
        }
    }

    fn finite_sides(self) -> [bool; 2] {
        [self.lower > f64::NEG_INFINITY, self.upper < f64::INFINITY]
    }

    fn is_equation(self) -> bool {
        self.lower == self.upper
    }

    fn soft_sides(self) -> [bool; 2] {
        let [below, above] = self.finite_sides();
        [below && self.lower_penalty[0] < f64::INFINITY, above && self.upper_penalty[0] < f64::INFINITY]
    }

    fn add_to_counts(self, count: &mut ConstraintCounts) {
        if self.is_equation() {
            count.equations += 1;
        } else {
            count.bounds += self.finite_sides().into_iter().map(usize::from).sum::<usize>();
        }
        count.soft += self.soft_sides().into_iter().map(usize::from).sum::<usize>();
    }

    fn print(self, f: &mut Formatter<'_>, name: &dyn Display) -> fmt::Result {
        let Self { lower, upper, .. } = self;
        match self.finite_sides() {
            _ if self.is_equation() => write!(f, "{name} = {lower}"),
            [true, true] => write!(f, "{lower} ≤ {name} ≤ {upper}"),
            [true, false] => write!(f, "{name} ≥ {lower}"),
            _ => write!(f, "{name} ≤ {upper}"),
        }
    }

    fn print_penalties(self, f: &mut Formatter<'_>) -> fmt::Result {
        let has = self.finite_sides();
        match self.soft_sides() {
            [false, false] => Ok(()),
            [true, true] if self.lower_penalty == self.upper_penalty => {
                print_penalty(f, "soft", self.lower_penalty)
            }
            // The only bound.
            [true, false] if !has[1] => print_penalty(f, "soft", self.lower_penalty),
            [false, true] if !has[0] => print_penalty(f, "soft", self.upper_penalty),
            [below, above] => {
                if below {
                    print_penalty(f, "soft below", self.lower_penalty)?;
                }
                if above {
                    print_penalty(f, "soft above", self.upper_penalty)?;
                }
                Ok(())
            }
        }
    }
}

fn print_penalty(f: &mut Formatter<'_>, what: &str, [linear, quadratic]: [f64; 2]) -> fmt::Result {
    write!(f, ", {what}: ")?;
    match (linear != 0.0, quadratic != 0.0) {
        (true, true) => write!(f, "{linear} e + ½ {quadratic} e²"),
        (false, true) => write!(f, "½ {quadratic} e²"),
        _ => write!(f, "{linear} e"),
    }
}

/// Prints the bounds of a variable, with one line for consecutive stages with equal bounds.
fn print_bounds_over_stages(
    f: &mut Formatter<'_>,
    name: &dyn Display,
    stages: Range<usize>,
    count: &mut ConstraintCounts,
    bounds_at: impl Fn(usize) -> BoundPair,
) -> fmt::Result {
    let (mut first, mut lines, mut unlisted_stages) = (stages.start, 0, 0);
    while first < stages.end {
        let sides = bounds_at(first);
        let next = (first + 1..stages.end).find(|&k| bounds_at(k) != sides).unwrap_or(stages.end);
        (first..next).for_each(|_| sides.add_to_counts(count));
        if sides.finite_sides() != [false; 2] {
            if lines < MAX_LISTED_BOUNDS {
                f.write_str("         ")?;
                sides.print(f, name)?;
                match next - first {
                    1 => write!(f, " at stage {first}")?,
                    _ => write!(f, " at stages {first}..={}", next - 1)?,
                }
                sides.print_penalties(f)?;
                writeln!(f)?;
                lines += 1;
            } else {
                unlisted_stages += next - first;
            }
        }
        first = next;
    }
    match unlisted_stages {
        0 => Ok(()),
        _ => writeln!(f, "         … and other bounds of {name} at {unlisted_stages} more stages"),
    }
}

/// Prints names; of a long list the first and the last ones.
fn print_names(f: &mut Formatter<'_>, names: &[&str]) -> fmt::Result {
    let half = MAX_LISTED_NAMES / 2;
    for (i, name) in names.iter().enumerate() {
        let separator = if i == 0 { "" } else { ", " };
        if names.len() <= MAX_LISTED_NAMES || i < half || i + half >= names.len() {
            write!(f, "{separator}{name}")?;
        } else if i == half {
            write!(f, "{separator}…")?;
        }
    }
    Ok(())
}

/// Prints the iterate without the QP.
impl<P, T, D, M> fmt::Debug for Ocp<P, T, D, M>
where
    P: Formulation<T>,
    T: Real,
    D: AsRef<[StageDims]> + fmt::Debug,
    M: AsRef<[T]> + AsMut<[T]> + fmt::Debug,
{
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("Ocp")
            .field("model", &self.names().model)
            .field("intervals", &self.intervals())
            .field("initial", &self.initial_state)
            .field("iterate", &self.iterate)
            .finish_non_exhaustive()
    }
}
