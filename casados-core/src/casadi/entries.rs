//! The matrices of a problem as sums of entries of its stages.

use super::sparsity::Sparsity;
use alloc::vec::Vec;

/// A term of an entry: the position of a number in a stage, or a constant.
#[derive(Clone, Copy, Debug)]
pub enum EntryTerm {
    /// A number in a block of an interval.
    Interval {
        /// The stage at the start of the interval.
        stage: usize,
        /// The block: see [`Blocks`].
        block: usize,
        /// The index in the block.
        index: usize,
    },
    /// A number in the matrix of a node.
    Node {
        /// The stage.
        stage: usize,
        /// The index in its matrix.
        index: usize,
    },
    /// A constant.
    Constant(f64),
}

/// The derivatives of an interval in column-major order: those of its end with respect to `x` and
/// `u`, and the blocks `xx`, `xu` and `uu` of second derivatives. Derivatives that were not
/// requested are empty.
pub type Blocks<'a> = [&'a [f64]; 5];

/// A term with the row and the column of its entry.
pub type Term = ([usize; 2], EntryTerm);

/// A matrix as a sum of terms: first those of all intervals, then those of nodes and constants.
#[derive(Debug, Default)]
pub struct MatrixSum {
    /// The sparsity pattern.
    pub sparsity: Sparsity,
    /// The terms of each interval.
    intervals: Vec<Vec<StridedEntries>>,
    /// The terms of the matrix at each node.
    nodes: Vec<Vec<StridedEntries>>,
    constants: Vec<Constant>,
}

/// Successive entries whose numbers are at equal distances.
#[derive(Debug)]
struct StridedEntries {
    /// The first entry.
    entry: u32,
    /// The position of its number.
    block: u32,
    place: u32,
    /// The distance to the next number.
    stride: u32,
    count: u32,
    /// Whether the numbers are added to earlier terms.
    adds: bool,
}

/// An entry with a constant, alone or besides other terms.
#[derive(Debug)]
struct Constant {
    entry: u32,
    value: f64,
    adds: bool,
}

impl StridedEntries {
    /// Appends the next entry, if it continues the run.
    fn try_append(&mut self, next: &Self) -> bool {
        let Some(stride) = next.place.checked_sub(self.place + self.stride * (self.count - 1)) else {
            return false;
        };
        let goes_on = self.entry + self.count == next.entry && self.block == next.block;
        if !goes_on || self.adds != next.adds || stride == 0 || self.count > 1 && stride != self.stride {
            return false;
        }
        (self.stride, self.count) = (stride, self.count + 1);
        true
    }

    /// Writes the entries, `factor` times numbers of the block.
    fn write(&self, block: &[f64], factor: f64, to: &mut [f64]) {
        let &Self { entry, place, stride, count, adds, .. } = self;
        let to = &mut to[entry as usize..(entry + count) as usize];
        let (place, stride) = (place as usize, stride as usize);
        let from = block.get(place..).unwrap_or_default();
        if !adds && from.is_empty() {
            to.fill(0.0);
        } else if stride == 1 && !adds {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = factor * from);
        } else if adds {
            to.iter_mut().zip(from.iter().step_by(stride)).for_each(|(to, from)| *to += factor * from);
        } else {
            to.iter_mut().zip(from.iter().step_by(stride)).for_each(|(to, from)| *to = factor * from);
        }
    }
}

impl MatrixSum {
    /// The matrix with these terms.
    pub fn new(rows: usize, columns: usize, mut terms: Vec<Term>) -> Self {
        let rank = |slot| match slot {
            EntryTerm::Interval { .. } => 0,
            EntryTerm::Node { .. } => 1,
            EntryTerm::Constant(_) => 2,
        };
        // The order of stages is kept.
        terms.sort_by_key(|&([row, column], slot)| (column, row, rank(slot)));
        let mut entries: Vec<(usize, usize)> = Vec::new();
        let mut matrix = Self::default();
        for ([row, column], slot) in terms {
            let adds = entries.last() == Some(&(row, column));
            if !adds {
                entries.push((row, column));
            }
            let entry = entries.len() as u32 - 1;
            let (list, stage, [block, index]) = match slot {
                EntryTerm::Interval { stage, block, index } => (&mut matrix.intervals, stage, [block, index]),
                EntryTerm::Node { stage, index } => (&mut matrix.nodes, stage, [0, index]),
                EntryTerm::Constant(value) => {
                    matrix.constants.push(Constant { entry, value, adds });
                    continue;
                }
            };
            if list.len() <= stage {
                list.resize_with(stage + 1, Vec::new);
            }
            let run =
                StridedEntries { entry, block: block as u32, place: index as u32, stride: 1, count: 1, adds };
            if !list[stage].last_mut().is_some_and(|last| last.try_append(&run)) {
                list[stage].push(run);
            }
        }
        matrix.sparsity = Sparsity::from_entries(rows, columns, entries);
        matrix
    }

    /// Writes the terms of an interval, times `factor`.
    pub fn write_interval(&self, stage: usize, blocks: &Blocks<'_>, factor: f64, to: &mut [f64]) {
        for run in self.intervals.get(stage).into_iter().flatten() {
            run.write(blocks.get(run.block as usize).copied().unwrap_or_default(), factor, to);
        }
    }

    /// Adds the terms of the matrices at all nodes and the constants, times `factor`, after those
    /// of intervals.
    pub fn write_nodes<'a>(&self, matrices: impl Iterator<Item = &'a [f64]>, factor: f64, to: &mut [f64]) {
        for (matrix, runs) in matrices.zip(&self.nodes) {
            runs.iter().for_each(|run| run.write(matrix, factor, to));
        }
        for &Constant { entry, value, adds } in &self.constants {
            let to = &mut to[entry as usize];
            *to = factor * value + if adds { *to } else { 0.0 };
        }
    }

    /// Sets the terms of the matrix at a node to zero.
    pub fn zero_node_terms(&self, stage: usize, matrix: &mut [f64]) {
        for &StridedEntries { place, stride, count, .. } in self.nodes.get(stage).into_iter().flatten() {
            let places = matrix[place as usize..].iter_mut().step_by(stride as usize);
            places.take(count as usize).for_each(|number| *number = 0.0);
        }
    }
}
