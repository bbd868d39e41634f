//! The covariance of an estimate.
//!
//! ```text
//! Cov(w) = s² Z (Zᵀ H Z)⁻¹ Zᵀ        H: the Hessian of the cost        Z: a basis of the null space of active constraints
//! ```
//!
//! H. G. Bock, E. Kostina, J. P. Schlöder, "Numerical methods for parameter estimation in nonlinear
//! differential algebraic equations", GAMM-Mitteilungen 30 (2007); J. Nocedal, S. J. Wright,
//! *Numerical Optimization*, 2nd edition, sections 10.3 and 16.2 (null-space methods).

mod table;

use super::get;
use super::unknowns::Unknowns;
use crate::linalg::{axpy, dot};
use crate::ocp::formulation::error::{OcpError, Part, Text};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::{QpError, part, part_mut, zeros};
use crate::scalar::Real;
use crate::structure::name_matches;
use alloc::vec::Vec;
use core::fmt;

/// The covariance of states and controls of an estimate; see
/// [`Ocp::covariance`](crate::ocp::Ocp::covariance).
///
/// Parameters that are estimated are [free](crate::ocp::HeapOcp), the same at all stages. As text
/// it is a table of estimates with their standard deviations.
///
/// ```
/// # use casados::ocp::{GaussNewton, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn constant(x: [f64; 3]) -> [f64; 3] { x }
/// # /// With a standard deviation of 0.1 each: of two parameters only the product is seen.
/// # #[function]
/// # fn seen(x: [f64; 3]) -> [f64; 2] { [10.0 * (x[0] - 1.0), 10.0 * (x[1] * x[2] - 2.0)] }
/// # let cost = || LeastSquaresCost::<Seen>::diagonal(&[1.0; 2]);
/// # let mut ocp = Problem::new(Map::<Constant, f64>::new())
/// #     .stage_cost(cost())
/// #     .terminal_cost(cost())
/// #     .on(Horizon::uniform(3, 1.0))?;
/// # ocp.free_initial_state().guess(&[1.0, 2.0, 1.0], &[])?;
/// let covariance = ocp.covariance(GaussNewton::default())?;
/// // The mean of four samples.
/// let deviation = covariance.standard_deviation("x[0]", 0)?;
/// assert!((deviation - 0.05).abs() < 1e-12 && !covariance.is_identifiable());
/// println!("{covariance}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Covariance<T> {
    names: &'static Names,
    /// Names of free parameters, in front of the controls.
    free: Vec<&'static str>,
    /// `NX`, free parameters and `NU`, intervals.
    dims: [usize; 3],
    /// Rows of states and controls, stage after stage: those of `Z (Zᵀ H Z)^(−½)`.
    rows: Vec<T>,
    identifiable_count: usize,
    /// The estimate itself, in the same order.
    values: Vec<T>,
    /// Whether a variable moves along a direction that data say nothing of.
    is_unidentifiable: Vec<bool>,
    directions: Vec<Unidentifiable<T>>,
    /// `s²`
    variance_factor: T,
}

/// A combination of variables that data say nothing of: the estimate may be moved along it, and the
/// cost stays.
///
/// ```
/// # use casados::ocp::{GaussNewton, HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
/// # use casados::prelude::*;
/// # #[function]
/// # fn constant(x: [f64; 3]) -> [f64; 3] { x }
/// # /// With a standard deviation of 0.1 each: of two parameters only the product is seen.
/// # #[function]
/// # fn seen(x: [f64; 3]) -> [f64; 2] { [10.0 * (x[0] - 1.0), 10.0 * (x[1] * x[2] - 2.0)] }
/// # let cost = || LeastSquaresCost::<Seen>::diagonal(&[1.0; 2]);
/// # let mut ocp = Problem::new(Map::<Constant, f64>::new())
/// #     .stage_cost(cost())
/// #     .terminal_cost(cost())
/// #     .on(Horizon::uniform(3, 1.0))?;
/// # ocp.free_initial_state().guess(&[1.0, 2.0, 1.0], &[])?;
/// let covariance = ocp.covariance(GaussNewton::default())?;
/// for direction in covariance.unidentifiable() {
///     println!("data say nothing of {direction}");
///     let [(first, _, one), (second, _, half)] = direction.parts[..] else { panic!("two variables") };
///     assert_eq!([first, second], ["x[1]", "x[2]"]);
///     assert!((one - 1.0).abs() < 1e-9 && (half + 0.5).abs() < 1e-9);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
        Self { variance_factor: self.variance_factor * variance, ..self }
    }

    /// The covariance of two variables, each with its stage.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`], [`OcpError::NoSuchStage`], [`OcpError::NotIdentifiable`]
    pub fn covariance(&self, a: (&str, usize), b: (&str, usize)) -> Result<T, OcpError> {
        Ok(self.variance_factor * dot(self.variable_row(a)?, self.variable_row(b)?))
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

    fn variable_row(&self, (name, stage): (&str, usize)) -> Result<&[T], OcpError> {
        let [nx, nu, intervals] = self.dims;
        let position = |names: &[&str]| names.iter().position(|variable| name_matches(name, variable));
        let (index, part_of, stages, known) = match (position(self.names.x), position(self.names.u)) {
            (Some(i), _) => (i, Part::States, intervals + 1, self.names.x.get(i)),
            (None, Some(j)) => (nx + self.free.len() + j, Part::Controls, intervals, self.names.u.get(j)),
            (None, None) => match position(&self.free) {
                Some(w) => (nx + w, Part::Parameters, intervals + 1, self.free.get(w)),
                None => return Err(OcpError::UnknownName { name: Text::new(name), known: self.names }),
            },
        };
        if stage >= stages {
            return Err(OcpError::NoSuchStage { part: part_of, stage, stages });
        }
        let row_index = stage * (nx + nu) + index;
        if self.is_unidentifiable.get(row_index).copied().unwrap_or(true) {
            return Err(OcpError::NotIdentifiable { name: known.copied().unwrap_or_default(), stage });
        }
        Ok(part(&self.rows, row_index * self.identifiable_count, self.identifiable_count))
    }
}

