//! The covariance of an estimate.
//!
//! ```text
//! Cov(w) = s² Z (Zᵀ H Z)⁻¹ Zᵀ        H: the Hessian of the cost        Z: a basis of the null space of active constraints
//! ```
//!
//! H. G. Bock, E. Kostina, J. P. Schlöder, "Numerical methods for parameter estimation in nonlinear
//! differential algebraic equations", GAMM-Mitteilungen 30 (2007); J. Nocedal, S. J. Wright,
//! *Numerical Optimization*, 2nd edition, sections 10.3 and 16.2 (null-space methods).

use super::get;
use crate::linalg::axpy;
use crate::ocp::HeapOcp;
use crate::ocp::convexify::diagonalise;
use crate::ocp::curvature::Curvature;
use crate::ocp::dynamics::Dynamics;
use crate::ocp::error::{OcpError, Part, Text};
use crate::ocp::instance::Initial;
use crate::ocp::names::Names;
use crate::ocp::problem::Formulation;
use crate::ocp::transfer::dot;
use crate::qp::element::add;
use crate::qp::{Bounds, QpError, assign, is_marked, marked, part, part_mut, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use crate::structure::means;
use alloc::vec::Vec;
use core::fmt;

/// The covariance of states and controls of an estimate; see
/// [`Ocp::covariance`](super::super::Ocp::covariance).
///
/// Parameters that are estimated are states that do not change, or shared controls.
#[derive(Clone, Debug)]
pub struct Covariance<T> {
    names: &'static Names,
    /// `NX`, `NU`, intervals.
    dims: [usize; 3],
    /// Rows of states and controls, stage after stage: those of `Z (Zᵀ H Z)^(−½)`.
    rows: Vec<T>,
    rank: usize,
    /// Whether a variable moves along a direction that data say nothing of.
    unknown: Vec<bool>,
    directions: Vec<Unidentifiable<T>>,
    /// `s²`
    scale: T,
}

/// A combination of variables that data say nothing of: the estimate may be moved along it, and the
/// cost stays.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Unidentifiable<T> {
    /// Name, stage and coefficient of those variables that the others follow from: elements of the
    /// first state, controls. The largest coefficient is one.
    pub parts: Vec<(&'static str, usize, T)>,
}

/// Writes what the direction consists of: `+1.00 x[2] −0.80 x[4]`, with the stage where it is not
/// the first one.
impl<T: Real> fmt::Display for Unidentifiable<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (name, stage, value)) in self.parts.iter().enumerate() {
            let space = if i > 0 { " " } else { "" };
            write!(f, "{space}{:+.2} {name}", value.to_f64())?;
            if *stage > 0 {
                write!(f, " at stage {stage}")?;
            }
        }
        Ok(())
    }
}

impl<T: Real> Covariance<T> {
    /// Whether all variables have a variance.
    #[must_use]
    pub fn is_identifiable(&self) -> bool {
        self.directions.is_empty()
    }

    /// What data say nothing of, one direction for each degree of freedom; empty if everything is
    /// identifiable.
    #[must_use]
    pub fn unidentifiable(&self) -> &[Unidentifiable<T>] {
        &self.directions
    }

    /// The same for a noise of another variance: with residuals that are not divided by their
    /// standard deviation `s² = ‖r‖² / (m − n)`, of `m` residuals and `n` unknowns.
    #[must_use]
    pub fn scaled(self, variance: T) -> Self {
        Self { scale: self.scale * variance, ..self }
    }

    /// The covariance of two variables, each with its stage.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::NotIdentifiable`]
    pub fn covariance(&self, a: (&str, usize), b: (&str, usize)) -> Result<T, OcpError> {
        Ok(self.scale * dot(self.row(a)?, self.row(b)?))
    }

    /// The variance of a variable at a stage.
    ///
    /// # Errors
    /// As [`Covariance::covariance`].
    pub fn variance(&self, name: &str, stage: usize) -> Result<T, OcpError> {
        self.covariance((name, stage), (name, stage))
    }

    /// The standard deviation of a variable at a stage, in its units.
    ///
    /// # Errors
    /// As [`Covariance::covariance`].
    pub fn standard_deviation(&self, name: &str, stage: usize) -> Result<T, OcpError> {
        Ok(self.variance(name, stage)?.sqrt())
    }

