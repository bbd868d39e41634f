//! Problems with several phases, solved as one.
//!
//! ```text
//! start   →   phase 0: x₀ … x_N   →   phase 1: x₀ = link(x_N, p of phase 0) … x_N   →   …
//! ```
//!
//! Decisions at the start of a phase, its free parameters and the states that no link determines,
//! are controls of the stage before: the last stage of the previous phase, or the start, a stage
//! without states.
//!
//! | | |
//! | --- | --- |
//! | `link` | the map from the end of a phase to the start of the next |
//! | `phase` | a phase, independent of the type of its problem |
//! | `stage_conversion` | points, bounds and QPs of phases and of the joined problem |
//! | `program` | the interface to solvers |
//! | `derivatives` | derivatives of solutions and values |

mod derivatives;
mod dynamics;
mod link;
mod phase;
mod program;
mod stage_conversion;

pub use derivatives::{PhaseAdjoint, PhaseDirection, PhaseFactors};
pub use dynamics::PhaseDynamics;
pub use link::{Continuous, Jump, Link};
#[doc(hidden)]
pub use link::{PhaseDims, PhaseEnd};

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free_parameters::FreeParameters;
use crate::ocp::formulation::functions::dynamics::SecondOrder;
use crate::ocp::formulation::instance::inner_points::InnerPoints;
use crate::ocp::formulation::instance::{HeapOcp, InitialState, Ocp};
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::ends;
use crate::qp::{HeapSolution, Qp, Solution, SolutionStage, StageDims, copy_common, try_reserve, zeros};
use crate::scalar::Real;
use crate::structure::name_matches;
use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use phase::{Phase, PhaseStart};
use stage_conversion::StagePosition;

/// A sequence of problems, solved as one, each with its own model, horizon and controls.
///
/// ```text
/// min  Σ_i (costs of phase i)        x₀ of phase i+1 = link_i(x_N, p of phase i)
/// ```
///
/// A phase is a problem on a horizon, with bounds, costs, constraints, free parameters and guesses
/// by its own names. Its duration is fixed or free ([`Horizon::free`](crate::ocp::Horizon)); its
/// time starts at its first node. The first phase has an initial state; the [`Link`] before another
/// phase maps the end of the previous one to its first state: [`Continuous`], or a [`Jump`].
///
/// `join` makes one problem of the phases, which [`Sqp`](crate::ocp::Sqp) and
/// [`Ipm`](crate::ocp::Ipm) solve with exact derivatives, in time that is linear in the number of
/// intervals. It borrows the phases; after a run each phase has its part of the iterate, with
/// multipliers.
///
/// Free parameters of a phase are states of the joined problem, with `w₊ = w`; each phase has only
/// its own.
///
/// # Example
/// A ball is thrown up, bounces with half of its speed, and must return to its first height in
/// minimum time. Its initial speed is bounded.
/// ```
/// use casados::ocp::{GeneralCost, HeapIpm, Horizon, Jump, Phases, Problem};
/// use casados::prelude::*;
///
/// /// Height and speed in units of a gravity of one.
/// #[ode(duration = p)]
/// fn fall(x: [f64; 2], _p: f64) -> [f64; 2] { [x[1], -1.0] }
/// #[function]
/// fn impact(x: [f64; 2], _p: f64) -> [f64; 2] { [x[0], -0.5 * x[1]] }
/// #[function]
/// fn time(_x: [f64; 2], _p: f64) -> f64 { 1.0 }
///
/// let n = 4;
/// let flight = |longest: f64| {
///     Problem::new(Irk::<Fall, Gauss<2>>::new(Options::default())?)
///         .running_cost(GeneralCost::<Time>::new())
///         .on(Horizon::free(n, 0.1..=longest, 1.0))
/// };
/// let (mut down, mut up) = (flight(5.0)?, flight(5.0)?);
/// down.free_initial_state().bound("x[0]", ..1, 1.0, 1.0)?.bound("x[1]", ..1, -3.0, 3.0)?;
/// down.bound("x[0]", n.., 0.0, 0.0)?.guess(&[0.5, -1.0], &[])?;
/// up.bound("x[0]", n.., 1.0, 1.0)?.guess(&[0.5, 1.0], &[])?;
///
/// let mut bounce = Phases::new(&mut down).then(Jump::<Impact>::new(), &mut up).join()?;
/// assert!(HeapIpm::new(&bounce)?.solve(&mut bounce)?.is_converged());
/// drop(bounce);
/// // Thrown down as fast as it may be: it hits the ground with √(3² + 2).
/// let speed = 11.0_f64.sqrt();
/// assert!((down.solution()?.end_time() - (speed - 3.0)).abs() < 1e-6);
/// assert!((up.solution()?.state("x[1]")?[0] - 0.5 * speed).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Phases<'a, T = f64> {
    phases: Vec<JoinedPhase<'a, T>>,
    /// The trial point of each phase; empty before `join`.
    trial_points: Vec<TrialPoint<T>>,
    /// The fixed elements of the first state.
    initial_state: Vec<T>,
}

