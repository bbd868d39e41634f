//! What goes from a phase to the whole and back: points with their multipliers, bounds, and QPs.
//!
//! ```text
//! stage of a phase   (x | w, u)        of the whole   (x, w | u)        w₊ = w
//! ```
//!
//! The order of variables is the same: what are controls `w` of a phase, shared by its stages, are
//! states of the whole.

use super::phase::Size;
use crate::qp::element::set;
use crate::qp::{
    Arrays, Bounds, HeapSolution, SolutionStage, SolutionStageMut, Stage, StageMut, assign, part, part_mut,
};
use crate::scalar::Real;

/// A point of the whole, at the stages of a phase, as one of the phase. What is decided at its end
/// goes to `decided`; `before` are the multipliers of what was decided at its start.
pub(super) fn load<'s, T: Real>(
    size: Size,
    from: &mut impl Iterator<Item = SolutionStage<'s, T>>,
    to: &mut HeapSolution<T>,
    before: Option<SolutionStage<'s, T>>,
) -> Option<SolutionStage<'s, T>> {
    let (mut last, mut begins) = (None, before);
    to.each_stage_mut(|to| {
        let Some(from) = from.next() else { return };
        load_stage(size, &from, to, begins.take());
        last = Some(from);
    });
    last
}

fn load_stage<T: Real>(
    Size { nx, free, linear, .. }: Size,
    from: &SolutionStage<'_, T>,
    to: SolutionStageMut<'_, T>,
    before: Option<SolutionStage<'_, T>>,
) {
    for (x, u, to_x, to_u) in [
        (from.x, from.u, to.x, &mut *to.u),
        (from.x_lower, from.u_lower, to.x_lower, &mut *to.u_lower),
        (from.x_upper, from.u_upper, to.x_upper, &mut *to.u_upper),
    ] {
        let (x, w) = x.split_at_checked(nx).unwrap_or_default();
        let (to_w, to_u) = to_u.split_at_mut_checked(free).unwrap_or_default();
        assign(to_x, x);
        assign(to_w, w);
        assign(to_u, u);
    }
    assign(to.dynamics, from.dynamics);
    assign(to.g_lower, from.g_lower);
    assign(to.g_upper, from.g_upper);
    // The ranges of parameters are bounds of where they are decided.
    if let Some(before) = before {
        assign(to.u_lower, part(before.u_lower, linear, free));
        assign(to.u_upper, part(before.u_upper, linear, free));
    }
}

/// A stage of a phase as one of the whole; with the first stage of the next phase, where it ends.
pub(super) fn store<T: Real>(
    Size { free, .. }: Size,
    from: &SolutionStage<'_, T>,
    to: SolutionStageMut<'_, T>,
    next: Option<(Size, SolutionStage<'_, T>)>,
) {
    for (x, u, to_x, to_u) in [
        (from.x, from.u, to.x, &mut *to.u),
        (from.x_lower, from.u_lower, to.x_lower, &mut *to.u_lower),
        (from.x_upper, from.u_upper, to.x_upper, &mut *to.u_upper),
    ] {
        let (w, u) = u.split_at_checked(free).unwrap_or_default();
        let (first, second) = to_x.split_at_mut_checked(x.len()).unwrap_or_default();
        assign(first, x);
        assign(second, w);
        assign(to_u, u);
    }
    assign(to.dynamics, from.dynamics);
    assign(to.g_lower, from.g_lower);
    assign(to.g_upper, from.g_upper);
    if let Some((Size { own, linear, free, .. }, next)) = next {
        let (of_linear, of_free) = to.u.split_at_mut_checked(linear).unwrap_or_default();
        assign(of_linear, part(next.x, own, linear));
        assign(of_free, part(next.u, 0, free));
        for (to, from) in [(to.u_lower, next.u_lower), (to.u_upper, next.u_upper)] {
            assign(to.get_mut(linear..).unwrap_or_default(), part(from, 0, free));
        }
    }
}

/// Six vectors of bounds and penalties.
fn lists<'a, T>(bounds: &Bounds<'a, T>) -> [&'a [T]; 6] {
    let Bounds { lower, upper, lower_linear, lower_quadratic, upper_linear, upper_quadratic } = *bounds;
    [lower, upper, lower_linear, lower_quadratic, upper_linear, upper_quadratic]
}

