//! Least-squares costs at the nodes.

use crate::function::{ArrayV, ArrayY, Function, MatrixYY};
use crate::linalg::{Arithmetic, Kernel, RowVisitor, dispatch, for_each_row};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::cost::{Cost, CostContext, TermWriter};
use crate::ocp::formulation::functions::node_evaluation::{
    AvailableVariables, ParameterDerivatives, QuadraticTerms, check_finite_value, depends_on_algebraic,
};
use crate::ocp::formulation::functions::sparsity::{self, EntryVisitor};
use crate::ocp::formulation::functions::weights;
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Outputs, Plain, Shape, plain};
use bytemuck::Zeroable;
use core::fmt;
use core::ops::Range;

/// `½ (y − r)ᵀ W (y − r)` of the outputs `y(x, z, u, p, t)` of a function and the reference `r` of
/// the stage.
///
/// Its Hessian is the Gauss-Newton matrix `JᵀWJ`; the exact Hessian adds the second derivatives of
/// `y`.
///
/// ```
/// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// /// What follows a reference: the position, and the push with little weight.
/// #[function]
/// fn track(x: [f64; 2], u: f64) -> [f64; 2] { [x[0], u] }
///
/// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
///     .stage_cost(LeastSquaresCost::<Track>::diagonal(&[1.0, 1e-6]))
///     .on(Horizon::uniform(20, 0.1))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0, 0.0], &[0.0])?;
/// ocp.set_reference(.., &[1.0, 0.0])?;
/// let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
/// assert!(sqp.solve(&mut ocp)?.is_converged());
/// assert!((ocp.solution()?.state("x[0]")?[15] - 1.0).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct LeastSquaresCost<F: Function, T: Plain = f64> {
    weights: MatrixYY<F, T>,
    /// Nonzero if `W` is not symmetric and positive semidefinite.
    has_invalid_weights: usize,
    /// Nonzero if `W` is not diagonal.
    has_full_weights: usize,
    y: ArrayY<F, T>,
    mu: ArrayY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
}

plain!([F: Function, T: Plain] LeastSquaresCost<F, T> { weights, has_invalid_weights, has_full_weights, y, mu, jacobian, hessian });

impl<F: Function, T: Real> LeastSquaresCost<F, T> {
    /// The cost with the weights `W`, a symmetric, positive semidefinite matrix.
    ///
    /// `Problem::on` and every linearisation reject other weights: [`OcpError::InvalidWeight`].
    #[must_use]
    pub fn new(weights: &MatrixYY<F, T>) -> Self {
        let mut cost: Self = Zeroable::zeroed();
        cost.set_weights(weights);
        F::jacobian_constants::<T>(&mut cost.jacobian);
        cost
    }

    /// The cost with a nonnegative weight for each output.
    #[must_use]
    pub fn diagonal(weights: &ArrayY<F, T>) -> Self {
        let mut matrix: MatrixYY<F, T> = Zeroable::zeroed();
        for (i, &weight) in weights.as_ref().iter().enumerate() {
            matrix[(i, i)] = weight;
        }
        Self::new(&matrix)
    }

    /// Changes the weights, as in [`LeastSquaresCost::new`].
    pub fn set_weights(&mut self, weights: &MatrixYY<F, T>) {
        let elements = || (0..F::Outputs::NY).flat_map(|i| (0..i).map(move |j| (i, j)));
        self.has_full_weights =
            usize::from(elements().any(|(i, j)| weights[(i, j)] != T::ZERO || weights[(j, i)] != T::ZERO));
        self.weights = *weights;
        self.has_invalid_weights =
            usize::from(weights::check::<F, T>(weights, self.has_full_weights != 0).is_err());
    }

    /// Computes `μ = W (y − r)`, and returns `½ (y − r)ᵀ μ`.
    #[inline(always)]
    fn weighted_square(&mut self, reference: &[T], stage: usize) -> Result<T, OcpError> {
        let Self { weights, has_full_weights: coupled, y, mu, .. } = self;
        for (y, &r) in y.as_mut().iter_mut().zip(reference) {
            *y = *y - r;
        }
        apply_weights::<F, T>(weights, *coupled, y, mu);
        let products = y.as_ref().iter().zip(mu.as_ref()).map(|(y, mu)| *y * *mu);
        let square = products.fold(T::ZERO, |sum, product| sum + product);
        check_finite_value::<F, T>(y, T::from_f64(0.5) * square, stage)
    }
}

/// Computes `μ = W y`.
#[inline(always)]
fn apply_weights<F: Function, T: Real>(
    weights: &MatrixYY<F, T>,
    coupled: usize,
    y: &ArrayY<F, T>,
    mu: &mut ArrayY<F, T>,
) {
    for (k, mu) in mu.as_mut().iter_mut().enumerate() {
        *mu = if coupled == 0 {
            weights[(k, k)] * y[k]
        } else {
            let products = y.as_ref().iter().enumerate().map(|(l, y)| weights[(k, l)] * *y);
            products.fold(T::ZERO, |sum, product| sum + product)
        };
    }
}