/// A trial point of a phase, with the ends of its intervals and its constraints there.
struct TrialPoint<T> {
    point: HeapSolution<T>,
    ends: Vec<T>,
}

/// A phase and the link after it.
struct JoinedPhase<'a, T> {
    problem: &'a mut dyn Phase<T>,
    start: PhaseStart,
    /// The names of the parameters shared with the phase before.
    shared_names: Vec<&'a str>,
    link: Option<Box<dyn Link<T> + 'a>>,
    /// The start of the next phase.
    next_start: Option<PhaseStart>,
    /// The index of its first stage in the joined problem.
    first: usize,
}

impl<T> fmt::Debug for Phases<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Phases").field("phases", &self.phases.len()).finish()
    }
}

impl<'a, T: Real> Phases<'a, T> {
    /// Starts a sequence with its first phase.
    pub fn new<P>(first: &'a mut HeapOcp<P, T>) -> Self
    where
        P: Formulation<T, Dynamics: SecondOrder<T>> + 'a,
    {
        Self { phases: vec![JoinedPhase::new(first)], trial_points: Vec::new(), initial_state: Vec::new() }
    }

    /// Appends a phase, which starts by the link.
    #[must_use]
    pub fn then<P>(mut self, link: impl Link<T> + 'a, next: &'a mut HeapOcp<P, T>) -> Self
    where
        P: Formulation<T, Dynamics: SecondOrder<T>> + 'a,
    {
        if let Some(last) = self.phases.last_mut() {
            last.link = Some(Box::new(link));
        }
        self.phases.push(JoinedPhase::new(next));
        self
    }

    /// Shares a free parameter, by name, between the last phase and the phase before: both have one
    /// value.
    ///
    /// # Example
    /// A car is pushed and braked for a second each; its final speed determines its mass.
    /// ```
    /// use casados::ocp::{Continuous, HeapIpm, Horizon, Phases, Problem};
    /// use casados::prelude::*;
    ///
    /// /// Speed and mass; 2 N, then −1 N.
    /// #[ode]
    /// fn push(_x: f64, p: f64) -> f64 { 2.0 / p }
    /// #[ode]
    /// fn brake(_x: f64, p: f64) -> f64 { -1.0 / p }
    ///
    /// let mut first = Problem::new(Irk::<Push, Gauss<1>>::new(Options::default())?)
    ///     .on(Horizon::uniform(2, 0.5))?;
    /// first.fix_initial_state(&[0.0])?.guess(&[1.0], &[])?.free("p", 0.1..=9.0, 1.0)?;
    /// let mut second = Problem::new(Irk::<Brake, Gauss<1>>::new(Options::default())?)
    ///     .on(Horizon::uniform(2, 0.5))?;
    /// second.guess(&[1.0], &[])?.bound("x", 2.., 2.0, 2.0)?.free("p", 0.1..=9.0, 1.0)?;
    ///
    /// let mut drive = Phases::new(&mut first).then(Continuous, &mut second).share("p").join()?;
    /// assert!(HeapIpm::new(&drive)?.solve(&mut drive)?.is_converged());
    /// drop(drive);
    /// let mass = second.solution()?.parameter("p")?[0];
    /// assert!((mass - 0.5).abs() < 1e-7);
    /// assert_eq!(first.solution()?.parameter("p")?[0], mass);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn share(mut self, name: &'a str) -> Self {
        if let Some(last) = self.phases.last_mut() {
            last.shared_names.push(name);
        }
        self
    }

