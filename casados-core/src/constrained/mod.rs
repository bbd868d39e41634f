//! Models with constraints after index reduction by the macro.

mod consistent;
mod error;
mod kkt;
mod projected;

use crate::function::Function;
use crate::model::Dae;
pub use consistent::Consistent;
pub use error::Inconsistent;
pub use projected::Projected;

/// A model with constraints `g(x, p, t) = 0`, which `#[dae(index_reduction)]` reduced to index 1;
/// see [`Structure::reduction`](crate::structure::Structure::reduction).
///
/// Initial states must satisfy the invariants; [`Consistent`] computes such states. In an optimal
/// control problem the invariants are imposed at one node.
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
    /// Constraints and their lower derivatives `y(x, p, t)`; zero on every solution.
    type Invariants: Function<Shape = Self::Shape>;
}

/// A model of `#[dae(index_reduction(projection))]`: the macro generates the equations of the
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
    /// `(x − x̂ + Gᵀν, y)` as a function of `(x, ν, x̂, p, t)`, with `G = ∂y/∂x`; `ν` takes the
    /// place of `z`, and `x̂` that of `u`.
    type Projection: Function;
}
