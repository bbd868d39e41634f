//! The unknowns of an estimate, and a basis of the null space of the dynamics.

use crate::linalg::axpy;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::data::Layout;
use crate::ocp::formulation::instance::{HeapOcp, InitialState};
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::add;
use crate::qp::{is_marked, marked_indices, part, part_mut, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// The unknowns of an estimate: elements of the first state, free parameters and shared controls,
/// and controls of every stage; with the derivatives of all variables with respect to them.
pub(super) struct Unknowns<T> {
    /// `NX`; free parameters and `NU`; intervals.
    pub dims: [usize; 3],
    /// Name and stage of each unknown.
    pub names: Vec<(&'static str, usize)>,
    /// Rows of `Z`, a row of `names.len()` elements for each variable of each stage.
    pub rows: Vec<T>,
}

impl<T: Real> Unknowns<T> {
    pub fn count(&self) -> usize {
        self.names.len()
    }
    fn row_start(&self, stage: usize, index: usize) -> usize {
        let [nx, nu, _] = self.dims;
        (stage * (nx + nu) + index) * self.count()
    }
    pub fn row(&self, stage: usize, index: usize) -> &[T] {
        part(&self.rows, self.row_start(stage, index), self.count())
    }

    /// The unknowns of a linearised problem.
    pub fn new<P: Formulation<T>>(ocp: &HeapOcp<P, T>) -> Result<Self, OcpError> {
        let Layout { intervals, free_count: free, .. } = ocp.layout();
        let (nx, nu) = (P::Shape::NX, free + P::Shape::NU);
        let model_names = <P::Dynamics as Dynamics<T>>::NAMES;
        let qp = ocp.qp();
        let mut names = Vec::new();
        if ocp.initial_state == InitialState::Free {
            names.extend(model_names.x.iter().map(|&name| (name, 0)));
        }
        let is_shared = |j: usize| is_marked(qp.shared(), j);
        let name = |j: usize| match j.checked_sub(free) {
            None => ocp.free_parameter_name(j),
            Some(j) => model_names.u.get(j).copied().unwrap_or_default(),
        };
        names.extend(marked_indices(qp.shared()).map(|j| (name(j), 0)));
        for k in 0..intervals {
            names.extend((free..nu).filter(|&j| !is_shared(j)).map(|j| (name(j), k)));
        }
        let count = names.len();
        let rows = zeros((intervals + 1) * (nx + nu) * count)?;
        let mut unknowns = Self { dims: [nx, nu, intervals], names, rows };
        let first = if ocp.initial_state == InitialState::Free { nx } else { 0 };
        for i in 0..first {
            let place = unknowns.row_start(0, i) + i;
            add(&mut unknowns.rows, place, T::ONE);
        }
        // Free parameters belong to the last stage too.
        for w in 0..free {
            let place = unknowns.row_start(intervals, nx + w) + first + w;
            add(&mut unknowns.rows, place, T::ONE);
        }
        let shared = marked_indices(qp.shared()).count();
        let mut next_own = first + shared;
        for (k, stage) in qp.stages().enumerate().take(intervals) {
            let mut next_shared = first;
            for j in 0..nu {
                let unknown = if is_shared(j) { &mut next_shared } else { &mut next_own };
                let place = unknowns.row_start(k, nx + j) + *unknown;
                *unknown += 1;
                add(&mut unknowns.rows, place, T::ONE);
            }
            let view = stage.arrays();
            let (before, behind) =
                unknowns.rows.split_at_mut_checked((k + 1) * (nx + nu) * count).unwrap_or_default();
            let here = part(before, k * (nx + nu) * count, (nx + nu) * count);
            for i in 0..nx {
                let next = part_mut(behind, i * count, count);
                let column = part(view.matrix, i * view.ld, nx + nu);
                for (&factor, row) in column.iter().zip(here.chunks_exact(count.max(1))) {
                    axpy(factor, row, next);
                }
            }
        }
        Ok(unknowns)
    }
}
