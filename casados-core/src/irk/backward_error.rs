//! Backward errors of derivatives: they reveal an elimination that lost digits.
//!
//! Forward derivatives `D` of all variables satisfy `∂f/∂v D = 0` at every stage, adjoints `μ`
//! satisfy `Jᵀμ = h (b ⊗ λ, 0)`. The residual of a weighted sum over all directions is compared
//! with the magnitudes of its terms, equation by equation, which is invariant under scaling of
//! equations and unknowns. The weights are neither equal nor alternating, so that no structure of
//! the model hides an error. The unknowns of the solve are `dk`, so the magnitude of
//! `dξ = V + h Σ a dk` is the sum of those of its terms (W. Oettli, W. Prager, Compatibility of
//! approximate solution of linear equations with given error bounds, Numer. Math. 6 (1964)):
//! cancellation in this sum is no error of the elimination.

use super::adjoint::AdjointSweep;
use super::directions::{Directions, checksum_weight};
use super::forward::checksum::{ACCUMULATORS, sum_accumulators};
use super::forward::sweep::ForwardSweep;
use super::workspace::{Linearization, StageWorkspace};
use crate::irk::coefficients::Coefficients;
use crate::linalg::{Arithmetic, Block, Kernel, RowVisitor, dispatch, for_each_row, minus_ha};
use crate::memory::Fallback;
use crate::model::Dae;
use crate::plan::{Plan, PlanOf, StructureTable};
use crate::scalar::{Field, Lanes};
use crate::shape::{Array, InBounds, Plain, Shape};

/// Bound of the backward error of derivatives, in ε.
const BACKWARD_ERROR_TOLERANCE: f64 = 4096.0;

/// Bound of the backward error of the residual, in ε.
const RESIDUAL_TOLERANCE: f64 = 16.0;

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Returns the lanes in which the forward derivatives of a step satisfy the linearised
    /// equations.
    ///
    /// If the directions cancel in the weighted sum, its rounding errors are large relative to it.
    /// A second sum with other weights is then checked, in which they hardly cancel too.
    pub(crate) fn verify_forward<R: Array<E>, D: Directions<E>>(
        &mut self,
        sweep: &ForwardSweep<M, E, R, S>,
        coefficients: &Coefficients<E, S>,
        directions: D,
        with_second_weights: bool,
    ) -> E::Mask {
        let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
        // The residual is no longer needed: its memory is reused.
        let Self {
            variable_scratch: [probe, sizes],
            f,
            equation_magnitudes: terms,
            linearization: linear,
            ..
        } = self;
        let (probe, sizes) = (probe.as_mut(), sizes.as_mut());
        let inputs = probe.get_mut(nx + nx + nz..).in_bounds().unwrap_or_default();
        for (w, input) in inputs.iter_mut().enumerate().take(M::Shape::NU + M::Shape::NP) {
            *input = [directions.weighted_sum(nx + w, with_second_weights); S];
        }
        dispatch(VerifyForward {
            plan: F::plan::<M>(),
            start_sums: sweep.start_sums.as_ref(),
            stage_sums: sweep.stage_sums.as_ref(),
            a: &coefficients.a,
            h: self.inputs.time.step,
            jacobian: F::Plan::<M>::jacobian(&linear.jacobian),
            variable_sums: probe,
            variable_magnitudes: sizes,
            equation_sums: F::Plan::<M>::k_mut(f),
            equation_magnitudes: F::Plan::<M>::k_mut(terms),
        })
    }

    /// Returns the lanes in which the adjoints of a step satisfy their equations, with `λ` at the
    /// end of the step. The equations are those of `stored_linearization` or of the workspace.
    pub(crate) fn verify_adjoint<const C: usize>(
        &mut self,
        stored_linearization: Option<&Linearization<M, E, S, F>>,
        backward: &AdjointSweep<M, E, S, C>,
        coefficients: &Coefficients<E, S>,
    ) -> E::Mask {
        let [sums, sizes] = &mut self.variable_scratch;
        dispatch(VerifyAdjoint {
            plan: F::plan::<M>(),
            lambda: backward.lambda.as_ref(),
            mu: backward.mu.as_ref(),
            source: if backward.has_source { backward.stage_source.as_ref() } else { &[] },
            a: &coefficients.a,
            b: &coefficients.b,
            h: self.inputs.time.step,
            jacobian: F::Plan::<M>::jacobian(&stored_linearization.unwrap_or(&self.linearization).jacobian),
            sums: F::Plan::<M>::v_mut(sums),
            magnitudes: F::Plan::<M>::v_mut(sizes),
        })
    }
}

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Returns the lanes in which the residual is at the level of the rounding errors of its terms,
    /// `|f_r| ≤ 16 ε Σ_c |∂f_r/∂v_c v_c|`.
    pub(crate) fn residual_is_rounding(&mut self) -> E::Mask {
        self.replicate_jacobian();
        dispatch(ResidualTest {
            plan: F::plan::<M>(),
            f: self.f.as_ref(),
            points: F::Plan::<M>::v(&self.points),
            jacobian: F::Plan::<M>::jacobian(&self.linearization.jacobian),
            magnitudes: F::Plan::<M>::k_mut(&mut self.equation_magnitudes),
        })
    }
}

