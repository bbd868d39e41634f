//! The steps of successive intervals, chosen or replayed.

use super::*;

impl<M: Dae, B: Engine<M, T>, T: Real> Piecewise<M, B, T> {
    /// Takes all steps, or prepares the frozen ones for other controls. The caller marks the result
    /// as valid.
    pub(super) fn prepare_steps(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
    ) -> Result<(), Error> {
        self.solved = false;
        let count = ends.len();
        if controls.len() != count || count == 0 {
            return Err(Error::Intervals { controls: controls.len(), ends: count });
        }
        self.statistics = AdaptiveStatistics::default();
        self.integrator.allocate_derivatives()?;
        check_model_input::<M, T>(Argument::X0, x0.as_slice())?;
        check_input(Argument::T, ends)?;
        let start = self.integrator.start_time;
        let last = ends.last().copied().unwrap_or(start);
        let mut before = start;
        for (index, (u, end)) in controls.iter().zip(ends).enumerate() {
            check_model_input::<M, T>(Argument::U, u.as_slice())?;
            if !is_inside_interval(*end, before, last) {
                let (t, before, end) = (end.to_f64(), before.to_f64(), last.to_f64());
                return Err(Error::Unordered { index, t, before, end });
            }
            before = *end;
        }
        if self.frozen.is_some() {
            return self.check_frozen(start, controls, ends);
        }
        self.interval_count = 0;
        while self.segments.len() < count {
            push_segment(&mut self.segments)?;
        }
        let given = self.integrator.workspace.start_guess;
        let result = self.choose_steps(x0, controls, ends);
        self.integrator.workspace.start_guess = given;
        self.integrator.start_time = start;
        result?;
        self.interval_count = count;
        Ok(())
    }

    fn choose_steps(
        &mut self,
        x0: &VectorX<M, T>,
        controls: &[VectorU<M, T>],
        ends: &[T],
    ) -> Result<(), Error> {
        let Self { integrator, segments, statistics, nominal, .. } = self;
        let (nx, mut x) = (M::Shape::NX, *x0);
        for (k, ((segment, u), end)) in segments.iter_mut().zip(controls).zip(ends).enumerate() {
            let span = Span { start: integrator.start_time, end: *end };
            (segment.x, segment.u, segment.span, segment.start_guess) =
                (x, *u, span, integrator.workspace.start_guess);
            segment.steps_were_chosen = true;
            // Each interval has a tape of its own, which later calls reuse.
            core::mem::swap(&mut integrator.tape, &mut segment.tape);
            let result = integrator.run_to(&x, u, *end, true, |_, _| Ok(()));
            core::mem::swap(&mut integrator.tape, &mut segment.tape);
            statistics.add(&integrator.statistics);
            result?;
            x = integrator.workspace.result.x;
            if k == 0 {
                *nominal = integrator.workspace.result;
            }
            // The next interval continues this solution, if there are several.
            let point = integrator.workspace.point.as_ref();
            let ends = point[..nx].iter().chain(&point[2 * nx..]);
            for (given, end) in integrator.workspace.start_guess.as_mut().iter_mut().zip(ends) {
                *given = *end;
            }
            integrator.start_time = *end;
        }
        (nominal.x, nominal.z) = (integrator.workspace.result.x, integrator.workspace.result.z);
        Ok(())
    }

    fn check_frozen(&mut self, start: T, controls: &[VectorU<M, T>], ends: &[T]) -> Result<(), Error> {
        let segments = self.segments.get_mut(..self.interval_count).unwrap_or_default();
        let mut before = start;
        for (segment, end) in segments.iter().zip(ends) {
            segment.span.check_same(before, *end)?;
            before = *end;
        }
        if segments.len() != ends.len() {
            return Err(Error::Intervals { controls: segments.len(), ends: ends.len() });
        }
        for (segment, u) in segments.iter_mut().zip(controls) {
            segment.u = *u;
        }
        Ok(())
    }

