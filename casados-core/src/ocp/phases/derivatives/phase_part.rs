//! The derivatives of the functions of a phase, and the right-hand sides of the joined problem.

use crate::linalg::axpy;
use crate::ocp::formulation::error::{OcpError, Text};
use crate::ocp::formulation::free_parameters::FreeParameters;
use crate::ocp::formulation::names::Names;
use crate::ocp::phases::JoinedPhase;
use crate::ocp::phases::phase::PhaseSize;
use crate::ocp::solution::sensitivities::kkt_direction::RightHandSide;
use crate::ocp::solution::sensitivities::parameters::KktParameterDerivatives;
use crate::ocp::solution::sensitivities::recursion::padded_index;
use crate::qp::element::{add, set};
use crate::qp::{part, part_mut, zeros};
use crate::scalar::Real;
use crate::structure::name_matches;
use alloc::vec::Vec;

/// The derivatives of the functions of a phase with respect to its parameters.
#[derive(Clone, Debug)]
pub(super) struct PhasePart<T> {
    pub names: &'static Names,
    pub size: PhaseSize,
    free: FreeParameters,
    /// The index of its first stage in the joined problem.
    pub first: usize,
    pub functions: KktParameterDerivatives<T>,
    /// `∂y/∂p` of the link, by columns, and by rows before.
    link: Vec<T>,
    link_rows: Vec<T>,
    /// The number of outputs of the link.
    outputs: usize,
}

impl<T: Real> PhasePart<T> {
    pub fn new(phase: &JoinedPhase<'_, T>) -> Result<Self, OcpError> {
        let names = phase.problem.static_names();
        let outputs = phase.next_start.as_ref().map_or(0, |next| next.size.given_states);
        Ok(Self {
            names,
            size: phase.start.size,
            free: phase.problem.free_parameters().clone(),
            first: phase.first,
            functions: phase.problem.parameter_derivatives()?,
            link: zeros(outputs * names.p.len())?,
            link_rows: zeros(outputs * names.p.len())?,
            outputs,
        })
    }

    pub fn parameters(&self) -> usize {
        self.names.p.len()
    }
    /// The states of the joined problem in this phase.
    pub fn states(&self) -> usize {
        self.size.nx + self.size.free
    }
    /// The gradient over the variables of a stage by a parameter; empty outside of the phase.
    pub fn gradient(&self, stage: usize, p: usize) -> &[T] {
        let Some(k) = stage.checked_sub(self.first).filter(|&k| k <= self.size.intervals) else { return &[] };
        let columns = self.functions.gradient_jacobian(k);
        let rows = columns.len().checked_div(self.parameters()).unwrap_or(0);
        part(columns, p * rows, rows)
    }
    /// The derivative of the end of an interval, or of the link, by a parameter.
    pub fn end(&self, stage: usize, p: usize) -> &[T] {
        match stage.checked_sub(self.first) {
            Some(k) if k < self.size.intervals => {
                part(self.functions.end_jacobian(k), p * self.size.nx, self.size.nx)
            }
            Some(k) if k == self.size.intervals => part(&self.link, p * self.outputs, self.outputs),
            _ => &[],
        }
    }

    /// The derivative of a constraint row of a stage of the joined problem by a parameter; zero
    /// outside of the phase.
    pub fn constraint_slope(&self, stage: usize, row: usize, p: usize) -> T {
        let k = stage.checked_sub(self.first).filter(|&k| k <= self.size.intervals);
        k.map_or(T::ZERO, |k| self.functions.constraint_slope(k, row, p))
    }

