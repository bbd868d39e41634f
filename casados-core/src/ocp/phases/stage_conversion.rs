//! Conversion between phases and the joined problem: points with their multipliers, bounds, and
//! QPs.
//!
//! ```text
//! stage of a phase   (x | w, u)        of the whole   (x, w | u)        w₊ = w
//! ```
//!
//! The order of variables is the same: the controls `w` of a phase, shared by its stages, are
//! states of the joined problem.

use super::phase::{PhaseSize, PhaseStart};
use crate::qp::element::set;
use crate::qp::{
    Arrays, Bounds, BoundsMut, HeapSolution, SolutionStage, SolutionStageMut, Stage, StageDims, StageMut,
    copy_common, padded_len, part, part_mut,
};
use crate::scalar::Real;

/// Reads a point of the joined problem at the stages of a phase. The start of the phase is decided
/// at `previous_stage`; returns the last stage of the phase.
pub(super) fn load_phase<'s, T: Real>(
    phase_start: &PhaseStart,
    from: &mut impl Iterator<Item = SolutionStage<'s, T>>,
    to: &mut HeapSolution<T>,
    previous_stage: Option<SolutionStage<'s, T>>,
) -> Option<SolutionStage<'s, T>> {
    let (mut last, mut start_stage) = (None, previous_stage);
    to.each_stage_mut(|to| {
        let Some(from) = from.next() else { return };
        load_phase_stage(phase_start, &from, to, start_stage.take());
        last = Some(from);
    });
    last
}

fn load_phase_stage<T: Real>(
    phase_start: &PhaseStart,
    from: &SolutionStage<'_, T>,
    to: SolutionStageMut<'_, T>,
    previous_stage: Option<SolutionStage<'_, T>>,
) {
    let PhaseSize { nx, free, .. } = phase_start.size;
    for (x, u, to_x, to_u) in [
        (from.x, from.u, to.x, &mut *to.u),
        (from.x_lower, from.u_lower, to.x_lower, &mut *to.u_lower),
        (from.x_upper, from.u_upper, to.x_upper, &mut *to.u_upper),
    ] {
        let (x, w) = x.split_at_checked(nx).unwrap_or_default();
        let (to_w, to_u) = to_u.split_at_mut_checked(free).unwrap_or_default();
        copy_common(to_x, x);
        copy_common(to_w, w);
        copy_common(to_u, u);
    }
    copy_common(to.dynamics, from.dynamics);
    copy_common(to.g_lower, from.g_lower);
    copy_common(to.g_upper, from.g_upper);
    // The multipliers of decided variables are at the stage before.
    if let Some(before) = previous_stage {
        for (from, x, u) in
            [(before.u_lower, to.x_lower, to.u_lower), (before.u_upper, to.x_upper, to.u_upper)]
        {
            scatter_start_variables(phase_start, from, x, u);
        }
    }
}

