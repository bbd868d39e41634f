//! Quadratic programs with the structure of optimal control.
//!
//! ```text
//! min  Σ_k ½ [x; u]ᵀ [Q Sᵀ; S R] [x; u] + qᵀ x + rᵀ u
//!      x_{k+1} = A x_k + B u_k + b
//!      lb ≤ (x, u) ≤ ub,   lg ≤ C x + D u ≤ ug      each side optional, each side hard or soft
//! ```
//!
//! Dimensions may differ from stage to stage. The initial state is fixed (two equal bounds),
//! bounded or free. States may be periodic, and controls shared by all stages.
//!
//! - [`Qp`] is the data, [`Solution`] a point with multipliers; the caller owns their memory, on
//!   the heap or not.
//! - [`QpSolver`] is the trait of all solvers: [`InteriorPoint`], which requires neither heap nor
//!   `std`; a solver after partial condensing (`Condensing`); and Clarabel (feature `clarabel`).
//! - [`residuals`] evaluates the optimality conditions at a point, independently of the solver.
#![cfg_attr(
    feature = "alloc",
    doc = "
```
use casados_core::qp::{HeapInteriorPoint, HeapQp, HeapSolution, QpSolver, StageDims, QpStart};

// x₊ = x + u, from x₀ = 1, with |u| ≤ 0.4, three intervals.
let mut dims = [StageDims::new(1, 1, 0); 4];
dims[3].nu = 0;
let mut qp = HeapQp::<f64>::new(&dims)?;
for mut stage in qp.stages_mut() {
    stage.a_mut().set(0, 0, 1.0);
    stage.b_mut().set(0, 0, 1.0);
    stage.q_mut().set(0, 0, 1.0);
    stage.r_mut().set(0, 0, 0.1);
    stage.u_bounds_mut().set(0, -0.4, 0.4);
}
qp.fix_initial_state(&[1.0])?;

let mut solver = HeapInteriorPoint::new();
let mut solution = HeapSolution::new(&dims)?;
let statistics = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
let u0 = solution.stages().next().map_or(f64::NAN, |stage| stage.u[0]);
assert!((u0 + 0.4).abs() < 1e-7 && statistics.iterations < 15);

// The next sampling instant begins where this one would have gone.
qp.fix_initial_state(&[0.6])?;
solution.shift();
solver.solve(qp.view(), QpStart::Warm, solution.view_mut())?;
# Ok::<(), casados_core::qp::QpError>(())
```
"
)]

#[cfg(feature = "alloc")]
mod batch;
mod block;
mod bounds;
mod check;
#[cfg(feature = "clarabel")]
mod clarabel;
#[cfg(feature = "alloc")]
mod condense;
mod coupling;
pub(crate) mod element;
mod error;
#[cfg(feature = "alloc")]
mod instance;
pub(crate) mod interior;
#[cfg(feature = "alloc")]
mod lanes;
mod layout;
#[cfg(feature = "alloc")]
mod memory;
mod problem;
#[cfg(feature = "alloc")]
mod queue;
mod residuals;
mod solution;
mod solver;
#[cfg(feature = "clarabel")]
mod sparse;
mod stage;
mod statistics;
mod violation;

#[cfg(feature = "alloc")]
pub use batch::BatchInteriorPoint;
pub use block::{Block, BlockMut};
pub use bounds::{Bounds, BoundsMut};
pub use check::check;
#[cfg(feature = "clarabel")]
pub use clarabel::{Clarabel, SecondOrderCone};
#[cfg(feature = "alloc")]
pub use condense::Condensing;
pub use error::{QpError, QpField, Side};
#[cfg(feature = "alloc")]
pub use instance::QpInstance;
#[cfg(feature = "alloc")]
pub use interior::HeapInteriorPoint;
#[cfg(feature = "alloc")]
pub(crate) use interior::Symmetric;
pub use interior::{InteriorPoint, InteriorPointOptions, Store};
pub use layout::StageDims;
#[cfg(feature = "alloc")]
pub use problem::HeapQp;
pub use problem::{Qp, QpView};
pub use residuals::residuals;
#[cfg(feature = "alloc")]
pub use solution::HeapSolution;
pub use solution::{Solution, SolutionStage, SolutionStageMut, SolutionView};
pub use solver::{QpSolver, QpStart};
pub use stage::{Stage, StageMut};
pub use statistics::{QpStatistics, Residuals};

// Exports for the optimal control problems.
pub(crate) use coupling::{is_marked, marked_indices};
pub(crate) use interior::{
    Columns, add_symmetric_product, add_transposed, dot, scale, splat, subtract, subtract_column, symmetric,
};
pub(crate) use layout::{StageOffsetsIter, copy_common, padded_len, part, part_mut, take_mut};
#[cfg(feature = "alloc")]
pub(crate) use memory::{try_reserve, try_resize, zeros};
#[cfg(feature = "alloc")]
pub(crate) use queue::{each, threads};
pub(crate) use residuals::bounds as bound_residuals;
pub(crate) use stage::Arrays;
pub(crate) use statistics::nan_max;
pub(crate) use violation::{Violation, largest_violation};
