//! A step of the forward sweep, panel by panel: from `V_n` to the derivatives of the stages, to
//! `V_{n+1}`, which after the last step is a result, and to what second derivatives need of both.

use super::checksum::{ACCUMULATORS, Summed, accumulate, clear, minus_weights};
use super::output::{Columns, Target};
use super::right_hand_side::{Later, Placed, Scatter, place};
use super::stage_rows::CurvedRows;
use crate::irk::coefficients::Coefficients;
use crate::irk::coefficients::nodes;
use crate::irk::directions::{Directions, L1_CACHE_BYTES, panel, panel_mut, panels};
use crate::irk::kinematic::KinematicPanel;
use crate::irk::workspace::{Linearization, Work};
use crate::linalg::{
    Ahead, Arithmetic, Block, Down, Factors, Kernel, Planned, Up, dispatch, is_long, is_short, kernels,
    minus_ha, sweeps,
};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayX, Dae};
use crate::plan::{Plan, PlanOf, Table};
use crate::scalar::Lanes;
use crate::shape::{Aligned, Array, Plain, Shape, copy};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Derivatives of one step in directions, as many as there are elements in `R`, in panels.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Sweep<M: Dae, T: Plain, R: Plain, const S: usize> {
    /// `dx_n/dw` at the start of the step, and at its end if that is not the end of the interval.
    v: [Aligned<ArrayX<M, R>>; 2],
    /// Which of them is at the end.
    end: bool,
    /// The first of them is what it is at the start of an interval, where that is always the same.
    begun: bool,
    /// `d(k, z)/dw` at its stages.
    dy: Aligned<ArrayK<M, [R; S]>>,
    /// Weighted sums over all columns of `dy` and of `V_n`, in accumulators.
    pub(in crate::irk) sums: Aligned<ArrayK<M, [[T; ACCUMULATORS]; S]>>,
    pub(in crate::irk) start_sums: Aligned<ArrayX<M, [T; ACCUMULATORS]>>,
    /// Zero if all that was written to a result after the last step is finite, else NaN.
    pub(in crate::irk) finite: [T; 1],
}

/// A step that is linearised, and the directions that go through it.
pub(in crate::irk) struct Linearized<'a, M: Dae, E: Lanes, D, const S: usize, F: Fallback> {
    /// Where its factors are, if they are not where they are made.
    pub kept: Option<&'a Linearization<M, E, S, F>>,
    pub coefficients: &'a Coefficients<E, S>,
    pub directions: D,
    /// Whether it is the first of the interval.
    pub first: bool,
}
copy!(['a, M: Dae, E: Lanes, D: Copy, const S: usize, F: Fallback] Linearized<'a, M, E, D, S, F>);

/// What a step writes beside its own memory.
pub(in crate::irk) struct Outputs<'a, E, G> {
    /// The rows of `D` for second derivatives.
    pub curved: Option<&'a mut [E]>,
    /// The result, after the last step: it has `V_{n+1}`.
    pub end: Option<G>,
    /// Whether that may be in no cache.
    pub distant: bool,
}

