//! The elimination order of the Newton matrix, chosen at compile time.
//!
//! Ordered by variable, the Newton matrix of any Runge-Kutta method has the pattern of
//! `f_ẋ ∪ f_x ∪ f_z`, with s×s blocks as entries. If the stages share one Jacobian, block
//! elimination decouples in the eigenbasis of A: it is the scalar elimination of `f_ẋ + hμ f_x` for
//! every eigenvalue `μ` of A. Pivots are therefore tested on such complex matrices, at many points
//! of the model and many values of `hμ`: a pivot has to be acceptable at all of them. Among the
//! acceptable ones the Markowitz cost decides.
//!
//! One of the points is at rest: all states are zero. Models often start there, and entries that
//! vanish there (the sine of an angle) must not be pivots. If the matrix itself is singular at
//! rest, this point is ignored for the columns that vanish.

use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap};

/// A structural non-zero of the Newton matrix with its values at the samples.
#[derive(Clone, Debug)]
pub struct Entry {
    pub row: u32,
    pub column: u32,
    pub values: Vec<Complex>,
    /// Whether the block is a constant multiple of the identity, a pivot without cost.
    pub trivial: bool,
}

/// The positions of the elimination: the tables of `casados_core::model::Elimination`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The row and column of each pivot, in order.
    pub pivots: Vec<(u32, u32)>,
    /// The offsets of the blocks of each pivot: the pivot itself (`L` follows it), `U`, and the
    /// end.
    pub ranges: Vec<[u32; 3]>,
    /// The row and column of each block of the factors, fill included.
    pub blocks: Vec<(u32, u32)>,
    /// For every pivot, for every block of `L`, for every block of `U`: the block that is updated.
    pub updates: Vec<u32>,
}

/// A complex number of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex {
    pub re: f64,
    pub im: f64,
}

impl Complex {
    pub fn abs(self) -> f64 {
        self.re.hypot(self.im)
    }
    pub fn times(self, b: Self) -> Self {
        Self { re: self.re * b.re - self.im * b.im, im: self.re * b.im + self.im * b.re }
    }
    fn minus(self, b: Self) -> Self {
        Self { re: self.re - b.re, im: self.im - b.im }
    }
    fn divide(self, b: Self) -> Self {
        let d = b.re * b.re + b.im * b.im;
        Self { re: (self.re * b.re + self.im * b.im) / d, im: (self.im * b.re - self.re * b.im) / d }
    }
}

/// Pivot thresholds: a pivot is acceptable if at every sample it is at least this fraction of the
/// largest entry of its column (rows scaled to a largest entry of one).
const PIVOT_THRESHOLDS: [f64; 4] = [0.1, 1e-2, 1e-4, 0.0];

/// A column vanishes at rest if all its entries are below this, with rows scaled to a largest entry
/// of one: the matrix is singular there.
const VANISHING_COLUMN_TOLERANCE: f64 = 1e-10;

/// The matrix during elimination.
struct ActiveMatrix {
    /// By row, by column: the values at the samples, and whether the block is trivial.
    rows: Vec<BTreeMap<u32, (Vec<Complex>, bool)>>,
    /// The rows with an entry in each column.
    columns: Vec<Vec<u32>>,
    eliminated_rows: Vec<bool>,
    eliminated_columns: Vec<bool>,
    /// 1 / largest entry of each row at each sample, at the start.
    scales: Vec<Vec<f64>>,
    /// The length of the chain of pivots on which each row depends.
    depths: Vec<u32>,
    /// The index of the first sample at rest.
    at_rest: usize,
}

impl ActiveMatrix {
    fn new(size: usize, entries: &[Entry], at_rest: usize) -> Self {
        let samples = entries.first().map_or(0, |e| e.values.len());
        let mut active = Self {
            rows: vec![BTreeMap::new(); size],
            columns: vec![Vec::new(); size],
            eliminated_rows: vec![false; size],
            eliminated_columns: vec![false; size],
            scales: vec![vec![0.0; samples]; size],
            depths: vec![0; size],
            at_rest: samples.saturating_sub(at_rest),
        };
        for entry in entries {
            active.rows[entry.row as usize].insert(entry.column, (entry.values.clone(), entry.trivial));
            active.columns[entry.column as usize].push(entry.row);
            for (scale, value) in active.scales[entry.row as usize].iter_mut().zip(&entry.values) {
                *scale = scale.max(value.abs());
            }
        }
        for scale in active.scales.iter_mut().flatten() {
            *scale = if *scale > 0.0 { 1.0 / *scale } else { 1.0 };
        }
        active
    }

