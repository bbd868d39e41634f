//! Structural dependence of the end of an interval: the sparsity of the model's graph, propagated
//! over stages and steps.
//!
//! Each unknown `ẋ_j` or `z_j` is matched with an equation that contains it (a perfect matching).
//! It depends on the variables of that equation, and recursively on their dependencies: the
//! non-zeros of `A⁻¹ B` for general entries of `A` and `B` (J. R. Gilbert, "Predicting structure in
//! sparse matrix computations", SIAM J. Matrix Anal. Appl. 15, 1994). A state depends on its
//! derivative, within a step by the tableau and from step to step.

use super::sparsity::Dependence;
use crate::structure::Pattern;
use alloc::vec;
use alloc::vec::Vec;

/// The numbers of states, algebraic states and directions `w = (x₀, u, p)` of a model.
#[derive(Clone, Copy, Debug)]
pub struct Dimensions {
    /// The number of states.
    pub nx: usize,
    /// The number of algebraic states.
    pub nz: usize,
    /// The number of states, controls and parameters.
    pub nw: usize,
}

impl Dimensions {
    /// The dimensions of a model.
    pub const fn of<M: crate::model::Dae>() -> Self {
        use crate::shape::Shape;
        Self { nx: M::Shape::NX, nz: M::Shape::NZ, nw: M::Shape::NW }
    }

    /// The index of an unknown `(ẋ, z)` among the variables.
    const fn variable(self, unknown: usize) -> usize {
        if unknown < self.nx { unknown } else { self.nx + unknown }
    }
}

/// The directions `w = (x₀, u, p)` on which the variables `(ẋ, x, z, u, p)` depend; `jacobian` has
/// the non-zeros of the model's Jacobian.
///
/// `depth` is the number of successive model evaluations of an explicit method, each of which
/// propagates dependencies by one equation. In an implicit method all stages depend on each other,
/// and the end has the dependencies of the stages.
pub fn variables(dimensions: Dimensions, jacobian: Pattern, depth: Option<usize>) -> Dependence {
    let Dimensions { nx, nz, nw } = dimensions;
    let mut relation = Dependence::zero(nx + nz + nw, nw);
    // States, controls and parameters depend on themselves.
    for direction in 0..nx {
        relation.set(nx + direction, direction);
    }
    for direction in nx..nw {
        relation.set(nx + nz + direction, direction);
    }
    let equations = match_equations(dimensions, jacobian);
    let mut contains = vec![Vec::new(); nx + nz];
    for (equation, variable) in jacobian.iter() {
        if let Some(variables) = contains.get_mut(equation) {
            variables.push(variable);
        }
    }
    for _ in 0..depth.unwrap_or(usize::MAX) {
        let before = relation.clone();
        let mut news = false;
        for (unknown, equation) in equations.iter().enumerate() {
            let variable = dimensions.variable(unknown);
            for from in equation.and_then(|equation| contains.get(equation)).into_iter().flatten() {
                news |= relation.add_row(variable, &before, *from);
            }
            if equation.is_none() {
                (0..nw).for_each(|direction| relation.set(variable, direction));
            }
        }
        let after = relation.clone();
        for state in 0..nx {
            news |= relation.add_row(nx + state, &after, state);
        }
        if !news {
            break;
        }
    }
    relation
}

/// The entries of the Hessian of any `λᵀy` with respect to `w` that may be non-zero, given the
/// second derivatives with respect to the variables.
pub fn curvature(variables: &Dependence, second: Pattern, hessian: &mut Dependence) {
    for (one, other) in second.iter() {
        hessian.add_row_products(variables, one, other);
    }
}

/// Matches an equation with each unknown `(ẋ, z)` by augmenting paths; none if there is no perfect
/// matching.
fn match_equations(Dimensions { nx, nz, .. }: Dimensions, jacobian: Pattern) -> Vec<Option<usize>> {
    let nk = nx + nz;
    let mut unknowns_of = vec![Vec::new(); nk];
    for (equation, variable) in jacobian.iter() {
        let unknown = match variable {
            _ if variable < nx => Some(variable),
            _ if (2 * nx..nx + nk).contains(&variable) => Some(variable - nx),
            _ => None,
        };
        if let (Some(unknowns), Some(unknown)) = (unknowns_of.get_mut(equation), unknown) {
            unknowns.push(unknown);
        }
    }
    let mut equation_of = vec![None; nk];
    for equation in 0..nk {
        augment(equation, &unknowns_of, &mut equation_of, &mut vec![false; nk]);
    }
    equation_of
}

/// Matches an equation with an unknown, and rematches other equations along an augmenting path.
fn augment(
    equation: usize,
    unknowns_of: &[Vec<usize>],
    equation_of: &mut [Option<usize>],
    seen: &mut [bool],
) -> bool {
    for &unknown in unknowns_of.get(equation).into_iter().flatten() {
        if seen.get(unknown) != Some(&false) {
            continue;
        }
        seen[unknown] = true;
        let taken = equation_of[unknown];
        if taken.is_none_or(|other| augment(other, unknowns_of, equation_of, seen)) {
            equation_of[unknown] = Some(equation);
            return true;
        }
    }
    false
}
