//! Second derivatives over `(x₀, u, p)` as integrators have them: the blocks `xx`, `xu`, `uu`,
//! `xp`, `up` and `pp`, one behind the other, each column by column.

/// Where the blocks are, for so many states, controls and parameters.
#[derive(Clone, Copy, Debug)]
pub struct Blocks(pub [usize; 3]);

impl Blocks {
    /// How many numbers there are.
    pub fn len(self) -> usize {
        self.offset(0, 3)
    }

    /// Where the block of two kinds begins, the first of which comes first.
    fn offset(self, one: usize, two: usize) -> usize {
        let Self(sizes) = self;
        let columns = (0..two).flat_map(|column| (0..=column).map(move |row| (row, column)));
        let before = columns.chain((0..one).map(|row| (row, two)));
        before.map(|(row, column)| sizes[row] * sizes.get(column).copied().unwrap_or(0)).sum()
    }

    /// Where the derivatives by two kinds of variables begin, and the distances of rows and of
    /// columns.
    pub fn block_layout(self, row: usize, column: usize) -> [usize; 3] {
        let Self(sizes) = self;
        if row <= column {
            [self.offset(row, column), 1, sizes[row]]
        } else {
            [self.offset(column, row), sizes[column], 1]
        }
    }

    /// Where the derivative by two directions is.
    pub fn index(self, row: usize, column: usize) -> usize {
        let [(one, i), (two, j)] = [self.kind(row), self.kind(column)];
        let [first, of_rows, of_columns] = self.block_layout(one, two);
        first + of_rows * i + of_columns * j
    }

    /// Which kind a direction is, and which of it.
    fn kind(self, direction: usize) -> (usize, usize) {
        let Self([nx, nu, _]) = self;
        match direction {
            _ if direction < nx => (0, direction),
            _ if direction < nx + nu => (1, direction - nx),
            _ => (2, direction - nx - nu),
        }
    }
}
