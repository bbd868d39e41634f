//! A problem of a batch.

use super::problem::HeapQp;
use super::solution::HeapSolution;
use crate::scalar::Real;

/// A quadratic program of a batch, with the memory of its solution.
///
/// ```
/// use casados::qp::{HeapQp, HeapSolution, QpInstance, StageDims};
///
/// let dims = [StageDims::new(2, 1, 0), StageDims::new(2, 0, 0)];
/// let instance = QpInstance { qp: HeapQp::<f64>::new(&dims)?, solution: HeapSolution::new(&dims)? };
/// assert_eq!(instance.qp.dims(), instance.solution.dims());
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Debug)]
pub struct QpInstance<T: Real = f64> {
    /// The data.
    pub qp: HeapQp<T>,
    /// The solution, which warm starts read.
    pub solution: HeapSolution<T>,
}
