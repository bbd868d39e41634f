//! Rebuilding a problem with more variables or rows.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParameters;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::construction::Reallocatable;
use crate::ocp::formulation::instance::data::{self, Layout, node_row_count, path_row_count, split_data};
use crate::ocp::formulation::instance::inner_points::{InnerPoints, InnerRow};
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::get;
use crate::qp::{
    Bounds, BoundsMut, Qp, Solution, SolutionStage, SolutionStageMut, StageDims, copy_common, marked_indices,
    part, part_mut, try_reserve,
};
use crate::scalar::Real;
use alloc::vec::Vec;

impl<P: Formulation<T>, T: Real, D: Reallocatable<StageDims>, M: Reallocatable<T> + AsMut<[T]>>
    Ocp<P, T, D, M>
{
    /// Rebuilds the problem with these free parameters and these rows. A new variable is inserted
    /// at `insert_at` among the controls; new rows follow the existing ones.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]; [`OcpError::Unsupported`] for given memory.
    pub(in crate::ocp) fn rebuild(
        &mut self,
        free: FreeParameters,
        mut inner: InnerPoints<T>,
        insert_at: Option<usize>,
    ) -> Result<(), OcpError> {
        let (old, intervals) = (self.layout(), self.intervals());
        let layout = Layout {
            inner_rows: inner.row_count::<P>(),
            has_algebraic_bounds: inner.has_algebraic_bounds::<P>(),
            ..Layout::new(intervals, free.count())
        };
        let mut dims: Vec<StageDims> = Vec::new();
        try_reserve(&mut dims, intervals.saturating_add(1))?;
        dims.resize(intervals, data::stage_dims::<P, T>(layout, false));
        dims.push(data::stage_dims::<P, T>(layout, true));
        let count = dims.len();
        let mut qp =
            Qp::in_memory(D::reallocate(&dims, count)?, M::reallocate(&[], Qp::<T, (), ()>::memory(&dims))?)?;
        let length = Solution::<T, (), ()>::memory(&dims);
        let mut iterate = Solution::in_memory(D::reallocate(&dims, count)?, M::reallocate(&[], length)?)?;
        let mut data = M::reallocate(&[], data::data_len::<P, T>(layout))?;
        let (variables, multipliers) = iterate.variables_and_costates();
        inner.allocate::<P>(layout, [variables.len(), multipliers.len()])?;
        self.copy_bounds_and_couplings(&mut qp, insert_at);
        for (k, stage) in self.iterate.stages().enumerate() {
            if let Some(to) = iterate.stage_mut(k) {
                copy_stage(&stage, to, insert_at);
            }
        }
        let (to, from) =
            (split_data::<P, T>(data.as_mut(), layout), split_data::<P, T>(self.data.as_mut(), old));
        for (to, from) in [
            (to.times, from.times),
            (to.p, from.p),
            (to.references, from.references),
            (to.arrival, from.arrival),
        ] {
            copy_common(to, from);
        }
        let infinity = T::from_f64(f64::INFINITY);
        let [new_rows, old_rows] = [layout, old].map(path_row_count::<P, T>);
        for (to, from, none) in [(to.lower, from.lower, -infinity), (to.upper, from.upper, infinity)] {
            to.fill(none);
            for k in 0..=intervals {
                let rows = if k < intervals { old_rows } else { P::Terminal::ROWS };
                copy_common(part_mut(to, k * new_rows, rows), part(from, k * old_rows, rows));
            }
            if old.inner_rows == 0 {
                for_each_point_row::<P, T>(&inner, |from, row| {
                    for k in 0..intervals {
                        let value = get(to, k * new_rows + from);
                        crate::qp::element::set(to, k * new_rows + row, value);
                    }
                });
            }
        }
        if old.inner_rows == 0 {
            for mut stage in qp.stages_mut().take(intervals) {
                let bounds = stage.g_bounds_mut();
                let penalties = [
                    &mut *bounds.lower_linear,
                    &mut *bounds.lower_quadratic,
                    &mut *bounds.upper_linear,
                    &mut *bounds.upper_quadratic,
                ];
                for list in penalties {
                    for_each_point_row::<P, T>(&inner, |from, row| {
                        let value = get(list, from);
                        crate::qp::element::set(list, row, value);
                    });
                }
            }
        }
        (self.qp, self.iterate, self.data, self.free, self.inner_points) = (qp, iterate, data, free, inner);
        self.algebraic_is_current = false;
        Ok(())
    }

    /// Copies bounds and couplings, with one more variable inserted at `insert_at` among the
    /// controls.
    fn copy_bounds_and_couplings(&self, to: &mut Qp<T, D, M>, insert_at: Option<usize>) {
        let view = self.qp.view();
        let insert_or_end = insert_at.unwrap_or(usize::MAX);
        for (from, mut to) in view.stages().zip(to.stages_mut()) {
            copy_bounds(&from.x_bounds(), to.x_bounds_mut(), usize::MAX);
            copy_bounds(&from.u_bounds(), to.u_bounds_mut(), insert_or_end);
            copy_bounds(&from.g_bounds(), to.g_bounds_mut(), usize::MAX);
        }
        marked_indices(view.periodic()).for_each(|i| {
            to.make_periodic(i);
        });
        marked_indices(view.shared()).map(|j| if j < insert_or_end { j } else { j + 1 }).for_each(|j| {
            to.share(j);
        });
        if let Some(w) = insert_at {
            to.share(w);
        }
    }
}

/// Visits every row of path constraints at points, which follow the rows at the node.
fn for_each_point_row<P: Formulation<T>, T: Real>(
    inner: &InnerPoints<T>,
    mut copy: impl FnMut(usize, usize),
) {
    for index in 0..inner.count() * P::Path::ROWS {
        if let Some(InnerRow::Path { row, .. }) = inner.row::<P>(index) {
            copy(row, node_row_count::<P, T>() + index);
        }
    }
}

/// Copies a list to a list with one more element at `insert_at`.
fn copy_with_insertion<T: Real>(from: &[T], to: &mut [T], insert_at: usize) {
    let (before, after) = from.split_at(insert_at.min(from.len()));
    copy_common(to, before);
    copy_common(to.get_mut(insert_at.saturating_add(1)..).unwrap_or_default(), after);
}

fn copy_bounds<T: Real>(from: &Bounds<'_, T>, to: BoundsMut<'_, T>, insert_at: usize) {
    for (from, to) in [
        (from.lower, to.lower),
        (from.upper, to.upper),
        (from.lower_linear, to.lower_linear),
        (from.lower_quadratic, to.lower_quadratic),
        (from.upper_linear, to.upper_linear),
        (from.upper_quadratic, to.upper_quadratic),
    ] {
        copy_with_insertion(from, to, insert_at);
    }
}

fn copy_stage<T: Real>(from: &SolutionStage<'_, T>, to: SolutionStageMut<'_, T>, insert_at: Option<usize>) {
    for (from, to) in [(from.u, to.u), (from.u_lower, to.u_lower), (from.u_upper, to.u_upper)] {
        copy_with_insertion(from, to, insert_at.unwrap_or(usize::MAX));
    }
    for (from, to) in [
        (from.x, to.x),
        (from.dynamics, to.dynamics),
        (from.x_lower, to.x_lower),
        (from.x_upper, to.x_upper),
        (from.g_lower, to.g_lower),
        (from.g_upper, to.g_upper),
    ] {
        copy_common(to, from);
    }
}
