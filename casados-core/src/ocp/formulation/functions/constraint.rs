//! Constraints at the nodes.

use crate::function::{ArrayV, ArrayY, Function};
use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::node_evaluation::{
    AvailableVariables, ParameterDerivatives, QuadraticTerms, check_finite_outputs, depends_on_algebraic,
    parameter_index,
};
use crate::ocp::formulation::functions::sparsity::{self, EntryVisitor};
use crate::scalar::Real;
use crate::shape::{Array, Outputs, Plain, Shape, plain};
use bytemuck::Zeroable;

/// The node at which constraints are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintContext<'a, T> {
    pub(in crate::ocp) stage: usize,
    /// The positions of the free parameters.
    pub(in crate::ocp) free: FreeParametersView<'a>,
    /// The copies of elements of the first state, and the index of the first copy among the shared
    /// variables.
    pub(in crate::ocp) initial_state_copies: &'a [T],
    pub(in crate::ocp) first_copy: usize,
}

impl<'a, T> ConstraintContext<'a, T> {
    /// The context of a stage with the shared variables `w`, which begin with the copies.
    #[inline(always)]
    pub(in crate::ocp) fn new(stage: usize, free: FreeParametersView<'a>, w: &'a [T]) -> Self {
        Self { stage, free, initial_state_copies: w, first_copy: 0 }
    }

    /// Returns the context without the first `count` copies.
    fn skip_copies(self, count: usize) -> Self {
        Self {
            initial_state_copies: self.initial_state_copies.get(count..).unwrap_or_default(),
            first_copy: self.first_copy + count,
            ..self
        }
    }
}

/// Constraints at a node: functions of `(x, z, u, p, t)` with bounds. `()` is no constraint, a pair
/// has the rows of both.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # #[function]
/// # fn sum(x: f64, u: f64) -> f64 { x + u }
/// // Two constraints as a pair.
/// let pair = (Constraint::<Sum>::new([-1.0], [1.0]), Constraint::<Both>::new([-2.0; 2], [2.0; 2]));
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
///     .path_constraints(pair)
///     .on(Horizon::uniform(20, 0.1))?;
/// ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// assert_eq!(ocp.solution()?.constraint("Both[1]")?.len(), 20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Constraints<S: Shape, T: Real> {
    /// The number of rows.
    const ROWS: usize;
    /// Whether they depend on algebraic states.
    const ALGEBRAIC: bool;
    /// The number of elements of the first state that they depend on; the last stage has copies of
    /// these.
    const INITIAL_STATE_COPIES: usize = 0;

    /// Returns the state that a copy is equal to.
    #[doc(hidden)]
    fn copied_state(copy: usize) -> usize {
        copy
    }
    /// Checks that they depend on available variables only.
    ///
    /// # Errors
    /// [`OcpError::NotThere`]
    #[doc(hidden)]
    fn check(&self, there: AvailableVariables) -> Result<(), OcpError>;
    /// Visits the structural entries of the Jacobian and the Hessian over `(x, u, z)`; returns
    /// false if these are unknown.
    #[doc(hidden)]
    fn visit_sparsity(&self, visit: EntryVisitor<'_>) -> bool {
        let _ = visit;
        Self::ROWS == 0
    }
    /// Writes the default bounds: lower and upper bounds, linear and quadratic penalties.
    #[doc(hidden)]
    fn bounds(&self, limits: [&mut [T]; 4]);
    /// Evaluates the constraints.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn value(
        &mut self,
        v: &S::ArrayV<T>,
        values: &mut [T],
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError>;
    /// Evaluates the constraints and their Jacobian, with a column for each constraint, `ld` apart.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn linearise(
        &mut self,
        v: &S::ArrayV<T>,
        values: &mut [T],
        columns: &mut [T],
        ld: usize,
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError>;
    /// Adds the Hessian of `μᵀg`.
    #[doc(hidden)]
    fn add_hessian(
        &mut self,
        v: &S::ArrayV<T>,
        mu: &[T],
        context: ConstraintContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    );
    /// Evaluates `∂g/∂p`, a row for each constraint. If `μ` is given, adds the derivative by the
    /// parameters of the gradient of `μᵀg`.
    #[doc(hidden)]
    fn add_parameter_derivatives(
        &mut self,
        v: &S::ArrayV<T>,
        mu: Option<&[T]>,
        context: ConstraintContext<'_, T>,
        slopes: &mut [T],
        cross: &mut ParameterDerivatives<'_, T>,
    );
    /// Returns the function and the output of a row.
    #[doc(hidden)]
    fn name(row: usize) -> (&'static str, usize);
    /// Returns the unit of a row, if its function has one.
    #[doc(hidden)]
    fn unit(_row: usize) -> &'static str {
        ""
    }
}

