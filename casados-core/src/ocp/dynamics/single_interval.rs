//! Integrators of single intervals as dynamics: one interval after the other, without further
//! memory.

use crate::function::Function;
use crate::integrator::Integrator as _;
use crate::memory::{WithForward, WithHessian};
use crate::model::{Dae, Ode};
#[cfg(feature = "alloc")]
use crate::ocp::dynamics::dense_output::for_each_interval_inside;
use crate::ocp::dynamics::interval_setup::{IntervalSetup, each};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::cost::TermWriter;
use crate::ocp::formulation::functions::dynamics::{
    Dynamics, IntegralTerms, IntervalResult, Nodes, SecondOrder, Sink, vector,
};
use crate::ocp::formulation::functions::sparsity::DynamicsStructure;
use crate::ocp::formulation::names::Names;
use crate::quadrature::{Integrand, LeastSquares, Quadrature};
use crate::scalar::Real;
use crate::shape::Matrix;
use crate::{erk, irk};
use core::fmt;

/// Returns the names of a model.
pub(in crate::ocp) const fn names<M: Dae>() -> Names {
    let structure = &M::STRUCTURE;
    Names {
        model: structure.name,
        x: structure.x,
        z: structure.z,
        u: structure.u,
        p: structure.p,
        units: M::UNITS,
        duration: M::DURATION,
        linear: M::LINEAR,
        degrees: M::DEGREES,
        integrals: M::INTEGRALS,
    }
}

/// Returns the sparsity of the equations of a model.
pub(in crate::ocp) const fn model_structure<M: Dae>() -> DynamicsStructure {
    DynamicsStructure::Equations(M::STRUCTURE.jacobian, M::STRUCTURE.hessian)
}

/// An integrator with an integral cost: `∫ l dt` of a [`Quadrature`] with one output, or half the
/// integral of a square of [`LeastSquares`], which has a Gauss-Newton matrix. A quadrature has
/// none: only exact Hessians contain its second derivatives.
///
/// References of integrals are parameters, with a value for each stage.
///
/// ```
/// use casados::ocp::{HeapSqp, Horizon, Problem, WithIntegral};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// /// The speed, too, costs something all along the way.
/// #[function]
/// fn price(x: [f64; 2], u: f64) -> f64 { 0.5 * (x[1] * x[1] + u * u) }
///
/// let irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut ocp = Problem::new(WithIntegral::new(irk, Quadrature::<Price>::new())).on(Horizon::uniform(10, 0.1))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?.guess(&[0.0, 0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct WithIntegral<I, Q> {
    /// The integrator.
    pub integrator: I,
    /// The integral.
    pub integral: Q,
}

impl<I, Q> WithIntegral<I, Q> {
    /// An integrator with an integral cost.
    pub fn new(integrator: I, integral: Q) -> Self {
        Self { integrator, integral }
    }
}

/// An integrand that can be an integral cost.
///
/// ```
/// use casados::ocp::{HeapSqp, Horizon, IntegralCost, OcpError, Problem, WithIntegral};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn speed(x: [f64; 2], _u: f64) -> f64 { x[1] }
///
/// /// The cost of a second at a constant speed of 2, by any integral.
/// fn cost<Q: IntegralCost<Cart, f64>>(integral: Q) -> Result<f64, OcpError> {
///     let irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
///     let mut ocp = Problem::new(WithIntegral::new(irk, integral)).on(Horizon::uniform(4, 0.25))?;
///     ocp.fix_initial_state(&[0.0, 2.0])?.bound("u", .., 0.0, 0.0)?.guess(&[0.0, 2.0], &[0.0])?;
///     Ok(HeapSqp::new(&ocp)?.solve(&mut ocp)?.objective)
/// }
/// assert!((cost(Quadrature::<Speed>::new())? - 2.0).abs() < 1e-6);
/// assert!((cost(LeastSquares::<Speed>::new(&nalgebra::matrix![1.0]))? - 2.0).abs() < 1e-6);
/// # Ok::<(), OcpError>(())
/// ```
pub trait IntegralCost<M: Dae, T: Real>: Integrand<M, T> {
    /// Checks its weights.
    ///
    /// # Errors
    /// [`OcpError::InvalidWeight`]
    #[doc(hidden)]
    fn check(&self) -> Result<(), OcpError> {
        Ok(())
    }
    /// Prints it as a formula.
    ///
    /// # Errors
    /// The errors of `show`.
    #[doc(hidden)]
    fn term(&self, show: TermWriter<'_>) -> fmt::Result;
    /// Prepares the integrand for an interval.
    #[doc(hidden)]
    fn prepare(&mut self);
    /// Returns the value of the last interval and its derivatives.
    #[doc(hidden)]
    fn terms(&self) -> IntegralTerms<'_, T>;
}

impl<M: Dae, F: Function<Shape = M::Shape>, T: Real> IntegralCost<M, T> for LeastSquares<F, T> {
    fn check(&self) -> Result<(), OcpError> {
        crate::ocp::formulation::functions::weights::check::<F, T>(&self.weights, true)
    }
    fn term(&self, show: TermWriter<'_>) -> fmt::Result {
        show(format_args!("½∫‖{}‖²_W dt", F::STRUCTURE.name))
    }
    fn prepare(&mut self) {}
    fn terms(&self) -> IntegralTerms<'_, T> {
        IntegralTerms {
            value: self.value,
            x: self.grad_x0.as_slice(),
            u: self.grad_u.as_slice(),
            p: self.grad_p.as_slice(),
            hessian: [self.h_xx.as_slice(), self.h_xu.as_slice(), self.h_uu.as_slice()],
            hessian_p: [self.h_xp.as_slice(), self.h_up.as_slice(), self.h_pp.as_slice()],
        }
    }
}

