//! What is remembered about steps, and the memory that all calls work in.

use crate::linalg::Factors;
use crate::model::{ArrayK, ArrayV, ArrayX, Dae, VectorP, VectorU};
use crate::result::{Dense, Nominal};
use crate::scalar::Real;
use crate::shape::Plain;
use crate::tableau::Tableau;
use bytemuck::Zeroable;

/// `Copy` without the bounds of a derive.
macro_rules! copy {
    ([$($generics:tt)*] $type:ty) => {
        impl<$($generics)*> Clone for $type {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<$($generics)*> Copy for $type {}
    };
}
pub(crate) use copy;

/// The coefficients of a tableau in the number type of the integrator.
pub(crate) struct Coefficients<T, const S: usize> {
    pub a: [[T; S]; S],
    pub b: [T; S],
    pub c: [T; S],
    /// Lagrange polynomials at the start of the step.
    pub start: [T; S],
    /// Lagrange polynomials at its end.
    pub end: [T; S],
    pub tableau: Tableau<S>,
}

impl<T: Real, const S: usize> Coefficients<T, S> {
    pub fn new(tableau: Tableau<S>) -> Self {
        let mut end = tableau.lagrange(1.0);
        if tableau.is_stiffly_accurate() {
            // The last stage is the end: not even a rounding error apart.
            end = core::array::from_fn(|i| if i + 1 == S { 1.0 } else { 0.0 });
        }
        Self {
            a: tableau.a().map(|row| row.map(T::from_f64)),
            b: tableau.b().map(T::from_f64),
            c: tableau.c().map(T::from_f64),
            start: tableau.lagrange(0.0).map(T::from_f64),
            end: end.map(T::from_f64),
            tableau,
        }
    }
}

/// One step: all that is needed to find out anything else about it.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Step<M: Dae, T: Plain, const S: usize> {
    /// The state at its start.
    pub(crate) x: ArrayX<M, T>,
    /// The unknowns `(k, z)` at its stages.
    pub(crate) y: ArrayK<M, [T; S]>,
}

/// What a call was given, besides the state at its start.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Inputs<M: Dae, T: Plain> {
    pub u: VectorU<M, T>,
    pub p: VectorP<M, T>,
    pub time: Times<T>,
}

/// Where an interval is.
#[derive(Clone, Copy, Zeroable)]
pub(crate) struct Times<T> {
    /// Its start.
    pub start: T,
    /// Its length.
    pub interval: T,
    /// The length of one of its steps.
    pub step: T,
}

/// The linearisation of the stages of a step.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(crate) struct Linearization<M: Dae, T: Plain, const S: usize> {
    /// Entries of the Jacobian of the model, stage by stage.
    pub jacobian: [M::Jacobian<T>; S],
    /// Factors of the Newton matrix.
    pub factors: Factors<M, T, S>,
}

/// The memory that every call works in.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Work<M: Dae, T: Plain, const S: usize> {
    /// The solution of the last call.
    pub(crate) result: Nominal<M, T>,
    /// The solution at the last time that was asked for.
    pub(crate) dense: Dense<M, T>,
    /// What the last call was given.
    pub(crate) inputs: Inputs<M, T>,
    /// What the last successful call was given.
    pub(crate) kept: Inputs<M, T>,
    /// Parameters as they were set.
    pub(crate) parameters: VectorP<M, T>,
    /// Start values as they were given.
    pub(crate) given: ArrayK<M, T>,
    /// The state at the start of the step, then at its end.
    pub(crate) x: ArrayX<M, T>,
    /// Variables of the model at the stages.
    pub(crate) points: [ArrayV<M, T>; S],
    /// The residual at one stage.
    pub(crate) f: ArrayK<M, T>,
    /// The magnitude of the terms of each equation at one stage: `Σ_c |f_c v_c|`.
    pub(crate) magnitude: ArrayK<M, T>,
    /// The residual at all stages, then the increment.
    pub(crate) residual: ArrayK<M, [[T; 1]; S]>,
    /// The largest residual relative to its terms where it was computed last, its equation and stage.
    pub(crate) relative: (T, usize, usize),
    pub(crate) linear: Linearization<M, T, S>,
    /// Whether the constant entries of the Jacobian are there.
    pub(crate) ready: bool,
}

copy!([M: Dae, T: Plain, const S: usize] Step<M, T, S>);
copy!([M: Dae, T: Plain] Inputs<M, T>);
copy!([M: Dae, T: Plain, const S: usize] Linearization<M, T, S>);
copy!([M: Dae, T: Plain, const S: usize] Work<M, T, S>);

impl<M: Dae, T: Real, const S: usize> Work<M, T, S> {
    /// To be called before anything else.
    pub(crate) fn prepare(&mut self) {
        if !self.ready {
            for jacobian in &mut self.linear.jacobian {
                M::jacobian_constants::<T>(jacobian);
            }
            self.ready = true;
        }
    }
}