    /// The smallest ratio over the samples of an entry to the largest one of its column.
    fn quality(&self, row: usize, column: u32) -> f64 {
        let (values, _) = &self.rows[row][&column];
        let mut worst = f64::INFINITY;
        for (k, value) in values.iter().enumerate() {
            let own = value.abs() * self.scales[row][k];
            let largest = self.columns[column as usize]
                .iter()
                .map(|&r| self.rows[r as usize][&column].0[k].abs() * self.scales[r as usize][k])
                .fold(0.0, f64::max);
            if k >= self.at_rest && !(largest > VANISHING_COLUMN_TOLERANCE && largest.is_finite()) {
                continue;
            }
            // A column that vanishes, or an entry that is tiny in its own row, is no pivot either.
            let ratio = if largest > 0.0 { own / largest } else { 0.0 };
            worst = worst.min(ratio.min(own * 1e3));
            if !worst.is_finite() {
                return 0.0;
            }
        }
        worst
    }

    /// The cheapest acceptable pivot: smallest Markowitz cost, trivial blocks first, then the
    /// shortest chain of dependences (independent pivots overlap in the processor), then the first
    /// in order.
    fn choose(&self) -> Option<(u32, u32)> {
        let mut candidates: Vec<(u64, bool, u32, u32, u32)> = Vec::new();
        for (row, entries) in self.rows.iter().enumerate().filter(|(row, _)| !self.eliminated_rows[*row]) {
            for (&column, (_, trivial)) in entries {
                let cost = (entries.len() as u64 - 1) * (self.columns[column as usize].len() as u64 - 1);
                candidates.push((cost, !trivial, self.depths[row], row as u32, column));
            }
        }
        candidates.sort_unstable();
        for threshold in PIVOT_THRESHOLDS {
            // At the last threshold every non-zero pivot is acceptable: the best one.
            if threshold == 0.0 {
                return candidates
                    .iter()
                    .map(|&(.., r, c)| (self.quality(r as usize, c), r, c))
                    .max_by(|a, b| a.0.total_cmp(&b.0))
                    .map(|(_, r, c)| (r, c));
            }
            let good = candidates.iter().find(|&&(.., r, c)| self.quality(r as usize, c) >= threshold);
            if let Some(&(.., row, column)) = good {
                return Some((row, column));
            }
        }
        None
    }

    /// Eliminates with a pivot; returns the rows of its column (L) and the columns of its row (U).
    fn eliminate(&mut self, row: u32, column: u32) -> (Vec<u32>, Vec<u32>) {
        let pivot_row = std::mem::take(&mut self.rows[row as usize]);
        let pivot = pivot_row[&column].0.clone();
        let mut lower: Vec<u32> =
            self.columns[column as usize].iter().copied().filter(|&r| r != row).collect();
        lower.sort_unstable();
        let upper: Vec<u32> = pivot_row.keys().copied().filter(|&c| c != column).collect();
        let depth = self.depths[row as usize] + 1;
        for &r in &lower {
            self.depths[r as usize] = self.depths[r as usize].max(depth);
            let Some((factor, _)) = self.rows[r as usize].remove(&column) else { continue };
            for &c in &upper {
                let samples = pivot.len();
                let target = self.rows[r as usize].entry(c).or_insert_with(|| {
                    self.columns[c as usize].push(r);
                    (vec![Complex::default(); samples], false)
                });
                target.1 = false;
                for k in 0..samples {
                    let change = factor[k].divide(pivot[k]).times(pivot_row[&c].0[k]);
                    target.0[k] = target.0[k].minus(change);
                }
            }
        }
        for &c in &upper {
            self.columns[c as usize].retain(|&r| r != row);
        }
        self.columns[column as usize].clear();
        self.eliminated_rows[row as usize] = true;
        self.eliminated_columns[column as usize] = true;
        (lower, upper)
    }
}

