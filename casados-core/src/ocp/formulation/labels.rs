//! What the numbers of a problem are called where they are refused: as the model does.

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::Part;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
use crate::scalar::Real;
use crate::shape::Shape;
use core::fmt;

const fn names<P: Formulation<T>, T: Real>() -> Names {
    <P::Dynamics as Dynamics<T>>::NAMES
}

fn listed(names: &[&'static str], index: usize) -> (&'static str, usize) {
    (names.get(index).copied().unwrap_or(""), index)
}

/// What a constraint is called: as its function, with the output where that has several.
pub(in crate::ocp) struct OutputName {
    function: &'static str,
    output: Option<usize>,
}

impl OutputName {
    /// Whether a name means it: that of the function means all of its outputs.
    pub fn is_meant(&self, name: &str) -> bool {
        let Some(rest) = name.strip_prefix(self.function) else { return false };
        let index = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        rest.is_empty() || index.is_some_and(|index| index.parse() == Ok(self.output.unwrap_or(0)))
    }
}

/// The name of a row.
pub(in crate::ocp) fn output<C: Constraints<S, T>, S: Shape, T: Real>(row: usize) -> OutputName {
    let (function, output) = C::name(row);
    let has_others = (0..C::ROWS).map(C::name).any(|(other, output)| other == function && output > 0);
    OutputName { function, output: has_others.then_some(output) }
}

impl fmt::Display for OutputName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.output {
            Some(output) => write!(f, "{}[{output}]", self.function),
            None => f.write_str(self.function),
        }
    }
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
    pub fn parameters<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        Self { part, stage, name: |index| listed(names::<P, T>().p, index) }
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
