//! A step of the forward sweep, panel by panel: from `V_n` to the stage derivatives, to `V_{n+1}`
//! (the result, after the last step), and to the rows of `D` for second derivatives.

use super::checksum::{ACCUMULATORS, ChecksumVisitor, accumulate, clear_accumulators, minus_weights};
use super::output::{DerivativeOutput, PanelCombination};
use super::right_hand_side::{PanelRightHandSide, Scatter, ScatterProgress, scatter_panel};
use super::stage_sensitivities::StageRowWriter;
use crate::irk::coefficients::Coefficients;
use crate::irk::coefficients::nodes;
use crate::irk::directions::{Directions, L1_CACHE_BYTES, panel, panel_mut, panels};
use crate::irk::kinematic::KinematicPanel;
use crate::irk::workspace::{Linearization, StageWorkspace};
use crate::linalg::{
    Arithmetic, BackSubstitution, Block, Factors, ForwardSubstitution, Kernel, PlannedFactors, Prefetch,
    dispatch, is_large_plan, is_unrolled, kernels, minus_ha, solve_triangular_pair,
};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae};
use crate::plan::{Plan, PlanOf, StructureTable};
use crate::scalar::Lanes;
use crate::shape::{Aligned, Array, InBounds, Plain, Shape, copy};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Derivatives of one step, in panels; `R` holds one number per direction.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardSweep<M: Dae, T: Plain, R: Plain, const S: usize> {
    /// `V_n = dx_n/dw` at the start of the step, and `V_{n+1}` at its end unless the interval ends
    /// there.
    v: [Aligned<ArrayX<M, R>>; 2],
    /// Whether the first of them is at the end of the step.
    end_is_first: bool,
    /// Whether the first of them holds the unit matrix of the start of an interval.
    identity_written: bool,
    /// `d(k, z)/dw` at the stages.
    dy: Aligned<ArrayK<M, [R; S]>>,
    /// Weighted sums over all columns of `dy` and of `V_n`, in accumulators.
    pub(in crate::irk) stage_sums: Aligned<ArrayK<M, [[T; ACCUMULATORS]; S]>>,
    pub(in crate::irk) start_sums: Aligned<ArrayX<M, [T; ACCUMULATORS]>>,
    /// Zero if all derivatives in the result are finite, otherwise NaN.
    pub(in crate::irk) finite_indicator: [T; 1],
}

/// A linearised step and its directions.
pub(in crate::irk) struct LinearizedStep<'a, M: Dae, E: Lanes, D, const S: usize, F: Fallback> {
    /// The linearisation with the factors; `None` if they are in the workspace.
    pub stored_linearization: Option<&'a Linearization<M, E, S, F>>,
    pub coefficients: &'a Coefficients<E, S>,
    pub directions: D,
    /// Whether the step is the first of the interval.
    pub is_first: bool,
}
copy!(['a, M: Dae, E: Lanes, D: Copy, const S: usize, F: Fallback] LinearizedStep<'a, M, E, D, S, F>);

/// The outputs of a step besides its own memory.
pub(in crate::irk) struct StepOutputs<'a, E, G> {
    /// The rows of `D` for second derivatives.
    pub stage_sensitivities: Option<&'a mut [E]>,
    /// The result of the last step, which receives `V_{n+1}`.
    pub result: Option<G>,
    /// Whether the memory of the result may be in no cache.
    pub prefetch_output: bool,
}

