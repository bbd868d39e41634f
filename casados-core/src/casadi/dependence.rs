//! Which derivatives of the end of an interval may differ from zero: what the graph of a model
//! knows, followed over stages and steps.
//!
//! The unknown `ẋ_j` or `z_j` is matched with an equation that contains it, so that no equation is
//! matched twice. It depends on what that equation contains, and this on what it depends on in
//! turn: the entries of `A⁻¹ B` that differ from zero for general values of the entries of `A` and
//! `B` (J. R. Gilbert, "Predicting structure in sparse matrix computations", SIAM J. Matrix Anal.
//! Appl. 15, 1994). A state depends on its derivative, within a step by the tableau and from step
//! to step.

use super::sparsity::Dependence;
use crate::structure::Pattern;
use alloc::vec;
use alloc::vec::Vec;

/// The numbers of states, of algebraic states, and of directions `w = (x₀, u, p)` of a model.
#[derive(Clone, Copy, Debug)]
pub struct Dimensions {
    /// States.
    pub nx: usize,
    /// Algebraic states.
    pub nz: usize,
    /// States, controls and parameters.
    pub nw: usize,
}

impl Dimensions {
    /// Those of a model.
    pub const fn of<M: crate::model::Dae>() -> Self {
        use crate::shape::Shape;
        Self { nx: M::Shape::NX, nz: M::Shape::NZ, nw: M::Shape::NW }
    }

    /// The variable that an unknown `(ẋ, z)` is.
    const fn variable(self, unknown: usize) -> usize {
        if unknown < self.nx { unknown } else { self.nx + unknown }
    }
}

/// Of which of the directions `w = (x₀, u, p)` the variables `(ẋ, x, z, u, p)` depend; `jacobian`
/// has the non-zeros of the model's.
///
/// `depth` is the number of evaluations of the model that come one after the other in an explicit
/// method, each of which leads one equation further. In an implicit one each depends on all, and
/// what holds at a stage holds at the end.
pub fn variables(dimensions: Dimensions, jacobian: Pattern, depth: Option<usize>) -> Dependence {
    let Dimensions { nx, nz, nw } = dimensions;
    let mut relation = Dependence::zero(nx + nz + nw, nw);
    // States, controls and parameters are themselves.
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

/// Which entries of the Hessian of any `λᵀy` over `w` may differ from zero, where `second` are
/// those of second derivatives by the variables.
pub fn curvature(variables: &Dependence, second: Pattern, hessian: &mut Dependence) {
    for (one, other) in second.iter() {
        hessian.add_row_products(variables, one, other);
    }
}

/// An equation for each unknown `(ẋ, z)`, by augmenting paths; none if there is no perfect
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

/// Finds an unknown for an equation, and other ones for those it takes them from.
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
