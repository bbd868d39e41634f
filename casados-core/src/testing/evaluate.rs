//! A model's own derivatives as dense matrices, and those of independent methods.

use super::bounded::Bounded;
use super::forward::Forward;
use crate::model::{ArrayK, ArrayV, Dae, GraphDae};
use crate::scalar::{Lanes, Scalar};
use crate::shape::{Array, Shape};
use nalgebra::DMatrix;
use num_complex::Complex64;
use num_dual::{Dual64, HyperDual64};
use std::vec::Vec;

/// The complex step, about `1e-200`; a power of two, so that multiplications by it are exact.
const COMPLEX_STEP: f64 = f64::from_bits((1023 - 664) << 52);

/// Ratio of the rounding errors of an operation of a reference and of [`Forward`]: a complex
/// division rounds three times in each part.
const REFERENCE_ERROR_FACTOR: f64 = 4.0;

/// Values with bounds of their errors.
#[derive(Clone, Debug)]
pub(super) struct BoundedMatrix {
    pub value: DMatrix<f64>,
    pub error: DMatrix<f64>,
}

impl BoundedMatrix {
    fn of(values: &DMatrix<Bounded>, factor: f64) -> Self {
        Self { value: values.map(|b| b.value), error: values.map(|b| factor * b.error) }
    }
}

/// The number of variables for derivatives: all but `t`.
pub(super) const fn derivative_variable_count<M: Dae>() -> usize {
    M::Shape::NV - 1
}

/// Converts a point to another number type.
fn convert_point<M: Dae, S: Lanes<Cell = S>>(v: &ArrayV<M, f64>) -> ArrayV<M, S> {
    Array::from_fn(|i| S::from_f64(v[i]))
}

fn filled_array<S: Lanes<Cell = S>, A: Array<S>>(value: f64) -> A {
    A::from_fn(|_| S::from_f64(value))
}

/// `f(v)`
pub(super) fn residual<M: Dae, S: Lanes<Cell = S>>(v: &ArrayV<M, S>) -> ArrayK<M, S> {
    let mut f = filled_array::<S, ArrayK<M, S>>(f64::NAN);
    M::residual::<S>(v, &mut f);
    f
}

/// `f(v)` as evaluated with the Jacobian, and the Jacobian. Entries that are not written are NaN.
pub(super) fn jacobian<M: Dae, S: Lanes<Cell = S>>(v: &ArrayV<M, f64>) -> (ArrayK<M, S>, DMatrix<S>) {
    let mut f = filled_array::<S, ArrayK<M, S>>(f64::NAN);
    let mut values = filled_array::<S, M::Jacobian<S>>(f64::NAN);
    M::jacobian_constants::<S>(&mut values);
    M::residual_jacobian::<S>(&convert_point::<M, S>(v), &mut f, &mut values);
    let mut dense = DMatrix::from_element(M::Shape::NK, derivative_variable_count::<M>(), S::from_f64(0.0));
    for entry in 0..M::STRUCTURE.jacobian.len() {
        dense[M::STRUCTURE.jacobian.at(entry)] = values[entry];
    }
    (f, dense)
}

/// `∇(μᵀ f)`, including `t`.
pub(super) fn adjoint<M: Dae, S: Lanes<Cell = S>>(v: &ArrayV<M, S>, mu: &[f64]) -> ArrayV<M, S> {
    let mu = <ArrayK<M, S> as Array<S>>::from_fn(|r| S::from_f64(mu[r]));
    let mut gradient = filled_array::<S, ArrayV<M, S>>(f64::NAN);
    M::adjoint::<S>(v, &mu, &mut gradient);
    gradient
}

/// `∇²(μᵀ f)`, both triangles.
pub(super) fn hessian<M: Dae, S: Lanes<Cell = S>>(v: &ArrayV<M, f64>, mu: &[f64]) -> DMatrix<S> {
    let mu = <ArrayK<M, S> as Array<S>>::from_fn(|r| S::from_f64(mu[r]));
    let mut values = filled_array::<S, M::Hessian<S>>(f64::NAN);
    M::hessian::<S>(&convert_point::<M, S>(v), &mu, &mut values);
    let mut dense = DMatrix::from_element(
        derivative_variable_count::<M>(),
        derivative_variable_count::<M>(),
        S::from_f64(0.0),
    );
    for entry in 0..M::STRUCTURE.hessian.len() {
        let (i, j) = M::STRUCTURE.hessian.at(entry);
        dense[(i, j)] = values[entry];
        dense[(j, i)] = values[entry];
    }
    dense
}