/// The part of the work on a panel.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::irk) enum SweepPart {
    /// The right-hand side, the solution, and the outputs.
    All,
    /// The right-hand side only.
    RightHandSide,
    /// The outputs after the solution.
    AfterSolve,
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> ForwardSweep<M, E, R, S> {
    /// Sets `V_0`.
    pub(crate) fn set_initial_directions<D: Directions<E>>(&mut self, directions: D) {
        self.end_is_first = false;
        // Without an operating system all calls take the same time, including the first one.
        if !(cfg!(feature = "std") && D::ARE_UNIT_VECTORS && self.identity_written) {
            let end = R::flat_mut(self.v[0].as_mut());
            unit_or_seeds::<E, D, S>(end, M::Shape::NX, directions);
        }
        self.identity_written = D::ARE_UNIT_VECTORS;
    }

    /// Differentiates the next step, which is linearised. Returns the lanes in which the stage
    /// derivatives satisfy their equations.
    pub(in crate::irk) fn step<D: Directions<E>, G: DerivativeOutput<E>, F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        linearized: LinearizedStep<'_, M, E, D, S, F>,
        outputs: &mut StepOutputs<'_, E, G>,
    ) -> E::Mask {
        self.end_is_first = !self.end_is_first;
        self.repeat_step(work, linearized, outputs)
    }

    /// Repeats the step.
    pub(in crate::irk) fn repeat_step<D: Directions<E>, G: DerivativeOutput<E>, F: Fallback>(
        &mut self,
        work: &mut StageWorkspace<M, E, S, F>,
        linearized: LinearizedStep<'_, M, E, D, S, F>,
        outputs: &mut StepOutputs<'_, E, G>,
    ) -> E::Mask {
        if const { !Factors::<M, E, S, F>::MAY_BE_DENSE }
            || work.linearization(linearized.stored_linearization).factors.is_from_plan()
        {
            self.run(work, linearized, outputs, SweepPart::All, false);
        } else {
            self.run(work, linearized, outputs, SweepPart::RightHandSide, false);
            self.solve_columns(work, linearized.directions);
            self.run(work, linearized, outputs, SweepPart::AfterSolve, false);
        }
        let valid = work.verify_forward(self, linearized.coefficients, linearized.directions, false);
        if E::all(valid) {
            return valid;
        }
        self.run(work, linearized, outputs, SweepPart::AfterSolve, true);
        E::or(valid, work.verify_forward(self, linearized.coefficients, linearized.directions, true))
    }

    fn run<D: Directions<E>, G: DerivativeOutput<E>, F: Fallback>(
        &mut self,
        work: &StageWorkspace<M, E, S, F>,
        linearized: LinearizedStep<'_, M, E, D, S, F>,
        outputs: &mut StepOutputs<'_, E, G>,
        part: SweepPart,
        with_second_weights: bool,
    ) {
        self.identity_written &= self.end_is_first;
        let LinearizedStep { stored_linearization: kept, coefficients, directions, is_first: first } =
            linearized;
        let Self { v, end_is_first: end, dy, stage_sums: sums, start_sums, finite_indicator: finite, .. } =
            self;
        let [start, other] = v;
        let (v, next) = if *end { (start, other) } else { (other, start) };
        *finite = [dispatch(SweepKernel::<_, E, D, G, F, S> {
            plan: F::plan::<M>(),
            part,
            jacobian: F::Plan::<M>::jacobian(&work.linearization.jacobian),
            factors: work.linearization(kept).factors.planned(),
            coefficients,
            h: work.inputs.time.step,
            directions,
            is_first: first,
            v: R::flat(v.as_ref()),
            v_next: R::flat_mut(next.as_mut()),
            dy: R::flat_mut(dy.as_mut().as_flattened_mut()),
            sums: sums.as_mut(),
            start_sums: start_sums.as_mut(),
            stage_sensitivities: outputs.stage_sensitivities.as_deref_mut(),
            result: outputs.result.as_mut(),
            prefetch_output: outputs.prefetch_output,
            output_sum: E::from_f64(0.0),
            with_second_weights,
            scatter_progress: ScatterProgress::default(),
            fallback: PhantomData,
        })];
    }

    /// Recomputes the outputs after a change of the stage derivatives: `V_{n+1}` and the checksums.
    pub(in crate::irk) fn update_outputs<D: Directions<E>, G: DerivativeOutput<E>, F: Fallback>(
        &mut self,
        work: &StageWorkspace<M, E, S, F>,
        linearized: LinearizedStep<'_, M, E, D, S, F>,
        outputs: &mut StepOutputs<'_, E, G>,
    ) {
        self.run(work, linearized, outputs, SweepPart::AfterSolve, false);
    }

    /// `V_n` at the start of the step.
    pub(in crate::irk) fn v(&self) -> &[E] {
        self.v.get(usize::from(!self.end_is_first)).map_or(&[], |v| R::flat(v.as_ref()))
    }

    /// The derivatives of the stages.
    pub(in crate::irk) fn dy(&self) -> &[E] {
        R::flat(self.dy.as_ref().as_flattened())
    }

    /// The derivatives of the stages.
    pub(in crate::irk) fn dy_mut(&mut self) -> &mut [R] {
        self.dy.as_mut().as_flattened_mut()
    }
}

