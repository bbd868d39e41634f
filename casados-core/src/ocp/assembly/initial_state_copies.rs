//! Copies of elements of the first state, for boundary conditions at the last stage.

use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::SolutionStage;
use crate::qp::element::{get, set};
use crate::scalar::Real;
use crate::shape::Shape;

/// Writes the constraints `x₀[i] − w = 0` of the copies, after the path constraints: values and
/// gradients, which are zero at other stages.
pub(in crate::ocp) fn link_initial_state_copies<P: Formulation<T>, T: Real>(
    at: &SolutionStage<'_, T>,
    stage: usize,
    (values, columns, ld): (&mut [T], &mut [T], usize),
) {
    for copy_index in 0..P::Terminal::INITIAL_STATE_COPIES {
        let (row, state, w) =
            (P::Path::ROWS + copy_index, P::Terminal::copied_state(copy_index), P::Shape::NX + copy_index);
        let is_first = stage == 0;
        set(values, row, if is_first { get(at.x, state) - get(at.u, copy_index) } else { T::ZERO });
        if is_first && ld > 0 {
            set(columns, row * ld + state, T::ONE);
            set(columns, row * ld + w, -T::ONE);
        }
    }
}