/// The model's own Jacobian with error bounds.
pub(super) fn model_jacobian<M: Dae>(v: &ArrayV<M, f64>) -> BoundedMatrix {
    let bounds = jacobian::<M, Bounded>(v).1;
    BoundedMatrix { value: jacobian::<M, f64>(v).1, error: bounds.map(|b| b.error) }
}

/// The model's own gradient as one column, with error bounds.
pub(super) fn model_gradient<M: Dae>(v: &ArrayV<M, f64>, mu: &[f64]) -> BoundedMatrix {
    let bounds = adjoint::<M, Bounded>(&convert_point::<M, Bounded>(v), mu);
    let values = adjoint::<M, f64>(v, mu);
    BoundedMatrix {
        value: DMatrix::from_fn(M::Shape::NV, 1, |i, _| values[i]),
        error: DMatrix::from_fn(M::Shape::NV, 1, |i, _| bounds[i].error),
    }
}

/// The model's own Hessian with error bounds.
pub(super) fn model_hessian<M: Dae>(v: &ArrayV<M, f64>, mu: &[f64]) -> BoundedMatrix {
    let bounds = hessian::<M, Bounded>(v, mu);
    BoundedMatrix { value: hessian::<M, f64>(v, mu), error: bounds.map(|b| b.error) }
}

/// Evaluates a function of a point in another number type, at `v`, seeded in the direction of
/// variable `j`.
fn evaluate_seeded<S: Scalar<Cell = S>>(
    v: &[f64],
    outputs: usize,
    seed: impl Fn(usize, f64) -> S,
    function: impl Fn(&[S], &mut [S]),
) -> Vec<S> {
    let point: Vec<S> = v.iter().enumerate().map(|(i, &value)| seed(i, value)).collect();
    let mut f: Vec<S> = core::iter::repeat_n(S::from_f64(0.0), outputs).collect();
    function(&point, &mut f);
    f
}

fn forward_seed(j: usize) -> impl Fn(usize, f64) -> Forward<Bounded> {
    move |i, value| Forward { re: Bounded::exact(value), d: Bounded::exact(f64::from(u8::from(i == j))) }
}

/// The Jacobian by `num-dual`.
pub(super) fn dual_jacobian<M: GraphDae>(v: &ArrayV<M, f64>) -> BoundedMatrix {
    let value = matrix_from_columns(derivative_variable_count::<M>(), M::Shape::NK, |j| {
        let seed = |i, value| Dual64::new(value, f64::from(u8::from(i == j)));
        evaluate_seeded(v.as_ref(), M::Shape::NK, seed, M::residual_of::<Dual64>)
            .iter()
            .map(|f| f.eps)
            .collect()
    });
    BoundedMatrix { value, error: jacobian_bounds::<M>(v) }
}

/// The Jacobian by the complex step.
pub(super) fn complex_jacobian<M: GraphDae>(v: &ArrayV<M, f64>) -> BoundedMatrix {
    let value = matrix_from_columns(derivative_variable_count::<M>(), M::Shape::NK, |j| {
        evaluate_seeded(v.as_ref(), M::Shape::NK, complex_seed(j), M::residual_of::<Complex64>)
            .iter()
            .map(|f| f.im / COMPLEX_STEP)
            .collect()
    });
    BoundedMatrix { value, error: jacobian_bounds::<M>(v) }
}

fn complex_seed(j: usize) -> impl Fn(usize, f64) -> Complex64 {
    move |i, value| Complex64::new(value, if i == j { COMPLEX_STEP } else { 0.0 })
}

fn jacobian_bounds<M: GraphDae>(v: &ArrayV<M, f64>) -> DMatrix<f64> {
    matrix_from_columns(derivative_variable_count::<M>(), M::Shape::NK, |j| {
        evaluate_seeded(v.as_ref(), M::Shape::NK, forward_seed(j), M::residual_of::<Forward<Bounded>>)
            .iter()
            .map(|f| REFERENCE_ERROR_FACTOR * f.d.error)
            .collect()
    })
}

