//! Matrices of a problem as sums of numbers of its stages: the lists by which they are written.

use super::sparsity::Sparsity;
use crate::qp::QpView;
use alloc::vec::Vec;

/// A number that is added to an entry: where it is in the matrix of a stage, or its value.
#[derive(Clone, Copy, Debug)]
pub enum Slot {
    /// A number of the matrix of a stage.
    Entry {
        /// The stage.
        stage: usize,
        /// The place in its matrix.
        index: usize,
    },
    /// A constant.
    Constant(f64),
}

/// A number that is added to an entry, with the row and the column of this.
pub type Term = ([usize; 2], Slot);

/// A matrix as a sum: what is added to which entry.
#[derive(Debug, Default)]
pub struct Entries {
    /// The entries.
    pub sparsity: Sparsity,
    /// Numbers of the matrices of each stage.
    stages: Vec<Vec<Run>>,
    constants: Vec<(u32, f64)>,
}

/// Entries one behind the other, whose numbers are at equal distances.
#[derive(Debug)]
struct Run {
    /// The first entry.
    entry: u32,
    /// Where its number is.
    place: u32,
    /// How far the next one is.
    stride: u32,
    count: u32,
    /// Whether these entries have numbers of earlier stages, to which these are added.
    adds: bool,
}

impl Run {
    /// Takes the next entry, if it is where the run goes on.
    fn take(&mut self, entry: u32, place: u32, adds: bool) -> bool {
        let Some(stride) = place.checked_sub(self.place + self.stride * (self.count - 1)) else {
            return false;
        };
        let goes_on = self.entry + self.count == entry && self.adds == adds;
        if !goes_on || stride == 0 || self.count > 1 && stride != self.stride {
            return false;
        }
        (self.stride, self.count) = (stride, self.count + 1);
        true
    }
}

impl Entries {
    /// The matrix of these terms.
    pub fn new(rows: usize, columns: usize, mut terms: Vec<Term>) -> Self {
        // Constants behind the numbers of stages, which are in order.
        terms.sort_by_key(|&([row, column], slot)| (column, row, matches!(slot, Slot::Constant(_))));
        let mut entries: Vec<(usize, usize)> = Vec::new();
        let (mut stages, mut constants) = (Vec::<Vec<Run>>::new(), Vec::new());
        for ([row, column], slot) in terms {
            let adds = entries.last() == Some(&(row, column));
            if !adds {
                entries.push((row, column));
            }
            let entry = entries.len() as u32 - 1;
            match slot {
                Slot::Entry { stage, index } => {
                    if stages.len() <= stage {
                        stages.resize_with(stage + 1, Vec::new);
                    }
                    let (runs, place) = (&mut stages[stage], index as u32);
                    if !runs.last_mut().is_some_and(|run| run.take(entry, place, adds)) {
                        runs.push(Run { entry, place, stride: 1, count: 1, adds });
                    }
                }
                Slot::Constant(value) => constants.push((entry, value)),
            }
        }
        let sparsity = Sparsity::from_entries(rows, columns, entries);
        Self { sparsity, stages, constants }
    }

    /// The values of the entries, times `factor`, out of the matrices of the stages: the rows of
    /// constraints or the Hessian, as `choose` says.
    pub fn write<'a>(
        &self,
        qp: &QpView<'a, f64>,
        choose: impl Fn((&'a [f64], &'a [f64])) -> &'a [f64],
        factor: f64,
        to: &mut [f64],
    ) {
        for &(entry, _) in &self.constants {
            to[entry as usize] = 0.0;
        }
        for (stage, runs) in qp.stages().zip(&self.stages) {
            let arrays = stage.arrays();
            let matrix = choose((arrays.matrix, arrays.hessian));
            for &Run { entry, place, stride, count, adds } in runs {
                let to = &mut to[entry as usize..(entry + count) as usize];
                let from = matrix[place as usize..].iter().step_by(stride as usize);
                if adds {
                    to.iter_mut().zip(from).for_each(|(to, from)| *to += factor * from);
                } else {
                    to.iter_mut().zip(from).for_each(|(to, from)| *to = factor * from);
                }
            }
        }
        for &(entry, value) in &self.constants {
            to[entry as usize] += factor * value;
        }
    }
}
