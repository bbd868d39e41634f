//! The entries of a Jacobian of the model: row, column, value.

use crate::model::{Dae, Pattern, Structure};
use crate::shape::Plain;

/// The entries from `begin` to `end` of a Jacobian: row, column, value.
#[inline(always)]
pub(crate) fn entries<'a, V>(
    structure: &Structure,
    jacobian: &'a [V],
    begin: usize,
    end: usize,
) -> impl Iterator<Item = (usize, usize, &'a V)> + use<'a, V> {
    let Pattern { rows, columns } = structure.jacobian;
    let places =
        rows.get(begin..end).unwrap_or_default().iter().zip(columns.get(begin..end).unwrap_or_default());
    let values = jacobian.get(begin..end).unwrap_or_default();
    places.zip(values).map(|((row, column), value)| (*row as usize, *column as usize, value))
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
