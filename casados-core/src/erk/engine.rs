//! The engine of explicit methods: for scalars one interval, for SIMD registers several intervals.

use super::adjoint::{AdjointProblem, AdjointSweep, Multipliers};
use super::forward::{Variation, copy_to_columns};
use super::forward_sweep::ForwardSweep;
use super::hessian::HessianSum;
use super::non_finite::NonFiniteLanes;
use super::scheme::{Grid, Scheme};
use super::stage_integrand::{NoIntegrand, StageIntegrand};
use super::step::{EvaluationCounts, StepRecord, StepWorkspace};
use crate::error::Error;
use crate::linalg::{kernels, run_plain};
use crate::memory::{Memory, WithForward, WithHessian};
use crate::model::{ArrayW, ArrayX, Ode};
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::scalar::{Field, Lanes};
use crate::shape::{Array, InBounds, Matrix, Shape};
use crate::statistics::Statistics;
use crate::tableau::Tableau;
use bytemuck::Zeroable;

/// The result of a call, and the lanes in which it is valid: those without a non-finite value.
pub(crate) type MaskedResult<'a, E, R> = Result<(<E as Field>::Mask, &'a R), Error>;

/// The workspace after a call with derivatives, and the memory of the derivatives.
type Differentiated<'a, M, E, const S: usize> =
    (&'a mut StepWorkspace<M, E, S>, &'a mut ForwardMemory<M, E, S>);

/// The method and its memory.
pub(crate) struct Engine<M: Ode, E: Lanes, const S: usize, W: Memory> {
    pub(super) scheme: Scheme<M, E, S>,
    pub(super) counts: EvaluationCounts,
    pub(super) workspace: W::Nominal<StepWorkspace<M, E, S>>,
    pub(super) adjoint: W::Nominal<AdjointMemory<M, E, S>>,
    pub(super) trajectory: W::Tape<StepRecord<M, E, S>>,
    pub(super) forward: W::Forward<ForwardMemory<M, E, S>>,
    pub(super) hessian: W::Hessian<HessianMemory<M, E>>,
    pub(super) multipliers: W::HessianTape<Multipliers<M, E, S>>,
}

/// Memory of the adjoint of one seed.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct AdjointMemory<M: Ode, E: Lanes, const S: usize> {
    pub(super) sweep: AdjointSweep<M, E, [E; 1], S>,
    pub(super) result: Adjoint<M, E>,
}

/// Memory of first-order derivatives, for as many columns as there are elements of `w`.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct ForwardMemory<M: Ode, E: Lanes, const S: usize> {
    pub(super) sweep: AdjointSweep<M, E, ArrayW<M, E>, S>,
    pub(super) result: ForwardAdjoint<M, E>,
}

/// Memory of second-order derivatives, besides that of the first order.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct HessianMemory<M: Ode, E: Lanes> {
    pub(super) curvature: HessianSum<M, E>,
    pub(super) result: Hessian<M, E>,
}

impl<M: Ode, E: Lanes, const S: usize, W: Memory> Engine<M, E, S, W> {
    pub fn new(tableau: &Tableau<S>) -> Self {
        Self::with_scheme(Scheme::new(tableau))
    }

    /// Returns an engine with empty memory.
    pub(super) fn with_scheme(scheme: Scheme<M, E, S>) -> Self {
        Self {
            scheme,
            counts: EvaluationCounts::default(),
            workspace: Default::default(),
            adjoint: Default::default(),
            trajectory: Default::default(),
            forward: Default::default(),
            hessian: Default::default(),
            multipliers: Default::default(),
        }
    }

