//! Units of constraints in real-time iterations, the smallest options that are allowed, and what a
//! user meets first: the prelude, the log.

use crate::Test;
use casados::ocp::{
    Constraint, HeapIpm, HeapOcp, HeapRealTime, HeapSqp, Horizon, Kind, LeastSquaresCost, Map, OcpError,
    Problem,
};
use casados::prelude::*;

#[function]
fn drive(x: f64, u: f64) -> f64 {
    x + u
}
#[function]
fn both(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}

/// The same wall in metres and in other units: `UNIT u ≥ −0.3 UNIT`.
macro_rules! walled {
    ($name:ident, $type:ident, $unit:literal) => {
        #[function]
        fn $name(_x: f64, u: f64) -> f64 {
            $unit * u
        }
        mod $name {
            use super::*;
            type Walled = Problem<Map<Drive, f64>, LeastSquaresCost<Both>, (), Constraint<$type>>;
            fn problem() -> Result<HeapOcp<Walled>, OcpError> {
                let mut ocp = Problem::new(Map::<Drive, f64>::new())
                    .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
                    .path_constraints(Constraint::<$type>::new([-0.3 * $unit], [f64::INFINITY]))
                    .on(Horizon::uniform(4, 1.0))?;
                ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
                Ok(ocp)
            }
            /// The first control of a sample from one.
            pub fn feedback() -> Result<f64, OcpError> {
                Ok(HeapRealTime::new(problem()?)?.prepare()?.feedback(&[1.0])?.u[0])
            }
        }
    };
}
walled!(metres, Metres, 1.0);
walled!(kilometres, Kilometres, 1e-3);
walled!(small, Small, 1e-5);
walled!(pascal, Pascal, 1e5);
walled!(large, Large, 1e8);

/// Without the wall the first control of `min ½ Σ (x² + u²)` over four stages is −1.6/2.6: the
/// wall holds it at −0.3, in any unit.
#[test]
fn feedback_in_other_units() -> Test {
    let controls = [
        metres::feedback()?,
        kilometres::feedback()?,
        small::feedback()?,
        pascal::feedback()?,
        large::feedback()?,
    ];
    for u in controls {
        assert!((u + 0.3).abs() < 1e-6, "{controls:?}");
    }
    Ok(())
}

/// However near to its bounds a run begins, its multipliers are numbers, and those of the other
/// method.
#[test]
fn warm_starts_close_to_bounds() -> Test {
    let make = || -> Result<_, OcpError> {
        let mut ocp = Problem::new(Map::<Drive, f64>::new())
            .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
            .on(Horizon::uniform(4, 1.0))?;
        ocp.fix_initial_state(&[1.0])?.bound("u", .., -0.3, 0.3)?.guess(&[1.0], &[-0.3])?;
        Ok(ocp)
    };
    let mut known = make()?;
    assert!(HeapSqp::new(&known)?.solve(&mut known)?.is_converged());
    let expected = known.solution()?.multiplier("u")?;
    for push in [f64::MIN_POSITIVE, 1e-300, 1e-30] {
        let mut ocp = make()?;
        let mut ipm = HeapIpm::new(&ocp)?;
        (ipm.options.warm_start, ipm.options.warm_push) = (true, push);
        let outcome = ipm.solve(&mut ocp)?;
        let solution = ocp.solution()?;
        for series in solution.series() {
            let multipliers = series.lower_multipliers.iter().chain(&series.upper_multipliers);
            assert!(multipliers.chain(&series.values).all(|value| value.is_finite()), "{push:e}: {series:?}");
        }
        let found = solution.multiplier("u")?;
        let near = found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(outcome.is_solved() && near, "{push:e}: {outcome} {found:?} {expected:?}");
    }
    Ok(())
}

/// Warm starts next to a bound at zero, with pushes down to the smallest positive number.
#[test]
fn the_smallest_push_beside_zero() -> Test {
    for push in [f64::MIN_POSITIVE, 1e-300, 1e-30, 1e-20, 1e-12] {
        let problem =
            Problem::new(Map::<Drive, f64>::new()).stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]));
        let mut ocp = problem.on(Horizon::uniform(4, 1.0))?;
        ocp.fix_initial_state(&[-1.0])?.bound("u", .., 0.0, 2.0)?.guess(&[-1.0], &[0.0])?;
        let mut ipm = HeapIpm::new(&ocp)?;
        (ipm.options.warm_start, ipm.options.warm_push) = (true, push);
        let outcome = ipm.solve(&mut ocp)?;
        // `P₃ = 1`, `P₂ = 1.5`, `P₁ = 1.6`: `u₀ = 1.6/2.6`, no bound is active.
        let u = ocp.stage(0)?.u[0];
        assert!(outcome.is_converged() && (u - 1.6 / 2.6).abs() < 1e-6, "{push:e}: {u} {outcome}");
    }
    Ok(())
}

#[ode]
mod cart {
    #[derive(Debug, PartialEq, Record)]
    pub struct State {
        pub place: f64,
        pub speed: f64,
    }
    pub fn cart(x: &State, u: f64) -> State {
        State { place: x.speed, speed: u }
    }
    use casados::prelude::*;
}

/// The derive and the trait come with the prelude.
#[test]
fn records_of_the_prelude() -> Test {
    let start = cart::State { place: 0.0, speed: 1.0 };
    let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?).on(Horizon::uniform(2, 0.5))?;
    ocp.fix_initial_state(&start.numbers())?.guess(&start.numbers(), &[0.0])?;
    assert_eq!(ocp.solution()?.record(Kind::State, 2), Some(start));
    Ok(())
}

/// A solver without QPs has no number of their iterations in its log.
#[test]
fn qp_iterations_in_logs() -> Test {
    let mut ocp = Problem::new(Map::<Drive, f64>::new())
        .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(4, 1.0))?;
    ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
    let column = |log: String| -> Result<Vec<String>, Box<dyn std::error::Error>> {
        let mut lines = log.lines();
        let end = lines.next().and_then(|head| head.find("QP it.")).ok_or("no such column")? + "QP it.".len();
        let cell =
            |line: &str| line.get(..end).and_then(|line| line.split_whitespace().last()).map(String::from);
        Ok(lines.filter_map(cell).collect())
    };
    let mut ipm = HeapIpm::new(&ocp)?;
    ipm.solve(&mut ocp)?;
    let of_ipm = column(ipm.log().to_string())?;
    assert!(!of_ipm.is_empty() && of_ipm.iter().all(|cell| cell == "-"), "{of_ipm:?}\n{}", ipm.log());
    ocp.guess(&[1.0], &[0.0])?;
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.solve(&mut ocp)?;
    let of_sqp = column(sqp.log().to_string())?;
    assert!(
        of_sqp.iter().any(|cell| cell.parse::<usize>().is_ok_and(|n| n > 0)),
        "{of_sqp:?}\n{}",
        sqp.log()
    );
    Ok(())
}
