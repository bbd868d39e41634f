//! Random problems by classes: what is solvable is solved, what is said of the others is true.
//!
//! A run has some hundred problems of each class; `CASADOS_QP_RANDOM=100` multiplies that.

use crate::Test;
use crate::known::{Hessian, Kind, Known, Numbers, PLAIN, problem};
use casados::qp::{
    HeapInteriorPoint, HeapSolution, QpError, QpSolver, Residuals, SolutionStage, Start, residuals,
};

const TOLERANCE: f64 = 1e-8;

/// How many problems of a class.
fn cases(few: u64) -> u64 {
    let factor = std::env::var("CASADOS_QP_RANDOM").ok().and_then(|factor| factor.parse().ok());
    few * factor.unwrap_or(1)
}

/// What became of the problems of a class.
#[derive(Debug, Default)]
struct Counts {
    all: u64,
    solved: u64,
    wrong: u64,
    infeasible: u64,
    not_convex: u64,
    iterations_used_up: u64,
    stalled: u64,
    others: u64,
    iterations: u64,
}

impl Counts {
    /// Every verdict but `Ok` is false: the problem has a solution.
    fn count(&mut self, seed: u64, found: &Result<(usize, Option<String>), QpError>) {
        self.all += 1;
        match found {
            Ok((iterations, None)) => {
                self.solved += 1;
                self.iterations += *iterations as u64;
            }
            Ok((_, Some(_))) => self.wrong += 1,
            Err(QpError::Infeasible { .. }) => self.infeasible += 1,
            Err(QpError::NotConvex { .. }) => self.not_convex += 1,
            Err(QpError::MaxIterations { .. }) => self.iterations_used_up += 1,
            Err(QpError::Stalled { .. }) => self.stalled += 1,
            Err(_) => self.others += 1,
        }
        if std::env::var("CASADOS_QP_SHOW").is_ok() && !matches!(found, Ok((_, None))) {
            println!("{seed}: {found:?}");
        }
    }
    fn false_verdicts(&self) -> u64 {
        self.wrong + self.infeasible + self.not_convex + self.others
    }
}

fn multipliers<'a>(stage: &SolutionStage<'a, f64>) -> impl Iterator<Item = &'a f64> + use<'a> {
    let sides = [stage.x_lower, stage.x_upper, stage.u_lower, stage.u_upper, stage.g_lower, stage.g_upper];
    sides.into_iter().flatten()
}

/// What is wrong with a point that is said to be the solution.
///
/// With residuals `r`, `f(v) − f* ≤ Σ slack · multiplier + r |v − v*|₁` and `f* − f(v) ≤ r (|λ*|₁ + |π*|₁)`: convexity along the line
/// between the points, and weak duality.
fn wrong(known: &Known, found: &HeapSolution<f64>, tolerance: f64) -> Option<String> {
    let (Residuals { stationarity, dynamics, inequalities, complementarity }, objective) =
        residuals(known.qp.view(), found);
    let largest = stationarity.max(dynamics).max(inequalities).max(complementarity);
    let is_number = [stationarity, dynamics, inequalities, complementarity, objective];
    if is_number.iter().any(|r| !r.is_finite()) || largest > tolerance {
        return Some(format!("residuals {stationarity:e} {dynamics:e} {inequalities:e} {complementarity:e}"));
    }
    let (_, expected) = residuals(known.qp.view(), &known.solution);
    let (mut distance, mut forces, mut sides) = (0.0, 0.0, 0.0);
    for (a, b) in found.stages().zip(known.solution.stages()) {
        let pairs = a.x.iter().zip(b.x).chain(a.u.iter().zip(b.u));
        distance += pairs.map(|(a, b)| (a - b).abs()).sum::<f64>();
        let all = b.dynamics.iter().chain(multipliers(&b));
        forces += all.map(|force| force.abs()).sum::<f64>();
        sides += 2.0 * multipliers(&b).count() as f64;
    }
    let rounding = 1e-13 * (1.0 + expected.abs()) * sides.max(1.0);
    let (above, below) = (largest * (sides + distance) + rounding, largest * forces + rounding);
    let difference = objective - expected;
    (difference > above || -difference > below)
        .then(|| format!("objective {objective} instead of {expected}: {difference:e}, {above:e}, {below:e}"))
}

