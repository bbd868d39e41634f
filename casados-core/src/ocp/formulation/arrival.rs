//! The arrival cost of moving-horizon estimation: prior information about the first state.
//!
//! ```text
//! ½ (x₀ − x̄)ᵀ W (x₀ − x̄)
//! ```

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::functions::weights::{WeightError, check_semidefinite};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{arrival_weights, split_data};
use crate::ocp::formulation::problem::Formulation;
use crate::qp::{Qp, Solution, StageDims};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use bytemuck::Zeroable;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Sets the arrival cost of moving-horizon estimation: adds `½ (x₀ − x̄)ᵀ W (x₀ − x̄)` to the
    /// objective and replaces an earlier arrival cost. `W` is the inverse of the covariance of
    /// `x̄`; `weight` has the columns of `W`, which is symmetric. `W = 0` removes the cost.
    ///
    /// C. V. Rao, J. B. Rawlings, D. Q. Mayne, IEEE Trans. Autom. Control 48 (2003).
    ///
    /// # Errors
    /// [`OcpError::Length`]; [`OcpError::InvalidValue`] of `x̄`;
    /// [`OcpError::InvalidArrivalWeight`].
    ///
    /// # Example
    /// The prior mean is 0 with the weight 1, the measurement 3 with the weight 2:
    /// `x + 2 (x − 3) = 0`.
    /// ```
    /// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
    /// use casados::prelude::*;
    ///
    /// #[function]
    /// fn drift(x: f64, u: f64) -> f64 { x + u }
    /// #[function]
    /// fn disturbance(_x: f64, u: f64) -> f64 { 1e3 * u }
    /// #[function]
    /// fn measured(x: f64, _u: f64) -> f64 { x }
    ///
    /// let mut ocp = Problem::new(Map::<Drift, f64>::new())
    ///     .stage_cost(LeastSquaresCost::<Disturbance>::diagonal(&[1.0]))
    ///     .terminal_cost(LeastSquaresCost::<Measured>::diagonal(&[2.0]))
    ///     .on(Horizon::uniform(1, 1.0))?;
    /// ocp.free_initial_state().guess(&[0.0], &[0.0])?;
    /// ocp.set_arrival_cost(&[0.0], &[1.0])?.set_terminal_reference(&[3.0])?;
    /// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// assert!((ocp.stage(0)?.x[0] - 2.0).abs() < 1e-4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_arrival_cost(&mut self, mean: &[T], weight: &[T]) -> Result<&mut Self, OcpError> {
        let nx = P::Shape::NX;
        Labels::states::<P, T>(Part::InitialState, 0).check_vector(mean, nx)?;
        Labels::states::<P, T>(Part::Arrival, 0).check_length(weight, nx * nx)?;
        let mut matrix = <P::Shape as Shape>::MatrixXX::<T>::zeroed();
        crate::qp::copy_common(matrix.as_mut_slice(), weight);
        check_semidefinite::<T, _>(&matrix, true).map_err(
            |WeightError { indices: place, value, allowed }| {
                let x = <P::Dynamics as Dynamics<T>>::NAMES.x;
                let states = place.map(|state| x.get(state).copied().unwrap_or_default());
                OcpError::InvalidArrivalWeight { states, value, allowed }
            },
        )?;
        let layout = self.layout();
        let arrival = split_data::<P, T>(self.data.as_mut(), layout).arrival;
        crate::qp::copy_common(arrival, mean);
        crate::qp::copy_common(arrival.get_mut(nx..).unwrap_or_default(), weight);
        Ok(self)
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns whether there is an arrival cost, which may couple all elements of the first state.
    pub(crate) fn has_arrival_cost(&self) -> bool {
        let weights = arrival_weights::<P, T>(self.data.as_ref(), self.layout());
        weights.iter().any(|&weight| weight != T::ZERO)
    }
}

/// Returns the arrival cost at a point.
pub(in crate::ocp) fn arrival_cost<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    arrival: &[T],
    at: &Solution<T, D, M>,
) -> T {
    let Some(first) = at.stages().next() else { return T::ZERO };
    let (mean, weight) = arrival.split_at_checked(first.x.len()).unwrap_or_default();
    let distance = || first.x.iter().zip(mean).map(|(&x, &mean)| x - mean);
    let columns = weight.chunks_exact(mean.len().max(1)).zip(distance());
    let quadratic_form = columns.fold(T::ZERO, |sum, (column, d)| {
        column.iter().zip(distance()).fold(sum, |sum, (&w, other)| sum + d * w * other)
    });
    T::from_f64(0.5) * quadratic_form
}

/// Adds the arrival cost to a QP in absolute variables: `W` to the Hessian, and to the gradient
/// `W (x − x̄)` at the given state, or `−W x̄` without one.
pub(in crate::ocp) fn add_to_qp<T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>>(
    arrival: &[T],
    state: &[T],
    qp: &mut Qp<T, D, M>,
) {
    let nx = qp.dims().first().map_or(0, |first| first.nx);
    let (mean, weight) = arrival.split_at_checked(nx).unwrap_or_default();
    if weight.iter().all(|&w| w == T::ZERO) {
        return;
    }
    let Some(mut stage) = qp.stage_mut(0) else { return };
    let arrays = stage.arrays();
    let columns = arrays.hessian.chunks_exact_mut(arrays.ld.max(1)).zip(arrays.gradient);
    for ((j, weight), (column, gradient)) in weight.chunks_exact(nx.max(1)).enumerate().zip(columns) {
        for (h, &w) in column.iter_mut().zip(weight).skip(j) {
            *h = *h + w;
        }
        let at = state.iter().copied().chain(core::iter::repeat(T::ZERO));
        *gradient = weight
            .iter()
            .zip(mean.iter().zip(at))
            .fold(*gradient, |sum, (&w, (&mean, x))| sum - w * (mean - x));
    }
}
