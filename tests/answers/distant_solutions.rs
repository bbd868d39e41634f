//! Problems whose numbers are far from one: solutions are chosen first, and references of the cost
//! such that they are solutions.

use crate::Test;
use casados::ocp::{
    Collocation, GeneralCost, HeapIpm, HeapOcp, HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Map,
    Outcome, Problem, Status,
};
use casados::prelude::*;
use casados::testing::Random;

/// `x₊ = a x + b u`
#[function]
fn linear(x: f64, u: f64, p: [f64; 6]) -> f64 {
    p[4] * x + p[5] * u
}
/// `½ q (x − x_r)² + ½ r (u − u_r)²`
#[function]
fn deviation(x: f64, u: f64, p: [f64; 6]) -> f64 {
    0.5 * p[2] * (x - p[0]) * (x - p[0]) + 0.5 * p[3] * (u - p[1]) * (u - p[1])
}

const N: usize = 6;

/// Where numbers are far from one.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Displacement {
    /// Variables, each in a unit.
    Units,
    /// The origin of the control: it is near one beside its lower bound, which is large.
    Offset,
    /// The objective.
    Objective,
    /// Variables and the objective.
    Both,
}

/// A problem and its solution: states, controls, and the objective there.
struct KnownProblem {
    p: [[f64; 6]; N],
    x: [f64; N + 1],
    u: [f64; N],
    /// Lower and upper bounds of the control.
    bounds: [f64; 2],
    objective: f64,
    /// Sizes of `x` and `u`.
    units: [f64; 2],
}

/// With `λ_k` the multiplier of a bound that is active and `π` the costates, `q (x − x_r) = π_k − a
/// π_{k+1}` and `r (u − u_r) = −b π_{k+1} ± λ_k` are the conditions of optimality.
fn known_problem(random: &mut Random, far: Displacement, k: i32) -> KnownProblem {
    let power =
        |random: &mut Random| 10.0_f64.powi(random.below(2 * k.unsigned_abs() as usize + 1) as i32 - k);
    let units = matches!(far, Displacement::Units | Displacement::Both);
    let [sx, su] = if units { [power(random), power(random)] } else { [1.0; 2] };
    let force = if matches!(far, Displacement::Objective | Displacement::Both) { power(random) } else { 1.0 };
    let origin = if far == Displacement::Offset { 10.0_f64.powi(k) } else { 0.0 };
    let (a, b) = (0.5 + 0.4 * random.symmetric(), 1.0 + 0.5 * random.symmetric());
    let (q, r) = (1.0 + 0.5 * random.symmetric(), 1.0 + 0.5 * random.symmetric());
    let mut known = KnownProblem {
        p: [[0.0; 6]; N],
        x: [0.0; N + 1],
        u: [0.0; N],
        bounds: [origin * su, (origin + 2.0) * su],
        objective: 0.0,
        units: [sx, su],
    };
    let mut costates = [0.0; N + 1];
    costates[..N].iter_mut().for_each(|costate| *costate = random.symmetric());
    // From where the control of the offset holds it.
    let mut x = random.symmetric() + b * origin / (1.0 - a);
    for stage in 0..N {
        let multiplier = 0.1 + random.unit();
        let (u, push) = match random.below(3) {
            0 => (origin, multiplier),
            1 => (origin + 2.0, -multiplier),
            _ => (origin + 0.2 + 1.6 * random.unit(), 0.0),
        };
        let of_x = if stage == 0 { 0.0 } else { (costates[stage] - a * costates[stage + 1]) / q };
        let of_u = (push - b * costates[stage + 1]) / r;
        known.p[stage] =
            [(x - of_x) * sx, (u - of_u) * su, force * q / (sx * sx), force * r / (su * su), a, b * sx / su];
        known.objective += 0.5 * force * (q * of_x * of_x + r * of_u * of_u);
        (known.x[stage], known.u[stage]) = (x * sx, u * su);
        x = a * x + b * u;
    }
    known.x[N] = x * sx;
    known
}

type Far1 = HeapOcp<Problem<Map<Linear, f64>, GeneralCost<Deviation>>, f64>;

fn problem(known: &KnownProblem, near: bool) -> Result<Far1, Box<dyn std::error::Error>> {
    let problem = Problem::new(Map::<Linear, f64>::new()).stage_cost(GeneralCost::<Deviation>::new());
    let mut ocp = problem.on(Horizon::uniform(N, 1.0))?;
    ocp.set_parameters(N.., &known.p[N - 1])?;
    for (stage, p) in known.p.iter().enumerate() {
        ocp.set_parameters(stage..=stage, p)?;
    }
    ocp.fix_initial_state(&[known.x[0]])?.bound("u", .., known.bounds[0], known.bounds[1])?;
    let guess = if near { known.bounds[0] } else { 0.0 };
    ocp.guess(&[if near { known.x[0] } else { 0.0 }], &[guess])?;
    Ok(ocp)
}

