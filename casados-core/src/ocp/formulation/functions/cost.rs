//! Costs at the nodes.

use crate::function::{ArrayV, ArrayY, Function};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::node_evaluation::{
    AvailableVariables, ParameterDerivatives, QuadraticTerms, check_finite_value, depends_on_algebraic,
    parameter_index,
};
use crate::ocp::formulation::functions::sparsity::{self, EntryVisitor};
use crate::scalar::Real;
use crate::shape::{Array, Plain, Shape, plain};
use bytemuck::Zeroable;
use core::fmt;

/// A cost at a node, as a function of `(x, z, u, p, t)`. `()` is no cost, a pair is the sum of
/// both.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # #[function]
/// # fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// # let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
/// #     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// # ocp.guess(&[0.0, 0.0], &[0.0])?;
/// /// A cart with any cost, or a pair of them.
/// fn effortless<C>(cost: C) -> Result<f64, Box<dyn std::error::Error>>
/// where
///     C: CostOf<Irk<Cart, Gauss<2>>, f64>,
/// {
///     let irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
///     let mut ocp = Problem::new(irk).stage_cost(cost).on(Horizon::uniform(2, 0.5))?;
///     ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[1.0, 0.0], &[3.0])?;
///     HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
///     Ok(ocp.stage(0)?.u[0])
/// }
/// let least = || LeastSquaresCost::<Effort>::diagonal(&[1.0]);
/// assert!(effortless(least())?.abs() < 1e-7 && effortless((least(), least()))?.abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Cost<S: Shape, T: Real> {
    /// The number of elements of a reference.
    const REFERENCES: usize;
    /// Whether the Hessian that [`Cost::add_derivatives`] adds is positive semidefinite if the
    /// exact one is not requested.
    const CONVEX: bool;
    /// Whether it is known to be a convex function of the variables, because its outputs are
    /// linear.
    #[doc(hidden)]
    const CONVEX_IN_VARIABLES: bool = false;
    /// Whether it depends on algebraic states.
    const ALGEBRAIC: bool;

    /// Checks that it depends on available variables only, and that its weights are valid.
    ///
    /// # Errors
    /// [`OcpError::NotThere`], [`OcpError::InvalidWeight`]
    #[doc(hidden)]
    fn check(&self, there: AvailableVariables) -> Result<(), OcpError>;

    /// Checks its weights, which may have changed since [`Cost::check`].
    ///
    /// # Errors
    /// [`OcpError::InvalidWeight`]
    #[doc(hidden)]
    fn check_weights(&self) -> Result<(), OcpError> {
        Ok(())
    }

    /// Returns the function and the output of an element of the reference.
    #[doc(hidden)]
    fn name(reference: usize) -> (&'static str, usize) {
        ("", reference)
    }

    /// Prints its terms as formulas.
    ///
    /// # Errors
    /// The errors of `show`.
    #[doc(hidden)]
    fn terms(&self, show: TermWriter<'_>) -> fmt::Result;

    /// Visits the structural entries of the exact Hessian over `(x, u, z)`; returns false if these
    /// are unknown.
    #[doc(hidden)]
    fn visit_sparsity(&self, visit: EntryVisitor<'_>) -> bool {
        let _ = visit;
        false
    }

    /// Returns the value at a point.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn value(&mut self, v: &S::ArrayV<T>, reference: &[T], stage: usize) -> Result<T, OcpError>;

    /// Returns the value at a point times the factor; adds gradient and Hessian times the factor.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_derivatives(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        context: CostContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) -> Result<T, OcpError>;

    /// Adds the derivatives of the gradient by the parameters, and gradient and Hessian with
    /// respect to the parameters, times the factor.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_parameter_derivatives(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        context: CostContext<'_, T>,
        cross: &mut ParameterDerivatives<'_, T>,
    ) -> Result<(), OcpError>;

    /// Adds the derivative by the reference, times the factor: of the value at a point, or, if a
    /// direction is given, of the directional derivative of the value.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn add_reference_derivatives(
        &mut self,
        point: (&S::ArrayV<T>, Option<&S::ArrayV<T>>),
        reference: &[T],
        context: CostContext<'_, T>,
        to: &mut [T],
    ) -> Result<(), OcpError> {
        let _ = (point, reference, context, to);
        Ok(())
    }
}