    fn row(&self, (name, stage): (&str, usize)) -> Result<&[T], OcpError> {
        let [nx, nu, intervals] = self.dims;
        let position = |names: &[&str]| names.iter().position(|variable| means(name, variable));
        let (index, part_of, stages, known) = match (position(self.names.x), position(self.names.u)) {
            (Some(i), _) => (i, Part::States, intervals + 1, self.names.x.get(i)),
            (None, Some(j)) => (nx + j, Part::Controls, intervals, self.names.u.get(j)),
            (None, None) => {
                return Err(OcpError::UnknownName { name: Text::new(name), known: self.names });
            }
        };
        if stage >= stages {
            return Err(OcpError::NoSuchStage { part: part_of, stage, stages });
        }
        let place = stage * (nx + nu) + index;
        if self.unknown.get(place).copied().unwrap_or(true) {
            return Err(OcpError::NotIdentifiable { name: known.copied().unwrap_or_default(), stage });
        }
        Ok(part(&self.rows, place * self.rank, self.rank))
    }
}

/// What the estimate is found by: elements of the first state, shared controls, controls of every
/// stage; and how all variables follow from these.
struct Unknowns<T> {
    /// `NX`, `NU`, intervals.
    dims: [usize; 3],
    /// Name and stage of each.
    names: Vec<(&'static str, usize)>,
    /// Rows of `Z`, a row of `names.len()` elements for each variable of each stage.
    rows: Vec<T>,
}

impl<T: Real> Unknowns<T> {
    fn count(&self) -> usize {
        self.names.len()
    }
    fn place(&self, stage: usize, index: usize) -> usize {
        let [nx, nu, _] = self.dims;
        (stage * (nx + nu) + index) * self.count()
    }
    fn row(&self, stage: usize, index: usize) -> &[T] {
        part(&self.rows, self.place(stage, index), self.count())
    }

