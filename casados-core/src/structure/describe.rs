//! The text description of a [`Structure`].

use super::{Cost, Elimination, Kinematic, Structure};
use core::fmt::{self, Display, Formatter, Write};

/// Number of columns of the text.
const WIDTH: usize = 96;
/// Indentation of the words of a line.
const INDENT: usize = 15;
/// Maximal number of words of a list.
const MAX_WORDS: usize = 64;
/// Numbers of stages for which the cost is listed.
const LISTED_STAGES: [usize; 4] = [1, 2, 3, 4];

/// Dimensions and names, equations by kind, operation counts, sparsity, the elimination order, and
/// the expected cost of a step.
///
/// Equations are counted from 0; long lists are truncated.
impl Display for Structure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let kind = match (self.is_explicit(), self.z.len()) {
            (true, _) => "explicit, ẋ = g(x, u, p, t)",
            (false, 0) => "implicit, f(ẋ, x, u, p, t) = 0",
            (false, _) => "differential-algebraic, f(ẋ, x, z, u, p, t) = 0",
        };
        writeln!(f, "{}: {kind}\n", self.name)?;
        fmt_names(f, "states x", self.x)?;
        fmt_names(f, "algebraic z", self.z)?;
        fmt_names(f, "controls u", self.u)?;
        fmt_names(f, "parameters p", self.p)?;
        writeln!(f)?;
        self.fmt_equations(f)?;
        if let Some(reduction) = self.reduction {
            writeln!(f, "{reduction}")?;
        }
        self.fmt_sparsity(f)?;
        writeln!(f)?;
        self.fmt_elimination(f)?;
        writeln!(f)?;
        self.fmt_costs(f)
    }
}

impl Structure {
    /// Returns the name of a variable `(ẋ, x, z, u, p, t)` by its index.
    #[must_use]
    pub fn variable(&self, index: u32) -> impl Display {
        let nx = self.x.len();
        let mut index = index as usize;
        if let Some(&name) = self.x.get(index) {
            return VariableName { name, derivative: true };
        }
        index = index.saturating_sub(nx);
        for block in [self.x, self.z, self.u, self.p] {
            if let Some(&name) = block.get(index) {
                return VariableName { name, derivative: false };
            }
            index -= block.len();
        }
        VariableName { name: "t", derivative: false }
    }

    /// Returns the name of an unknown `(k, z)` by its index: a derivative or an algebraic state.
    #[must_use]
    pub fn unknown(&self, index: u32) -> impl Display {
        let nx = self.x.len() as u32;
        self.variable(if index < nx { index } else { index + nx })
    }

    fn fmt_equations(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let equations = self.linear.len() as u32;
        let trivial = |row: &u32| self.trivial.contains(row);
        let linear = |row: &u32| self.linear.get(*row as usize) == Some(&true);
        let constant = |row: &u32| self.constant_rows.get(*row as usize) == Some(&true);
        let line = |f: &mut Formatter<'_>, title: &str, list: &dyn Fn(&u32) -> bool, note: &'static str| {
            let count = (0..equations).filter(list).count();
            if count == 0 {
                return Ok(());
            }
            let rows = Ranges((0..equations).filter(list).peekable());
            fmt_words(
                f,
                title,
                [NumberRange::Count(count)].into_iter().chain(rows).chain([NumberRange::Note(note)]),
            )
        };
        line(f, "trivial", &trivial, "c ẋ + c′ v + c″(t) = 0")?;
        line(f, "linear", &|row| linear(row) && !trivial(row), "linear in (ẋ, x, z, u, p)")?;
        line(f, "nonlinear", &|row| !linear(row), "with second derivatives")?;
        line(f, "constant", &constant, "rows of the Newton matrix that never change")?;
        if !self.quadratures.is_empty() {
            let states = self.quadratures.iter().filter_map(|&state| self.x.get(state as usize));
            fmt_words(f, "quadratures", states.map(|name| NameRun::Name(name)))?;
        }
        if self.linear_in_state {
            let matrix = if self.constant_matrix { "; its matrix serves a whole interval" } else { "" };
            writeln!(f, "{:INDENT$}one iteration of Newton's method is exact{matrix}", "")?;
        }
        writeln!(f)
    }

