//! The coefficients of a tableau, and sums over stages.

use crate::linalg::{Arithmetic, Eigenbasis};
use crate::scalar::{Field, Lanes};
use crate::tableau::Tableau;

/// The coefficients of a tableau in the number type of the integrator.
#[derive(Clone)]
pub(crate) struct Coefficients<E, const S: usize> {
    pub a: [[E; S]; S],
    pub b: [E; S],
    pub c: [E; S],
    /// Values of the Lagrange polynomials at the start of the step.
    pub lagrange_start: [E; S],
    /// Values of the Lagrange polynomials at the end of the step.
    pub lagrange_end: [E; S],
    /// Values of the Lagrange polynomials at the stages of a next step of the same size, one row
    /// for each of its stages; `None` without extrapolation.
    pub lagrange_next: Option<[[E; S]; S]>,
    /// The eigenbasis of `A`; `None` if stage-wise blocks are cheaper.
    pub eigenbasis: Option<Eigenbasis<E, S, S>>,
    pub tableau: Tableau<S>,
}

impl<E: Lanes, const S: usize> Coefficients<E, S> {
    /// Converts the tableau; with the eigenbasis if `shared` Jacobians are used. Not inlined, since
    /// inlining would scalarise every coefficient in the caller.
    #[cfg_attr(feature = "std", inline(never))]
    pub fn new(tableau: Tableau<S>, shared: bool) -> Self {
        let mut end = tableau.lagrange(1.0);
        if tableau.is_stiffly_accurate() {
            // The last node is the end of the step: exactly 1, without rounding error.
            end = [0.0; S];
            if let Some(last) = end.last_mut() {
                *last = 1.0;
            }
        }
        let next = tableau.c().map(|c| tableau.lagrange(1.0 + c));
        let finite = next.as_flattened().iter().all(|l| l.is_finite());
        Self {
            a: cast_matrix(tableau.a()),
            b: cast_row(tableau.b()),
            c: cast_row(tableau.c()),
            lagrange_start: cast_row(&tableau.lagrange(0.0)),
            lagrange_end: cast_row(&end),
            // Extrapolation by polynomials of higher degree is inaccurate.
            lagrange_next: (finite && S <= 4).then(|| cast_matrix(&next)),
            eigenbasis: if const { S < 3 } || !shared { None } else { Eigenbasis::new(&tableau) },
            tableau,
        }
    }
}

/// Converts to the number type of the integrator. A loop compiles faster than `map`.
#[inline(always)]
fn cast_row<E: Lanes, const S: usize>(from: &[f64; S]) -> [E; S] {
    let mut to = [E::from_f64(0.0); S];
    for (to, from) in to.iter_mut().zip(from) {
        *to = E::from_f64(*from);
    }
    to
}

#[inline(always)]
fn cast_matrix<E: Lanes, const S: usize>(from: &[[f64; S]; S]) -> [[E; S]; S] {
    let mut to = [[E::from_f64(0.0); S]; S];
    for (to, from) in to.iter_mut().zip(from) {
        *to = cast_row(from);
    }
    to
}

/// `x + h Σ_j a_ij k_j`
#[inline(always)]
pub(super) fn stage_values<A: Arithmetic, E: Field, const S: usize>(
    x: E,
    minus_ha: &[[E; S]; S],
    k: &[E; S],
) -> [E; S] {
    let mut sum = [x; S];
    for (column, &k) in minus_ha.iter().zip(k) {
        for (sum, &element) in sum.iter_mut().zip(column) {
            *sum = A::subtract(*sum, element, k);
        }
    }
    sum
}

/// `h c_i`, as sums of the rows of `hA`.
#[inline(always)]
pub(super) fn nodes<E: Lanes, const S: usize>(a: &[[E; S]; S], h: E) -> [E; S] {
    let mut nodes = [E::from_f64(0.0); S];
    for (node, row) in nodes.iter_mut().zip(a) {
        for &a in row {
            *node = *node + h * a;
        }
    }
    nodes
}

/// `Σ_j a_j b_j`
#[inline(always)]
pub(crate) fn dot<E: Field, const S: usize>(a: &[E; S], b: &[E; S]) -> E {
    let mut sum = E::from_f64(0.0);
    for (a, b) in a.iter().zip(b) {
        sum = sum + *a * *b;
    }
    sum
}