/// What is done to a panel.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::irk) enum Phase {
    /// All of it.
    Whole,
    /// The right-hand side.
    Before,
    /// What comes after the solution.
    After,
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Sweep<M, E, R, S> {
    /// `V_0`
    pub(crate) fn start<D: Directions<E>>(&mut self, directions: D) {
        self.end = false;
        // Without an operating system every call takes the same time, the first one too.
        if !(cfg!(feature = "std") && D::SPARSE && self.begun) {
            let end = R::flat_mut(self.v[0].as_mut());
            unit_or_seeds::<E, D, S>(end, M::Shape::NX, directions);
        }
        self.begun = D::SPARSE;
    }

    /// The step that follows, which is linearised. Whether the derivatives of the stages satisfy
    /// their equations.
    pub(in crate::irk) fn step<D: Directions<E>, G: Target<E>, F: Fallback>(
        &mut self,
        work: &mut Work<M, E, S, F>,
        of: Linearized<'_, M, E, D, S, F>,
        outputs: &mut Outputs<'_, E, G>,
    ) -> E::Mask {
        self.end = !self.end;
        self.repeat(work, of, outputs)
    }

    /// The same step again.
    pub(in crate::irk) fn repeat<D: Directions<E>, G: Target<E>, F: Fallback>(
        &mut self,
        work: &mut Work<M, E, S, F>,
        of: Linearized<'_, M, E, D, S, F>,
        outputs: &mut Outputs<'_, E, G>,
    ) -> E::Mask {
        if const { !Factors::<M, E, S, F>::MAY_BE_DENSE } || work.linear(of.kept).factors.is_planned() {
            self.run(work, of, outputs, Phase::Whole, false);
        } else {
            self.run(work, of, outputs, Phase::Before, false);
            self.solve_columns(work, of.directions);
            self.run(work, of, outputs, Phase::After, false);
        }
        let good = work.verify_forward(self, of.coefficients, of.directions, false);
        if E::all(good) {
            return good;
        }
        self.run(work, of, outputs, Phase::After, true);
        E::or(good, work.verify_forward(self, of.coefficients, of.directions, true))
    }

    fn run<D: Directions<E>, G: Target<E>, F: Fallback>(
        &mut self,
        work: &Work<M, E, S, F>,
        of: Linearized<'_, M, E, D, S, F>,
        outputs: &mut Outputs<'_, E, G>,
        phase: Phase,
        second: bool,
    ) {
        self.begun &= self.end;
        let Linearized { kept, coefficients, directions, first } = of;
        let Self { v, end, dy, sums, start_sums, finite, .. } = self;
        let [start, other] = v;
        let (v, next) = if *end { (start, other) } else { (other, start) };
        *finite = [dispatch(Step::<_, E, D, G, F, S> {
            plan: F::plan::<M>(),
            phase,
            jacobian: F::Plan::<M>::jacobian(&work.linear.jacobian),
            factors: work.linear(kept).factors.planned(),
            coefficients,
            h: work.inputs.time.step,
            directions,
            first,
            v: R::flat(v.as_ref()),
            next: R::flat_mut(next.as_mut()),
            dy: R::flat_mut(dy.as_mut().as_flattened_mut()),
            sums: sums.as_mut(),
            start_sums: start_sums.as_mut(),
            curved: outputs.curved.as_deref_mut(),
            result: outputs.end.as_mut(),
            distant: outputs.distant,
            sum: E::from_f64(0.0),
            second,
            placed: Placed::default(),
            of: PhantomData,
        })];
    }

    /// What follows from derivatives of the stages that are others now: `V_{n+1}`, and the sums
    /// over all directions.
    pub(in crate::irk) fn conclude<D: Directions<E>, G: Target<E>, F: Fallback>(
        &mut self,
        work: &Work<M, E, S, F>,
        of: Linearized<'_, M, E, D, S, F>,
        outputs: &mut Outputs<'_, E, G>,
    ) {
        self.run(work, of, outputs, Phase::After, false);
    }

    /// `V` at the start of the step.
    pub(in crate::irk) fn v(&self) -> &[E] {
        self.v.get(usize::from(!self.end)).map_or(&[], |v| R::flat(v.as_ref()))
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
    /// See [`Sweep::start`].
    fn unit_or_seeds [E: Lanes, D: Directions<E>, const S: usize] [E, D, S] <A>(
        v: &'k mut [E],
        rows: usize,
        directions: D,
    ) {
        v.fill(E::from_f64(0.0));
        panels!([D::COLUMNS, directions.columns()], E, S, column, W => {
            for (index, row) in panel_mut::<E, W>(v, column, rows).iter_mut().enumerate() {
                directions.add(index, E::from_f64(1.0), column, row);
            }
        });
    }
}

/// See [`Sweep::step`].
struct Step<'a, M: Plan, E: Plain, D, G, F, const S: usize> {
    plan: M,
    phase: Phase,
    jacobian: &'a M::Jacobian<[E; S]>,
    factors: Planned<'a, M, E, S>,
    coefficients: &'a Coefficients<E, S>,
    h: E,
    directions: D,
    first: bool,
    v: &'a [E],
    next: &'a mut [E],
    dy: &'a mut [E],
    sums: &'a mut [[[E; ACCUMULATORS]; S]],
    start_sums: &'a mut [[E; ACCUMULATORS]],
    curved: Option<&'a mut [E]>,
    result: Option<&'a mut G>,
    distant: bool,
    /// That of all that was written to the result.
    sum: E,
    second: bool,
    placed: Placed,
    of: PhantomData<F>,
}

