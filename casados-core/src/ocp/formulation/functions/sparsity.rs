//! Where derivatives of a problem may differ from zero: what the graphs of its functions know.

use crate::function::Function;
use crate::ocp::formulation::free_parameters::FreeParametersView;
use crate::structure::Pattern;

/// An entry of derivatives over `(x, u, z)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DerivativeEntry {
    /// Of a Jacobian: output and variable.
    Jacobian(usize, usize),
    /// Of a Hessian: two variables, in one order or the other.
    Hessian(usize, usize),
}

/// What takes entries.
pub type EntryVisitor<'a> = &'a mut dyn FnMut(DerivativeEntry);

/// What the ends of intervals follow from.
#[derive(Clone, Copy, Debug)]
pub enum DynamicsStructure {
    /// Nothing is known.
    Unknown,
    /// The equations of a model: where these and their second derivatives have entries.
    Equations(Pattern, Pattern),
    /// A function of `(x, z, u, p)`.
    Map(Pattern, Pattern),
}

/// The entries of the Jacobian of a function.
pub(in crate::ocp) fn visit_jacobian<F: Function>(visit: EntryVisitor<'_>) {
    for (row, variable) in F::STRUCTURE.jacobian.iter() {
        if let Some(position) = FreeParametersView::default().position::<F::Shape>(variable) {
            visit(DerivativeEntry::Jacobian(row, position));
        }
    }
}

/// The entries of the Hessian of any sum of the outputs of a function.
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

/// The entries of `JᵀWJ`, where weights couple different outputs or not.
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
