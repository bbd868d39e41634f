//! Checks of a problem before its linearisation.

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::{OcpError, Part};
#[cfg(feature = "alloc")]
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::functions::node_evaluation::AvailableVariables;
use crate::ocp::formulation::instance::{InitialState, Ocp};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::{StageDims, part};
use crate::scalar::Real;
use crate::shape::Shape;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Finds parts that are not set, invalid weights of costs, and non-finite numbers in the
    /// iterate.
    ///
    /// # Errors
    /// [`OcpError::Missing`], [`OcpError::InvalidWeight`], [`OcpError::InvalidValue`]
    pub fn check(&mut self) -> Result<(), OcpError> {
        let Problem { dynamics, stage_cost, terminal_cost, .. } = self.problem.parts();
        dynamics.check()?;
        stage_cost.check_weights()?;
        terminal_cost.check_weights()?;
        if self.initial_state == InitialState::Unknown {
            return Err(OcpError::Missing { part: Part::InitialState, stage: 0 });
        }
        let np = P::Shape::NP;
        let p = part(self.data.as_ref(), self.intervals() + 1, (self.intervals() + 1) * np);
        if let Some((index, _)) = crate::finite::find_non_finite(p) {
            let stage = index.checked_div(np).unwrap_or(0);
            return Err(OcpError::Missing { part: Part::Parameters, stage });
        }
        self.check_iterate()
    }

    /// # Errors
    /// [`OcpError::InvalidValue`]
    pub(in crate::ocp) fn check_iterate(&self) -> Result<(), OcpError> {
        // Checks all numbers at once; names are determined only if one is not finite.
        if crate::finite::find_non_finite(self.iterate.all_numbers()).is_some() {
            self.find_non_finite()
        } else {
            Ok(())
        }
    }

    /// Finds functions without the derivatives that a free end time requires.
    ///
    /// # Errors
    /// [`OcpError::DependsOnTime`], [`OcpError::Unsupported`]
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn check_functions_for_free_end(&mut self) -> Result<(), OcpError> {
        let intervals = self.intervals();
        if P::Dynamics::INTEGRAL {
            let what = "a free end time with `WithIntegral`";
            let remedy = "Take `integrals(..)` of the model, or a running cost";
            return Err(OcpError::Unsupported { what, remedy });
        }
        let Problem { stage_cost, terminal_cost, path, terminal, .. } = self.problem.parts();
        let before_end =
            AvailableVariables { z: P::Dynamics::ALGEBRAIC, u: true, stage: 0, t: false, degrees: &[] };
        let at_end = AvailableVariables { z: false, u: false, stage: intervals, t: false, degrees: &[] };
        stage_cost.check(before_end)?;
        terminal_cost.check(at_end)?;
        path.check(before_end)?;
        terminal.check(at_end)
    }

    /// Finds the first number of the iterate that is not finite.
    fn find_non_finite(&self) -> Result<(), OcpError> {
        let (last, part) = (self.intervals(), Part::Multipliers);
        for (stage, point) in self.iterate.stages().enumerate() {
            Labels::states::<P, T>(Part::States, stage).check_finite(point.x)?;
            for (part, values) in [(Part::Controls, point.u), (part, point.u_lower), (part, point.u_upper)] {
                let (w, u) = values.split_at_checked(self.free.count()).unwrap_or_default();
                Labels::controls::<P, T>(part, stage).check_finite(u)?;
                self.check_free_parameters(part, w)?;
            }
            for multipliers in [point.dynamics, point.x_lower, point.x_upper] {
                Labels::states::<P, T>(part, stage).check_finite(multipliers)?;
            }
            let bounds = if stage == last { Part::TerminalBounds } else { Part::PathBounds };
            let constraint_labels = Labels { part, ..Labels::constraints::<P, T>(bounds, stage) };
            for multipliers in [point.g_lower, point.g_upper] {
                constraint_labels.check_finite(multipliers)?;
            }
        }
        Ok(())
    }

    /// Checks free parameters, or their multipliers, by name.
    fn check_free_parameters(&self, part: Part, w: &[T]) -> Result<(), OcpError> {
        let Some((index, value)) = crate::finite::find_non_finite(w) else { return Ok(()) };
        let part = if part == Part::Controls { Part::Parameters } else { part };
        Err(OcpError::InvalidValue { part, stage: 0, name: self.free_parameter_name(index), index, value })
    }
}
