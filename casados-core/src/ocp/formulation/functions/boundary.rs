//! Boundary conditions: constraints that couple the first and the last state.

use crate::function::{ArrayV, ArrayY, Function};
use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::constraint::{ConstraintContext, Constraints};
use crate::ocp::formulation::functions::node_evaluation::{
    AvailableVariables, ParameterDerivatives, QuadraticTerms, check_finite_outputs, for_each_hessian_entry,
    parameter_index, write_variables,
};
use crate::ocp::formulation::functions::sparsity::EntryVisitor;
use crate::scalar::Real;
use crate::shape::{Array, Outputs, Plain, Shape, plain};
use bytemuck::Zeroable;

/// `lower ≤ r(x₀, x_N, p) ≤ upper` for the outputs of a function of the first state `x0`, the last
/// state `x` and the parameters of the last node. A bound may be infinite; equal bounds are an
/// equation.
///
/// It is a terminal constraint, alone or in a pair with others, with names, bounds and multipliers
/// in solutions. The QP has a shared variable, equal to `x0[i]`, for each element `i` that the
/// function depends on. For periodic states use [`Ocp::periodic`](crate::ocp::Ocp::periodic).
///
/// # Example
/// A car returns with twice its initial speed, a metre further on.
/// ```
/// use casados::ocp::{Boundary, GeneralCost, HeapIpm, Horizon, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn car(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { u * u }
/// #[function]
/// fn twice(x0: [f64; 2], x: [f64; 2]) -> [f64; 2] { [x[0] - x0[0], x[1] - 2.0 * x0[1]] }
///
/// let mut ocp = Problem::new(Irk::<Car, Gauss<2>>::new(Options::default())?)
///     .running_cost(GeneralCost::<Effort>::new())
///     .terminal_constraints(Boundary::<Twice>::new([1.0, 0.0], [1.0, 0.0]))
///     .on(Horizon::uniform(10, 0.1))?;
/// ocp.free_initial_state().bound("x[0]", ..1, 0.0, 0.0)?.guess(&[0.0, 1.0], &[0.0])?;
/// assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// let speed = ocp.solution()?.state("x[1]")?.to_vec();
/// assert!((speed[10] - 2.0 * speed[0]).abs() < 1e-6);
/// // 9/14 m/s, but for a control that is constant in each interval.
/// assert!((speed[0] - 9.0 / 14.0).abs() < 1e-2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Boundary<F: Function, T: Plain = f64> {
    lower: ArrayY<F, T>,
    upper: ArrayY<F, T>,
    /// The linear penalties of soft bounds.
    linear: ArrayY<F, T>,
    quadratic: ArrayY<F, T>,
    v: ArrayV<F, T>,
    g: ArrayY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
}

plain!([F: Function, T: Plain] Boundary<F, T> { lower, upper, linear, quadratic, v, g, jacobian, hessian });

impl<F: Function, T: Real> Boundary<F, T> {
    /// A boundary condition with these bounds.
    #[must_use]
    pub fn new(lower: ArrayY<F, T>, upper: ArrayY<F, T>) -> Self {
        let linear = Array::from_fn(|_| T::from_f64(f64::INFINITY));
        let mut boundary = Self { lower, upper, linear, ..Zeroable::zeroed() };
        F::jacobian_constants::<T>(&mut boundary.jacobian);
        boundary
    }

    /// Makes the bounds soft: a violation `e` costs `linear · e + ½ quadratic · e²`.
    #[must_use]
    pub fn soft(mut self, linear: T, quadratic: T) -> Self {
        self.linear = Array::from_fn(|_| linear);
        self.quadratic = Array::from_fn(|_| quadratic);
        self
    }

    /// Writes the variables of the function, with `x₀` in the place of algebraic states.
    fn load_variables<S: Shape>(&mut self, v: &S::ArrayV<T>, context: ConstraintContext<'_, T>) {
        let (nx, rest) = (S::NX, 2 * S::NX + S::NZ + S::NU);
        let variables = v.as_ref();
        let x = crate::qp::part(variables, nx, nx);
        let p = crate::qp::part(variables, rest, S::NP);
        let t = variables.get(rest + S::NP).copied().unwrap_or(T::ZERO);
        write_variables::<F::Shape, T>(&mut self.v, [x, &[], &[], p], t);
        let first = self.v.as_mut().get_mut(2 * nx..).unwrap_or_default();
        for (copy, &value) in context.initial_state_copies.iter().enumerate().take(copied_state_count::<F>())
        {
            crate::qp::element::set(first, copied_state::<F>(copy), value);
        }
    }

    /// Returns the index of a variable in `(x, w)`.
    fn position<S: Shape>(variable: usize, context: ConstraintContext<'_, T>) -> Option<usize> {
        let nx = S::NX;
        if let Some(p) = parameter_index::<F::Shape>(variable) {
            return context.free.index_of(p).map(|w| nx + w);
        }
        match variable.checked_sub(2 * nx) {
            None => variable.checked_sub(nx),
            Some(state) => (0..copied_state_count::<F>())
                .find(|&copy| copied_state::<F>(copy) == state)
                .map(|copy| nx + context.first_copy + copy),
        }
    }
}

/// Returns the number of elements of the first state that a function depends on.
const fn copied_state_count<F: Function>() -> usize {
    let (variables, nx) = (F::STRUCTURE.variables, F::Shape::NX);
    let (mut index, mut count) = (0, 0);
    while index < variables.len() {
        let variable = variables[index] as usize;
        if variable >= 2 * nx && variable < 3 * nx {
            count += 1;
        }
        index += 1;
    }
    count
}

