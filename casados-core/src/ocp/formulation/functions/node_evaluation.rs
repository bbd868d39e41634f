//! Evaluation of functions at a node: their arguments, and the targets of their derivatives.

use crate::function::{ArrayV, ArrayY, Function, FunctionStructure, MatrixYY};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::scalar::Real;
use crate::shape::Shape;

/// Returns the index of a parameter among the variables.
#[inline(always)]
pub(in crate::ocp) fn parameter_index<S: Shape>(variable: usize) -> Option<usize> {
    variable.checked_sub(2 * S::NX + S::NZ + S::NU).filter(|&p| p < S::NP)
}

/// Returns whether a function depends on algebraic states.
pub(in crate::ocp) const fn depends_on_algebraic<F: Function>() -> bool {
    F::STRUCTURE.blocks[2] < F::STRUCTURE.blocks[3]
}

/// Writes the variables `(0, x, z, u, p, t)`.
#[inline(always)]
pub(in crate::ocp) fn write_variables<S: Shape, T: Real>(
    v: &mut S::ArrayV<T>,
    [x, z, u, p]: [&[T]; 4],
    t: T,
) {
    let begin = 2 * S::NX + S::NZ;
    let time = core::slice::from_ref(&t);
    let parts = [(S::NX, x), (2 * S::NX, z), (begin, u), (begin + S::NU, p), (begin + S::NU + S::NP, time)];
    for (begin, part) in parts {
        let target = v.as_mut().get_mut(begin..).unwrap_or_default();
        for (to, &from) in target.iter_mut().zip(part) {
            *to = from;
        }
    }
}

/// Checks that all outputs of a function are finite.
///
/// # Errors
/// [`OcpError::NonFiniteFunction`]
pub(in crate::ocp) fn check_finite_outputs<F: Function, T: Real>(
    y: &ArrayY<F, T>,
    stage: usize,
) -> Result<(), OcpError> {
    match crate::finite::find_non_finite(y.as_ref()) {
        None => Ok(()),
        Some((output, value)) => Err(OcpError::NonFiniteFunction {
            function: F::STRUCTURE.name,
            stage,
            output,
            value,
            phase: None,
        }),
    }
}

/// Returns a value computed from the outputs of a function, if it is finite.
///
/// # Errors
/// [`OcpError::NonFiniteFunction`]
pub(in crate::ocp) fn check_finite_value<F: Function, T: Real>(
    y: &ArrayY<F, T>,
    value: T,
    stage: usize,
) -> Result<T, OcpError> {
    if value.is_finite() {
        return Ok(value);
    }
    let (output, value) = crate::finite::find_non_finite(y.as_ref()).unwrap_or((0, value.to_f64()));
    Err(OcpError::NonFiniteFunction { function: F::STRUCTURE.name, stage, output, value, phase: None })
}

/// The variables that are available at a node.
#[derive(Clone, Copy, Debug)]
pub struct AvailableVariables {
    /// Algebraic states.
    pub(in crate::ocp) z: bool,
    /// Controls: available except at the end of the horizon.
    pub(in crate::ocp) u: bool,
    /// The first stage with these variables.
    pub(in crate::ocp) stage: usize,
    /// The time: available unless the end time is free.
    pub(in crate::ocp) t: bool,
    /// The degrees of controls, if a function is evaluated at nodes in place of an interval, where
    /// it may depend on constant controls only; otherwise empty.
    pub(in crate::ocp) degrees: &'static [u32],
}

impl AvailableVariables {
    /// Returns whether a control is a coefficient of a polynomial.
    fn is_polynomial(self, control: usize) -> bool {
        let mut end = 0;
        let mut degrees = self.degrees.iter().map(|&degree| degree as usize);
        degrees.any(|degree| {
            let first = end;
            end += degree + 1;
            degree > 0 && (first..end).contains(&control)
        })
    }

