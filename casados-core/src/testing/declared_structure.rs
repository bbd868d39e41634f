//! Checks of the declared structure, which lets the engine skip work, against patterns and values.

use super::evaluate;
use super::report::{Entry, Report};
use crate::model::{ArrayV, Dae};
use crate::shape::{Array, Shape};
use std::format;
use std::vec::Vec;

/// Compares the declared structure with the declared patterns, and with the Jacobian at two points.
pub(super) fn check_declared_structure<M: Dae>(
    report: &mut Report,
    number: usize,
    v: &ArrayV<M, f64>,
    other: &ArrayV<M, f64>,
) {
    let structure = &M::STRUCTURE;
    let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
    let (end_z, time) = (2 * nx + nz, M::Shape::NV - 1);
    let matrix = structure.blocks[3];
    let jacobian = |v: &ArrayV<M, f64>| evaluate::jacobian::<M, f64>(v).1;
    let mut unchanged = |what: &'static str, entries: &[usize], moved: &dyn Fn(usize) -> bool| {
        let v2 = <ArrayV<M, f64> as Array<f64>>::from_fn(|i| if moved(i) { other[i] } else { v[i] });
        let (here, there) = (jacobian(v), jacobian(&v2));
        let found = entries.iter().map(|&e| {
            let at = structure.jacobian.at(e);
            (e, Entry { value: there[at], expected: here[at], tolerance: 0.0 })
        });
        let name = |e: usize| {
            let (row, column) = structure.jacobian.at(e);
            format!("of equation {row} by {}", structure.variable(column as u32))
        };
        report.compare(what, "another point", number, 0.0, found, name);
    };
    let all: Vec<usize> = (0..matrix).collect();
    if structure.linear_in_state {
        unchanged("linear in the state", &all, &|i| i < end_z);
    }
    if structure.constant_matrix {
        unchanged("constant matrix", &all, &|i| i < end_z || i == time);
    }
    if structure.autonomous {
        unchanged("autonomous", &(0..structure.jacobian.len()).collect::<Vec<_>>(), &|i| i == time);
    }
    let constant = |&e: &usize| structure.constant_rows.get(structure.jacobian.at(e).0) == Some(&true);
    unchanged("constant rows", &all.iter().copied().filter(constant).collect::<Vec<_>>(), &|_| true);

    if structure.autonomous {
        let residual = |t: f64| {
            let v = <ArrayV<M, f64> as Array<f64>>::from_fn(|i| if i == time { t } else { v[i] });
            evaluate::jacobian::<M, f64>(&v).0
        };
        let (here, there) = (residual(v[time]), residual(other[time]));
        let found = (0..M::Shape::NK)
            .map(|row| (row, Entry { value: there[row], expected: here[row], tolerance: 0.0 }));
        report.compare("autonomous", "another time", number, 0.0, found, |row| format!("equation {row}"));
    }
    check_declared_patterns::<M>(report, number);
}

/// Compares the declared structure with the declared patterns.
fn check_declared_patterns<M: Dae>(report: &mut Report, number: usize) {
    let structure = &M::STRUCTURE;
    let (nx, nz, time) = (M::Shape::NX, M::Shape::NZ, M::Shape::NV - 1);
    let mut sorted: Vec<usize> = (structure.blocks[1]..structure.blocks[5]).collect();
    sorted.sort_by_key(|&e| structure.jacobian.at(e).1);
    let found = sorted.iter().enumerate().map(|(i, &e)| {
        let value = structure.by_column.get(i).map_or(f64::NAN, |&entry| f64::from(entry));
        (i, Entry { value, expected: e as f64, tolerance: 0.0 })
    });
    report.compare("entries by column", "pattern", number, 0.0, found, |i| format!("number {i}"));

    let diagonal = |entry: u32| structure.hessian.rows.get(entry as usize).copied();
    // Skipped columns must be empty: those of the variables that are not listed.
    let mut absent = |what: &'static str, count: usize, listed: &[u32], entries: &dyn Fn(usize) -> usize| {
        let others = (0..count).filter(|&i| !listed.contains(&(i as u32)));
        let found = others.map(|i| (i, Entry { value: entries(i) as f64, expected: 0.0, tolerance: 0.0 }));
        report.compare(what, "pattern", number, 0.0, found, |i| format!("entries of number {i}"));
    };
    let column = |variable: usize| {
        structure.jacobian.columns.iter().filter(|&&column| column as usize == variable).count()
    };
    let direction = |i: usize| column(if i < nx { nx + i } else { nx + nz + i });
    absent("directions", M::Shape::NW, structure.directions, &direction);
    let curved = |i: usize| {
        let pattern = [structure.hessian.rows, structure.hessian.columns];
        pattern.iter().flat_map(|list| list.iter()).filter(|&&variable| variable as usize == i).count()
    };
    let diagonal_controls =
        structure.diagonal_controls.iter().map(|diagonal_controls| diagonal_controls.entry);
    let apart = diagonal_controls.filter_map(diagonal);
    let listed: Vec<u32> = structure.curved.iter().copied().chain(apart).collect();
    absent("curved variables", time, &listed, &curved);
    let influential: Vec<u32> =
        (0..nx as u32).filter(|state| !structure.quadratures.contains(state)).collect();
    absent("quadratures", nx, &influential, &|state| column(nx + state));
    let ordinary: Vec<u32> =
        (0..M::Shape::NK as u32).filter(|row| !structure.trivial.contains(row)).collect();
    // One derivative, at most one other variable, constant coefficients.
    absent("trivial equations", M::Shape::NK, &ordinary, &|row| {
        let own = |e: &usize| structure.jacobian.at(*e).0 == row;
        let derivatives = (0..structure.blocks[1]).filter(own).count();
        let others = (structure.blocks[1]..structure.jacobian.len()).filter(own).count();
        let varying = (0..structure.jacobian.len()).filter(own).filter(|&e| !structure.constant[e]).count();
        usize::from(derivatives != 1) + others.saturating_sub(1) + varying
    });
}
