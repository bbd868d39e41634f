//! Solutions by name against closed forms: values, multipliers, points between nodes; saved, read
//! and taken up again.

use crate::Test;
use casados::ocp::{
    Collocation, Constraint, HeapIpm, HeapOcp, HeapSqp, Horizon, Kind, LeastSquaresCost, Map, OcpError,
    Problem, Shooting, Trajectory, TrajectoryError,
};
use casados::prelude::*;

/// A chain of two integrators, with the force as an algebraic state.
#[dae]
fn cart(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: f64) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] - z, z - u / p]
}

#[function]
fn effort(_x: [f64; 2], _z: f64, u: f64, _p: f64) -> f64 {
    u
}

#[function]
fn limits(x: [f64; 2], z: f64, _u: f64, _p: f64) -> [f64; 2] {
    [x[1], z]
}

#[function]
fn end(x: [f64; 2], _z: f64, _u: f64, _p: f64) -> f64 {
    x[0] - 1.0
}

const N: usize = 10;
const MASS: f64 = 2.0;

/// From rest to the place 1 in one unit of time, at rest there, with little force.
macro_rules! rest_to_rest {
    ($dynamics:expr) => {{
        let infinity = f64::INFINITY;
        let mut ocp = Problem::new($dynamics)
            .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
            .path_constraints(Constraint::<Limits>::new([-infinity; 2], [9.0, infinity]))
            .terminal_constraints(Constraint::<End>::new([0.0], [0.0]))
            .on(Horizon::uniform(N, 0.1))?;
        ocp.fix_initial_state(&[0.0; 2])?.bound("x[1]", N.., 0.0, 0.0)?.set_parameters(.., &[MASS])?;
        ocp.guess(&[0.0; 2], &[0.0])?;
        ocp
    }};
}

/// Forces of least squares from rest to rest in discrete time: `m (h² Σ (N − k − ½) a_k = 1,
/// h Σ a_k = 0)`, `a_k = c (N/2 − k − ½)`.
fn acceleration(k: usize) -> f64 {
    let (n, h) = (N as f64, 0.1);
    let shape = |k: usize| 0.5 * n - k as f64 - 0.5;
    let way: f64 = (0..N).map(|k| h * h * (n - k as f64 - 0.5) * shape(k)).sum();
    shape(k) / way
}

fn assert_near(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() < tolerance, "{what}: {found} instead of {expected}");
}

/// States, algebraic states, controls and constraints by name, at nodes and between them.
fn check(solution: &Trajectory, dense: &Trajectory) -> Test {
    let (mut place, mut speed) = (0.0, 0.0);
    let points = 3;
    for k in 0..N {
        let a = acceleration(k);
        assert_near(solution.state("x[0]")?[k], place, 1e-6, "place");
        assert_near(solution.state("x[1]")?[k], speed, 1e-6, "speed");
        assert_near(solution.control("u")?[k], MASS * a, 1e-5, "force");
        assert_near(solution.algebraic("z")?[k], a, 1e-5, "acceleration");
        assert_near(solution.constraint("Limits[0]")?[k], speed, 1e-6, "constraint");
        assert_near(solution.constraint("Limits[1]")?[k], a, 1e-5, "constraint of z");
        for j in 0..=points {
            let (index, t) = (k * (points + 1) + j, 0.1 * j as f64 / (points + 1) as f64);
            assert_near(dense.times()[index], 0.1 * k as f64 + t, 1e-12, "time");
            assert_near(
                dense.state("x[0]")?[index],
                place + t * speed + 0.5 * t * t * a,
                1e-6,
                "place inside",
            );
            assert_near(dense.state("x[1]")?[index], speed + t * a, 1e-6, "speed inside");
            assert_near(dense.control("u")?[index], MASS * a, 1e-5, "force inside");
            assert_near(dense.algebraic("z")?[index], a, 1e-5, "acceleration inside");
            assert_near(dense.constraint("Limits[0]")?[index], speed + t * a, 1e-6, "constraint inside");
        }
        (place, speed) = (place + 0.1 * speed + 0.005 * a, speed + 0.1 * a);
    }
    assert_near(solution.state("x[0]")?[N], 1.0, 1e-6, "end");
    assert_near(solution.terminal("End")?[0], 0.0, 1e-6, "constraint at the end");
    assert_eq!(solution.parameter("p")?, [MASS; N + 1]);
    assert_eq!(dense.times().len(), (points + 1) * N + 1);
    for series in dense.series() {
        assert_eq!(dense.times_of(series).len(), series.values.len(), "{}", series.name);
        assert!(!dense.times_of(series).is_empty(), "{}", series.name);
    }
    assert_near(dense.times_of(dense.get("End")?)[0], 1.0, 1e-12, "time of the end");
    Ok(())
}

