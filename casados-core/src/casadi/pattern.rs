//! Sparsity patterns of the matrices of a stage: those of the model, costs and constraints,
//! propagated through the interval.

use super::dependence::{self, Dimensions};
use super::sparsity::Dependence;
use crate::ocp::{Constraints, Cost, DerivativeEntry, Dynamics, DynamicsStructure, Formulation, Problem};
use crate::shape::Shape;
use crate::structure::Pattern;

/// The sparsity patterns of a stage, with respect to its states and controls.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StagePattern {
    /// The Jacobian of the end of the interval, followed by that of the constraints.
    pub jacobian: Dependence,
    /// The contribution of the interval to the Hessian of the Lagrangian.
    pub interval: Dependence,
    /// The contribution of costs and constraints at the node.
    pub node: Dependence,
}

/// What a stage has.
struct Stage {
    pattern: StagePattern,
    /// The states and controls on which each of `(x, u, z)` depends.
    variables: Dependence,
    /// The number of rows of the end of the interval.
    next: usize,
}

impl Stage {
    /// Adds the pattern of a function at the node; a dense one if it has none.
    fn add(&mut self, first: usize, tell: impl FnOnce(&mut dyn FnMut(DerivativeEntry)) -> bool) {
        let Self { pattern: StagePattern { jacobian, node, .. }, variables, .. } = self;
        let is_known = tell(&mut |entry| match entry {
            DerivativeEntry::Jacobian(row, variable) => {
                jacobian.add_row(first + row, variables, variable);
            }
            DerivativeEntry::Hessian(one, other) => node.add_row_products(variables, one, other),
        });
        if !is_known {
            (first..jacobian.rows()).for_each(|row| jacobian.fill(row));
            (0..node.rows()).for_each(|row| node.fill(row));
        }
    }

    /// Adds the end of the interval.
    fn add_interval_end(&mut self, origin: DynamicsStructure, dimensions: Dimensions, controls: usize) {
        let Dimensions { nx, nz, .. } = dimensions;
        match origin {
            DynamicsStructure::Unknown => {
                (0..self.next).for_each(|row| self.pattern.jacobian.fill(row));
                (0..nx + controls).for_each(|row| self.pattern.interval.fill(row));
                (0..nz).for_each(|row| self.variables.fill(nx + controls + row));
            }
            DynamicsStructure::Equations(jacobian, hessian) => {
                let on = dependence::variables(dimensions, jacobian, None);
                for row in 0..nx {
                    self.pattern.jacobian.add_row(row, &on, nx + row);
                }
                for row in 0..nz {
                    self.variables.add_row(nx + controls + row, &on, 2 * nx + row);
                }
                for (one, other) in hessian.iter() {
                    self.pattern.interval.add_row_products(&on, one, other);
                }
            }
            DynamicsStructure::Map(jacobian, hessian) => self.map(jacobian, hessian, dimensions, controls),
        }
    }

    /// Adds the end of the interval as a function of the variables `(ẋ, x, z, u, …)` of a model.
    fn map(&mut self, jacobian: Pattern, hessian: Pattern, Dimensions { nx, nz, .. }: Dimensions, nu: usize) {
        let position = |variable: usize| match variable.checked_sub(nx)? {
            state if state < nx => Some(state),
            other => other.checked_sub(nz).filter(|&control| (nx..nx + nu).contains(&control)),
        };
        for (row, variable) in jacobian.iter() {
            if let Some(column) = position(variable) {
                self.pattern.jacobian.set(row, column);
            }
        }
        for (one, other) in hessian.iter() {
            if let (Some(one), Some(other)) = (position(one), position(other)) {
                self.pattern.interval.add_row_products(&self.variables, one, other);
            }
        }
    }
}

/// The patterns of a stage, the last one or another, with `rows` constraints.
pub fn stage_pattern<P: Formulation<f64>>(problem: &mut P, is_last: bool, rows: usize) -> StagePattern {
    let [nx, nz, nu] = [P::Shape::NX, P::Shape::NZ, P::Shape::NU];
    let [next, nu, nz] = if is_last { [0; 3] } else { [nx, nu, nz] };
    let n = nx + nu;
    let mut variables = Dependence::zero(n + nz, n);
    (0..n).for_each(|variable| variables.set(variable, variable));
    let [interval, node] = [Dependence::zero(n, n), Dependence::zero(n, n)];
    let pattern = StagePattern { jacobian: Dependence::zero(next + rows, n), interval, node };
    let mut stage = Stage { pattern, variables, next };
    let Problem { stage_cost, terminal_cost, path, terminal, .. } = problem.parts();
    if is_last {
        stage.add(next, |visit| terminal.visit_sparsity(visit));
        stage.add(next + rows, |visit| terminal_cost.visit_sparsity(visit));
    } else {
        let dimensions = Dimensions { nx, nz, nw: P::Shape::NW };
        stage.add_interval_end(<P::Dynamics as Dynamics<f64>>::STRUCTURE, dimensions, nu);
        stage.add(next, |visit| path.visit_sparsity(visit));
        stage.add(next + rows, |visit| stage_cost.visit_sparsity(visit));
    }
    stage.pattern
}