kernels! {
    /// See [`ForwardSweep::set_initial_directions`].
    fn unit_or_seeds [E: Lanes, D: Directions<E>, const S: usize] [E, D, S] <A>(
        v: &'k mut [E],
        rows: usize,
        directions: D,
    ) {
        v.fill(E::from_f64(0.0));
        panels!([D::COLUMNS, directions.columns()], E, S, column, W => {
            for (index, row) in panel_mut::<E, W>(v, column, rows).iter_mut().enumerate() {
                directions.add_scaled(index, E::from_f64(1.0), column, row);
            }
        });
    }
}

/// See [`ForwardSweep::step`].
struct SweepKernel<'a, M: Plan, E: Plain, D, G, F, const S: usize> {
    plan: M,
    part: SweepPart,
    jacobian: &'a M::Jacobian<[E; S]>,
    factors: PlannedFactors<'a, M, E, S>,
    coefficients: &'a Coefficients<E, S>,
    h: E,
    directions: D,
    is_first: bool,
    v: &'a [E],
    v_next: &'a mut [E],
    dy: &'a mut [E],
    sums: &'a mut [[[E; ACCUMULATORS]; S]],
    start_sums: &'a mut [[E; ACCUMULATORS]],
    stage_sensitivities: Option<&'a mut [E]>,
    result: Option<&'a mut G>,
    prefetch_output: bool,
    /// The sum of all elements that were written to the result.
    output_sum: E,
    with_second_weights: bool,
    scatter_progress: ScatterProgress,
    fallback: PhantomData<F>,
}

/// The coefficients of all panels.
struct PanelCoefficients<E, const S: usize> {
    /// `h c_i`
    nodes: [E; S],
    /// `−hA`
    minus_ha: Block<E, S>,
    /// `−h b_i`
    minus_weights: [E; S],
}

impl<M: Plan, E: Lanes, D: Directions<E>, G: DerivativeOutput<E>, F: Fallback, const S: usize> Kernel
    for SweepKernel<'_, M, E, D, G, F, S>
{
    type Number = E;
    type Output = E;
    const WIDE: bool = is_large_plan::<M, S>() && matches!(D::COLUMNS, Some(8..));
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) -> E {
        let nodes = nodes(&self.coefficients.a, self.h);
        if self.part != SweepPart::RightHandSide {
            for accumulators in self.sums.as_flattened_mut().iter_mut().chain(&mut *self.start_sums) {
                clear_accumulators(accumulators);
            }
            if D::ARE_UNIT_VECTORS && self.is_first {
                for (state, [sum, ..]) in self.start_sums.iter_mut().enumerate() {
                    *sum = self.directions.weighted_sum(state, self.with_second_weights);
                }
            }
        }
        if const { D::ARE_UNIT_VECTORS && Self::fits_cache::<A>() }
            && self.part != SweepPart::AfterSolve
            && self.is_first
        {
            self.dy.fill(E::from_f64(0.0));
            let Self { plan, directions, .. } = self;
            let jacobian = self.jacobian.as_ref();
            Scatter { plan, jacobian, nodes: &nodes, dy: &mut *self.dy, directions }.evaluate::<A>();
        }
        let Self { coefficients, h, .. } = self;
        let mut minus_weights = coefficients.b;
        for weight in &mut minus_weights {
            *weight = -(h * *weight);
        }
        let shared = &PanelCoefficients { nodes, minus_ha: minus_ha(&coefficients.a, h), minus_weights };
        let columns = self.directions.columns();
        panels!([D::COLUMNS, columns], E, S, column, W => self.process_panel::<A, W>(column, shared));
        // Zero times a non-finite number is NaN.
        E::from_f64(0.0) * self.output_sum
    }
}

