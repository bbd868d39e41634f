//! Convex functions of residuals as costs at the nodes.

use crate::function::{ArrayV, ArrayY, Function, MatrixYY};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::cost::{Cost, CostContext, TermWriter};
use crate::ocp::formulation::functions::least_squares::{GaussNewtonTerms, subtract_reference_derivatives};
use crate::ocp::formulation::functions::node_evaluation::{
    AvailableVariables, ParameterDerivatives, QuadraticTerms, check_finite_value, depends_on_algebraic,
};
use crate::scalar::Real;
use crate::shape::{Matrix, Outputs, Plain, Shape};
use bytemuck::Zeroable;
use core::fmt;

/// A convex function `φ(r)` of a residual with `NY` elements.
///
/// A user-defined function, `¼ r⁴` of every residual:
///
/// ```
/// use casados::ocp::{Convex, ConvexCost, HeapSqp, Horizon, Map, Problem};
/// use casados::prelude::*;
///
/// #[derive(Clone)]
/// struct Quartic;
/// impl Convex<f64> for Quartic {
///     fn evaluate(&self, r: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
///         for (i, r) in r.iter().enumerate() {
///             (gradient[i], hessian[i * (gradient.len() + 1)]) = (r.powi(3), 3.0 * r * r);
///         }
///         r.iter().map(|r| 0.25 * r.powi(4)).sum()
///     }
/// }
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// #[function]
/// fn end(x: f64, _u: f64) -> f64 { x }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(ConvexCost::<Both, _>::new(Quartic))
///     .terminal_cost(ConvexCost::<End, _>::new(Quartic))
///     .on(Horizon::uniform(1, 1.0))?;
/// ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.3])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// // u³ + (1 + u)³ = 0
/// assert!((ocp.stage(0)?.u[0] + 0.5).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Convex<T> {
    /// Returns `φ(r)` and writes its gradient, `NY`, and its Hessian, `NY × NY` with both
    /// triangles, which is symmetric and positive semidefinite. Both are zero before the call.
    fn evaluate(&self, r: &[T], gradient: &mut [T], hessian: &mut [T]) -> T;

    /// Checks the constants of the function.
    ///
    /// # Errors
    /// The first invalid constant; problems return it as
    /// [`OcpError::InvalidWeight`](crate::ocp::OcpError::InvalidWeight).
    fn check(&self) -> Result<(), InvalidConstant> {
        Ok(())
    }
}

/// An invalid constant of a [`Convex`] function.
///
/// ```
/// use casados::ocp::{Convex, Huber};
///
/// let invalid = Huber { weights: [1.0, 1.0], delta: [0.5, 0.0] }.check().unwrap_err();
/// assert_eq!((invalid.output, invalid.value), (1, 0.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvalidConstant {
    /// The index of its residual.
    pub output: usize,
    /// Its value.
    pub value: f64,
    /// The requirement.
    pub allowed: &'static str,
}

/// The Huber function with a weight for each residual: `½ w r²` if `|r| ≤ δ`, otherwise
/// `w δ (|r| − ½ δ)`. The gradient of outliers is bounded.
///
/// P. J. Huber, "Robust estimation of a location parameter", Ann. Math. Statist. 35 (1964).
///
/// ```
/// use casados::ocp::{Convex, Huber};
///
/// // ½ r² up to 0.5, then linear; gradient and Hessian are zero before.
/// let huber = Huber { weights: [1.0], delta: [0.5] };
/// let (mut gradient, mut hessian) = ([0.0], [0.0]);
/// assert_eq!(huber.evaluate(&[2.0], &mut gradient, &mut hessian), 0.5 * (2.0 - 0.25));
/// assert_eq!((gradient, hessian), ([0.5], [0.0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Huber<T, const NY: usize> {
    /// The nonnegative weights `w`.
    pub weights: [T; NY],
    /// The positive thresholds `δ`, in the units of the residuals.
    pub delta: [T; NY],
}