    fn fmt_sparsity(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let blocks = ["ẋ", "x", "z", "u", "p"];
        let present: [bool; 5] = [true, true, !self.z.is_empty(), !self.u.is_empty(), !self.p.is_empty()];
        fmt_title(f, "non-zeros")?;
        for (name, _) in blocks.iter().zip(present).filter(|(_, present)| *present) {
            write!(f, "    f_{name}")?;
        }
        writeln!(f, "    all")?;
        let row = |f: &mut Formatter<'_>, name: &str, constant: bool| {
            fmt_title(f, name)?;
            let count = |begin: usize, end: usize| match constant {
                false => end - begin,
                true => self.constant.get(begin..end).unwrap_or_default().iter().filter(|c| **c).count(),
            };
            for (block, _) in present.iter().enumerate().filter(|(_, present)| **present) {
                write!(f, "{:>7}", count(self.blocks[block], self.blocks[block + 1]))?;
            }
            write!(f, "{:>7}", count(0, self.jacobian.len()))
        };
        let variables = 2 * self.x.len() + self.z.len() + self.u.len() + self.p.len();
        row(f, "  Jacobian", false)?;
        writeln!(f, " of {}", self.linear.len() * variables)?;
        row(f, "  constant", true)?;
        writeln!(f)?;
        fmt_title(f, "  Hessian")?;
        writeln!(
            f,
            "{} of {} in the lower triangle, of {} of {variables} variables",
            self.hessian.len(),
            variables * (variables + 1) / 2,
            self.curved.len() + self.diagonal_controls.len(),
        )?;
        fmt_title(f, "directions")?;
        let directions = self.x.len() + self.u.len() + self.p.len();
        writeln!(f, "{} of {directions} of (x₀, u, p) have any influence", self.directions.len())?;
        fmt_title(f, "operations")?;
        let operations = &self.operations;
        if *operations == Default::default() {
            return writeln!(f, "not known");
        }
        writeln!(
            f,
            "f {}, f and Jacobian {}, gradient {}, Hessian {}",
            operations.residual, operations.residual_jacobian, operations.adjoint, operations.hessian
        )
    }

    fn fmt_elimination(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Elimination { pivots, slots, kinematic, .. } = self.elimination;
        fmt_title(f, "elimination")?;
        if pivots.is_empty() {
            return writeln!(f, "no plan: the whole matrix is pivoted");
        }
        let is_kinematic = |&(_, of): &(u32, &Kinematic)| of.equation != Kinematic::NONE;
        let kinematic = || (0..).zip(kinematic).filter(is_kinematic);
        let identities = pivots.iter().filter(|pivot| pivot.identity).count();
        let fill = self.elimination.fill();
        writeln!(
            f,
            "{} blocks = {} non-zeros + {fill} fill; {identities} of {} pivots are identities",
            slots.len(),
            slots.len().saturating_sub(fill),
            pivots.len(),
        )?;
        if kinematic().count() > 0 {
            fmt_title(f, "  kinematic")?;
            writeln!(f, "each follows from the variable of its equation, and is no unknown")?;
            let states = kinematic().map(|(state, of)| Assignment {
                unknown: self.unknown(state),
                equation: of.equation as usize,
            });
            fmt_words(f, "", states)?;
        }
        let order = pivots
            .iter()
            .map(|pivot| Assignment { unknown: self.unknown(pivot.slot), equation: pivot.equation as usize });
        fmt_title(f, "  order")?;
        writeln!(f, "each unknown ← the equation that it is found from")?;
        fmt_words(f, "", order)
    }

    fn fmt_costs(&self, f: &mut Formatter<'_>) -> fmt::Result {
        const TITLE_WIDTH: usize = 38;
        write!(f, "{:TITLE_WIDTH$}", "operations of a step, s stages")?;
        for s in LISTED_STAGES {
            write!(f, "      s = {s:1}")?;
        }
        writeln!(f)?;
        let costs = LISTED_STAGES.map(|s| self.cost(s));
        let row = |f: &mut Formatter<'_>, title: &dyn Display, value: fn(&Cost) -> u64| {
            let mut length = CharacterCount(0);
            write!(length, "{title}")?;
            write!(f, "  {title}{:1$}", "", TITLE_WIDTH.saturating_sub(2 + length.0))?;
            for cost in &costs {
                write!(f, "{:>11}", value(cost))?;
            }
            writeln!(f)
        };
        if self.operations != Default::default() {
            row(f, &"f", |c| c.residual)?;
            row(f, &"f and Jacobian", |c| c.residual_jacobian)?;
        }
        row(f, &"factors", |c| c.factorisation)?;
        row(f, &"a solve, each column", |c| c.solve)?;
        row(f, &"an iteration with new factors", |c| c.iteration)?;
        row(f, &format_args!("forward, {} directions", self.directions.len()), |c| c.forward)?;
        row(f, &"adjoint", |c| c.adjoint)?;
        row(f, &"Hessian, beside both", |c| c.hessian)
    }
}

/// The name of a variable; `ẋ[2]` for the derivative of `x[2]`.
struct VariableName {
    name: &'static str,
    derivative: bool,
}

