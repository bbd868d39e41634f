//! The questions that a batch can be asked, each known by what it answers.

use super::group::{Group, Verdict};
use super::intervals::{Interval, vector};
use crate::error::Error;
use crate::irk::Integrator;
use crate::memory::Heap;
use crate::model::{ArrayK, Dae, VectorU};
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::scalar::{Lanes, Real};
use crate::shape::{Matrix, Plain, Shape};

/// A result as the slices that it consists of.
pub trait Slices<V: Plain> {
    fn slices<'a>(&'a self) -> impl Iterator<Item = &'a [V]>
    where
        V: 'a;
    fn slices_mut<'a>(&'a mut self) -> impl Iterator<Item = &'a mut [V]>
    where
        V: 'a;
}

macro_rules! slices {
    ($type:ident $(: $inner:ident)?; $($field:ident),*) => {
        impl<M: Dae, V: Plain> Slices<V> for $type<M, V> {
            fn slices<'a>(&'a self) -> impl Iterator<Item = &'a [V]>
            where
                V: 'a,
            {
                let own = [$(self.$field.as_slice()),*].into_iter();
                $(let own = self.$inner.slices().chain(own);)?
                own
            }
            fn slices_mut<'a>(&'a mut self) -> impl Iterator<Item = &'a mut [V]>
            where
                V: 'a,
            {
                let own = [$(self.$field.as_mut_slice()),*].into_iter();
                $(let own = self.$inner.slices_mut().chain(own);)?
                own
            }
        }
    };
}
slices!(Nominal; x, z, z0);
slices!(Forward: nominal; dx_dx0, dx_du, dx_dp, dz_dx0, dz_du, dz_dp, dz0_dx0, dz0_du, dz0_dp);
slices!(Adjoint: nominal; grad_x0, grad_u, grad_p);
slices!(ForwardAdjoint: forward; grad_x0, grad_u, grad_p);
slices!(Hessian: first; h_xx, h_xu, h_uu, h_xp, h_up, h_pp);

/// What a call of a batch answers for each interval.
pub trait Answer<M: Dae, T: Real>: Copy + Send + Slices<T> {
    /// The same with a number for each lane.
    type Wide<E: Lanes>: Slices<E>;

    /// Bytes of the right-hand sides.
    fn columns<E: Lanes, const S: usize>() -> usize;

    /// For several intervals at once.
    fn together<E: Lanes, const S: usize>(
        group: &mut Group<M, E, S>,
        warm: bool,
    ) -> Verdict<'_, E, Self::Wide<E>>;

    /// For one interval.
    fn alone<'a, B, const S: usize>(
        irk: &'a mut Integrator<M, B, S, T, Heap>,
        interval: &Interval<'_, M, T>,
    ) -> Result<&'a Self, Error>;
}

macro_rules! answer {
    ($type:ident, $call:ident($($lambda:ident)?), $columns:expr) => {
        impl<M: Dae, T: Real> Answer<M, T> for $type<M, T> {
            type Wide<E: Lanes> = $type<M, E>;

            fn columns<E: Lanes, const S: usize>() -> usize {
                size_of::<ArrayK<M, [E; S]>>() * $columns
            }
            fn together<E: Lanes, const S: usize>(
                group: &mut Group<M, E, S>,
                warm: bool,
            ) -> Verdict<'_, E, Self::Wide<E>> {
                group.$call(warm)
            }
            fn alone<'a, B, const S: usize>(
                irk: &'a mut Integrator<M, B, S, T, Heap>,
                interval: &Interval<'_, M, T>,
            ) -> Result<&'a Self, Error> {
                let u: VectorU<M, T> = vector(interval.u);
                irk.$call(interval.x0, &u, interval.h $(, &vector(interval.$lambda))?)
            }
        }
    };
}
answer!(Nominal, solve(), 1);
answer!(Forward, forward(), M::Shape::NW);
answer!(ForwardAdjoint, forward_adjoint(lambda), M::Shape::NW);
answer!(Adjoint, adjoint(lambda), 1);
answer!(Hessian, hessian(lambda), M::Shape::NW);