/// Receives the terms of an objective.
pub type TermWriter<'a> = &'a mut dyn FnMut(fmt::Arguments<'_>) -> fmt::Result;

/// The stage, the factor and the kind of Hessian.
#[derive(Clone, Copy, Debug)]
pub struct CostContext<'a, T> {
    pub(in crate::ocp) stage: usize,
    pub(in crate::ocp) factor: T,
    pub(in crate::ocp) exact: bool,
    /// `(x, u)` if the gradient is that of the quadratic model at zero, `∇f − H (x, u)` with the
    /// added [convex](Cost::CONVEX) Hessian `H`; otherwise empty.
    pub(in crate::ocp) model_origin: &'a [T],
}

impl<S: Shape, T: Real> Cost<S, T> for () {
    const REFERENCES: usize = 0;
    const CONVEX: bool = true;
    const CONVEX_IN_VARIABLES: bool = true;
    const ALGEBRAIC: bool = false;
    fn check(&self, _: AvailableVariables) -> Result<(), OcpError> {
        Ok(())
    }
    fn terms(&self, _: TermWriter<'_>) -> fmt::Result {
        Ok(())
    }
    fn visit_sparsity(&self, _: EntryVisitor<'_>) -> bool {
        true
    }
    fn value(&mut self, _: &S::ArrayV<T>, _: &[T], _: usize) -> Result<T, OcpError> {
        Ok(T::ZERO)
    }
    fn add_derivatives(
        &mut self,
        _: &S::ArrayV<T>,
        _: &[T],
        _: CostContext<'_, T>,
        _: &mut QuadraticTerms<'_, T>,
    ) -> Result<T, OcpError> {
        Ok(T::ZERO)
    }
    fn add_parameter_derivatives(
        &mut self,
        _: &S::ArrayV<T>,
        _: &[T],
        _: CostContext<'_, T>,
        _: &mut ParameterDerivatives<'_, T>,
    ) -> Result<(), OcpError> {
        Ok(())
    }
}

/// The reference of `A` is followed by that of `B`.
impl<S: Shape, T: Real, A: Cost<S, T>, B: Cost<S, T>> Cost<S, T> for (A, B) {
    const REFERENCES: usize = A::REFERENCES + B::REFERENCES;
    const CONVEX: bool = A::CONVEX && B::CONVEX;
    const CONVEX_IN_VARIABLES: bool = A::CONVEX_IN_VARIABLES && B::CONVEX_IN_VARIABLES;
    const ALGEBRAIC: bool = A::ALGEBRAIC || B::ALGEBRAIC;
    fn check(&self, there: AvailableVariables) -> Result<(), OcpError> {
        self.0.check(there)?;
        self.1.check(there)
    }
    fn check_weights(&self) -> Result<(), OcpError> {
        self.0.check_weights()?;
        self.1.check_weights()
    }
    fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
        self.0.terms(show)?;
        self.1.terms(show)
    }
    fn visit_sparsity(&self, visit: EntryVisitor<'_>) -> bool {
        self.0.visit_sparsity(visit) && self.1.visit_sparsity(visit)
    }
    fn name(reference: usize) -> (&'static str, usize) {
        match reference.checked_sub(A::REFERENCES) {
            None => A::name(reference),
            Some(reference) => B::name(reference),
        }
    }
    fn value(&mut self, v: &S::ArrayV<T>, reference: &[T], stage: usize) -> Result<T, OcpError> {
        let (first, second) = reference.split_at_checked(A::REFERENCES).unwrap_or_default();
        Ok(self.0.value(v, first, stage)? + self.1.value(v, second, stage)?)
    }
    fn add_derivatives(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        context: CostContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) -> Result<T, OcpError> {
        let (first, second) = reference.split_at_checked(A::REFERENCES).unwrap_or_default();
        Ok(self.0.add_derivatives(v, first, context, terms)?
            + self.1.add_derivatives(v, second, context, terms)?)
    }
    fn add_parameter_derivatives(
        &mut self,
        v: &S::ArrayV<T>,
        reference: &[T],
        context: CostContext<'_, T>,
        cross: &mut ParameterDerivatives<'_, T>,
    ) -> Result<(), OcpError> {
        let (first, second) = reference.split_at_checked(A::REFERENCES).unwrap_or_default();
        self.0.add_parameter_derivatives(v, first, context, cross)?;
        self.1.add_parameter_derivatives(v, second, context, cross)
    }
    fn add_reference_derivatives(
        &mut self,
        point: (&S::ArrayV<T>, Option<&S::ArrayV<T>>),
        reference: &[T],
        context: CostContext<'_, T>,
        to: &mut [T],
    ) -> Result<(), OcpError> {
        let (first, second) = reference.split_at_checked(A::REFERENCES).unwrap_or_default();
        let (to_first, to_second) = to.split_at_mut_checked(A::REFERENCES).unwrap_or_default();
        self.0.add_reference_derivatives(point, first, context, to_first)?;
        self.1.add_reference_derivatives(point, second, context, to_second)
    }
}

