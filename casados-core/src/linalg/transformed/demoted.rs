//! The numbers of shared factors: complex, with half of the digits.

use super::complex::Complex;
use crate::scalar::Lanes;

/// What systems in the eigenbasis are solved with.
pub(in crate::linalg) type DemotedComplex<E, const S: usize> = Complex<<E as Lanes>::Demoted, S>;

/// With half of the digits.
#[inline(always)]
pub(in crate::linalg) fn demote<T: Lanes, const S: usize>(number: Complex<T, S>) -> DemotedComplex<T, S> {
    Complex { parts: number.parts.map(T::demote) }
}