    /// Joins the phases to one problem, whose iterate consists of their guesses. Its stages are the
    /// start and the stages of all phases in order.
    ///
    /// Later changes of a phase require another `join`.
    ///
    /// # Errors
    /// [`OcpError::LinkDimension`], [`OcpError::NotThere`], [`OcpError::DependsOnTime`] of a link;
    /// [`OcpError::Phase`] for a fixed initial state after the first phase, for periodic states,
    /// shared controls, and shared parameters that are not free in both phases;
    /// [`OcpError::Missing`] and other errors of an incomplete phase ([`Ocp::check`]);
    /// [`OcpError::OutOfMemory`].
    pub fn join(mut self) -> Result<HeapOcp<Self, T>, OcpError> {
        self.check()?;
        let mut dims: Vec<StageDims> = Vec::new();
        let mut decided: Vec<usize> =
            self.phases.iter().map(|phase| phase.start.start_variable_count()).collect();
        decided.push(0);
        let mut decided = decided.into_iter();
        dims.push(StageDims::new(0, decided.next().unwrap_or(0), 0));
        for (phase, decided) in self.phases.iter_mut().zip(decided) {
            phase.first = dims.len();
            let phase_dims = phase.problem.qp().dims();
            try_reserve(&mut dims, phase_dims.len())?;
            let (nx, free) = (phase.start.size.nx, phase.start.size.free);
            dims.extend(phase_dims.iter().map(|stage| StageDims::new(nx + free, stage.nu - free, stage.ng)));
            if let Some(last) = dims.last_mut() {
                last.nu = decided;
            }
            try_reserve(&mut self.trial_points, 1)?;
            self.trial_points
                .push(TrialPoint { point: Solution::new(phase_dims)?, ends: zeros(ends(phase_dims))? });
        }
        let (rows, scratch) =
            (dims.iter().map(|stage| stage.ng).sum::<usize>(), stage_conversion::scratch_len::<T>(&dims));
        let mut ocp = Ocp {
            qp: Qp::new(&dims)?,
            iterate: Solution::new(&dims)?,
            data: zeros(2 * rows + scratch)?,
            // The start has no states.
            initial_state: InitialState::Fixed,
            problem: self,
            objective: T::ZERO,
            stage_residuals: [T::ZERO; 2],
            free: FreeParameters::default(),
            inner_points: InnerPoints::default(),
            step_length: None,
            algebraic_is_current: false,
        };
        let Ocp { problem, qp, iterate, data, .. } = &mut ocp;
        problem.write_bounds(qp, data.get_mut(..2 * rows).unwrap_or_default());
        problem.store_iterates(iterate);
        Ok(ocp)
    }

    /// # Errors
    /// The errors of [`Phases::join`].
    fn check(&mut self) -> Result<(), OcpError> {
        for (index, phase) in self.phases.iter_mut().enumerate() {
            if let Some(what) = phase.problem.unsupported_feature(index == 0) {
                return Err(OcpError::Phase { phase: index, model: phase.problem.names().model, what });
            }
            phase.problem.check().map_err(|error| error.in_phase(index))?;
            let mut size = phase.problem.size();
            size.given_states = if index == 0 { size.given_states } else { size.model_states };
            phase.start = PhaseStart { size, shared: vec![None; size.free] };
        }
        self.initial_state = self.given_initial_state()?;
        let mut before: Option<&mut JoinedPhase<'_, T>> = None;
        for (index, phase) in self.phases.iter_mut().enumerate() {
            phase.share_parameters(before.as_deref(), index)?;
            if let Some(before) = &mut before {
                if let Some(link) = &before.link {
                    link.check(before.problem.link_dims(phase.start.size.model_states))?;
                }
                before.next_start = Some(phase.start.clone());
            }
            before = Some(phase);
        }
        Ok(())
    }

    /// Returns the fixed elements of the first state.
    fn given_initial_state(&self) -> Result<Vec<T>, OcpError> {
        let Some(JoinedPhase { problem, start: phase_start, .. }) = self.phases.first() else {
            return Ok(Vec::new());
        };
        let mut start = zeros(phase_start.size.given_states)?;
        if let Some(first) = problem.qp().stage(0) {
            copy_common(&mut start, first.x_bounds().lower);
        }
        Ok(start)
    }

    /// Returns the phase of a stage of the joined problem; none for the start.
    fn at(&self, stage: usize) -> Option<(usize, &JoinedPhase<'a, T>)> {
        self.phases.iter().enumerate().rev().find(|(_, phase)| phase.first <= stage)
    }

