//! Checks of inputs and outputs for non-finite values.

use crate::error::{Argument, Error};
use crate::linalg::{are_finite, kernels};
use crate::model::Dae;
use crate::result::{Forward, Hessian};
use crate::scalar::Real;
use crate::shape::{Matrix, Plain};

/// Checks inputs without names: times and lengths.
///
/// # Errors
/// [`Error::NonFiniteInput`]
pub(crate) fn check_input<T: Real>(argument: Argument, values: &[T]) -> Result<(), Error> {
    match find_non_finite(values) {
        Some((index, value)) => Err(Error::NonFiniteInput { argument, index, name: "", value }),
        None => Ok(()),
    }
}

/// Checks inputs with names in the model.
///
/// # Errors
/// [`Error::NonFiniteInput`]
pub(crate) fn check_model_input<M: Dae, T: Real>(argument: Argument, values: &[T]) -> Result<(), Error> {
    match find_non_finite(values) {
        Some((index, value)) => {
            Err(Error::NonFiniteInput { argument, index, name: element_name::<M>(argument, index), value })
        }
        None => Ok(()),
    }
}

/// Returns the name of an element of an argument in the model; every column has the same names.
pub(crate) fn element_name<M: Dae>(argument: Argument, index: usize) -> &'static str {
    let structure = &M::STRUCTURE;
    let names = match argument {
        Argument::X0 | Argument::Lambda | Argument::SeedX | Argument::StartXdot => structure.x,
        Argument::Nu | Argument::StartZ => structure.z,
        Argument::U | Argument::SeedU => structure.u,
        Argument::P | Argument::SeedP => structure.p,
        Argument::H | Argument::T => &[],
    };
    index.checked_rem(names.len()).and_then(|index| names.get(index)).copied().unwrap_or("")
}

/// Checks an output.
///
/// # Errors
/// [`Error::Overflow`] for the first non-finite element.
pub(crate) fn check_output<T: Real>(values: &[T], step: usize) -> Result<(), Error> {
    match find_non_finite(values) {
        Some((index, _)) => Err(Error::Overflow { step, index }),
        None => Ok(()),
    }
}

/// Checks forward derivatives.
///
/// # Errors
/// [`Error::Overflow`] for the first non-finite derivative.
#[cfg_attr(feature = "std", inline(never))]
pub(crate) fn check_forward<M: Dae, T: Real>(result: &Forward<M, T>, step: usize) -> Result<(), Error> {
    for values in [
        result.dx_dx0.as_slice(),
        result.dx_du.as_slice(),
        result.dx_dp.as_slice(),
        result.dz_dx0.as_slice(),
        result.dz_du.as_slice(),
        result.dz_dp.as_slice(),
        result.dz0_dx0.as_slice(),
        result.dz0_du.as_slice(),
        result.dz0_dp.as_slice(),
    ] {
        check_output(values, step)?;
    }
    Ok(())
}

/// Checks a gradient by `x₀`, `u` and `p`.
///
/// # Errors
/// [`Error::Overflow`] for the first non-finite element.
#[inline(always)]
pub(crate) fn check_gradient<T: Real>(x0: &[T], u: &[T], p: &[T]) -> Result<(), Error> {
    check_output(x0, 0)?;
    check_output(u, 0)?;
    check_output(p, 0)
}

/// Checks second derivatives.
///
/// # Errors
/// [`Error::Overflow`] for the first non-finite second derivative.
pub(crate) fn check_second_derivatives<M: Dae, T: Real>(result: &Hessian<M, T>) -> Result<(), Error> {
    for values in result.second_derivative_blocks() {
        check_output(values, 0)?;
    }
    Ok(())
}

impl<M: Dae, T: Plain> Hessian<M, T> {
    /// The blocks of `∇²(λᵀx)`, column by column.
    #[inline]
    pub(crate) fn second_derivative_blocks(&self) -> [&[T]; 6] {
        let Self { h_xx, h_xu, h_uu, h_xp, h_up, h_pp, .. } = self;
        [h_xx.as_slice(), h_xu.as_slice(), h_uu.as_slice(), h_xp.as_slice(), h_up.as_slice(), h_pp.as_slice()]
    }
}

/// Returns the first element that is infinite or NaN.
#[inline]
pub(crate) fn find_non_finite<T: Real>(values: &[T]) -> Option<(usize, f64)> {
    // Short slices are checked without the call of a kernel.
    let finite = if values.len() < 16 { are_finite(values) } else { are_all_finite(values) };
    if finite {
        return None;
    }
    first_non_finite(values)
}

/// Returns the first non-finite element. Inlined without an operating system, so that the optimiser
/// sees the range of the index.
#[cfg_attr(feature = "std", cold, inline(never))]
#[cfg_attr(not(feature = "std"), inline(always))]
fn first_non_finite<T: Real>(values: &[T]) -> Option<(usize, f64)> {
    values.iter().position(|value| !value.is_finite()).map(|index| (index, values[index].to_f64()))
}

kernels! {
    /// See [`are_finite`].
    fn are_all_finite [E: Real] [E] <A>(values: &'k [E]) -> bool {
        are_finite(values)
    }
}
