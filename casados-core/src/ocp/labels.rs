//! What the numbers of a problem are called where they are refused: as the model does.

use super::check::Labels;
use super::constraint::Constraints;
use super::cost::Cost;
use super::dynamics::Dynamics;
use super::error::Part;
use super::names::Names;
use super::problem::Formulation;
use crate::scalar::Real;

const fn names<P: Formulation<T>, T: Real>() -> Names {
    <P::Dynamics as Dynamics<T>>::NAMES
}

fn listed(names: &[&'static str], index: usize) -> (&'static str, usize) {
    (names.get(index).copied().unwrap_or(""), index)
}

impl Labels {
    /// Of states: of the iterate, of the start, or of bounds.
    pub fn states<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        Self { part, stage, name: |index| listed(names::<P, T>().x, index) }
    }
    /// Of controls.
    pub fn controls<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        Self { part, stage, name: |index| listed(names::<P, T>().u, index) }
    }
    /// Of parameters.
    pub fn parameters<P: Formulation<T>, T: Real>(stage: usize) -> Self {
        Self { part: Part::Parameters, stage, name: |index| listed(names::<P, T>().p, index) }
    }
    /// Of constraints.
    pub fn constraints<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        let name = if part == Part::TerminalBounds { P::Terminal::name } else { P::Path::name };
        Self { part, stage, name }
    }
    /// Of references.
    pub fn references<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        let name = if part == Part::TerminalReference { P::TerminalCost::name } else { P::StageCost::name };
        Self { part, stage, name }
    }
}