#[test]
fn trajectories_of_all_integrators() -> Test {
    let options = Options::default();
    let mut ocp = rest_to_rest!(Irk::<Cart, Gauss<2>>::new(options)?);
    assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    check(&ocp.solution()?, &ocp.dense_solution(3)?)?;

    let options = Options { steps: 2, ..options };
    let mut ocp = rest_to_rest!(Shooting::new(Batch::<Cart, RadauIIA<2>>::new(options.lifted())?));
    let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    check(&ocp.solution()?, &ocp.dense_solution(3)?)?;

    let mut ocp = rest_to_rest!(Collocation::new(Irk::<Cart, Gauss<3>>::new(options)?)?);
    assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    check(&ocp.solution()?, &ocp.dense_solution(3)?)
}

/// The objective is `½ h Σ u²` with `u = m a`. If the end is to be at `1 + δ`, accelerations grow
/// by that factor: its derivative is twice the value, and so is minus the multiplier of the
/// equation.
#[test]
fn multipliers_as_derivatives() -> Test {
    let mut ocp = rest_to_rest!(Irk::<Cart, Gauss<2>>::new(Options::default())?);
    let mut ipm = HeapIpm::new(&ocp)?;
    ipm.options.tolerance = 1e-10;
    let outcome = ipm.solve(&mut ocp)?;
    let solution = ocp.solution()?;
    let value: f64 = (0..N).map(|k| 0.05 * (MASS * acceleration(k)).powi(2)).sum();
    assert_near(outcome.objective, value, 1e-6, "objective");
    assert_near(solution.multiplier("End")?[0], -2.0 * value, 1e-5, "multiplier of the end");
    // A start at `δ` is a way that is shorter by it.
    assert_near(solution.multiplier("x[0]")?[0], 2.0 * value, 1e-5, "multiplier of the start");
    for &costate in solution.costate("x[0]")? {
        assert_near(costate, -2.0 * value, 1e-5, "costate");
    }
    assert_eq!(solution.multiplier("u")?.len(), N);
    Ok(())
}

/// `½ (x − 3)²` with the soft bound `x ≤ 1` and its penalty `e + ½ e²`: `e = ½`, and the force of
/// the bound is `1 + e`.
#[test]
fn slacks_and_active_bounds() -> Test {
    #[function]
    fn go(x: f64, u: f64) -> f64 {
        x + u
    }
    #[function]
    fn place(x: f64, _u: f64) -> f64 {
        x
    }
    let mut ocp = Problem::new(Map::<Go, f64>::new())
        .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[1.0]))
        .on(Horizon::uniform(1, 1.0))?;
    ocp.fix_initial_state(&[0.0])?.set_terminal_reference(&[3.0])?.guess(&[0.0], &[0.0])?;
    ocp.bound("x", .., f64::NEG_INFINITY, 1.0)?.soften("x", 1.., 1.0, 1.0)?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    let solution = ocp.solution()?;
    let series = solution.get("x")?;
    assert_eq!((series.kind, series.first), (Kind::State, 0));
    assert_eq!((&series.lower[..], &series.upper[..]), (&[Some(0.0), None][..], &[Some(0.0), Some(1.0)][..]));
    assert_near(series.violations()[1], 0.5, 1e-6, "slack");
    assert_near(series.multipliers()[1], 1.5, 1e-5, "force");
    assert!(series.is_active(1, 1e-6) && !series.is_active(2, 1e-6));
    assert!(solution.get("u")?.violations().iter().all(|&e| e == 0.0));
    // Of a map there is nothing between nodes.
    assert_eq!(ocp.dense_solution(4)?, ocp.solution()?);
    Ok(())
}

