//! Second derivatives with respect to `(x₀, u, p)` in the layout of integrators: the blocks `xx`,
//! `xu`, `uu`, `xp`, `up` and `pp`, one after the other, each in column-major order.

/// The layout of the blocks, for these numbers of states, controls and parameters.
#[derive(Clone, Copy, Debug)]
pub struct Blocks(pub [usize; 3]);

impl Blocks {
    /// The number of elements.
    pub fn len(self) -> usize {
        self.offset(0, 3)
    }

    /// The offset of the block of two kinds, in order.
    fn offset(self, one: usize, two: usize) -> usize {
        let Self(sizes) = self;
        let columns = (0..two).flat_map(|column| (0..=column).map(move |row| (row, column)));
        let before = columns.chain((0..one).map(|row| (row, two)));
        before.map(|(row, column)| sizes[row] * sizes.get(column).copied().unwrap_or(0)).sum()
    }

    /// The offset of the derivatives with respect to two kinds of variables, and the strides of
    /// rows and of columns.
    pub fn block_layout(self, row: usize, column: usize) -> [usize; 3] {
        let Self(sizes) = self;
        if row <= column {
            [self.offset(row, column), 1, sizes[row]]
        } else {
            [self.offset(column, row), sizes[column], 1]
        }
    }

    /// The index of the derivative with respect to two directions.
    pub fn index(self, row: usize, column: usize) -> usize {
        let [(one, i), (two, j)] = [self.kind(row), self.kind(column)];
        let [first, of_rows, of_columns] = self.block_layout(one, two);
        first + of_rows * i + of_columns * j
    }

    /// The kind of a direction, and its index in that kind.
    fn kind(self, direction: usize) -> (usize, usize) {
        let Self([nx, nu, _]) = self;
        match direction {
            _ if direction < nx => (0, direction),
            _ if direction < nx + nu => (1, direction - nx),
            _ => (2, direction - nx - nu),
        }
    }
}