    /// Those of a problem that has been linearised.
    fn new<P: Formulation<T>>(ocp: &HeapOcp<P, T>) -> Result<Self, OcpError> {
        let (nx, nu, intervals) = (P::Shape::NX, P::Shape::NU, ocp.intervals());
        let known = <P::Dynamics as Dynamics<T>>::NAMES;
        let qp = ocp.qp();
        let mut names = Vec::new();
        if ocp.initial == Initial::Free {
            names.extend(known.x.iter().map(|&name| (name, 0)));
        }
        let is_shared = |j: usize| is_marked(qp.shared(), j);
        names.extend(marked(qp.shared()).filter_map(|j| known.u.get(j)).map(|&name| (name, 0)));
        for k in 0..intervals {
            let own = known.u.iter().enumerate().filter(|&(j, _)| !is_shared(j));
            names.extend(own.map(|(_, &name)| (name, k)));
        }
        let count = names.len();
        let rows = zeros((intervals + 1) * (nx + nu) * count)?;
        let mut all = Self { dims: [nx, nu, intervals], names, rows };
        let first = if ocp.initial == Initial::Free { nx } else { 0 };
        for i in 0..first {
            let place = all.place(0, i) + i;
            add(&mut all.rows, place, T::ONE);
        }
        let shared = marked(qp.shared()).count();
        let mut own = first + shared;
        for (k, stage) in qp.stages().enumerate().take(intervals) {
            let mut joint = first;
            for j in 0..nu {
                let unknown = if is_shared(j) { &mut joint } else { &mut own };
                let place = all.place(k, nx + j) + *unknown;
                *unknown += 1;
                add(&mut all.rows, place, T::ONE);
            }
            let view = stage.arrays();
            let (before, behind) =
                all.rows.split_at_mut_checked((k + 1) * (nx + nu) * count).unwrap_or_default();
            let here = part(before, k * (nx + nu) * count, (nx + nu) * count);
            for i in 0..nx {
                let next = part_mut(behind, i * count, count);
                let column = part(view.matrix, i * view.ld, nx + nu);
                for (&factor, row) in column.iter().zip(here.chunks_exact(count.max(1))) {
                    axpy(factor, row, next);
                }
            }
        }
        Ok(all)
    }
}

/// A symmetric matrix of `n` unknowns, column after column, both triangles.
struct Gram<T> {
    n: usize,
    data: Vec<T>,
}

impl<T: Real> Gram<T> {
    fn new(n: usize) -> Result<Self, OcpError> {
        Ok(Self { n, data: zeros(n * n)? })
    }
    /// Adds `factor (a bᵀ + b aᵀ) / 2`.
    fn add(&mut self, factor: T, a: &[T], b: &[T]) {
        let half = T::from_f64(0.5) * factor;
        for ((column, &x), &y) in self.data.chunks_exact_mut(self.n.max(1)).zip(a).zip(b) {
            axpy(half * y, a, column);
            axpy(half * x, b, column);
        }
    }
    /// `Bᵀ A B`, for columns of `B`.
    fn reduced(&self, basis: &[Vec<T>]) -> Result<Self, OcpError> {
        let mut result = Self::new(basis.len())?;
        let mut product = zeros(self.n)?;
        for (column, b) in result.data.chunks_exact_mut(basis.len().max(1)).zip(basis) {
            product.fill(T::ZERO);
            for (a, &factor) in self.data.chunks_exact(self.n.max(1)).zip(b) {
                axpy(factor, a, &mut product);
            }
            for (element, other) in column.iter_mut().zip(basis) {
                *element = dot(&product, other);
            }
        }
        Ok(result)
    }
    /// Eigenvalues, each with its eigenvector (Jacobi's method).
    fn eigen(mut self) -> Result<Vec<(T, Vec<T>)>, OcpError> {
        let n = self.n;
        let mut vectors = zeros(n * n)?;
        (0..n).for_each(|i| add(&mut vectors, i * n + i, T::ONE));
        diagonalise(&mut self.data, &mut vectors, n.max(1), n);
        let value = |i: usize| get(&self.data, i * n + i);
        Ok(vectors.chunks_exact(n.max(1)).enumerate().map(|(i, v)| (value(i), v.to_vec())).collect())
    }
}

impl<P: Formulation<T>, T: Real> HeapOcp<P, T> {
    /// The covariance of an estimate, which the iterate is: of all states and controls at all
    /// stages.
    ///
    /// ```text
    /// Cov(w) = Z (Zᵀ H Z)⁻¹ Zᵀ
    /// ```
    ///
    /// `H` is the Hessian of the cost, the matrix of Gauss and Newton `Σ JᵀWJ` with
    /// [`GaussNewton`](crate::ocp::GaussNewton): with weights `1/σ²` the information of samples
    /// with independent Gaussian noise of the standard deviation `σ`
    /// ([`Covariance::scaled`] is for other weights), and of an arrival cost. Columns of `Z` are a
    /// basis of the directions that dynamics, couplings and active hard bounds leave; bounds are
    /// active where their multiplier is larger than their slack. Soft bounds are none.
    ///
    /// What data say nothing of is found by the eigenvalues of `D Zᵀ H Z D`, whose diagonal is
    /// one: those below `n m ε` times the largest one, with `n` unknowns, `m` variables in all
    /// stages and the accuracy `ε` of the numbers, are no more than what rounding makes of sums of
    /// `m` products. Their eigenvectors are [`Covariance::unidentifiable`]; a variable that moves
    /// along one of these by more than `(n m ε)^½` of what it moves by where each unknown moves by
    /// its unit, the inverse root of its diagonal element of `Zᵀ H Z`, has no variance.
    ///
    /// It takes `O(m n² + n³)` operations.
    ///
    /// # Errors
    /// Those of [`Ocp::linearise`](crate::ocp::Ocp::linearise); [`OcpError::Qp`] if the Hessian on
    /// the null space has a negative eigenvalue: the iterate is no minimum; [`OcpError::OutOfMemory`]
    ///
    /// # Example
    /// Of two parameters only the product is seen.
    /// ```
    /// use casados::ocp::{GaussNewton, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
    /// use casados::prelude::*;
    ///
    /// #[function]
    /// fn constant(x: [f64; 3]) -> [f64; 3] { x }
    /// /// With a standard deviation of 0.1 each.
    /// #[function]
    /// fn seen(x: [f64; 3]) -> [f64; 2] { [10.0 * (x[0] - 1.0), 10.0 * (x[1] * x[2] - 2.0)] }
    ///
    /// let cost = || LeastSquaresCost::<Seen>::diagonal(&[1.0; 2]);
    /// let mut ocp = Problem::new(Map::<Constant, f64>::new())
    ///     .stage_cost(cost())
    ///     .terminal_cost(cost())
    ///     .on(Horizon::uniform(3, 1.0))?;
    /// ocp.free_initial_state().guess(&[1.0, 2.0, 1.0], &[])?;
    /// let covariance = ocp.covariance(GaussNewton::default())?;
    /// // The mean of four samples.
    /// assert!((covariance.standard_deviation("x[0]", 0)? - 0.05).abs() < 1e-12);
    /// assert!(covariance.variance("x[1]", 0).is_err());
    /// assert_eq!(covariance.unidentifiable()[0].to_string(), "+1.00 x[1] -0.50 x[2]");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn covariance<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
    ) -> Result<Covariance<T>, OcpError> {
        self.linearise(curvature)?;
        let unknowns = Unknowns::new(self)?;
        let [nx, nu, intervals] = unknowns.dims;
        let n = unknowns.count();
        let rounding = T::from_f64(T::EPSILON * (n * (intervals + 1) * (nx + nu)).max(1) as f64);
        let information = self.information(&unknowns)?;
        let units: Vec<T> = (0..n).map(|i| unit(get(&information.data, i * n + i))).collect();
        // Directions that active constraints leave, each unknown in its unit.
        let mut left = Vec::new();
        for (value, vector) in self.active_constraints(&unknowns, &units)?.eigen()? {
            if value <= rounding {
                left.push(vector.iter().zip(&units).map(|(&v, &unit)| v * unit).collect::<Vec<T>>());
            }
        }
        let mut reduced = information.reduced(&left)?;
        let scales: Vec<T> = (0..left.len()).map(|i| unit(get(&reduced.data, i * left.len() + i))).collect();
        for (column, &scale) in reduced.data.chunks_exact_mut(left.len().max(1)).zip(&scales) {
            column.iter_mut().zip(&scales).for_each(|(a, &other)| *a = *a * scale * other);
        }
        let eigen = reduced.eigen()?;
        let largest = eigen.iter().fold(T::ZERO, |largest, (value, _)| value.abs().max(largest));
        let (mut basis, mut null) = (Vec::new(), Vec::new());
        for (value, vector) in eigen {
            let mut direction = zeros(n)?;
            for ((left, &scale), &factor) in left.iter().zip(&scales).zip(&vector) {
                axpy(factor * scale, left, &mut direction);
            }
            if value > rounding * largest {
                let deviation = T::ONE / value.sqrt();
                direction.iter_mut().for_each(|d| *d = *d * deviation);
                basis.push(direction);
            } else if value < T::ZERO - rounding * largest {
                let pivot = value.to_f64();
                return Err(OcpError::Qp(QpError::NotConvex { stage: 0, index: 0, pivot }));
            } else {
                null.push(direction);
            }
        }
        unknowns.covariance::<P>(&basis, &null, &units, rounding.sqrt())
    }

