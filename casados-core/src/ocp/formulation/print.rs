//! A problem as mathematics, with names, bounds and sizes.

use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::data::node_rows;
use crate::ocp::formulation::instance::data::{bounds, path_rows};
use crate::ocp::formulation::instance::{Initial, Ocp};
use crate::ocp::formulation::labels::output;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::get;
use crate::qp::{Bounds, Stage, StageDims, marked_indices};
use crate::scalar::Real;
use crate::shape::Shape;
use core::fmt::{self, Display, Formatter};
use core::ops::Range;

/// More names than this are not listed.
const NAMES: usize = 8;
/// More bounds than this of one variable, which differ from stage to stage, are not listed.
const RUNS: usize = 4;

/// The objective, the dynamics, bounds and constraints by name, with the stages at which they hold
/// and the penalties of soft ones, and how large the problem is.
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
        match self.free.view().end() {
            Some(w) => writeln!(f, "{}, which is free", self.name_of_free(w))?,
            None => writeln!(f, "{end}")?,
        }
        self.objective(f)?;
        self.variables(f, &names)?;
        let arguments = [("x", names.x.len()), ("u", names.u.len()), ("p", names.p.len())];
        f.write_str("  s.t.   x₊ = φ(")?;
        for (i, (name, _)) in arguments.iter().filter(|(_, count)| *count > 0).enumerate() {
            write!(f, "{}{name}", if i == 0 { "" } else { ", " })?;
        }
        f.write_str(")")?;
        if P::Dynamics::ALGEBRAIC && !names.z.is_empty() {
            f.write_str(", with algebraic states ")?;
            list(f, names.z)?;
        }
        writeln!(f)?;
        if self.initial == Initial::Unknown {
            writeln!(f, "         (initial state not said: `fix_initial_state` or `free_initial_state`)")?;
        }
        let mut count = Count::default();
        self.bounds(f, &names, &mut count)?;
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
        write!(f, ", {} bounds", count.sides)?;
        if count.soft > 0 {
            write!(f, ", {} of them soft", count.soft)?;
        }
        writeln!(f)
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    fn objective(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let problem = self.problem.parts_ref();
        let sum = if problem.running { "Σ h " } else { "Σ " };
        f.write_str("  min    ")?;
        let mut is_first = true;
        let mut show = |prefix: &str, term: fmt::Arguments<'_>| {
            let plus = if core::mem::take(&mut is_first) { "" } else { " + " };
            write!(f, "{plus}{prefix}{term}")
        };
        problem.dynamics.terms(&mut |term| show("Σ ", term))?;
        problem.stage_cost.terms(&mut |term| show(sum, term))?;
        problem.terminal_cost.terms(&mut |term| show("", term))?;
        if self.has_arrival_cost() {
            show("", format_args!("½‖x₀ − x̄‖²_W"))?;
        }
        if is_first {
            f.write_str("0")?;
        }
        writeln!(f)
    }

    fn variables(&self, f: &mut Formatter<'_>, names: &Names) -> fmt::Result {
        f.write_str("  over   ")?;
        let (own, more) = names.x.split_at(names.own_states());
        let (linear, integrals) = more.split_at(names.linear.len());
        let kinds =
            [("state", own), ("linear control", linear), ("integral", integrals), ("control", names.u)];
        for (i, (kind, names)) in kinds.into_iter().filter(|(_, names)| !names.is_empty()).enumerate() {
            let separator = if i == 0 { "" } else { "; " };
            let plural = if names.len() == 1 { "" } else { "s" };
            write!(f, "{separator}{} {kind}{plural} ", names.len())?;
            list(f, names)?;
        }
        let (copies, free) = (P::Terminal::STARTS, self.free.count() - P::Terminal::STARTS);
        if free > 0 {
            let plural = if free == 1 { "" } else { "s" };
            write!(f, "; {free} free parameter{plural} ")?;
            for w in 0..free {
                write!(f, "{}{}", if w == 0 { "" } else { ", " }, self.name_of_free(copies + w))?;
            }
        }
        writeln!(f)
    }

    fn bounds(&self, f: &mut Formatter<'_>, names: &Names, count: &mut Count) -> fmt::Result {
        let (intervals, view, free) = (self.intervals(), self.qp.view(), self.free.count());
        for (i, name) in names.x.iter().enumerate() {
            runs(f, name, 0..intervals + 1, count, |k| {
                view.stage(k).map_or(Sides::NONE, |stage| Sides::of(&stage.x_bounds(), i))
            })?;
        }
        for (j, name) in names.u.iter().enumerate() {
            runs(f, name, 0..intervals, count, |k| {
                view.stage(k).map_or(Sides::NONE, |stage| Sides::of(&stage.u_bounds(), free + j))
            })?;
        }
        for w in P::Terminal::STARTS..free {
            let sides = view.stage(0).map_or(Sides::NONE, |stage| Sides::of(&stage.u_bounds(), w));
            sides.count(count);
            if sides.has() != [false; 2] {
                f.write_str("         ")?;
                sides.write(f, &self.name_of_free(w))?;
                sides.write_penalties(f)?;
                writeln!(f)?;
            }
        }
        // Bounds in the QP are those of what is linear.
        let layout = self.layout();
        let [lower, upper] = bounds::<P, T>(self.data.as_ref(), layout);
        let constraint = |k: usize, row: usize| {
            let place = k * path_rows::<P, T>(layout) + row;
            let [lower, upper] = [lower, upper].map(|bounds| get(bounds, place).to_f64());
            let of = |stage: Stage<'_, T>| Sides { lower, upper, ..Sides::of(&stage.g_bounds(), row) };
            view.stage(k).map_or(Sides::NONE, of)
        };
        for row in 0..P::Path::ROWS {
            let name = output::<P::Path, P::Shape, T>(row);
            runs(f, &name, 0..intervals, count, |k| constraint(k, row))?;
        }
        #[cfg(feature = "alloc")]
        for index in 0..layout.inner {
            let name = self.inside_name(index).0;
            runs(f, &name, 0..intervals, count, |k| constraint(k, node_rows::<P, T>() + index))?;
        }
        for row in 0..P::Terminal::ROWS {
            let name = output::<P::Terminal, P::Shape, T>(row);
            runs(f, &name, intervals..intervals + 1, count, |k| constraint(k, row))?;
        }
        Ok(())
    }
}

