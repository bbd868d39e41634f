//! Constraints at the nodes.

use crate::function::{ArrayV, ArrayY, Function};
use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::free::Free;
use crate::ocp::formulation::functions::pattern::{self, Entries};
use crate::ocp::formulation::functions::point::{
    Cross, Terms, There, finite_outputs, is_algebraic, parameter,
};
use crate::scalar::Real;
use crate::shape::{Array, Outputs, Plain, Shape, plain};
use bytemuck::Zeroable;

/// Where constraints are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Spot<'a, T> {
    pub(in crate::ocp) stage: usize,
    /// Where variables are.
    pub(in crate::ocp) free: Free<'a>,
    /// Copies of elements of the first state, and which of the shared variables the first one is.
    pub(in crate::ocp) starts: &'a [T],
    pub(in crate::ocp) first: usize,
}

impl<'a, T> Spot<'a, T> {
    /// Of a stage with these shared variables, the first ones of which are the copies.
    #[inline(always)]
    pub(in crate::ocp) fn new(stage: usize, free: Free<'a>, w: &'a [T]) -> Self {
        Self { stage, free, starts: w, first: 0 }
    }

    /// Without so many copies.
    fn behind(self, count: usize) -> Self {
        Self { starts: self.starts.get(count..).unwrap_or_default(), first: self.first + count, ..self }
    }
}

/// Constraints at a node, as functions of `(x, z, u, p, t)` with bounds: `()` is none, a pair is
/// both.
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
    /// How many rows.
    const ROWS: usize;
    /// Whether they depend on algebraic states.
    const ALGEBRAIC: bool;
    /// How many elements of the first state they depend on, of which the last stage has copies.
    const STARTS: usize = 0;

    /// Which state a copy is of.
    #[doc(hidden)]
    fn start(copy: usize) -> usize {
        copy
    }
    /// Whether they depend on what is there only.
    ///
    /// # Errors
    /// [`OcpError::NotThere`]
    #[doc(hidden)]
    fn check(&self, there: There) -> Result<(), OcpError>;
    /// Shows where the Jacobian and the Hessian over `(x, u, z)` may have entries; false if that is
    /// not known.
    #[doc(hidden)]
    fn pattern(&self, visit: Entries<'_>) -> bool {
        let _ = visit;
        Self::ROWS == 0
    }
    /// The bounds that hold where nothing else is said: lower ones, upper ones, linear and
    /// quadratic penalties.
    #[doc(hidden)]
    fn bounds(&self, limits: [&mut [T]; 4]);
    /// The values.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    #[doc(hidden)]
    fn value(&mut self, v: &S::ArrayV<T>, values: &mut [T], at: Spot<'_, T>) -> Result<(), OcpError>;
    /// The values, and their derivatives: a column for each, `ld` apart.
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
        at: Spot<'_, T>,
    ) -> Result<(), OcpError>;
    /// Adds the Hessian of `μᵀg`.
    #[doc(hidden)]
    fn curve(&mut self, v: &S::ArrayV<T>, mu: &[T], at: Spot<'_, T>, terms: &mut Terms<'_, T>);
    /// `∂g/∂p`, a row for each of the constraints; adds what parameters change of the gradient of
    /// `μᵀg`, if `μ` is given.
    #[doc(hidden)]
    fn cross(&mut self, v: &S::ArrayV<T>, mu: Option<&[T]>, slopes: &mut [T], cross: &mut Cross<'_, T>);
    /// The function of a row, and which of its outputs it is.
    #[doc(hidden)]
    fn name(row: usize) -> (&'static str, usize);
    /// The unit of a row, if its function says one.
    #[doc(hidden)]
    fn unit(_row: usize) -> &'static str {
        ""
    }
}