/// What all panels share.
struct Shared<E, const S: usize> {
    /// `h c_i`
    nodes: [E; S],
    /// `−hA`
    minus_ha: Block<E, S>,
    /// `−h b_i`
    minus_weights: [E; S],
}

impl<M: Plan, E: Lanes, D: Directions<E>, G: Target<E>, F: Fallback, const S: usize> Kernel
    for Step<'_, M, E, D, G, F, S>
{
    type Number = E;
    type Output = E;
    const WIDE: bool = is_long::<M, S>() && matches!(D::COLUMNS, Some(8..));
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) -> E {
        let nodes = nodes(&self.coefficients.a, self.h);
        if self.phase != Phase::Before {
            for accumulators in self.sums.as_flattened_mut().iter_mut().chain(&mut *self.start_sums) {
                clear(accumulators);
            }
            if D::SPARSE && self.first {
                for (state, [sum, ..]) in self.start_sums.iter_mut().enumerate() {
                    *sum = self.directions.total(state, self.second);
                }
            }
        }
        if const { D::SPARSE && Self::is_small::<A>() } && self.phase != Phase::After && self.first {
            self.dy.fill(E::from_f64(0.0));
            let Self { plan, directions, .. } = self;
            let jacobian = self.jacobian.as_ref();
            Scatter { plan, jacobian, nodes: &nodes, dy: &mut *self.dy, directions }.all::<A>();
        }
        let Self { coefficients, h, .. } = self;
        let mut minus_weights = coefficients.b;
        for weight in &mut minus_weights {
            *weight = -(h * *weight);
        }
        let shared = &Shared { nodes, minus_ha: minus_ha(&coefficients.a, h), minus_weights };
        let columns = self.directions.columns();
        panels!([D::COLUMNS, columns], E, S, column, W => self.panel::<A, W>(column, shared));
        // Nothing times what is not finite is not a number.
        E::from_f64(0.0) * self.sum
    }
}

