//! The data of a problem on a horizon besides its QP and its iterate, in one block of memory.

use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::node_evaluation::write_variables;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::element::get;
use crate::qp::{SolutionStage, StageDims, padded_len, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;

/// The parts of the block.
pub(in crate::ocp) struct Data<'a, T> {
    /// Times of the nodes.
    pub times: &'a mut [T],
    /// Parameters of every node.
    pub p: &'a mut [T],
    /// References of every stage, followed by that of the last one.
    pub references: &'a mut [T],
    /// Lower bounds of the constraints of every stage, followed by those of the last one.
    pub lower: &'a mut [T],
    /// Upper bounds of the constraints, in the same order.
    pub upper: &'a mut [T],
    /// Algebraic states of every stage but the last, and `∂z/∂(x, u)`, row after row.
    pub algebraic: &'a mut [T],
    /// Weights of the second derivatives of algebraic states, of every stage but the last; empty if
    /// no function depends on algebraic states.
    pub weights: &'a mut [T],
    /// Workspace for derivatives over `(x, u, z)` of a stage: a gradient, a Hessian and the
    /// constraints; empty without `z`.
    pub extended: &'a mut [T],
    /// Workspace for two matrices and a vector over `(x, u)`.
    pub scratch: &'a mut [T],
    /// Mean and weights of the arrival cost.
    pub arrival: &'a mut [T],
}

/// The dimensions of a problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub intervals: usize,
    /// The number of copies of the first state and [free
    /// parameters](super::super::free_parameters).
    pub free_count: usize,
    /// Rows for [points inside](super::inner_points) intervals, of every stage but the last.
    pub inner_rows: usize,
    /// Whether algebraic states have bounds at nodes.
    pub has_algebraic_bounds: bool,
}

impl Layout {
    /// The dimensions of a problem without points inside intervals.
    pub const fn new(intervals: usize, free: usize) -> Self {
        Self { intervals, free_count: free, inner_rows: 0, has_algebraic_bounds: false }
    }
}

/// Returns `NX + NU` and the number of free parameters, which are between states and controls.
pub(in crate::ocp) const fn stage_variable_count<S: Shape>(free: usize) -> usize {
    S::NX + free + S::NU
}

/// Returns whether a cost or a constraint depends on algebraic states.
pub(in crate::ocp) const fn depends_on_algebraic<P: Formulation<T>, T: Real>() -> bool {
    P::StageCost::ALGEBRAIC || P::Path::ALGEBRAIC
}

/// Returns the number of rows of the path constraints at nodes, and of the copies of the first
/// state.
pub(in crate::ocp) const fn node_row_count<P: Formulation<T>, T: Real>() -> usize {
    P::Path::ROWS + P::Terminal::INITIAL_STATE_COPIES
}

/// Returns the number of all rows of a stage but the last.
pub(in crate::ocp) const fn path_row_count<P: Formulation<T>, T: Real>(layout: Layout) -> usize {
    node_row_count::<P, T>() + layout.inner_rows
}

const fn data_lens<P: Formulation<T>, T: Real>(layout: Layout) -> [usize; 10] {
    let Layout { intervals, free_count: free, has_algebraic_bounds: bounds_algebraic, .. } = layout;
    let references = intervals * P::StageCost::REFERENCES + P::TerminalCost::REFERENCES;
    let path = path_row_count::<P, T>(layout);
    let rows = intervals * path + P::Terminal::ROWS;
    let n = stage_variable_count::<P::Shape>(free);
    let node_row_total = node_row_count::<P, T>();
    let constraints = if node_row_total > P::Terminal::ROWS { node_row_total } else { P::Terminal::ROWS };
    [
        intervals + 1,
        (intervals + 1) * P::Shape::NP,
        references,
        rows,
        rows,
        intervals * algebraic_len::<P::Shape>(free),
        if depends_on_algebraic::<P, T>() || bounds_algebraic { intervals * P::Shape::NZ } else { 0 },
        extended_len::<P::Shape>(free, constraints),
        scratch_len::<T>(n, P::Shape::NZ),
        P::Shape::NX * (P::Shape::NX + 1),
    ]
}

/// Returns the length of two matrices and a vector over `(x, w, u)`, or of a gradient over
/// `(x, w, u, z)`.
const fn scratch_len<T>(n: usize, nz: usize) -> usize {
    let (matrices, gradient) = ((2 * n + 1) * padded_len::<T>(n), n + nz);
    if matrices < gradient { gradient } else { matrices }
}

