//! Checks of a model's derivatives against independent ones.

use super::declared_structure;
use super::evaluate::{self, BoundedMatrix, derivative_variable_count};
use super::points::{Points, Random};
use super::report::{Entry, Report};
use crate::model::{ArrayV, Dae, GraphDae};
use crate::shape::Shape;
use core::any::type_name;
use nalgebra::DMatrix;
use std::format;
use std::string::String;
use std::vec::Vec;

/// Checks the residual, Jacobian, adjoint and Hessian of a graph model three ways: against
/// `num-dual`, the complex step, and central differences of order 8.
///
/// All entries are compared; those outside of the declared patterns must be zero. Tolerances are
/// bounds of the rounding errors of both sides at each point (running error analysis), plus the
/// truncation error for differences.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::{Points, check_derivatives};
///
/// #[ode]
/// fn pendulum(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0] - 9.81 * x[0].sin()]
/// }
///
/// check_derivatives::<Pendulum>(&Points::random(20)).assert();
/// ```
pub fn check_derivatives<M: GraphDae>(points: &Points<M>) -> Report {
    let mut report = check_by_differences(points);
    for (number, v, mu) in sample_points(points) {
        let jacobian = evaluate::model_jacobian::<M>(&v);
        let adjoint = evaluate::model_gradient::<M>(&v, &mu);
        let hessian = evaluate::model_hessian::<M>(&v, &mu);

        let dual = evaluate::dual_jacobian::<M>(&v);
        compare_jacobian::<M>(&mut report, "num-dual", number, &jacobian, &dual);
        compare_adjoint::<M>(&mut report, "num-dual", number, &adjoint, &transposed_product(&dual, &mu));
        let dual = evaluate::dual_hessian::<M>(&v, &mu);
        compare_hessian::<M>(&mut report, "num-dual", number, &hessian, &dual);

        let complex = evaluate::complex_jacobian::<M>(&v);
        compare_jacobian::<M>(&mut report, "complex step", number, &jacobian, &complex);
        let complex = evaluate::complex_hessian::<M>(&v, &mu);
        compare_hessian::<M>(&mut report, "complex step", number, &hessian, &complex);
    }
    report
}

/// As [`check_derivatives`], for any model: against central differences of order 8 only.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::*;
///
/// #[ode]
/// fn oscillator(x: [f64; 2], u: f64) -> [f64; 2] {
///     [x[1], u - x[0].sin()]
/// }
///
/// check_by_differences::<Oscillator>(&Points::random(5)).assert();
/// ```
pub fn check_by_differences<M: Dae>(points: &Points<M>) -> Report {
    let mut report = Report::new(format!("derivatives of {}", type_name::<M>()));
    for (number, v, mu) in sample_points(points) {
        check_residual::<M>(&mut report, number, &v);

        let jacobian = evaluate::model_jacobian::<M>(&v);
        let differences = evaluate::difference_jacobian::<M>(&v);
        compare_jacobian::<M>(&mut report, "differences", number, &jacobian, &differences);

        let adjoint = evaluate::model_gradient::<M>(&v, &mu);
        let product = transposed_product(&jacobian, &mu);
        compare_adjoint::<M>(&mut report, "Jacobian", number, &adjoint, &product);

        let hessian = evaluate::model_hessian::<M>(&v, &mu);
        let differences = evaluate::difference_hessian::<M>(&v, &mu);
        compare_hessian::<M>(&mut report, "differences", number, &hessian, &differences);

        check_linear::<M>(&mut report, number, &v);
    }
    report
}

/// Checks by differences that entries of the Jacobian and the Hessian outside of the declared
/// patterns are zero, that entries declared constant are the same at all points, and that variables
/// declared unused have no entries.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::*;
///
/// #[ode]
/// fn oscillator(x: [f64; 2], u: f64) -> [f64; 2] {
///     [x[1], u - x[0].sin()]
/// }
///
/// check_pattern::<Oscillator>(&Points::random(5)).assert();
/// ```
pub fn check_pattern<M: Dae>(points: &Points<M>) -> Report {
    let mut report = Report::new(format!("patterns of {}", type_name::<M>()));
    let n = derivative_variable_count::<M>();
    let mut declared = DMatrix::from_element(M::Shape::NK, n, false);
    for entry in 0..M::STRUCTURE.jacobian.len() {
        declared[M::STRUCTURE.jacobian.at(entry)] = true;
    }
    let mut declared_twice = DMatrix::from_element(n, n, false);
    for entry in 0..M::STRUCTURE.hessian.len() {
        let (i, j) = M::STRUCTURE.hessian.at(entry);
        declared_twice[(i, j)] = true;
        declared_twice[(j, i)] = true;
    }
    for (number, v, mu) in sample_points(points) {
        let outside = |declared: &DMatrix<bool>, found: &BoundedMatrix| -> Vec<(usize, Entry)> {
            (0..found.value.len())
                .filter(|&i| !declared[i])
                .map(|i| (i, Entry { value: 0.0, expected: found.value[i], tolerance: found.error[i] }))
                .collect()
        };
        let found = evaluate::difference_jacobian::<M>(&v);
        let entries = outside(&declared, &found);
        let (scale, name) = (largest_magnitude(&found.value), |i| jacobian_entry_name::<M>(i));
        report.compare("Jacobian outside", "differences", number, scale, entries.into_iter(), name);
        let found = evaluate::difference_hessian::<M>(&v, &mu);
        let entries = outside(&declared_twice, &found);
        let (scale, name) = (largest_magnitude(&found.value), |i| hessian_entry_name::<M>(i));
        report.compare("Hessian outside", "differences", number, scale, entries.into_iter(), name);
    }
    let points: Vec<_> = sample_points(points).collect();
    for ((number, v, _), (_, other, _)) in points.iter().zip(points.iter().cycle().skip(1)) {
        declared_structure::check_declared_structure::<M>(&mut report, *number, v, other);
    }
    report
}

