//! Costs and constraints of the variables that dynamics have, for messages of the compiler.

use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::scalar::Real;

/// A cost of the variables that dynamics have. Messages of the compiler name the dynamics, where
/// those of the other trait have dimensions as numbers.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a cost for this model with numbers `{T}`",
    label = "its function has other arguments than the model",
    note = "a `#[function]` takes the arguments of the model, as long as there (unused ones with an underscore): `x`, `z`, `u`, `p`, `t`",
    note = "costs are `LeastSquaresCost<F>`, `GeneralCost<F>`, `ConvexCost<F, _>`, and pairs of costs"
)]
pub trait CostOf<D: Dynamics<T>, T: Real>: Cost<D::Shape, T> {}

#[diagnostic::do_not_recommend]
impl<D: Dynamics<T>, T: Real, C: Cost<D::Shape, T>> CostOf<D, T> for C {}

/// Constraints of the variables that dynamics have. Messages of the compiler name the dynamics,
/// where those of the other trait have dimensions as numbers.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a constraint for this model with numbers `{T}`",
    label = "its function has other arguments than the model",
    note = "a `#[function]` takes the arguments of the model, as long as there (unused ones with an underscore): `x`, `z`, `u`, `p`, `t`",
    note = "constraints are `Constraint<F>`, and pairs of constraints"
)]
pub trait ConstraintsOf<D: Dynamics<T>, T: Real>: Constraints<D::Shape, T> {}

#[diagnostic::do_not_recommend]
impl<D: Dynamics<T>, T: Real, C: Constraints<D::Shape, T>> ConstraintsOf<D, T> for C {}