/// What there is beside the dynamics.
#[derive(Default)]
struct Count {
    equations: usize,
    sides: usize,
    soft: usize,
}

/// The bounds of one variable at one stage, and their penalties.
#[derive(Clone, Copy, PartialEq)]
struct Sides {
    lower: f64,
    upper: f64,
    /// Linear and quadratic.
    below: [f64; 2],
    above: [f64; 2],
}

impl Sides {
    const NONE: Self = Self {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        below: [f64::INFINITY, 0.0],
        above: [f64::INFINITY, 0.0],
    };

    fn of<T: Real>(bounds: &Bounds<'_, T>, index: usize) -> Self {
        let at = |list: &[T]| get(list, index).to_f64();
        Self {
            lower: at(bounds.lower),
            upper: at(bounds.upper),
            below: [at(bounds.lower_linear), at(bounds.lower_quadratic)],
            above: [at(bounds.upper_linear), at(bounds.upper_quadratic)],
        }
    }

    fn has(self) -> [bool; 2] {
        [self.lower > f64::NEG_INFINITY, self.upper < f64::INFINITY]
    }

    fn is_equation(self) -> bool {
        self.lower == self.upper
    }

    fn soft(self) -> [bool; 2] {
        let [below, above] = self.has();
        [below && self.below[0] < f64::INFINITY, above && self.above[0] < f64::INFINITY]
    }

    fn count(self, count: &mut Count) {
        if self.is_equation() {
            count.equations += 1;
        } else {
            count.sides += self.has().into_iter().map(usize::from).sum::<usize>();
        }
        count.soft += self.soft().into_iter().map(usize::from).sum::<usize>();
    }

    fn write(self, f: &mut Formatter<'_>, name: &dyn Display) -> fmt::Result {
        let Self { lower, upper, .. } = self;
        match self.has() {
            _ if self.is_equation() => write!(f, "{name} = {lower}"),
            [true, true] => write!(f, "{lower} ≤ {name} ≤ {upper}"),
            [true, false] => write!(f, "{name} ≥ {lower}"),
            _ => write!(f, "{name} ≤ {upper}"),
        }
    }

    fn write_penalties(self, f: &mut Formatter<'_>) -> fmt::Result {
        let has = self.has();
        match self.soft() {
            [false, false] => Ok(()),
            [true, true] if self.below == self.above => penalty(f, "soft", self.below),
            // The only side there is.
            [true, false] if !has[1] => penalty(f, "soft", self.below),
            [false, true] if !has[0] => penalty(f, "soft", self.above),
            [below, above] => {
                if below {
                    penalty(f, "soft below", self.below)?;
                }
                if above {
                    penalty(f, "soft above", self.above)?;
                }
                Ok(())
            }
        }
    }
}

fn penalty(f: &mut Formatter<'_>, what: &str, [linear, quadratic]: [f64; 2]) -> fmt::Result {
    write!(f, ", {what}: ")?;
    match (linear != 0.0, quadratic != 0.0) {
        (true, true) => write!(f, "{linear} e + ½ {quadratic} e²"),
        (false, true) => write!(f, "½ {quadratic} e²"),
        _ => write!(f, "{linear} e"),
    }
}

/// The bounds of a variable: a line for stages one after the other at which they are the same.
fn runs(
    f: &mut Formatter<'_>,
    name: &dyn Display,
    stages: Range<usize>,
    count: &mut Count,
    at: impl Fn(usize) -> Sides,
) -> fmt::Result {
    let (mut first, mut lines, mut left) = (stages.start, 0, 0);
    while first < stages.end {
        let sides = at(first);
        let next = (first + 1..stages.end).find(|&k| at(k) != sides).unwrap_or(stages.end);
        (first..next).for_each(|_| sides.count(count));
        if sides.has() != [false; 2] {
            if lines < RUNS {
                f.write_str("         ")?;
                sides.write(f, name)?;
                match next - first {
                    1 => write!(f, " at stage {first}")?,
                    _ => write!(f, " at stages {first}..={}", next - 1)?,
                }
                sides.write_penalties(f)?;
                writeln!(f)?;
                lines += 1;
            } else {
                left += next - first;
            }
        }
        first = next;
    }
    match left {
        0 => Ok(()),
        _ => writeln!(f, "         … and other bounds of {name} at {left} more stages"),
    }
}

/// Names, of many the first and the last ones.
fn list(f: &mut Formatter<'_>, names: &[&str]) -> fmt::Result {
    let half = NAMES / 2;
    for (i, name) in names.iter().enumerate() {
        let separator = if i == 0 { "" } else { ", " };
        if names.len() <= NAMES || i < half || i + half >= names.len() {
            write!(f, "{separator}{name}")?;
        } else if i == half {
            write!(f, "{separator}…")?;
        }
    }
    Ok(())
}

/// The iterate, and nothing of the QP.
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
            .field("initial", &self.initial)
            .field("iterate", &self.iterate)
            .finish_non_exhaustive()
    }
}