/// Maximum number of updates of a plan, the size of a table; a full matrix of 66 equations has as
/// many. Larger models have no plan, and the engine factorises the whole matrix with pivoting.
const MAX_UPDATES: usize = 100_000;

/// The plan for a matrix of `size` equations and unknowns, whose last `at_rest` samples are at
/// rest; empty if it would be too long.
pub fn plan(size: usize, entries: &[Entry], at_rest: usize) -> Plan {
    let mut active = ActiveMatrix::new(size, entries, at_rest);
    let mut steps = Vec::with_capacity(size);
    let mut updates = 0;
    for _ in 0..size {
        let Some((row, column)) = active.choose() else { break };
        let (lower, upper) = active.eliminate(row, column);
        updates += lower.len() * upper.len();
        if updates > MAX_UPDATES {
            return Plan::default();
        }
        steps.push((row, column, lower, upper));
    }
    sort_rows(&mut steps);
    number_blocks(&steps)
}

type Step = (u32, u32, Vec<u32>, Vec<u32>);

/// Sorts the rows of every step by their order of elimination, so that the next pivot is updated
/// first, and the columns in the opposite order, so that in the back substitution the last computed
/// unknown comes last and does not delay the rest of the sum.
fn sort_rows(steps: &mut [Step]) {
    let rows: HashMap<u32, usize> = steps.iter().enumerate().map(|(k, step)| (step.0, k)).collect();
    let columns: HashMap<u32, usize> = steps.iter().enumerate().map(|(k, step)| (step.1, k)).collect();
    for (_, _, lower, upper) in steps {
        lower.sort_by_key(|row| rows.get(row));
        upper.sort_by_key(|column| Reverse(columns.get(column)));
    }
}