/// Bounds of a stage. Where a phase begins behind another one, those of its parameters are bounds
/// of where they are decided, and integrals have none: the link says that they are zero.
pub(super) fn bounds<T: Real>(
    Size { nx, free, own, linear, .. }: Size,
    from: &Stage<'_, T>,
    to: &mut StageMut<'_, T>,
    begins: bool,
) {
    let (x, u, g) = (from.x_bounds(), from.u_bounds(), from.g_bounds());
    let all = [lists(&x), lists(&u), lists(&g)];
    let width = to.dims().nu;
    let bounds = to.x_bounds_mut();
    let [of_x, of_u, of_g] = all;
    for (list, (x, u)) in [
        bounds.lower,
        bounds.upper,
        bounds.lower_linear,
        bounds.lower_quadratic,
        bounds.upper_linear,
        bounds.upper_quadratic,
    ]
    .into_iter()
    .zip(of_x.into_iter().zip(of_u))
    {
        let (first, second) = list.split_at_mut_checked(nx).unwrap_or_default();
        assign(part_mut(first, 0, if begins { own + linear } else { nx }), x);
        if !begins {
            assign(second, part(u, 0, free));
        }
    }
    let controls = to.u_bounds_mut();
    copy(of_u.map(|list| list.get(free..).unwrap_or_default()), controls, width);
    copy(of_g, to.g_bounds_mut(), usize::MAX);
}

/// The ranges of the parameters of a phase, as bounds of what is decided at the stage before.
pub(super) fn ranges<T: Real>(
    Size { free, linear, .. }: Size,
    first: &Stage<'_, T>,
    to: &mut StageMut<'_, T>,
) {
    let (bounds, mut to) = (first.u_bounds(), to.u_bounds_mut());
    for w in 0..free {
        let [lower, upper, ..] = lists(&bounds).map(|list| list.get(w).copied().unwrap_or(T::ZERO));
        to.set(linear + w, lower, upper);
    }
}

fn copy<T: Real>(from: [&[T]; 6], to: crate::qp::BoundsMut<'_, T>, most: usize) {
    for (to, from) in [
        to.lower,
        to.upper,
        to.lower_linear,
        to.lower_quadratic,
        to.upper_linear,
        to.upper_quadratic,
    ]
    .into_iter()
    .zip(from)
    {
        assign(to, part(from, 0, from.len().min(most)));
    }
}

/// The QP at a stage, without what leads to another phase.
pub(super) fn qp<T: Real>(Size { nx, free, .. }: Size, from: &Stage<'_, T>, to: &mut Arrays<'_, T>) {
    let (view, bounds) = (from.arrays(), from.g_bounds());
    let Arrays { ld, next, rows, matrix, hessian, gradient, offset, limits, .. } = to;
    let (ld, n) = (*ld, view.n);
    let from_column = |list, j: usize| part(list, j * view.ld, n);
    let copy = |to: &mut [T], j: usize, from: &[T]| {
        let column = part_mut(to, j * ld, ld);
        let (own, behind) = column.split_at_mut_checked(n).unwrap_or_default();
        assign(own, from);
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
        assign(own, view.offset);
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
    assign(gradient, part(view.gradient, 0, n));
    let (lower, rest) = limits.split_at_mut_checked(*rows).unwrap_or_default();
    assign(part_mut(lower, ld, bounds.lower.len()), bounds.lower);
    assign(part_mut(rest, ld, bounds.upper.len()), bounds.upper);
}
