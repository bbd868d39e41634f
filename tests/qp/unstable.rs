//! Dynamics that are unstable: over the horizon errors of the uncontrolled system grow beyond all
//! digits, those of the controlled one decay.

use crate::{Test, solve, solve_to};
use casados::qp::{
    HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpSolver, QpStart, StageDims, residuals,
};

const INFINITY: f64 = f64::INFINITY;
const STAGES: usize = 40;
/// 3⁴⁰ is 1e19.
const GROWTH: f64 = 3.0;

/// `x₊ = 3 x + u` from `x₀ = 1` with costs `½ (x² + u²)`.
fn scalar_problem<T: casados::Real>() -> Result<HeapQp<T>, QpError> {
    let mut dims = vec![StageDims::new(1, 1, 0); STAGES + 1];
    dims[STAGES].nu = 0;
    let mut qp = HeapQp::new(&dims)?;
    for mut stage in qp.stages_mut() {
        stage.a_mut().set(0, 0, T::from_f64(GROWTH));
        stage.b_mut().set(0, 0, T::ONE);
        stage.q_mut().set(0, 0, T::ONE);
        stage.r_mut().set(0, 0, T::ONE);
    }
    qp.fix_initial_state(&[T::ONE])?;
    Ok(qp)
}

/// States, controls and multipliers by the scalar recursion `p = 1 + a² p₊ / (1 + p₊)`, whose terms
/// are all positive: `u = −a p₊ / (1 + p₊) x`, `x₊ = a x / (1 + p₊)`, `π = p₊ x₊`.
fn scalar_recursion() -> Vec<[f64; 3]> {
    let mut costs = vec![1.0];
    for k in 0..STAGES {
        costs.push(1.0 + GROWTH * GROWTH * costs[k] / (1.0 + costs[k]));
    }
    let mut x = 1.0;
    let steps = costs.iter().rev().skip(1).map(|p| {
        let (here, next) = (x, GROWTH * x / (1.0 + p));
        x = next;
        [here, -GROWTH * p / (1.0 + p) * here, p * next]
    });
    steps.collect()
}

/// To rounding, in one step, since there is nothing but equations.
#[test]
fn agreement_with_the_scalar_recursion() -> Test {
    let (solution, statistics, _) = solve(&scalar_problem::<f64>()?)?;
    assert_eq!(statistics.iterations, 1);
    for (stage, expected) in solution.stages().zip(scalar_recursion()) {
        for (found, expected) in [stage.x[0], stage.u[0], stage.dynamics[0]].into_iter().zip(expected) {
            // Some hundred operations.
            assert!((found - expected).abs() <= 100.0 * f64::EPSILON, "{found} {expected}");
        }
    }
    Ok(())
}

/// In single precision, too: 3¹⁵ are all digits that it has.
#[test]
fn single_precision() -> Test {
    let qp = scalar_problem::<f32>()?;
    let mut solution = HeapSolution::new(qp.dims())?;
    HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut())?;
    for (stage, expected) in solution.stages().zip(scalar_recursion()) {
        for (found, expected) in [stage.x[0], stage.u[0], stage.dynamics[0]].into_iter().zip(expected) {
            let distance = (f64::from(found) - expected).abs();
            assert!(distance <= 100.0 * f64::from(f32::EPSILON), "{found} {expected}");
        }
    }
    Ok(())
}

/// The controls have just enough room, and use it up at first: there is no feedback there. In
/// between the state is bounded, and its end is given.
#[test]
fn unstable_dynamics_with_bounds() -> Test {
    for room in [2.5, 2.1, 2.01, 2.0001] {
        let mut qp = scalar_problem::<f64>()?;
        for mut stage in qp.stages_mut().take(STAGES) {
            stage.u_bounds_mut().set(0, -room, room);
        }
        for mut stage in qp.stages_mut().skip(STAGES / 2).take(3) {
            stage.x_bounds_mut().set(0, 0.2, INFINITY);
        }
        qp.stage_mut(STAGES).ok_or("no stage")?.x_bounds_mut().set(0, -0.5, -0.5);
        let (mut solution, statistics, judged) = solve_to(1e-9, &qp)?;
        println!("{room}: {statistics:?} {judged}");
        // Begun again where it ended, one factorisation is enough.
        let mut solver = HeapInteriorPoint::new();
        let again = solver.solve(qp.view(), QpStart::Warm, solution.view_mut())?;
        assert_eq!(again.factorisations, 1);
        let (judged, _) = residuals(qp.view(), &solution);
        assert!(judged.largest() <= 1e-8, "{judged}");
    }
    Ok(())
}

/// The rider in the Alps (J. T. Betts, "Practical methods for optimal control and estimation using
/// nonlinear programming", 2010, section 4.7) without the Alps: over 20 s errors grow by exp(40).
/// The exponential function of `h A` by its series up to the fourth power, as a step of the
/// classical Runge-Kutta method has it.
#[test]
fn rider_in_the_alps() -> Test {
    let a = [[-10.0, 0.0, 0.0, 0.0], [0.0, -2.0, 0.0, 0.0], [0.0, 0.0, -3.0, 5.0], [0.0, 0.0, 5.0, -3.0]];
    let b = [[1.0, 1.0], [1.0, -2.0], [1.0, -1.0], [1.0, 3.0]];
    let (stages, h) = (200, 0.1);
    // The columns of A and of B after a step.
    let column = |mut x: [f64; 4], push: [f64; 4]| {
        let mut term: [f64; 4] =
            std::array::from_fn(|i| (0..4).map(|j| a[i][j] * x[j]).sum::<f64>() + push[i]);
        for power in 1..=4 {
            let factor = h / f64::from(power);
            (0..4).for_each(|i| x[i] += factor * term[i]);
            term = std::array::from_fn(|i| factor * (0..4).map(|j| a[i][j] * term[j]).sum::<f64>());
        }
        x
    };
    let mut dims = vec![StageDims::new(4, 2, 0); stages + 1];
    dims[stages].nu = 0;
    for room in [INFINITY, 12.0] {
        let mut qp = HeapQp::<f64>::new(&dims)?;
        for mut stage in qp.stages_mut() {
            let of_state = |j: usize| column(std::array::from_fn(|i| f64::from(u8::from(i == j))), [0.0; 4]);
            stage.a_mut().fill_with(|i, j| of_state(j)[i]);
            stage.b_mut().fill_with(|i, j| column([0.0; 4], b.map(|row| row[j]))[i]);
            stage.q_mut().set_diagonal([20.0; 4]);
            stage.r_mut().set_diagonal([2e-3; 2]);
        }
        for mut stage in qp.stages_mut().take(stages) {
            (0..2).for_each(|j| stage.u_bounds_mut().set(j, -room, room));
        }
        qp.fix_initial_state(&[2.0, 1.0, 2.0, 1.0])?;
        let mut last = qp.stage_mut(stages).ok_or("no stage")?;
        for (i, end) in [2.0, 3.0, 1.0, -2.0].into_iter().enumerate().take(if room > 1e3 { 4 } else { 0 }) {
            last.x_bounds_mut().set(i, end, end);
        }
        // Forces are hundreds.
        let (_, statistics, judged) = solve_to(1e-8, &qp)?;
        println!("{room}: {statistics:?} {judged}");
    }
    Ok(())
}
