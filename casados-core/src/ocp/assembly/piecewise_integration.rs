//! Integration of intervals in pieces, from point to point, with derivatives.
//!
//! ```text
//! x_{j+1} = φ_j(x_j, u, p)        D_{j+1} = ∂φ_j/∂x D_j + ∂φ_j/∂(u, p)
//! ```
//!
//! Second derivatives are computed backward over the pieces. With the multipliers `λ_j` of the end
//! of a piece, and the contributions of constraints at its start, `f_j = ∂(μᵀg_j)/∂x` and
//! `ν_j = ∂(μᵀg_j)/∂z`:
//!
//! ```text
//! H += M_jᵀ ∇²(λ_{j+1}ᵀφ_j + ν_jᵀζ_j) M_j        λ_j = (∂φ_j/∂x)ᵀ λ_{j+1} + (∂ζ_j/∂x)ᵀ ν_j + f_j
//! ```
//!
//! `M_j` is `D_j` stacked on the identity of `(u, p)`.

use crate::linalg::dot;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::dynamics::{IntegralTerms, IntervalResult, Nodes, Sink};
use crate::ocp::formulation::instance::inner_points::piece_memory::{PieceMemory, PieceSizes};
use crate::qp::element::get;
use crate::qp::{copy_common, part, part_mut};
use crate::scalar::Real;

/// Integrates one piece of all intervals.
pub(in crate::ocp) type PieceIntegrator<'a, T> =
    &'a mut dyn FnMut(&Nodes<'_, T>, Sink<'_, T>) -> Result<(), OcpError>;

/// The pieces of all intervals.
pub(in crate::ocp) struct PiecewiseIntegration<'a, T> {
    pub sizes: PieceSizes,
    /// Zero, the points, and one.
    pub fractions: &'a [T],
    pub memory: &'a mut PieceMemory<T>,
}

