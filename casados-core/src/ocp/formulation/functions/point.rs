//! Functions at a node: what they are evaluated at, and where their derivatives go.

use crate::function::{ArrayV, ArrayY, Function, FunctionStructure, MatrixYY};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free::Free;
use crate::scalar::Real;
use crate::shape::Shape;

/// The index of a parameter among the variables.
#[inline(always)]
pub(in crate::ocp) fn parameter<S: Shape>(variable: usize) -> Option<usize> {
    variable.checked_sub(2 * S::NX + S::NZ + S::NU).filter(|&p| p < S::NP)
}

/// Whether a function depends on algebraic states.
pub(in crate::ocp) const fn is_algebraic<F: Function>() -> bool {
    F::STRUCTURE.blocks[2] < F::STRUCTURE.blocks[3]
}

/// Writes the variables `(0, x, z, u, p, t)`.
#[inline(always)]
pub(in crate::ocp) fn read<S: Shape, T: Real>(v: &mut S::ArrayV<T>, [x, z, u, p]: [&[T]; 4], t: T) {
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

/// Whether all outputs of a function are finite.
///
/// # Errors
/// [`OcpError::NonFiniteFunction`]
pub(in crate::ocp) fn finite_outputs<F: Function, T: Real>(
    y: &ArrayY<F, T>,
    stage: usize,
) -> Result<(), OcpError> {
    match crate::finite::find_non_finite(y.as_ref()) {
        None => Ok(()),
        Some((output, value)) => {
            Err(OcpError::NonFiniteFunction { function: F::STRUCTURE.name, stage, output, value })
        }
    }
}

/// A value that follows from the outputs of a function, if it is finite.
///
/// # Errors
/// [`OcpError::NonFiniteFunction`]
pub(in crate::ocp) fn finite<F: Function, T: Real>(
    y: &ArrayY<F, T>,
    value: T,
    stage: usize,
) -> Result<T, OcpError> {
    if value.is_finite() {
        return Ok(value);
    }
    let (output, value) = crate::finite::find_non_finite(y.as_ref()).unwrap_or((0, value.to_f64()));
    Err(OcpError::NonFiniteFunction { function: F::STRUCTURE.name, stage, output, value })
}

/// What is there where a function is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct There {
    /// Algebraic states.
    pub(in crate::ocp) z: bool,
    /// Controls: not at the end of the horizon.
    pub(in crate::ocp) u: bool,
    /// The first stage of these.
    pub(in crate::ocp) stage: usize,
    /// A time that has no derivatives: not where the end of the horizon is free.
    pub(in crate::ocp) t: bool,
}

impl There {
    /// Whether a function depends on this only.
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
            if let Some(&variable) = missing {
                return Err(OcpError::NotThere { function, variable, terminal: !self.u });
            }
        }
        Ok(())
    }
}

/// A gradient and the lower triangle of a Hessian over `(x, w, u)`, or `(x, w, u, z)`, to be added
/// to.
pub struct Terms<'a, T> {
    /// Where variables are.
    pub(in crate::ocp) free: Free<'a>,
    pub(in crate::ocp) gradient: &'a mut [T],
    pub(in crate::ocp) hessian: &'a mut [T],
    /// The distance of columns.
    pub(in crate::ocp) ld: usize,
}

