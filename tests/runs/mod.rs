//! Random runs: how long they are, and what became of them.
//!
//! `CASADOS_RANDOM=100` makes them a hundred times as long. Each class prints a row of the table in
//! `docs/random_runs.md`, which says the rest.

#![allow(dead_code)] // Each program that includes it takes a part.

use std::collections::BTreeMap;
use std::fmt::{self, Debug};
use std::ops::Range;

fn environment_number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|number| number.parse().ok())
}

/// How many times as long as usual.
pub fn case_multiplier() -> u64 {
    environment_number("CASADOS_RANDOM").unwrap_or(1)
}

/// The seeds of so many cases, or the one that `CASADOS_RANDOM_SEED` names.
pub fn seeds(few: u64) -> Range<u64> {
    environment_number("CASADOS_RANDOM_SEED").map_or(0..few * case_multiplier(), |seed| seed..seed + 1)
}

/// Whether cases with other verdicts than `Ok` are printed.
pub fn prints_verdicts() -> bool {
    std::env::var("CASADOS_RANDOM_SHOW").is_ok()
}

/// How many cases of a class ended with each verdict.
pub struct Counts {
    class: String,
    verdict_counts: BTreeMap<String, u64>,
}

impl Counts {
    pub fn new(class: impl Into<String>) -> Self {
        Self { class: class.into(), verdict_counts: BTreeMap::new() }
    }

    /// One more of a verdict.
    pub fn count(&mut self, verdict: &str) {
        *self.verdict_counts.entry(verdict.into()).or_default() += 1;
    }

    /// One more of `Ok`, or of the kind of an error.
    pub fn count_result<T, E: Debug>(&mut self, found: &Result<T, E>) {
        match found {
            Ok(_) => self.count("Ok"),
            Err(error) => self.count(&error_kind(error)),
        }
    }

    /// How many of a verdict.
    pub fn count_of(&self, verdict: &str) -> u64 {
        self.verdict_counts.get(verdict).copied().unwrap_or(0)
    }

    /// How many of some verdicts.
    pub fn count_of_any(&self, verdicts: &[&str]) -> u64 {
        verdicts.iter().map(|verdict| self.count_of(verdict)).sum()
    }

    pub fn all(&self) -> u64 {
        self.verdict_counts.values().sum()
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "| {} | {} | {} |", self.class, self.all(), self.count_of("Ok"))?;
        let others: Vec<_> = self.verdict_counts.iter().filter(|(verdict, _)| *verdict != "Ok").collect();
        let others: Vec<_> = others.iter().map(|(verdict, count)| format!("{verdict} {count}")).collect();
        write!(f, " {} |", others.join(", "))
    }
}

/// What solvers of QPs say first, and the variant of the error.
const VERDICTS: [(&str, &str); 5] = [
    ("infeasible: ", "Infeasible"),
    ("not solved after", "MaxIterations"),
    ("no progress after", "Stalled"),
    ("the time limit was reached", "OutOfTime"),
    ("the Hessian is not positive semidefinite", "NotConvex"),
];

/// What refused data are told by: how the text begins, a part of it, and the variant of the error.
const REFUSAL_TEXTS: [(&str, &str, &str); 4] = [
    ("the option", "", "InvalidOption"),
    ("stage", " elements instead of ", "Length"),
    ("stage", " exceeds upper bound ", "CrossedBounds"),
    ("stage", " is ", "InvalidValue"),
];

/// The variant of a verdict; of other errors their text before the first number or name.
pub fn error_kind(error: &impl Debug) -> String {
    let text = format!("{error:?}");
    let by_content =
        REFUSAL_TEXTS.iter().find(|(start, part, _)| text.starts_with(start) && text.contains(part));
    if let Some((.., variant)) = by_content {
        return (*variant).into();
    }
    match VERDICTS.iter().find(|(text_of, _)| text.starts_with(text_of)) {
        Some((_, variant)) => (*variant).into(),
        None => text
            .split(|c: char| c.is_ascii_digit() || "`({".contains(c))
            .next()
            .unwrap_or_default()
            .trim()
            .into(),
    }
}