/// Solves problems of a kind; `start` may write something senseless into the solution first.
fn run(name: &str, kind: &Kind, few: u64, start: Start) -> Result<Counts, QpError> {
    let mut counts = Counts::default();
    let only: Option<u64> = std::env::var("ONLY").ok().and_then(|s| s.parse().ok());
    for seed in only.map_or(0..cases(few), |s| s..s + 1) {
        let mut random = Numbers::new(seed.wrapping_mul(2).wrapping_add(1));
        let known = problem(&mut random, kind)?;
        let (own, _) = residuals(known.qp.view(), &known.solution);
        assert!(own.largest() < 1e-11 * 10_f64.powf(2.0 * kind.units), "{seed}: {own}");
        let mut solver = HeapInteriorPoint::new();
        if kind.units > 0.0 {
            // Terms of other sizes: a part of them is what can be asked for.
            solver.options.relative_tolerance = 1e-9;
        }
        let mut solution = HeapSolution::new(known.qp.dims())?;
        if start == Start::Warm {
            senseless(&mut random, &mut solution);
        }
        let found = solver.solve(known.qp.view(), start, solution.view_mut());
        let tolerance = if kind.units > 0.0 { f64::INFINITY } else { TOLERANCE };
        let found = found.map(|statistics| (statistics.iterations, wrong(&known, &solution, tolerance)));
        counts.count(seed, &found);
    }
    println!("{name}: {counts:?}");
    Ok(counts)
}

/// Numbers of all sizes and signs, and now and then none.
fn senseless(random: &mut Numbers, solution: &mut HeapSolution<f64>) {
    let size = [0.0, 1.0, 8.0, 100.0][random.below(4)];
    for k in 0..solution.dims().len() {
        let Some(stage) = solution.stage_mut(k) else { return };
        let parts = [
            stage.x, stage.u, stage.dynamics, stage.x_lower, stage.x_upper, stage.u_lower, stage.u_upper,
            stage.g_lower, stage.g_upper,
        ];
        for value in parts.into_iter().flatten() {
            let number = random.next() * random.power(size);
            *value = if random.chance(0.001) { f64::NAN } else { number };
        }
    }
}

#[test]
fn strictly_convex() -> Test {
    let counts = run("strictly convex", &PLAIN, 300, Start::Cold)?;
    assert_eq!(counts.solved, counts.all);
    let kind = Kind { empty: true, ..PLAIN };
    let counts = run("strictly convex with empty stages", &kind, 300, Start::Cold)?;
    assert_eq!(counts.solved, counts.all);
    Ok(())
}

#[test]
fn convex() -> Test {
    for hessian in [Hessian::LowRank, Hessian::Zero] {
        let kind = Kind { hessian, empty: true, ..PLAIN };
        let counts = run(&format!("{hessian:?}"), &kind, 300, Start::Cold)?;
        assert!(counts.false_verdicts() == 0 && 1000 * counts.solved >= 999 * counts.all, "{counts:?}");
    }
    Ok(())
}

#[test]
fn degenerate() -> Test {
    for hessian in [Hessian::Definite, Hessian::LowRank, Hessian::Zero] {
        let kind = Kind { hessian, degenerate: true, empty: true, ..PLAIN };
        let counts = run(&format!("degenerate, {hessian:?}"), &kind, 300, Start::Cold)?;
        assert!(counts.false_verdicts() == 0 && 1000 * counts.solved >= 999 * counts.all, "{counts:?}");
    }
    Ok(())
}

#[test]
fn soft() -> Test {
    for hessian in [Hessian::Definite, Hessian::LowRank] {
        for huge in [1e3, 1e8, 1e10, 1e12, 1e14, 1e20, f64::INFINITY] {
            let kind = Kind { hessian, soft: Some(huge), empty: true, ..PLAIN };
            let counts = run(&format!("soft, {hessian:?}, none is {huge:e}"), &kind, 100, Start::Cold)?;
        }
    }
    Ok(())
}

#[test]
fn senseless_starts() -> Test {
    for hessian in [Hessian::Definite, Hessian::LowRank, Hessian::Zero] {
        let kind = Kind { hessian, soft: Some(1e12), degenerate: true, empty: true, ..PLAIN };
        let counts = run(&format!("senseless start, {hessian:?}"), &kind, 200, Start::Warm)?;
        assert!(counts.false_verdicts() == 0 && 1000 * counts.solved >= 999 * counts.all, "{counts:?}");
    }
    Ok(())
}

#[test]
fn other_units() -> Test {
    for hessian in [Hessian::Definite, Hessian::Zero] {
        for units in [1.0, 3.0] {
            let kind = Kind { hessian, units, ..PLAIN };
            let counts = run(&format!("units of 1e±{units}, {hessian:?}"), &kind, 200, Start::Cold)?;
            assert!(counts.false_verdicts() == 0 && 1000 * counts.solved >= 999 * counts.all, "{counts:?}");
        }
    }
    Ok(())
}
