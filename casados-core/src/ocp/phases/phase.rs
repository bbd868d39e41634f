//! The interface of a phase, independent of the type of its problem.

use super::link::{PhaseDims, PhaseEnd};
use crate::ocp::formulation::error::{ConstraintName, OcpError};
use crate::ocp::formulation::free_parameters::FreeParameters;
use crate::ocp::formulation::functions::dynamics::{Dynamics, SecondOrder, StageAction};
use crate::ocp::formulation::instance::{HeapOcp, InitialState};
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
use crate::ocp::formulation::program::curvature::Convexification;
use crate::ocp::formulation::program::curvature::{Exact, GaussNewton};
use crate::ocp::formulation::program::{Program, ProgramParts};
use crate::ocp::solution::sensitivities::parameters::KktParameterDerivatives;
use crate::qp::{
    HeapSolution, QpError, QpField, QpView, Side, SolutionStage, copy_common, marked_indices, part,
};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;
use core::ops::Range;

/// The kind of Hessian.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub exact: bool,
    pub convexification: Convexification,
}

/// The dimensions of a phase.
#[derive(Clone, Copy, Debug)]
pub(super) struct PhaseSize {
    /// States.
    pub nx: usize,
    /// Free parameters.
    pub free: usize,
    /// States without linear controls and integrals.
    pub model_states: usize,
    /// Linear controls.
    pub linear_controls: usize,
    /// States that the link gives; the states from here to `model_states + linear_controls` are
    /// decided.
    pub given_states: usize,
    pub intervals: usize,
}

impl PhaseSize {
    /// Returns the states that are decided at the start of the phase.
    pub fn free_start_states(&self) -> Range<usize> {
        self.given_states..self.model_states + self.linear_controls
    }
}

/// The start of a phase, whose decision variables are its free states, then the parameters that it
/// does not share with the phase before.
#[derive(Clone, Debug)]
pub(super) struct PhaseStart {
    pub size: PhaseSize,
    /// For each free parameter the index of the shared parameter of the phase before.
    pub shared: Vec<Option<usize>>,
}

impl PhaseStart {
    /// Returns the indices of the parameters that are decision variables at the start.
    pub fn parameters(&self) -> impl Iterator<Item = usize> {
        self.shared.iter().enumerate().filter(|(_, shared)| shared.is_none()).map(|(w, _)| w)
    }

    /// Returns the number of decision variables at the start: states, then parameters.
    pub fn start_variable_count(&self) -> usize {
        self.size.free_start_states().len() + self.parameters().count()
    }
}

/// A phase, independent of the type of its problem.
pub(super) trait Phase<T: Real> {
    fn size(&self) -> PhaseSize;
    fn names(&self) -> Names;
    fn static_names(&self) -> &'static Names;
    /// Returns memory for derivatives with respect to parameters.
    fn parameter_derivatives(&self) -> Result<KktParameterDerivatives<T>, OcpError>;
    /// Writes the QP with exact Hessians and the derivatives with respect to parameters at the
    /// iterate, and returns the objective.
    fn differentiate(&mut self, result: &mut KktParameterDerivatives<T>) -> Result<T, OcpError>;
    fn free_parameters(&self) -> &FreeParameters;
    /// Returns the index of a parameter of the model among the free parameters.
    fn free_index(&self, parameter: usize) -> Option<usize>;
    /// Returns the dimensions that a link at its end must match; `next_states` is the number of
    /// states of the next phase.
    fn link_dims(&self, next_states: usize) -> PhaseDims;
    /// Returns a feature that phases do not support. Frees the start of every phase but the first.
    fn unsupported_feature(&mut self, is_first: bool) -> Option<&'static str>;
    fn check(&mut self) -> Result<(), OcpError>;
    fn qp(&self) -> QpView<'_, T>;
    fn iterate(&self) -> &HeapSolution<T>;
    fn iterate_mut(&mut self) -> &mut HeapSolution<T>;
    /// Returns the bounds of constraints as the user gave them.
    fn given_constraint_bounds(&mut self) -> [&[T]; 2];
    /// Writes the QP at the iterate, and returns the objective.
    fn linearise(&mut self, kind: Kind) -> Result<T, OcpError>;
    fn evaluate(&mut self, trial_point: &HeapSolution<T>, ends: &mut [T]) -> Result<T, OcpError>;
    /// Whether the stages of its intervals are variables.
    fn is_lifted(&self) -> bool;
    /// Sets the step length of lifted stages for the next evaluation.
    fn set_step_length(&mut self, step_length: Option<T>);
    /// Returns the sum and the largest of the residuals of the equations of lifted stages.
    fn stage_residuals(&self) -> [T; 2];
    fn initialise_stages(&mut self) -> Result<(), OcpError>;
    fn expand_stage_steps(&mut self, step: &HeapSolution<T>) -> Result<(), OcpError>;
    fn apply_stage_action(&mut self, action: StageAction<T>);
    /// Returns the end of the phase, at this point of its last stage.
    fn phase_end<'s>(&'s self, at: SolutionStage<'s, T>) -> PhaseEnd<'s, T>;
    fn name(&self, place: (QpField, usize, usize), side: Side) -> ConstraintName;
    fn derivative(&self, error: &QpError) -> Option<OcpError>;
    fn complete(&mut self, needs_violation: bool) -> (bool, Option<(ConstraintName, f64)>);
}