impl<M: Plan, E: Lanes, D: Directions<E>, G: Target<E>, F: Fallback, const S: usize>
    Step<'_, M, E, D, G, F, S>
{
    /// Whether `V_n` is always the unit matrix.
    const UNIT: bool = D::SPARSE && !F::INTERVALS;

    /// Whether all panels fit the nearest cache, and one unrolled loop fills them; of a large model
    /// each is filled when its turn comes.
    const fn is_small<A: Arithmetic>() -> bool {
        let (Some(columns), Some(nk)) = (D::COLUMNS, Table::Unknowns.known::<M>()) else { return false };
        let bytes = columns * nk * S * size_of::<E>();
        bytes <= L1_CACHE_BYTES && is_short::<A, Scatter<'_, M, E, D, S>>()
    }

    /// Whether sums are made of what is in the memory: of small models all of it is in the nearest
    /// cache, and registers are few.
    const fn sums_late<A: Arithmetic>() -> bool {
        size_of::<E>() <= 8 && Self::is_small::<A>()
    }

    #[inline(always)]
    fn panel<A: Arithmetic, const W: usize>(&mut self, column: usize, shared: &Shared<E, S>) {
        self.before::<A, W>(column, &shared.nodes);
        let (dy, _) = panel_mut::<E, W>(self.dy, column, self.plan.nk() * S).as_chunks_mut::<S>();
        let minus_weights = &minus_weights::<E, W>(column, self.second);
        if self.phase == Phase::Whole {
            if const { Self::sums_late::<A>() } {
                sweeps::<A, M, E, [E; W], S, W, Down, Up>(self.factors, dy, 0, &mut ());
            } else {
                let ahead = match &self.result {
                    Some(to) if self.distant => Ahead(to.following::<W>(column)),
                    _ => Ahead(&[]),
                };
                let sums = &mut *self.sums;
                let visitor = &mut Summed { sums, minus_weights, ahead };
                sweeps::<A, M, E, [E; W], S, W, Down, Up>(self.factors, dy, 0, visitor);
            }
        }
        self.after::<A, W>(column, minus_weights, shared);
    }

    /// The right-hand side of a panel, with `h c_i`.
    #[inline(always)]
    fn before<A: Arithmetic, const W: usize>(&mut self, column: usize, nodes: &[E; S]) {
        let (plan, nx, nk) = (self.plan, self.plan.nx(), self.plan.nk());
        let v = panel::<E, W>(self.v, column, nx);
        let (dy, _) = panel_mut::<E, W>(self.dy, column, nk * S).as_chunks_mut::<S>();
        // Lengths that the optimiser knows need no looking at.
        if self.phase == Phase::After || v.len() != nx || dy.len() != nk {
            return;
        }
        let (jacobian, directions) = (self.jacobian.as_ref(), self.directions);
        if const { !Self::UNIT } && !(self.first && D::SPARSE) {
            let kinematic = KinematicPanel { plan, jacobian, v, directions, column };
            Later { kinematic, nodes, dy: &mut *dy }.all::<A>();
        } else if const { !Self::is_small::<A>() } {
            place::<M, E, D, S, W>((plan, directions), jacobian, nodes, &mut self.placed, dy, column);
        }
    }

    /// What follows from the solution of a panel.
    #[inline(always)]
    fn after<A: Arithmetic, const W: usize>(
        &mut self,
        column: usize,
        minus_weights: &[E; W],
        shared: &Shared<E, S>,
    ) {
        let (plan, nx, nk) = (self.plan, self.plan.nx(), self.plan.nk());
        let v = panel::<E, W>(self.v, column, nx);
        let (dy, _) = panel_mut::<E, W>(self.dy, column, nk * S).as_chunks_mut::<S>();
        if self.phase == Phase::Before || v.len() != nx || dy.len() != nk {
            return;
        }
        let (jacobian, directions) = (self.jacobian.as_ref(), self.directions);
        let kinematic = KinematicPanel { plan, jacobian, v, directions, column };
        let mut sums = Summed { sums: &mut *self.sums, minus_weights, ahead: Ahead(&[]) };
        if const { !Self::sums_late::<A>() } && self.phase != Phase::After {
            kinematic.reconstruct::<A>(&shared.minus_ha, dy, &mut sums);
        } else {
            kinematic.reconstruct::<A>(&shared.minus_ha, dy, &mut ());
            sums.all::<A>(dy);
        }
        let unit = Self::UNIT || self.first && D::SPARSE;
        if const { !Self::UNIT } && !unit {
            for (accumulators, row) in self.start_sums.iter_mut().zip(v) {
                accumulate::<A, E, W>(accumulators, minus_weights, row);
            }
        }
        // The unit matrix need not be read.
        let from = if unit { None } else { Some(v) };
        let ones = if unit { plan.structure().directions.get(column..).unwrap_or_default() } else { &[] };
        if let Some(to) = &mut self.result {
            let end =
                Columns { start: from, ones, dy, unknowns: 0..nx, minus_weights: &shared.minus_weights };
            self.sum = self.sum + end.write::<A>(&mut to.columns::<W>(column));
        } else if const { !Self::UNIT } {
            let next = panel_mut::<E, W>(self.next, column, nx);
            for (n, (to, dk)) in next.iter_mut().zip(dy.iter()).enumerate() {
                let mut row = from.and_then(|v| v.get(n)).copied().unwrap_or([E::from_f64(0.0); W]);
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
        if let Some(curved) = &mut self.curved {
            let count = plan.structure().curved.len();
            let d = panel_mut::<E, W>(curved, column, count * S);
            CurvedRows { plan, minus_ha: shared.minus_ha, directions }.panel::<A, W>(v, dy, d, column);
        }
    }
}
