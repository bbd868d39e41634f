//! Evaluation of the model at the stages of a step.
//!
//! The values of a variable, an equation or an entry of the Jacobian at all stages are adjacent in
//! memory. On machines with registers of as many numbers, one call of the model evaluates all
//! stages.

use crate::irk::coefficients::Coefficients;
use crate::irk::coefficients::stage_values;
use crate::irk::kinematic::{self, has_no_kinematic_unknowns, kinematic_derivative};
use crate::irk::stage_array::StageArray;
use crate::irk::workspace::{IntervalTimes, StageWorkspace};
use crate::linalg::{Arithmetic, Block, Kernel, RowVisitor, dispatch, for_each_row, kernels, minus_ha};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::plan::{Plan, PlanOf, StructureTable};
use crate::scalar::{Lanes, SideBySide, Strided};
use crate::shape::{InBounds, Matrix, Plain, Shape};

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> StageWorkspace<M, E, S, F> {
    /// Writes `u` and `p`, which are constant in an interval.
    pub(crate) fn place_inputs(&mut self) {
        let u = 2 * M::Shape::NX + M::Shape::NZ;
        let inputs = self.inputs.u.as_slice().iter().chain(self.inputs.p.as_slice());
        for (point, input) in self.points.as_mut()[u..].iter_mut().zip(inputs) {
            *point = [*input; S];
        }
    }

    /// Writes `(k_i, ξ_i, z_i, t_i)` with `ξ_i = x + h Σ_j a_ij k_j`.
    #[inline]
    pub(crate) fn place_stages(
        &mut self,
        coefficients: &Coefficients<E, S>,
        step: usize,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
    ) {
        self.dispatch_place::<false>(coefficients, step, x, y);
    }

    /// Like [`place_stages`](Self::place_stages), with the `k_i` of
    /// [kinematic](crate::irk::kinematic) states computed from their velocities.
    #[inline]
    pub(crate) fn place_unknowns(
        &mut self,
        coefficients: &Coefficients<E, S>,
        step: usize,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
    ) {
        if const { !kinematic::has_kinematic_states::<M>() } {
            return self.place_stages(coefficients, step, x, y);
        }
        self.dispatch_place::<true>(coefficients, step, x, y);
    }

    #[inline(always)]
    fn dispatch_place<const UNKNOWNS: bool>(
        &mut self,
        coefficients: &Coefficients<E, S>,
        step: usize,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
    ) {
        dispatch(PlaceStages::<_, E, S, UNKNOWNS> {
            plan: F::plan::<M>(),
            points: F::Plan::<M>::v_mut(&mut self.points),
            jacobian: F::Plan::<M>::jacobian(&self.linearization.jacobian),
            x: F::Plan::<M>::x(x),
            y: F::Plan::<M>::k(y),
            a: &coefficients.a,
            c: &coefficients.c,
            time: self.inputs.time,
            step,
        });
    }

    /// Evaluates the residual at all stages.
    pub(crate) fn evaluate_residual(&mut self) {
        self.evaluate::<false>();
    }

    /// Evaluates the residual and the Jacobian at all stages.
    pub(crate) fn evaluate_jacobian(&mut self) {
        self.evaluate::<true>();
        self.replicate_jacobian();
    }

    /// Evaluates one Jacobian for all stages, and the residual at each stage. With one lane the
    /// Jacobians of all stages are evaluated, in one SIMD register if possible, and averaged in the
    /// factorisation. With several lanes the Jacobian at the midpoint of the stages is evaluated.
    /// `residual` is whether the residual is known.
    pub(crate) fn evaluate_midpoint_jacobian(
        &mut self,
        coefficients: &Coefficients<E, S>,
        step: usize,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
        residual: bool,
    ) {
        if const { E::LANES == 1 } || self.identical_stages {
            self.evaluate::<true>();
            if const { E::LANES == 1 } {
                self.replicate_jacobian();
            }
            return;
        }
        to_middle(self.points.as_mut(), 2 * M::Shape::NX + M::Shape::NZ);
        self.evaluate_stage::<true>(0);
        self.first_stage_only = true;
        self.place_unknowns(coefficients, step, x, y);
        if residual {
            self.evaluate_stage::<false>(0);
        } else {
            self.evaluate_residual();
        }
    }

    /// Copies the Jacobian of the first stage to all stages, if only that was evaluated.
    pub(crate) fn replicate_jacobian(&mut self) {
        if core::mem::take(&mut self.first_stage_only) {
            spread(self.linearization.jacobian.as_mut());
        }
    }

    #[inline(always)]
    fn evaluate<const JACOBIAN: bool>(&mut self) {
        // Identical stages are evaluated once.
        let alike = core::mem::take(&mut self.identical_stages);
        let Self { points, f, linearization: linear, first_stage_only: first_only, .. } = self;
        if JACOBIAN {
            *first_only = false;
        }
        let call = Evaluate::<M, E, S, JACOBIAN> { points, f, jacobian: &mut linear.jacobian };
        if E::side_by_side(call).is_err() {
            for i in 0..if alike { 1 } else { S } {
                self.evaluate_stage::<JACOBIAN>(i);
            }
            if alike {
                spread(self.f.as_mut());
                self.first_stage_only |= JACOBIAN;
            }
        }
    }

    /// Evaluates the residual, and with `JACOBIAN` the Jacobian, at a stage.
    #[inline(always)]
    fn evaluate_stage<const JACOBIAN: bool>(&mut self, i: usize) {
        let Self { points, f, linearization: linear, .. } = self;
        let (point, f) = (points.stage_view(i), f.stage_view_mut(i));
        if JACOBIAN {
            M::residual_jacobian::<Strided<E, S>>(point, f, linear.jacobian.stage_view_mut(i));
        } else {
            M::residual::<Strided<E, S>>(point, f);
        }
    }
}

