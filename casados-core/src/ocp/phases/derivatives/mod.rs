//! Derivatives of the solution of joined phases, and of its value, with respect to the initial
//! state and the parameters of every phase.
//!
//! Stages of the joined problem have different dimensions. The Riccati recursion has those of the
//! largest stage: further states are zero, further controls have a unit Hessian.

mod phase_part;

use super::Phases;
use super::program::write_with;
use crate::ocp::formulation::error::{OcpError, Text};
use crate::ocp::formulation::instance::HeapOcp;
use crate::ocp::solution::sensitivities::SolutionFactors;
use crate::ocp::solution::sensitivities::parameters::KktParameterDerivatives;
use crate::ocp::solution::sensitivities::recursion::padded_index;
use crate::qp::element::{get, set};
use crate::qp::zeros;
use crate::scalar::Real;
use crate::structure::name_matches;
use alloc::vec::Vec;
use phase_part::{InitialStateRightHandSide, ParameterRightHandSide, PhasePart, SeedRightHandSide};

/// Factors of the optimality conditions of joined phases at their solution: derivatives of states,
/// controls and free parameters of all phases, adjoints, and the gradient of the optimal value,
/// with respect to the initial state and to the parameters of every phase.
///
/// They are those of [`SolutionFactors`], with exact Hessians: for a constant active set,
/// parameters of all stages of a phase changing together. A parameter that is free has no
/// derivatives. Equal parameters of two phases are two parameters; the derivative by both is the
/// sum.
///
/// `Ocp::factorise_phases` computes them, by one linearisation and one Riccati recursion.
///
/// # Example
/// A ball falls from a height `h` and bounces with a part `e` of its speed. Its second flight, to
/// the top, takes `e √(2 h)`, with a gravity of one.
/// ```
/// use casados::ocp::{HeapIpm, Horizon, Jump, PhaseFactors, Phases, Problem};
/// use casados::prelude::*;
///
/// /// Height and speed; duration, and what the ground leaves of the speed.
/// #[ode(duration = p[0])]
/// fn fall(x: [f64; 2], _p: [f64; 2]) -> [f64; 2] { [x[1], -1.0] }
/// #[function]
/// fn impact(x: [f64; 2], p: [f64; 2]) -> [f64; 2] { [x[0], -p[1] * x[1]] }
///
/// let (n, height, part) = (4, 2.0, 0.5_f64);
/// let flight = || {
///     let mut flight = Problem::new(Irk::<Fall, Gauss<2>>::new(Options::default())?)
///         .on(Horizon::free(n, 0.1..=9.0, 1.0))?;
///     flight.set_parameters(.., &[1.0, part])?;
///     Ok::<_, casados::ocp::OcpError>(flight)
/// };
/// let (mut down, mut up) = (flight()?, flight()?);
/// down.fix_initial_state(&[height, 0.0])?.bound("x[0]", n.., 0.0, 0.0)?.guess(&[0.5, -1.0], &[])?;
/// up.bound("x[1]", n.., 0.0, 0.0)?.guess(&[0.5, 1.0], &[])?;
/// let mut bounce = Phases::new(&mut down).then(Jump::<Impact>::new(), &mut up).join()?;
/// assert!(HeapIpm::new(&bounce)?.solve(&mut bounce)?.is_converged());
///
/// let mut factors = PhaseFactors::new(&bounce)?;
/// bounce.factorise_phases(&mut factors)?;
/// let by_height = factors.by_initial_state("x[0]")?.free_parameters(1)[0];
/// assert!((by_height - part / (2.0 * height).sqrt()).abs() < 1e-7);
/// let by_part = factors.by_parameter(0, "p[1]")?.free_parameters(1)[0];
/// assert!((by_part - (2.0 * height).sqrt()).abs() < 1e-7);
/// // The height of the top is e² h: an adjoint has all its derivatives.
/// let top = factors.adjoint(&[(1, n, "x[0]", 1.0)])?;
/// assert!((top.x0[0] - part * part).abs() < 1e-7);
/// assert!((top.p[0][1] - 2.0 * part * height).abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PhaseFactors<T> {
    factors: SolutionFactors<T>,
    parts: Vec<PhasePart<T>>,
    /// `∂V/∂x₀`.
    value_gradient_x0: Vec<T>,
    /// The unit vector of a given initial state.
    unit: Vec<T>,
    adjoint: PhaseAdjoint<T>,
}

/// `λᵀ dw/dx₀` and `λᵀ dw/dp` of joined phases; see [`PhaseFactors`] for an example.
///
/// ```
/// use casados::ocp::PhaseAdjoint;
///
/// fn largest(adjoint: &PhaseAdjoint<f64>) -> f64 {
///     adjoint.x0.iter().chain(adjoint.p.iter().flatten()).fold(0.0, |largest: f64, x| largest.max(x.abs()))
/// }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PhaseAdjoint<T> {
    /// With respect to the initial state of the first phase; empty if it is free.
    pub x0: Vec<T>,
    /// With respect to the parameters of each phase, `NP` of its model.
    pub p: Vec<Vec<T>>,
}

