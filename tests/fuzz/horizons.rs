//! Free parameters, free ends and conditions between the ends, with any ranges, guesses and
//! options; what is asked about such problems; and batches of quadratic programs with anything in
//! them.

use super::source::Source;
use super::*;
use casados::ocp::{
    Boundary, Collocation, GeneralCost, HeapIpm, HeapSqp, Horizon, OcpError, Outcome, Problem, Status,
};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use casados::qp::{BatchInteriorPoint, HeapQp, HeapSolution, QpInstance, QpStart, StageDims};

/// A weight on a rope whose length, and how long it swings, are free.
#[ode(duration = p.duration)]
mod swings {
    pub struct State {
        /// Angle, rad.
        pub angle: f64,
        /// Speed, rad/s.
        pub speed: f64,
    }
    pub struct Design {
        pub length: f64,
        /// Seconds, s.
        pub duration: f64,
    }

    pub fn swing(x: &State, u: f64, p: &Design) -> State {
        State { angle: x.speed, speed: u - x.angle.sin() / p.length }
    }
    /// Not negative: no run is unbounded.
    #[function]
    fn price(x: &State, u: f64, p: &Design) -> f64 {
        u * u + x.angle * x.angle + (p.length - 1.0) * (p.length - 1.0)
    }
    #[function]
    fn round_trip(x0: &State, x: &State, p: &Design) -> [f64; 2] {
        [x.angle - x0.angle, x.speed + x0.speed * p.length]
    }
}

/// A range, ordered or not, and a guess that is mostly in it.
fn range(source: &mut Source) -> (core::ops::RangeInclusive<f64>, f64) {
    let (lower, length, guess) = (source.number(), source.number(), source.number());
    match source.below(4) {
        0 => (lower..=length, guess),
        1 => (lower.abs()..=lower.abs() + length.abs(), lower.abs() + 0.5 * length.abs()),
        _ => (0.1..=3.0, 0.1 + 0.9 * guess.abs().min(3.0)),
    }
}

/// A run by one of both solvers.
macro_rules! solve {
    ($ocp:expr, $source:expr) => {
        if $source.below(2) == 0 {
            let mut ipm = HeapIpm::new($ocp)?;
            ipm.options.max_iterations = [40, 40, 3][$source.below(3)];
            ipm.solve($ocp)?
        } else {
            let mut sqp = HeapSqp::new($ocp)?;
            sqp.options.max_iterations = [40, 40, 3][$source.below(3)];
            sqp.solve($ocp)?
        }
    };
}

/// A problem with all of it, its run, and what is asked about it then.
macro_rules! run {
    ($dynamics:expr, $source:expr, $seed:expr) => {{
        let source: &mut Source = $source;
        let solve = || -> Result<Outcome, OcpError> {
            let ends = Boundary::<RoundTrip>::new([0.0, source.number()], [0.0, f64::INFINITY]);
            let ((ends_range, end), parts) = (range(source), [0.0, source.number(), 1.0]);
            let horizon = match source.below(4) {
                0 => Horizon::uniform([3, 1, 0][source.below(3)], 0.3),
                1 => Horizon::free_nodes(&parts, ends_range, end),
                _ => Horizon::free(source.below(6), ends_range, end),
            };
            let problem = Problem::new($dynamics).running_cost(GeneralCost::<Price>::new());
            let mut ocp = problem.terminal_constraints(ends).on(horizon)?;
            ocp.set_parameters(.., &[1.0, 0.7])?;
            ocp.guess(&[source.number(), source.number()], &[source.number()])?;
            if source.below(3) == 0 {
                ocp.free_initial_state();
            } else {
                ocp.fix_initial_state(&[source.number(), source.number()])?;
            }
            if source.below(3) > 0 {
                let (range, guess) = range(source);
                ocp.free(["p.length", "p", "p.mass"][source.below(8).min(2) % 3], range, guess)?;
            }
            if source.below(3) == 0 {
                let (a, b) = (source.number(), source.number());
                ocp.bound(["u", "x.angle", "p.length"][source.below(3)], .., a.min(b), a.max(b))?;
            }
            if source.below(4) == 0 {
                let _ = ocp.guess_by_simulation();
            }
            for warning in ocp.warnings()? {
                assert!(!warning.to_string().is_empty());
            }
            let outcome = solve!(&mut ocp, source);
            assert!(!outcome.to_string().is_empty());
            // The cost is not negative, and so are ends: a free one has a positive range.
            assert!(outcome.status != Status::Unbounded, "seed {}: {outcome}", $seed);
            let options = AdaptiveOptions { max_steps: 200, ..source.adaptive_options() };
            if let Ok(mut adaptive) = Adaptive::<Swings, Radau>::new(options)
                && let Ok(verification) = ocp.verify(&mut adaptive)
            {
                let defects = verification.defects();
                assert!(defects.iter().all(|defect| defect.amount.is_finite()), "seed {}", $seed);
                let refined = Horizon::refined(ocp.times(), &verification.intervals(source.number()));
                assert!(refined.len() < 2 * ocp.times().len());
                assert!(!verification.to_string().is_empty());
            }
            if matches!(outcome.status, Status::Converged | Status::Acceptable) {
                let numbers = outcome.objective.is_finite() && outcome.residuals.largest().is_finite();
                assert!(numbers, "seed {}: {outcome}", $seed);
                let mut solution = ocp.solution()?;
                let all = solution.series().iter().flat_map(|series| &series.values).chain(solution.times());
                assert!(all.into_iter().all(|value| value.is_finite()), "seed {}: {outcome}", $seed);
                let name = ["x.angle", "u", "p.length", "t", "y", ""][source.below(6)];
                let unit = ["m/s", "a < b & c", "\u{1b}\u{ffff}"][source.below(3)];
                let _ = solution.set_unit(name, unit).is_ok();
                if let Ok(panel) = Panel::trajectories(&solution, "x.angle") {
                    let svg = Figure::new().with(panel).to_svg();
                    assert!(roxmltree::Document::parse(&svg).is_ok(), "seed {}: {svg}", $seed);
                }
            }
            Ok(outcome)
        };
        solve()
    }};
}