impl Display for VariableName {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match (self.derivative, self.name.strip_prefix('x')) {
            (false, _) => f.write_str(self.name),
            (true, Some(rest)) if !rest.starts_with(char::is_alphanumeric) => write!(f, "ẋ{rest}"),
            (true, _) => write!(f, "d({})/dt", self.name),
        }
    }
}

/// An unknown and the equation that determines it.
struct Assignment<N> {
    unknown: N,
    equation: usize,
}

impl<N: Display> Display for Assignment<N> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} ← {}", self.unknown, self.equation)
    }
}

/// A word in a list of numbers: their count, a number or a range, or a note.
enum NumberRange {
    Count(usize),
    Numbers(u32, u32),
    Note(&'static str),
}

impl Display for NumberRange {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Count(count) => write!(f, "{count}:"),
            Self::Numbers(first, last) if first == last => write!(f, "{first}"),
            Self::Numbers(first, last) => write!(f, "{first}-{last}"),
            Self::Note(note) => write!(f, "({note})"),
        }
    }
}

/// Ascending numbers, grouped into runs.
struct Ranges<I: Iterator<Item = u32>>(core::iter::Peekable<I>);

impl<I: Iterator<Item = u32>> Iterator for Ranges<I> {
    type Item = NumberRange;
    fn next(&mut self) -> Option<Self::Item> {
        let first = self.0.next()?;
        let mut last = first;
        while self.0.next_if(|&next| next == last + 1).is_some() {
            last += 1;
        }
        Some(NumberRange::Numbers(first, last))
    }
}

/// Counts characters, so that the length of a word is found without allocation.
struct CharacterCount(usize);

impl Write for CharacterCount {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0 += text.chars().count();
        Ok(())
    }
}

pub(super) fn fmt_title(f: &mut Formatter<'_>, title: &str) -> fmt::Result {
    write!(f, "{title:INDENT$}")
}

fn fmt_names(f: &mut Formatter<'_>, title: &str, names: &[&str]) -> fmt::Result {
    if names.is_empty() {
        return Ok(());
    }
    fmt_words(f, title, [NameRun::Count(names.len())].into_iter().chain(NameRuns(names)))
}

/// A word in a list of names: their count, a name, or a range of indices.
enum NameRun<'a> {
    Count(usize),
    Name(&'a str),
    Run(&'a str, &'a str),
}

impl Display for NameRun<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}:"),
            Self::Name(name) => f.write_str(name),
            Self::Run(first, last) => write!(f, "{first} .. {last}"),
        }
    }
}

/// Names, with ranges such as `x[0] .. x[9]` for more than three.
struct NameRuns<'a>(&'a [&'a str]);

impl<'a> Iterator for NameRuns<'a> {
    type Item = NameRun<'a>;
    fn next(&mut self) -> Option<NameRun<'a>> {
        let follows = |pair: &[&str]| match (split_index(pair[0]), split_index(pair[1])) {
            (Some((a, i)), Some((b, j))) => a == b && i + 1 == j,
            _ => false,
        };
        let run = 1 + self.0.windows(2).take_while(|pair| follows(pair)).count();
        let (first, rest) = self.0.split_first()?;
        match self.0.get(run - 1) {
            Some(last) if run > 3 => {
                self.0 = self.0.get(run..).unwrap_or_default();
                Some(NameRun::Run(first, last))
            }
            _ => {
                self.0 = rest;
                Some(NameRun::Name(first))
            }
        }
    }
}

/// `("x", 3)` of `x[3]`.
fn split_index(name: &str) -> Option<(&str, u32)> {
    let (head, index) = name.strip_suffix(']')?.rsplit_once('[')?;
    Some((head, index.parse().ok()?))
}

/// Writes a title and words in lines; long lists are truncated.
fn fmt_words<W: Display>(f: &mut Formatter<'_>, title: &str, words: impl Iterator<Item = W>) -> fmt::Result {
    self::fmt_title(f, title)?;
    let mut column = INDENT;
    let mut left_out = 0;
    for (index, word) in words.enumerate() {
        if index >= MAX_WORDS {
            left_out += 1;
            continue;
        }
        let mut length = CharacterCount(0);
        write!(length, "{word}")?;
        if column > INDENT && column + 2 + length.0 > WIDTH {
            write!(f, "\n{:INDENT$}", "")?;
            column = INDENT;
        }
        let gap = if column > INDENT { "  " } else { "" };
        write!(f, "{gap}{word}")?;
        column += gap.len() + length.0;
    }
    if left_out > 0 {
        write!(f, "  and {left_out} more")?;
    }
    writeln!(f)
}
