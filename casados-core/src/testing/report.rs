//! The result of a check: a table, and the wrong entries.

use core::fmt;
use std::string::String;
use std::vec::Vec;

/// The maximum number of wrong entries listed by name.
const MAX_LISTED_ENTRIES: usize = 12;

/// The result of a check. Displayed as a table; [`Report::assert`] panics with the table if an
/// entry is wrong.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::{Points, check_derivatives};
///
/// #[ode]
/// fn oscillator(x: [f64; 2], u: f64) -> [f64; 2] {
///     [x[1], u - x[0].sin()]
/// }
///
/// let report = check_derivatives::<Oscillator>(&Points::random(5));
/// println!("{report}");
/// assert!(report.passed() && report.wrong.is_empty() && !report.rows.is_empty());
/// ```
#[derive(Clone, Debug)]
#[must_use = "a report says whether the check has passed: call `assert` or look at `passed`"]
pub struct Report {
    /// The subject of the check.
    pub title: String,
    /// One row for each quantity and reference.
    pub rows: Vec<Row>,
    /// The first wrong entries.
    pub wrong: Vec<Deviation>,
    /// Warnings: a solution outside of the ranges of the model.
    pub warnings: Vec<String>,
}

/// The comparison of one quantity with one reference.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::*;
///
/// #[ode]
/// fn oscillator(x: [f64; 2], u: f64) -> [f64; 2] {
///     [x[1], u - x[0].sin()]
/// }
///
/// let report = check_derivatives::<Oscillator>(&Points::random(5));
/// for row in &report.rows {
///     println!("{} against {}: {:.1e}", row.quantity, row.reference, row.difference);
///     assert!(row.wrong == 0 && row.ratio <= 1.0);
/// }
/// ```
#[derive(Clone, Debug)]
pub struct Row {
    /// The compared quantity.
    pub quantity: &'static str,
    /// The reference.
    pub reference: &'static str,
    /// The number of compared entries.
    pub entries: usize,
    /// The number of inconclusive entries: neither side is finite, or the error bound is missing or
    /// larger than a thousandth of the largest entry.
    pub inconclusive: usize,
    /// The number of wrong entries.
    pub wrong: usize,
    /// The largest difference.
    pub difference: f64,
    /// The largest difference relative to its tolerance.
    pub ratio: f64,
    /// The largest finite tolerance.
    pub tolerance: f64,
    /// The largest entry.
    pub scale: f64,
}

/// A wrong entry.
///
/// The deviation from a wrong closed form:
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::{Exact, check_exact};
/// use nalgebra::{Vector1, vector};
///
/// /// Its solution is x₀ e^(−p t).
/// #[ode]
/// fn decay(x: f64, p: f64) -> f64 {
///     -p * x
/// }
///
/// let (x0, p, h): (f64, f64, f64) = (2.0, 0.5, 1.0);
/// let e = (-p * h).exp();
/// let exact = Exact { states: vec![x0 * e + 1e-6], ..Default::default() };
/// let integrator = |steps| Irk::<Decay, Gauss<3>>::new(Options { steps, ..Default::default() });
/// let (mut coarse, mut fine) = (integrator(4)?, integrator(8)?);
/// let report =
///     check_exact(&mut coarse, &mut fine, &Vector1::new(x0), &vector![], &Vector1::new(p), h, &exact)?;
/// println!("{report}");
/// let deviation = &report.wrong[0];
/// assert!(!report.passed() && (deviation.expected - deviation.value - 1e-6).abs() < 1e-9);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Deviation {
    /// The compared quantity.
    pub quantity: &'static str,
    /// The reference.
    pub reference: &'static str,
    /// The entry: equations and variables by name.
    pub entry: String,
    /// The index of the point.
    pub point: usize,
    /// The value.
    pub value: f64,
    /// The expected value.
    pub expected: f64,
    /// The tolerance of the difference.
    pub tolerance: f64,
}

/// An entry to be compared.
pub(super) struct Entry {
    pub value: f64,
    pub expected: f64,
    pub tolerance: f64,
}

