//! Whether a problem is known to be convex, and the largest violation of an iterate.

use crate::ocp::formulation::error::ConstraintName;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::functions::sparsity::{DerivativeEntry, DynamicsStructure};
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::StageDims;
use crate::scalar::Real;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns whether the problem is known to be convex, and the largest violation of the iterate,
    /// if `with_violation`.
    pub(in crate::ocp) fn convexity_and_violation(
        &mut self,
        with_violation: bool,
    ) -> (bool, Option<(ConstraintName, f64)>) {
        #[cfg(feature = "alloc")]
        let violated = if with_violation { self.largest_violation() } else { None };
        #[cfg(not(feature = "alloc"))]
        let violated = None.filter(|_| with_violation);
        (self.is_convex(), violated)
    }

    /// Whether dynamics and constraints are known to be linear, and costs to be convex.
    fn is_convex(&self) -> bool {
        let is_linear = match P::Dynamics::STRUCTURE {
            DynamicsStructure::Unknown => false,
            DynamicsStructure::Equations(_, hessian) | DynamicsStructure::Map(_, hessian) => {
                hessian.is_empty()
            }
        };
        let costs = P::StageCost::CONVEX_IN_VARIABLES && P::TerminalCost::CONVEX_IN_VARIABLES;
        let Problem { path, terminal, .. } = self.problem.parts_ref();
        let mut has_hessian_entries = false;
        let mut visit = |entry| has_hessian_entries |= matches!(entry, DerivativeEntry::Hessian(..));
        let is_known = path.visit_sparsity(&mut visit) && terminal.visit_sparsity(&mut visit);
        is_linear && costs && is_known && !has_hessian_entries
    }
}
