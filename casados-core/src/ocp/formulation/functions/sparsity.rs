//! Structural sparsity of the derivatives of a problem, from the expression graphs of its
//! functions.

use crate::function::Function;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::structure::Pattern;

/// A structural entry of derivatives over `(x, u, z)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DerivativeEntry {
    /// An entry of a Jacobian: output and variable.
    Jacobian(usize, usize),
    /// An entry of a Hessian: two variables, in either order.
    Hessian(usize, usize),
}

/// Receives structural entries.
pub type EntryVisitor<'a> = &'a mut dyn FnMut(DerivativeEntry);

/// The functions that determine the sparsity of `φ`.
#[derive(Clone, Copy, Debug)]
pub enum DynamicsStructure {
    /// Unknown.
    Unknown,
    /// The equations of a model: the patterns of their first and second derivatives.
    Equations(Pattern, Pattern),
    /// A function of `(x, z, u, p)`: the patterns of its first and second derivatives.
    Map(Pattern, Pattern),
}

/// Visits the entries of the Jacobian of a function.
pub(in crate::ocp) fn visit_jacobian<F: Function>(visit: EntryVisitor<'_>) {
    for (row, variable) in F::STRUCTURE.jacobian.iter() {
        if let Some(position) = FreeParametersView::default().position::<F::Shape>(variable) {
            visit(DerivativeEntry::Jacobian(row, position));
        }
    }
}

/// Visits the entries of the Hessian of a weighted sum of the outputs of a function.
pub(in crate::ocp) fn visit_hessian<F: Function>(visit: EntryVisitor<'_>) {
    for (one, other) in F::STRUCTURE.hessian.iter() {
        if let (Some(one), Some(other)) = (
            FreeParametersView::default().position::<F::Shape>(one),
            FreeParametersView::default().position::<F::Shape>(other),
        ) {
            visit(DerivativeEntry::Hessian(one, other));
        }
    }
}

/// Visits the entries of `JᵀWJ`; `coupled` if `W` is not diagonal.
pub(in crate::ocp) fn visit_gauss_newton<F: Function>(coupled: bool, visit: EntryVisitor<'_>) {
    let jacobian_entries = || F::STRUCTURE.jacobian.iter();
    for (k, one) in jacobian_entries() {
        for (_, other) in jacobian_entries().filter(|&(l, _)| coupled || k == l) {
            if let (Some(one), Some(other)) = (
                FreeParametersView::default().position::<F::Shape>(one),
                FreeParametersView::default().position::<F::Shape>(other),
            ) {
                visit(DerivativeEntry::Hessian(one, other));
            }
        }
    }
}