fn solved_problem() -> Result<
    HeapOcp<impl casados::ocp::Formulation<f64, Dynamics: casados::ocp::SecondOrder<f64>>>,
    Box<dyn std::error::Error>,
> {
    let mut ocp = rest_to_rest!(Irk::<Cart, Gauss<2>>::new(Options::default())?);
    ocp.bound("u", .., -10.0, 10.0)?;
    assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    Ok(ocp)
}

/// A solution that was taken up again is one: there is nothing left to do.
#[test]
fn restored_solutions() -> Test {
    let mut first = solved_problem()?;
    let solution = first.solution()?;
    let mut ocp = rest_to_rest!(Irk::<Cart, Gauss<2>>::new(Options::default())?);
    ocp.bound("u", .., -10.0, 10.0)?.restore(&solution)?;
    assert_eq!(ocp.solution()?, solution);
    ocp.linearise(casados::ocp::Exact::default())?;
    assert!(ocp.residuals().0.largest() < 1e-6, "{}", ocp.residuals().0);
    // Bounds are those of the problem, not of the trajectory.
    ocp.bound("u", .., -12.0, 12.0)?.restore(&solution)?;
    assert_eq!(ocp.solution()?.get("u")?.upper, [Some(12.0); N]);
    Ok(())
}

#[test]
fn saved_trajectories() -> Test {
    let mut ocp = solved_problem()?;
    let solution = ocp.solution()?;
    let text = serde_json::to_string(&solution)?;
    let again: Trajectory = serde_json::from_str(&text)?;
    assert_eq!(again, solution);
    // Of a series that was written elsewhere there may be no times.
    let mut elsewhere = again.series()[0].clone();
    assert_eq!(again.times_of(&elsewhere), again.times());
    elsewhere.first = usize::MAX;
    assert!(again.times_of(&elsewhere).is_empty());
    ocp.guess(&[0.0; 2], &[0.0])?.restore(&again)?;
    assert_eq!(ocp.solution()?, solution);
    Ok(())
}

/// What no problem writes is refused where it is read, by name.
#[test]
fn corrupted_files() -> Test {
    let mut ocp = solved_problem()?;
    let sound = serde_json::to_value(ocp.solution()?)?;
    let read = |value: serde_json::Value| {
        let found = serde_json::from_value::<Trajectory>(value);
        found.map_or_else(|error| error.to_string(), |_| String::new())
    };
    assert_eq!(read(sound.clone()), "");
    let times = sound["times"].as_array().ok_or("a list")?.len();
    let spoiled = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = sound.clone();
        change(&mut value);
        read(value)
    };
    for first in [1, u64::MAX] {
        let said = spoiled(&|value| value["series"][0]["first"] = first.into());
        assert!(
            said.ends_with(&format!(
                "{times} values from index {first}, but the trajectory only {times} times"
            ))
        );
    }
    let order = "the times of the trajectory must be finite and must not decrease";
    assert_eq!(spoiled(&|value| value["times"][1] = (-1.0).into()), order);
    let cut = |list: &'static str| {
        move |value: &mut serde_json::Value| {
            value["series"][0][list].as_array_mut().map(Vec::pop);
        }
    };
    for list in ["lower", "upper", "lower_multipliers", "upper_multipliers", "costates"] {
        assert!(spoiled(&cut(list)).starts_with("the trajectory has "), "{list}");
    }
    Ok(())
}

