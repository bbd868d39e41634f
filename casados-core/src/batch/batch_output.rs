//! The outputs of a batch call, one type for each mode.

use super::intervals::{Interval, vector};
use super::lanes::{MAX_LANES, MaskedResult, Unpack, all_lanes_true};
use super::single::{Group, Single};
use crate::error::Error;
use crate::linalg::dispatch;
use crate::model::Dae;
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::scalar::{Lanes, Real};
use crate::shape::{Matrix, Plain, Shape, copy_into};

/// Results of several intervals, one in each lane. Its functions are inlined into kernels.
pub trait LaneResults<E: Lanes, R> {
    /// Returns the lanes without a non-finite number; matrices are left out, since they are checked
    /// when they are written.
    fn is_finite(&self) -> E::Mask;
    /// Writes the results of valid lanes; `select` returns the result within an element of the
    /// slice.
    fn unpack<Q>(&self, valid: &[bool], results: &mut [Q], select: impl Fn(&mut Q) -> &mut R + Copy);
}

/// Writes a field of the results of valid lanes.
macro_rules! unpack_field {
    ($self:ident, $field:ident, $good:ident, $results:ident, $get:ident) => {{
        let mut to: [&mut [T]; MAX_LANES] = Default::default();
        for ((to, result), &good) in to.iter_mut().zip($results.iter_mut()).zip($good) {
            if good {
                *to = $get(result).$field.as_mut_slice();
            }
        }
        dispatch(Unpack { from: $self.$field.as_slice(), to: &mut to });
    }};
}

macro_rules! wide {
    ($type:ident $(: $inner:ident)?; $($field:ident),*; $($matrix:ident),*) => {
        impl<M: Dae, T: Plain, E: Lanes<Cell: AsRef<[T]>>> LaneResults<E, $type<M, T>> for $type<M, E> {
            #[inline(always)]
            fn is_finite(&self) -> E::Mask {
                let finite = all_lanes_true::<E>();
                $(let finite = E::and(finite, LaneResults::<E, _>::is_finite(&self.$inner));)?
                $(let finite = are_finite(self.$field.as_slice(), finite);)*
                finite
            }
            #[inline(always)]
            fn unpack<Q>(
                &self,
                good: &[bool],
                results: &mut [Q],
                get: impl Fn(&mut Q) -> &mut $type<M, T> + Copy,
            ) {
                $(self.$inner.unpack(good, results, move |result| &mut get(result).$inner);)?
                $(unpack_field!(self, $field, good, results, get);)*
                $(unpack_field!(self, $matrix, good, results, get);)*
            }
        }
    };
}
wide!(Nominal; x, z, z0;);
wide!(Forward: nominal;; dx_dx0, dx_du, dx_dp, dz_dx0, dz_du, dz_dp, dz0_dx0, dz0_du, dz0_dp);
wide!(Adjoint: nominal; grad_x0, grad_u, grad_p;);
wide!(ForwardAdjoint: forward; grad_x0, grad_u, grad_p;);
wide!(Hessian: first;; h_xx, h_xu, h_uu, h_xp, h_up, h_pp);

/// Returns the lanes of `finite` whose values are all finite.
#[inline(always)]
fn are_finite<E: Lanes>(values: &[E], mut finite: E::Mask) -> E::Mask {
    for &value in values {
        finite = E::and(finite, value.is_finite());
    }
    finite
}

/// The output of a batch call for each interval.
pub trait BatchOutput<M: Dae, T: Real>: Copy + Send {
    /// The outputs of a group, one in each lane.
    type LaneResults<E: Lanes<Cell: AsRef<[T]>>>: LaneResults<E, Self>;
    /// Number of columns of derivatives.
    const COLUMNS: usize;

    /// Computes a group of intervals.
    fn compute_group<I: Single<Model = M, Number = T>, E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>>(
        group: &mut I::Group<E>,
    ) -> MaskedResult<'_, E, Self::LaneResults<E>>;

    /// Computes one interval into `self`, so that large results are written once.
    fn compute_single<I: Single<Model = M, Number = T>>(
        &mut self,
        single: &mut I,
        interval: &Interval<'_, M, T>,
    ) -> Result<(), Error>;
}

macro_rules! batch_output {
    ($type:ident, $together:ident, $columns:expr, |$single:ident, $at:ident, $to:ident| $alone:expr) => {
        impl<M: Dae, T: Real> BatchOutput<M, T> for $type<M, T> {
            type LaneResults<E: Lanes<Cell: AsRef<[T]>>> = $type<M, E>;
            const COLUMNS: usize = $columns;

            fn compute_group<I: Single<Model = M, Number = T>, E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>>(
                group: &mut I::Group<E>,
            ) -> MaskedResult<'_, E, Self::LaneResults<E>> {
                group.$together()
            }
            fn compute_single<I: Single<Model = M, Number = T>>(
                &mut self,
                $single: &mut I,
                $at: &Interval<'_, M, T>,
            ) -> Result<(), Error> {
                let $to = self;
                $alone
            }
        }
    };
}
batch_output!(Nominal, solve, 0, |single, at, to| {
    copy_into(to, single.solve_with_quadrature(at.x0, &vector(at.u), at.h, None)?);
    Ok(())
});
batch_output!(Forward, forward, M::Shape::NW, |single, at, to| single.forward_to(at, to));
batch_output!(ForwardAdjoint, forward_adjoint, M::Shape::NW, |single, at, to| single
    .forward_adjoint_to(at, to));
batch_output!(Adjoint, adjoint, 1, |single, at, to| {
    copy_into(to, single.adjoint_with_quadrature(at.x0, &vector(at.u), at.h, &vector(at.lambda), None)?);
    Ok(())
});
batch_output!(Hessian, hessian, M::Shape::NW, |single, at, to| single.hessian_to(at, to));