/// The points with their indices, and seeds `μ` in `[-1, 1]` for each.
fn sample_points<M: Dae>(points: &Points<M>) -> impl Iterator<Item = (usize, ArrayV<M, f64>, Vec<f64>)> {
    points.iter().enumerate().map(|(number, v)| {
        let mut random = Random::new(number as u64 + 1);
        (number, v, (0..M::Shape::NK).map(|_| random.symmetric()).collect())
    })
}

/// The residual evaluated with the Jacobian is bitwise equal to the residual.
fn check_residual<M: Dae>(report: &mut Report, number: usize, v: &ArrayV<M, f64>) {
    let alone = evaluate::residual::<M, f64>(v);
    let (beside, _) = evaluate::jacobian::<M, f64>(v);
    let entries = beside.as_ref().iter().zip(alone.as_ref()).map(|(&value, &expected)| Entry {
        value,
        expected,
        tolerance: 0.0,
    });
    let name = |r| format!("of equation {r}");
    report.compare("residual with Jacobian", "residual", number, 0.0, entries.enumerate(), name);
}

/// Equations declared linear have no second derivatives.
fn check_linear<M: Dae>(report: &mut Report, number: usize, v: &ArrayV<M, f64>) {
    for (row, _) in M::STRUCTURE.linear.iter().enumerate().filter(|(_, linear)| **linear) {
        let mu: Vec<f64> = (0..M::Shape::NK).map(|r| f64::from(u8::from(r == row))).collect();
        let found = evaluate::hessian::<M, f64>(v, &mu);
        let entries = found.iter().map(|&value| Entry { value, expected: 0.0, tolerance: 0.0 });
        let name = |i| format!("of equation {row} {}", hessian_entry_name::<M>(i));
        report.compare("Hessian, linear rows", "zero", number, 0.0, entries.enumerate(), name);
    }
}

/// `Jᵀ μ` with error bounds, and a zero for `t`.
fn transposed_product(jacobian: &BoundedMatrix, mu: &[f64]) -> BoundedMatrix {
    let (rows, columns) = jacobian.value.shape();
    let (mut value, mut error) = (DMatrix::zeros(columns + 1, 1), DMatrix::zeros(columns + 1, 1));
    for j in 0..columns {
        for (r, &mu) in mu.iter().enumerate().take(rows) {
            let product = mu * jacobian.value[(r, j)];
            value[j] += product;
            // One rounding for the product, and one for each sum.
            error[j] += mu.abs() * jacobian.error[(r, j)] + rows as f64 * f64::EPSILON * product.abs();
        }
    }
    BoundedMatrix { value, error }
}

fn compare_jacobian<M: Dae>(
    report: &mut Report,
    reference: &'static str,
    point: usize,
    own: &BoundedMatrix,
    other: &BoundedMatrix,
) {
    let scale = largest_magnitude(&own.value);
    report.compare("Jacobian", reference, point, scale, matrix_entries(own, other), |i| {
        jacobian_entry_name::<M>(i)
    });
}

fn compare_adjoint<M: Dae>(
    report: &mut Report,
    reference: &'static str,
    point: usize,
    own: &BoundedMatrix,
    other: &BoundedMatrix,
) {
    let scale = largest_magnitude(&own.value);
    let name = |i| format!("by {}", variable_name::<M>(i));
    report.compare("adjoint", reference, point, scale, matrix_entries(own, other), name);
}

fn compare_hessian<M: Dae>(
    report: &mut Report,
    reference: &'static str,
    point: usize,
    own: &BoundedMatrix,
    other: &BoundedMatrix,
) {
    let scale = largest_magnitude(&own.value);
    report.compare("Hessian", reference, point, scale, matrix_entries(own, other), |i| {
        hessian_entry_name::<M>(i)
    });
}

/// Entries in column-major order.
fn matrix_entries<'a>(
    own: &'a BoundedMatrix,
    other: &'a BoundedMatrix,
) -> impl Iterator<Item = (usize, Entry)> + 'a {
    (0..own.value.len()).map(|i| {
        let tolerance = own.error[i] + other.error[i];
        (i, Entry { value: own.value[i], expected: other.value[i], tolerance })
    })
}

fn largest_magnitude(values: &DMatrix<f64>) -> f64 {
    values.iter().fold(0.0, |a, b| if b.is_finite() { f64::max(a, b.abs()) } else { a })
}

fn jacobian_entry_name<M: Dae>(i: usize) -> String {
    let (row, column) = (i % M::Shape::NK, i / M::Shape::NK);
    format!("of equation {row} by {}", variable_name::<M>(column))
}

fn hessian_entry_name<M: Dae>(i: usize) -> String {
    let (row, column) = (i % derivative_variable_count::<M>(), i / derivative_variable_count::<M>());
    format!("by {} and {}", variable_name::<M>(row), variable_name::<M>(column))
}

/// The name of a variable of the model.
fn variable_name<M: Dae>(index: usize) -> String {
    let structure = &M::STRUCTURE;
    let mut i = index;
    if let Some(name) = structure.x.get(i) {
        return format!("d({name})/dt");
    }
    i -= structure.x.len();
    for block in [structure.x, structure.z, structure.u, structure.p] {
        if let Some(name) = block.get(i) {
            return String::from(*name);
        }
        i -= block.len();
    }
    String::from("t")
}