/// Whether loops over this many entries are unrolled. Loops on SIMD registers take a small part of
/// a step, so only short ones are unrolled.
const fn is_worth_unrolling<E>(entries: Option<usize>) -> bool {
    size_of::<E>() <= 8 || matches!(entries, Some(..65))
}

struct ResidualTest<'a, M: Plan, E: Plain, const S: usize> {
    plan: M,
    f: &'a [[E; S]],
    points: &'a M::V<[E; S]>,
    jacobian: &'a M::Jacobian<[E; S]>,
    magnitudes: &'a mut M::K<[E; S]>,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for ResidualTest<'_, M, E, S> {
    type Number = E;
    type Output = E::Mask;
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) -> E::Mask {
        let (zero, bound) = (E::from_f64(0.0), E::from_f64(RESIDUAL_TOLERANCE * E::EPSILON));
        self.magnitudes.as_mut().fill([E::from_f64(E::SMALLEST); S]);
        for_each_row::<A, _>(&mut self);
        let mut valid = E::le(zero, zero);
        for (f, sizes) in self.f.iter().zip(self.magnitudes.as_ref()) {
            for (&f, &size) in f.iter().zip(sizes) {
                valid = E::and(valid, E::le(f.abs(), bound * size));
            }
        }
        valid
    }
}

impl<M: Plan, E: Lanes, const S: usize> RowVisitor for ResidualTest<'_, M, E, S> {
    const ROWS: Option<usize> = StructureTable::JACOBIAN.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::JACOBIAN.row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 4 * if size_of::<E>() > 8 { S } else { 1 };
    const UNROLLED: bool = is_worth_unrolling::<E>(Self::ROWS);
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Some((r, c, values)) = self.plan.entry(self.jacobian.as_ref(), row) else { return };
        let (Some(sizes), Some(points)) =
            (self.magnitudes.as_mut().get_mut(r).in_bounds(), self.points.as_ref().get(c).in_bounds())
        else {
            return;
        };
        // A local copy stays in registers: the optimiser cannot prove that the arguments do not
        // overlap.
        let mut size = *sizes;
        for i in 0..S {
            size[i] = size[i] + (values[i] * points[i]).abs();
        }
        *sizes = size;
    }
}

/// The weighted sum over all seeds.
#[inline(always)]
fn weighted_seed_sum<E: Field, const C: usize>(seeds: &[E; C]) -> E {
    if const { C == 1 } {
        return seeds[0];
    }
    let mut sum = E::from_f64(0.0);
    for (seed, &value) in seeds.iter().enumerate() {
        sum = sum + checksum_weight::<E>(seed, false) * value;
    }
    sum
}

/// `|sum| ≤ BACKWARD_ERROR_TOLERANCE ε size`
#[inline(always)]
fn is_small<E: Lanes>(sum: E, size: E) -> E::Mask {
    E::le(sum.abs(), E::from_f64(BACKWARD_ERROR_TOLERANCE * E::EPSILON) * size.max(E::from_f64(E::SMALLEST)))
}

/// `|value|` at each stage.
#[inline(always)]
fn magnitudes_of<E: Lanes, const S: usize>(values: &[E; S]) -> [E; S] {
    let mut sizes = *values;
    for size in &mut sizes {
        *size = size.abs();
    }
    sizes
}

/// `start + h Σ_l a_il dk_l`, and the sum of the magnitudes of its terms.
#[inline(always)]
fn stage_sums_with_magnitudes<A: Arithmetic, E: Lanes, const S: usize>(
    start: E,
    minus_ha: &Block<E, S>,
    (dk, dk_sizes): (&[E; S], &[E; S]),
) -> ([E; S], [E; S]) {
    let (mut xi, mut sizes) = ([start; S], [start.abs(); S]);
    for ((column, &dk), &dk_size) in minus_ha.iter().zip(dk).zip(dk_sizes) {
        for ((xi, size), &element) in xi.iter_mut().zip(&mut sizes).zip(column) {
            *xi = A::subtract(*xi, element, dk);
            *size = A::subtract(*size, -element.abs(), dk_size);
        }
    }
    (xi, sizes)
}