/// The derivatives of the solution with respect to an initial state or a parameter; see
/// [`PhaseFactors`] for an example. What does not exist is empty.
///
/// ```
/// use casados::ocp::PhaseDirection;
///
/// /// The changes of the first states of a phase.
/// fn start<'a>(direction: &'a PhaseDirection<'_, f64>, phase: usize) -> &'a [f64] {
///     direction.state(phase, 0)
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PhaseDirection<'a, T> {
    factors: &'a PhaseFactors<T>,
}

impl<T: Real> PhaseFactors<T> {
    /// Allocates memory for joined phases.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new(ocp: &HeapOcp<Phases<'_, T>, T>) -> Result<Self, OcpError> {
        let stages = ocp.qp.dims();
        let largest = |of: fn(&crate::qp::StageDims) -> usize| stages.iter().map(of).max().unwrap_or(0);
        let dims = [largest(|stage| stage.nx), largest(|stage| stage.nu), 0];
        let (n, functions) = (ocp.intervals(), KktParameterDerivatives::default());
        let parts = ocp.problem.phases.iter().map(PhasePart::new).collect::<Result<Vec<_>, _>>()?;
        let given = ocp.problem.initial_state.len();
        let p = parts.iter().map(|part| zeros(part.parameters())).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            factors: SolutionFactors::with_dims(dims, 0, n, functions)?,
            parts,
            value_gradient_x0: zeros(given)?,
            unit: zeros(given)?,
            adjoint: PhaseAdjoint { x0: zeros(given)?, p },
        })
    }

    /// Sets the barrier parameter of the iterate, as [`SolutionFactors::smoothing`].
    pub fn set_smoothing(&mut self, mu: T) -> &mut Self {
        self.factors.smoothing = mu;
        self
    }

    /// The number of weakly active bounds, as [`SolutionFactors::weakly_active`].
    #[must_use]
    pub fn weakly_active(&self) -> usize {
        self.factors.weakly_active()
    }

    /// `∂V/∂x₀` with respect to the initial state of the first phase; empty if it is free.
    #[must_use]
    pub fn value_gradient_x0(&self) -> &[T] {
        &self.value_gradient_x0
    }

    /// `∂V/∂p` with respect to the parameters of a phase; empty if there is no such phase.
    #[must_use]
    pub fn value_gradient_p(&self, phase: usize) -> &[T] {
        self.parts.get(phase).map_or(&[], |part| &part.functions.value_gradient)
    }

    /// The derivatives of the solution with respect to an element of the initial state.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`] if the first phase has no such state, or if it is free.
    pub fn by_initial_state(&mut self, name: &str) -> Result<PhaseDirection<'_, T>, OcpError> {
        let Some(part) = self.parts.first() else { return Err(OcpError::NoSolution) };
        let known = part.names;
        let found = known.x.iter().take(self.unit.len()).position(|state| name_matches(name, state));
        let Some(state) = found else { return Err(OcpError::UnknownName { name: Text::new(name), known }) };
        self.unit.fill(T::ZERO);
        set(&mut self.unit, state, T::ONE);
        self.factors.solve(&InitialStateRightHandSide(&self.unit));
        Ok(PhaseDirection { factors: self })
    }

    /// The derivatives of the solution with respect to a parameter of a phase; zero for a free
    /// parameter.
    ///
    /// # Errors
    /// [`OcpError::NoSuchPhase`]; [`OcpError::UnknownParameter`]
    pub fn by_parameter(&mut self, phase: usize, name: &str) -> Result<PhaseDirection<'_, T>, OcpError> {
        let part = self.phase_part(phase)?;
        let known = part.names;
        let found =
            known.p.iter().take(known.model_parameter_count()).position(|label| name_matches(name, label));
        let Some(parameter) = found else {
            return Err(OcpError::UnknownParameter { name: Text::new(name), known });
        };
        let nx = self.factors.dims()[0];
        self.factors.solve(&ParameterRightHandSide { part: part_of(&self.parts, phase)?, parameter, nx });
        Ok(PhaseDirection { factors: self })
    }

    /// Computes `λᵀ dw/dx₀` and `λᵀ dw/dp` for all initial states and parameters, by one solve.
    /// `λ` is a list of elements of the solution, each with its phase, stage, name and weight. The
    /// names are those of states, controls and free parameters of the phase, which have one value.
    ///
    /// # Errors
    /// [`OcpError::NoSuchPhase`], [`OcpError::NoSuchStage`], [`OcpError::UnknownName`];
    /// [`OcpError::InvalidValue`] for a weight that is not finite.
    pub fn adjoint(&mut self, seed: &[(usize, usize, &str, T)]) -> Result<&PhaseAdjoint<T>, OcpError> {
        let mut places = Vec::new();
        for &(phase, stage, name, weight) in seed {
            let part = self.phase_part(phase)?;
            let index = part.variable(stage, name, self.factors.dims()[0])?;
            if !weight.is_finite() {
                let (part, name, value) = (crate::ocp::Part::States, "seed", weight.to_f64());
                return Err(OcpError::InvalidValue { part, stage, name, index: 0, value });
            }
            places.push((part.first + stage, index, weight));
        }
        self.factors.solve(&SeedRightHandSide(&places));
        let direction = &self.factors.direction;
        for (i, x0) in self.adjoint.x0.iter_mut().enumerate() {
            *x0 = get(direction.multipliers(1), i);
        }
        let nx = self.factors.dims()[0];
        for (part, p) in self.parts.iter().zip(&mut self.adjoint.p) {
            for (parameter, sum) in p.iter_mut().enumerate() {
                let slope = |stage, row| part.constraint_slope(stage, row, parameter);
                *sum = self.factors.product_with_forces(direction, slope);
                for stage in part.first..=part.first + part.size.intervals {
                    let variables = |i: usize| match padded_index(i, part.states(), nx).checked_sub(nx) {
                        None => get(direction.state(stage), i),
                        Some(control) => get(direction.control(stage), control),
                    };
                    for (i, &slope) in part.gradient(stage, parameter).iter().enumerate() {
                        *sum = *sum + slope * variables(i);
                    }
                    for (&slope, &multiplier) in
                        part.end(stage, parameter).iter().zip(direction.multipliers(stage + 1))
                    {
                        *sum = *sum + slope * multiplier;
                    }
                }
            }
        }
        Ok(&self.adjoint)
    }

    fn phase_part(&self, phase: usize) -> Result<&PhasePart<T>, OcpError> {
        part_of(&self.parts, phase)
    }
}

