//! The entries of a Jacobian of the model: row, column, value.

use crate::model::{Dae, Pattern};
use crate::shape::Plain;

/// The entries of a Jacobian: row, column, value.
#[inline(always)]
pub(crate) fn entries<M: Dae, V>(jacobian: &[V]) -> impl Iterator<Item = (usize, usize, &V)> {
    let Pattern { rows, columns } = M::STRUCTURE.jacobian;
    let places = rows.iter().zip(columns);
    places.zip(jacobian).map(|((row, column), value)| (*row as usize, *column as usize, value))
}

/// An entry of a Jacobian: row, column, value.
#[inline(always)]
pub(crate) fn entry<M: Dae, V: Plain>(jacobian: &M::Jacobian<V>, index: usize) -> Option<(usize, usize, &V)> {
    let Pattern { rows, columns } = M::STRUCTURE.jacobian;
    let &row = rows.get(index)?;
    let &column = columns.get(index)?;
    let value = jacobian.as_ref().get(index)?;
    Some((row as usize, column as usize, value))
}
