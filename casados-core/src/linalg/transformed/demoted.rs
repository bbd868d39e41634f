//! Complex numbers of reduced precision, for shared factors.

use super::complex::Complex;
use crate::scalar::Lanes;

/// The numbers of systems in the eigenbasis.
pub(in crate::linalg) type DemotedComplex<E, const S: usize> = Complex<<E as Lanes>::Demoted, S>;

/// Demotes to half of the digits.
#[inline(always)]
pub(in crate::linalg) fn demote<T: Lanes, const S: usize>(number: Complex<T, S>) -> DemotedComplex<T, S> {
    Complex { parts: number.parts.map(T::demote) }
}
