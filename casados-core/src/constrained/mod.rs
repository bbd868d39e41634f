//! Models with constraints, whose index the macro reduced.

mod consistent;
mod error;

use crate::function::Function;
use crate::model::Dae;
pub use consistent::Consistent;
pub use error::Inconsistent;

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
