//! Memory of a solver: fixed, or growing on the heap.

use crate::qp::error::{QpError, QpField};
#[cfg(feature = "alloc")]
use crate::qp::memory::CACHE_LINE;

/// Memory of a solver: an array or slice, or, with the feature `alloc`, a `Vec` that grows for
/// larger problems and never shrinks.
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
/// // Two sides of three controls are bounded; nothing is soft, and nothing is an equation.
/// const DIMS: [StageDims; 4] = {
///     let mut dims = [StageDims::new(1, 1, 0); 4];
///     dims[3].nu = 0;
///     dims
/// };
/// const MEMORY: (usize, usize) = InteriorPoint::<f64, (), ()>::memory(&DIMS, 6, 0, 0);
/// let mut solver = InteriorPoint::in_memory([0.0; MEMORY.0], [0u32; MEMORY.1]);
/// let mut solution = HeapSolution::new(&dims)?;
/// solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
///
/// // A slice that is too short is an error.
/// let (mut short, mut indices) = ([0.0; 3], [0u32; MEMORY.1]);
/// let mut solver = InteriorPoint::in_memory(&mut short[..], &mut indices[..]);
/// let found = solver.solve(qp.view(), QpStart::Cold, solution.view_mut());
/// assert!(matches!(found, Err(QpError::Dimension { found: 3, .. })));
/// # Ok::<(), casados::qp::QpError>(())
/// ```
pub trait Store<T>: AsRef<[T]> + AsMut<[T]> {
    /// Returns at least `length` elements.
    ///
    /// # Errors
    /// [`QpError::Dimension`] or [`QpError::OutOfMemory`] if there are fewer.
    #[doc(hidden)]
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError>;
}

fn checked_slice<T>(slice: &mut [T], expected: usize, field: QpField) -> Result<&mut [T], QpError> {
    let found = slice.len();
    slice.get_mut(..expected).ok_or(QpError::Dimension { field, stage: 0, expected, found })
}

impl<T, const N: usize> Store<T> for [T; N] {
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError> {
        checked_slice(self, length, field)
    }
}

impl<T> Store<T> for &mut [T] {
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError> {
        checked_slice(self, length, field)
    }
}

#[cfg(feature = "alloc")]
impl<T: Copy + Default> Store<T> for alloc::vec::Vec<T> {
    fn at_least(&mut self, length: usize, field: QpField) -> Result<&mut [T], QpError> {
        // Whole registers are read from the start of a cache line.
        let line = CACHE_LINE / size_of::<T>().max(1);
        crate::qp::memory::try_resize(self, length.saturating_add(line))?;
        let begin = self.as_ptr().align_offset(CACHE_LINE).min(line);
        checked_slice(self.get_mut(begin..).unwrap_or_default(), length, field)
    }
}
