//! Conditions of optimality by code of its own: the QP is taken for values and first derivatives,
//! and everything else, sums, signs, complementarity, is written down here once more.

use crate::Test;
use casados::ocp::{Convexification, GaussNewton, HeapOcp, Phases};
use casados::qp::{Block, Bounds, SolutionStage, Stage};

/// Violations of bounds and complementarity, relative to sizes.
const TOLERANCE: f64 = 1e-5;

/// An element, zero where there is none.
pub fn element_or_zero(block: Block<'_, f64>, i: usize, j: usize) -> f64 {
    block.get(i, j).unwrap_or(0.0)
}

/// The element of the Hessian of a stage.
pub fn hessian(stage: &Stage<'_, f64>, i: usize, j: usize) -> f64 {
    let (i, j, nx) = (i.max(j), i.min(j), stage.dims().nx);
    match (i.checked_sub(nx), j.checked_sub(nx)) {
        (None, _) => element_or_zero(stage.q(), i, j),
        (Some(i), None) => element_or_zero(stage.s(), i, j),
        (Some(i), Some(j)) => element_or_zero(stage.r(), i, j),
    }
}

/// `[A B; C D]`, of which the first rows are those of the dynamics.
pub fn jacobian(stage: &Stage<'_, f64>, row: usize, j: usize) -> f64 {
    let (nx, next) = (stage.dims().nx, stage.offset().len());
    let (rows, row) = match row.checked_sub(next) {
        None => ([stage.a(), stage.b()], row),
        Some(row) => ([stage.c(), stage.d()], row),
    };
    if j < nx { element_or_zero(rows[0], row, j) } else { element_or_zero(rows[1], row, j - nx) }
}

pub fn variables(at: &SolutionStage<'_, f64>) -> Vec<f64> {
    at.x.iter().chain(at.u).copied().collect()
}

/// Bounds with their multipliers hold at values.
fn check_bounds(bounds: &Bounds<'_, f64>, values: &[f64], lower: &[f64], upper: &[f64]) -> Test {
    for (i, &value) in values.iter().enumerate() {
        for (distance, multiplier) in
            [(value - bounds.lower[i], lower[i]), (bounds.upper[i] - value, upper[i])]
        {
            let size = 1.0 + value.abs();
            assert!(distance > -TOLERANCE * size, "{i}: {value} {bounds:?}");
            assert!(multiplier > -TOLERANCE, "{i}: {multiplier}");
            let product =
                if distance.is_finite() { distance.abs().min(1.0) * multiplier } else { multiplier };
            assert!(product.abs() < TOLERANCE * (1.0 + multiplier.abs()), "{i}: {distance} {multiplier}");
        }
    }
    Ok(())
}

/// The conditions at the iterate of a problem.
pub fn check(ocp: &mut HeapOcp<Phases<'_>>) -> Test {
    ocp.linearise(GaussNewton { convexification: Convexification::None })?;
    let stages: Vec<_> = ocp.iterate().stages().collect();
    let mut arriving: Vec<f64> = vec![0.0; stages[0].x.len()];
    for (k, (stage, at)) in ocp.qp().stages().zip(&stages).enumerate() {
        let v = variables(at);
        let row = |row: usize| -> f64 { (0..v.len()).map(|j| jacobian(&stage, row, j) * v[j]).sum() };
        let next = stage.offset().len();
        for (i, offset) in stage.offset().iter().enumerate() {
            let gap = row(i) + offset - stages[k + 1].x[i];
            assert!(gap.abs() < TOLERANCE * (1.0 + stages[k + 1].x[i].abs()), "gap {k} {i}: {gap}");
        }
        let g: Vec<f64> = (0..at.g_lower.len()).map(|i| row(next + i)).collect();
        check_bounds(&stage.x_bounds(), at.x, at.x_lower, at.x_upper)?;
        check_bounds(&stage.u_bounds(), at.u, at.u_lower, at.u_upper)?;
        check_bounds(&stage.g_bounds(), &g, at.g_lower, at.g_upper)?;
        let gradient: Vec<f64> = stage.gradient_x().iter().chain(stage.gradient_u()).copied().collect();
        let force = |lower: &[f64], upper: &[f64], i: usize| upper[i] - lower[i];
        for j in 0..v.len() {
            let quadratic: f64 = (0..v.len()).map(|i| hessian(&stage, i, j) * v[i]).sum();
            let dynamics: f64 = (0..next).map(|i| jacobian(&stage, i, j) * at.dynamics[i]).sum();
            let general: f64 =
                (0..g.len()).map(|i| jacobian(&stage, next + i, j) * force(at.g_lower, at.g_upper, i)).sum();
            let of_bounds = match j.checked_sub(at.x.len()) {
                None => force(at.x_lower, at.x_upper, j) - arriving[j],
                Some(j) => force(at.u_lower, at.u_upper, j),
            };
            let sum = gradient[j] + quadratic + dynamics + general + of_bounds;
            let size = 1.0 + dynamics.abs() + general.abs() + of_bounds.abs();
            assert!(sum.abs() < TOLERANCE * size, "stationarity {k} {j}: {sum} of {size}");
        }
        arriving = at.dynamics.to_vec();
    }
    Ok(())
}