    /// Adds the link at the end of the phase, with its multipliers.
    pub fn add_link(&mut self, phase: &mut JoinedPhase<'_, T>, multipliers: &[T]) {
        let Some(link) = &mut phase.link else { return };
        let Some(last) = phase.problem.iterate().stages().next_back() else { return };
        let end = phase.problem.phase_end(last);
        let (np, multipliers) = (self.names.p.len(), part(multipliers, 0, self.outputs));
        self.link_rows.fill(T::ZERO);
        let mut cross = self.functions.stage_derivatives(self.size.intervals, end.free);
        link.add_parameter_derivatives(end, multipliers, &mut self.link_rows, &mut cross);
        for (row, (slopes, &multiplier)) in
            self.link_rows.chunks_exact(np.max(1)).zip(multipliers).enumerate()
        {
            axpy(multiplier, slopes, &mut self.functions.value_gradient);
            for (p, &slope) in slopes.iter().enumerate() {
                set(&mut self.link, p * self.outputs + row, slope);
            }
        }
        self.functions.clear_free_parameters(end.free);
        for p in (0..np).filter(|&p| end.free.index_of(p).is_some()) {
            part_mut(&mut self.link, p * self.outputs, self.outputs).fill(T::ZERO);
        }
    }
}

/// The right-hand side of a parameter of a phase.
pub(super) struct ParameterRightHandSide<'a, T> {
    pub part: &'a PhasePart<T>,
    pub parameter: usize,
    pub nx: usize,
}

impl<T: Real> RightHandSide<T> for ParameterRightHandSide<'_, T> {
    fn gradient(&self, k: usize, q: &mut [T]) {
        for (i, &value) in self.part.gradient(k, self.parameter).iter().enumerate() {
            set(q, padded_index(i, self.part.states(), self.nx), value);
        }
    }
    fn dynamics_constant(&self, k: usize) -> &[T] {
        self.part.end(k, self.parameter)
    }
    fn constraint_slope(&self, stage: usize, row: usize) -> T {
        self.part.constraint_slope(stage, row, self.parameter)
    }
}

/// The right-hand side of an initial state: the start determines the first state.
pub(super) struct InitialStateRightHandSide<'a, T>(pub &'a [T]);

impl<T: Real> RightHandSide<T> for InitialStateRightHandSide<'_, T> {
    fn gradient(&self, _: usize, _: &mut [T]) {}
    fn dynamics_constant(&self, k: usize) -> &[T] {
        if k == 0 { self.0 } else { &[] }
    }
    fn constraint_slope(&self, _: usize, _: usize) -> T {
        T::ZERO
    }
}

/// A right-hand side with a gradient at single variables: stage, index and value.
pub(super) struct SeedRightHandSide<'a, T>(pub &'a [(usize, usize, T)]);

impl<T: Real> RightHandSide<T> for SeedRightHandSide<'_, T> {
    fn gradient(&self, k: usize, q: &mut [T]) {
        self.0.iter().filter(|(stage, ..)| *stage == k).for_each(|&(_, index, value)| add(q, index, value));
    }
    fn dynamics_constant(&self, _: usize) -> &[T] {
        &[]
    }
    fn constraint_slope(&self, _: usize, _: usize) -> T {
        T::ZERO
    }
}

impl<T: Real> PhasePart<T> {
    /// The index of a variable of a stage of the phase among the padded states and controls.
    ///
    /// # Errors
    /// [`OcpError::NoSuchStage`], [`OcpError::UnknownName`]
    pub fn variable(&self, stage: usize, name: &str, nx: usize) -> Result<usize, OcpError> {
        let (known, intervals) = (self.names, self.size.intervals);
        let position = |names: &[&str]| names.iter().position(|variable| name_matches(name, variable));
        let names_of_p = known.p.iter().enumerate().filter(|(_, variable)| name_matches(name, variable));
        let part = crate::ocp::Part::States;
        if stage > intervals {
            return Err(OcpError::NoSuchStage { part, stage, stages: intervals + 1 });
        }
        if let Some(state) = position(known.x) {
            return Ok(state);
        }
        if let Some(control) = position(known.u) {
            if stage == intervals {
                let part = crate::ocp::Part::Controls;
                return Err(OcpError::NoSuchStage { part, stage, stages: intervals });
            }
            return Ok(nx + control);
        }
        let mut parameters = names_of_p.filter_map(|(p, _)| self.free.view().index_of(p));
        match parameters.next() {
            Some(w) => Ok(self.size.nx + w),
            None => Err(OcpError::UnknownName { name: Text::new(name), known }),
        }
    }
}
