//! Labels of the elements of a problem in errors, by the names of the model.

use crate::ocp::formulation::check::Labels;
use crate::ocp::formulation::error::Part;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::Dynamics;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::Ocp;
#[cfg(feature = "alloc")]
use crate::ocp::formulation::instance::inner_points::InnerRow;
use crate::ocp::formulation::names::Names;
use crate::ocp::formulation::problem::Formulation;
#[cfg(feature = "alloc")]
use crate::qp::StageDims;
use crate::scalar::Real;
use crate::shape::Shape;
#[cfg(feature = "alloc")]
use alloc::format;
#[cfg(feature = "alloc")]
use alloc::string::{String, ToString};
use core::fmt;

const fn model_names<P: Formulation<T>, T: Real>() -> Names {
    <P::Dynamics as Dynamics<T>>::NAMES
}

fn name_and_index(names: &[&'static str], index: usize) -> (&'static str, usize) {
    (names.get(index).copied().unwrap_or(""), index)
}

/// The name of a constraint: its function, with the output if it has several.
pub(in crate::ocp) struct OutputName {
    function: &'static str,
    output: Option<usize>,
}

impl OutputName {
    /// Returns whether a name denotes this output; the name of the function denotes all of its
    /// outputs.
    pub fn matches(&self, name: &str) -> bool {
        let Some(rest) = name.strip_prefix(self.function) else { return false };
        let index = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        rest.is_empty() || index.is_some_and(|index| index.parse() == Ok(self.output.unwrap_or(0)))
    }
}

/// Returns the name of a row.
pub(in crate::ocp) fn output_name<C: Constraints<S, T>, S: Shape, T: Real>(row: usize) -> OutputName {
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
    /// Labels of states, of the initial state or of bounds of states.
    pub fn states<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        Self { part, stage, name: |index| name_and_index(model_names::<P, T>().x, index) }
    }
    /// Labels of controls.
    pub fn controls<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        Self { part, stage, name: |index| name_and_index(model_names::<P, T>().u, index) }
    }
    /// Labels of algebraic states.
    pub fn algebraic<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        Self { part, stage, name: |index| name_and_index(model_names::<P, T>().z, index) }
    }
    /// Labels of parameters.
    pub fn parameters<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        Self { part, stage, name: |index| name_and_index(model_names::<P, T>().p, index) }
    }
    /// Labels of constraints.
    pub fn constraints<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        let name = if part == Part::TerminalBounds { P::Terminal::name } else { P::Path::name };
        Self { part, stage, name }
    }
    /// Labels of references.
    pub fn references<P: Formulation<T>, T: Real>(part: Part, stage: usize) -> Self {
        let name = if part == Part::TerminalReference { P::TerminalCost::name } else { P::StageCost::name };
        Self { part, stage, name }
    }
}

#[cfg(feature = "alloc")]
impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Returns the name, with its point, and the unit of a row that follows the path constraints at
    /// the nodes.
    pub(in crate::ocp) fn inner_row_name_and_unit(&self, index: usize) -> (String, &'static str) {
        let units = <P::Dynamics as Dynamics<T>>::NAMES.units;
        let unit_at =
            |units: &'static [&'static str], index: usize| units.get(index).copied().unwrap_or_default();
        let (row, (name, _)) = self.inner_points.row_name::<P>(index);
        let (name, unit) = match row {
            InnerRow::Path { row, .. } => {
                (output_name::<P::Path, P::Shape, T>(row).to_string(), P::Path::unit(row))
            }
            InnerRow::Variable { variable, .. } => match variable.checked_sub(P::Shape::NX) {
                None => (name.to_string(), unit_at(units.x, variable)),
                Some(z) => (name.to_string(), unit_at(units.z, z)),
            },
        };
        match row.point() {
            0 => (name, unit),
            point => (format!("{name}@{}", self.inner_points.fraction(point).to_f64()), unit),
        }
    }
}
