//! Results of calls, kept and as numbers.

use crate::case::Values;
use casados::prelude::*;
use casados::result::{Adjoint, Forward, Hessian, Nominal};
use casados::{__private::Matrix, Shape};

/// Places of results, one for each input, once they are asked for.
pub(super) struct Results<M: Dae> {
    pub(super) nominal: Vec<Nominal<M>>,
    pub(super) forward: Vec<Forward<M>>,
    pub(super) adjoint: Vec<Adjoint<M>>,
    pub(super) hessian: Vec<Hessian<M>>,
}

impl<M: Dae> Results<M> {
    pub(super) const NONE: Self =
        Self { nominal: Vec::new(), forward: Vec::new(), adjoint: Vec::new(), hessian: Vec::new() };
}

/// So many places.
pub(super) fn allocate<R: Default>(results: &mut Vec<R>, count: usize) -> &mut [R] {
    results.resize_with(count, Default::default);
    results
}

/// A vector of the model's own type.
pub(super) fn vector<V: Matrix<f64>>(numbers: &[f64]) -> V {
    let mut vector = V::zeroed();
    vector.as_mut_slice().copy_from_slice(numbers);
    vector
}

/// The elements by rows.
fn rows<V: Matrix<f64>>(matrix: &V, row: usize) -> impl Iterator<Item = f64> {
    (0..V::COLUMNS).map(move |j| matrix[(row, j)])
}

fn jacobian<M: Dae>(result: &Forward<M>) -> Vec<f64> {
    (0..M::Shape::NX).flat_map(|i| rows(&result.dx_dx0, i).chain(rows(&result.dx_du, i))).collect()
}

fn lower_triangle<M: Dae>(result: &Hessian<M>) -> Vec<f64> {
    let (nx, nw) = (M::Shape::NX, M::Shape::NX + M::Shape::NU);
    let lower = |i: usize, j: usize| match (i < nx, j < nx) {
        (true, _) => result.h_xx[(i, j)],
        (false, true) => result.h_xu[(j, i - nx)],
        (false, false) => result.h_uu[(i - nx, j - nx)],
    };
    (0..nw).flat_map(|i| (0..=i).map(move |j| lower(i, j))).collect()
}

pub(super) fn values_of_nominal<M: Dae>(result: &Nominal<M>, values: &mut Values) {
    values.x = result.x.as_slice().to_vec();
}

pub(super) fn values_of_forward<M: Dae>(result: &Forward<M>, values: &mut Values) {
    values_of_nominal(result, values);
    values.forward = jacobian(result);
}

pub(super) fn values_of_adjoint<M: Dae>(result: &Adjoint<M>, values: &mut Values) {
    values_of_nominal(result, values);
    values.adjoint = [result.grad_x0.as_slice(), result.grad_u.as_slice()].concat();
}

pub(super) fn values_of_hessian<M: Dae>(result: &Hessian<M>, values: &mut Values) {
    values_of_forward(result, values);
    values.adjoint = [result.grad_x0.as_slice(), result.grad_u.as_slice()].concat();
    values.hessian = lower_triangle(result);
}