impl Report {
    pub(super) fn new(title: String) -> Self {
        Self { title, rows: Vec::new(), wrong: Vec::new(), warnings: Vec::new() }
    }

    /// Whether no entry is wrong, and every row has a conclusive entry.
    #[must_use]
    pub fn passed(&self) -> bool {
        !self.rows.is_empty()
            && self
                .rows
                .iter()
                .all(|row| row.wrong == 0 && (row.entries == 0 || row.inconclusive < row.entries))
    }

    /// Panics with the report if an entry is wrong.
    #[track_caller]
    pub fn assert(&self) {
        assert!(self.passed(), "{self}");
    }

    /// Compares entries. `scale` is the largest entry; `name` returns the name of an index.
    pub(super) fn compare(
        &mut self,
        quantity: &'static str,
        reference: &'static str,
        point: usize,
        scale: f64,
        entries: impl Iterator<Item = (usize, Entry)>,
        name: impl Fn(usize) -> String,
    ) {
        let known = self.rows.iter().position(|r| r.quantity == quantity && r.reference == reference);
        let index = known.unwrap_or_else(|| {
            self.rows.push(Row {
                quantity,
                reference,
                entries: 0,
                inconclusive: 0,
                wrong: 0,
                difference: 0.0,
                ratio: 0.0,
                tolerance: 0.0,
                scale: 0.0,
            });
            self.rows.len() - 1
        });
        let row = &mut self.rows[index];
        row.scale = row.scale.max(scale);
        for (i, entry) in entries {
            row.entries += 1;
            let Entry { value, expected, tolerance } = entry;
            let difference = (value - expected).abs();
            if (!value.is_finite() && !expected.is_finite()) || !tolerance.is_finite() {
                row.inconclusive += 1;
                continue;
            }
            row.tolerance = row.tolerance.max(tolerance);
            // NaN is wrong.
            if difference <= tolerance {
                let silent = tolerance > 1e-3 * scale.max(expected.abs());
                row.inconclusive += usize::from(silent && difference != 0.0);
                row.difference = row.difference.max(difference);
                if tolerance > 0.0 {
                    row.ratio = row.ratio.max(difference / tolerance);
                }
            } else {
                row.wrong += 1;
                row.difference = nan_max(row.difference, difference);
                row.ratio = nan_max(row.ratio, difference / tolerance);
                if self.wrong.len() < MAX_LISTED_ENTRIES {
                    self.wrong.push(Deviation {
                        quantity,
                        reference,
                        entry: name(i),
                        point,
                        value,
                        expected,
                        tolerance,
                    });
                }
            }
        }
    }
}

/// The larger one; NaN is the largest.
fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.title)?;
        writeln!(
            f,
            "{:<24} {:<18} {:>8} {:>12} {:>6} {:>9} {:>9} {:>9} {:>9}",
            "quantity",
            "reference",
            "entries",
            "inconclusive",
            "failed",
            "largest",
            "max |Δ|",
            "max tol",
            "|Δ|/tol"
        )?;
        for row in &self.rows {
            writeln!(
                f,
                "{:<24} {:<18} {:>8} {:>12} {:>6} {:>9.1e} {:>9.1e} {:>9.1e} {:>9.1e}",
                row.quantity,
                row.reference,
                row.entries,
                row.inconclusive,
                row.wrong,
                row.scale,
                row.difference,
                row.tolerance,
                row.ratio
            )?;
        }
        for wrong in &self.wrong {
            writeln!(
                f,
                "failed: {} {} is {:.17e}, {} gives {:.17e}: difference {:.1e}, tolerance {:.1e} (point {})",
                wrong.quantity,
                wrong.entry,
                wrong.value,
                wrong.reference,
                wrong.expected,
                (wrong.value - wrong.expected).abs(),
                wrong.tolerance,
                wrong.point
            )?;
        }
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        let total: usize = self.rows.iter().map(|row| row.wrong).sum();
        if total > self.wrong.len() {
            writeln!(f, "... and {} more", total - self.wrong.len())?;
        }
        if total == 0 && !self.passed() {
            writeln!(f, "nothing was compared: no entry is finite, or no tolerance is small")?;
        }
        Ok(())
    }
}