impl<P: Formulation<T>, T: Real> HeapOcp<P, T> {
    /// Writes the fixed initial state to the iterate.
    fn set_given_initial_state(&mut self) {
        let model_states = self.names().model_state_count();
        let (Some(bounds), Some(first)) = (self.qp.view().stage(0), self.iterate.stage_mut(0)) else {
            return;
        };
        copy_common(first.x.get_mut(..model_states).unwrap_or_default(), bounds.x_bounds().lower);
    }
}

impl<P: Formulation<T, Dynamics: SecondOrder<T>>, T: Real> Phase<T> for HeapOcp<P, T> {
    fn size(&self) -> PhaseSize {
        let names = self.names();
        PhaseSize {
            nx: P::Shape::NX,
            free: self.free.count(),
            model_states: names.model_state_count(),
            linear_controls: names.linear.len(),
            given_states: if self.initial_state == InitialState::Free {
                0
            } else {
                names.model_state_count()
            },
            intervals: self.intervals(),
        }
    }
    fn names(&self) -> Names {
        <P::Dynamics as Dynamics<T>>::NAMES
    }
    fn static_names(&self) -> &'static Names {
        const { &<P::Dynamics as Dynamics<T>>::NAMES }
    }
    fn free_parameters(&self) -> &FreeParameters {
        &self.free
    }
    fn parameter_derivatives(&self) -> Result<KktParameterDerivatives<T>, OcpError> {
        KktParameterDerivatives::new::<P>(self.free.count(), self.intervals())
    }
    fn differentiate(&mut self, result: &mut KktParameterDerivatives<T>) -> Result<T, OcpError> {
        self.differentiate_with(Exact { convexification: Convexification::None }, result)?;
        Ok(self.objective)
    }
    fn free_index(&self, parameter: usize) -> Option<usize> {
        self.free.view().index_of(parameter)
    }
    fn link_dims(&self, next_states: usize) -> PhaseDims {
        PhaseDims {
            ending_dims: [P::Shape::NX, P::Shape::NU, P::Shape::NP, P::Shape::NZ],
            model_states: self.names().model_state_count(),
            next_states,
            stage: self.intervals(),
            is_timed: self.free.view().end_time_index().is_none(),
        }
    }
    fn unsupported_feature(&mut self, is_first: bool) -> Option<&'static str> {
        let free = self.free.count();
        if marked_indices(self.qp.view().periodic()).next().is_some() {
            return Some("periodic states: a phase begins where the one before it ends");
        }
        if marked_indices(self.qp.view().shared()).any(|control| control >= free) {
            return Some("shared controls: take free parameters of the model, `free`");
        }
        if !is_first && matches!(self.initial_state, InitialState::Fixed | InitialState::PartlyFixed) {
            return Some("an initial state of its own: the link before it says what it is");
        }
        if is_first && self.initial_state != InitialState::Free {
            self.set_given_initial_state();
        }
        if !is_first {
            self.initial_state = InitialState::Free;
        }
        self.equalise_shared_controls();
        None
    }
    fn check(&mut self) -> Result<(), OcpError> {
        self.check()
    }
    fn qp(&self) -> QpView<'_, T> {
        self.qp.view()
    }
    fn iterate(&self) -> &HeapSolution<T> {
        &self.iterate
    }
    fn iterate_mut(&mut self) -> &mut HeapSolution<T> {
        self.algebraic_is_current = false;
        &mut self.iterate
    }
    fn given_constraint_bounds(&mut self) -> [&[T]; 2] {
        let ProgramParts { given, .. } = <P as Program<T>>::split(self);
        given
    }
    fn linearise(&mut self, Kind { exact, convexification }: Kind) -> Result<T, OcpError> {
        if exact {
            self.linearise(Exact { convexification })?;
        } else {
            self.linearise(GaussNewton { convexification })?;
        }
        Ok(self.objective)
    }
    fn evaluate(&mut self, at: &HeapSolution<T>, ends: &mut [T]) -> Result<T, OcpError> {
        self.evaluate(at, ends)
    }
    fn is_lifted(&self) -> bool {
        P::Dynamics::LIFTED
    }
    fn set_step_length(&mut self, step_length: Option<T>) {
        self.step_length = step_length;
    }
    fn stage_residuals(&self) -> [T; 2] {
        self.stage_residuals
    }
    fn initialise_stages(&mut self) -> Result<(), OcpError> {
        <P as Program<T>>::initialise_stages(self)
    }
    fn expand_stage_steps(&mut self, step: &HeapSolution<T>) -> Result<(), OcpError> {
        <P as Program<T>>::expand_stage_steps(self, step)
    }
    fn apply_stage_action(&mut self, action: StageAction<T>) {
        Program::apply_stage_action(&mut self.problem, action);
    }
    fn phase_end<'s>(&'s self, at: SolutionStage<'s, T>) -> PhaseEnd<'s, T> {
        let (stage, np, data) = (self.intervals(), P::Shape::NP, self.data.as_slice());
        PhaseEnd {
            stage,
            x: at.x,
            w: part(at.u, 0, self.free.count()),
            free: self.free.view(),
            p: part(data, stage + 1 + stage * np, np),
            t: data.get(stage).copied().unwrap_or(T::ZERO),
        }
    }
    fn name(&self, (field, stage, index): (QpField, usize, usize), side: Side) -> ConstraintName {
        self.name(field, stage, index, side)
    }
    fn derivative(&self, error: &QpError) -> Option<OcpError> {
        self.non_finite_derivative(error)
    }
    fn complete(&mut self, needs_violation: bool) -> (bool, Option<(ConstraintName, f64)>) {
        self.convexity_and_violation(needs_violation)
    }
}
