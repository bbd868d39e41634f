//! Evaluation of event functions, with checks for finite values.

use super::Event;
use crate::error::{Error, Place};
use crate::finite::find_non_finite;
use crate::model::{ArrayK, ArrayV, Dae, VectorX};
use crate::result::Dense;
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};

/// Writes the state, the given algebraic states and the time to their places among the variables.
pub(super) fn write_point<M: Dae, T: Real>(v: &mut ArrayV<M, T>, x: &VectorX<M, T>, z: &[T], t: T) {
    let nx = M::Shape::NX;
    let v = v.as_mut();
    v[nx..2 * nx].copy_from_slice(x.as_slice());
    for (to, z) in v.iter_mut().skip(2 * nx).zip(z) {
        *to = *z;
    }
    if let Some(time) = v.last_mut() {
        *time = t;
    }
}

/// Evaluates an event function at a point of the dense output of a step.
pub(super) fn evaluate_event_function<M: Dae, T: Real>(
    event: &Event<M, T>,
    v: &mut ArrayV<M, T>,
    at: &Dense<M, T>,
    t: T,
    k: usize,
) -> Result<f64, Error> {
    write_point::<M, T>(v, &at.x, at.z.as_slice(), t);
    let value = event.guard.first_output(v);
    check_finite(event.guard.name, &[value], k)?;
    Ok(value.to_f64())
}

/// `ġ = ∂g/∂t + g_x ẋ`, with the gradient with respect to all variables.
pub(super) fn event_function_rate<M: Dae, T: Real>(
    gradient: &ArrayV<M, T>,
    by_t: T,
    xdot: &ArrayK<M, T>,
) -> T {
    let nx = M::Shape::NX;
    let products = gradient.as_ref()[nx..2 * nx].iter().zip(xdot.as_ref());
    products.fold(by_t, |sum, (g, f)| sum + *g * *f)
}

pub(super) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::ZERO, |sum, (a, b)| sum + *a * *b)
}

/// # Errors
/// [`Error::NonFiniteFunction`]
pub(super) fn check_finite<T: Real>(function: &'static str, values: &[T], step: usize) -> Result<(), Error> {
    let at = Place { step, stage: 0, iteration: 0 };
    match find_non_finite(values) {
        None => Ok(()),
        Some((output, value)) => Err(Error::NonFiniteFunction { function, output, value, at }),
    }
}