    /// Checks that a function depends on available variables only.
    pub(in crate::ocp) fn check<F: Function>(self) -> Result<(), OcpError> {
        let FunctionStructure { name: function, variables, z, u, .. } = F::STRUCTURE;
        if F::IS_TIMED && !self.t {
            return Err(OcpError::DependsOnTime { function });
        }
        let (nx, nz, nu) = (F::Shape::NX, F::Shape::NZ, F::Shape::NU);
        for &variable in variables {
            let Some(index) = (variable as usize).checked_sub(2 * nx) else { continue };
            let missing = if index < nz {
                z.get(index).filter(|_| !self.z)
            } else if index < nz + nu {
                u.get(index - nz).filter(|_| !self.u)
            } else {
                None
            };
            if let Some(&coefficient) = index.checked_sub(nz).and_then(|control| u.get(control))
                && self.is_polynomial(index - nz)
            {
                return Err(OcpError::CostAtNodes { function, coefficient });
            }
            if let Some(&variable) = missing {
                return Err(OcpError::NotThere { function, variable, terminal: !self.u });
            }
        }
        Ok(())
    }
}

/// A gradient and the lower triangle of a Hessian over `(x, w, u)`, or `(x, w, u, z)`, as
/// accumulators.
pub struct QuadraticTerms<'a, T> {
    /// The positions of the free parameters.
    pub(in crate::ocp) free: FreeParametersView<'a>,
    pub(in crate::ocp) gradient: &'a mut [T],
    pub(in crate::ocp) hessian: &'a mut [T],
    /// The stride of columns.
    pub(in crate::ocp) ld: usize,
}

impl<T: Real> QuadraticTerms<'_, T> {
    /// Adds to the gradient.
    #[inline(always)]
    pub(in crate::ocp) fn add_gradient(&mut self, index: usize, value: T) {
        if let Some(element) = self.gradient.get_mut(index) {
            *element = *element + value;
        }
    }
    /// Adds to the Hessian, `row ≥ column`.
    #[inline(always)]
    pub(in crate::ocp) fn add_hessian(&mut self, row: usize, column: usize, value: T) {
        if let Some(element) = self.hessian.get_mut(column * self.ld + row) {
            *element = *element + value;
        }
    }
    /// Adds `factor ∇²(μᵀy)` of the outputs of a function; `hessian` is the memory of its entries.
    #[inline(always)]
    pub(in crate::ocp) fn add_weighted_hessian<F: Function>(
        &mut self,
        v: &ArrayV<F, T>,
        mu: &ArrayY<F, T>,
        factor: T,
        hessian: &mut F::Hessian<T>,
    ) {
        let free = self.free;
        for_each_hessian_entry::<F, T>(v, mu, hessian, |row, column, value| {
            let places = [row, column].map(|variable| free.position::<F::Shape>(variable));
            if let [Some(row), Some(column)] = places {
                // Controls precede algebraic states here, and follow them in a model.
                let swap = row < column;
                let (row, column) = if swap { (column, row) } else { (row, column) };
                self.add_hessian(row, column, factor * value);
            }
        });
    }
}

impl<T: Real> QuadraticTerms<'_, T> {
    /// Adds the derivatives of a cost `T l` by the duration `T`, the variable `duration_index`,
    /// beyond those of `l`: `l` to the gradient, `∇l` to its row and column of an exact Hessian.
    /// `gradient_before` is the gradient before `∇(T l)` at constant `T` was added.
    pub(in crate::ocp) fn add_duration_derivatives(
        &mut self,
        duration_index: usize,
        [cost, duration]: [T; 2],
        gradient_before: &[T],
        exact: bool,
    ) {
        for (i, &before) in gradient_before.iter().enumerate().filter(|_| exact) {
            let slope = (self.gradient.get(i).copied().unwrap_or(T::ZERO) - before) / duration;
            self.add_hessian(i.max(duration_index), i.min(duration_index), slope);
            if i == duration_index {
                self.add_hessian(i, i, slope);
            }
        }
        self.add_gradient(duration_index, cost / duration);
    }
}

