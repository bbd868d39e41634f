//! Random problems of optimal control with a feasible trajectory: what is said of them is true, and
//! a solver that has solved others, or failed to, says the same as one that never did.
//!
//! `CASADOS_RANDOM=100` makes a hundred times as many.

use crate::Test;
use crate::runs::{Counts, error_kind, prints_verdicts, seeds};
use casados::ocp::{
    Constraint, GaussNewton, Globalisation, HeapIpm, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map,
    OcpError, Outcome, Problem, Status,
};
use casados::prelude::*;
use casados::qp::residuals;

/// Numbers from a seed (splitmix64: Steele, Lea, Flood, "Fast splittable pseudorandom number
/// generators", OOPSLA 2014).
struct Numbers(u64);

impl Numbers {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn below(&mut self, bound: usize) -> usize {
        (self.bits() % bound as u64) as usize
    }
    /// In −1 .. 1.
    fn next(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A mass on a spring that may push: the equations are linear.
#[function]
fn spring(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
    [x[0] + 0.2 * x[1], x[1] + 0.2 * (u[0] - p[0] * x[0] - p[1] * x[1])]
}

/// A pendulum.
#[function]
fn pendulum(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> [f64; 2] {
    [x[0] + 0.2 * x[1], x[1] + 0.2 * (u[0] + 3.0 * p[0] * x[0].sin() - p[1] * x[1] * x[1].abs())]
}

#[function]
fn output(x: [f64; 2], u: [f64; 1], _p: [f64; 2]) -> [f64; 3] {
    [x[0], x[1], u[0]]
}

#[function]
fn state(x: [f64; 2], _u: [f64; 1], _p: [f64; 2]) -> [f64; 2] {
    [x[0], x[1]]
}

/// Linear, too.
#[function]
fn mixed(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> f64 {
    x[0] + p[0] * u[0]
}

/// Power.
#[function]
fn power(x: [f64; 2], u: [f64; 1], p: [f64; 2]) -> f64 {
    x[1] * u[0] + p[1] * x[0] * x[0]
}

type Stage = LeastSquaresCost<Output>;
type End = LeastSquaresCost<State>;

/// What a problem is made of.
struct Draw {
    intervals: usize,
    p: [f64; 2],
    weights: [f64; 3],
    reference: [f64; 3],
    x: Vec<[f64; 2]>,
    u: Vec<f64>,
    distance: [f64; 4],
    guess: Vec<[f64; 3]>,
}

impl Draw {
    fn new(random: &mut Numbers, next: impl Fn(&[f64; 2], f64, &[f64; 2]) -> [f64; 2]) -> Self {
        let intervals = 1 + random.below(8);
        let p = [0.5 + random.next().abs(), 0.2 * random.next().abs()];
        let (mut x, mut u) = (vec![[random.next(), random.next()]], Vec::new());
        for k in 0..intervals {
            u.push(random.next());
            x.push(next(&x[k], u[k], &p));
        }
        // A tenth of the guesses is anything.
        let size = [0.0, 0.3, 1.0, 1.0, 1.0, 3.0, 3.0, 10.0, 30.0, 1e200][random.below(10)];
        Self {
            intervals,
            p,
            weights: core::array::from_fn(|_| 10_f64.powf(2.0 * random.next())),
            reference: core::array::from_fn(|_| 2.0 * random.next()),
            x,
            u,
            distance: core::array::from_fn(|_| 0.05 + random.next().abs()),
            guess: (0..=intervals).map(|_| core::array::from_fn(|_| size * random.next())).collect(),
        }
    }
}

/// A problem in which the drawn trajectory satisfies all constraints.
macro_rules! problem {
    ($draw:expr, $next:ty, $constraint:ty, $value:expr) => {{
        let draw: &Draw = $draw;
        let [near_x, near_v, near_u, near_g] = draw.distance;
        let infinity = f64::INFINITY;
        let mut ocp = Problem::new(Map::<$next, f64>::new())
            .stage_cost(Stage::diagonal(&draw.weights))
            .terminal_cost(End::diagonal(&[draw.weights[0], draw.weights[1]]))
            .path_constraints(Constraint::<$constraint>::new([-infinity], [infinity]))
            .on(Horizon::uniform(draw.intervals, 0.2))?;
        ocp.set_parameters(.., &draw.p)?.fix_initial_state(&draw.x[0])?;
        for k in 0..draw.intervals {
            let u = draw.u[k];
            ocp.bound("u[0]", k..=k, f64::max(u - near_u, -1.2), f64::min(u + near_u, 1.2))?;
            let value: f64 = $value(&draw.x[k], u, &draw.p);
            ocp.set_path_bounds(k..=k, &[-infinity], &[value + near_g])?;
            ocp.set_reference(k..=k, &draw.reference)?;
        }
        for k in 1..=draw.intervals {
            let x = draw.x[k];
            ocp.bound("x[0]", k..=k, x[0] - near_x, x[0] + 2.0 * near_x)?;
            ocp.bound("x[1]", k..=k, x[1] - near_v, infinity)?;
        }
        for k in 0..=draw.intervals {
            let [a, b, c] = draw.guess[k];
            let u = [c];
            ocp.guess_stage(k, &[a, b], if k < draw.intervals { &u } else { &[] })?;
        }
        ocp
    }};
}

fn spring_step(x: &[f64; 2], u: f64, p: &[f64; 2]) -> [f64; 2] {
    [x[0] + 0.2 * x[1], x[1] + 0.2 * (u - p[0] * x[0] - p[1] * x[1])]
}
fn pendulum_step(x: &[f64; 2], u: f64, p: &[f64; 2]) -> [f64; 2] {
    [x[0] + 0.2 * x[1], x[1] + 0.2 * (u + 3.0 * p[0] * x[0].sin() - p[1] * x[1] * x[1].abs())]
}
fn mixed_value(x: &[f64; 2], u: f64, p: &[f64; 2]) -> f64 {
    x[0] + p[0] * u
}
fn power_value(x: &[f64; 2], u: f64, p: &[f64; 2]) -> f64 {
    x[1] * u + p[1] * x[0] * x[0]
}

/// All numbers of the iterate.
macro_rules! numbers {
    ($ocp:expr) => {{
        let stages = $ocp.iterate().stages();
        stages
            .flat_map(|s| [s.x, s.u, s.dynamics, s.x_lower, s.x_upper, s.g_upper].concat())
            .collect::<Vec<f64>>()
    }};
}

mod allowed_residuals;
mod control;

use allowed_residuals::AllowedResiduals;

/// What is said of a run, without how long it took.
fn said(found: &Result<Outcome, OcpError>) -> String {
    match found {
        Ok(outcome) => format!("{:?} {} {:?}", outcome.status, outcome.iterations, outcome.objective),
        Err(error) => format!("{error:?}"),
    }
}

/// Checks a run, and that of another solver on the same problem.
macro_rules! judge {
    ($counts:expr, $seed:expr, $tolerance:expr, ($ocp:expr, $found:expr), ($other:expr, $again:expr)) => {{
        let (found, again) = ($found, $again);
        assert_eq!(said(&found), said(&again), "{}", $seed);
        let (all, others) = (numbers!($ocp), numbers!($other));
        assert!(all.iter().zip(&others).all(|(a, b)| a.to_bits() == b.to_bits()), "{}", $seed);
        match &found {
            Ok(outcome) => {
                if outcome.is_solved() {
                    assert!(all.iter().all(|number| number.is_finite()), "{}: {outcome}", $seed);
                }
                if outcome.status == Status::Converged {
                    // By the problem linearised anew, element by element.
                    $ocp.linearise(GaussNewton::default())?;
                    let (judged, _) = residuals($ocp.qp(), $ocp.iterate());
                    assert!(judged.largest() <= 2.0 * $tolerance, "{}: {judged} {outcome}", $seed);
                    $counts.count("Ok");
                } else {
                    $counts.count(&error_kind(&outcome.status));
                }
                if prints_verdicts() && outcome.status != Status::Converged {
                    println!("{} {}: {outcome}", $counts, $seed);
                }
            }
            Err(error) => {
                $counts.count(&error_kind(error));
                if prints_verdicts() {
                    println!("{} {}: {error}", $counts, $seed);
                }
            }
        }
        found
    }};
}

/// Solves what `make` makes, and something else with the same solver before.
macro_rules! runs {
    ($counts:expr, $seed:expr, $draw:expr, $other:expr, $make:expr, |$ocp:ident| $solver:expr) => {{
        let mut spoiled = $other?;
        let mut solver = {
            let $ocp = &spoiled;
            $solver
        };
        let _ = solver.solve(&mut spoiled);
        let mut problem = $make?;
        let found = solver.solve(&mut problem);
        let mut same = $make?;
        let mut fresh = {
            let $ocp = &same;
            $solver
        };
        let again = fresh.solve(&mut same);
        let tolerance = solver.options.allowed($draw.objective_sensitivity());
        (judge!($counts, $seed, tolerance, (problem, found), (same, again)), problem)
    }};
}

type SpringProblem = Problem<Map<Spring, f64>, Stage, End, Constraint<Mixed>>;

fn linear(draw: &Draw) -> Result<HeapOcp<SpringProblem>, OcpError> {
    Ok(problem!(draw, Spring, Mixed, mixed_value))
}

/// A problem of the same size whose start is nowhere.
fn unreachable_problem<P>(
    ocp: Result<HeapOcp<P>, OcpError>,
    random: &mut Numbers,
) -> Result<HeapOcp<P>, OcpError>
where
    P: casados::ocp::Formulation<f64>,
{
    let mut ocp = ocp?;
    let special = [f64::NAN, 1e300, f64::INFINITY, -1e150, 5e-324][random.below(5)];
    for stage in 0..ocp.qp().dims().len() {
        if let Some(stage) = ocp.iterate_mut().stage_mut(stage) {
            stage.x[random.below(2)] = special;
        }
    }
    Ok(ocp)
}

fn random_globalisation(random: &mut Numbers) -> Globalisation {
    [Globalisation::Merit, Globalisation::Filter, Globalisation::FullStep][random.below(3)]
}

/// Linear equations and constraints, with a feasible trajectory: `Infeasible` is false.
#[test]
fn random_convex_problems() -> Test {
    let (mut sqp, mut ipm) = (Counts::new("convex, SQP"), Counts::new("convex, interior point"));
    for seed in seeds(100) {
        let random = &mut Numbers(seed);
        let draw = Draw::new(random, spring_step);
        let (globalisation, elastic) = (random_globalisation(random), random.below(2) == 0);
        let (found, _) =
            runs!(sqp, seed, draw, unreachable_problem(linear(&draw), random), linear(&draw), |ocp| {
                let mut solver = HeapSqp::new(ocp)?;
                (solver.options.globalisation, solver.options.elastic) = (globalisation, elastic);
                solver
            });
        let is_false = |found: &Result<Outcome, OcpError>| {
            found.as_ref().is_ok_and(|outcome| {
                matches!(outcome.status, Status::Infeasible { .. } | Status::InfeasibleQp { .. })
            })
        };
        assert!(!is_false(&found), "{seed}: {found:?}");
        let (found, _) =
            runs!(ipm, seed, draw, unreachable_problem(linear(&draw), random), linear(&draw), |ocp| {
                HeapIpm::new(ocp)?
            });
        assert!(!is_false(&found), "{seed}: {found:?}");
    }
    println!("{sqp}\n{ipm}");
    // Guesses of 1e200, one in ten, have no objective.
    assert!(
        20 * sqp.count_of("Ok") >= 17 * sqp.all() && 20 * ipm.count_of("Ok") >= 17 * ipm.all(),
        "{sqp}\n{ipm}"
    );
    Ok(())
}

type PendulumProblem = Problem<Map<Pendulum, f64>, Stage, End, Constraint<Power>>;

fn nonlinear(draw: &Draw) -> Result<HeapOcp<PendulumProblem>, OcpError> {
    Ok(problem!(draw, Pendulum, Power, power_value))
}

/// Violations at an iterate, by the data of the problem.
#[derive(Default)]
struct Violations {
    largest: f64,
    sum: f64,
    gaps: f64,
}

impl Violations {
    fn of(draw: &Draw, ocp: &HeapOcp<PendulumProblem>) -> Self {
        let [near_x, near_v, near_u, near_g] = draw.distance;
        let stages: Vec<([f64; 2], Option<f64>)> = ocp
            .iterate()
            .stages()
            .map(|stage| ([stage.x[0], stage.x[1]], stage.u.first().copied()))
            .collect();
        let mut found = Self::default();
        for (k, &(x, u)) in stages.iter().enumerate() {
            if k > 0 {
                let known = draw.x[k];
                found.note_violation(known[0] - near_x - x[0]);
                found.note_violation(x[0] - known[0] - 2.0 * near_x);
                found.note_violation(known[1] - near_v - x[1]);
            }
            let Some(u) = u else { continue };
            let power = power_value(&draw.x[k], draw.u[k], &draw.p) + near_g;
            found.note_violation(f64::max(draw.u[k] - near_u, -1.2) - u);
            found.note_violation(u - f64::min(draw.u[k] + near_u, 1.2));
            found.note_violation(power_value(&x, u, &draw.p) - power);
            let next = pendulum_step(&x, u, &draw.p).into_iter().zip(stages[k + 1].0);
            found.gaps += next.map(|(next, found)| (next - found).abs()).sum::<f64>();
        }
        found
    }

    fn note_violation(&mut self, violation: f64) {
        self.largest = self.largest.max(violation);
        self.sum += violation.max(0.0);
    }
}

/// What is said to be violated is, by so much, and no bound is by more; gaps are together no more
/// than violations of bounds.
fn check_infeasibility(
    seed: u64,
    draw: &Draw,
    (found, ocp): (Result<Outcome, OcpError>, HeapOcp<PendulumProblem>),
) {
    if let Ok(Outcome { status: Status::Infeasible { violation, .. }, .. }) = found {
        let Violations { largest, sum, gaps } = Violations::of(draw, &ocp);
        assert!((largest - violation).abs() <= 1e-12 * (1.0 + violation), "{seed}: {largest}, {found:?}");
        assert!(gaps <= sum * (1.0 + 1e-12), "{seed}: {gaps}, {sum}, {found:?}");
    }
}

/// A pendulum with a bound on power. Near an iterate there may be no feasible point: `Infeasible`
/// says no more than that.
#[test]
fn random_nonconvex_problems() -> Test {
    let mut sqp = Counts::new("pendulum with bounded power, SQP by Gauss and Newton");
    let mut exact = Counts::new("the same, exact Hessians");
    let mut ipm = Counts::new("the same, interior point");
    for seed in seeds(100) {
        let random = &mut Numbers(!seed);
        let draw = Draw::new(random, pendulum_step);
        let globalisation = random_globalisation(random);
        let run =
            runs!(sqp, seed, draw, unreachable_problem(nonlinear(&draw), random), nonlinear(&draw), |ocp| {
                let mut solver = HeapSqp::new(ocp)?.gauss_newton();
                solver.options.globalisation = globalisation;
                solver
            });
        check_infeasibility(seed, &draw, run);
        let run = runs!(
            exact,
            seed,
            draw,
            unreachable_problem(nonlinear(&draw), random),
            nonlinear(&draw),
            |ocp| {
                let mut solver = HeapSqp::new(ocp)?;
                solver.options.globalisation = globalisation;
                solver
            }
        );
        check_infeasibility(seed, &draw, run);
        let run =
            runs!(ipm, seed, draw, unreachable_problem(nonlinear(&draw), random), nonlinear(&draw), |ocp| {
                HeapIpm::new(ocp)?
            });
        check_infeasibility(seed, &draw, run);
    }
    println!("{sqp}\n{exact}\n{ipm}");
    for counts in [sqp, exact, ipm] {
        assert!(2 * counts.count_of("Ok") >= counts.all(), "{counts}");
    }
    Ok(())
}