/// The pseudo-Huber function, a smooth form of [`Huber`] with second derivatives everywhere:
/// `w δ² (√(1 + (r/δ)²) − 1)`.
///
/// ```
/// use casados::ocp::{Convex, PseudoHuber};
///
/// let smooth = PseudoHuber { weights: [1.0], delta: [1.0] };
/// let (mut gradient, mut hessian) = ([0.0], [0.0]);
/// let value = smooth.evaluate(&[3.0_f64.sqrt()], &mut gradient, &mut hessian);
/// assert!((value - 1.0).abs() < 1e-15); // √(1 + 3) − 1
/// assert!((gradient[0] - 0.75_f64.sqrt()).abs() < 1e-15); // r/√(1 + r²)
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PseudoHuber<T, const NY: usize> {
    /// The nonnegative weights `w`.
    pub weights: [T; NY],
    /// The positive thresholds `δ`, in the units of the residuals.
    pub delta: [T; NY],
}

/// Evaluates `Σ w_i f(r_i, δ_i)`, where `f` returns its value and its first and second derivative.
fn evaluate_separable<T: Real, const NY: usize>(
    [weights, delta]: [&[T; NY]; 2],
    r: &[T],
    [gradient, hessian]: [&mut [T]; 2],
    f: impl Fn(T, T) -> [T; 3],
) -> T {
    let mut sum = T::ZERO;
    let diagonal_elements = gradient.iter_mut().zip(hessian.iter_mut().step_by(NY + 1));
    for ((&r, (&weight, &delta)), (slope, curvature)) in
        r.iter().zip(weights.iter().zip(delta)).zip(diagonal_elements)
    {
        let [value, first, second] = f(r, delta);
        sum = sum + weight * value;
        (*slope, *curvature) = (weight * first, weight * second);
    }
    sum
}

/// Checks that weights are nonnegative and `δ` positive.
fn check_constants<T: Real>(weights: &[T], delta: &[T]) -> Result<(), InvalidConstant> {
    let invalid = |output, value, allowed| Err(InvalidConstant { output, value, allowed });
    for (i, (weight, delta)) in weights.iter().zip(delta).enumerate() {
        let (weight, delta) = (weight.to_f64(), delta.to_f64());
        if !(weight >= 0.0 && weight.is_finite()) {
            return invalid(i, weight, "finite and at least 0");
        }
        if !(delta > 0.0 && delta.is_finite()) {
            return invalid(i, delta, "finite and positive: it is the `delta` of Huber's function");
        }
    }
    Ok(())
}

impl<T: Real, const NY: usize> Convex<T> for Huber<T, NY> {
    fn evaluate(&self, r: &[T], gradient: &mut [T], hessian: &mut [T]) -> T {
        let half = T::from_f64(0.5);
        evaluate_separable([&self.weights, &self.delta], r, [gradient, hessian], |r, delta| {
            if r.abs() <= delta {
                [half * r * r, r, T::ONE]
            } else {
                let force = if r < T::ZERO { -delta } else { delta };
                [delta * (r.abs() - half * delta), force, T::ZERO]
            }
        })
    }
    fn check(&self) -> Result<(), InvalidConstant> {
        check_constants(&self.weights, &self.delta)
    }
}

impl<T: Real, const NY: usize> Convex<T> for PseudoHuber<T, NY> {
    fn evaluate(&self, r: &[T], gradient: &mut [T], hessian: &mut [T]) -> T {
        evaluate_separable([&self.weights, &self.delta], r, [gradient, hessian], |r, delta| {
            let ratio = r / delta;
            let root = (T::ONE + ratio * ratio).sqrt();
            // `√(1 + a²) − 1` without cancellation.
            [r * r / (T::ONE + root), r / root, T::ONE / (root * root * root)]
        })
    }
    fn check(&self) -> Result<(), InvalidConstant> {
        check_constants(&self.weights, &self.delta)
    }
}

