//! Traits that check the arguments of costs and constraints against the dynamics, for readable
//! compiler messages.

use crate::function::Function;
use crate::ocp::formulation::functions::boundary::Boundary;
use crate::ocp::formulation::functions::constraint::{Constraint, Constraints};
use crate::ocp::formulation::functions::convex::ConvexCost;
use crate::ocp::formulation::functions::cost::{Cost, GeneralCost};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::functions::least_squares::LeastSquaresCost;
use crate::scalar::Real;
use crate::shape::{Plain, Shape};
use core::marker::PhantomData;

/// A cost whose arguments match the dynamics. Compiler messages then name the dynamics, instead of
/// dimensions as numbers.
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not fit the dynamics of this problem with numbers `{T}`",
    label = "a cost of this problem does not fit its dynamics",
    note = "its function has the arguments of the model, and its numbers are those of the integrator: `LeastSquaresCost<F, f32>` for one of `f32`"
)]
pub trait CostOf<D: Dynamics<T>, T: Real>:
    Cost<D::Shape, T> + IsCost<Functions: HasArgumentsOf<D, T>>
{
}

#[diagnostic::do_not_recommend]
impl<D: Dynamics<T>, T: Real, C: Cost<D::Shape, T> + IsCost<Functions: HasArgumentsOf<D, T>>> CostOf<D, T>
    for C
{
}

/// Constraints whose arguments match the dynamics. Compiler messages then name the dynamics,
/// instead of dimensions as numbers.
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not fit the dynamics of this problem with numbers `{T}`",
    label = "a constraint of this problem does not fit its dynamics",
    note = "its function has the arguments of the model, and its numbers are those of the integrator: `Constraint<F, f32>` for one of `f32`"
)]
pub trait ConstraintsOf<D: Dynamics<T>, T: Real>:
    Constraints<D::Shape, T> + IsConstraint<Functions: HasArgumentsOf<D, T>>
{
}

#[diagnostic::do_not_recommend]
impl<D: Dynamics<T>, T: Real, C: Constraints<D::Shape, T> + IsConstraint<Functions: HasArgumentsOf<D, T>>>
    ConstraintsOf<D, T> for C
{
}

/// The functions of a cost.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a cost",
    label = "neither a cost nor a pair of costs",
    note = "a cost wraps a `#[function]`: `GeneralCost::<F>::new()` is the sum of its outputs, `LeastSquaresCost::<F>::diagonal(&weights)` half the weighted sum of their squares, `ConvexCost::<F, _>::new(function)` a convex function of them"
)]
pub trait IsCost {
    /// The function, or a pair of functions.
    type Functions;
}

impl IsCost for () {
    type Functions = ();
}
impl<A: IsCost, B: IsCost> IsCost for (A, B) {
    type Functions = (A::Functions, B::Functions);
}
impl<F: Function, T: Plain> IsCost for GeneralCost<F, T> {
    type Functions = SingleFunction<F>;
}
impl<F: Function, T: Real> IsCost for LeastSquaresCost<F, T> {
    type Functions = SingleFunction<F>;
}
impl<F: Function, C, T: Real> IsCost for ConvexCost<F, C, T> {
    type Functions = SingleFunction<F>;
}

/// The functions of constraints.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a constraint",
    label = "neither a constraint nor a pair of constraints",
    note = "a constraint wraps a `#[function]` with bounds of its outputs: `Constraint::<F>::new([lower], [upper])`"
)]
pub trait IsConstraint {
    /// The function, or a pair of functions.
    type Functions;
}

impl IsConstraint for () {
    type Functions = ();
}
impl<A: IsConstraint, B: IsConstraint> IsConstraint for (A, B) {
    type Functions = (A::Functions, B::Functions);
}
impl<F: Function, T: Plain> IsConstraint for Constraint<F, T> {
    type Functions = SingleFunction<F>;
}

impl<F: Function, T: Plain> IsConstraint for Boundary<F, T> {
    type Functions = BoundaryFunction<F>;
}

/// The function of a boundary condition.
pub struct BoundaryFunction<F>(PhantomData<F>);

