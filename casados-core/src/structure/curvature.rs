//! Tables derived from the sparsity patterns, so that the engine does not search.

use super::Pattern;

/// No column: see [`Structure::column_of_direction`](super::Structure::column_of_direction).
pub const NO_COLUMN: u32 = u32::MAX;

/// A term of the product with the symmetric matrix `∇²(μᵀ f)`, whose lower triangle is given. Rows
/// and columns are positions in [`Structure::curved`](super::Structure::curved).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Term {
    /// The row.
    pub row: u32,
    /// The column.
    pub column: u32,
    /// Index of its value in the lower triangle.
    pub entry: u32,
    /// Number of rows, including this one, whose terms alternate, since they have the same columns.
    pub rows: u32,
}

/// The second derivative in a control or a parameter that occurs in no other second derivative. Its
/// row of `D_i` has one element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagonalControl {
    /// The diagonal entry of the Hessian.
    pub entry: u32,
    /// The direction.
    pub direction: u32,
}

/// Maximal number of rows with alternating terms; in firmware memory is scarcer than time.
pub const MAX_INTERLEAVED_ROWS: usize = if cfg!(feature = "std") { 3 } else { 1 };

/// Returns all `N` terms of the product with the symmetric matrix whose lower triangle has this
/// pattern, for the `C` variables `curved`; entries of other variables are omitted. Terms are in
/// row order, but the terms of rows with the same columns (such as those of the coordinates of a
/// point) alternate, so that the factor is loaded once.
#[must_use]
pub const fn symmetric<const C: usize, const N: usize>(hessian: &Pattern, curved: &[u32; C]) -> [Term; N] {
    let mut terms = [Term { row: 0, column: 0, entry: 0, rows: 1 }; N];
    // Position of the next term of each row.
    let mut next = [0; C];
    let mut entry = 0;
    while entry < hessian.len() {
        let (row, column) = hessian.at(entry);
        entry += 1;
        let (Some(row), Some(column)) = (position_in(curved, row), position_in(curved, column)) else {
            continue;
        };
        next[row] += 1;
        if row != column {
            next[column] += 1;
        }
    }
    let (mut row, mut sum) = (0, 0);
    while row < C {
        (next[row], sum) = (sum, sum + next[row]);
        row += 1;
    }
    assert!(sum == N, "N must be the number of entries of the symmetric matrix");
    let mut entry = 0;
    while entry < hessian.len() {
        let (row, column) = hessian.at(entry);
        let term = Term { row: 0, column: 0, entry: entry as u32, rows: 1 };
        entry += 1;
        let (Some(row), Some(column)) = (position_in(curved, row), position_in(curved, column)) else {
            continue;
        };
        terms[next[row]] = Term { row: row as u32, column: column as u32, ..term };
        next[row] += 1;
        if row != column {
            terms[next[column]] = Term { row: column as u32, column: row as u32, ..term };
            next[column] += 1;
        }
    }
    interleave_rows(&terms, &next)
}

/// Reorders terms in row order, with the given ends of the rows, so that the terms of rows with the
/// same columns alternate.
const fn interleave_rows<const C: usize, const N: usize>(by_row: &[Term; N], ends: &[usize; C]) -> [Term; N] {
    // Rows with the same columns are searched for among the following rows only.
    const MAX_LOOKAHEAD_ROWS: usize = 8;
    let (mut terms, mut place, mut done, mut row) = (*by_row, 0, [false; C], 0);
    while row < C {
        let (mut rows, mut count, mut other) = ([row; MAX_INTERLEAVED_ROWS], 0, row);
        while other < C && other < row + MAX_LOOKAHEAD_ROWS && count < MAX_INTERLEAVED_ROWS && !done[row] {
            if !done[other] && have_same_columns(by_row, row_range(ends, row), row_range(ends, other)) {
                rows[count] = other;
                count += 1;
            }
            other += 1;
        }
        let (mut term, [begin, end]) = (0, row_range(ends, row));
        while term < end - begin && count > 0 {
            let mut of = 0;
            while of < count {
                terms[place] = by_row[row_range(ends, rows[of])[0] + term];
                terms[place].rows = count as u32;
                (place, of) = (place + 1, of + 1);
            }
            term += 1;
        }
        while count > 0 {
            count -= 1;
            done[rows[count]] = true;
        }
        row += 1;
    }
    terms
}

/// The first and the last position of a row.
const fn row_range<const C: usize>(ends: &[usize; C], row: usize) -> [usize; 2] {
    [if row > 0 { ends[row - 1] } else { 0 }, ends[row]]
}

/// Whether two ranges of terms have the same columns.
const fn have_same_columns(terms: &[Term], [begin, end]: [usize; 2], [other, last]: [usize; 2]) -> bool {
    let mut term = 0;
    while term < end - begin
        && other + term < last
        && terms[begin + term].column == terms[other + term].column
    {
        term += 1;
    }
    begin + term == end && other + term == last
}

/// Returns the `N` entries of a Jacobian from `begin` on in column order, stable, for `V` columns.
#[must_use]
pub const fn by_column<const V: usize, const N: usize>(jacobian: &Pattern, begin: usize) -> [u32; N] {
    sort_entries::<V, N, true>(jacobian, begin)
}

/// Returns the first `N` entries of a Jacobian in row order, stable, for `R` rows.
#[must_use]
pub const fn by_row<const R: usize, const N: usize>(jacobian: &Pattern) -> [u32; N] {
    sort_entries::<R, N, false>(jacobian, 0)
}