    /// `Zᵀ H Z`
    fn information(&self, unknowns: &Unknowns<T>) -> Result<Gram<T>, OcpError> {
        let mut gram = Gram::new(unknowns.count())?;
        for (k, stage) in self.qp().stages().enumerate() {
            let view = stage.arrays();
            for j in 0..view.n {
                for i in j..view.n {
                    let value = get(view.hessian, j * view.ld + i);
                    if value != T::ZERO {
                        let factor = if i == j { value } else { value + value };
                        gram.add(factor, unknowns.row(k, i), unknowns.row(k, j));
                    }
                }
            }
        }
        Ok(gram)
    }

    /// `Σ c cᵀ` of the gradients of active constraints by the unknowns in their units, each of
    /// length one.
    fn active_constraints(&self, unknowns: &Unknowns<T>, units: &[T]) -> Result<Gram<T>, OcpError> {
        let n = unknowns.count();
        let mut gram = Gram::new(n)?;
        let mut row = zeros(n)?;
        let mut take = |row: &mut [T]| {
            row.iter_mut().zip(units).for_each(|(c, &unit)| *c = *c * unit);
            let square = dot(row, row);
            if square > T::ZERO {
                gram.add(T::ONE / square, row, row);
            }
            row.fill(T::ZERO);
        };
        let qp = self.qp();
        for ((k, stage), point) in qp.stages().enumerate().zip(self.iterate.stages()) {
            let view = stage.arrays();
            let nx = point.x.len();
            let values = || point.x.iter().chain(point.u);
            for (i, &x) in point.x.iter().enumerate() {
                let multipliers = [get(point.x_lower, i), get(point.x_upper, i)];
                if is_active(&stage.x_bounds(), i, x, multipliers) {
                    assign(&mut row, unknowns.row(k, i));
                    take(&mut row);
                }
            }
            for (j, &u) in point.u.iter().enumerate() {
                let multipliers = [get(point.u_lower, j), get(point.u_upper, j)];
                if is_active(&stage.u_bounds(), j, u, multipliers) {
                    assign(&mut row, unknowns.row(k, nx + j));
                    take(&mut row);
                }
            }
            for (g, (&lower, &upper)) in point.g_lower.iter().zip(point.g_upper).enumerate() {
                let column = part(view.matrix, (view.next + g) * view.ld, view.n);
                let value = column.iter().zip(values()).fold(T::ZERO, |sum, (&c, &v)| sum + c * v);
                if is_active(&stage.g_bounds(), g, value, [lower, upper]) {
                    for (i, &factor) in column.iter().enumerate() {
                        axpy(factor, unknowns.row(k, i), &mut row);
                    }
                    take(&mut row);
                }
            }
        }
        for i in marked(qp.periodic()) {
            assign(&mut row, unknowns.row(0, i));
            axpy(-T::ONE, unknowns.row(self.intervals(), i), &mut row);
            take(&mut row);
        }
        Ok(gram)
    }
}