impl<T: Real> PiecewiseIntegration<'_, T> {
    /// Integrates all pieces at these nodes, with or without first derivatives.
    ///
    /// # Errors
    /// The errors of the integrator.
    pub fn forward(
        &mut self,
        nodes: &Nodes<'_, T>,
        derivatives: bool,
        call: PieceIntegrator<'_, T>,
    ) -> Result<(), OcpError> {
        let Self { sizes, fractions: parts, memory } = self;
        let (sizes, [nx, nu, _, nz]) = (*sizes, sizes.dims);
        let PieceMemory { solutions: found, v, cost_and_hessian_sums: totals, product, .. } = &mut **memory;
        copy_common(v, nodes.v);
        totals.fill(T::ZERO);
        initialise_nodes(sizes, found, nodes);
        for (j, ends) in parts.windows(2).enumerate() {
            let piece = Some([get(ends, 0), get(ends, 1)]);
            let here = Nodes { v: if j == 0 { nodes.v } else { v.as_slice() }, piece, ..*nodes };
            call(&here, &mut |k, step| {
                let point_len = sizes.point_len();
                let start_and_end =
                    part_mut(found, (k * sizes.point_count_with_ends() + j) * point_len, 2 * point_len);
                let (start, end) = start_and_end.split_at_mut_checked(point_len).unwrap_or_default();
                copy_common(end, step.x);
                copy_common(part_mut(start, nx, nz), step.z);
                let total = part_mut(totals, k * sizes.sums_len(), sizes.sums_len());
                let IntegralTerms { value, x, u, p, hessian: [xx, xu, uu], hessian_p: [xp, up, pp] } =
                    step.cost;
                if let Some(sum) = total.first_mut() {
                    *sum = *sum + value;
                }
                if !derivatives {
                    return;
                }
                let (start, slopes_z) =
                    start.split_at_mut_checked(nx + nz + nx * sizes.inputs()).unwrap_or_default();
                let d = start.get(nx + nz..).unwrap_or_default();
                let end_columns = part_mut(end, nx + nz, nx * sizes.inputs());
                chain_square(nx, d, [step.dx, step.du, step.dp], end_columns);
                let [dx, du, dp] = step.dz;
                chain_rule([nz, nx], d, [dx, du, dp], slopes_z);
                for (c, (slope, column)) in
                    part_mut(total, 1, sizes.inputs()).iter_mut().zip(d.chunks_exact(nx.max(1))).enumerate()
                {
                    let through_states = if x.is_empty() { T::ZERO } else { dot(x, column) };
                    let direct = c.checked_sub(nx).map_or(T::ZERO, |c| match c.checked_sub(nu) {
                        None => get(u, c),
                        Some(c) => get(p, c),
                    });
                    *slope = *slope + through_states + direct;
                }
                add_congruence(sizes, d, [xx, xu, uu, xp, up, pp], total, product);
            })?;
            let has_next_piece = j + 2 < parts.len();
            for k in 0..if has_next_piece { nodes.len() } else { 0 } {
                copy_common(part_mut(v, k * nodes.ld[0], nx), sizes.point_solution(found, k, j + 1).x);
            }
        }
        Ok(())
    }

    /// Computes second derivatives from the stored first ones, with weights of the algebraic states
    /// at nodes, and the stored weights and constraint gradients at points.
    ///
    /// # Errors
    /// The errors of the integrator.
    pub fn backward(&mut self, nodes: &Nodes<'_, T>, call: PieceIntegrator<'_, T>) -> Result<(), OcpError> {
        let Self { sizes, fractions: parts, memory } = self;
        let (sizes, [nx, _, _, nz], n) = (*sizes, sizes.dims, nodes.len());
        let PieceMemory {
            solutions: found,
            v,
            multipliers: [of_ends, before],
            weights,
            constraint_gradients: forces,
            cost_and_hessian_sums: totals,
            product,
            ..
        } = &mut **memory;
        copy_common(of_ends, nodes.multipliers);
        for k in 0..n {
            // The present Hessian blocks of integral costs are Gauss-Newton blocks.
            part_mut(totals, k * sizes.sums_len(), sizes.sums_len())
                .iter_mut()
                .skip(1 + sizes.inputs())
                .for_each(|h| *h = T::ZERO);
        }
        for (j, ends) in parts.windows(2).enumerate().rev() {
            for k in 0..if j > 0 { n } else { 0 } {
                copy_common(part_mut(v, k * nodes.ld[0], nx), sizes.point_solution(found, k, j).x);
            }
            let here = Nodes {
                v: if j == 0 { nodes.v } else { v.as_slice() },
                multipliers: of_ends.as_slice(),
                weights: match j.checked_sub(1) {
                    None => nodes.weights,
                    Some(point) => part(weights, point * n * nz, n * nz),
                },
                piece: Some([get(ends, 0), get(ends, 1)]),
                ..*nodes
            };
            call(&here, &mut |k, step| {
                let total = part_mut(totals, k * sizes.sums_len(), sizes.sums_len());
                let ([xx, xu, uu], [xp, up, pp]) = (step.hessian, step.hessian_p);
                add_congruence(
                    sizes,
                    sizes.point_solution(found, k, j).dx,
                    [xx, xu, uu, xp, up, pp],
                    total,
                    product,
                );
                let Some(point) = j.checked_sub(1) else { return };
                let end_multipliers = part(of_ends, k * nodes.ld[1], nx);
                let nu = part(weights, (point * n + k) * nz, nz);
                let forces = part(forces, (point * n + k) * nx, nx);
                let columns = step.dx.chunks_exact(nx.max(1)).enumerate();
                for ((i, column), to) in columns.zip(part_mut(before, k * nodes.ld[1], nx)) {
                    let through_algebraic =
                        if nz > 0 { dot(part(step.dz[0], i * nz, nz), nu) } else { T::ZERO };
                    *to = dot(column, end_multipliers)
                        + through_algebraic
                        + get(forces, i)
                        + get(step.cost.x, i);
                }
            })?;
            core::mem::swap(of_ends, before);
        }
        Ok(())
    }

    /// Visits the intervals as if they had been integrated in one piece.
    pub fn visit_intervals(
        &self,
        intervals: usize,
        derivatives: bool,
        exact: bool,
        mut visit: impl FnMut(usize, &IntervalResult<'_, T>),
    ) {
        let (sizes, [nx, nu, _, nz]) = (self.sizes, self.sizes.dims);
        fn split<T>(columns: &[T], [height, nx, nu]: [usize; 3]) -> [&[T]; 3] {
            let (x, rest) = columns.split_at_checked(height * nx).unwrap_or_default();
            let (u, p) = rest.split_at_checked(height * nu).unwrap_or_default();
            [x, u, p]
        }
        for k in 0..intervals {
            let (start, end) = (
                sizes.point_solution(&self.memory.solutions, k, 0),
                sizes.point_solution(&self.memory.solutions, k, sizes.points + 1),
            );
            let total = part(&self.memory.cost_and_hessian_sums, k * sizes.sums_len(), sizes.sums_len());
            let (value, rest) = (get(total, 0), total.get(1..).unwrap_or_default());
            let mut result = IntervalResult { x: end.x, z: start.z, ..IntervalResult::default() };
            result.cost.value = value;
            if derivatives {
                let (gradient, blocks) = rest.split_at_checked(sizes.inputs()).unwrap_or_default();
                let mut rest = blocks;
                let [xx, xu, uu, xp, up, pp] = sizes.hessian_block_lens().map(|length| {
                    let (block, behind) = rest.split_at_checked(length).unwrap_or_default();
                    rest = behind;
                    block
                });
                [result.dx, result.du, result.dp] = split(end.dx, [nx, nx, nu]);
                result.dz = split(start.dz, [nz, nx, nu]);
                [result.cost.x, result.cost.u, result.cost.p] = split(gradient, [1, nx, nu]);
                let has_costs = value != T::ZERO || gradient.iter().any(|&slope| slope != T::ZERO);
                if exact {
                    (result.hessian, result.hessian_p) = ([xx, xu, uu], [xp, up, pp]);
                } else if has_costs {
                    (result.cost.hessian, result.cost.hessian_p) = ([xx, xu, uu], [xp, up, pp]);
                } else {
                    result.cost = IntegralTerms::default();
                }
            }
            visit(k, &result);
        }
    }
}

