//! The QPs of the chain of masses.

use crate::Test;
use casados::Real;
use casados::qp::{
    BlockMut, Condensing, HeapInteriorPoint, HeapQp, HeapSolution, QpSolver, QpStart, StageDims, residuals,
};
use reference_data::Record;

/// Elements of a list of matrices, of which the last one repeats.
struct RepeatedMatrices {
    numbers: Vec<f64>,
    size: usize,
}

impl RepeatedMatrices {
    fn load(record: &Record, key: &str, count: usize, size: usize) -> Result<Self, String> {
        Ok(Self { numbers: record.numbers(key, count * size)?, size })
    }
    /// Row-major.
    fn at(&self, k: usize) -> &[f64] {
        let k = k.min(self.numbers.len() / self.size - 1);
        &self.numbers[k * self.size..(k + 1) * self.size]
    }
}

pub struct Chain {
    pub record: Record,
    pub intervals: usize,
    pub nx: usize,
}

impl Chain {
    pub fn load(masses: usize) -> Result<Self, String> {
        let record = Record::load(&format!("ocp/qp_chain_{masses}.json"))?;
        let (intervals, nx) = (record.number("N")? as usize, record.number("nx")? as usize);
        Ok(Self { record, intervals, nx })
    }

    pub fn qp<T: Real>(&self) -> Result<HeapQp<T>, Box<dyn std::error::Error>> {
        let (record, nx, n) = (&self.record, self.nx, self.intervals);
        let mut dims = vec![StageDims::new(nx, 3, 0); n + 1];
        dims[n].nu = 0;
        let mut qp = HeapQp::new(&dims)?;
        let load = |key, count, size| RepeatedMatrices::load(record, key, count, size);
        let (a, b, offset) = (load("A", 2, nx * nx)?, load("B", 2, nx * 3)?, load("b", 2, nx)?);
        let (q, r, s) = (load("Q", 2, nx * nx)?, load("R", 1, 9)?, load("S", 1, 3 * nx)?);
        let (gradient, wall) = (load("q", 2, nx)?, record.list("wall_index")?);
        let lower = record.list("wall_lower")?;
        let number = T::from_f64;
        for (k, mut stage) in qp.stages_mut().enumerate() {
            stage.q_mut().fill_with(|i, j| number(q.at(k / n)[i * nx + j]));
            for (x, &value) in stage.gradient_x_mut().iter_mut().zip(gradient.at(k)) {
                *x = number(value);
            }
            if k == n {
                break;
            }
            stage.a_mut().fill_with(|i, j| number(a.at(k)[i * nx + j]));
            stage.b_mut().fill_with(|i, j| number(b.at(k)[i * 3 + j]));
            stage.r_mut().fill_with(|i, j| number(r.at(k)[i * 3 + j]));
            stage.s_mut().fill_with(|i, j| number(s.at(k)[i * nx + j]));
            for (x, &value) in stage.offset_mut().iter_mut().zip(offset.at(k)) {
                *x = number(value);
            }
            for i in 0..3 {
                stage.u_bounds_mut().set(i, number(-1.0), number(1.0));
            }
            if k > 0 {
                for (&i, &lower) in wall.iter().zip(&lower) {
                    stage.x_bounds_mut().set(i as usize, number(lower), number(f64::INFINITY));
                }
            }
        }
        let x0: Vec<T> = record.list("x0")?.into_iter().map(number).collect();
        qp.fix_initial_state(&x0)?;
        Ok(qp)
    }

    /// The largest distance from the reference.
    pub fn error<T: Real>(&self, solution: &HeapSolution<T>) -> Result<f64, String> {
        let x = self.record.numbers("x", (self.intervals + 1) * self.nx)?;
        let u = self.record.numbers("u", self.intervals * 3)?;
        let found_x = solution.stages().flat_map(|stage| stage.x);
        let found_u = solution.stages().flat_map(|stage| stage.u);
        let pairs = found_x.zip(&x).chain(found_u.zip(&u));
        Ok(pairs.map(|(found, expected)| (found.to_f64() - expected).abs()).fold(0.0, f64::max))
    }
}