impl<D: Dynamics<T>, T: Real, F: Function> HasArgumentsOf<D, T> for BoundaryFunction<F>
where
    <F::Shape as Shape>::ArrayX<f64>: StatesOf<<D::Shape as Shape>::ArrayX<f64>>,
    <F::Shape as Shape>::ArrayZ<f64>: FirstStatesOf<<D::Shape as Shape>::ArrayX<f64>>,
    <F::Shape as Shape>::ArrayP<f64>: ParametersOf<<D::Shape as Shape>::ArrayP<f64>>,
{
}

/// The argument `x0` matches the states of the model.
#[diagnostic::on_unimplemented(
    message = "the boundary condition has the argument `x0: {Self}`, and the model `x: {Model}`",
    label = "its function has another argument `x0` than the states of the model",
    note = "a boundary condition is a `#[function]` of `x0: {Model}`, `x: {Model}` and the parameters `p` of the model"
)]
pub trait FirstStatesOf<Model> {}
impl<X> FirstStatesOf<X> for X {}

/// The only function of a cost or of constraints.
pub struct SingleFunction<F>(PhantomData<F>);

/// A function whose arguments match the dynamics.
pub trait HasArgumentsOf<D: Dynamics<T>, T: Real> {}

impl<D: Dynamics<T>, T: Real> HasArgumentsOf<D, T> for () {}
impl<D: Dynamics<T>, T: Real, A: HasArgumentsOf<D, T>, B: HasArgumentsOf<D, T>> HasArgumentsOf<D, T>
    for (A, B)
{
}
impl<D: Dynamics<T>, T: Real, F: Function> HasArgumentsOf<D, T> for SingleFunction<F>
where
    <F::Shape as Shape>::ArrayX<f64>: StatesOf<<D::Shape as Shape>::ArrayX<f64>>,
    <F::Shape as Shape>::ArrayZ<f64>: AlgebraicStatesOf<<D::Shape as Shape>::ArrayZ<f64>>,
    <F::Shape as Shape>::ArrayU<f64>: ControlsOf<<D::Shape as Shape>::ArrayU<f64>>,
    <F::Shape as Shape>::ArrayP<f64>: ParametersOf<<D::Shape as Shape>::ArrayP<f64>>,
{
}

/// The argument `x` matches the states of the model.
#[diagnostic::on_unimplemented(
    message = "the function has the argument `x: {Self}`, and the model `x: {Model}`",
    label = "its function has another argument `x` than the model",
    note = "a `#[function]` takes the arguments of the model, as long as there, unused ones with an underscore: `_x: {Model}`"
)]
pub trait StatesOf<Model> {}
impl<X> StatesOf<X> for X {}

/// The argument `z` matches the algebraic states of the model.
#[diagnostic::on_unimplemented(
    message = "the function has the argument `z: {Self}`, and the model `z: {Model}`",
    label = "its function has another argument `z` than the model",
    note = "a `#[function]` takes the arguments of the model, as long as there, unused ones with an underscore: `_z: {Model}`; one that is left out has no elements"
)]
pub trait AlgebraicStatesOf<Model> {}
impl<Z> AlgebraicStatesOf<Z> for Z {}

/// The argument `u` matches the controls of the model.
#[diagnostic::on_unimplemented(
    message = "the function has the argument `u: {Self}`, and the model `u: {Model}`",
    label = "its function has another argument `u` than the model",
    note = "a `#[function]` takes the arguments of the model, as long as there, unused ones with an underscore: `_u: {Model}`; one that is left out has no elements"
)]
pub trait ControlsOf<Model> {}
impl<U> ControlsOf<U> for U {}

/// The argument `p` matches the parameters of the model.
#[diagnostic::on_unimplemented(
    message = "the function has the argument `p: {Self}`, and the model `p: {Model}`",
    label = "its function has another argument `p` than the model",
    note = "a `#[function]` takes the arguments of the model, as long as there, unused ones with an underscore: `_p: {Model}`; one that is left out has no elements"
)]
pub trait ParametersOf<Model> {}
impl<P> ParametersOf<P> for P {}