/// Bounds that contradict each other over several stages are named, whatever the solver says.
#[test]
fn violations_by_constraint_name() -> Test {
    let mut ocp = solved_problem()?;
    ocp.bound("x[0]", 2..5, 7.0, 8.0)?.bound("x[1]", 2..5, -1e-3, 1e-3)?.guess(&[0.0; 2], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.max_iterations = 3;
    let outcome = sqp.solve(&mut ocp)?;
    let solution = ocp.solution()?;
    let violations = solution.violations(1e-6);
    assert!(!outcome.is_solved() && !violations.is_empty(), "{outcome}");
    for (violation, next) in violations.iter().zip(&violations[1..]) {
        assert!(violation.amount >= next.amount);
    }
    for violation in &violations {
        let series = solution.get(violation.name)?;
        let index = violation.stage - series.first;
        assert_eq!(series.violations()[index], violation.amount);
        let text = violation.to_string();
        assert!(
            text.contains(violation.name) && text.contains(&format!("stage {}", violation.stage)),
            "{text}"
        );
    }
    // Each of those in question is there, or holds.
    for (stage, name) in (2..5).flat_map(|stage| [(stage, "x[0]"), (stage, "x[1]")]) {
        let amount = solution.get(name)?.violations()[stage];
        let found = violations.iter().any(|violation| (violation.name, violation.stage) == (name, stage));
        assert_eq!(found, amount > 1e-6);
    }
    Ok(())
}

/// A guess on a finer grid: states on straight lines, controls held.
#[test]
fn guesses_from_other_grids() -> Test {
    let mut coarse = solved_problem()?;
    let solution = coarse.solution()?;
    let mut fine = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .on(Horizon::nodes(&[-0.5, 0.0, 0.025, 0.1, 0.25, 0.3, 0.95, 1.0, 2.0]))?;
    fine.guess_from(&solution)?;
    let (x, u) = (solution.state("x[0]")?, solution.control("u")?);
    let expected = [x[0], x[0], 0.75 * x[0] + 0.25 * x[1], x[1], 0.5 * (x[2] + x[3]), x[3]];
    for (k, expected) in expected.into_iter().chain([0.5 * (x[9] + x[10]), x[10], x[10]]).enumerate() {
        assert_near(fine.stage(k)?.x[0], expected, 1e-14, "state");
    }
    for (k, expected) in [u[0], u[0], u[0], u[1], u[2], u[3], u[9], u[9]].into_iter().enumerate() {
        assert_eq!(fine.stage(k)?.u[0], expected, "{k}");
    }
    Ok(())
}

/// One line for each time, of which every number can be read back.
#[test]
fn tables_of_trajectories() -> Test {
    let solution = solved_problem()?.solution()?;
    let text = solution.csv().to_string();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("t,x[0],x[1],z,u,p,Limits[0],Limits[1],End"));
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), N + 1);
    for (k, row) in rows.iter().enumerate() {
        assert_eq!(row.len(), 9);
        assert_eq!(row[2].parse::<f64>()?, solution.state("x[1]")?[k]);
        assert_eq!(row[4].is_empty(), k == N);
        assert_eq!(row[8].is_empty(), k != N);
    }
    assert_eq!(rows[3][4].parse::<f64>()?, solution.control("u")?[3]);
    Ok(())
}

fn message<V>(result: Result<V, TrajectoryError>) -> String {
    result.err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn invalid_arguments() -> Test {
    let mut ocp = solved_problem()?;
    let solution = ocp.solution()?;
    assert_eq!(
        message(solution.state("speed")),
        "the solution of `Cart` has no `speed`: it has `x[0]`, `x[1]`"
    );
    assert_eq!(message(solution.state("x")), "`x` is ambiguous, it matches `x[0]`, `x[1]`");
    assert_eq!(
        message(solution.constraint("Corner")),
        "the solution of `Cart` has no `Corner`: it has `Limits[0]`, `Limits[1]`"
    );
    assert!(message(solution.get("y")).contains("`z`, `u`, `p`, `Limits[0]`"));
    let mut short =
        Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?).on(Horizon::uniform(2, 0.1))?;
    assert_eq!(
        message(short.restore(&solution).map(|_| ())),
        "the trajectory has 11 values of `x[0]` instead of 3: for other horizons use `guess_from`, which interpolates"
    );
    let mut other = Problem::new(Map::<Step, f64>::new()).on(Horizon::uniform(N, 0.1))?;
    assert_eq!(
        message(other.guess_from(&solution).map(|_| ())),
        "the solution of `Cart` has no `x[2]`: it has `x[0]`, `x[1]`"
    );
    assert!(matches!(other.solution(), Err(OcpError::Missing { .. })));
    for points in [usize::MAX, usize::MAX / 2, 1 << 50] {
        assert!(matches!(ocp.dense_solution(points), Err(OcpError::OutOfMemory { .. })), "{points}");
    }
    Ok(())
}

#[function]
fn step(x: [f64; 3], u: f64) -> [f64; 3] {
    [x[0] + u, x[1], x[2]]
}
