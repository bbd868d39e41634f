//! Groups of intervals for explicit methods.

use super::intervals::{Interval, vector};
use super::lanes::{MAX_LANES, MaskedResult};
use super::single::{self, Single, Standard, gather};
use crate::erk::{ColumnPanels, Engine, Grid, Integrator, NoIntegrand};
use crate::error::Error;
use crate::memory::{Heap, Memory};
use crate::model::{ArrayX, Ode};
use crate::options::Options;
use crate::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use crate::scalar::{Lanes, Real};
use crate::shape::{Matrix, Shape, copy_into};
use crate::statistics::Statistics;
use crate::tableau::{Method, Tableau};
use core::slice::{from_mut, from_ref};

impl<M: Ode, B, const S: usize, T: Real> Single for Integrator<M, B, S, T, Heap> {
    type Method = B;
    type Tableau = Tableau<S>;
    type Stages = ();
    type Group<E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>> = Group<M, E, S>;

    const IS_ITERATIVE: bool = false;
    const SUPPORTS_GROUPS: bool = true;

    fn of(options: &Options, tableau: &Tableau<S>) -> Result<Self, Error> {
        Self::build(*options, tableau)
    }

    fn working_set<E: Lanes>(_: &Options, columns: usize) -> usize {
        // `dx`, `dξ` and the `dk` of all stages.
        size_of::<ArrayX<M, E>>() * (S + 2) * columns.max(1)
    }

    fn give(&mut self, _: [&[T]; 2]) -> Result<(), Error> {
        Ok(())
    }

    fn start(&mut self, _: Option<&[()]>, _: bool) -> Result<(), Error> {
        Ok(())
    }

    fn stages(&mut self, _: &mut [()]) -> Result<(), Error> {
        Ok(())
    }

    fn forward_to(&mut self, at: &Interval<'_, M, T>, to: &mut Forward<M, T>) -> Result<(), Error> {
        copy_into(to, self.forward(at.x0, &vector(at.u), at.h)?);
        Ok(())
    }

    fn forward_adjoint_to(
        &mut self,
        at: &Interval<'_, M, T>,
        to: &mut ForwardAdjoint<M, T>,
    ) -> Result<(), Error> {
        copy_into(to, self.forward_adjoint(at.x0, &vector(at.u), at.h, &vector(at.lambda))?);
        Ok(())
    }

    fn hessian_to(&mut self, at: &Interval<'_, M, T>, to: &mut Hessian<M, T>) -> Result<(), Error> {
        copy_into(to, self.hessian(at.x0, &vector(at.u), at.h, &vector(at.lambda))?);
        Ok(())
    }
}

impl<M: Ode, B: Method<S>, const S: usize, T: Real> Standard for Integrator<M, B, S, T, Heap> {
    const TABLEAU: Tableau<S> = {
        assert!(B::TABLEAU.is_explicit(), "the tableau of this method is not explicit");
        B::TABLEAU
    };
}

/// A group of intervals and its memory.
pub struct Group<M: Ode, E: Lanes, const S: usize> {
    engine: Engine<M, E, S, Heap>,
    grid: Grid<E>,
    lambda: <Heap as Memory>::Nominal<ArrayX<M, E>>,
    panels: <Heap as Memory>::Nominal<ColumnPanels<M, E, S>>,
}

impl<M: Ode, E: Lanes, const S: usize> Group<M, E, S> {
    /// Runs a call of the engine.
    fn run_engine<'e, R>(
        &'e mut self,
        call: impl FnOnce(&'e mut Engine<M, E, S, Heap>, &Grid<E>, &[E]) -> MaskedResult<'e, E, R>,
    ) -> MaskedResult<'e, E, R> {
        let Self { engine, grid, lambda, .. } = self;
        call(engine, grid, <Heap>::nominal(lambda)?.as_ref())
    }

    /// Runs a call of the engine with derivatives in all directions.
    fn run_engine_with_panels<'e, R>(
        &'e mut self,
        call: impl FnOnce(
            &'e mut Engine<M, E, S, Heap>,
            &Grid<E>,
            &[E],
            &mut ColumnPanels<M, E, S>,
        ) -> MaskedResult<'e, E, R>,
    ) -> MaskedResult<'e, E, R> {
        let Self { engine, grid, lambda, panels } = self;
        call(engine, grid, <Heap>::nominal(lambda)?.as_ref(), <Heap>::nominal(panels)?)
    }
}

impl<M: Ode, B, T: Real, E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>, const S: usize>
    single::Group<Integrator<M, B, S, T, Heap>, E> for Group<M, E, S>
{
    fn new(options: &Options, tableau: &Tableau<S>) -> Self {
        let Options { steps, compensated, .. } = *options;
        let grid = Grid { start_time: E::zeroed(), h: E::zeroed(), steps, compensated };
        let (lambda, panels) = (Default::default(), Default::default());
        Self { engine: Engine::new(tableau), grid, lambda, panels }
    }

    fn load_intervals(
        &mut self,
        intervals: &[&Interval<'_, M, T>],
        _: Option<[&[T]; 2]>,
        _: Option<&[&[()]; MAX_LANES]>,
        _: bool,
    ) -> Result<(), Error> {
        let Self { engine, grid, lambda, .. } = self;
        let [x, variables] = engine.begin()?;
        gather(intervals, x, |interval| interval.x0.as_slice());
        let (u, p) = variables[2 * M::Shape::NX..].split_at_mut(M::Shape::NU);
        gather(intervals, u, |interval| interval.u);
        gather(intervals, &mut p[..M::Shape::NP], |interval| interval.p);
        gather(intervals, from_mut(&mut grid.start_time), |interval| from_ref(&interval.t0));
        gather(intervals, from_mut(&mut grid.h), |interval| from_ref(&interval.h));
        grid.h = grid.h / E::from_whole(grid.steps);
        gather(intervals, <Heap>::nominal(lambda)?.as_mut(), |interval| interval.lambda);
        Ok(())
    }

    fn copy_stages(&mut self, _: usize, _: &mut [()]) -> Result<(), Error> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        self.engine.statistics()
    }

    fn solve(&mut self) -> MaskedResult<'_, E, Nominal<M, E>> {
        self.run_engine(|engine, grid, _| engine.solve(grid, &mut NoIntegrand))
    }

    fn forward(&mut self) -> MaskedResult<'_, E, Forward<M, E>> {
        self.run_engine_with_panels(|engine, grid, _, panels| engine.forward(grid, panels, &mut NoIntegrand))
    }

    fn adjoint(&mut self) -> MaskedResult<'_, E, Adjoint<M, E>> {
        self.run_engine(|engine, grid, lambda| engine.adjoint(grid, lambda, &mut NoIntegrand))
    }

    fn forward_adjoint(&mut self) -> MaskedResult<'_, E, ForwardAdjoint<M, E>> {
        self.run_engine_with_panels(|engine, grid, lambda, panels| {
            engine.forward_adjoint(grid, lambda, panels)
        })
    }

    fn hessian(&mut self) -> MaskedResult<'_, E, Hessian<M, E>> {
        self.run_engine_with_panels(|engine, grid, lambda, panels| {
            engine.hessian(grid, lambda, panels, &mut NoIntegrand)
        })
    }
}