    /// Replays all steps, solved to rounding.
    pub(super) fn replay_steps(
        &mut self,
        x0: &VectorX<M, T>,
        mut integrand: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        reset_integrand(&mut integrand);
        let Self { integrator, segments, interval_count: count, nominal, .. } = self;
        let mut x = *x0;
        for (k, segment) in segments.iter_mut().enumerate().take(*count) {
            segment.x = x;
            let (mut frozen, state, ..) = segment.load(integrator)?;
            let mut part = chain_rule_integrand(&mut integrand, None, false);
            frozen.solve::<B>(state, &x, dyn_integrand(&mut part))?;
            x = integrator.workspace.result.x;
            collect_end(nominal, &integrator.workspace.result, k);
        }
        finish_integrand(&mut integrand)
    }

    /// Replays all steps with derivatives and the data of second-order ones; with an integrand and
    /// its sums, or without.
    pub(super) fn forward_sweep(
        &mut self,
        x0: &VectorX<M, T>,
        second: bool,
        mut along: OptionalIntegrand<'_, '_, M, T>,
        mut sums: Option<&mut QuadratureSums<M, T>>,
    ) -> Result<PiecewiseForward<M, T>, Error> {
        reset_integrand(&mut along);
        let Self { integrator, segments, interval_count: count, nominal, sensitivities: [v, next], .. } =
            self;
        let at = DirectionLayout::<M> { intervals: *count, model: core::marker::PhantomData };
        let (nx, width) = (M::Shape::NX, at.column_count());
        refill_vec(v, nx * width, T::ZERO)?;
        refill_vec(next, nx.max(M::Shape::NZ) * width, T::ZERO)?;
        for x in 0..nx {
            v[x * width + x] = T::ONE;
        }
        let mut result = PiecewiseForward {
            nominal: *nominal,
            dx_dx0: Zeroable::zeroed(),
            dx_du: filled_vec(*count, MatrixXU::<M, T>::zeroed())?,
            dx_dp: Zeroable::zeroed(),
            dz_dx0: Zeroable::zeroed(),
            dz_du: filled_vec(*count, MatrixZU::<M, T>::zeroed())?,
            dz_dp: Zeroable::zeroed(),
        };
        let mut x = *x0;
        for (k, segment) in segments.iter_mut().enumerate().take(*count) {
            segment.x = x;
            if second {
                segment.start_sensitivities.clone_from(v);
            }
            let mut history = core::mem::take(&mut segment.step_sensitivities);
            history.clear();
            let (mut frozen, state, memory, _) = segment.load(integrator)?;
            let mut part = chain_rule_integrand(&mut along, None, second);
            frozen.forward::<B>(
                state,
                &x,
                memory,
                second.then_some(&mut history),
                dyn_integrand(&mut part),
            )?;
            if let (Some(sums), Some(integrand)) = (&mut sums, &mut along) {
                sums.add_interval(k, &mut **integrand, v);
            }
            let local = &memory.hessian.first.forward;
            x = local.nominal.x;
            collect_end(nominal, &local.nominal, k);
            if k + 1 == *count {
                at.apply_chain_rule(k, &local.dz_dx0, &local.dz_du, &local.dz_dp, v, next);
                check_output(&next[..M::Shape::NZ * width], 0)?;
                fill_matrix(&mut result.dz_dx0, |r, c| next[r * width + c]);
                fill_matrix(&mut result.dz_dp, |r, c| next[r * width + at.parameter_column() + c]);
                for (k, du) in result.dz_du.iter_mut().enumerate() {
                    fill_matrix(du, |r, c| next[r * width + at.control_column(k) + c]);
                }
            }
            at.apply_chain_rule(k, &local.dx_dx0, &local.dx_du, &local.dx_dp, v, next);
            v.copy_from_slice(&next[..nx * width]);
            segment.step_sensitivities = history;
        }
        fill_matrix(&mut result.dx_dx0, |r, c| v[r * width + c]);
        fill_matrix(&mut result.dx_dp, |r, c| v[r * width + at.parameter_column() + c]);
        for (k, du) in result.dx_du.iter_mut().enumerate() {
            fill_matrix(du, |r, c| v[r * width + at.control_column(k) + c]);
        }
        result.nominal = *nominal;
        finish_integrand(&mut along)?;
        sums.map_or(Ok(()), |sums| sums.check())?;
        check_output(v, 0)?;
        Ok(result)
    }
}
