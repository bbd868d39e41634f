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
/// Estimated parameters are [free](crate::ocp::HeapOcp), equal at all stages.
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
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Covariance<T> {
    names: &'static Names,
    /// Names of free parameters, which precede the controls.
    free: Vec<&'static str>,
    /// `NX`; free parameters and `NU`; intervals.
    dims: [usize; 3],
    /// Rows of `Z (Zᵀ H Z)^(−½)` for states and controls, by stages.
    rows: Vec<T>,
    identifiable_count: usize,
    /// Whether a variable changes along an unidentifiable direction.
    is_unidentifiable: Vec<bool>,
    directions: Vec<Unidentifiable<T>>,
    /// `s²`
    variance_factor: T,
}

/// An unidentifiable direction: a combination of variables along which the estimate can change
/// without changing the cost.
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
    /// Name, stage and coefficient of the independent variables in the direction: elements of the
    /// first state, and controls. The largest coefficient is one.
    pub parts: Vec<(&'static str, usize, T)>,
}

/// Writes the parts of the direction: `+1.00 x[2] −0.80 x[4]`, with the stage unless it is the
/// first.
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

    /// The unidentifiable directions, one for each degree of freedom; empty if everything is
    /// identifiable.
    #[must_use]
    pub fn unidentifiable(&self) -> &[Unidentifiable<T>] {
        &self.directions
    }

    /// The covariance for another variance of the noise: for residuals that are not divided by
    /// their standard deviation `s² = ‖r‖² / (m − n)`, with `m` residuals and `n` unknowns.
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
    /// The covariance of the estimate at the iterate, for all states, controls and free parameters
    /// at all stages.
    ///
    /// ```text
    /// Cov(w) = Z (Zᵀ H Z)⁻¹ Zᵀ
    /// ```
    ///
    /// `H` is the Hessian of the cost: with [`GaussNewton`](crate::ocp::GaussNewton) the
    /// Gauss-Newton matrix `Σ JᵀWJ`. With weights `1/σ²` it is the information of samples with
    /// independent Gaussian noise of standard deviation `σ`, and of an arrival cost; for other
    /// weights see [`Covariance::scaled`]. The columns of `Z` are a basis of the null space of
    /// dynamics, couplings and active hard bounds. A bound is active if its multiplier is larger
    /// than its slack. Soft bounds are ignored.
    ///
    /// Unidentifiable directions are eigenvectors of `D Zᵀ H Z D`, scaled to a unit diagonal, with
    /// eigenvalues below `n m ε` times the largest one: the rounding error of sums of `m` products.
    /// There are `n` unknowns and `m` variables in all stages; `ε` is the unit roundoff. They are
    /// listed by [`Covariance::unidentifiable`]. A variable has no variance if it moves along one
    /// of them by more than `(n m ε)^½` of its movement when each unknown moves by its unit, the
    /// inverse root of its diagonal element of `Zᵀ H Z`.
    ///
    /// The complexity is `O(m n² + n³)`.
    ///
    /// # Errors
    /// The errors of [`Ocp::linearise`](crate::ocp::Ocp::linearise); [`OcpError::Qp`] if the
    /// Hessian on the null space has a negative eigenvalue, so that the iterate is no minimum;
    /// [`OcpError::OutOfMemory`].
    ///
    /// # Example
    /// Only the product of two parameters is identifiable.
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
        // The null space of active constraints, with unknowns in their units.
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
        Ok(Covariance { free, ..covariance })
    }
}

/// The factor that scales a diagonal element to one; one for a zero element.
fn diagonal_scale<T: Real>(diagonal: T) -> T {
    if diagonal > T::ZERO { T::ONE / diagonal.sqrt() } else { T::ONE }
}

impl<T: Real> Unknowns<T> {
    /// Computes the covariance of all variables from that of the unknowns.
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
            is_unidentifiable: unknown,
            directions: directions.collect(),
            variance_factor: T::ONE,
        })
    }

    /// Names the parts of a direction that exceed the tolerance in their units.
    fn named_direction(&self, direction: &[T], units: &[T], tolerance: T) -> Unidentifiable<T> {
        let largest =
            direction.iter().fold(T::ZERO, |largest, &d| if d.abs() > largest.abs() { d } else { largest });
        let parts = self.names.iter().zip(direction.iter().zip(units));
        let parts = parts.filter(|&(_, (&d, &unit))| d.abs() > tolerance * unit);
        Unidentifiable { parts: parts.map(|(&(name, stage), (&d, _))| (name, stage, d / largest)).collect() }
    }
}
