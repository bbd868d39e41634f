//! What is asked of a problem that is handed to solvers of nonlinear programs.

use super::algebraic;
use super::constraint::Constraints;
use super::data::{Node, split};
use super::error::OcpError;
use super::instance::Ocp;
use super::point::read;
use super::problem::{Formulation, Problem};
use crate::qp::{StageDims, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// After [`Ocp::linearise`]: the objective without penalties, and `g` of every stage in
    /// `values`.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    pub(crate) fn constraints(&mut self, values: &mut [T]) -> Result<T, OcpError> {
        let intervals = self.intervals();
        let data = split::<P, T>(self.data.as_mut(), intervals);
        let Problem { path, terminal, running, .. } = self.problem.parts();
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, at) in self.iterate.stages().enumerate() {
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, _) = algebraic::at::<P::Shape, T>(data.algebraic, k);
            read::<P::Shape, T>(&mut point, [at.x, z, at.u, node.p], node.time);
            let values = values.get_mut(k * P::Path::ROWS..).unwrap_or_default();
            if k < intervals {
                path.value(&point, part_mut(values, 0, P::Path::ROWS), k)?;
            } else {
                terminal.value(&point, part_mut(values, 0, P::Terminal::ROWS), k)?;
            }
        }
        Ok(self.objective)
    }

    /// Whether the first state has a cost of its own, by which all of its elements may be coupled.
    pub(crate) fn has_arrival_cost(&mut self) -> bool {
        let intervals = self.intervals();
        let arrival = split::<P, T>(self.data.as_mut(), intervals).arrival;
        arrival.iter().skip(P::Shape::NX).any(|&weight| weight != T::ZERO)
    }
}
