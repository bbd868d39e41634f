//! Supernodes: successive pivots with the same columns of `L` and rows of `U`, except for
//! themselves, whose indices are looked up once (J. W. H. Liu, E. G. Ng, B. W. Peyton, On finding
//! supernodes for sparse matrix computations, 1993).

use super::elimination::Plan;
use std::collections::HashMap;

/// Maximum number of pivots in a supernode.
const MAX_SUPERNODE: usize = 4;

/// The size of the supernode that starts at each pivot; zero within one.
pub fn find(plan: &Plan) -> Vec<u32> {
    let Plan { pivots, ranges, blocks, .. } = plan;
    // The blocks of `L`, row by row.
    let mut left: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[block, upper, _] in ranges {
        for index in block + 1..upper {
            left.entry(blocks[index as usize].0).or_default().push(index);
        }
    }
    let left = |row: u32| left.get(&row).map_or(&[][..], Vec::as_slice);
    let rows = |from: u32, to: u32| blocks[from as usize..to as usize].iter().map(|block| block.0);
    let columns = |from: u32, to: u32| blocks[from as usize..to as usize].iter().map(|block| block.1);
    let goes_on = |&first: &usize| {
        let ([row, next_row], [_, next_column]) =
            ([pivots[first].0, pivots[first + 1].0], [pivots[first].1, pivots[first + 1].1]);
        let ([block, upper, end], [next_block, next_upper, next_end]) = (ranges[first], ranges[first + 1]);
        let below = std::iter::once(next_row).chain(rows(next_block + 1, next_upper));
        let beside = columns(next_upper, next_end).chain(std::iter::once(next_column));
        // The blocks of a column that belong to these rows are contiguous.
        let before = left(row).iter().map(|index| index + 1).chain(std::iter::once(block + 1));
        rows(block + 1, upper).eq(below)
            && columns(upper, end).eq(beside)
            && left(next_row).iter().copied().eq(before)
    };
    let mut supernodes = vec![0; pivots.len()];
    let mut first = 0;
    while first < pivots.len() {
        let last = (pivots.len() - 1).min(first + MAX_SUPERNODE - 1);
        let more = (first..last).take_while(goes_on).count();
        supernodes[first] = more as u32 + 1;
        first += more + 1;
    }
    supernodes
}

#[cfg(test)]
mod tests {
    use super::super::elimination::{Complex, Entry, plan};
    use super::*;

    /// A diagonally dominant matrix with these entries.
    fn of(size: u32, is_entry: impl Fn(u32, u32) -> bool) -> Plan {
        let mut entries = Vec::new();
        for row in 0..size {
            for column in (0..size).filter(|&column| row == column || is_entry(row, column)) {
                let re = if row == column { 40.0 } else { 1.0 };
                entries.push(Entry { row, column, values: vec![Complex { re, im: 0.0 }], trivial: false });
            }
        }
        plan(size as usize, &entries, 0)
    }

    #[test]
    fn full_matrix_is_one_supernode() {
        assert_eq!(find(&of(3, |_, _| true)), [3, 0, 0]);
        assert_eq!(find(&of(6, |_, _| true)), [4, 0, 0, 0, 2, 0]);
    }

    #[test]
    fn diagonal_pivots_are_single() {
        let chain = of(12, |row, column| (row / 3).abs_diff(column / 3) <= 1);
        assert_eq!(find(&chain), [3, 0, 0, 3, 0, 0, 3, 0, 0, 3, 0, 0]);
        let lines = of(4, |row, column| row.abs_diff(column) == 1);
        assert_eq!(find(&lines)[..2], [1, 1]);
    }

    #[test]
    fn rows_have_the_same_blocks_before_them() {
        // Column 0 has an entry in row 1 only, and is first: rows 1 and 2 differ.
        let plan =
            of(4, |row, column| column == 3 || row == 3 || row * column == 2 || (row, column) == (1, 0));
        assert_eq!(plan.pivots, [(0, 0), (2, 2), (1, 1), (3, 3)]);
        assert_eq!(find(&plan), [1, 1, 2, 0]);
    }
}
