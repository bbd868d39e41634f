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
#[diagnostic::on_unimplemented(
    message = "the equations of the projection of `{Self}` are not known",
    note = "`#[dae(index_reduction(projection))]` writes them"
)]
pub trait Projectable: Constrained {
    /// `(x − x̂ + Gᵀν, y)` of `(x, ν, x̂, p, t)`, with `G = ∂y/∂x`: a function with `ν` in the
    /// place of `z` and `x̂` in that of `u`.
    type Projection: Function;
}