impl<S: Shape, T: Real> Constraints<S, T> for () {
    const ROWS: usize = 0;
    const ALGEBRAIC: bool = false;
    fn check(&self, _: AvailableVariables) -> Result<(), OcpError> {
        Ok(())
    }
    fn bounds(&self, _: [&mut [T]; 4]) {}
    fn value(&mut self, _: &S::ArrayV<T>, _: &mut [T], _: ConstraintContext<'_, T>) -> Result<(), OcpError> {
        Ok(())
    }
    fn linearise(
        &mut self,
        _: &S::ArrayV<T>,
        _: &mut [T],
        _: &mut [T],
        _: usize,
        _: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError> {
        Ok(())
    }
    fn add_hessian(
        &mut self,
        _: &S::ArrayV<T>,
        _: &[T],
        _: ConstraintContext<'_, T>,
        _: &mut QuadraticTerms<'_, T>,
    ) {
    }
    fn add_parameter_derivatives(
        &mut self,
        _: &S::ArrayV<T>,
        _: Option<&[T]>,
        _: ConstraintContext<'_, T>,
        _: &mut [T],
        _: &mut ParameterDerivatives<'_, T>,
    ) {
    }
    fn name(row: usize) -> (&'static str, usize) {
        ("", row)
    }
}

impl<S: Shape, T: Real, A: Constraints<S, T>, B: Constraints<S, T>> Constraints<S, T> for (A, B) {
    const ROWS: usize = A::ROWS + B::ROWS;
    const ALGEBRAIC: bool = A::ALGEBRAIC || B::ALGEBRAIC;
    const INITIAL_STATE_COPIES: usize = A::INITIAL_STATE_COPIES + B::INITIAL_STATE_COPIES;
    fn copied_state(copy: usize) -> usize {
        match copy.checked_sub(A::INITIAL_STATE_COPIES) {
            None => A::copied_state(copy),
            Some(copy) => B::copied_state(copy),
        }
    }
    fn check(&self, there: AvailableVariables) -> Result<(), OcpError> {
        self.0.check(there)?;
        self.1.check(there)
    }
    fn visit_sparsity(&self, visit: EntryVisitor<'_>) -> bool {
        use crate::ocp::formulation::functions::sparsity::DerivativeEntry;
        let visit_shifted = &mut |entry| match entry {
            DerivativeEntry::Jacobian(row, variable) => {
                visit(DerivativeEntry::Jacobian(A::ROWS + row, variable))
            }
            DerivativeEntry::Hessian(..) => visit(entry),
        };
        self.1.visit_sparsity(visit_shifted) && self.0.visit_sparsity(visit)
    }
    fn bounds(&self, limits: [&mut [T]; 4]) {
        let [(l, lower), (u, upper), (i, linear), (q, quadratic)] =
            limits.map(|rows| rows.split_at_mut_checked(A::ROWS).unwrap_or_default());
        self.0.bounds([l, u, i, q]);
        self.1.bounds([lower, upper, linear, quadratic]);
    }
    fn value(
        &mut self,
        v: &S::ArrayV<T>,
        values: &mut [T],
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError> {
        let (first, second) = values.split_at_mut_checked(A::ROWS).unwrap_or_default();
        self.0.value(v, first, context)?;
        self.1.value(v, second, context.skip_copies(A::INITIAL_STATE_COPIES))
    }
    fn linearise(
        &mut self,
        v: &S::ArrayV<T>,
        values: &mut [T],
        columns: &mut [T],
        ld: usize,
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError> {
        let (first, second) = values.split_at_mut_checked(A::ROWS).unwrap_or_default();
        let (first_columns, second_columns) = columns.split_at_mut_checked(A::ROWS * ld).unwrap_or_default();
        self.0.linearise(v, first, first_columns, ld, context)?;
        self.1.linearise(v, second, second_columns, ld, context.skip_copies(A::INITIAL_STATE_COPIES))
    }
    fn add_hessian(
        &mut self,
        v: &S::ArrayV<T>,
        mu: &[T],
        context: ConstraintContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) {
        let (first, second) = mu.split_at_checked(A::ROWS).unwrap_or_default();
        self.0.add_hessian(v, first, context, terms);
        self.1.add_hessian(v, second, context.skip_copies(A::INITIAL_STATE_COPIES), terms);
    }
    fn add_parameter_derivatives(
        &mut self,
        v: &S::ArrayV<T>,
        mu: Option<&[T]>,
        context: ConstraintContext<'_, T>,
        slopes: &mut [T],
        cross: &mut ParameterDerivatives<'_, T>,
    ) {
        let (first_slopes, second_slopes) = slopes.split_at_mut_checked(A::ROWS * S::NP).unwrap_or_default();
        let (first, second) = mu.and_then(|mu| mu.split_at_checked(A::ROWS)).unzip();
        self.0.add_parameter_derivatives(v, first, context, first_slopes, cross);
        let context = context.skip_copies(A::INITIAL_STATE_COPIES);
        self.1.add_parameter_derivatives(v, second, context, second_slopes, cross);
    }
    fn name(row: usize) -> (&'static str, usize) {
        match row.checked_sub(A::ROWS) {
            None => A::name(row),
            Some(row) => B::name(row),
        }
    }
    fn unit(row: usize) -> &'static str {
        row.checked_sub(A::ROWS).map_or_else(|| A::unit(row), B::unit)
    }
}

/// `lower ≤ g(x, z, u, p, t) ≤ upper` for the outputs of a function. A bound may be infinite; equal
/// bounds are an equation.
///
/// ```
/// use casados::ocp::{Constraint, GeneralCost, HeapSqp, Horizon, Problem};
/// use casados::prelude::*;
///
/// /// A cart on a rail that is pushed: position m, velocity m/s; acceleration m/s².
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
/// #[function]
/// fn speed(x: [f64; 2], _u: f64) -> f64 { x[1] }
///
/// // At most 1.2 m/s, or 100 for each m/s above: from rest to 1 m in a second.
/// let fast = Constraint::<Speed>::new([f64::NEG_INFINITY], [1.2]).soft(100.0, 0.0);
/// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
///     .running_cost(GeneralCost::<Effort>::new())
///     .path_constraints(fast)
///     .on(Horizon::uniform(20, 0.05))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 20.., 1.0, 1.0)?.guess(&[0.0, 0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// let speeds = ocp.solution()?.state("x[1]")?.to_vec();
/// assert!(speeds[..20].iter().all(|speed| *speed < 1.2 + 1e-5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Constraint<F: Function, T: Plain = f64> {
    lower: ArrayY<F, T>,
    upper: ArrayY<F, T>,
    /// The linear penalties of soft bounds.
    linear: ArrayY<F, T>,
    quadratic: ArrayY<F, T>,
    g: ArrayY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
}

plain!([F: Function, T: Plain] Constraint<F, T> { lower, upper, linear, quadratic, g, jacobian, hessian });

impl<F: Function, T: Real> Constraint<F, T> {
    /// Constraints with these bounds at every node.
    #[must_use]
    pub fn new(lower: ArrayY<F, T>, upper: ArrayY<F, T>) -> Self {
        let linear = Array::from_fn(|_| T::from_f64(f64::INFINITY));
        let mut constraint = Self { lower, upper, linear, ..Zeroable::zeroed() };
        F::jacobian_constants::<T>(&mut constraint.jacobian);
        constraint
    }