/// The Hessian of `μᵀ f` by the hyper-duals of `num-dual`.
pub(super) fn dual_hessian<M: GraphDae>(v: &ArrayV<M, f64>, mu: &[f64]) -> BoundedMatrix {
    let n = derivative_variable_count::<M>();
    let (mut value, mut error) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    let is = |i: usize, j: usize| f64::from(u8::from(i == j));
    for i in 0..n {
        for j in 0..=i {
            let seed = |k, value| HyperDual64::new(value, is(k, i), is(k, j), 0.0);
            let f = evaluate_seeded(v.as_ref(), M::Shape::NK, seed, M::residual_of::<HyperDual64>);
            // Rows without second derivatives add exact zeros.
            let mut sum = Bounded::exact(0.0);
            if f.iter().any(|f| f.eps1eps2 != 0.0) {
                let seed = |k, value| Forward {
                    re: Forward { re: Bounded::exact(value), d: Bounded::exact(is(k, i)) },
                    d: Forward { re: Bounded::exact(is(k, j)), d: Bounded::exact(0.0) },
                };
                let bounds = evaluate_seeded(
                    v.as_ref(),
                    M::Shape::NK,
                    seed,
                    M::residual_of::<Forward<Forward<Bounded>>>,
                );
                for ((f, bound), &mu) in f.iter().zip(&bounds).zip(mu) {
                    let term = Bounded { value: f.eps1eps2, error: bound.d.d.error };
                    sum = sum + Bounded::exact(mu) * term;
                }
            }
            (value[(i, j)], value[(j, i)]) = (sum.value, sum.value);
            (error[(i, j)], error[(j, i)]) =
                (REFERENCE_ERROR_FACTOR * sum.error, REFERENCE_ERROR_FACTOR * sum.error);
        }
    }
    BoundedMatrix { value, error }
}

/// The Hessian of `μᵀ f` by the complex step through the model's gradient.
pub(super) fn complex_hessian<M: GraphDae>(v: &ArrayV<M, f64>, mu: &[f64]) -> BoundedMatrix {
    let n = derivative_variable_count::<M>();
    fn multiplier_seeds<S: Scalar>(mu: &[f64]) -> Vec<S> {
        mu.iter().map(|&mu| S::from_f64(mu)).collect()
    }
    let value = matrix_from_columns(n, n, |j| {
        let gradient = |v: &[Complex64], g: &mut [Complex64]| M::adjoint_of(v, &multiplier_seeds(mu), g);
        let column = evaluate_seeded(v.as_ref(), M::Shape::NV, complex_seed(j), gradient);
        column[..n].iter().map(|g| g.im / COMPLEX_STEP).collect()
    });
    let error = matrix_from_columns(n, n, |j| {
        let gradient = |v: &[Forward<Bounded>], g: &mut [Forward<Bounded>]| {
            M::adjoint_of(v, &multiplier_seeds(mu), g);
        };
        let column = evaluate_seeded(v.as_ref(), M::Shape::NV, forward_seed(j), gradient);
        column[..n].iter().map(|g| REFERENCE_ERROR_FACTOR * g.d.error).collect()
    });
    BoundedMatrix { value, error }
}

/// The Jacobian by differences of the residual.
pub(super) fn difference_jacobian<M: Dae>(v: &ArrayV<M, f64>) -> BoundedMatrix {
    difference_matrix::<M>(v, M::Shape::NK, |v| residual::<M, Bounded>(v).as_ref().to_vec())
}

/// The Hessian by differences of the model's gradient.
pub(super) fn difference_hessian<M: Dae>(v: &ArrayV<M, f64>, mu: &[f64]) -> BoundedMatrix {
    difference_matrix::<M>(v, derivative_variable_count::<M>(), |v| {
        adjoint::<M, Bounded>(v, mu).as_ref()[..derivative_variable_count::<M>()].to_vec()
    })
}

/// Derivatives of a function of the point with respect to each variable.
fn difference_matrix<M: Dae>(
    v: &ArrayV<M, f64>,
    outputs: usize,
    function: impl Fn(&ArrayV<M, Bounded>) -> Vec<Bounded>,
) -> BoundedMatrix {
    let point = convert_point::<M, Bounded>(v);
    let columns: Vec<Vec<Bounded>> = (0..derivative_variable_count::<M>())
        .map(|j| {
            super::differences::derivative(v[j], outputs, |value| {
                let mut moved = point;
                moved[j] = value;
                function(&moved)
            })
        })
        .collect();
    let dense = DMatrix::from_fn(outputs, columns.len(), |i, j| columns[j][i]);
    BoundedMatrix::of(&dense, 1.0)
}

fn matrix_from_columns(columns: usize, rows: usize, column: impl Fn(usize) -> Vec<f64>) -> DMatrix<f64> {
    let values: Vec<Vec<f64>> = (0..columns).map(column).collect();
    DMatrix::from_fn(rows, columns, |i, j| values[j][i])
}
