//! The rank of the matrix `∂f/∂(ẋ, z)` of the reduced model at sample points: redundant constraints
//! are not a structural property.

use super::variable_name;
use crate::graph::Node;
use crate::structure::samples;
use crate::structure::{Analysis, samplings};
use syn::{Error, Result};

/// Pivots below this, relative to the largest one of a scaled matrix, count as zero.
const ZERO_PIVOT_TOLERANCE: f64 = 1e-11;
/// Elements of null vectors below this, relative to the largest one, count as zero.
const MIN_NULL_VECTOR_ELEMENT: f64 = 1e-6;

/// The number of sample points with a singular matrix, and the number of all; `differentiated`:
/// whether any equation was differentiated.
///
/// # Errors
/// If all are singular: names the redundant equations, and the unknowns that they leave
/// undetermined.
pub fn check(analysis: &Analysis, differentiated: bool) -> Result<[u32; 2]> {
    let model = &analysis.model;
    let (nx, count) = (model.variables.x.len() as u32, model.residual.len());
    let entries: Vec<(usize, usize, Node)> = analysis.derivatives.jacobian[..analysis.derivatives.blocks[3]]
        .iter()
        .filter(|entry| !(nx..2 * nx).contains(&entry.1))
        .map(|&(row, variable, value)| {
            let column = if variable < nx { variable } else { variable - nx };
            (row as usize, column as usize, value)
        })
        .collect();
    let nodes: Vec<Node> = entries.iter().map(|entry| entry.2).collect();
    let points = samples::values(&model.graph, &nodes, &samplings(model), model.opaque.len());
    let matrix = |values: &Vec<f64>, transposed: bool| {
        let mut matrix = vec![vec![0.0; count]; count];
        for (&(row, column, _), &value) in entries.iter().zip(values) {
            let (row, column) = if transposed { (column, row) } else { (row, column) };
            matrix[row][column] = value;
        }
        matrix
    };
    let singular = points.iter().filter(|values| null_vector(matrix(values, false), false).is_some()).count();
    if singular < points.len() || points.is_empty() {
        return Ok([singular as u32, points.len() as u32]);
    }
    let members = |transposed: bool| -> Vec<usize> {
        let vector = null_vector(matrix(&points[0], transposed), true).unwrap_or_default();
        let largest = vector.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
        (0..vector.len()).filter(|&index| vector[index].abs() > MIN_NULL_VECTOR_ELEMENT * largest).collect()
    };
    let (equations, unknowns) = (members(true), members(false));
    let number = |equation: &usize| equation.to_string();
    let name = |&unknown: &usize| {
        let unknown = unknown as u32;
        variable_name(&model.variables, if unknown < nx { unknown } else { unknown + nx })
    };
    let message = format!(
        "the index cannot be reduced: {}equations {} are dependent at every sample point and do not determine {}. \
         Remove redundant constraints; replace one equation by a combination in which the unknowns cancel; or declare \
         the region by `nominal(..)` and `range(..)` (equations are counted from 0)",
        if differentiated { "once differentiated, " } else { "" },
        equations.iter().map(number).collect::<Vec<_>>().join(", "),
        unknowns.iter().map(name).collect::<Vec<_>>().join(", "),
    );
    let span = equations.first().and_then(|&equation| model.spans.get(equation).copied());
    Err(Error::new(span.unwrap_or_else(|| model.name.span()), message))
}

/// A vector `n` with `A n = 0`, if the matrix is singular: elimination with full pivoting after
/// scaling of rows and columns. Empty without `wanted`.
fn null_vector(mut a: Vec<Vec<f64>>, wanted: bool) -> Option<Vec<f64>> {
    let count = a.len();
    let scales = scale(&mut a);
    let mut columns: Vec<usize> = (0..count).collect();
    let mut rank = count;
    for step in 0..count {
        let mut best = (0.0, step, step);
        for (row, values) in a.iter().enumerate().skip(step) {
            for (column, value) in values.iter().enumerate().skip(step) {
                if value.abs() > best.0 {
                    best = (value.abs(), row, column);
                }
            }
        }
        if best.0 <= ZERO_PIVOT_TOLERANCE {
            rank = step;
            break;
        }
        a.swap(step, best.1);
        columns.swap(step, best.2);
        a.iter_mut().for_each(|row| row.swap(step, best.2));
        let (above, below) = a.split_at_mut(step + 1);
        let pivot = &above[step];
        for row in below {
            let factor = row[step] / pivot[step];
            if factor != 0.0 {
                row[step..].iter_mut().zip(&pivot[step..]).for_each(|(to, from)| *to -= factor * from);
            }
        }
    }
    if rank == count {
        return None;
    }
    let mut vector = vec![0.0; count];
    if wanted {
        vector[columns[rank]] = 1.0;
        for row in (0..rank).rev() {
            let sum: f64 = (row + 1..count).map(|column| a[row][column] * vector[columns[column]]).sum();
            vector[columns[row]] = -sum / a[row][row];
        }
        vector.iter_mut().zip(&scales).for_each(|(value, scale)| *value *= scale);
    }
    Some(vector)
}

/// Scales rows and then columns to a largest element of one; returns the scales of the columns.
fn scale(a: &mut [Vec<f64>]) -> Vec<f64> {
    let reciprocal = |largest: f64| if largest > 0.0 { 1.0 / largest } else { 1.0 };
    for row in a.iter_mut() {
        let scale = reciprocal(row.iter().fold(0.0, |largest, value| value.abs().max(largest)));
        row.iter_mut().for_each(|value| *value *= scale);
    }
    (0..a.len())
        .map(|column| {
            let scale = reciprocal(a.iter().fold(0.0, |largest, row| row[column].abs().max(largest)));
            a.iter_mut().for_each(|row| row[column] *= scale);
            scale
        })
        .collect()
}