/// `φ(y − r)`: a convex function `φ` of the outputs `y(x, z, u, p, t)` of a function minus the
/// reference `r` of the stage. `φ` is [`Huber`], [`PseudoHuber`], or a user-defined [`Convex`].
///
/// Its Hessian is the generalised Gauss-Newton matrix `Jᵀ ∇²φ J`, which is positive semidefinite;
/// the exact Hessian adds `Σ_i ∂φ/∂r_i ∇²y_i`. [`LeastSquaresCost`](crate::ocp::LeastSquaresCost)
/// is the case `φ = ½ ‖·‖²`. References are zero by default.
///
/// N. N. Schraudolph, "Fast curvature matrix-vector products for second-order gradient descent",
/// Neural Comput. 14 (2002); F. Messerer, K. Baumgärtner, M. Diehl, "Survey of sequential convex
/// programming and generalized Gauss-Newton methods", ESAIM: Proc. Surv. 71 (2021).
///
/// # Example
/// For the data 0, 0.2, 0.4 and 10 the outlier contributes only `δ = 1` to the gradient:
/// `3 x = 0.6 + 1`.
/// ```
/// use casados::ocp::{ConvexCost, HeapSqp, Horizon, Huber, Map, Problem};
/// use casados::prelude::*;
///
/// #[function]
/// fn stays(x: f64, _u: f64) -> f64 { x }
/// #[function]
/// fn state(x: f64, _u: f64) -> f64 { x }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
///
/// let stage = Huber { weights: [1.0, 1.0], delta: [1.0, 1.0] };
/// let last = Huber { weights: [1.0], delta: [1.0] };
/// let mut ocp = Problem::new(Map::<Stays, f64>::new())
///     .stage_cost(ConvexCost::<Both, _>::new(stage))
///     .terminal_cost(ConvexCost::<State, _>::new(last))
///     .on(Horizon::uniform(3, 1.0))?;
/// ocp.free_initial_state().guess(&[0.0], &[0.0])?;
/// for (k, data) in [0.0, 0.2, 0.4].into_iter().enumerate() {
///     ocp.set_reference(k..=k, &[data, 0.0])?;
/// }
/// ocp.set_terminal_reference(&[10.0])?;
/// let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
/// assert!(outcome.is_converged());
/// assert!((ocp.stage(0)?.x[0] - 1.6 / 3.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ConvexCost<F: Function, C, T: Plain = f64> {
    /// `φ`, whose constants may be changed.
    pub outer: C,
    y: ArrayY<F, T>,
    /// `∂φ/∂r` and `∂²φ/∂r²`.
    mu: ArrayY<F, T>,
    phi: MatrixYY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
}

impl<F: Function, C: Clone, T: Plain> Clone for ConvexCost<F, C, T> {
    fn clone(&self) -> Self {
        let Self { outer, y, mu, phi, jacobian, hessian } = self;
        let outer = outer.clone();
        Self { outer, y: *y, mu: *mu, phi: *phi, jacobian: *jacobian, hessian: *hessian }
    }
}

impl<F: Function, C: core::fmt::Debug, T: Plain> core::fmt::Debug for ConvexCost<F, C, T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let name = F::STRUCTURE.name;
        f.debug_struct("ConvexCost")
            .field("function", &name)
            .field("outer", &self.outer)
            .finish_non_exhaustive()
    }
}

impl<F: Function, C: Convex<T>, T: Real> ConvexCost<F, C, T> {
    /// The cost of a convex function. `Problem::on` and every linearisation reject invalid
    /// constants: [`OcpError::InvalidWeight`].
    #[must_use]
    pub fn new(outer: C) -> Self {
        let mut cost = Self {
            outer,
            y: Zeroable::zeroed(),
            mu: Zeroable::zeroed(),
            phi: Zeroable::zeroed(),
            jacobian: Zeroable::zeroed(),
            hessian: Zeroable::zeroed(),
        };
        F::jacobian_constants::<T>(&mut cost.jacobian);
        cost
    }