/// # Errors
/// [`OcpError::NoSuchPhase`]
fn part_of<T>(parts: &[PhasePart<T>], phase: usize) -> Result<&PhasePart<T>, OcpError> {
    parts.get(phase).ok_or(OcpError::NoSuchPhase { phase, phases: parts.len() })
}

impl<T: Real> PhaseDirection<'_, T> {
    /// The derivatives of the states of a phase at a stage.
    #[must_use]
    pub fn state(&self, phase: usize, stage: usize) -> &[T] {
        self.at(phase, stage).map_or(&[], |(part, stage)| {
            crate::qp::part(self.factors.factors.direction.state(stage), 0, part.size.nx)
        })
    }

    /// The derivatives of the controls of a phase in an interval.
    #[must_use]
    pub fn control(&self, phase: usize, stage: usize) -> &[T] {
        let inside = self.at(phase, stage).filter(|(part, _)| stage < part.size.intervals);
        inside.map_or(&[], |(part, stage)| {
            crate::qp::part(self.factors.factors.direction.control(stage), 0, part.names.u.len())
        })
    }

    /// The derivatives of the free parameters of a phase, in the order of the calls of `free`; an
    /// end time is the first.
    #[must_use]
    pub fn free_parameters(&self, phase: usize) -> &[T] {
        self.at(phase, 0).map_or(&[], |(part, stage)| {
            crate::qp::part(self.factors.factors.direction.state(stage), part.size.nx, part.size.free)
        })
    }

    fn at(&self, phase: usize, stage: usize) -> Option<(&PhasePart<T>, usize)> {
        let part = self.factors.parts.get(phase)?;
        (stage <= part.size.intervals).then_some((part, part.first + stage))
    }
}

impl<T: Real> HeapOcp<Phases<'_, T>, T> {
    /// Factorises the optimality conditions of joined phases at the iterate, which must be a
    /// solution.
    ///
    /// # Errors
    /// The errors of [`Ocp::factorise`](crate::ocp::Ocp::factorise), of one phase with its number;
    /// [`OcpError::Length`] if the memory is that of other phases.
    pub fn factorise_phases(&mut self, factors: &mut PhaseFactors<T>) -> Result<(), OcpError> {
        let PhaseFactors { factors, parts, value_gradient_x0, .. } = factors;
        let (part, stage) = (crate::ocp::Part::Memory, 0);
        for (expected, found) in [
            (self.problem.phases.len(), parts.len()),
            (self.intervals(), factors.intervals()),
            (self.problem.initial_state.len(), value_gradient_x0.len()),
        ] {
            if expected != found {
                return Err(OcpError::Length { part, stage, expected, found });
            }
        }
        factors.check_smoothing()?;
        write_with(self, |index, phase| {
            let part = parts.get_mut(index).ok_or(OcpError::NoSolution)?;
            phase.differentiate(&mut part.functions)
        })?;
        for (phase, part) in self.problem.phases.iter_mut().zip(parts.iter_mut()) {
            let last = self.iterate.stage(part.first + part.size.intervals);
            part.add_link(phase, last.map_or(&[], |last| last.dynamics));
        }
        let start = self.iterate.stage(0).map_or(&[][..], |start| start.dynamics);
        crate::qp::copy_common(value_gradient_x0, start);
        let compliance = T::from_f64(T::EPSILON).cbrt();
        factors.factorise_qp(self.qp.view(), &self.iterate, compliance, &mut |[stage, row], stiffness, c| {
            let part = parts.iter_mut().rev().find(|part| part.first <= stage);
            if let Some(part) = part {
                part.functions.add_constraint([stage - part.first, row], stiffness, c);
            }
        })
    }
}