/// Visits the entries of `∇²(μᵀy)` of the outputs of a function, as two variables and a value;
/// `hessian` is their memory.
#[inline(always)]
pub(in crate::ocp) fn for_each_hessian_entry<F: Function, T: Real>(
    v: &ArrayV<F, T>,
    mu: &ArrayY<F, T>,
    hessian: &mut F::Hessian<T>,
    mut visit: impl FnMut(usize, usize, T),
) {
    if F::STRUCTURE.hessian.is_empty() {
        return;
    }
    F::hessian::<T>(v, mu, hessian);
    for (entry, &value) in hessian.as_ref().iter().enumerate() {
        if let Some((row, column)) = F::STRUCTURE.hessian.get(entry) {
            visit(row, column, value);
        }
    }
}

/// Derivatives with respect to parameters, as accumulators.
pub struct ParameterDerivatives<'a, T> {
    /// The positions of the free parameters.
    pub(in crate::ocp) free: FreeParametersView<'a>,
    /// Derivatives of a gradient over `(x, u)`, or `(x, u, z)`: a column for each parameter.
    pub(in crate::ocp) mixed_columns: &'a mut [T],
    /// The stride of columns.
    pub(in crate::ocp) ld: usize,
    /// The gradient with respect to the parameters.
    pub(in crate::ocp) gradient: &'a mut [T],
    /// The Hessian with respect to the parameters, both triangles.
    pub(in crate::ocp) hessian: &'a mut [T],
}

impl<T: Real> ParameterDerivatives<'_, T> {
    /// Adds to the derivative of element `row` by parameter `p`.
    pub(in crate::ocp) fn add_mixed(&mut self, row: usize, p: usize, value: T) {
        if let Some(element) = self.mixed_columns.get_mut(p * self.ld + row) {
            *element = *element + value;
        }
    }
    /// Adds to the gradient with respect to parameters.
    pub(in crate::ocp) fn add_gradient(&mut self, p: usize, value: T) {
        if let Some(element) = self.gradient.get_mut(p) {
            *element = *element + value;
        }
    }
    /// Adds to one element of the Hessian with respect to parameters.
    pub(in crate::ocp) fn add_hessian(&mut self, p: usize, q: usize, value: T) {
        if let Some(element) = self.hessian.get_mut(q * self.gradient.len() + p) {
            *element = *element + value;
        }
    }
    /// Adds the derivatives by parameters of `factor ∇(μᵀy)` of the outputs of a function;
    /// `hessian` is the memory of the entries of its Hessian.
    pub(in crate::ocp) fn add_weighted_hessian<F: Function>(
        &mut self,
        v: &ArrayV<F, T>,
        mu: &ArrayY<F, T>,
        factor: T,
        hessian: &mut F::Hessian<T>,
    ) {
        for_each_hessian_entry::<F, T>(v, mu, hessian, |row, column, value| {
            // Parameters follow states and controls: they are rows of the lower triangle.
            let Some(p) = parameter_index::<F::Shape>(row) else { return };
            if let Some(position) = self.free.position::<F::Shape>(column) {
                self.add_mixed(position, p, factor * value);
            } else if let Some(q) = parameter_index::<F::Shape>(column) {
                self.add_hessian(p, q, factor * value);
                if p != q {
                    self.add_hessian(q, p, factor * value);
                }
            }
        });
    }
    /// Adds the Gauss-Newton part of the derivatives by parameters of the gradient of
    /// `factor φ(y)`, where `mu = ∇φ` and `outer = ∇²φ`.
    pub(in crate::ocp) fn gauss_newton<F: Function>(
        &mut self,
        jacobian: &F::Jacobian<T>,
        mu: &ArrayY<F, T>,
        outer_hessian: &MatrixYY<F, T>,
        factor: T,
    ) {
        let entries = || jacobian.as_ref().iter().zip(F::STRUCTURE.jacobian.iter());
        for (&b, (l, variable)) in entries() {
            let Some(p) = parameter_index::<F::Shape>(variable) else { continue };
            self.add_gradient(p, factor * mu[l] * b);
            for (&a, (k, variable)) in entries() {
                let product = factor * outer_hessian[(k, l)] * a * b;
                if let Some(i) = self.free.position::<F::Shape>(variable) {
                    self.add_mixed(i, p, product);
                } else if let Some(q) = parameter_index::<F::Shape>(variable) {
                    self.add_hessian(q, p, product);
                }
            }
        }
    }
    /// Adds the blocks `xp`, `up` and `pp`, column after column. Rows of `pp` of free parameters
    /// are rows of variables, too.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn add_blocks(&mut self, [nx, nu]: [usize; 2], [xp, up, pp]: [&[T]; 3]) {
        for (to, &value) in self.hessian.iter_mut().zip(pp) {
            *to = *to + value;
        }
        if self.free.count() > 0 {
            for (p, column) in pp.chunks_exact(self.gradient.len().max(1)).enumerate() {
                for (w, value) in self.free.free_elements(column) {
                    self.add_mixed(nx + w, p, value);
                }
            }
        }
        for (first, rows, block) in [(0, nx, xp), (nx + self.free.count(), nu, up)] {
            for (p, column) in block.chunks_exact(rows.max(1)).enumerate() {
                column.iter().enumerate().for_each(|(i, &value)| self.add_mixed(first + i, p, value));
            }
        }
    }
}