    /// Evaluates `φ` and its derivatives at the outputs.
    fn evaluate(&mut self, reference: &[T], stage: usize) -> Result<T, OcpError> {
        let Self { outer, y, mu, phi, .. } = self;
        for (y, &r) in y.as_mut().iter_mut().zip(reference) {
            *y = *y - r;
        }
        mu.as_mut().fill(T::ZERO);
        phi.as_mut_slice().fill(T::ZERO);
        let value = outer.evaluate(y.as_ref(), mu.as_mut(), phi.as_mut_slice());
        let derivatives = mu.as_ref().iter().chain(phi.as_slice());
        let value = derivatives.fold(value, |value, &d| if d.is_finite() { value } else { d });
        let value = check_finite_value::<F, T>(y, value, stage)?;
        for k in 0..F::Outputs::NY {
            let curvature = phi[(k, k)];
            if curvature < T::ZERO {
                let (outputs, allowed) = ([k, k], "at least 0: the outer function must be convex");
                let (function, value) = (F::STRUCTURE.name, curvature.to_f64());
                return Err(OcpError::InvalidWeight { function, outputs, value, allowed });
            }
        }
        Ok(value)
    }
}

#[diagnostic::do_not_recommend]
impl<S: Shape, F: Function<Shape = S>, C: Convex<T>, T: Real> Cost<S, T> for ConvexCost<F, C, T> {
    const REFERENCES: usize = F::Outputs::NY;
    const CONVEX: bool = true;
    const CONVEX_IN_VARIABLES: bool = F::STRUCTURE.hessian.is_empty();
    const ALGEBRAIC: bool = depends_on_algebraic::<F>();

    fn check(&self, there: AvailableVariables) -> Result<(), OcpError> {
        Cost::<F::Shape, T>::check_weights(self)?;
        there.check::<F>()
    }

    fn check_weights(&self) -> Result<(), OcpError> {
        self.outer.check().map_err(|InvalidConstant { output, value, allowed }| {
            let outputs = [output, output];
            OcpError::InvalidWeight { function: F::STRUCTURE.name, outputs, value, allowed }
        })
    }

    fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
        show(format_args!("φ({} − r)", F::STRUCTURE.name))
    }

    fn name(reference: usize) -> (&'static str, usize) {
        (F::STRUCTURE.name, reference)
    }

    fn value(&mut self, v: &ArrayV<F, T>, reference: &[T], stage: usize) -> Result<T, OcpError> {
        F::value::<T>(v, &mut self.y);
        self.evaluate(reference, stage)
    }

    fn add_derivatives(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        at: CostContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) -> Result<T, OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        let value = self.evaluate(reference, at.stage)?;
        let Self { mu, phi, jacobian, hessian, .. } = self;
        // Relative to a point `v` the gradient is `Jᵀ (φ′ − φ″ J v)`.
        let y = &Zeroable::zeroed();
        GaussNewtonTerms::<F, T> { weights: phi, y, jacobian, context: at, terms: &mut *terms }
            .add_coupled(mu);
        if at.exact {
            terms.add_weighted_hessian::<F>(v, mu, at.factor, hessian);
        }
        Ok(at.factor * value)
    }

    fn add_parameter_derivatives(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        context: CostContext<'_, T>,
        cross: &mut ParameterDerivatives<'_, T>,
    ) -> Result<(), OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        self.evaluate(reference, context.stage)?;
        let Self { mu, phi, jacobian, hessian, .. } = self;
        cross.gauss_newton::<F>(jacobian, mu, phi, context.factor);
        if context.exact {
            cross.add_weighted_hessian::<F>(v, mu, context.factor, hessian);
        }
        Ok(())
    }

    fn add_reference_derivatives(
        &mut self,
        (v, direction): (&ArrayV<F, T>, Option<&ArrayV<F, T>>),
        reference: &[T],
        context: CostContext<'_, T>,
        to: &mut [T],
    ) -> Result<(), OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        self.evaluate(reference, context.stage)?;
        subtract_reference_derivatives::<F, T>(
            (&self.phi, &self.mu),
            (&self.jacobian, direction),
            context.factor,
            to,
        );
        Ok(())
    }
}