impl<T: Real> Terms<'_, T> {
    /// Adds to the gradient.
    #[inline(always)]
    pub(in crate::ocp) fn slope(&mut self, index: usize, value: T) {
        if let Some(element) = self.gradient.get_mut(index) {
            *element = *element + value;
        }
    }
    /// Adds to the Hessian, `row ≥ column`.
    #[inline(always)]
    pub(in crate::ocp) fn curve(&mut self, row: usize, column: usize, value: T) {
        if let Some(element) = self.hessian.get_mut(column * self.ld + row) {
            *element = *element + value;
        }
    }
    /// Adds `factor ∇²(μᵀy)` of the outputs of a function, whose entries are computed in `hessian`.
    #[inline(always)]
    pub(in crate::ocp) fn curvature<F: Function>(
        &mut self,
        v: &ArrayV<F, T>,
        mu: &ArrayY<F, T>,
        factor: T,
        hessian: &mut F::Hessian<T>,
    ) {
        let free = self.free;
        each_entry::<F, T>(v, mu, hessian, |row, column, value| {
            let places = [row, column].map(|variable| free.position::<F::Shape>(variable));
            if let [Some(row), Some(column)] = places {
                // Controls come before algebraic states here, and behind them in a model.
                let swap = row < column;
                let (row, column) = if swap { (column, row) } else { (row, column) };
                self.curve(row, column, factor * value);
            }
        });
    }
}

impl<T: Real> Terms<'_, T> {
    /// Adds what a duration `T`, the variable `place`, does to a cost `T l` beside what `l` does by
    /// it: `l` to the gradient, `∇l` to its row and its column of an exact Hessian. The gradient
    /// was `before`, and `∇(T l)` with `T` constant was added.
    pub(in crate::ocp) fn add_duration(
        &mut self,
        place: usize,
        [cost, duration]: [T; 2],
        before: &[T],
        exact: bool,
    ) {
        for (i, &before) in before.iter().enumerate().filter(|_| exact) {
            let slope = (self.gradient.get(i).copied().unwrap_or(T::ZERO) - before) / duration;
            self.curve(i.max(place), i.min(place), slope);
            if i == place {
                self.curve(i, i, slope);
            }
        }
        self.slope(place, cost / duration);
    }
}

/// The entries of `∇²(μᵀy)` of the outputs of a function, as two variables and a value; computed in
/// `hessian`.
#[inline(always)]
pub(in crate::ocp) fn each_entry<F: Function, T: Real>(
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

/// Derivatives with respect to parameters, to be added to.
pub struct Cross<'a, T> {
    /// Where variables are.
    pub(in crate::ocp) free: Free<'a>,
    /// Of a gradient over `(x, u)`, or `(x, u, z)`: a column for each parameter.
    pub(in crate::ocp) columns: &'a mut [T],
    /// The distance of columns.
    pub(in crate::ocp) ld: usize,
    /// The gradient with respect to the parameters themselves.
    pub(in crate::ocp) slopes: &'a mut [T],
    /// The Hessian with respect to these, both triangles.
    pub(in crate::ocp) square: &'a mut [T],
}