/// Adds the blocks `xx`, `xu`, `uu` and `xp`, `up`, `pp`, column after column, to the lower
/// triangle.
pub(in crate::ocp) fn add_blocks<T: Real>(
    terms: &mut QuadraticTerms<'_, T>,
    nx: usize,
    [xx, xu, uu]: [&[T]; 3],
    parameter_blocks: [&[T]; 3],
) {
    if xx.is_empty() && uu.is_empty() {
        return;
    }
    let first = nx + terms.free.count();
    for (j, column) in xx.chunks_exact(nx.max(1)).enumerate() {
        for (i, &value) in column.iter().enumerate().skip(j) {
            terms.add_hessian(i, j, value);
        }
    }
    for (u, column) in xu.chunks_exact(nx.max(1)).enumerate() {
        for (x, &value) in column.iter().enumerate() {
            terms.add_hessian(first + u, x, value);
        }
    }
    let nu = xu.len() / nx.max(1);
    for (j, column) in uu.chunks_exact(nu.max(1)).enumerate() {
        for (i, &value) in column.iter().enumerate().skip(j) {
            terms.add_hessian(first + i, first + j, value);
        }
    }
    if terms.free.count() > 0 {
        add_parameter_blocks(terms, [nx, nu], parameter_blocks);
    }
}

/// Adds the blocks of free parameters.
fn add_parameter_blocks<T: Real>(
    terms: &mut QuadraticTerms<'_, T>,
    [nx, nu]: [usize; 2],
    [xp, up, pp]: [&[T]; 3],
) {
    let free = terms.free;
    for (w, column) in free.free_columns(xp, nx) {
        column.iter().enumerate().for_each(|(x, &value)| terms.add_hessian(nx + w, x, value));
    }
    for (w, column) in free.free_columns(up, nu) {
        for (u, &value) in column.iter().enumerate() {
            terms.add_hessian(nx + free.count() + u, nx + w, value);
        }
    }
    let np = pp.len().isqrt();
    for (w, column) in free.free_columns(pp, np) {
        for (other, value) in free.free_elements(column).filter(|&(other, _)| other >= w) {
            terms.add_hessian(nx + other, nx + w, value);
        }
    }
}