    /// Writes the bounds of all stages, and the bounds of constraints as the user gave them: lower
    /// bounds, then upper bounds.
    fn write_bounds(&mut self, qp: &mut Qp<T, Vec<StageDims>, Vec<T>>, given: &mut [T]) {
        let (mut lower, mut upper) = given.split_at_mut(given.len() / 2);
        let mut stages = qp.stages_mut();
        let mut previous_stage = stages.next();
        for (index, JoinedPhase { problem, start: phase_start, .. }) in self.phases.iter_mut().enumerate() {
            for (k, from) in problem.qp().stages().enumerate() {
                if k == 0
                    && let Some(mut previous) = previous_stage.take()
                {
                    stage_conversion::write_start_variable_bounds(phase_start, &from, &mut previous);
                }
                let Some(mut to) = stages.next() else { return };
                let position = match (index, k) {
                    (0, 0) => StagePosition::FirstStage,
                    (_, 0) => StagePosition::PhaseStart,
                    _ => StagePosition::InteriorStage,
                };
                stage_conversion::copy_stage_bounds(phase_start, &from, &mut to, position);
                previous_stage = Some(to);
            }
            for (to, from) in [&mut lower, &mut upper].into_iter().zip(problem.given_constraint_bounds()) {
                let (own, behind) = core::mem::take(to).split_at_mut(from.len());
                own.copy_from_slice(from);
                *to = behind;
            }
        }
    }

    /// Writes the iterates of all phases to the iterate of the joined problem.
    fn store_iterates(&self, to: &mut HeapSolution<T>) {
        let first_stages =
            || self.phases.iter().map(|phase| (&phase.start, phase.problem.iterate().stages().next()));
        let nexts = first_stages().skip(1).map(Some).chain([None]);
        let mut stages = self.phases.iter().zip(nexts).flat_map(|(phase, next)| {
            let next = next.and_then(|(phase_start, first)| Some((phase_start, first?)));
            let size = phase.start.size;
            let stages = phase.problem.iterate().stages().enumerate();
            stages.map(move |(k, stage)| (size, stage, next.filter(|_| k == size.intervals)))
        });
        let mut start = first_stages().next().and_then(|(phase_start, first)| Some((phase_start, first?)));
        to.each_stage_mut(|to| {
            if let Some((phase_start, first)) = start.take() {
                stage_conversion::write_start_variables(phase_start, &first, to.u, to.u_lower, to.u_upper);
            } else if let Some((size, from, next)) = stages.next() {
                stage_conversion::store_phase_stage(size, &from, to, next);
            }
        });
    }

    /// Reads a point of the joined problem to the iterates of the phases.
    fn load<'s>(&mut self, mut stages: impl Iterator<Item = SolutionStage<'s, T>>) {
        let mut before = stages.next();
        for JoinedPhase { problem, start: phase_start, .. } in &mut self.phases {
            before = stage_conversion::load_phase(phase_start, &mut stages, problem.iterate_mut(), before);
        }
    }
}

impl<'a, T: Real> JoinedPhase<'a, T> {
    fn new<P>(problem: &'a mut HeapOcp<P, T>) -> Self
    where
        P: Formulation<T, Dynamics: SecondOrder<T>> + 'a,
    {
        let start = PhaseStart { size: Phase::<T>::size(problem), shared: Vec::new() };
        Self { problem, start, shared_names: Vec::new(), link: None, next_start: None, first: 0 }
    }

    /// Looks up the shared names among the free parameters of this phase and the phase before.
    ///
    /// # Errors
    /// [`OcpError::Phase`]
    fn share_parameters(&mut self, before: Option<&Self>, phase: usize) -> Result<(), OcpError> {
        let names = self.problem.names();
        for name in &self.shared_names {
            let mut is_found = false;
            let meant = names.p.iter().enumerate().filter(|(_, label)| name_matches(name, label));
            for (parameter, label) in meant {
                let own = self.problem.free_index(parameter);
                let other = before.and_then(|before| {
                    let of_before = before.problem.names().p;
                    before.problem.free_index(of_before.iter().position(|other| other == label)?)
                });
                if let (Some(own), Some(other)) = (own, other)
                    && let Some(shared) = self.start.shared.get_mut(own)
                {
                    (*shared, is_found) = (Some(other), true);
                }
            }
            if !is_found {
                let what =
                    "a shared parameter that is not free in it and in the phase before: `free` of both";
                return Err(OcpError::Phase { phase, model: names.model, what });
            }
        }
        Ok(())
    }
}