/// Writes a stage of a phase to the joined problem, and to the last stage the start of the next
/// phase.
pub(super) fn store_phase_stage<T: Real>(
    PhaseSize { free, .. }: PhaseSize,
    from: &SolutionStage<'_, T>,
    to: SolutionStageMut<'_, T>,
    next: Option<(&PhaseStart, SolutionStage<'_, T>)>,
) {
    for (x, u, to_x, to_u) in [
        (from.x, from.u, to.x, &mut *to.u),
        (from.x_lower, from.u_lower, to.x_lower, &mut *to.u_lower),
        (from.x_upper, from.u_upper, to.x_upper, &mut *to.u_upper),
    ] {
        let (w, u) = u.split_at_checked(free).unwrap_or_default();
        let (first, second) = to_x.split_at_mut_checked(x.len()).unwrap_or_default();
        copy_common(first, x);
        copy_common(second, w);
        copy_common(to_u, u);
    }
    copy_common(to.dynamics, from.dynamics);
    copy_common(to.g_lower, from.g_lower);
    copy_common(to.g_upper, from.g_upper);
    if let Some((phase_start, next)) = next {
        write_start_variables(phase_start, &next, to.u, to.u_lower, to.u_upper);
    }
}

/// Writes the variables that are decided at the start of a phase, from its first stage, with the
/// multipliers of their bounds.
pub(super) fn write_start_variables<T: Real>(
    phase_start: &PhaseStart,
    first: &SolutionStage<'_, T>,
    to: &mut [T],
    lower: &mut [T],
    upper: &mut [T],
) {
    for (to, x, u) in
        [(to, first.x, first.u), (lower, first.x_lower, first.u_lower), (upper, first.x_upper, first.u_upper)]
    {
        gather_start_variables(phase_start, x, u, to);
    }
}

/// Gathers the elements that are decided at the start of a phase, from a vector over its first
/// states and controls: free states, then free parameters.
fn gather_start_variables<T: Real>(phase_start: &PhaseStart, x: &[T], u: &[T], to: &mut [T]) {
    let size = phase_start.size;
    let (states, parameters) = to.split_at_mut_checked(size.free_start_states().len()).unwrap_or_default();
    copy_common(states, x.get(size.free_start_states()).unwrap_or_default());
    for (to, w) in parameters.iter_mut().zip(phase_start.parameters()) {
        copy_common(core::slice::from_mut(to), part(u, w, 1));
    }
}

/// Scatters the decision variables at the start of a phase: the inverse of
/// [`gather_start_variables`].
fn scatter_start_variables<T: Real>(phase_start: &PhaseStart, decided: &[T], x: &mut [T], u: &mut [T]) {
    let size = phase_start.size;
    let (states, parameters) = decided.split_at_checked(size.free_start_states().len()).unwrap_or_default();
    copy_common(x.get_mut(size.free_start_states()).unwrap_or_default(), states);
    for (&from, w) in parameters.iter().zip(phase_start.parameters()) {
        set(u, w, from);
    }
}

/// Returns the six vectors of bounds and penalties.
fn bound_vectors<'a, T>(bounds: &Bounds<'a, T>) -> [&'a [T]; 6] {
    let Bounds { lower, upper, lower_linear, lower_quadratic, upper_linear, upper_quadratic } = *bounds;
    [lower, upper, lower_linear, lower_quadratic, upper_linear, upper_quadratic]
}

/// Returns the six vectors of bounds and penalties.
fn bound_vectors_mut<T>(bounds: BoundsMut<'_, T>) -> [&mut [T]; 6] {
    let BoundsMut { lower, upper, lower_linear, lower_quadratic, upper_linear, upper_quadratic } = bounds;
    [lower, upper, lower_linear, lower_quadratic, upper_linear, upper_quadratic]
}

/// The position of a stage among the phases, for its bounds.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum StagePosition {
    /// The first stage of all phases: its states are fixed or decided.
    FirstStage,
    /// The first stage of another phase.
    PhaseStart,
    InteriorStage,
}

/// Copies the bounds of a stage, except bounds of variables decided at the stage before, and of
/// integrals at the start of a phase.
pub(super) fn copy_stage_bounds<T: Real>(
    phase_start: &PhaseStart,
    from: &Stage<'_, T>,
    to: &mut StageMut<'_, T>,
    position: StagePosition,
) {
    let PhaseSize { nx, free, model_states: own, .. } = phase_start.size;
    let control_bounds = bound_vectors(&from.u_bounds());
    let count = match position {
        StagePosition::FirstStage => 0,
        StagePosition::PhaseStart => own,
        StagePosition::InteriorStage => nx,
    };
    for (to, (x, u)) in bound_vectors_mut(to.x_bounds_mut())
        .into_iter()
        .zip(bound_vectors(&from.x_bounds()).into_iter().zip(control_bounds))
    {
        copy_common(part_mut(to, 0, count), x);
        for (w, shared) in phase_start.shared.iter().enumerate() {
            if position == StagePosition::InteriorStage
                || position == StagePosition::PhaseStart && shared.is_some()
            {
                copy_common(part_mut(to, nx + w, 1), part(u, w, 1));
            }
        }
    }
    for (to, from) in bound_vectors_mut(to.u_bounds_mut()).into_iter().zip(control_bounds) {
        copy_common(to, from.get(free..).unwrap_or_default());
    }
    for (to, from) in bound_vectors_mut(to.g_bounds_mut()).into_iter().zip(bound_vectors(&from.g_bounds())) {
        copy_common(to, from);
    }
}