kernels! {
    /// Writes the mean of the stages to the first stage. (The variables from `inputs` on, except
    /// the time, are equal at all stages.)
    fn to_middle [E: Lanes, const S: usize] [E, S] <A>(points: &'k mut [[E; S]], inputs: usize) {
        let (own, rest) = points.split_at_mut(inputs.min(points.len()));
        let stage_weight = E::from_f64(const { 1.0 / S as f64 });
        for stages in own.iter_mut().chain(rest.last_mut()) {
            let mut total = stages[0];
            for &stage in &stages[1..] {
                total = total + stage;
            }
            stages[0] = stage_weight * total;
        }
    }
}

kernels! {
    /// Copies the values of the first stage to all stages.
    fn spread [E: Lanes, const S: usize] [E, S] <A>(cells: &'k mut [[E; S]]) {
        for cell in cells {
            *cell = [cell[0]; S];
        }
    }
}

/// Evaluates `f`, and with `JACOBIAN` its Jacobian, at all stages in one call.
struct Evaluate<'a, M: Dae, E: Lanes, const S: usize, const JACOBIAN: bool> {
    points: &'a StageArray<ArrayV<M, [E; S]>, E, S>,
    f: &'a mut StageArray<ArrayK<M, [E; S]>, E, S>,
    jacobian: &'a mut StageArray<M::Jacobian<[E; S]>, E, S>,
}

impl<M: Dae, E: Lanes, const S: usize, const JACOBIAN: bool> SideBySide<E, S>
    for Evaluate<'_, M, E, S, JACOBIAN>
{
    #[inline(always)]
    fn call<R: Lanes<Cell = [E; S]>>(self) {
        if JACOBIAN {
            M::residual_jacobian::<R>(self.points, self.f, self.jacobian);
        } else {
            M::residual::<R>(self.points, self.f);
        }
    }
}

/// See [`StageWorkspace::place_stages`] and [`StageWorkspace::place_unknowns`].
struct PlaceStages<'a, M: Plan, E: Plain, const S: usize, const UNKNOWNS: bool> {
    plan: M,
    points: &'a mut M::V<[E; S]>,
    jacobian: &'a M::Jacobian<[E; S]>,
    x: &'a M::X<E>,
    y: &'a M::K<[E; S]>,
    a: &'a [[E; S]; S],
    c: &'a [E; S],
    time: IntervalTimes<E>,
    step: usize,
}

impl<M: Plan, E: Lanes, const S: usize, const UNKNOWNS: bool> Kernel for PlaceStages<'_, M, E, S, UNKNOWNS> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { plan, points, jacobian, x, y, a, c, time, step } = self;
        let (points, x, y, jacobian) = (points.as_mut(), x.as_ref(), y.as_ref(), jacobian.as_ref());
        let (h, nx) = (time.step, x.len());
        if let Some(t) = points.last_mut() {
            let start = E::from_whole(step);
            for (t, &c) in t.iter_mut().zip(c) {
                *t = time.start + h * (start + c);
            }
        }
        if y.len() < nx || points.len() < nx + y.len() {
            return;
        }
        let minus_ha = minus_ha(a, h);
        // Kinematic states, mostly the first or the last unknowns, are not copied.
        let (first, end) = if UNKNOWNS { plan.facts().non_kinematic_range } else { (0, y.len()) };
        let states = first..nx.min(end).max(first);
        let (xdot, rest) = points.split_at_mut(nx);
        let (xi, rest) = rest.split_at_mut(nx);
        rest[..y.len() - nx].copy_from_slice(&y[nx..]);
        let own_x = x.get(states.clone()).in_bounds().unwrap_or_default().iter();
        let (own_xdot, own_xi) = (xdot.get_mut(states.clone()), xi.get_mut(states.clone()));
        let places = own_xdot.unwrap_or_default().iter_mut().zip(own_xi.unwrap_or_default());
        let own_y = y.get(states.clone()).in_bounds().unwrap_or_default();
        for ((((xdot, xi), &x), state), k) in places.zip(own_x).zip(states).zip(own_y) {
            if !(UNKNOWNS && (const { !has_no_kinematic_unknowns::<M>() }) && plan.kinematic(state).is_some())
            {
                (*xdot, *xi) = (*k, stage_values::<A, E, S>(x, &minus_ha, k));
            }
        }
        if UNKNOWNS {
            for_each_row::<A, _>(&mut Reconstruct { plan, points, jacobian, x, minus_ha });
        }
    }
}

/// Computes kinematic states and their derivatives from their velocities.
struct Reconstruct<'a, M, E, const S: usize> {
    plan: M,
    points: &'a mut [[E; S]],
    jacobian: &'a [[E; S]],
    x: &'a [E],
    minus_ha: Block<E, S>,
}

impl<M: Plan, E: Lanes, const S: usize> RowVisitor for Reconstruct<'_, M, E, S> {
    const ROWS: Option<usize> = StructureTable::Kinematic.known_row_count::<M>();
    #[inline(always)]
    fn row_count(&self) -> usize {
        StructureTable::Kinematic.row_count(self.plan.structure())
    }
    const INSTRUCTIONS: usize = 3 * S;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, state: usize) {
        let Some(k) = kinematic_derivative(self.plan, state, self.jacobian, self.points) else { return };
        let (Some(&x), Some(xdot)) = (self.x.get(state).in_bounds(), self.points.get_mut(state).in_bounds())
        else {
            return;
        };
        *xdot = k;
        if let Some(xi) = self.points.get_mut(self.plan.nx() + state).in_bounds() {
            *xi = stage_values::<A, E, S>(x, &self.minus_ha, &k);
        }
    }
}