impl<T: Real> Cross<'_, T> {
    /// Adds to the derivative of element `row` by parameter `p`.
    pub(in crate::ocp) fn add(&mut self, row: usize, p: usize, value: T) {
        if let Some(element) = self.columns.get_mut(p * self.ld + row) {
            *element = *element + value;
        }
    }
    /// Adds to the gradient with respect to parameters.
    pub(in crate::ocp) fn slope(&mut self, p: usize, value: T) {
        if let Some(element) = self.slopes.get_mut(p) {
            *element = *element + value;
        }
    }
    /// Adds to the Hessian with respect to parameters, at this place alone.
    pub(in crate::ocp) fn curve(&mut self, p: usize, q: usize, value: T) {
        if let Some(element) = self.square.get_mut(q * self.slopes.len() + p) {
            *element = *element + value;
        }
    }
    /// Adds what parameters change of `factor ∇(μᵀy)` of the outputs of a function; entries of its
    /// Hessian are computed in `hessian`.
    pub(in crate::ocp) fn curvature<F: Function>(
        &mut self,
        v: &ArrayV<F, T>,
        mu: &ArrayY<F, T>,
        factor: T,
        hessian: &mut F::Hessian<T>,
    ) {
        each_entry::<F, T>(v, mu, hessian, |row, column, value| {
            // Parameters come after states and controls: they are rows of the lower triangle.
            let Some(p) = parameter::<F::Shape>(row) else { return };
            if let Some(position) = self.free.position::<F::Shape>(column) {
                self.add(position, p, factor * value);
            } else if let Some(q) = parameter::<F::Shape>(column) {
                self.curve(p, q, factor * value);
                if p != q {
                    self.curve(q, p, factor * value);
                }
            }
        });
    }
    /// Adds what parameters change of the gradient of `factor φ(y)` by first derivatives of the
    /// outputs of a function: `∇φ` is `mu`, its matrix `∇²φ` is `outer`.
    pub(in crate::ocp) fn gauss_newton<F: Function>(
        &mut self,
        jacobian: &F::Jacobian<T>,
        mu: &ArrayY<F, T>,
        outer: &MatrixYY<F, T>,
        factor: T,
    ) {
        let entries = || jacobian.as_ref().iter().zip(F::STRUCTURE.jacobian.iter());
        for (&b, (l, variable)) in entries() {
            let Some(p) = parameter::<F::Shape>(variable) else { continue };
            self.slope(p, factor * mu[l] * b);
            for (&a, (k, variable)) in entries() {
                let product = factor * outer[(k, l)] * a * b;
                if let Some(i) = self.free.position::<F::Shape>(variable) {
                    self.add(i, p, product);
                } else if let Some(q) = parameter::<F::Shape>(variable) {
                    self.curve(q, p, product);
                }
            }
        }
    }
    /// Adds matrices `xp`, `up` and `pp`, column after column.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn add_blocks(&mut self, [nx, nu]: [usize; 2], [xp, up, pp]: [&[T]; 3]) {
        for (to, &value) in self.square.iter_mut().zip(pp) {
            *to = *to + value;
        }
        for (first, rows, block) in [(0, nx, xp), (nx, nu, up)] {
            for (p, column) in block.chunks_exact(rows.max(1)).enumerate() {
                column.iter().enumerate().for_each(|(i, &value)| self.add(first + i, p, value));
            }
        }
    }
}

/// Adds blocks `xx`, `xu`, `uu` and `xp`, `up`, `pp`, column after column, to the lower triangle.
pub(in crate::ocp) fn add_blocks<T: Real>(
    terms: &mut Terms<'_, T>,
    nx: usize,
    [xx, xu, uu]: [&[T]; 3],
    of_parameters: [&[T]; 3],
) {
    if xx.is_empty() && uu.is_empty() {
        return;
    }
    let first = nx + terms.free.count();
    for (j, column) in xx.chunks_exact(nx.max(1)).enumerate() {
        for (i, &value) in column.iter().enumerate().skip(j) {
            terms.curve(i, j, value);
        }
    }
    for (u, column) in xu.chunks_exact(nx.max(1)).enumerate() {
        for (x, &value) in column.iter().enumerate() {
            terms.curve(first + u, x, value);
        }
    }
    let nu = xu.len() / nx.max(1);
    for (j, column) in uu.chunks_exact(nu.max(1)).enumerate() {
        for (i, &value) in column.iter().enumerate().skip(j) {
            terms.curve(first + i, first + j, value);
        }
    }
    if terms.free.count() > 0 {
        add_blocks_of_parameters(terms, [nx, nu], of_parameters);
    }
}

/// Adds those of free parameters.
fn add_blocks_of_parameters<T: Real>(
    terms: &mut Terms<'_, T>,
    [nx, nu]: [usize; 2],
    [xp, up, pp]: [&[T]; 3],
) {
    let free = terms.free;
    for (w, column) in free.columns(xp, nx) {
        column.iter().enumerate().for_each(|(x, &value)| terms.curve(nx + w, x, value));
    }
    for (w, column) in free.columns(up, nu) {
        for (u, &value) in column.iter().enumerate() {
            terms.curve(nx + free.count() + u, nx + w, value);
        }
    }
    let np = pp.len().isqrt();
    for (w, column) in free.columns(pp, np) {
        for (other, value) in free.elements(column).filter(|&(other, _)| other >= w) {
            terms.curve(nx + other, nx + w, value);
        }
    }
}
