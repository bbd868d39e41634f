//! Dense patterns, in the order of [`Structure`](crate::model::Structure).

use crate::shape::Shape;

/// Rows and columns of all `N = NK (NV − 1)` entries of the Jacobian, block by block.
#[must_use]
pub const fn jacobian_pattern<M: Shape, const N: usize>() -> ([u32; N], [u32; N]) {
    let (mut rows, mut columns) = ([0; N], [0; N]);
    let widths = block_widths::<M>();
    let (mut entry, mut block, mut start) = (0, 0, 0);
    while block < 5 {
        let mut row = 0;
        while row < M::NK {
            let mut column = 0;
            while column < widths[block] {
                rows[entry] = row as u32;
                columns[entry] = (start + column) as u32;
                entry += 1;
                column += 1;
            }
            row += 1;
        }
        start += widths[block];
        block += 1;
    }
    (rows, columns)
}

/// Rows and columns of all `N = (NV − 1) NV / 2` entries of the lower triangle of the Hessian, row
/// by row.
#[must_use]
pub const fn hessian_pattern<const N: usize>() -> ([u32; N], [u32; N]) {
    let (mut rows, mut columns) = ([0; N], [0; N]);
    let (mut entry, mut row, mut column) = (0, 0, 0);
    while entry < N {
        rows[entry] = row;
        columns[entry] = column;
        entry += 1;
        column += 1;
        if column > row {
            row += 1;
            column = 0;
        }
    }
    (rows, columns)
}

/// The index of an entry in the Jacobian.
pub fn jacobian_entry<M: Shape>(row: usize, column: usize) -> usize {
    let mut start = 0;
    for width in block_widths::<M>() {
        if column < start + width {
            return M::NK * start + row * width + column - start;
        }
        start += width;
    }
    0
}

/// The index of the entry of two variables in the Hessian.
pub fn hessian_entry(a: usize, b: usize) -> usize {
    let (row, column) = if a < b { (b, a) } else { (a, b) };
    row * (row + 1) / 2 + column
}

/// The numbers of columns of the five blocks.
const fn block_widths<M: Shape>() -> [usize; 5] {
    [M::NX, M::NX, M::NZ, M::NU, M::NP]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Dims;

    #[test]
    fn positions_of_entries() {
        type Shape = Dims<2, 1, 3, 2, 3, 11, 7>;
        let (rows, columns) = jacobian_pattern::<Shape, 30>();
        for entry in 0..30 {
            assert_eq!(jacobian_entry::<Shape>(rows[entry] as usize, columns[entry] as usize), entry);
        }
        let (rows, columns) = hessian_pattern::<55>();
        for entry in 0..55 {
            let (row, column) = (rows[entry] as usize, columns[entry] as usize);
            assert!(column <= row && row < 10);
            assert_eq!(hessian_entry(row, column), entry);
            assert_eq!(hessian_entry(column, row), entry);
        }
    }
}
