//! A point in time, and the layout of the variables of a model.

use crate::model::{Dae, VectorP, VectorU, VectorX};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

/// A point in time with a given state.
pub struct ModelPoint<'a, M: Dae, T: Real> {
    pub x: &'a VectorX<M, T>,
    pub u: &'a VectorU<M, T>,
    pub p: &'a VectorP<M, T>,
    pub t: T,
}

/// The index of an unknown of `(ẋ, z)` among the variables `(ẋ, x, z, u, p, t)`.
pub(super) const fn variable_of_unknown<M: Dae>(unknown: usize) -> usize {
    if unknown < M::Shape::NX { unknown } else { unknown + M::Shape::NX }
}

/// Writes `u` and `p` to their places among the variables of a model, after `(ẋ, x, z)`.
pub(super) fn write_inputs<M: Dae, T: Real>(point: &mut [T], u: &VectorU<M, T>, p: &VectorP<M, T>) {
    let begin = 2 * M::Shape::NX + M::Shape::NZ;
    for (to, from) in point.iter_mut().skip(begin).zip(u.as_slice().iter().chain(p.as_slice())) {
        *to = *from;
    }
}