/// Returns the state that a copy is equal to.
fn copied_state<F: Function>(copy: usize) -> usize {
    let nx = F::Shape::NX;
    let initial_states =
        F::STRUCTURE.variables.iter().filter_map(|&variable| (variable as usize).checked_sub(2 * nx));
    initial_states.filter(|state| *state < nx).nth(copy).unwrap_or(0)
}

#[diagnostic::do_not_recommend]
impl<S: Shape, F: Function, T: Real> Constraints<S, T> for Boundary<F, T> {
    const ROWS: usize = F::Outputs::NY;
    const ALGEBRAIC: bool = false;
    const INITIAL_STATE_COPIES: usize = {
        let (nx, nz, nu, np) = (F::Shape::NX, F::Shape::NZ, F::Shape::NU, F::Shape::NP);
        assert!(
            nx == S::NX && nz == S::NX && nu == 0 && np == S::NP,
            "a boundary condition is a function of two states of the model, `x0` and `x`, and of its parameters `p`, \
             if it has some"
        );
        copied_state_count::<F>()
    };

    fn copied_state(copy: usize) -> usize {
        copied_state::<F>(copy)
    }
    fn check(&self, there: AvailableVariables) -> Result<(), OcpError> {
        if there.u {
            let what = "a boundary condition as a path constraint";
            return Err(OcpError::Unsupported { what, remedy: "Give it to `terminal_constraints`" });
        }
        let name = <Self as Constraints<S, T>>::name;
        let labels = Labels { part: Part::TerminalBounds, stage: there.stage, name };
        for index in 0..F::Outputs::NY {
            labels.check_bounds(index, self.lower[index], self.upper[index])?;
            labels.check_penalty(index, self.linear[index], self.quadratic[index])?;
        }
        if F::IS_TIMED && !there.t {
            return Err(OcpError::DependsOnTime { function: F::STRUCTURE.name });
        }
        Ok(())
    }
    fn visit_sparsity(&self, _: EntryVisitor<'_>) -> bool {
        false
    }
    fn bounds(&self, limits: [&mut [T]; 4]) {
        let given = [&self.lower, &self.upper, &self.linear, &self.quadratic];
        for (to, from) in limits.into_iter().zip(given) {
            crate::qp::copy_common(to, from.as_ref());
        }
    }
    fn value(
        &mut self,
        v: &S::ArrayV<T>,
        values: &mut [T],
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError> {
        self.load_variables::<S>(v, context);
        F::value::<T>(&self.v, &mut self.g);
        check_finite_outputs::<F, T>(&self.g, context.stage)?;
        crate::qp::copy_common(values, self.g.as_ref());
        Ok(())
    }
    fn linearise(
        &mut self,
        v: &S::ArrayV<T>,
        values: &mut [T],
        columns: &mut [T],
        ld: usize,
        context: ConstraintContext<'_, T>,
    ) -> Result<(), OcpError> {
        self.load_variables::<S>(v, context);
        F::value_jacobian::<T>(&self.v, &mut self.g, &mut self.jacobian);
        check_finite_outputs::<F, T>(&self.g, context.stage)?;
        crate::qp::copy_common(values, self.g.as_ref());
        for ((row, variable), &value) in F::STRUCTURE.jacobian.iter().zip(self.jacobian.as_ref()) {
            if let Some(position) = Self::position::<S>(variable, context) {
                crate::qp::element::set(columns, row * ld + position, value);
            }
        }
        Ok(())
    }
    fn add_hessian(
        &mut self,
        v: &S::ArrayV<T>,
        mu: &[T],
        context: ConstraintContext<'_, T>,
        terms: &mut QuadraticTerms<'_, T>,
    ) {
        self.load_variables::<S>(v, context);
        let mu: ArrayY<F, T> = Array::from_fn(|i| mu.get(i).copied().unwrap_or(T::ZERO));
        for_each_hessian_entry::<F, T>(&self.v, &mu, &mut self.hessian, |row, column, value| {
            let places = [row, column].map(|variable| Self::position::<S>(variable, context));
            if let [Some(row), Some(column)] = places {
                terms.add_hessian(row.max(column), row.min(column), value);
            }
        });
    }
    fn add_parameter_derivatives(
        &mut self,
        v: &S::ArrayV<T>,
        mu: Option<&[T]>,
        context: ConstraintContext<'_, T>,
        slopes: &mut [T],
        cross: &mut ParameterDerivatives<'_, T>,
    ) {
        self.load_variables::<S>(v, context);
        F::value_jacobian::<T>(&self.v, &mut self.g, &mut self.jacobian);
        for ((row, variable), &value) in F::STRUCTURE.jacobian.iter().zip(self.jacobian.as_ref()) {
            if let Some(p) = parameter_index::<F::Shape>(variable) {
                crate::qp::element::set(slopes, row * S::NP + p, value);
            }
        }
        let Some(mu) = mu else { return };
        let mu: ArrayY<F, T> = Array::from_fn(|i| mu.get(i).copied().unwrap_or(T::ZERO));
        for_each_hessian_entry::<F, T>(&self.v, &mu, &mut self.hessian, |row, column, value| {
            // Parameters follow the states: they are rows of the lower triangle.
            let Some(p) = parameter_index::<F::Shape>(row) else { return };
            if let Some(position) = Self::position::<S>(column, context) {
                cross.add_mixed(position, p, value);
            } else if let Some(q) = parameter_index::<F::Shape>(column) {
                cross.add_hessian(p, q, value);
                if p != q {
                    cross.add_hessian(q, p, value);
                }
            }
        });
    }
    fn name(row: usize) -> (&'static str, usize) {
        (F::STRUCTURE.name, row)
    }
}