/// Counting sort of entries by columns or rows, of which there are `K`.
const fn sort_entries<const K: usize, const N: usize, const COLUMNS: bool>(
    jacobian: &Pattern,
    begin: usize,
) -> [u32; N] {
    let (mut entries, mut next) = ([0; N], [0; K]);
    let mut entry = begin;
    while entry < begin + N {
        next[sort_key::<COLUMNS>(jacobian, entry)] += 1;
        entry += 1;
    }
    let (mut key, mut sum) = (0, 0);
    while key < K {
        (next[key], sum) = (sum, sum + next[key]);
        key += 1;
    }
    let mut entry = begin;
    while entry < begin + N {
        let key = self::sort_key::<COLUMNS>(jacobian, entry);
        entries[next[key]] = entry as u32;
        next[key] += 1;
        entry += 1;
    }
    entries
}

/// The column of an entry, or its row.
const fn sort_key<const COLUMN: bool>(jacobian: &Pattern, entry: usize) -> usize {
    let (row, column) = jacobian.at(entry);
    if COLUMN { column } else { row }
}

/// Returns the start of each of `N − 1` rows among entries in row order, and the end of the last
/// row.
#[must_use]
pub const fn begins<const N: usize>(jacobian: &Pattern, by_row: &[u32]) -> [u32; N] {
    let (mut begins, mut place, mut row) = ([0; N], 0, 0);
    while row < N {
        while place < by_row.len() && jacobian.at(by_row[place] as usize).0 < row {
            place += 1;
        }
        begins[row] = place as u32;
        row += 1;
    }
    begins
}

/// Returns the position of each of `N` directions among those with influence, or [`NO_COLUMN`].
#[must_use]
pub const fn columns<const N: usize>(directions: &[u32]) -> [u32; N] {
    let mut columns = [NO_COLUMN; N];
    let mut column = 0;
    while column < directions.len() {
        columns[directions[column] as usize] = column as u32;
        column += 1;
    }
    columns
}

/// The position of a number in an ascending list that contains it.
const fn position_in<const C: usize>(list: &[u32; C], number: usize) -> Option<usize> {
    let (mut low, mut high) = (0, C);
    while low + 1 < high {
        let middle = low.midpoint(high);
        if (list[middle] as usize) <= number {
            low = middle;
        } else {
            high = middle;
        }
    }
    if low < C && list[low] as usize == number { Some(low) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_of_the_symmetric_product() {
        // 3 7 9 with entries (3, 3), (7, 3), (9, 7), (9, 9).
        let hessian = Pattern { rows: &[3, 7, 9, 9], columns: &[3, 3, 7, 9] };
        let terms = symmetric::<3, 6>(&hessian, &[3, 7, 9]);
        let found = terms.map(|Term { row, column, entry, .. }| (row, column, entry));
        assert_eq!(found, [(0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 2, 2), (2, 1, 2), (2, 2, 3)]);
        assert!(terms.iter().all(|term| term.rows == 1));
    }

    #[test]
    fn rows_with_the_same_columns_alternate() {
        // All pairs of the first four, and the last one with itself; it is adjacent to them.
        let hessian =
            Pattern { rows: &[0, 1, 1, 2, 2, 2, 3, 3, 3, 3, 4], columns: &[0, 0, 1, 0, 1, 2, 0, 1, 2, 3, 4] };
        let terms = symmetric::<5, 17>(&hessian, &[0, 1, 2, 3, 4]);
        let row_of = |first: usize| terms[first..].iter().map(|term| term.row);
        if MAX_INTERLEAVED_ROWS == 1 {
            assert!(row_of(0).is_sorted());
            return;
        }
        assert!(row_of(0).take(12).eq([0, 1, 2].repeat(4)));
        assert!(row_of(12).eq([3, 3, 3, 3, 4]));
        assert!(terms.iter().map(|term| term.rows).eq([3; 12].into_iter().chain([1; 5])));
        assert!(terms.iter().map(|term| term.column).take(12).eq([0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]));
        let entry_of = |row: usize, column: usize| row * (row + 1) / 2 + column;
        for term in &terms[..16] {
            let [row, column] = [term.row, term.column].map(|index| index as usize);
            assert_eq!(term.entry as usize, entry_of(row.max(column), row.min(column)));
        }
    }

    #[test]
    fn entries_sorted_by_columns_and_by_rows() {
        // Two blocks, each in row order: (0, 4), (2, 3), (2, 4), and (0, 6), (2, 5), (2, 6).
        let jacobian = Pattern { rows: &[0, 2, 2, 0, 2, 2], columns: &[4, 3, 4, 6, 5, 6] };
        assert_eq!(by_column::<7, 6>(&jacobian, 0), [1, 0, 2, 4, 3, 5]);
        assert_eq!(by_column::<7, 3>(&jacobian, 3), [4, 3, 5]);
        let by_row = by_row::<3, 6>(&jacobian);
        assert_eq!(by_row, [0, 3, 1, 2, 4, 5]);
        // The second row is empty.
        assert_eq!(begins::<4>(&jacobian, &by_row), [0, 2, 2, 6]);
    }

    #[test]
    fn directions_without_influence_have_no_column() {
        assert_eq!(columns::<4>(&[0, 2, 3]), [0, NO_COLUMN, 1, 2]);
    }
}