/// Subtracts `φ′`, or for a direction `d` `φ″ J d`, times a factor: the negative derivative of
/// `φ(y − r)` by `r`.
pub(in crate::ocp) fn subtract_reference_derivatives<F: Function, T: Real>(
    (second, first): (&MatrixYY<F, T>, &ArrayY<F, T>),
    (jacobian, direction): (&F::Jacobian<T>, Option<&ArrayV<F, T>>),
    factor: T,
    to: &mut [T],
) {
    let Some(direction) = direction else {
        to.iter_mut().zip(first.as_ref()).for_each(|(to, &mu)| *to = *to - factor * mu);
        return;
    };
    for ((output, variable), &slope) in F::STRUCTURE.jacobian.iter().zip(jacobian.as_ref()) {
        let directional_derivative =
            factor * slope * direction.as_ref().get(variable).copied().unwrap_or(T::ZERO);
        for (k, to) in to.iter_mut().enumerate() {
            *to = *to - second[(k, output)] * directional_derivative;
        }
    }
}

#[diagnostic::do_not_recommend]
impl<S: Shape, F: Function<Shape = S>, T: Real> Cost<S, T> for LeastSquaresCost<F, T> {
    const REFERENCES: usize = F::Outputs::NY;
    const CONVEX: bool = true;
    const CONVEX_IN_VARIABLES: bool = F::STRUCTURE.hessian.is_empty();
    const ALGEBRAIC: bool = depends_on_algebraic::<F>();

    fn check(&self, there: AvailableVariables) -> Result<(), OcpError> {
        self.check_weights()?;
        there.check::<F>()
    }

    fn check_weights(&self) -> Result<(), OcpError> {
        match self.has_invalid_weights {
            0 => Ok(()),
            _ => weights::check::<F, T>(&self.weights, self.has_full_weights != 0),
        }
    }

    fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
        show(format_args!("½‖{} − r‖²_W", F::STRUCTURE.name))
    }

    fn visit_sparsity(&self, visit: EntryVisitor<'_>) -> bool {
        sparsity::visit_gauss_newton::<F>(self.has_full_weights != 0, visit);
        sparsity::visit_hessian::<F>(visit);
        true
    }

    fn name(reference: usize) -> (&'static str, usize) {
        (F::STRUCTURE.name, reference)
    }

    fn value(&mut self, v: &ArrayV<F, T>, reference: &[T], stage: usize) -> Result<T, OcpError> {
        F::value::<T>(v, &mut self.y);
        self.weighted_square(reference, stage)
    }

    fn add_derivatives(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        at: CostContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) -> Result<T, OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        let value = self.weighted_square(reference, at.stage)?;
        let Self { weights, has_full_weights: coupled, y, mu, jacobian, hessian, .. } = self;
        let mut gauss_newton =
            GaussNewtonTerms::<F, T> { weights, y, jacobian, context: at, terms: &mut *terms };
        if *coupled == 0 && !gauss_newton.depends_on_free_parameters() {
            dispatch(gauss_newton);
        } else {
            gauss_newton.add_coupled(&Zeroable::zeroed());
        }
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
        self.weighted_square(reference, context.stage)?;
        let Self { weights, mu, jacobian, hessian, .. } = self;
        cross.gauss_newton::<F>(jacobian, mu, weights, context.factor);
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
        self.weighted_square(reference, context.stage)?;
        subtract_reference_derivatives::<F, T>(
            (&self.weights, &self.mu),
            (&self.jacobian, direction),
            context.factor,
            to,
        );
        Ok(())
    }
}

/// Adds gradient and Hessian, `JᵀW (y − r)` and `JᵀWJ`; relative to a point `v` the gradient is
/// `Jᵀ W (y − r) − JᵀWJ v = JᵀW (y − r − J v)`.
pub(in crate::ocp) struct GaussNewtonTerms<'a, 'b, F: Function, T: Plain> {
    pub weights: &'a MatrixYY<F, T>,
    /// `y − r`
    pub y: &'a ArrayY<F, T>,
    pub jacobian: &'a F::Jacobian<T>,
    pub context: CostContext<'a, T>,
    pub terms: &'a mut QuadraticTerms<'b, T>,
}

impl<F: Function, T: Real> GaussNewtonTerms<'_, '_, F, T> {
    /// Returns the range of the entries of an output.
    #[inline(always)]
    fn entry_range(output: usize) -> Range<usize> {
        let begin = |output: usize| F::STRUCTURE.begins.get(output).map_or(0, |&begin| begin as usize);
        begin(output)..begin(output + 1)
    }

    /// Returns an entry, as a position in `(x, w, u, z)` and a value.
    #[inline(always)]
    fn entry(&self, place: usize) -> Option<(usize, T)> {
        let entry = *F::STRUCTURE.by_row.get(place)? as usize;
        let (_, variable) = F::STRUCTURE.jacobian.get(entry)?;
        Some((self.terms.free.position::<F::Shape>(variable)?, *self.jacobian.as_ref().get(entry)?))
    }

