//! Where derivatives of a problem may differ from zero: what the graphs of its functions know.

use crate::function::Function;
use crate::ocp::formulation::free::Free;
use crate::structure::Pattern;

/// An entry of derivatives over `(x, u, z)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// Of a Jacobian: output and variable.
    Slope(usize, usize),
    /// Of a Hessian: two variables, in one order or the other.
    Curvature(usize, usize),
}

/// What takes entries.
pub type Entries<'a> = &'a mut dyn FnMut(Entry);

/// What the ends of intervals follow from.
#[derive(Clone, Copy, Debug)]
pub enum Origin {
    /// Nothing is known.
    Unknown,
    /// The equations of a model: where these and their second derivatives have entries.
    Equations(Pattern, Pattern),
    /// A function of `(x, z, u, p)`.
    Map(Pattern, Pattern),
}

/// The entries of the Jacobian of a function.
pub(in crate::ocp) fn slopes<F: Function>(visit: Entries<'_>) {
    for (row, variable) in F::STRUCTURE.jacobian.iter() {
        if let Some(position) = Free::default().position::<F::Shape>(variable) {
            visit(Entry::Slope(row, position));
        }
    }
}

/// The entries of the Hessian of any sum of the outputs of a function.
pub(in crate::ocp) fn curvature<F: Function>(visit: Entries<'_>) {
    for (one, other) in F::STRUCTURE.hessian.iter() {
        if let (Some(one), Some(other)) =
            (Free::default().position::<F::Shape>(one), Free::default().position::<F::Shape>(other))
        {
            visit(Entry::Curvature(one, other));
        }
    }
}

/// The entries of `JᵀWJ`, where weights couple different outputs or not.
pub(in crate::ocp) fn squares<F: Function>(coupled: bool, visit: Entries<'_>) {
    let entries = || F::STRUCTURE.jacobian.iter();
    for (k, one) in entries() {
        for (_, other) in entries().filter(|&(l, _)| coupled || k == l) {
            if let (Some(one), Some(other)) =
                (Free::default().position::<F::Shape>(one), Free::default().position::<F::Shape>(other))
            {
                visit(Entry::Curvature(one, other));
            }
        }
    }
}
