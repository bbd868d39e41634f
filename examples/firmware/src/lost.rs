//! A model whose plan of elimination is good for nothing: what a call takes at most, when the whole
//! matrix is pivoted in every iteration and for the derivatives too.

use casados::__private::Lanes;
use casados::Dae;
use casados::{
    __private::{ArrayK, ArrayV, Elimination},
    model::Structure,
};
use core::marker::PhantomData;

/// The model `M`, of whose Newton matrix the plan sees zeros only: its pivots vanish.
pub struct Lost<M>(PhantomData<M>);

impl<M: Dae> Dae for Lost<M> {
    type Shape = M::Shape;
    type Jacobian<T: casados::__private::Plain> = M::Jacobian<T>;
    type Hessian<T: casados::__private::Plain> = M::Hessian<T>;
    type Factors<B: casados::__private::Plain> = M::Factors<B>;
    const STRUCTURE: Structure =
        Structure { elimination: Elimination { assembly: &[], ..M::STRUCTURE.elimination }, ..M::STRUCTURE };

    fn residual<S: Lanes>(v: &ArrayV<M, S::Cell>, f: &mut ArrayK<M, S::Cell>) {
        M::residual::<S>(v, f);
    }
    fn jacobian_constants<S: Lanes>(jacobian: &mut M::Jacobian<S::Cell>) {
        M::jacobian_constants::<S>(jacobian);
    }
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<M, S::Cell>,
        f: &mut ArrayK<M, S::Cell>,
        jacobian: &mut M::Jacobian<S::Cell>,
    ) {
        M::residual_jacobian::<S>(v, f, jacobian);
    }
    fn adjoint<S: Lanes>(v: &ArrayV<M, S::Cell>, mu: &ArrayK<M, S::Cell>, gradient: &mut ArrayV<M, S::Cell>) {
        M::adjoint::<S>(v, mu, gradient);
    }
    fn hessian<S: Lanes>(v: &ArrayV<M, S::Cell>, mu: &ArrayK<M, S::Cell>, hessian: &mut M::Hessian<S::Cell>) {
        M::hessian::<S>(v, mu, hessian);
    }
}
