//! The entries of a Jacobian of the model: row, column, value.

use crate::model::{Dae, Pattern};

/// Iterates over the entries of a Jacobian: row, column, value.
#[inline(always)]
pub(crate) fn entries<M: Dae, V>(jacobian: &[V]) -> impl Iterator<Item = (usize, usize, &V)> {
    let Pattern { rows, columns } = M::STRUCTURE.jacobian;
    let places = rows.iter().zip(columns);
    places.zip(jacobian).map(|((row, column), value)| (*row as usize, *column as usize, value))
}