impl<S: Shape, T: Real> Constraints<S, T> for () {
    const ROWS: usize = 0;
    const ALGEBRAIC: bool = false;
    fn check(&self, _: There) -> Result<(), OcpError> {
        Ok(())
    }
    fn bounds(&self, _: [&mut [T]; 4]) {}
    fn value(&mut self, _: &S::ArrayV<T>, _: &mut [T], _: Spot<'_, T>) -> Result<(), OcpError> {
        Ok(())
    }
    fn linearise(
        &mut self,
        _: &S::ArrayV<T>,
        _: &mut [T],
        _: &mut [T],
        _: usize,
        _: Spot<'_, T>,
    ) -> Result<(), OcpError> {
        Ok(())
    }
    fn curve(&mut self, _: &S::ArrayV<T>, _: &[T], _: Spot<'_, T>, _: &mut Terms<'_, T>) {}
    fn cross(&mut self, _: &S::ArrayV<T>, _: Option<&[T]>, _: &mut [T], _: &mut Cross<'_, T>) {}
    fn name(row: usize) -> (&'static str, usize) {
        ("", row)
    }
}

impl<S: Shape, T: Real, A: Constraints<S, T>, B: Constraints<S, T>> Constraints<S, T> for (A, B) {
    const ROWS: usize = A::ROWS + B::ROWS;
    const ALGEBRAIC: bool = A::ALGEBRAIC || B::ALGEBRAIC;
    const STARTS: usize = A::STARTS + B::STARTS;
    fn start(copy: usize) -> usize {
        match copy.checked_sub(A::STARTS) {
            None => A::start(copy),
            Some(copy) => B::start(copy),
        }
    }
    fn check(&self, there: There) -> Result<(), OcpError> {
        self.0.check(there)?;
        self.1.check(there)
    }
    fn pattern(&self, visit: Entries<'_>) -> bool {
        use crate::ocp::formulation::functions::pattern::Entry;
        let behind = &mut |entry| match entry {
            Entry::Slope(row, variable) => visit(Entry::Slope(A::ROWS + row, variable)),
            Entry::Curvature(..) => visit(entry),
        };
        self.1.pattern(behind) && self.0.pattern(visit)
    }
    fn bounds(&self, limits: [&mut [T]; 4]) {
        let [(l, lower), (u, upper), (i, linear), (q, quadratic)] =
            limits.map(|rows| rows.split_at_mut_checked(A::ROWS).unwrap_or_default());
        self.0.bounds([l, u, i, q]);
        self.1.bounds([lower, upper, linear, quadratic]);
    }
    fn value(&mut self, v: &S::ArrayV<T>, values: &mut [T], at: Spot<'_, T>) -> Result<(), OcpError> {
        let (first, second) = values.split_at_mut_checked(A::ROWS).unwrap_or_default();
        self.0.value(v, first, at)?;
        self.1.value(v, second, at.behind(A::STARTS))
    }
    fn linearise(
        &mut self,
        v: &S::ArrayV<T>,
        values: &mut [T],
        columns: &mut [T],
        ld: usize,
        at: Spot<'_, T>,
    ) -> Result<(), OcpError> {
        let (first, second) = values.split_at_mut_checked(A::ROWS).unwrap_or_default();
        let (mine, others) = columns.split_at_mut_checked(A::ROWS * ld).unwrap_or_default();
        self.0.linearise(v, first, mine, ld, at)?;
        self.1.linearise(v, second, others, ld, at.behind(A::STARTS))
    }
    fn curve(&mut self, v: &S::ArrayV<T>, mu: &[T], at: Spot<'_, T>, terms: &mut Terms<'_, T>) {
        let (first, second) = mu.split_at_checked(A::ROWS).unwrap_or_default();
        self.0.curve(v, first, at, terms);
        self.1.curve(v, second, at.behind(A::STARTS), terms);
    }
    fn cross(&mut self, v: &S::ArrayV<T>, mu: Option<&[T]>, slopes: &mut [T], cross: &mut Cross<'_, T>) {
        let (mine, others) = slopes.split_at_mut_checked(A::ROWS * S::NP).unwrap_or_default();
        let (first, second) = mu.and_then(|mu| mu.split_at_checked(A::ROWS)).unzip();
        self.0.cross(v, first, mine, cross);
        self.1.cross(v, second, others, cross);
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

/// `lower ≤ g(x, z, u, p, t) ≤ upper` of the outputs of a function. A side may be infinite; equal
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
    /// Penalties.
    linear: ArrayY<F, T>,
    quadratic: ArrayY<F, T>,
    g: ArrayY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
}

plain!([F: Function, T: Plain] Constraint<F, T> { lower, upper, linear, quadratic, g, jacobian, hessian });

impl<F: Function, T: Real> Constraint<F, T> {
    /// With these bounds at every node.
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
    const ALGEBRAIC: bool = is_algebraic::<F>();

    fn check(&self, there: There) -> Result<(), OcpError> {
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
    fn pattern(&self, visit: Entries<'_>) -> bool {
        pattern::slopes::<F>(visit);
        pattern::curvature::<F>(visit);
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
    fn value(&mut self, v: &ArrayV<F, T>, values: &mut [T], at: Spot<'_, T>) -> Result<(), OcpError> {
        F::value::<T>(v, &mut self.g);
        finite_outputs::<F, T>(&self.g, at.stage)?;
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
        at: Spot<'_, T>,
    ) -> Result<(), OcpError> {
        F::value_jacobian::<T>(v, &mut self.g, &mut self.jacobian);
        finite_outputs::<F, T>(&self.g, at.stage)?;
        for (value, &g) in values.iter_mut().zip(self.g.as_ref()) {
            *value = g;
        }
        for (entry, &value) in self.jacobian.as_ref().iter().enumerate() {
            let Some((row, variable)) = F::STRUCTURE.jacobian.get(entry) else { continue };
            let Some(position) = at.free.position::<F::Shape>(variable) else { continue };
            if let Some(element) = columns.get_mut(row * ld + position) {
                *element = value;
            }
        }
        Ok(())
    }
    fn curve(&mut self, v: &ArrayV<F, T>, mu: &[T], _: Spot<'_, T>, terms: &mut Terms<'_, T>) {
        terms.curvature::<F>(v, &multipliers::<F, T>(mu), T::ONE, &mut self.hessian);
    }
    fn cross(&mut self, v: &ArrayV<F, T>, mu: Option<&[T]>, slopes: &mut [T], cross: &mut Cross<'_, T>) {
        F::value_jacobian::<T>(v, &mut self.g, &mut self.jacobian);
        for (&value, (row, variable)) in self.jacobian.as_ref().iter().zip(F::STRUCTURE.jacobian.iter()) {
            let Some(p) = parameter::<F::Shape>(variable) else { continue };
            if let Some(slope) = slopes.get_mut(row * F::Shape::NP + p) {
                *slope = value;
            }
        }
        if let Some(mu) = mu {
            cross.curvature::<F>(v, &multipliers::<F, T>(mu), T::ONE, &mut self.hessian);
        }
    }
    fn name(row: usize) -> (&'static str, usize) {
        (F::STRUCTURE.name, row)
    }
    fn unit(_row: usize) -> &'static str {
        F::UNIT
    }
}

/// Those of the outputs of a function.
fn multipliers<F: Function, T: Real>(mu: &[T]) -> ArrayY<F, T> {
    Array::from_fn(|i| mu.get(i).copied().unwrap_or(T::ZERO))
}