struct VerifyForward<'a, M: Plan, E: Plain, const S: usize> {
    plan: M,
    start_sums: &'a [[E; ACCUMULATORS]],
    stage_sums: &'a [[[E; ACCUMULATORS]; S]],
    a: &'a [[E; S]; S],
    h: E,
    jacobian: &'a M::Jacobian<[E; S]>,
    /// Weighted sums over the directions of every variable, and their magnitudes.
    variable_sums: &'a mut [[E; S]],
    variable_magnitudes: &'a mut [[E; S]],
    /// Sums of every equation, and their magnitudes.
    equation_sums: &'a mut M::K<[E; S]>,
    equation_magnitudes: &'a mut M::K<[E; S]>,
}

impl<M: Plan, E: Lanes, const S: usize> Kernel for VerifyForward<'_, M, E, S> {
    type Number = E;
    type Output = E::Mask;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E::Mask {
        let Self {
            plan,
            start_sums,
            stage_sums,
            a,
            h,
            jacobian,
            variable_sums: probe,
            variable_magnitudes: sizes,
            equation_sums: sums,
            equation_magnitudes: terms,
        } = self;
        let (nx, zero) = (plan.nx(), E::from_f64(0.0));
        // Equal lengths, so that the optimiser removes bounds checks.
        let (nk, nv) = (plan.nk(), plan.nv());
        let (jacobian, sums, terms) = (jacobian.as_ref(), sums.as_mut(), terms.as_mut());
        if start_sums.len() != nx || stage_sums.len() != nk || probe.len() != nv || sizes.len() != nv {
            return E::lt(zero, zero);
        }
        let minus_ha = minus_ha(a, h);
        for (sizes, values) in sizes.iter_mut().zip(probe.iter()).skip(nx + nk) {
            *sizes = magnitudes_of(values);
        }
        for (unknown, stages) in stage_sums.iter().enumerate() {
            let mut sum = [zero; S];
            for (sum, accumulators) in sum.iter_mut().zip(stages) {
                *sum = sum_accumulators(accumulators);
            }
            let size = magnitudes_of(&sum);
            if unknown < nx {
                let xi = stage_sums_with_magnitudes::<A, E, S>(
                    sum_accumulators(&start_sums[unknown]),
                    &minus_ha,
                    (&sum, &size),
                );
                (probe[unknown], sizes[unknown]) = (sum, size);
                (probe[nx + unknown], sizes[nx + unknown]) = xi;
            } else {
                (probe[nx + unknown], sizes[nx + unknown]) = (sum, size);
            }
        }
        sums.fill([zero; S]);
        terms.fill([zero; S]);
        let mut total = EquationSums {
            plan,
            jacobian,
            variable_sums: probe,
            variable_magnitudes: sizes,
            equation_sums: sums,
            equation_magnitudes: terms,
        };
        for_each_row::<A, _>(&mut total);
        let mut valid = E::le(zero, zero);
        for (sums, terms) in total.equation_sums.iter().zip(&*total.equation_magnitudes) {
            for (&sum, &size) in sums.iter().zip(terms) {
                valid = E::and(valid, is_small(sum, size));
            }
        }
        valid
    }
}

/// For each equation the sum over all variables, and the sum of the magnitudes of its terms.
struct EquationSums<'a, M, E, const S: usize> {
    plan: M,
    jacobian: &'a [[E; S]],
    variable_sums: &'a [[E; S]],
    variable_magnitudes: &'a [[E; S]],
    equation_sums: &'a mut [[E; S]],
    equation_magnitudes: &'a mut [[E; S]],
}

impl<M: Plan, E: Lanes, const S: usize> RowVisitor for EquationSums<'_, M, E, S> {
    const ROWS: Option<usize> = StructureTable::JACOBIAN.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::JACOBIAN.row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 6 * if size_of::<E>() > 8 { S } else { 1 };
    const UNROLLED: bool = is_worth_unrolling::<E>(Self::ROWS);
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Some((r, c, values)) = self.plan.entry(self.jacobian, row) else { return };
        let Self {
            variable_sums: probe,
            variable_magnitudes: sizes,
            equation_sums: sums,
            equation_magnitudes: terms,
            ..
        } = self;
        let (Some(sums), Some(terms), Some(probe), Some(sizes)) = (
            sums.get_mut(r).in_bounds(),
            terms.get_mut(r).in_bounds(),
            probe.get(c).in_bounds(),
            sizes.get(c).in_bounds(),
        ) else {
            return;
        };
        // Local copies stay in registers: the optimiser cannot prove that the arguments do not
        // overlap.
        let (mut sum, mut term) = (*sums, *terms);
        for i in 0..S {
            // The sum has the opposite sign; only its magnitude matters.
            sum[i] = A::subtract(sum[i], values[i], probe[i]);
            term[i] = A::subtract(term[i], -values[i].abs(), sizes[i]);
        }
        (*sums, *terms) = (sum, term);
    }
}