/// What makes a diagonal element one; one itself where it is zero.
fn unit<T: Real>(diagonal: T) -> T {
    if diagonal > T::ZERO { T::ONE / diagonal.sqrt() } else { T::ONE }
}

/// Whether a hard bound is an equation, or its multiplier larger than its slack.
fn is_active<T: Real>(bounds: &Bounds<'_, T>, i: usize, value: T, [lower, upper]: [T; 2]) -> bool {
    let at = |values: &[T]| get(values, i);
    let is_hard = |linear: &[T]| !at(linear).is_finite();
    let equation = at(bounds.lower) == at(bounds.upper);
    let below = lower > value - at(bounds.lower) && is_hard(bounds.lower_linear);
    let above = upper > at(bounds.upper) - value && is_hard(bounds.upper_linear);
    equation || below || above
}

impl<T: Real> Unknowns<T> {
    /// From the unknowns to all variables.
    fn covariance<P: Formulation<T>>(
        &self,
        basis: &[Vec<T>],
        null: &[Vec<T>],
        units: &[T],
        tolerance: T,
    ) -> Result<Covariance<T>, OcpError> {
        let n = self.count();
        let variables = self.rows.len().checked_div(n).unwrap_or(0);
        let mut rows = zeros(variables * basis.len())?;
        let mut unknown = Vec::with_capacity(variables);
        let length = |values: &mut dyn Iterator<Item = T>| {
            values.fold(T::ZERO, |sum, value| sum + value * value).sqrt()
        };
        let lengths: Vec<T> = null
            .iter()
            .map(|direction| length(&mut direction.iter().zip(units).map(|(&d, &unit)| d / unit)))
            .collect();
        for (v, z) in self.rows.chunks_exact(n.max(1)).enumerate() {
            let row = part_mut(&mut rows, v * basis.len(), basis.len());
            row.iter_mut().zip(basis).for_each(|(element, b)| *element = dot(z, b));
            let moves = length(&mut z.iter().zip(units).map(|(&z, &unit)| z * unit));
            let mut directions = null.iter().zip(&lengths);
            unknown.push(
                directions.any(|(direction, &length)| dot(z, direction).abs() > tolerance * length * moves),
            );
        }
        let directions = null.iter().zip(&lengths);
        let directions =
            directions.map(|(direction, &length)| self.named(direction, units, tolerance * length));
        Ok(Covariance {
            names: const { &<P::Dynamics as Dynamics<T>>::NAMES },
            dims: self.dims,
            rows,
            rank: basis.len(),
            unknown,
            directions: directions.collect(),
            scale: T::ONE,
        })
    }

    /// A direction by the names of its parts, but for those that are no more than the tolerance in
    /// their units.
    fn named(&self, direction: &[T], units: &[T], tolerance: T) -> Unidentifiable<T> {
        let largest =
            direction.iter().fold(T::ZERO, |largest, &d| if d.abs() > largest.abs() { d } else { largest });
        let parts = self.names.iter().zip(direction.iter().zip(units));
        let parts = parts.filter(|&(_, (&d, &unit))| d.abs() > tolerance * unit);
        Unidentifiable { parts: parts.map(|(&(name, stage), (&d, _))| (name, stage, d / largest)).collect() }
    }
}
