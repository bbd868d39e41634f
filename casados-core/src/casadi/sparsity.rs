//! Sparsity patterns of matrices in CasADi's format, and as dependences of an integrator.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

/// Structural non-zeros of a matrix in CasADi's compressed column format: numbers of rows and
/// columns, offsets of the columns and the number of non-zeros, rows; for a dense matrix both
/// numbers and a one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sparsity {
    compressed: Vec<i64>,
    /// `(row, column)`, column by column.
    entries: Vec<(usize, usize)>,
}

impl Sparsity {
    /// The pattern of the entries for which `is_entry` holds.
    pub fn new(rows: usize, columns: usize, is_entry: impl Fn(usize, usize) -> bool) -> Self {
        let all = (0..columns).flat_map(|column| (0..rows).map(move |row| (row, column)));
        Self::from_entries(rows, columns, all.filter(|&(row, column)| is_entry(row, column)).collect())
    }

    /// The pattern of these entries, in column-major order.
    pub fn from_entries(rows: usize, columns: usize, entries: Vec<(usize, usize)>) -> Self {
        let mut compressed = vec![rows as i64, columns as i64];
        if entries.len() == rows * columns && !entries.is_empty() {
            compressed.push(1);
        } else {
            let mut begin = 0;
            for column in 0..=columns {
                begin += entries[begin..].iter().take_while(|entry| entry.1 < column).count();
                compressed.push(begin as i64);
            }
            compressed.extend(entries.iter().map(|&(row, _)| row as i64));
        }
        Self { compressed, entries }
    }

    /// The pattern of a dense vector.
    pub fn vector(rows: usize) -> Self {
        Self::new(rows, 1, |_, _| true)
    }

    /// The pattern of a zero matrix.
    pub fn zero(rows: usize, columns: usize) -> Self {
        Self::new(rows, columns, |_, _| false)
    }

    /// The pattern of the transposed matrix, and the indices of its entries in this pattern.
    pub fn transposed(&self) -> (Self, Vec<usize>) {
        let [rows, columns] = self.dimensions();
        let mut order: Vec<usize> = (0..self.entries.len()).collect();
        order.sort_by_key(|&entry| self.entries[entry]);
        let entries = order.iter().map(|&entry| self.entries[entry]).collect();
        (Self::from_entries(columns, rows, swap_rows_and_columns(entries)), order)
    }

    /// The pattern of the symmetric matrix with this upper triangle, and the indices of its entries
    /// in this pattern.
    pub fn symmetric(&self) -> (Self, Vec<usize>) {
        let [rows, columns] = self.dimensions();
        let entries = self.entries.iter().enumerate();
        let mut both: Vec<((usize, usize), usize)> = entries
            .flat_map(|(entry, &(row, column))| [((column, row), entry), ((row, column), entry)])
            .collect();
        both.sort_unstable();
        both.dedup();
        let (entries, places) = both.into_iter().unzip();
        (Self::from_entries(rows, columns, swap_rows_and_columns(entries)), places)
    }

    /// A block-diagonal pattern with `count` copies of this one.
    pub fn diagonal(&self, count: usize) -> Self {
        let [rows, columns] = self.dimensions();
        let of = |k: usize| self.entries.iter().map(move |&(i, j)| (k * rows + i, k * columns + j));
        Self::from_entries(count * rows, count * columns, (0..count).flat_map(of).collect())
    }

    /// The numbers of rows and columns.
    pub fn dimensions(&self) -> [usize; 2] {
        [0, 1].map(|index| self.compressed.get(index).map_or(0, |&length| length as usize))
    }

    /// The pattern in CasADi's format.
    pub fn compressed(&self) -> &[i64] {
        &self.compressed
    }

    /// `(row, column)` of the entries in the order of their values.
    pub fn entries(&self) -> &[(usize, usize)] {
        &self.entries
    }
}

fn swap_rows_and_columns(entries: Vec<(usize, usize)>) -> Vec<(usize, usize)> {
    entries.into_iter().map(|(row, column)| (column, row)).collect()
}

/// The entries of a matrix that may be non-zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dependence {
    columns: usize,
    related: Vec<bool>,
}

impl Dependence {
    /// A zero matrix.
    pub fn zero(rows: usize, columns: usize) -> Self {
        Self { columns, related: vec![false; rows * columns] }
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.related.len().checked_div(self.columns).unwrap_or(0)
    }

    /// Marks a row as dense.
    pub fn fill(&mut self, row: usize) {
        if let Some(related) = self.related.get_mut(row * self.columns..(row + 1) * self.columns) {
            related.fill(true);
        }
    }

    /// Adds the products of the entries of two rows of `other`, in both orders.
    pub fn add_row_products(&mut self, other: &Self, one: usize, two: usize) {
        let columns = self.columns;
        for a in (0..columns).filter(|&a| other.contains(one, a)) {
            for b in (0..columns).filter(|&b| other.contains(two, b)) {
                self.set(a, b);
                self.set(b, a);
            }
        }
    }

    /// A row.
    pub fn row(&self, row: usize) -> &[bool] {
        self.related.get(row * self.columns..(row + 1) * self.columns).unwrap_or(&[])
    }

    /// Whether an entry may differ from zero.
    pub fn contains(&self, row: usize, column: usize) -> bool {
        self.row(row).get(column).copied().unwrap_or(false)
    }

    /// Marks an entry as possibly non-zero.
    pub fn set(&mut self, row: usize, column: usize) {
        if let Some(related) = self.related.get_mut(row * self.columns + column) {
            *related = true;
        }
    }

    /// Adds the entries of `row` of `other` to the row `to`; returns whether an entry is new.
    pub fn add_row(&mut self, to: usize, other: &Self, row: usize) -> bool {
        let mut news = false;
        let range = to * self.columns..(to + 1) * self.columns;
        let Some(related) = self.related.get_mut(range) else { return false };
        for (to, from) in related.iter_mut().zip(other.row(row)) {
            news |= *from && !*to;
            *to |= *from;
        }
        news
    }

    /// The pattern of a block.
    pub fn block(&self, rows: Range<usize>, columns: Range<usize>) -> Sparsity {
        Sparsity::new(rows.len(), columns.len(), |row, column| {
            self.contains(rows.start + row, columns.start + column)
        })
    }

    /// The pattern of a transposed block: `columns` are its rows.
    pub fn transposed_block(&self, rows: Range<usize>, columns: Range<usize>) -> Sparsity {
        Sparsity::new(columns.len(), rows.len(), |row, column| {
            self.contains(rows.start + column, columns.start + row)
        })
    }
}
