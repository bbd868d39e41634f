//! With memory on the heap.

use super::{Ipm, IpmOptions};
use crate::ocp::HeapOcp;
use crate::ocp::error::OcpError;
use crate::ocp::log::Log;
use crate::ocp::problem::Formulation;
use crate::qp::{Solution, StageDims};
use crate::scalar::Real;
use alloc::vec::Vec;

/// A nonlinear interior point with its memory on the heap.
///
/// `HeapIpm::new(&ocp)?` makes it; [`Ipm`] has its methods, and an example.
pub type HeapIpm<T = f64> = Ipm<T, Vec<StageDims>, Vec<T>, Vec<u32>>;

impl<T: Real> HeapIpm<T> {
    /// For a problem.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Formulation<T>>(ocp: &HeapOcp<P, T>) -> Result<Self, OcpError> {
        let dims = ocp.qp().dims();
        Ok(Self {
            options: IpmOptions::new::<T>(),
            trial: Solution::new(dims)?,
            best: Solution::new(dims)?,
            numbers: Vec::new(),
            indices: Vec::new(),
            work: Vec::new(),
            log: Vec::new(),
        })
    }

    /// The iterations of the last run, to be printed.
    #[must_use]
    pub fn log(&self) -> Log<'_> {
        Log(&self.log)
    }
}