#[test]
fn free_parameters_and_ends() {
    let mut counts = Counts::new("free parameters and ends, conditions between the ends");
    for seed in seeds(150) {
        let mut source = Source::new(seed);
        let found = match source.below(3) {
            0 => Irk::<Swings, Gauss<2>>::new(source.options())
                .map_err(OcpError::from)
                .and_then(|irk| run!(irk, &mut source, seed)),
            1 => Erk::<Swings, Rk4>::new(Options::default())
                .map_err(OcpError::from)
                .and_then(|erk| run!(erk, &mut source, seed)),
            _ => Irk::<Swings, RadauIIA<2>>::new(Options::default())
                .and_then(Collocation::new)
                .map_err(OcpError::from)
                .and_then(|collocation| run!(collocation, &mut source, seed)),
        };
        match found {
            Ok(Outcome { status: Status::Converged | Status::Acceptable, .. }) => counts.count("Ok"),
            Ok(outcome) => {
                if prints_verdicts() {
                    println!("seed {seed}: {outcome}");
                }
                let text = format!("{:?}", outcome.status);
                counts.count(text.split([' ', '(', '{']).next().unwrap_or_default());
            }
            Err(error) => counts.count_result::<(), _>(&Err(error)),
        }
    }
    enough(&counts, 5);
}

/// A quadratic program of a few stages with anything in it.
fn random_program(source: &mut Source) -> Result<HeapQp, casados::qp::QpError> {
    let count = 1 + source.below(4);
    let dims: Vec<_> = (0..count)
        .map(|k| StageDims::new(2, if k + 1 < count { source.below(3) } else { 0 }, source.below(2)))
        .collect();
    let mut qp = HeapQp::new(&dims)?;
    for (k, dims) in dims.iter().enumerate() {
        let Some(mut stage) = qp.stage_mut(k) else { break };
        for i in 0..2 {
            stage.q_mut().set(i, i, 1.0);
            stage.a_mut().set(i, i, 1.0);
            for j in 0..dims.nu {
                stage.b_mut().set(i, j, source.number());
            }
            if source.below(20) == 0 {
                stage.q_mut().set(i, source.below(2), source.number());
            }
            stage.gradient_x_mut()[i] = source.number();
        }
        for j in 0..dims.nu {
            stage.r_mut().set(j, j, 1.0);
            let bound = source.number();
            stage.u_bounds_mut().set(j, -bound.abs(), bound.abs());
        }
        for i in 0..dims.ng {
            stage.c_mut().set(i, 0, source.number());
            let (a, b) = (source.number(), source.number());
            stage.g_bounds_mut().set(i, a.min(b), a.max(b));
        }
    }
    Ok(qp)
}

/// Each problem of a batch has an answer that is finite or a verdict, and what stands beside a
/// problem changes nothing.
#[test]
fn batches_of_quadratic_programs() -> Result<(), casados::qp::QpError> {
    let mut counts = Counts::new("batches of quadratic programs");
    let mut batch = BatchInteriorPoint::new();
    for seed in seeds(200) {
        let mut source = Source::new(seed);
        let mut instances = Vec::new();
        for _ in 0..source.below(20) {
            let qp = random_program(&mut source)?;
            let solution = HeapSolution::new(qp.dims())?;
            instances.push(QpInstance { qp, solution });
        }
        let start = [QpStart::Cold, QpStart::Warm][source.below(2)];
        let mut reversed: Vec<_> = instances.iter().rev().cloned().collect();
        let statuses = batch.solve(&mut instances, start)?.to_vec();
        let others = batch.solve(&mut reversed, start)?;
        for (status, other) in statuses.iter().zip(others.iter().rev()) {
            assert_eq!(format!("{status:?}"), format!("{other:?}"), "seed {seed}");
            counts.count_result(status);
        }
        for (status, instance) in statuses.iter().zip(&instances) {
            let mut stages = (0..instance.qp.dims().len()).filter_map(|k| instance.solution.stage(k));
            let finite = stages.all(|stage| stage.x.iter().chain(stage.u).all(|v| v.is_finite()));
            assert!(finite || status.is_err(), "seed {seed}");
        }
    }
    enough(&counts, 500);
    Ok(())
}