impl<M: Plan, E: Lanes, D: Directions<E>, G: DerivativeOutput<E>, F: Fallback, const S: usize>
    SweepKernel<'_, M, E, D, G, F, S>
{
    /// Whether `V_n` is always the unit matrix.
    const ALWAYS_IDENTITY: bool = D::ARE_UNIT_VECTORS && !F::INTERVALS;

    /// Whether all panels fit the L1 cache and one unrolled loop fills them; the panels of a large
    /// model are filled one at a time.
    const fn fits_cache<A: Arithmetic>() -> bool {
        let (Some(columns), Some(nk)) = (D::COLUMNS, StructureTable::Unknowns.known_row_count::<M>()) else {
            return false;
        };
        let bytes = columns * nk * S * size_of::<E>();
        bytes <= L1_CACHE_BYTES && is_unrolled::<A, Scatter<'_, M, E, D, S>>()
    }

    /// Whether the checksums are computed from memory after the solution: small models fit the L1
    /// cache, and scalar registers are few.
    const fn sums_after_solve<A: Arithmetic>() -> bool {
        size_of::<E>() <= 8 && Self::fits_cache::<A>()
    }

    #[inline(always)]
    fn process_panel<A: Arithmetic, const W: usize>(
        &mut self,
        column: usize,
        shared: &PanelCoefficients<E, S>,
    ) {
        self.compute_right_hand_side::<A, W>(column, &shared.nodes);
        let (dy, _) = panel_mut::<E, W>(self.dy, column, self.plan.nk() * S).as_chunks_mut::<S>();
        let minus_weights = &minus_weights::<E, W>(column, self.with_second_weights);
        if self.part == SweepPart::All {
            if const { Self::sums_after_solve::<A>() } {
                solve_triangular_pair::<A, M, E, [E; W], S, W, ForwardSubstitution, BackSubstitution>(
                    self.factors,
                    dy,
                    0,
                    &mut (),
                );
            } else {
                let ahead = match &self.result {
                    Some(to) if self.prefetch_output => Prefetch(to.next_columns::<W>(column)),
                    _ => Prefetch(&[]),
                };
                let sums = &mut *self.sums;
                let visitor = &mut ChecksumVisitor { sums, minus_weights, prefetch: ahead };
                solve_triangular_pair::<A, M, E, [E; W], S, W, ForwardSubstitution, BackSubstitution>(
                    self.factors,
                    dy,
                    0,
                    visitor,
                );
            }
        }
        self.process_solution::<A, W>(column, minus_weights, shared);
    }

    /// Computes the right-hand side of a panel, with the nodes `h c_i`.
    #[inline(always)]
    fn compute_right_hand_side<A: Arithmetic, const W: usize>(&mut self, column: usize, nodes: &[E; S]) {
        let (plan, nx, nk) = (self.plan, self.plan.nx(), self.plan.nk());
        let v = panel::<E, W>(self.v, column, nx);
        let (dy, _) = panel_mut::<E, W>(self.dy, column, nk * S).as_chunks_mut::<S>();
        // Equal lengths, so that the optimiser removes bounds checks.
        if self.part == SweepPart::AfterSolve || v.len() != nx || dy.len() != nk {
            return;
        }
        let (jacobian, directions) = (self.jacobian.as_ref(), self.directions);
        if const { !Self::ALWAYS_IDENTITY } && !(self.is_first && D::ARE_UNIT_VECTORS) {
            let kinematic = KinematicPanel { plan, jacobian, v, directions, column };
            PanelRightHandSide { kinematic, nodes, dy: &mut *dy }.evaluate::<A>();
        } else if const { !Self::fits_cache::<A>() } {
            scatter_panel::<M, E, D, S, W>(
                (plan, directions),
                jacobian,
                nodes,
                &mut self.scatter_progress,
                dy,
                column,
            );
        }
    }

    /// Computes the outputs of a panel from its solution.
    #[inline(always)]
    fn process_solution<A: Arithmetic, const W: usize>(
        &mut self,
        column: usize,
        minus_weights: &[E; W],
        shared: &PanelCoefficients<E, S>,
    ) {
        let (plan, nx, nk) = (self.plan, self.plan.nx(), self.plan.nk());
        let v = panel::<E, W>(self.v, column, nx);
        let (dy, _) = panel_mut::<E, W>(self.dy, column, nk * S).as_chunks_mut::<S>();
        if self.part == SweepPart::RightHandSide || v.len() != nx || dy.len() != nk {
            return;
        }
        let (jacobian, directions) = (self.jacobian.as_ref(), self.directions);
        let kinematic = KinematicPanel { plan, jacobian, v, directions, column };
        let mut sums = ChecksumVisitor { sums: &mut *self.sums, minus_weights, prefetch: Prefetch(&[]) };
        if const { !Self::sums_after_solve::<A>() } && self.part != SweepPart::AfterSolve {
            kinematic.reconstruct::<A>(&shared.minus_ha, dy, &mut sums);
        } else {
            kinematic.reconstruct::<A>(&shared.minus_ha, dy, &mut ());
            sums.add_panel::<A>(dy);
        }
        let is_identity = Self::ALWAYS_IDENTITY || self.is_first && D::ARE_UNIT_VECTORS;
        if const { !Self::ALWAYS_IDENTITY } && !is_identity {
            for (accumulators, row) in self.start_sums.iter_mut().zip(v) {
                accumulate::<A, E, W>(accumulators, minus_weights, row);
            }
        }
        // The unit matrix is known: it is not read.
        let base = if is_identity { None } else { Some(v) };
        let ones = if is_identity {
            plan.structure().directions.get(column..).in_bounds().unwrap_or_default()
        } else {
            &[]
        };
        if let Some(to) = &mut self.result {
            let end = PanelCombination {
                base,
                unit_rows: ones,
                dy,
                unknowns: 0..nx,
                minus_weights: &shared.minus_weights,
            };
            self.output_sum = self.output_sum + end.write::<A>(&mut to.columns_mut::<W>(column));
        } else if const { !Self::ALWAYS_IDENTITY } {
            let next = panel_mut::<E, W>(self.v_next, column, nx);
            for (n, (to, dk)) in next.iter_mut().zip(dy.iter()).enumerate() {
                let mut row = base.and_then(|v| v.get(n)).copied().unwrap_or([E::from_f64(0.0); W]);
                for (&weight, dk) in shared.minus_weights.iter().zip(dk) {
                    A::subtract_row(&mut row, weight, dk);
                }
                *to = row;
            }
            for (c, &state) in ones.iter().enumerate().take(W) {
                if let Some(row) = next.get_mut(state as usize) {
                    row[c] = row[c] + E::from_f64(1.0);
                }
            }
        }
        if let Some(curved) = &mut self.stage_sensitivities {
            let count = plan.structure().curved.len();
            let d = panel_mut::<E, W>(curved, column, count * S);
            StageRowWriter { plan, minus_ha: shared.minus_ha, directions }
                .write_panel::<A, W>(v, dy, d, column);
        }
    }
}
