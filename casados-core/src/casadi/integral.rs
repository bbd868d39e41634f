//! Integrals along the solution as an additional output.

use super::dependence;
use super::sparsity::Dependence;
use crate::error::Error;
use crate::function::Function;
use crate::model::Dae;
use crate::quadrature::{OptionalIntegrand, Quadrature};
use crate::shape::{Matrix, Outputs};
use alloc::boxed::Box;
use core::marker::PhantomData;

/// The integrals of all outputs of a function, or none.
#[doc(hidden)]
pub trait Integral<M: Dae>: 'static {
    /// The number of integrals.
    const COUNT: usize;
    /// Their memory.
    type Memory: Send;

    /// The memory for a thread.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn memory() -> Result<Self::Memory, Error>;
    /// The integrand, with these multipliers.
    fn integrand<'a>(memory: &'a mut Self::Memory, nu: &[f64]) -> OptionalIntegrand<'a, 'a, M, f64>;
    /// The values.
    fn value(memory: &Self::Memory) -> &[f64];
    /// The derivatives with respect to `x₀`, `u` and `p`, each in column-major order.
    fn jacobian(memory: &Self::Memory) -> [&[f64]; 3];
    /// The directions on which the outputs depend (in rows from `first` on), and the entries of
    /// their Hessian, given the dependencies of the variables at the stages.
    fn add_dependence(variables: &Dependence, first: usize, value: &mut Dependence, hessian: &mut Dependence);
}

/// No integrals.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Nothing;

impl<M: Dae> Integral<M> for Nothing {
    const COUNT: usize = 0;
    type Memory = ();

    fn memory() -> Result<(), Error> {
        Ok(())
    }
    fn integrand<'a>((): &'a mut (), _: &[f64]) -> OptionalIntegrand<'a, 'a, M, f64> {
        None
    }
    fn value((): &()) -> &[f64] {
        &[]
    }
    fn jacobian((): &()) -> [&[f64]; 3] {
        [&[]; 3]
    }
    fn add_dependence(_: &Dependence, _: usize, _: &mut Dependence, _: &mut Dependence) {}
}

/// The integrals of all outputs of a function `F`.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct Of<F>(PhantomData<fn() -> F>);

impl<M: Dae, F: Function<Shape = M::Shape>> Integral<M> for Of<F>
where
    Box<Quadrature<F>>: Send,
{
    const COUNT: usize = F::Outputs::NY;
    type Memory = Box<Quadrature<F>>;

    fn memory() -> Result<Self::Memory, Error> {
        Quadrature::boxed()
    }
    fn integrand<'a>(memory: &'a mut Self::Memory, nu: &[f64]) -> OptionalIntegrand<'a, 'a, M, f64> {
        memory.nu.as_mut_slice().copy_from_slice(nu);
        Some(&mut **memory)
    }
    fn value(memory: &Self::Memory) -> &[f64] {
        memory.q.as_slice()
    }
    fn jacobian(memory: &Self::Memory) -> [&[f64]; 3] {
        [memory.dq_dx0.as_slice(), memory.dq_du.as_slice(), memory.dq_dp.as_slice()]
    }
    fn add_dependence(
        variables: &Dependence,
        first: usize,
        value: &mut Dependence,
        hessian: &mut Dependence,
    ) {
        for (output, variable) in F::STRUCTURE.jacobian.iter() {
            value.add_row(first + output, variables, variable);
        }
        dependence::curvature(variables, F::STRUCTURE.hessian, hessian);
    }
}
