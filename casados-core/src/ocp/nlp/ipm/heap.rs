//! The interior-point method with memory on the heap.

use super::Ipm;
use super::IpmOptions;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::program::Program;
use crate::ocp::solution::log::Log;
use crate::qp::{Solution, StageDims};
use crate::scalar::Real;
use alloc::vec::Vec;

/// A nonlinear interior-point method with memory on the heap.
///
/// Created by `HeapIpm::new(&ocp)?`; [`Ipm`] has the methods, and an example.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # #[function]
/// # fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// # let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
/// #     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// # ocp.guess(&[0.0, 0.0], &[0.0])?;
/// let mut ipm = HeapIpm::new(&ocp)?;
/// let outcome = ipm.solve(&mut ocp)?;
/// assert!(outcome.is_converged(), "{outcome}");
/// // From rest to 1 m in 1 s: the velocity is free, and the effort decreases to zero at the end.
/// assert!((ocp.stage(10)?.x[0] - 1.0).abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type HeapIpm<T = f64> = Ipm<T, Vec<StageDims>, Vec<T>, Vec<u32>>;

impl<T: Real> HeapIpm<T> {
    /// Creates a solver for a problem.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Program<T>>(ocp: &HeapOcp<P, T>) -> Result<Self, OcpError> {
        let dims = ocp.qp().dims();
        Ok(Self {
            options: IpmOptions::new::<T>(),
            trial_point: Solution::new(dims)?,
            best_iterate: Solution::new(dims)?,
            guess: Solution::new(dims)?,
            kkt_numbers: Vec::new(),
            kkt_indices: Vec::new(),
            workspace: Vec::new(),
            log: Vec::new(),
        })
    }

    /// The iterations of the last run, for printing.
    #[must_use]
    pub fn log(&self) -> Log<'_> {
        Log(&self.log)
    }
}