struct VerifyAdjoint<'a, M: Plan, E: Plain, const S: usize, const C: usize> {
    plan: M,
    lambda: &'a [[E; C]],
    mu: &'a [[[E; C]; S]],
    /// Source terms of an integrand, the same for all seeds.
    source: &'a [[E; S]],
    a: &'a [[E; S]; S],
    b: &'a [E; S],
    h: E,
    jacobian: &'a M::Jacobian<[E; S]>,
    sums: &'a mut M::V<[E; S]>,
    magnitudes: &'a mut M::V<[E; S]>,
}

/// `Σ_r ∂f_r/∂v_c μ_r` of every variable at each stage, and the sum of the magnitudes of its terms.
struct VariableSums<'a, M, E, const S: usize, const C: usize> {
    plan: M,
    jacobian: &'a [[E; S]],
    mu: &'a [[[E; C]; S]],
    sums: &'a mut [[E; S]],
    magnitudes: &'a mut [[E; S]],
}

impl<M: Plan, E: Lanes, const S: usize, const C: usize> RowVisitor for VariableSums<'_, M, E, S, C> {
    /// The entries of `f_ẋ`, `f_x` and `f_z`.
    const ROWS: Option<usize> = StructureTable::Entries(0, 3).known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Entries(0, 3).row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = (6 + C) * if size_of::<E>() > 8 { S } else { 1 };
    const UNROLLED: bool = is_worth_unrolling::<E>(Self::ROWS);
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, row: usize) {
        let Some((r, c, values)) = self.plan.entry(self.jacobian, row) else { return };
        let Self { plan, mu, sums, magnitudes: sizes, .. } = self;
        let (Some(sums), Some(sizes), Some(mu)) =
            (sums.get_mut(c).in_bounds(), sizes.get_mut(c).in_bounds(), mu.get(plan.slot(r)).in_bounds())
        else {
            return;
        };
        // Local copies stay in registers: the optimiser cannot prove that the arguments do not
        // overlap.
        let (mut total, mut size) = (*sums, *sizes);
        for i in 0..S {
            let term = values[i] * weighted_seed_sum(&mu[i]);
            total[i] = total[i] + term;
            size[i] = size[i] + term.abs();
        }
        (*sums, *sizes) = (total, size);
    }
}

impl<M: Plan, E: Lanes, const S: usize, const C: usize> Kernel for VerifyAdjoint<'_, M, E, S, C> {
    type Number = E;
    type Output = E::Mask;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> E::Mask {
        let Self { plan, lambda, mu, source, a, b, h, jacobian, sums, magnitudes: sizes } = self;
        let (nx, nk, zero) = (plan.nx(), plan.nk(), E::from_f64(0.0));
        let (jacobian, sums, sizes) = (jacobian.as_ref(), sums.as_mut(), sizes.as_mut());
        if mu.len() != nk {
            return E::lt(zero, zero);
        }
        sums.fill([zero; S]);
        sizes.fill([zero; S]);
        let mut total = VariableSums { plan, jacobian, mu, sums, magnitudes: sizes };
        for_each_row::<A, _>(&mut total);
        let (sums, sizes) = (&*total.sums, &*total.magnitudes);
        let mut valid = E::le(zero, zero);
        for unknown in 0..nk {
            // For `k`: the entries of `f_ẋ` at its own stage, and those of `f_x` through all `ξ`.
            let variable = if unknown < nx { unknown } else { unknown + nx };
            let (Some(total), Some(size)) = (sums.get(variable).in_bounds(), sizes.get(variable).in_bounds())
            else {
                continue;
            };
            let (mut total, mut size) = (*total, *size);
            if let (true, Some(xi), Some(xi_size)) =
                (unknown < nx, sums.get(nx + unknown), sizes.get(nx + unknown))
            {
                let right = lambda.get(unknown).in_bounds().map_or(zero, |lambda| weighted_seed_sum(lambda));
                for i in 0..S {
                    let right = h * b[i] * right;
                    total[i] = total[i] - right;
                    size[i] = size[i] + right.abs();
                    for j in 0..S {
                        let ha = h * a[j][i];
                        total[i] = A::subtract(total[i], -ha, xi[j]);
                        size[i] = A::subtract(size[i], -ha.abs(), xi_size[j]);
                    }
                }
            }
            if let Some(source) = source.get(unknown) {
                for ((total, size), &source) in total.iter_mut().zip(&mut size).zip(source) {
                    let right = weighted_seed_sum(&[source; C]);
                    *total = *total - right;
                    *size = *size + right.abs();
                }
            }
            for (&total, &size) in total.iter().zip(&size) {
                valid = E::and(valid, is_small(total, size));
            }
        }
        valid
    }
}
