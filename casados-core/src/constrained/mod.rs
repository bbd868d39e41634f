//! Models with constraints, whose index the macro reduced.

mod consistent;
mod error;
mod kkt;
mod projected;

use crate::function::Function;
use crate::model::Dae;
pub use consistent::Consistent;
pub use error::Inconsistent;
pub use projected::Projected;

/// A model that was written with constraints `g(x, p, t) = 0`, of which `#[dae(index_reduction)]`
/// made equations of index 1; what it did is in
/// [`Structure::reduction`](crate::structure::Structure::reduction).
///
/// Start values have to satisfy the invariants: [`Consistent`] finds such values. In a problem of
/// optimal control they are imposed at one node.
///
/// ```
/// # use casados::prelude::*;
/// # use casados::{Consistent, Constrained, Inconsistent};
/// # use nalgebra::vector;
/// # /// A pendulum of 1 m in Cartesian coordinates: positions, velocities; z is the tension.
/// # #[dae(index_reduction(baumgarte = 2.0))]
/// # fn pendulum(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
/// #     [
/// #         xdot[0] - x[2],
/// #         xdot[1] - x[3],
/// #         xdot[2] + z * x[0],
/// #         xdot[3] + z * x[1] + 9.81,
/// #         x[0] * x[0] + x[1] * x[1] - 1.0,
/// #     ]
/// # }
/// // Of a pendulum of 1 m: the length, and that the velocity is across the rod.
/// type Invariants = <Pendulum as Constrained>::Invariants;
/// assert_eq!(Pendulum::STRUCTURE.reduction.map(|reduction| reduction.invariants()), Some(2));
/// // v = (ẋ, x, z, t), in a state that has both at zero.
/// let v = [0.0, 0.0, 0.0, 0.0, 0.6, -0.8, 0.8, 0.6, 0.0, 0.0];
/// let mut y = [1.0; 2];
/// Invariants::value::<f64>(&v, &mut y);
/// assert!(y.iter().all(|y| y.abs() < 1e-15));
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no invariants",
    note = "those of a `#[dae(index_reduction)]` are its constraints and their derivatives"
)]
pub trait Constrained: Dae {
    /// Constraints and their lower derivatives `y(x, p, t)`, zero on every solution.
    type Invariants: Function<Shape = Self::Shape>;
}

/// A model of `#[dae(index_reduction(projection))]`: the macro wrote the equations of the
/// projection onto its invariants, for [`Projected`].
///
/// ```
/// use casados::prelude::*;
/// use casados::{Projectable, Projected};
///
/// /// An integrator of a mechanism whose ends are projected.
/// fn projected<M: Projectable>() -> Result<Projected<Irk<M, Gauss<2>>>, Error> {
///     Ok(Projected::new(Irk::<M, Gauss<2>>::new(Options::default())?))
/// }
/// ```
#[diagnostic::on_unimplemented(
    message = "the equations of the projection of `{Self}` are not known",
    note = "`#[dae(index_reduction(projection))]` writes them"
)]
pub trait Projectable: Constrained {
    /// `(x − x̂ + Gᵀν, y)` of `(x, ν, x̂, p, t)`, with `G = ∂y/∂x`: a function with `ν` in the
    /// place of `z` and `x̂` in that of `u`.
    type Projection: Function;
}