/// Returns the length of the block.
pub(in crate::ocp) const fn data_len<P: Formulation<T>, T: Real>(layout: Layout) -> usize {
    let mut rest: &[usize] = &data_lens::<P, T>(layout);
    let mut sum = 0_usize;
    while let Some((&first, others)) = rest.split_first() {
        sum = sum.saturating_add(first);
        rest = others;
    }
    sum
}

/// Splits the block into its parts.
pub(in crate::ocp) fn split_data<P: Formulation<T>, T: Real>(
    memory: &mut [T],
    layout: Layout,
) -> Data<'_, T> {
    let mut rest = memory;
    let [times, p, references, lower, upper, algebraic, weights, extended, scratch, arrival] =
        data_lens::<P, T>(layout).map(|length| {
            let (part, behind) = core::mem::take(&mut rest).split_at_mut_checked(length).unwrap_or_default();
            rest = behind;
            part
        });
    Data { times, p, references, lower, upper, algebraic, weights, extended, scratch, arrival }
}

/// Returns the lower and the upper bounds of all constraints.
pub(in crate::ocp) fn constraint_bounds<P: Formulation<T>, T: Real>(
    memory: &[T],
    layout: Layout,
) -> [&[T]; 2] {
    let [times, p, references, lower, upper, ..] = data_lens::<P, T>(layout);
    let begin = times + p + references;
    [part(memory, begin, lower), part(memory, begin + lower, upper)]
}

/// Returns the weights of the arrival cost.
pub(in crate::ocp) fn arrival_weights<P: Formulation<T>, T: Real>(memory: &[T], layout: Layout) -> &[T] {
    let nx = P::Shape::NX;
    part(memory, data_len::<P, T>(layout) - nx * nx, nx * nx)
}

/// The data of a node.
pub(in crate::ocp) struct Node<'a, T> {
    pub time: T,
    pub p: &'a [T],
    /// The reference of its cost.
    pub reference: &'a [T],
    /// The factor of its cost: the length of the interval that starts here for running costs,
    /// otherwise one.
    pub factor: T,
}

impl<'a, T: Real> Node<'a, T> {
    /// The data of a node, from `times`, `p` and `references` of [`Data`].
    #[inline(always)]
    pub fn new<P: Formulation<T>>(
        k: usize,
        intervals: usize,
        running: bool,
        [times, p, references]: [&'a [T]; 3],
    ) -> Self {
        let (np, time, stage_references) = (P::Shape::NP, get(times, k), P::StageCost::REFERENCES);
        let is_stage = k < intervals;
        let length = if is_stage { stage_references } else { P::TerminalCost::REFERENCES };
        Self {
            time,
            p: part(p, k * np, np),
            reference: part(references, k * stage_references, length),
            factor: if running && is_stage { get(times, k + 1) - time } else { T::ONE },
        }
    }

    /// Writes the variables of the node, with the algebraic states `z`.
    #[inline(always)]
    pub fn write_variables<S: Shape>(
        &self,
        to: &mut S::ArrayV<T>,
        at: &SolutionStage<'_, T>,
        z: &[T],
        free: FreeParametersView<'_>,
    ) {
        let (w, u) = at.u.split_at_checked(free.count()).unwrap_or_default();
        write_variables::<S, T>(to, [at.x, z, u, self.p], self.time);
        if free.count() > 0 {
            free.write_parameters(part_mut(to.as_mut(), 2 * S::NX + S::NZ + S::NU, S::NP), w);
        }
    }
}

/// Returns the dimensions of a stage.
pub(in crate::ocp) const fn stage_dims<P: Formulation<T>, T: Real>(layout: Layout, last: bool) -> StageDims {
    if last {
        StageDims::new(P::Shape::NX, layout.free_count, P::Terminal::ROWS)
    } else {
        StageDims::new(P::Shape::NX, layout.free_count + P::Shape::NU, path_row_count::<P, T>(layout))
    }
}

/// Returns [`stage_variable_count`] and `NZ`.
pub(in crate::ocp) const fn variable_and_algebraic_counts<S: Shape>(free: usize) -> [usize; 2] {
    [stage_variable_count::<S>(free), S::NZ]
}

/// Returns the number of elements per stage of `z` and `∂z/∂(x, w, u)`, row after row.
pub(in crate::ocp) const fn algebraic_len<S: Shape>(free: usize) -> usize {
    let [n, nz] = variable_and_algebraic_counts::<S>(free);
    nz * (1 + n)
}

/// Returns the length of `algebraic::ExtendedDerivatives` for stages with `rows` constraints.
pub(in crate::ocp) const fn extended_len<S: Shape>(free: usize, rows: usize) -> usize {
    let [n, nz] = variable_and_algebraic_counts::<S>(free);
    if nz > 0 { (n + nz) * (1 + n + nz + rows) } else { 0 }
}
