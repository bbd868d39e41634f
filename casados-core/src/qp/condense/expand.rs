//! Conversion between solutions of the original and the condensed problem.

use super::plan::{CondensedRow, blocks};
use crate::qp::element::{get, set};
use crate::qp::interior::{Columns, add_symmetric_product, add_transposed, subtract, symmetric};
use crate::qp::layout::{StageOffsets, StageOffsetsIter, copy_common, padded_len, part, part_mut};
use crate::qp::problem::QpView;
use crate::qp::solution::SolutionView;
use crate::scalar::{Packed, Real, Registers};

/// Copies variables and multipliers between a solution and that of the condensed problem.
pub fn copy<T: Real>(
    (qp, block, rows): (QpView<'_, T>, usize, &[CondensedRow]),
    full: SolutionView<'_, T>,
    condensed: SolutionView<'_, T>,
    expand: bool,
) {
    let mut rows = rows;
    for (block, to) in blocks(qp.dims.len(), block).zip(StageOffsetsIter::<T>::new(condensed.dims)) {
        let (here, others) = rows.split_at_checked(to.ng).unwrap_or_default();
        rows = others;
        let mut controls = to.nx + to.nu;
        for place in StageOffsetsIter::<T>::new(qp.dims).skip(block.start).take(block.len()) {
            controls -= place.nu.min(controls);
            let states = if place.stage == block.start { place.nx } else { 0 };
            let pairs =
                (0..states).map(|i| (i, i)).chain((0..place.nu).map(|i| (place.nx + i, controls + i)));
            for (a, b) in pairs {
                copy_either_way(full.v, place.v + a, condensed.v, to.v + b, expand);
                copy_either_way(full.lower, place.row + a, condensed.lower, to.row + b, expand);
                copy_either_way(full.upper, place.row + a, condensed.upper, to.row + b, expand);
            }
            for (index, origin) in here.iter().enumerate().filter(|(_, origin)| origin.stage == place.stage) {
                let (a, b) = (place.row + origin.index, to.row + to.ld + index);
                copy_either_way(full.lower, a, condensed.lower, b, expand);
                copy_either_way(full.upper, a, condensed.upper, b, expand);
            }
            if place.stage + 1 == block.end {
                for i in 0..place.next {
                    copy_either_way(
                        full.dynamics,
                        place.dynamics + i,
                        condensed.dynamics,
                        to.dynamics + i,
                        expand,
                    );
                }
            }
        }
    }
}

fn copy_either_way<T: Real>(full: &mut [T], a: usize, condensed: &mut [T], b: usize, expand: bool) {
    if expand {
        set(full, a, get(condensed, b));
    } else {
        set(condensed, b, get(full, a));
    }
}

/// Computes the eliminated states and multipliers.
pub struct Expand<'a, 's, T> {
    pub qp: QpView<'a, T>,
    pub block: usize,
    pub solution: SolutionView<'s, T>,
    /// Workspace for a vector over next states and general constraints, and for a gradient.
    pub minus: &'a mut [T],
    pub g: &'a mut [T],
}

impl<T: Real> Registers<T> for Expand<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { qp, block, solution: SolutionView { v, dynamics, lower, upper, .. }, minus, g } = self;
        let inside = |stage: usize| !stage.is_multiple_of(block) && stage + 1 < qp.dims.len();
        for place in StageOffsetsIter::<T>::new(qp.dims).filter(|place| inside(place.stage + 1)) {
            let StageOffsets { n, ld, next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let (here, coming) = v.split_at_mut_checked(place.v + ld).unwrap_or_default();
            let coming = part_mut(coming, 0, next);
            copy_common(coming, part(data, place.offset(), next));
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            add_transposed::<T, E>(coming, matrix, part(here, place.v, ld), n, next);
        }
        for place in StageOffsetsIter::<T>::new(qp.dims).rev().filter(|place| inside(place.stage)) {
            let StageOffsets { nx, n, ng, ld, next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let (lower, upper) = (part(lower, place.row, place.rows), part(upper, place.row, place.rows));
            let g = part_mut(g, 0, ld);
            for ((g, &linear), (&lower, &upper)) in
                g.iter_mut().zip(part(data, place.gradient(), ld)).zip(lower.iter().zip(upper))
            {
                *g = linear + upper - lower;
            }
            let hessian = part(data, place.matrix(), place.hessian());
            symmetric::<T, E>(g, hessian, ld, part(v, place.v, ld), n);
            for (minus, &pi) in minus.iter_mut().zip(part(dynamics, place.dynamics, next)) {
                *minus = -pi;
            }
            let forces = part(lower, ld, ng).iter().zip(part(upper, ld, ng));
            for (minus, (&lower, &upper)) in part_mut(minus, next, ng).iter_mut().zip(forces) {
                *minus = lower - upper;
            }
            subtract::<T, E>(g, matrix, minus, n, next + ng);
            let before = place.dynamics.saturating_sub(padded_len::<T>(nx));
            copy_common(part_mut(dynamics, before, nx), part(g, 0, nx));
        }
    }
}

/// Returns `Σ ½ vᵀ H v + hᵀ v`; `product` is the workspace for a vector over the variables of a
/// stage.
pub fn stage_cost_and_product<T: Real>(qp: QpView<'_, T>, v: &[T], product: &mut [T]) -> f64 {
    let mut sum = 0.0;
    for place in StageOffsetsIter::<T>::new(qp.dims) {
        let data = part(qp.data, place.data, place.data_len());
        let (v, product) = (part(v, place.v, place.ld), part_mut(product, 0, place.ld));
        product.fill(T::ZERO);
        add_symmetric_product(product, part(data, place.matrix(), place.hessian()), place.ld, v, place.n);
        for ((&v, &product), &linear) in v.iter().zip(&*product).zip(part(data, place.gradient(), place.n)) {
            sum += v.to_f64() * (0.5 * product.to_f64() + linear.to_f64());
        }
    }
    sum
}