/// The references come from products of slacks and multipliers of 1e-9, which leave slacks of 1e-9
/// over the multiplier at active bounds. With 3 masses one of them (of u₂ at stage 2) has a
/// multiplier near zero: a slack of 7e-6 there satisfies the conditions as well as none. The
/// residuals, which are asserted to rounding, say that the solution here is the better one.
#[test]
fn reference_solutions_of_stored_problems() -> Test {
    let mut solver = HeapInteriorPoint::new();
    solver.options.tolerance = 1e-12;
    for masses in [3, 5, 7] {
        let chain = Chain::load(masses)?;
        let qp = chain.qp::<f64>()?;
        let mut solution = HeapSolution::new(qp.dims())?;
        let statistics = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
        assert!(statistics.iterations <= 14, "{statistics:?}");
        let error = chain.error(&solution)?;
        let tolerance = if masses == 3 { 1e-5 } else { 3e-7 };
        assert!(error < tolerance, "{masses} masses: {error:e}");
        let expected = chain.record.number("objective")?;
        assert!(
            (statistics.objective - expected).abs() < 1e-8 * expected,
            "{} {expected}",
            statistics.objective
        );
        // Gradients of sizes up to 1e2, in sums of 70 terms.
        let (residuals, _) = residuals(qp.view(), &solution);
        assert!(residuals.largest() < 70.0 * 1e2 * f64::EPSILON * 10.0, "{residuals}");
    }
    Ok(())
}

#[test]
fn iterations_of_warm_starts() -> Test {
    let mut solver = HeapInteriorPoint::new();
    let chain = Chain::load(5)?;
    let mut qp = chain.qp::<f64>()?;
    let mut solution = HeapSolution::new(qp.dims())?;
    let cold = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    let warm = solver.solve(qp.view(), QpStart::Warm, solution.view_mut())?;
    assert!(2 * warm.iterations <= cold.iterations, "{} after {}", warm.iterations, cold.iterations);
    // The next sampling instant: the state moves on, and the solution with it.
    let x1 = solution.stage(1).ok_or("no stage 1")?.x.to_vec();
    let reference = solution.clone();
    // All stages as the second one.
    let view = qp.view();
    let second = view.stage(1).ok_or("no stage 1")?;
    let elements = |block: casados::qp::Block<'_, f64>| {
        let (rows, columns) = block.shape();
        (0..columns * rows).filter_map(|i| block.get(i % rows, i / rows)).collect::<Vec<_>>()
    };
    let (a, b, gradient) = (elements(second.a()), elements(second.b()), second.gradient_x().to_vec());
    let offset = second.offset().to_vec();
    let mut first = qp.stage_mut(0).ok_or("no stage 0")?;
    first.a_mut().copy_from_columns(&a)?;
    first.b_mut().copy_from_columns(&b)?;
    first.gradient_x_mut().copy_from_slice(&gradient);
    first.offset_mut().copy_from_slice(&offset);
    qp.fix_initial_state(&x1)?;
    let mut shifted = reference.clone();
    shifted.shift();
    let after_shift = solver.solve(qp.view(), QpStart::Warm, shifted.view_mut())?;
    let mut again = reference.clone();
    let cold = solver.solve(qp.view(), QpStart::Cold, again.view_mut())?;
    assert!(
        after_shift.iterations < cold.iterations,
        "{} against {}",
        after_shift.iterations,
        cold.iterations
    );
    Ok(())
}

/// Single precision: ε = 1.2e-7 times gradients of 1e2 and a strong convexity of 0.004 leave errors
/// of 1e-2 at the worst.
#[test]
fn single_precision() -> Test {
    let chain = Chain::load(3)?;
    let qp = chain.qp::<f32>()?;
    let mut solution = HeapSolution::new(qp.dims())?;
    let mut solver = HeapInteriorPoint::new();
    solver.options.relative_tolerance = 0.0;
    let statistics = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    assert!(statistics.residuals.largest() <= 1e-4);
    let error = chain.error(&solution)?;
    assert!(error < 1e-2, "{error:e}");
    Ok(())
}

/// Multiplies costs: the solution is the same, forces and multipliers are so many times as large.
fn scale_costs<T: Real>(qp: &mut HeapQp<T>, factor: f64) {
    let factor = T::from_f64(factor);
    for mut stage in qp.stages_mut() {
        let multiply = |mut block: BlockMut<'_, T>| {
            let (rows, columns) = block.as_block().shape();
            for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
                let value = block.as_block().get(i, j).unwrap_or(T::ZERO);
                block.set(i, j, value * factor);
            }
        };
        multiply(stage.q_mut());
        multiply(stage.r_mut());
        multiply(stage.s_mut());
        stage.gradient_x_mut().iter_mut().for_each(|g| *g = *g * factor);
        stage.gradient_u_mut().iter_mut().for_each(|g| *g = *g * factor);
    }
}