/// Writes the bounds of the variables that are decided at the start of a phase, from its first
/// stage.
pub(super) fn write_start_variable_bounds<T: Real>(
    phase_start: &PhaseStart,
    first: &Stage<'_, T>,
    to: &mut StageMut<'_, T>,
) {
    let first_bounds = bound_vectors(&first.x_bounds()).into_iter().zip(bound_vectors(&first.u_bounds()));
    for (to, (x, u)) in bound_vectors_mut(to.u_bounds_mut()).into_iter().zip(first_bounds) {
        gather_start_variables(phase_start, x, u, to);
    }
}

/// Writes the start of a phase: the decision variables `decided`, and the parameters shared with
/// the phase before from `before`; other elements are zero unless given.
pub(super) fn write_start_state<T: Real>(
    phase_start: &PhaseStart,
    decided: &[T],
    before: &[T],
    start: &mut [T],
) {
    let (x, w) = start.split_at_mut_checked(phase_start.size.nx).unwrap_or_default();
    x.get_mut(phase_start.size.given_states..).unwrap_or_default().fill(T::ZERO);
    scatter_start_variables(phase_start, decided, x, w);
    for (w, shared) in w.iter_mut().zip(&phase_start.shared) {
        if let Some(shared) = *shared {
            copy_common(core::slice::from_mut(w), part(before, shared, 1));
        }
    }
}

/// Writes the columns of [`write_start_state`] to the QP; the decision variables begin at `first`,
/// the parameters of the phase before at `before`.
pub(super) fn write_start_columns<T: Real>(
    phase_start: &PhaseStart,
    [before, first]: [usize; 2],
    columns: &mut [T],
    ld: usize,
) {
    let nx = phase_start.size.nx;
    for (j, state) in
        phase_start.size.free_start_states().chain(phase_start.parameters().map(|w| nx + w)).enumerate()
    {
        set(columns, state * ld + first + j, T::ONE);
    }
    for (w, shared) in phase_start.shared.iter().enumerate() {
        if let Some(shared) = *shared {
            set(columns, (nx + w) * ld + before + shared, T::ONE);
        }
    }
}

/// Copies the QP of a stage, without the link to the next phase.
pub(super) fn copy_stage_qp<T: Real>(
    PhaseSize { nx, free, .. }: PhaseSize,
    from: &Stage<'_, T>,
    to: &mut Arrays<'_, T>,
) {
    let (view, bounds) = (from.arrays(), from.g_bounds());
    let Arrays { ld, next, rows, matrix, hessian, gradient, offset, limits, .. } = to;
    let (ld, n) = (*ld, view.n);
    let from_column = |list, j: usize| part(list, j * view.ld, n);
    let copy = |to: &mut [T], j: usize, from: &[T]| {
        let column = part_mut(to, j * ld, ld);
        let (own, behind) = column.split_at_mut_checked(n).unwrap_or_default();
        copy_common(own, from);
        behind.fill(T::ZERO);
    };
    for j in 0..view.next {
        copy(matrix, j, from_column(view.matrix, j));
    }
    if view.next > 0 {
        for w in nx..nx + free {
            part_mut(matrix, w * ld, ld).fill(T::ZERO);
            set(matrix, w * ld + w, T::ONE);
        }
        let (own, behind) = offset.split_at_mut_checked(nx).unwrap_or_default();
        copy_common(own, view.offset);
        behind.fill(T::ZERO);
    }
    for row in 0..bounds.lower.len() {
        copy(matrix, *next + row, from_column(view.matrix, view.next + row));
    }
    hessian.fill(T::ZERO);
    gradient.fill(T::ZERO);
    for j in 0..n {
        copy(hessian, j, from_column(view.hessian, j));
    }
    copy_common(gradient, part(view.gradient, 0, n));
    let (lower, rest) = limits.split_at_mut_checked(*rows).unwrap_or_default();
    copy_common(part_mut(lower, ld, bounds.lower.len()), bounds.lower);
    copy_common(part_mut(rest, ld, bounds.upper.len()), bounds.upper);
}

/// Returns the length of two matrices and a vector over the variables of a stage, or of four
/// vectors.
pub(super) fn scratch_len<T>(dims: &[StageDims]) -> usize {
    let of_stage = |stage: &StageDims| {
        let n = stage.nx + stage.nu;
        (2 * n + 4) * padded_len::<T>(n)
    };
    dims.iter().map(of_stage).max().unwrap_or(0)
}