/// Numbers the blocks pivot by pivot, and finds the block of every update.
fn number_blocks(steps: &[Step]) -> Plan {
    let mut plan = Plan::default();
    for (row, column, lower, upper) in steps {
        let begin = plan.blocks.len() as u32;
        plan.pivots.push((*row, *column));
        plan.blocks.push((*row, *column));
        plan.blocks.extend(lower.iter().map(|&r| (r, *column)));
        let middle = plan.blocks.len() as u32;
        plan.blocks.extend(upper.iter().map(|&c| (*row, c)));
        plan.ranges.push([begin, middle, plan.blocks.len() as u32]);
    }
    let number: HashMap<_, _> = plan.blocks.iter().zip(0..).map(|(&position, k)| (position, k)).collect();
    plan.updates = steps
        .iter()
        .flat_map(|(_, _, lower, upper)| lower.iter().flat_map(|&r| upper.iter().map(move |&c| (r, c))))
        .map(|position| number[&position])
        .collect();
    plan
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(row: u32, column: u32, values: &[f64]) -> Entry {
        let values = values.iter().map(|&re| Complex { re, im: 0.0 }).collect();
        Entry { row, column, values, trivial: false }
    }

    /// The residual of `P A Q = (I + L)(P + U)` at the first sample, by the tables of the plan.
    fn reconstruction_error(size: usize, entries: &[Entry], plan: &Plan) -> f64 {
        let mut blocks: HashMap<(u32, u32), f64> = plan.blocks.iter().map(|&at| (at, 0.0)).collect();
        for entry in entries {
            *blocks.get_mut(&(entry.row, entry.column)).expect("the plan has every entry") =
                entry.values[0].re;
        }
        let mut updates = plan.updates.iter();
        for &[begin, upper, end] in &plan.ranges {
            let at = |index: u32| plan.blocks[index as usize];
            for lower in begin + 1..upper {
                *blocks.get_mut(&at(lower)).unwrap() /= blocks[&at(begin)];
                for u in upper..end {
                    let change = blocks[&at(lower)] * blocks[&at(u)];
                    *blocks.get_mut(&at(*updates.next().expect("one update for each pair"))).unwrap() -=
                        change;
                }
            }
        }
        assert_eq!(updates.next(), None);
        // The solution of A x = A · 1, by the factors.
        let mut b = vec![0.0; size];
        entries.iter().for_each(|entry| b[entry.row as usize] += entry.values[0].re);
        for (&(row, _), &[begin, upper, _]) in plan.pivots.iter().zip(&plan.ranges) {
            for lower in begin + 1..upper {
                let (r, c) = plan.blocks[lower as usize];
                b[r as usize] -= blocks[&(r, c)] * b[row as usize];
            }
        }
        let mut x = vec![0.0; size];
        for (&(row, column), &[_, upper, end]) in plan.pivots.iter().zip(&plan.ranges).rev() {
            let mut sum = b[row as usize];
            for u in upper..end {
                let (r, c) = plan.blocks[u as usize];
                sum -= blocks[&(r, c)] * x[c as usize];
            }
            x[column as usize] = sum / blocks[&(row, column)];
        }
        x.iter().map(|x| (x - 1.0).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn factors_by_the_plan_solve_the_system() {
        // A band of width five with a full last row and column, diagonally dominant: its condition
        // number is about ten.
        let n = 30u32;
        let mut entries = Vec::new();
        for r in 0..n {
            for c in 0..n {
                if r.abs_diff(c) <= 2 || r + 1 == n || c + 1 == n {
                    let value = if r == c { 40.0 } else { f64::from((3 * r + 7 * c) % 5) - 1.5 };
                    entries.push(entry(r, c, &[value]));
                }
            }
        }
        let plan = plan(n as usize, &entries, 0);
        assert!(reconstruction_error(n as usize, &entries, &plan) < 1e-13);
        // The full row and column are last, so that there is hardly any fill.
        assert!(plan.blocks.len() <= entries.len() + 2, "{} of {}", plan.blocks.len(), entries.len());
    }

    #[test]
    fn a_pivot_that_vanishes_at_one_sample_is_not_taken() {
        // By cost alone (0, 0) and (1, 1) are equal; each vanishes at one of the samples.
        let entries = [
            entry(0, 0, &[0.0, 1.0, 1.0]),
            entry(0, 1, &[1.0, 1.0, 1.0]),
            entry(1, 0, &[1.0, 1.0, 1.0]),
            entry(1, 1, &[0.5, 0.0, 0.5]),
        ];
        let plan = plan(2, &entries, 0);
        assert!(matches!(plan.pivots[0], (0, 1) | (1, 0)), "{:?}", plan.pivots);
    }

    /// A matrix like `[[sin x, cos x], [−1, 1]]`: the last sample is at rest.
    #[test]
    fn a_pivot_that_vanishes_at_rest_is_not_taken() {
        let moving = [
            entry(0, 0, &[0.8, 0.5]),
            entry(0, 1, &[0.6, 0.9]),
            entry(1, 0, &[1.0, 1.0]),
            entry(1, 1, &[0.6, 0.9]),
        ];
        let entries = [
            entry(0, 0, &[0.8, 0.5, 0.0]),
            entry(0, 1, &[0.6, 0.9, 1.0]),
            entry(1, 0, &[1.0, 1.0, 1.0]),
            entry(1, 1, &[0.6, 0.9, 1.0]),
        ];
        assert_ne!(plan(2, &entries, 1).pivots[0], (0, 0));
        // If the matrix is singular at rest, the plan is that without this sample.
        let singular = [
            entry(0, 0, &[0.8, 0.5, 0.0]),
            entry(0, 1, &[0.6, 0.9, 0.0]),
            entry(1, 0, &[1.0, 1.0, 0.0]),
            entry(1, 1, &[0.6, 0.9, 0.0]),
        ];
        assert_eq!(plan(2, &singular, 1), plan(2, &moving, 0));
    }

    #[test]
    fn rows_of_any_scale_have_the_same_plan() {
        let make = |scale: f64| {
            [
                entry(0, 0, &[1.0 * scale, 2.0 * scale]),
                entry(0, 1, &[3.0 * scale, 1.0 * scale]),
                entry(1, 0, &[2.0, 1.0]),
                entry(1, 1, &[0.1, 4.0]),
                entry(1, 2, &[1.0, 1.0]),
                entry(2, 2, &[1.0, 2.0]),
            ]
        };
        assert_eq!(plan(3, &make(1.0), 0), plan(3, &make(1e-150), 0));
        assert_eq!(plan(3, &make(1.0), 0), plan(3, &make(1e150), 0));
    }

    #[test]
    fn nothing_to_eliminate() {
        assert_eq!(plan(0, &[], 0), Plan { ..Plan::default() });
    }
}