/// Initialises the first points with the nodes: `∂x/∂(x₀, u, p)` is the identity.
fn initialise_nodes<T: Real>(sizes: PieceSizes, found: &mut [T], nodes: &Nodes<'_, T>) {
    let [nx, _, _, nz] = sizes.dims;
    for (k, interval) in nodes.iter().enumerate() {
        let place = part_mut(found, k * sizes.point_count_with_ends() * sizes.point_len(), sizes.point_len());
        copy_common(place, interval.x);
        let columns = part_mut(place, nx + nz, nx * sizes.inputs());
        columns.fill(T::ZERO);
        columns.iter_mut().step_by(nx + 1).take(nx).for_each(|one| *one = T::ONE);
    }
}

/// `A D + (0, B, P)`, where `D` has as many rows as `A`.
fn chain_square<T: Real>(rows: usize, d: &[T], of_step: [&[T]; 3], to: &mut [T]) {
    chain_rule([rows, rows], d, of_step, to);
}

/// `A D + (0, B, P)` with the given number of rows; `D` has `nx` rows.
fn chain_rule<T: Real>([rows, nx]: [usize; 2], d: &[T], [a, b, p]: [&[T]; 3], to: &mut [T]) {
    let inputs = b.chunks_exact(rows.max(1)).chain(p.chunks_exact(rows.max(1)));
    let mut inputs = inputs.map(Some);
    for (c, (to, column)) in to.chunks_exact_mut(rows.max(1)).zip(d.chunks_exact(nx.max(1))).enumerate() {
        match if c < nx { None } else { inputs.next().flatten() } {
            Some(direct) => copy_common(to, direct),
            None => to.fill(T::ZERO),
        }
        for (a, &by) in a.chunks_exact(rows.max(1)).zip(column).filter(|(_, by)| **by != T::ZERO) {
            to.iter_mut().zip(a).for_each(|(to, &a)| *to = *to + a * by);
        }
    }
}

/// Adds `Mᵀ H M` to the blocks of an interval, for the blocks `H` of a piece. Does nothing if they
/// are empty.
fn add_congruence<T: Real>(
    sizes: PieceSizes,
    d: &[T],
    blocks: [&[T]; 6],
    total: &mut [T],
    product: &mut [T],
) {
    if blocks.iter().all(|block| block.is_empty()) {
        return;
    }
    let ([nx, nu, ..], inputs) = (sizes.dims, sizes.inputs());
    let [xx, xu, uu, xp, up, pp] = blocks;
    // Columns of `H_x,` with respect to controls and parameters.
    let mixed_column = |c: usize| match c.checked_sub(nx + nu) {
        Some(p) => part(xp, p * nx, nx),
        None => c.checked_sub(nx).map_or(&[][..], |u| part(xu, u * nx, nx)),
    };
    chain_square(nx, d, [xx, xu, xp], product);
    let mut rest = total.get_mut(1 + inputs..).unwrap_or_default();
    let (x, u, p) = (0..nx, nx..nx + nu, nx + nu..inputs);
    let pairs = [(&x, &x), (&x, &u), (&u, &u), (&x, &p), (&u, &p), (&p, &p)];
    let direct: [&[T]; 6] = [&[], &[], uu, &[], up, pp];
    for ((rows, columns), direct) in pairs.into_iter().zip(direct) {
        let (block, behind) = rest.split_at_mut_checked(rows.len() * columns.len()).unwrap_or_default();
        rest = behind;
        for (b, to) in columns.clone().zip(block.chunks_exact_mut(rows.len().max(1))) {
            let (of_b, d_b) = (part(product, b * nx, nx), part(d, b * nx, nx));
            for (a, to) in rows.clone().zip(to) {
                let mixed = mixed_column(a);
                let through_states = if mixed.is_empty() { T::ZERO } else { dot(mixed, d_b) };
                *to = *to + dot(part(d, a * nx, nx), of_b) + through_states;
            }
        }
        block.iter_mut().zip(direct).for_each(|(to, &value)| *to = *to + value);
    }
}