    /// Makes the bounds soft: a violation `e` costs `linear · e + ½ quadratic · e²`.
    #[must_use]
    pub fn soft(mut self, linear: T, quadratic: T) -> Self {
        self.linear = Array::from_fn(|_| linear);
        self.quadratic = Array::from_fn(|_| quadratic);
        self
    }
}

#[diagnostic::do_not_recommend]
impl<S: Shape, F: Function<Shape = S>, T: Real> Constraints<S, T> for Constraint<F, T> {
    const ROWS: usize = F::Outputs::NY;
    const ALGEBRAIC: bool = depends_on_algebraic::<F>();

    fn check(&self, there: AvailableVariables) -> Result<(), OcpError> {
        let part = if there.u { Part::PathBounds } else { Part::TerminalBounds };
        let labels = Labels { part, stage: there.stage, name: <Self as Constraints<F::Shape, T>>::name };
        let Self { lower, upper, linear, quadratic, .. } = self;
        for (index, (&lower, &upper)) in lower.as_ref().iter().zip(upper.as_ref()).enumerate() {
            labels.check_bounds(index, lower, upper)?;
        }
        for (index, (&linear, &quadratic)) in linear.as_ref().iter().zip(quadratic.as_ref()).enumerate() {
            labels.check_penalty(index, linear, quadratic)?;
        }
        there.check::<F>()
    }
    fn visit_sparsity(&self, visit: EntryVisitor<'_>) -> bool {
        sparsity::visit_jacobian::<F>(visit);
        sparsity::visit_hessian::<F>(visit);
        true
    }
    fn bounds(&self, limits: [&mut [T]; 4]) {
        let given = [&self.lower, &self.upper, &self.linear, &self.quadratic];
        for (to, from) in limits.into_iter().zip(given) {
            for (to, &from) in to.iter_mut().zip(from.as_ref()) {
                *to = from;
            }
        }
    }
    fn value(
        &mut self,
        v: &ArrayV<F, T>,
        values: &mut [T],
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError> {
        F::value::<T>(v, &mut self.g);
        check_finite_outputs::<F, T>(&self.g, context.stage)?;
        for (value, &g) in values.iter_mut().zip(self.g.as_ref()) {
            *value = g;
        }
        Ok(())
    }
    fn linearise(
        &mut self,
        v: &ArrayV<F, T>,
        values: &mut [T],
        columns: &mut [T],
        ld: usize,
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError> {
        F::value_jacobian::<T>(v, &mut self.g, &mut self.jacobian);
        check_finite_outputs::<F, T>(&self.g, context.stage)?;
        for (value, &g) in values.iter_mut().zip(self.g.as_ref()) {
            *value = g;
        }
        for (entry, &value) in self.jacobian.as_ref().iter().enumerate() {
            let Some((row, variable)) = F::STRUCTURE.jacobian.get(entry) else { continue };
            let Some(position) = context.free.position::<F::Shape>(variable) else { continue };
            if let Some(element) = columns.get_mut(row * ld + position) {
                *element = value;
            }
        }
        Ok(())
    }
    fn add_hessian(
        &mut self,
        v: &ArrayV<F, T>,
        mu: &[T],
        _: ConstraintContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) {
        terms.add_weighted_hessian::<F>(v, &multiplier_array::<F, T>(mu), T::ONE, &mut self.hessian);
    }
    fn add_parameter_derivatives(
        &mut self,
        v: &ArrayV<F, T>,
        mu: Option<&[T]>,
        _: ConstraintContext<'_, T>,
        slopes: &mut [T],
        cross: &mut ParameterDerivatives<'_, T>,
    ) {
        F::value_jacobian::<T>(v, &mut self.g, &mut self.jacobian);
        for (&value, (row, variable)) in self.jacobian.as_ref().iter().zip(F::STRUCTURE.jacobian.iter()) {
            let Some(p) = parameter_index::<F::Shape>(variable) else { continue };
            if let Some(slope) = slopes.get_mut(row * F::Shape::NP + p) {
                *slope = value;
            }
        }
        if let Some(mu) = mu {
            cross.add_weighted_hessian::<F>(v, &multiplier_array::<F, T>(mu), T::ONE, &mut self.hessian);
        }
    }
    fn name(row: usize) -> (&'static str, usize) {
        (F::STRUCTURE.name, row)
    }
    fn unit(_row: usize) -> &'static str {
        F::UNIT
    }
}

/// Returns the multipliers of the outputs of a function as an array.
fn multiplier_array<F: Function, T: Real>(mu: &[T]) -> ArrayY<F, T> {
    Array::from_fn(|i| mu.get(i).copied().unwrap_or(T::ZERO))
}