    /// Returns the weight of two outputs, without a panic branch.
    #[inline(always)]
    fn weight(&self, k: usize, l: usize) -> T {
        let weight = self.weights.as_slice().get(l * F::Outputs::NY + k);
        self.context.factor * weight.copied().unwrap_or(T::ZERO)
    }

    /// Returns `y − r`, or `y − r − J v`, of an output.
    #[inline(always)]
    fn shifted_residual(&self, output: usize) -> T {
        let mut y = self.y.as_ref().get(output).copied().unwrap_or(T::ZERO);
        for place in Self::entry_range(output) {
            if let Some((i, value)) = self.entry(place)
                && let Some(&v) = self.context.model_origin.get(i)
            {
                y = y - value * v;
            }
        }
        y
    }

    /// Adds the Hessian term of two outputs.
    #[inline(always)]
    fn add_output_hessian(&mut self, weight: T, [k, l]: [usize; 2]) {
        for a in Self::entry_range(k) {
            for b in Self::entry_range(l) {
                if let (Some((i, a)), Some((j, b))) = (self.entry(a), self.entry(b))
                    && i >= j
                {
                    self.terms.add_hessian(i, j, weight * a * b);
                }
            }
        }
    }

    /// Adds the gradient term of an output.
    #[inline(always)]
    fn add_output_gradient(&mut self, slope: T, output: usize) {
        for place in Self::entry_range(output) {
            if let Some((i, value)) = self.entry(place) {
                self.terms.add_gradient(i, slope * value);
            }
        }
    }

    /// Returns whether the outputs depend on free parameters.
    #[inline(always)]
    fn depends_on_free_parameters(&self) -> bool {
        F::STRUCTURE.blocks[4] < F::STRUCTURE.blocks[5] && self.terms.free.count() > 0
    }

    /// As [`GaussNewtonTerms::add_coupled`], over free parameters too.
    fn add_with_free_parameters(&mut self, mu: &ArrayY<F, T>) {
        let (free, jacobian, from) = (self.terms.free, self.jacobian.as_ref(), self.context.model_origin);
        let entries = || {
            let entries = F::STRUCTURE.jacobian.iter().zip(jacobian);
            entries.filter_map(move |((k, variable), &a)| Some((k, free.position::<F::Shape>(variable)?, a)))
        };
        let mut shifted_residuals = *self.y;
        for (k, i, a) in entries() {
            if let (Some(y), Some(&v)) = (shifted_residuals.as_mut().get_mut(k), from.get(i)) {
                *y = *y - a * v;
            }
        }
        let slopes: ArrayY<F, T> = Array::from_fn(|k| {
            let explicit_gradient = self.context.factor * mu.as_ref().get(k).copied().unwrap_or(T::ZERO);
            shifted_residuals
                .as_ref()
                .iter()
                .enumerate()
                .fold(explicit_gradient, |sum, (l, &y)| sum + self.weight(k, l) * y)
        });
        for (k, i, a) in entries() {
            self.terms.add_gradient(i, slopes[k] * a);
            for (l, j, b) in entries().filter(|&(_, j, _)| j <= i) {
                self.terms.add_hessian(i, j, self.weight(k, l) * a * b);
            }
        }
    }

    /// Adds the terms with full weights, and `Jᵀ μ`.
    pub fn add_coupled(&mut self, mu: &ArrayY<F, T>) {
        if self.depends_on_free_parameters() {
            return self.add_with_free_parameters(mu);
        }
        let shifted_residuals: ArrayY<F, T> = Array::from_fn(|output| self.shifted_residual(output));
        for k in 0..F::Outputs::NY {
            let mut slope = self.context.factor * mu.as_ref().get(k).copied().unwrap_or(T::ZERO);
            for (l, &moved) in shifted_residuals.as_ref().iter().enumerate() {
                let weight = self.weight(k, l);
                if weight != T::ZERO {
                    slope = slope + weight * moved;
                    self.add_output_hessian(weight, [k, l]);
                }
            }
            self.add_output_gradient(slope, k);
        }
    }
}

/// Adds the terms with diagonal weights.
impl<F: Function, T: Real> Kernel for GaussNewtonTerms<'_, '_, F, T> {
    type Number = T;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        for_each_row::<A, _>(&mut self);
    }
}

impl<F: Function, T: Real> RowVisitor for GaussNewtonTerms<'_, '_, F, T> {
    const ROWS: Option<usize> = Some(F::Outputs::NY);
    const INSTRUCTIONS: usize = {
        let outputs = if F::Outputs::NY > 0 { F::Outputs::NY } else { 1 };
        let entries = F::STRUCTURE.by_row.len() / outputs + 1;
        4 * entries + 3 * entries * entries
    };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, output: usize) {
        let weight = self.weight(output, output);
        if weight != T::ZERO {
            self.add_output_gradient(weight * self.shifted_residual(output), output);
            self.add_output_hessian(weight, [output, output]);
        }
    }
}