/// The largest difference to the solution in units, less what rounding leaves of numbers that are
/// large beside their unit: a thousand times their last digit.
fn error(ocp: &Far1, known: &KnownProblem) -> Result<f64, Box<dyn std::error::Error>> {
    let mut largest = 0.0f64;
    for stage in 0..N {
        let at = ocp.stage(stage)?;
        let pairs = [(at.x[0], known.x[stage]), (at.u[0], known.u[stage])];
        for ((found, expected), unit) in pairs.into_iter().zip(known.units) {
            let rounding = 1e3 * f64::EPSILON * expected.abs();
            largest = largest.max(((found - expected).abs() - rounding) / unit);
        }
    }
    Ok(largest)
}

/// By how much controls violate their bounds.
fn bound_violation(ocp: &Far1, known: &KnownProblem) -> Result<f64, Box<dyn std::error::Error>> {
    let [lower, upper] = known.bounds;
    let mut largest = 0.0f64;
    for stage in 0..N {
        let u = ocp.stage(stage)?.u[0];
        largest = largest.max(lower - u).max(u - upper);
    }
    Ok(largest)
}

/// A solver, its outcome, how far it is from the solution, and by how much it violates bounds.
type Run = (&'static str, Outcome, f64, f64);

/// Both solvers from both guesses.
fn solve_from_both_guesses(known: &KnownProblem) -> Result<Vec<Run>, Box<dyn std::error::Error>> {
    let mut found = Vec::new();
    for near in [false, true] {
        let mut ocp = problem(known, near)?;
        let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
        let name = if near { "Sqp near" } else { "Sqp" };
        found.push((name, outcome, error(&ocp, known)?, bound_violation(&ocp, known)?));
        let mut ocp = problem(known, near)?;
        let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
        let name = if near { "Ipm near" } else { "Ipm" };
        found.push((name, outcome, error(&ocp, known)?, bound_violation(&ocp, known)?));
    }
    Ok(found)
}

/// The conditions of optimality hold to 1e-8 in units, each off by a hundred at most, and the
/// reduced Hessian is at least a half of these: solutions are as near as 1e-5, also where the
/// origin of a control is 1e8 away and the distance of its bounds is two.
#[test]
fn solutions_in_all_units() -> Test {
    let mut random = Random::new(11);
    for far in [Displacement::Units, Displacement::Offset, Displacement::Objective, Displacement::Both] {
        for k in [1, 3, 5, 8] {
            for _ in 0..20 {
                let known = known_problem(&mut random, far, k);
                for (solver, outcome, error, violation) in solve_from_both_guesses(&known)? {
                    // Differences of near numbers are exact, so that no digit has to be forgiven
                    // but for products with units.
                    let said = outcome.residuals.inequalities * (1.0 + 1e-9);
                    assert!(violation <= said, "{far:?} {k} {solver}: {violation:e} {outcome}");
                    // With an offset of 1e8 a distance of one has eight digits: slacks of `Ipm` are
                    // rounded.
                    let hard = far == Displacement::Offset && k == 8 && solver.starts_with("Ipm");
                    let solved = outcome.is_converged() || hard && outcome.is_solved();
                    assert!(solved && error < 1e-5, "{far:?} {k} {solver}: {error:e} {outcome}");
                }
            }
        }
    }
    Ok(())
}

/// A feedback of a real-time iteration, whose solver of QPs knows no units but those that it
/// finds, has the control of the solution in all units, in the same iterations; up to three, but
/// for a few.
#[test]
fn real_time_iterations_in_all_units() -> Test {
    let mut differences = std::collections::BTreeMap::<i64, usize>::new();
    for seed in 0..200 {
        let mut own = None;
        for k in [0, 2, 5, 8] {
            // The same problem, since as many numbers are drawn.
            let known = known_problem(&mut Random::new(seed), Displacement::Both, k);
            let mut controller = HeapRealTime::exact(problem(&known, false)?)?;
            let feedback = controller.prepare()?.feedback(&known.x[..1])?;
            let error = (feedback.u[0] - known.u[0]).abs() / known.units[1];
            assert!(error < 1e-5, "seed {seed}, 1e±{k}: {error:e}");
            let iterations = feedback.statistics.iterations as i64;
            *differences.entry(iterations - *own.get_or_insert(iterations)).or_default() += 1;
        }
    }
    println!("{differences:?}");
    let more: usize = differences.iter().filter(|(more, _)| more.abs() > 3).map(|(_, count)| count).sum();
    assert!(more <= 8, "{differences:?}");
    Ok(())
}

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}
#[function]
fn economy(x: [f64; 2], u: f64) -> f64 {
    u * u + (x[0] - 1.0).cos()
}
#[function]
fn effort(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0], 0.3 * x[1], 0.3 * u]
}