    /// Begins a call. Returns the initial state and the variables of the model, to be written.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn begin(&mut self) -> Result<[&mut [E]; 2], Error> {
        let StepWorkspace { point, x, .. } = W::nominal(&mut self.workspace)?;
        self.counts = EvaluationCounts::default();
        point.counts = EvaluationCounts::default();
        point.non_finite.reset();
        Ok([x.as_mut(), point.variables_mut()])
    }

    /// Returns the statistics of the last call.
    pub fn statistics(&self) -> Statistics {
        let EvaluationCounts { steps, residuals, jacobians } = self.counts;
        Statistics { steps, residuals, jacobians, ..Statistics::default() }
    }

    pub fn solve(
        &mut self,
        grid: &Grid<E>,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> MaskedResult<'_, E, Nominal<M, E>> {
        integrand.reset();
        let workspace = W::nominal(&mut self.workspace)?;
        let outcome = workspace.integrate(&self.scheme, grid, integrand);
        self.counts = workspace.point.counts;
        outcome?;
        integrand.finish()?;
        let StepWorkspace { point, x, result, .. } = workspace;
        result.x.as_mut_slice().copy_from_slice(x.as_ref());
        Ok((point.non_finite.finite_lanes(), result))
    }

    pub fn forward(
        &mut self,
        grid: &Grid<E>,
        forward_sweep: &mut impl ForwardSweep<M, E, S>,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> MaskedResult<'_, E, Forward<M, E>>
    where
        W: WithForward,
    {
        let (workspace, memory) = self.differentiate(grid, forward_sweep, integrand)?;
        Ok((workspace.point.non_finite.finite_lanes(), &memory.result.forward))
    }

    pub fn forward_adjoint(
        &mut self,
        grid: &Grid<E>,
        lambda: &[E],
        forward_sweep: &mut impl ForwardSweep<M, E, S>,
    ) -> MaskedResult<'_, E, ForwardAdjoint<M, E>>
    where
        W: WithForward,
    {
        let (base, ForwardMemory { sweep, result }) =
            self.differentiate(grid, forward_sweep, &mut NoIntegrand)?;
        // The Jacobian is available: the gradient is a product with it.
        let AdjointSweep { forward, lambda: gradient, .. } = sweep;
        weigh::<M, E, _>(&forward.dx, lambda, &mut *gradient);
        let ForwardAdjoint { grad_x0, grad_u, grad_p, .. } = &mut *result;
        let to = [grad_x0.as_mut_slice(), grad_u.as_mut_slice(), grad_p.as_mut_slice()];
        write_gradient(gradient.as_ref(), to, grid.steps - 1, &mut base.point.non_finite)?;
        Ok((base.point.non_finite.finite_lanes(), result))
    }

    /// Computes the derivatives and writes them to the result.
    fn differentiate(
        &mut self,
        grid: &Grid<E>,
        forward_sweep: &mut impl ForwardSweep<M, E, S>,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> Result<Differentiated<'_, M, E, S>, Error>
    where
        W: WithForward,
    {
        integrand.reset();
        let workspace = W::nominal(&mut self.workspace)?;
        let memory = W::forward(&mut self.forward)?;
        let (ForwardMemory { sweep, result }, scheme) = (&mut *memory, &self.scheme);
        let outcome = forward_sweep.integrate(
            scheme,
            grid,
            workspace,
            &mut sweep.forward,
            integrand.is_present(),
            |point, dxi, at| {
                integrand.add_forward(point.variables(), dxi, [grid.h, scheme.b[at.stage]], false, at)
            },
        );
        self.counts = workspace.point.counts;
        outcome?;
        integrand.finish()?;
        write_forward(grid, workspace, &sweep.forward, &mut result.forward)?;
        Ok((workspace, memory))
    }

    pub fn adjoint(
        &mut self,
        grid: &Grid<E>,
        lambda: &[E],
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> MaskedResult<'_, E, Adjoint<M, E>> {
        integrand.reset();
        let workspace = W::nominal(&mut self.workspace)?;
        let AdjointMemory { sweep, result } = W::nominal(&mut self.adjoint)?;
        let records = W::tape(&mut self.trajectory, grid.steps)?;
        sweep.set_seeds(1, |x, _| lambda[x]);
        let problem = AdjointProblem { scheme: &self.scheme, grid, columns: 1 };
        let outcome = workspace.record_steps(&self.scheme, grid, records, integrand).and_then(|()| {
            sweep.integrate_backwards(problem, &mut workspace.point, records, None, integrand)
        });
        self.counts = workspace.point.counts;
        outcome?;
        integrand.finish()?;
        let Adjoint { nominal, grad_x0, grad_u, grad_p } = &mut *result;
        let to = [grad_x0.as_mut_slice(), grad_u.as_mut_slice(), grad_p.as_mut_slice()];
        write_gradient(sweep.lambda.as_ref(), to, 0, &mut workspace.point.non_finite)?;
        write_state(workspace, nominal);
        Ok((workspace.point.non_finite.finite_lanes(), result))
    }

    pub fn hessian(
        &mut self,
        grid: &Grid<E>,
        lambda: &[E],
        forward_sweep: &mut impl ForwardSweep<M, E, S>,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> MaskedResult<'_, E, Hessian<M, E>>
    where
        W: WithHessian,
    {
        integrand.reset();
        let workspace = W::nominal(&mut self.workspace)?;
        let sweep = &mut W::nominal(&mut self.adjoint)?.sweep;
        let variation = &mut W::forward(&mut self.forward)?.sweep.forward;
        let HessianMemory { curvature, result } = W::hessian(&mut self.hessian)?;
        let records = W::tape(&mut self.trajectory, grid.steps)?;
        let multipliers = W::hessian_tape(&mut self.multipliers, grid.steps)?;
        let scheme = &self.scheme;

        // The adjoint sweep comes first, so that the forward sweep knows the multipliers of each
        // stage and stores no derivatives of stages.
        let start = workspace.x;
        sweep.set_seeds(1, |x, _| lambda[x]);
        curvature.reset();
        let mut outcome = || {
            workspace.record_steps(scheme, grid, records, &mut NoIntegrand)?;
            let problem = AdjointProblem { scheme, grid, columns: 1 };
            sweep.integrate_backwards(
                problem,
                &mut workspace.point,
                records,
                Some(multipliers),
                integrand,
            )?;
            workspace.x = start;
            workspace.point.counts.steps = 0;
            forward_sweep.integrate(scheme, grid, workspace, variation, true, |point, dxi, at| {
                let multipliers = multipliers.get(at.step).and_then(|of_stages| of_stages.get(at.stage));
                let (Some(mu), Some(&b)) = (multipliers, scheme.b.get(at.stage).in_bounds()) else {
                    return Ok(());
                };
                integrand.add_forward(point.variables(), dxi, [grid.h, b], true, at)?;
                curvature.add_stage(scheme, point, mu, dxi, at)
            })
        };
        let outcome = outcome();
        self.counts = workspace.point.counts;
        outcome?;
        integrand.finish()?;

        let ForwardAdjoint { forward, grad_x0, grad_u, grad_p } = &mut result.first;
        write_forward(grid, workspace, variation, forward)?;
        let to = [grad_x0.as_mut_slice(), grad_u.as_mut_slice(), grad_p.as_mut_slice()];
        write_gradient(sweep.lambda.as_ref(), to, 0, &mut workspace.point.non_finite)?;
        if let Some(second) = integrand.hessian_sum() {
            curvature.add_lower(second);
        }
        write_hessian(curvature, result, &mut workspace.point.non_finite)?;
        Ok((workspace.point.non_finite.finite_lanes(), result))
    }
}

kernels! { by run_plain;
    /// The gradient `λᵀ dx`, in the first column of each direction.
    fn weigh [M: Ode, E: Lanes, R: Array<E>] [M, E, R] <A>(
        dx: &'k ArrayX<M, ArrayW<M, E>>,
        lambda: &'k [E],
        gradient: &'k mut ArrayW<M, R>,
    ) {
        for (w, gradient) in gradient.as_mut().iter_mut().enumerate() {
            let mut sum = E::zeroed();
            for (row, &lambda) in dx.as_ref().iter().zip(lambda) {
                sum = A::add(sum, lambda, row[w]);
            }
            gradient.as_mut()[0] = sum;
        }
    }
}

pub(super) fn write_state<M: Ode, E: Lanes, const S: usize>(
    base: &StepWorkspace<M, E, S>,
    result: &mut Nominal<M, E>,
) {
    result.x.as_mut_slice().copy_from_slice(base.x.as_ref());
}

fn write_forward<M: Ode, E: Lanes, const S: usize>(
    grid: &Grid<E>,
    base: &mut StepWorkspace<M, E, S>,
    variation: &Variation<M, E, ArrayW<M, E>, S>,
    result: &mut Forward<M, E>,
) -> Result<(), Error> {
    let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
    let (dx, step, non_finite) = (variation.dx.as_ref(), grid.steps - 1, &mut base.point.non_finite);
    copy_to_columns(dx, 0..nx, &mut result.dx_dx0, 0, step, non_finite)?;
    copy_to_columns(dx, nx..nx + nu, &mut result.dx_du, 0, step, non_finite)?;
    copy_to_columns(dx, nx + nu..nw, &mut result.dx_dp, 0, step, non_finite)?;
    write_state(base, &mut result.nominal);
    Ok(())
}

/// Writes the first column of the rows to the parts of a gradient.
fn write_gradient<E: Lanes, R: Array<E>>(
    rows: &[R],
    blocks: [&mut [E]; 3],
    step: usize,
    non_finite: &mut NonFiniteLanes<E>,
) -> Result<(), Error> {
    let mut begin = 0;
    for part in blocks {
        for (to, row) in part.iter_mut().zip(rows.iter().skip(begin)) {
            *to = row.as_ref()[0];
        }
        non_finite.check(part, |index, _| Error::Overflow { step, index: begin + index })?;
        begin += part.len();
    }
    Ok(())
}

fn write_hessian<M: Ode, E: Lanes>(
    curvature: &mut HessianSum<M, E>,
    result: &mut Hessian<M, E>,
    non_finite: &mut NonFiniteLanes<E>,
) -> Result<(), Error> {
    curvature.mirror();
    let (nx, nu, nw) = (M::Shape::NX, M::Shape::NU, M::Shape::NW);
    let rows = curvature.sum.as_ref();
    let (x, u, p) = (0..nx, nx..nx + nu, nx + nu..nw);
    copy_to_columns(&rows[x.clone()], x.clone(), &mut result.h_xx, 0, 0, non_finite)?;
    copy_to_columns(&rows[x.clone()], u.clone(), &mut result.h_xu, 0, 0, non_finite)?;
    copy_to_columns(&rows[u.clone()], u.clone(), &mut result.h_uu, 0, 0, non_finite)?;
    copy_to_columns(&rows[x], p.clone(), &mut result.h_xp, 0, 0, non_finite)?;
    copy_to_columns(&rows[u], p.clone(), &mut result.h_up, 0, 0, non_finite)?;
    copy_to_columns(&rows[p.clone()], p, &mut result.h_pp, 0, 0, non_finite)
}
