//! Simulation of the states with the controls of a point.

use crate::integrator::Integrator;
use crate::model::Dae;
use crate::ocp::dynamics::interval_setup::{IntervalSetup, in_interval};
use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
use crate::ocp::formulation::functions::dynamics::{Dynamics, vector};
use crate::ocp::formulation::instance::data::{Layout, split_data, stage_variable_count};
use crate::ocp::formulation::instance::{Ocp, interval_nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::ocp::formulation::program::Program;
use crate::ocp::nlp::advanced::StartOptions;
use crate::ocp::nlp::degenerate_start::PerturbedVariables;
use crate::qp::{Solution, StageDims, StageOffsetsIter, copy_common, padded_len, part_mut};
use crate::scalar::Real;
use crate::shape::{Matrix, Shape};
use bytemuck::Zeroable;

/// The start of a second run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::ocp) enum RestartPoint {
    /// A simulation with the controls of the guess.
    Simulation,
    /// A simulation with perturbed controls, if the violations of the simulated guess are
    /// stationary but not minimal.
    PerturbedSimulation(StartOptions),
}

impl<P: Program<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Projects a guess onto its bounds, simulates its states, with perturbed controls if `start`
    /// requires it, and makes it the iterate; `guess` becomes the last iterate. Returns whether the
    /// simulation is finite; otherwise the iterate is unchanged.
    pub(in crate::ocp) fn simulate_guess(
        &mut self,
        guess: &mut Solution<T, D, M>,
        ends: &mut [T],
        start: RestartPoint,
    ) -> bool {
        core::mem::swap(&mut self.iterate, guess);
        self.clip_to_bounds();
        if let RestartPoint::PerturbedSimulation(options) = start {
            self.perturb_variables(PerturbedVariables::Controls, &options);
        }
        core::mem::swap(&mut self.iterate, guess);
        let has_values = self.close_gaps_by_simulation(guess, ends, &[], f64::INFINITY);
        if has_values {
            core::mem::swap(&mut self.iterate, guess);
            self.equalise_shared_controls();
            self.equalise_periodic_states();
        }
        has_values
    }

    /// Closes the gaps of a point: moves its states to the ends of the preceding intervals,
    /// repeatedly. Returns whether all values are finite and the states move by at most
    /// `max_displacement_ratio` times the initial gaps, in `units` if there are any.
    pub(in crate::ocp) fn close_gaps_by_simulation(
        &mut self,
        point: &mut Solution<T, D, M>,
        ends: &mut [T],
        units: &[T],
        max_displacement_ratio: f64,
    ) -> bool {
        self.algebraic_is_current = false;
        let (mut displacement, mut gaps) = (0.0, 0.0);
        for sweep in 0..=self.intervals() {
            if self.evaluate(point, ends).is_err() {
                return false;
            }
            let mut sweep_displacement = 0.0;
            let (v, mut remaining_ends) = (point.view_mut().v, &*ends);
            for place in StageOffsetsIter::<T>::new(self.qp().dims).skip(1) {
                let (ends, next) = remaining_ends.split_at_checked(place.nx).unwrap_or_default();
                remaining_ends = next;
                for (i, (x, &end)) in part_mut(v, place.v, place.nx).iter_mut().zip(ends).enumerate() {
                    let unit = units.get(place.row + i).copied().unwrap_or(T::ONE);
                    sweep_displacement += ((end - *x) / unit).abs().to_f64();
                    *x = end;
                }
            }
            if sweep == 0 {
                gaps = sweep_displacement;
            }
            displacement += sweep_displacement;
            if displacement > max_displacement_ratio * gaps || !displacement.is_finite() {
                return false;
            }
            if sweep_displacement == 0.0 {
                break;
            }
        }
        true
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Simulates the states of the guess with its controls: from the initial state if that is
    /// fixed, otherwise from the first state of the guess. The guess has no gaps then. First state
    /// and controls are projected onto their bounds before; states and parameters of later stages
    /// need no guess. All multipliers are set to zero.
    ///
    /// The integrator is that of the problem;
    /// [`guess_by_simulation_with`](Ocp::guess_by_simulation_with) uses another one.
    ///
    /// # Errors
    /// [`OcpError::Simulation`] if the simulation ends before the horizon; states up to that stage
    /// are those of the simulation then. [`OcpError::NoIntegrator`] for `Collocation`. The errors
    /// of [`Ocp::check`].
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{GeneralCost, Horizon, OcpError, Problem};
    /// use casados::prelude::*;
    ///
    /// /// x(t) = x₀ / (1 − x₀ t)
    /// #[ode]
    /// fn growth(x: f64) -> f64 { x * x }
    /// #[function]
    /// fn size(x: f64) -> f64 { x }
    ///
    /// let mut ocp = Problem::new(Irk::<Growth, Gauss<3>>::new(Options::default())?)
    ///     .terminal_cost(GeneralCost::<Size>::new())
    ///     .on(Horizon::uniform(10, 0.1))?;
    /// ocp.fix_initial_state(&[0.5])?.guess(&[0.0], &[])?.guess_by_simulation()?;
    /// assert!((ocp.stage(10)?.x[0] - 1.0).abs() < 1e-6);
    /// // From 1.5 there is no solution behind 0.67 s.
    /// ocp.fix_initial_state(&[1.5])?;
    /// let error = ocp.guess_by_simulation().err().ok_or("it has no end")?;
    /// assert!(matches!(error, OcpError::Simulation { interval: 6, state: "x", .. }), "{error}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn guess_by_simulation(&mut self) -> Result<&mut Self, OcpError> {
        if P::Dynamics::LIFTED {
            return Err(OcpError::NoIntegrator);
        }
        self.roll_out(|ocp, k, end| {
            let layout @ Layout { intervals, .. } = ocp.layout();
            let data = split_data::<P, T>(ocp.data.as_mut(), layout);
            let (v, _) = ocp.iterate.variables_and_costates();
            let (ld, np) =
                (padded_len::<T>(stage_variable_count::<P::Shape>(layout.free_count)), P::Shape::NP);
            // Data of two intervals, since the last interval of a horizon may end with a map.
            let times = data.times.get(k..(k + 3).min(intervals + 1)).unwrap_or_default();
            let (v, p) = (v.get(k * ld..).unwrap_or_default(), data.p.get(k * np..).unwrap_or_default());
            let mut has_end = false;
            let nodes = interval_nodes::<P::Shape, T>(v, &[], &[], (p, ocp.free.view()), times);
            let Problem { dynamics, .. } = ocp.problem.parts();
            let result = dynamics.simulate(&nodes, &mut |interval, step| {
                if interval == 0 {
                    copy_common(end, step.x);
                    has_end = true;
                }
            });
            if has_end { Ok(()) } else { result }
        })
    }

    /// [`Ocp::guess_by_simulation`] by another integrator of the same model, such as an adaptive
    /// one with as many steps as required.
    ///
    /// # Errors
    /// The errors of [`Ocp::guess_by_simulation`].
    ///
    /// # Example
    /// ```
    /// # use casados::ocp::{GeneralCost, Horizon, Problem};
    /// # use casados::prelude::*;
    /// # #[ode]
    /// # fn growth(x: f64) -> f64 { x * x }
    /// # #[function]
    /// # fn size(x: f64) -> f64 { x }
    /// # let mut ocp = Problem::new(Irk::<Growth, Gauss<1>>::new(Options::default())?)
    /// #     .terminal_cost(GeneralCost::<Size>::new())
    /// #     .on(Horizon::uniform(10, 0.1))?;
    /// # ocp.fix_initial_state(&[0.5])?.guess(&[0.0], &[])?;
    /// let mut integrator = Adaptive::<Growth, Radau>::new(AdaptiveOptions::default())?;
    /// ocp.guess_by_simulation_with(&mut integrator)?;
    /// assert!((ocp.stage(10)?.x[0] - 1.0).abs() < 1e-4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn guess_by_simulation_with<I>(&mut self, integrator: &mut I) -> Result<&mut Self, OcpError>
    where
        I: Integrator<Model: Dae<Shape = P::Shape>, Number = T>,
    {
        self.roll_out(|ocp, k, end| {
            let layout = ocp.layout();
            let data = split_data::<P, T>(ocp.data.as_mut(), layout);
            let (v, _) = ocp.iterate.variables_and_costates();
            let nodes = interval_nodes::<P::Shape, T>(v, &[], &[], (data.p, ocp.free.view()), data.times);
            let Some(interval) = nodes.iter().nth(k) else { return Ok(()) };
            in_interval(k, integrator.begin(&interval))?;
            let result = integrator.solve(&vector(interval.x), &vector(interval.u), interval.h);
            copy_common(end, in_interval(k, result)?.x.as_slice());
            Ok(())
        })
    }

    /// Computes the states of the iterate interval by interval; `integrate` writes the end of an
    /// interval.
    fn roll_out(
        &mut self,
        mut integrate: impl FnMut(&mut Self, usize, &mut [T]) -> Result<(), OcpError>,
    ) -> Result<&mut Self, OcpError> {
        self.check()?;
        self.clip_to_bounds();
        self.equalise_shared_controls();
        self.iterate.multipliers_mut().fill(T::ZERO);
        self.algebraic_is_current = false;
        let mut memory = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        let end = part_mut(memory.as_mut(), 0, P::Shape::NX);
        for interval in 0..self.intervals() {
            integrate(self, interval, end).map_err(|error| self.simulation_error(interval, error))?;
            Labels::states::<P, T>(Part::States, interval + 1).check_finite(end)?;
            if let Some(next) = self.iterate.stage_mut(interval + 1) {
                copy_common(next.x, end);
            }
        }
        self.equalise_periodic_states();
        Ok(self)
    }

    /// The error of an interval, with the name of the largest state at its start.
    fn simulation_error(&self, interval: usize, error: OcpError) -> OcpError {
        let OcpError::Integration { error, .. } = error else { return error };
        let x = self.iterate.stage(interval).map_or(&[][..], |stage| stage.x);
        let names = <P::Dynamics as Dynamics<T>>::NAMES.x;
        let largest = names.iter().zip(x).fold(("", T::ZERO), |largest, (&name, &value)| {
            if largest.0.is_empty() || value.abs() > largest.1.abs() { (name, value) } else { largest }
        });
        let interval = u32::try_from(interval).unwrap_or(u32::MAX);
        OcpError::Simulation { interval, state: largest.0, value: largest.1.to_f64() as f32, error }
    }
}