/// The largest multiplier of the dynamics: a term of the gradients that are to vanish.
fn largest_multiplier<T: Real>(solution: &HeapSolution<T>) -> f64 {
    let all = solution.stages().flat_map(|stage| stage.dynamics);
    all.map(|force| force.to_f64().abs()).fold(0.0, f64::max)
}

/// Costs in other units, 2²⁰ times as large: rounding errors of forces of 1e6 and more are far
/// above the absolute tolerance, and a part of the forces is what can be asked for.
fn solve_in_other_units<T: Real>(relative: f64) -> Test {
    const UNIT: f64 = (1 << 20) as f64;
    let chain = Chain::load(3)?;
    let mut qp = chain.qp::<T>()?;
    scale_costs(&mut qp, UNIT);
    let mut solution = HeapSolution::new(qp.dims())?;
    let mut solver = HeapInteriorPoint::<T>::new();
    // In units both would be the same.
    solver.options.scaling = false;
    // Products of slacks and multipliers have these units too.
    (solver.options.start_mu, solver.options.max_iterations, solver.options.locate) = (UNIT, 20, false);
    // Rounding errors are a few ε of the terms.
    (solver.options.tolerance, solver.options.relative_tolerance) = (0.1 * T::EPSILON * UNIT, 0.0);
    let absolute = solver.solve(qp.view(), QpStart::Cold, solution.view_mut());
    assert!(absolute.is_err(), "{absolute:?}");
    (solver.options.tolerance, solver.options.relative_tolerance) = (0.0, relative);
    let statistics = solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    let (found, _) = residuals(qp.view(), &solution);
    let force = largest_multiplier(&solution);
    // Multipliers are among the terms of gradients, and none of the others is more than ten times
    // as large here.
    assert!(found.stationarity.max(found.complementarity) <= 10.0 * relative * force, "{found} of {force:e}");
    assert!(found.dynamics.max(found.inequalities) <= 10.0 * relative, "{found}");
    assert!(statistics.iterations <= 16, "{statistics:?}");
    // Where slack and multiplier both vanish, either may be the root of their product; and see
    // above for the reference.
    let error = chain.error(&solution)?;
    assert!(error < (10.0 * relative * force / UNIT).sqrt() + 1e-5, "{error:e}");
    Ok(())
}

#[test]
fn relative_tolerances() -> Test {
    solve_in_other_units::<f32>(1e-5)?;
    solve_in_other_units::<f64>(1e-12)
}

/// Clarabel, which shares nothing with the other solver, and the interface to it.
#[test]
fn agreement_with_clarabel() -> Test {
    let chain = Chain::load(3)?;
    let qp = chain.qp::<f64>()?;
    let mut solution = HeapSolution::new(qp.dims())?;
    let mut clarabel = casados::qp::Clarabel::new();
    // The second time data is updated in place.
    for _ in 0..2 {
        let statistics = clarabel.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
        let expected = chain.record.number("objective")?;
        assert!((statistics.objective - expected).abs() < 1e-7 * expected);
        let (residuals, _) = residuals(qp.view(), &solution);
        assert!(residuals.largest() < 1e-7, "{residuals}");
    }
    Ok(())
}

/// Blocks of intervals condensed to one: the same solution, states and multipliers expanded.
#[test]
fn condensed() -> Test {
    for (masses, block) in [(3, 4), (3, 3), (5, 4), (7, 5)] {
        let chain = Chain::load(masses)?;
        let qp = chain.qp::<f64>()?;
        let mut plain = HeapInteriorPoint::new();
        plain.options.tolerance = 1e-11;
        let mut solver = Condensing::new(block, plain.clone());
        let mut expected = HeapSolution::new(qp.dims())?;
        plain.solve(qp.view(), QpStart::Cold, expected.view_mut())?;
        let mut solution = HeapSolution::new(qp.dims())?;
        solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
        let (residuals, _) = residuals(qp.view(), &solution);
        assert!(residuals.largest() < 1e-10, "{residuals}");
        let pairs = solution.stages().zip(expected.stages());
        let pairs = pairs.flat_map(|(a, b)| a.u.iter().zip(b.u).chain(a.x.iter().zip(b.x)));
        let error = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-6, "{masses} masses in blocks of {block}: {error:e}");
    }
    Ok(())
}