/// The sum of all outputs `y(x, z, u, p, t)` of a function, with its exact Hessian.
///
/// If the Hessian is not positive semidefinite, the stages are convexified.
///
/// ```
/// use casados::ocp::{GeneralCost, Horizon, Problem};
/// use casados::prelude::*;
///
/// /// A cart on a rail that is pushed: position m, velocity m/s; acceleration m/s².
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
///
/// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
///     .running_cost(GeneralCost::<Effort>::new())
///     .on(Horizon::uniform(4, 0.5))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0, 0.0], &[2.0])?;
/// println!("{ocp}"); // the cost by its name
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct GeneralCost<F: Function, T: Plain = f64> {
    y: ArrayY<F, T>,
    mu: ArrayY<F, T>,
    gradient: ArrayV<F, T>,
    hessian: F::Hessian<T>,
}

plain!([F: Function, T: Plain] GeneralCost<F, T> { y, mu, gradient, hessian });

impl<F: Function, T: Plain> GeneralCost<F, T> {
    /// The cost of a function.
    #[must_use]
    pub fn new() -> Self {
        Self::zeroed()
    }
}

impl<F: Function, T: Plain> Default for GeneralCost<F, T> {
    fn default() -> Self {
        Self::zeroed()
    }
}

#[diagnostic::do_not_recommend]
impl<S: Shape, F: Function<Shape = S>, T: Real> Cost<S, T> for GeneralCost<F, T> {
    const REFERENCES: usize = 0;
    const CONVEX: bool = F::STRUCTURE.hessian.is_empty();
    const CONVEX_IN_VARIABLES: bool = F::STRUCTURE.hessian.is_empty();
    const ALGEBRAIC: bool = depends_on_algebraic::<F>();

    fn check(&self, there: AvailableVariables) -> Result<(), OcpError> {
        there.check::<F>()
    }

    fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
        show(format_args!("{}", F::STRUCTURE.name))
    }

    fn visit_sparsity(&self, visit: EntryVisitor<'_>) -> bool {
        sparsity::visit_hessian::<F>(visit);
        true
    }

    fn value(&mut self, v: &ArrayV<F, T>, _: &[T], stage: usize) -> Result<T, OcpError> {
        F::value::<T>(v, &mut self.y);
        let sum = self.y.as_ref().iter().fold(T::ZERO, |sum, &y| sum + y);
        check_finite_value::<F, T>(&self.y, sum, stage)
    }

    fn add_derivatives(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        context: CostContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) -> Result<T, OcpError> {
        let value = self.value(v, reference, context.stage)?;
        self.mu = Array::from_fn(|_| T::ONE);
        F::adjoint::<T>(v, &self.mu, &mut self.gradient);
        for (variable, &slope) in self.gradient.as_ref().iter().enumerate() {
            if let Some(i) = terms.free.position::<F::Shape>(variable) {
                terms.add_gradient(i, context.factor * slope);
            }
        }
        terms.add_weighted_hessian::<F>(v, &self.mu, context.factor, &mut self.hessian);
        Ok(context.factor * value)
    }

    fn add_parameter_derivatives(
        &mut self,
        v: &ArrayV<F, T>,
        _: &[T],
        context: CostContext<'_, T>,
        cross: &mut ParameterDerivatives<'_, T>,
    ) -> Result<(), OcpError> {
        self.mu = Array::from_fn(|_| T::ONE);
        F::adjoint::<T>(v, &self.mu, &mut self.gradient);
        for (variable, &slope) in self.gradient.as_ref().iter().enumerate() {
            if let Some(p) = parameter_index::<F::Shape>(variable) {
                cross.add_gradient(p, context.factor * slope);
            }
        }
        cross.add_weighted_hessian::<F>(v, &self.mu, context.factor, &mut self.hessian);
        Ok(())
    }
}