impl<P: Formulation<T>, T: Real> HeapOcp<P, T> {
    /// The covariance of an estimate, which the iterate is: of all states, controls and free
    /// parameters at all stages.
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
    /// the null space has a negative eigenvalue: the iterate is no minimum;
    /// [`OcpError::OutOfMemory`]
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
        let information = self.reduced_hessian(&unknowns)?;
        let units: Vec<T> = (0..n).map(|i| diagonal_scale(get(&information.data, i * n + i))).collect();
        // Directions that active constraints leave, each unknown in its unit.
        let mut free_directions = Vec::new();
        for (value, vector) in self.active_constraint_gram(&unknowns, &units)?.eigenpairs()? {
            if value <= rounding {
                free_directions
                    .push(vector.iter().zip(&units).map(|(&v, &unit)| v * unit).collect::<Vec<T>>());
            }
        }
        let mut reduced = information.reduced(&free_directions)?;
        let direction_scales: Vec<T> = (0..free_directions.len())
            .map(|i| diagonal_scale(get(&reduced.data, i * free_directions.len() + i)))
            .collect();
        for (column, &scale) in
            reduced.data.chunks_exact_mut(free_directions.len().max(1)).zip(&direction_scales)
        {
            column.iter_mut().zip(&direction_scales).for_each(|(a, &other)| *a = *a * scale * other);
        }
        let eigen = reduced.eigenpairs()?;
        let largest = eigen.iter().fold(T::ZERO, |largest, (value, _)| value.abs().max(largest));
        let (mut basis, mut unidentifiable_directions) = (Vec::new(), Vec::new());
        for (value, vector) in eigen {
            let mut direction = zeros(n)?;
            for ((left, &scale), &factor) in free_directions.iter().zip(&direction_scales).zip(&vector) {
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
                unidentifiable_directions.push(direction);
            }
        }
        let covariance =
            unknowns.covariance::<P>(&basis, &unidentifiable_directions, &units, rounding.sqrt())?;
        let free = (0..self.layout().free_count).map(|w| self.free_parameter_name(w)).collect();
        let mut values = zeros((intervals + 1) * (nx + nu))?;
        for (row, stage) in values.chunks_exact_mut((nx + nu).max(1)).zip(self.iterate.stages()) {
            row.iter_mut().zip(stage.x.iter().chain(stage.u)).for_each(|(to, &value)| *to = value);
        }
        Ok(Covariance { free, values, ..covariance })
    }
}

/// What makes a diagonal element one; one itself where it is zero.
fn diagonal_scale<T: Real>(diagonal: T) -> T {
    if diagonal > T::ZERO { T::ONE / diagonal.sqrt() } else { T::ONE }
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
        let norm = |values: &mut dyn Iterator<Item = T>| {
            values.fold(T::ZERO, |sum, value| sum + value * value).sqrt()
        };
        let direction_norms: Vec<T> = null
            .iter()
            .map(|direction| norm(&mut direction.iter().zip(units).map(|(&d, &unit)| d / unit)))
            .collect();
        for (v, z) in self.rows.chunks_exact(n.max(1)).enumerate() {
            let row = part_mut(&mut rows, v * basis.len(), basis.len());
            row.iter_mut().zip(basis).for_each(|(element, b)| *element = dot(z, b));
            let row_norm = norm(&mut z.iter().zip(units).map(|(&z, &unit)| z * unit));
            let mut directions = null.iter().zip(&direction_norms);
            unknown.push(
                directions
                    .any(|(direction, &length)| dot(z, direction).abs() > tolerance * length * row_norm),
            );
        }
        let directions = null.iter().zip(&direction_norms);
        let directions =
            directions.map(|(direction, &length)| self.named_direction(direction, units, tolerance * length));
        Ok(Covariance {
            names: const { &<P::Dynamics as Dynamics<T>>::NAMES },
            free: Vec::new(),
            dims: self.dims,
            rows,
            identifiable_count: basis.len(),
            values: Vec::new(),
            is_unidentifiable: unknown,
            directions: directions.collect(),
            variance_factor: T::ONE,
        })
    }

    /// A direction by the names of its parts, but for those that are no more than the tolerance in
    /// their units.
    fn named_direction(&self, direction: &[T], units: &[T], tolerance: T) -> Unidentifiable<T> {
        let largest =
            direction.iter().fold(T::ZERO, |largest, &d| if d.abs() > largest.abs() { d } else { largest });
        let parts = self.names.iter().zip(direction.iter().zip(units));
        let parts = parts.filter(|&(_, (&d, &unit))| d.abs() > tolerance * unit);
        Unidentifiable { parts: parts.map(|(&(name, stage), (&d, _))| (name, stage, d / largest)).collect() }
    }
}