/// Costs are not less than −1: whatever rounding does to states of 1e51, no run may say that they
/// fall without end.
#[test]
fn large_initial_states_are_not_unbounded() -> Test {
    let irk = || Irk::<Pendulum, Gauss<2>>::new(Options::default());
    for exponent in [6, 12, 24, 51, 150] {
        for x0 in [[1.0, 0.3], [-1.2, 0.0], [0.5, -2.0], [0.0, 1.0]] {
            let x0 = x0.map(|x: f64| x * 10.0_f64.powi(exponent));
            let economy = Problem::new(irk()?).running_cost(GeneralCost::<Economy>::new());
            let mut ocp = economy.on(Horizon::uniform(4, 0.1))?;
            ocp.fix_initial_state(&x0)?.guess(&[0.3, -0.2], &[0.1])?;
            if let Ok(outcome) = HeapIpm::new(&ocp)?.solve(&mut ocp) {
                assert_ne!(outcome.status, Status::Unbounded, "{x0:?} {outcome}");
            }
            let effort = LeastSquaresCost::<Effort>::diagonal(&[1.0; 3]);
            let problem = Problem::new(Collocation::new(irk()?)?).running_cost(effort);
            let mut ocp = problem.on(Horizon::uniform(4, 0.1))?;
            ocp.fix_initial_state(&x0)?.guess(&[0.3, -0.2], &[0.1])?;
            if let Ok(outcome) = HeapIpm::new(&ocp)?.solve(&mut ocp) {
                assert_ne!(outcome.status, Status::Unbounded, "{x0:?} {outcome}");
            }
        }
    }
    Ok(())
}

#[function]
fn add(x: f64, u: f64) -> f64 {
    x + u
}
#[function]
fn grow(x: f64, u: f64) -> f64 {
    x + 0.1 * u * u
}
#[function]
fn gain(_x: f64, u: f64) -> f64 {
    -u
}
#[function]
fn distant(_x: f64, u: f64) -> f64 {
    (u - 1e18) * (u - 1e18)
}

/// By `make`, with a change of the problem.
macro_rules! status {
    ($dynamics:ident, $cost:ident, |$ocp:ident| $change:block) => {{
        let problem = Problem::new(Map::<$dynamics, f64>::new()).stage_cost(GeneralCost::<$cost>::new());
        let mut $ocp = problem.on(Horizon::uniform(3, 0.1))?;
        $ocp.fix_initial_state(&[0.3])?.guess(&[0.0], &[0.0])?;
        $change
        HeapIpm::new(&$ocp)?.solve(&mut $ocp)?.status
    }};
}

/// What has no end: by dynamics that are not linear too, and where a soft bound costs less than is
/// gained. What has one: by a bound of another variable, by a soft bound that costs more, at a
/// minimum that is far away.
#[test]
fn unbounded_problems() -> Test {
    let none = f64::NEG_INFINITY;
    assert_eq!(status!(Add, Gain, |ocp| {}), Status::Unbounded);
    assert_eq!(status!(Grow, Gain, |ocp| {}), Status::Unbounded);
    let far = status!(Add, Gain, |ocp| {
        ocp.guess(&[3e6], &[1e6])?.bound("u", .., 1e5, f64::INFINITY)?;
    });
    assert_eq!(far, Status::Unbounded);
    for (penalty, expected) in [(0.5, Status::Unbounded), (2.0, Status::Converged)] {
        let soft = status!(Add, Gain, |ocp| {
            ocp.bound("u", .., none, 1.0)?.soften("u", .., penalty, 0.0)?;
        });
        assert_eq!(soft, expected, "{penalty}");
    }
    assert_eq!(
        status!(Add, Gain, |ocp| {
            ocp.bound("x", 1.., -1.0, 1.0)?;
        }),
        Status::Converged
    );
    assert_ne!(
        status!(Grow, Gain, |ocp| {
            ocp.bound("x", 3.., none, 9.0)?;
        }),
        Status::Unbounded
    );
    assert_ne!(status!(Add, Distant, |ocp| {}), Status::Unbounded);
    Ok(())
}
