//! The steps of the intervals one after the other, chosen or taken again.

use super::*;

impl<M: Dae, B: Engine<M, T>, T: Real> Piecewise<M, B, T> {
    /// Takes all steps, or prepares those that are kept for other controls. There is a result as
    /// soon as the caller says so.
    pub(super) fn steps(
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
        self.integrator.reserve()?;
        check_named::<M, T>(Argument::X0, x0.as_slice())?;
        check_input(Argument::T, ends)?;
        let start = self.integrator.start;
        let last = ends.last().copied().unwrap_or(start);
        let mut before = start;
        for (index, (u, end)) in controls.iter().zip(ends).enumerate() {
            check_named::<M, T>(Argument::U, u.as_slice())?;
            if !inside(*end, before, last) {
                let (t, before, end) = (end.to_f64(), before.to_f64(), last.to_f64());
                return Err(Error::Unordered { index, t, before, end });
            }
            before = *end;
        }
        if self.frozen.is_some() {
            return self.check_frozen(start, controls, ends);
        }
        self.count = 0;
        while self.segments.len() < count {
            add(&mut self.segments)?;
        }
        let given = self.integrator.base.given;
        let result = self.take(x0, controls, ends);
        self.integrator.base.given = given;
        self.integrator.start = start;
        result?;
        self.count = count;
        Ok(())
    }

    fn take(&mut self, x0: &VectorX<M, T>, controls: &[VectorU<M, T>], ends: &[T]) -> Result<(), Error> {
        let Self { integrator, segments, statistics, nominal, .. } = self;
        let (nx, mut x) = (M::Shape::NX, *x0);
        for (k, ((segment, u), end)) in segments.iter_mut().zip(controls).zip(ends).enumerate() {
            let span = Span { start: integrator.start, end: *end };
            (segment.x, segment.u, segment.span, segment.given) = (x, *u, span, integrator.base.given);
            segment.chosen = true;
            // Each interval has a tape of its own, which in later calls is long enough.
            core::mem::swap(&mut integrator.tape, &mut segment.tape);
            let result = integrator.run(&x, u, *end, true, |_, _| Ok(()));
            core::mem::swap(&mut integrator.tape, &mut segment.tape);
            statistics.add(&integrator.statistics);
            result?;
            x = integrator.base.result.x;
            if k == 0 {
                *nominal = integrator.base.result;
            }
            // Where there are several solutions, the next interval goes on with this one.
            let point = integrator.base.point.as_ref();
            let ends = point[..nx].iter().chain(&point[2 * nx..]);
            for (given, end) in integrator.base.given.as_mut().iter_mut().zip(ends) {
                *given = *end;
            }
            integrator.start = *end;
        }
        (nominal.x, nominal.z) = (integrator.base.result.x, integrator.base.result.z);
        Ok(())
    }

    fn check_frozen(&mut self, start: T, controls: &[VectorU<M, T>], ends: &[T]) -> Result<(), Error> {
        let segments = self.segments.get_mut(..self.count).unwrap_or_default();
        let mut before = start;
        for (segment, end) in segments.iter().zip(ends) {
            segment.span.check_is(before, *end)?;
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

    /// All steps again, to rounding.
    pub(super) fn replay(
        &mut self,
        x0: &VectorX<M, T>,
        mut along: OptionalIntegrand<'_, '_, M, T>,
    ) -> Result<(), Error> {
        reset_integrand(&mut along);
        let Self { integrator, segments, count, nominal, .. } = self;
        let mut x = *x0;
        for (k, segment) in segments.iter_mut().enumerate().take(*count) {
            segment.x = x;
            let (mut frozen, state, ..) = segment.open(integrator)?;
            let mut part = chain(&mut along, None, false);
            frozen.solve::<B>(state, &x, dynamic(&mut part))?;
            x = integrator.base.result.x;
            collect(nominal, &integrator.base.result, k);
        }
        finish_integrand(&mut along)
    }

    /// The same with derivatives, and what those of second order need; with an integrand and what
    /// it adds up, or without.
    pub(super) fn sweep(
        &mut self,
        x0: &VectorX<M, T>,
        second: bool,
        mut along: OptionalIntegrand<'_, '_, M, T>,
        mut sums: Option<&mut Sums<M, T>>,
    ) -> Result<PiecewiseForward<M, T>, Error> {
        reset_integrand(&mut along);
        let Self { integrator, segments, count, nominal, v: [v, next], .. } = self;
        let at = Columns::<M> { intervals: *count, model: core::marker::PhantomData };
        let (nx, width) = (M::Shape::NX, at.all());
        refill(v, nx * width, T::ZERO)?;
        refill(next, nx.max(M::Shape::NZ) * width, T::ZERO)?;
        for x in 0..nx {
            v[x * width + x] = T::ONE;
        }
        let mut result = PiecewiseForward {
            nominal: *nominal,
            dx_dx0: Zeroable::zeroed(),
            dx_du: filled(*count, MatrixXU::<M, T>::zeroed())?,
            dx_dp: Zeroable::zeroed(),
            dz_dx0: Zeroable::zeroed(),
            dz_du: filled(*count, MatrixZU::<M, T>::zeroed())?,
            dz_dp: Zeroable::zeroed(),
        };
        let mut x = *x0;
        for (k, segment) in segments.iter_mut().enumerate().take(*count) {
            segment.x = x;
            if second {
                segment.v.clone_from(v);
            }
            let mut history = core::mem::take(&mut segment.history);
            history.clear();
            let (mut frozen, state, memory, _) = segment.open(integrator)?;
            let mut part = chain(&mut along, None, second);
            frozen.forward::<B>(state, &x, memory, second.then_some(&mut history), dynamic(&mut part))?;
            if let (Some(sums), Some(integrand)) = (&mut sums, &mut along) {
                sums.add(k, &mut **integrand, v);
            }
            let local = &memory.hessian.first.forward;
            x = local.nominal.x;
            collect(nominal, &local.nominal, k);
            if k + 1 == *count {
                at.chain(k, &local.dz_dx0, &local.dz_du, &local.dz_dp, v, next);
                check_output(&next[..M::Shape::NZ * width], 0)?;
                fill(&mut result.dz_dx0, |r, c| next[r * width + c]);
                fill(&mut result.dz_dp, |r, c| next[r * width + at.p() + c]);
                for (k, du) in result.dz_du.iter_mut().enumerate() {
                    fill(du, |r, c| next[r * width + at.u(k) + c]);
                }
            }
            at.chain(k, &local.dx_dx0, &local.dx_du, &local.dx_dp, v, next);
            v.copy_from_slice(&next[..nx * width]);
            segment.history = history;
        }
        fill(&mut result.dx_dx0, |r, c| v[r * width + c]);
        fill(&mut result.dx_dp, |r, c| v[r * width + at.p() + c]);
        for (k, du) in result.dx_du.iter_mut().enumerate() {
            fill(du, |r, c| v[r * width + at.u(k) + c]);
        }
        result.nominal = *nominal;
        finish_integrand(&mut along)?;
        sums.map_or(Ok(()), |sums| sums.check())?;
        check_output(v, 0)?;
        Ok(result)
    }
}