impl<M: Dae, F: Function<Shape = M::Shape, Outputs = crate::shape::Count<1>>, T: Real> IntegralCost<M, T>
    for Quadrature<F, T>
{
    fn term(&self, show: TermWriter<'_>) -> fmt::Result {
        show(format_args!("∫{} dt", F::STRUCTURE.name))
    }
    fn prepare(&mut self) {
        self.nu.as_mut_slice().fill(T::ONE);
    }
    fn terms(&self) -> IntegralTerms<'_, T> {
        IntegralTerms {
            value: self.q.as_slice().first().copied().unwrap_or(T::ZERO),
            x: self.dq_dx0.as_slice(),
            u: self.dq_du.as_slice(),
            p: self.dq_dp.as_slice(),
            ..IntegralTerms::default()
        }
    }
}

macro_rules! single {
    ($module:ident, $model:ident $(, $nu:ident)?) => {
        impl<M: $model, B, const S: usize, T: Real, W: WithForward> Dynamics<T>
            for $module::Integrator<M, B, S, T, W>
        {
            type Shape = M::Shape;
            const NAMES: Names = names::<M>();
            const ALGEBRAIC: bool = true;
            const STRUCTURE: DynamicsStructure = model_structure::<M>();

            fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |integrator, at, x, u| {
                    integrator.begin(at)?;
                    Ok(integrator.solve(x, u, at.h)?.into())
                })
            }
            fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |integrator, at, x, u| {
                    integrator.begin(at)?;
                    Ok(integrator.forward(x, u, at.h)?.into())
                })
            }
            #[cfg(feature = "alloc")]
            fn inside(
                &mut self,
                nodes: &Nodes<'_, T>,
                parts: &[T],
                sink: Sink<'_, T>,
            ) -> Result<bool, OcpError> {
                for_each_interval_inside(self, nodes, parts, sink)
            }
        }

        impl<M: $model, B, const S: usize, T: Real, W: WithHessian> SecondOrder<T>
            for $module::Integrator<M, B, S, T, W>
        {
            fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |integrator, at, x, u| {
                    integrator.begin(at)?;
                    let lambda = vector(at.multipliers);
                    Ok(integrator.hessian_with_quadrature(x, u, at.h, &lambda, $(at.$nu,)? None)?.into())
                })
            }
        }

        impl<M: $model, B, const S: usize, T: Real, W: WithForward, Q: IntegralCost<M, T>> Dynamics<T>
            for WithIntegral<$module::Integrator<M, B, S, T, W>, Q>
        {
            type Shape = M::Shape;
            const NAMES: Names = names::<M>();
            const ALGEBRAIC: bool = true;
            const INTEGRAL: bool = true;

            fn check(&self) -> Result<(), OcpError> {
                self.integral.check()
            }
            fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
                self.integral.term(show)
            }
            fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |Self { integrator, integral }, at, x, u| {
                    integrator.begin(at)?;
                    integral.prepare();
                    let result = integrator.with(integral).solve(x, u, at.h)?;
                    let cost = IntegralTerms { value: integral.terms().value, ..IntegralTerms::default() };
                    Ok(IntervalResult { cost, ..result.into() })
                })
            }
            fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |Self { integrator, integral }, at, x, u| {
                    integrator.begin(at)?;
                    integral.prepare();
                    let result = integrator.with(integral).forward(x, u, at.h)?;
                    Ok(IntervalResult { cost: integral.terms(), ..result.into() })
                })
            }
            #[cfg(feature = "alloc")]
            fn inside(
                &mut self,
                nodes: &Nodes<'_, T>,
                parts: &[T],
                sink: Sink<'_, T>,
            ) -> Result<bool, OcpError> {
                for_each_interval_inside(&mut self.integrator, nodes, parts, sink)
            }
        }

        impl<M: $model, B, const S: usize, T: Real, W: WithHessian, Q: IntegralCost<M, T>> SecondOrder<T>
            for WithIntegral<$module::Integrator<M, B, S, T, W>, Q>
        {
            fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
                each::<M, T, _>(self, nodes, sink, |Self { integrator, integral }, at, x, u| {
                    integrator.begin(at)?;
                    integral.prepare();
                    let lambda = vector(at.multipliers);
                    let along: Option<&mut dyn Integrand<M, T>> = Some(&mut *integral);
                    let result = integrator.hessian_with_quadrature(x, u, at.h, &lambda, $(at.$nu,)? along)?;
                    // The Hessian of the integrator contains that of the integral.
                    let cost = IntegralTerms { hessian: [&[]; 3], hessian_p: [&[]; 3], ..integral.terms() };
                    Ok(IntervalResult { cost, ..result.into() })
                })
            }
        }
    };
}

single!(irk, Dae, nu);
single!(erk, Ode);
