//! Views of matrices in the memory of a QP.

use super::error::{QpError, QpField};

/// The layout of a matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct MatrixLayout {
    pub field: QpField,
    pub stage: usize,
    pub rows: usize,
    pub columns: usize,
    /// The stride of rows.
    pub row: usize,
    /// The stride of columns.
    pub column: usize,
}

impl MatrixLayout {
    fn index(&self, row: usize, column: usize) -> Option<usize> {
        (row < self.rows && column < self.columns).then(|| row * self.row + column * self.column)
    }
}

/// A read-only matrix.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// // A of the first stage, NX × NX, read.
/// let stage = qp.view().stages().next().unwrap();
/// assert_eq!(stage.a().shape(), (1, 1));
/// assert_eq!((stage.a().get(0, 0), stage.a().get(1, 0)), (Some(1.0), None));
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Block<'a, T> {
    pub(super) data: &'a [T],
    pub(super) shape: MatrixLayout,
}

/// A mutable matrix.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// for mut stage in qp.stages_mut() {
///     stage.q_mut().set_diagonal([2.0]);
///     stage.a_mut().fill_with(|row, column| if row == column { 0.5 } else { 0.0 });
/// }
/// assert_eq!(qp.view().stages().filter_map(|stage| stage.q().get(0, 0)).sum::<f64>(), 8.0);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Debug)]
pub struct BlockMut<'a, T> {
    pub(super) data: &'a mut [T],
    pub(super) shape: MatrixLayout,
}

impl<T: Copy> Block<'_, T> {
    /// Returns the numbers of rows and columns.
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        (self.shape.rows, self.shape.columns)
    }
    /// Returns an element.
    #[must_use]
    pub fn get(&self, row: usize, column: usize) -> Option<T> {
        self.data.get(self.shape.index(row, column)?).copied()
    }
}

impl<T: Copy> BlockMut<'_, T> {
    /// Returns a read-only view.
    #[must_use]
    pub fn as_block(&self) -> Block<'_, T> {
        Block { data: self.data, shape: self.shape }
    }
    /// Writes an element; does nothing if it does not exist.
    pub fn set(&mut self, row: usize, column: usize, value: T) {
        let index = self.shape.index(row, column);
        if let Some(element) = index.and_then(|i| self.data.get_mut(i)) {
            *element = value;
        }
    }
    /// Writes every element by a function of row and column.
    pub fn fill_with(&mut self, mut element: impl FnMut(usize, usize) -> T) {
        for column in 0..self.shape.columns {
            for row in 0..self.shape.rows {
                self.set(row, column, element(row, column));
            }
        }
    }
    /// Writes all elements, column after column (`as_slice()` of a matrix of nalgebra).
    ///
    /// # Errors
    /// [`QpError::Dimension`]
    pub fn copy_from_columns(&mut self, columns: &[T]) -> Result<(), QpError> {
        let MatrixLayout { field, stage, rows, columns: width, row, column } = self.shape;
        if columns.len() != rows * width {
            return Err(QpError::Dimension { field, stage, expected: rows * width, found: columns.len() });
        }
        for (j, source) in columns.chunks_exact(rows.max(1)).enumerate() {
            let target = self.data.get_mut(j * column..).unwrap_or_default();
            for (target, &value) in target.iter_mut().step_by(row.max(1)).zip(source) {
                *target = value;
            }
        }
        Ok(())
    }
    /// Writes the diagonal; other elements become zero.
    pub fn set_diagonal(&mut self, diagonal: impl IntoIterator<Item = T>)
    where
        T: Default,
    {
        self.fill_with(|_, _| T::default());
        for (i, value) in diagonal.into_iter().enumerate() {
            self.set(i, i, value);
        }
    }
}
