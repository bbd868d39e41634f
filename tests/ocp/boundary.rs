//! Boundary conditions: derivatives against those of copies of the first state that are states,
//! the short form of periodic states, closed forms, and mistakes by name.

use crate::Test;
use crate::free_parameters::stage_numbers;
use casados::ocp::{
    Boundary, Constraint, Exact, Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, OcpError,
    Problem, SecondOrder,
};
use casados::prelude::*;
use casados::qp::Side;

/// A pendulum with a parameter, and the same with copies of its first state.
#[ode]
mod pendulums {
    fn rates(x: [f64; 2], u: f64, p: f64) -> [f64; 2] {
        [x[1], u - p * x[0].sin()]
    }
    #[ode]
    fn pendulum(x: [f64; 2], u: f64, p: f64) -> [f64; 2] {
        rates(x, u, p)
    }
    #[ode]
    fn with_copies(x: [f64; 4], u: f64, p: f64) -> [f64; 4] {
        let [a, b] = rates([x[0], x[1]], u, p);
        [a, b, 0.0, 0.0]
    }
    #[function]
    fn effort(x: [f64; 2], u: f64, _p: f64) -> f64 {
        u * u + 0.1 * (x[0] - 0.4) * (x[0] - 0.4)
    }
    #[function]
    fn effort_with_copies(x: [f64; 4], u: f64, _p: f64) -> f64 {
        u * u + 0.1 * (x[0] - 0.4) * (x[0] - 0.4)
    }

    fn both(a: [f64; 2], b: [f64; 2], p: f64) -> [f64; 2] {
        [b[0] - a[0] * a[1] * p, b[1] * b[1] * a[0] + (a[0] * b[0]).sin()]
    }
    #[function]
    fn ends(x0: [f64; 2], x: [f64; 2], p: f64) -> [f64; 2] {
        both(x0, x, p)
    }
    #[function]
    fn ends_with_copies(x: [f64; 4], _u: f64, p: f64) -> [f64; 2] {
        both([x[2], x[3]], [x[0], x[1]], p)
    }
    /// Of one element alone.
    #[function]
    fn speed(x0: [f64; 2], x: [f64; 2], _p: f64) -> f64 {
        x[1] - x0[1] + 0.2
    }
    #[function]
    fn speed_with_copies(x: [f64; 4], _u: f64, _p: f64) -> f64 {
        x[1] - x[3] + 0.2
    }
    #[function]
    fn closed(x0: [f64; 2], x: [f64; 2], _p: f64) -> [f64; 2] {
        [x[0] - x0[0], x[1] - x0[1]]
    }
}

/// At the last stage the columns of a copy are those of a state in its place; where the conditions
/// are a pair, each has copies of its own.
#[test]
fn derivatives_by_copied_states() -> Test {
    const N: usize = 3;
    let (lower, upper) = ([-1.0, 0.2], [2.0, 0.3]);
    let erk = Options { steps: 2, ..Options::default() };
    let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(erk)?)
        .terminal_constraints(Boundary::<Ends>::new(lower, upper))
        .on(Horizon::uniform(N, 0.2))?;
    let mut other = Problem::new(Erk::<WithCopies, Rk4>::new(erk)?)
        .terminal_constraints(Constraint::<EndsWithCopies>::new(lower, upper))
        .on(Horizon::uniform(N, 0.2))?;
    let mut pair = Problem::new(Erk::<Pendulum, Rk4>::new(erk)?)
        .terminal_constraints((Boundary::<Speed>::new([0.0], [0.0]), Boundary::<Ends>::new(lower, upper)))
        .on(Horizon::uniform(N, 0.2))?;
    let start = [0.7, -0.4];
    ocp.free_initial_state().set_parameters(.., &[1.3])?;
    pair.free_initial_state().set_parameters(.., &[1.3])?;
    other.free_initial_state().set_parameters(.., &[1.3])?;
    for k in 0..=N {
        let x = [0.7 + 0.3 * k as f64, -0.4 - 0.2 * k as f64];
        let u = if k < N { &[0.1][..] } else { &[] };
        ocp.guess_stage(k, &x, u)?;
        pair.guess_stage(k, &x, u)?;
        other.guess_stage(k, &[x[0], x[1], start[0], start[1]], u)?;
    }
    let multipliers = [0.6, -1.1];
    ocp.iterate_mut().stage_mut(N).ok_or("no stage")?.g_upper.copy_from_slice(&multipliers);
    other.iterate_mut().stage_mut(N).ok_or("no stage")?.g_upper.copy_from_slice(&multipliers);
    pair.iterate_mut().stage_mut(N).ok_or("no stage")?.g_upper[1..].copy_from_slice(&multipliers);
    let none = Exact { convexification: casados::ocp::Convexification::None };
    ocp.linearise(none)?;
    other.linearise(none)?;
    pair.linearise(none)?;
    let (one, two) = (&stage_numbers(&ocp, 2)[N], &stage_numbers(&other, 4)[N]);
    assert_eq!(one.len(), two.len());
    for (i, (a, b)) in one.iter().zip(two).enumerate() {
        assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{i}: {a} {b}");
    }
    // Of the pair: speeds have the copy 0, the other function the copies 1 and 2.
    let last = pair.qp().stages().nth(N).ok_or("no stage")?;
    let alone = ocp.qp().stages().nth(N).ok_or("no stage")?;
    assert_eq!(
        (last.d().get(0, 0), last.d().get(0, 1), last.c().get(0, 1)),
        (Some(-1.0), Some(0.0), Some(1.0))
    );
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        assert_eq!(last.d().get(row + 1, column + 1), alone.d().get(row, column));
        assert_eq!(last.r().get(2, 1), alone.r().get(1, 0));
        assert_eq!(last.s().get(row + 1, column), alone.s().get(row, column));
    }
    Ok(())
}

fn solve_both_forms<P: Formulation<f64, Dynamics: SecondOrder<f64>> + Clone>(
    ocp: &HeapOcp<P>,
) -> Result<[HeapOcp<P>; 2], Box<dyn std::error::Error>> {
    let (mut a, mut b) = (ocp.clone(), ocp.clone());
    let outcome = HeapIpm::new(&a)?.solve(&mut a)?;
    assert!(outcome.is_converged(), "{outcome}");
    let outcome = HeapSqp::new(&b)?.solve(&mut b)?;
    assert!(outcome.is_converged(), "{outcome}");
    Ok([a, b])
}

/// `x_N − x₀ = 0` is the short form's solution.
#[test]
fn periodic_states() -> Test {
    let erk = || Erk::<Pendulum, Rk4>::new(Options { steps: 2, ..Options::default() });
    let cost = GeneralCost::<Effort>::new;
    let horizon = Horizon::uniform(12, 0.2);
    let mut general = Problem::new(erk()?)
        .running_cost(cost())
        .terminal_constraints(Boundary::<Closed>::new([0.0; 2], [0.0; 2]))
        .on(horizon)?;
    let mut short = Problem::new(erk()?).running_cost(cost()).on(horizon)?;
    general.free_initial_state().guess(&[0.2, 0.1], &[0.0])?;
    short.free_initial_state().guess(&[0.2, 0.1], &[0.0])?.periodic("x")?;
    // It starts with a push.
    general.bound("x[1]", ..1, 0.5, 0.5)?;
    short.bound("x[1]", ..1, 0.5, 0.5)?;
    for k in 0..=12 {
        let p = 1.0 + 0.8 * f64::from(k as u32).sin();
        general.set_parameters(k..=k, &[p])?;
        short.set_parameters(k..=k, &[p])?;
    }
    let text = general.to_string();
    assert!(text.contains("Closed[0] = 0 at stage 12") && !text.contains("free parameter"), "{text}");
    let [reference, _] = solve_both_forms(&short)?;
    assert!((reference.stage(0)?.x[0] - reference.stage(6)?.x[0]).abs() > 1e-3);
    for ocp in solve_both_forms(&general)? {
        for k in 0..=12 {
            let (a, b) = (ocp.stage(k)?, reference.stage(k)?);
            for (a, b) in a.x.iter().chain(a.u).zip(b.x.iter().chain(b.u)) {
                assert!((a - b).abs() < 1e-6, "stage {k}: {a} {b}");
            }
        }
    }
    // It is in solutions by its name; a solution is a start again.
    let [mut solved, _] = solve_both_forms(&general)?;
    let solution = solved.solution()?;
    assert!(solution.terminal("Closed[1]")?[0].abs() < 1e-8);
    general.restore(&solution)?;
    let restored = general.solution()?;
    assert_eq!(restored.state("x[0]")?, solution.state("x[0]")?);
    assert!((restored.terminal("Closed[1]")?[0] - solution.terminal("Closed[1]")?[0]).abs() < 1e-8);
    Ok(())
}

/// A rotation with a period of one: up to a turn by an angle it is periodic after that part of a
/// period, from wherever it starts.
#[ode(duration = p.duration)]
mod wheel {
    pub struct Turn {
        pub duration: f64,
        pub angle: f64,
    }
    pub fn wheel(x: [f64; 2], _p: &Turn) -> [f64; 2] {
        let rate = 2.0 * core::f64::consts::PI;
        [-rate * x[1], rate * x[0]]
    }
    #[function]
    fn turned(x0: [f64; 2], x: [f64; 2], p: &Turn) -> [f64; 2] {
        let (s, c) = p.angle.sin_cos();
        [x[0] - c * x0[0] + s * x0[1], x[1] - s * x0[0] - c * x0[1]]
    }
    #[function]
    fn radius(x: [f64; 2], _p: &Turn) -> f64 {
        (x[0] * x[0] + x[1] * x[1] - 1.0) * (x[0] * x[0] + x[1] * x[1] - 1.0) + 0.1 * x[1] * x[1]
    }
    /// The way that was gone, at least.
    #[function]
    fn way(x0: [f64; 2], x: [f64; 2], _p: &Turn) -> f64 {
        (x[0] - x0[0]) * (x[0] - x0[0]) + (x[1] - x0[1]) * (x[1] - x0[1])
    }
}

#[test]
fn partial_period_with_free_end_time() -> Test {
    let irk = Irk::<Wheel, Gauss<4>>::new(Options::default())?;
    let mut ocp = Problem::new(irk)
        .terminal_cost(GeneralCost::<Radius>::new())
        .terminal_constraints((
            Boundary::<Turned>::new([0.0; 2], [0.0; 2]),
            Boundary::<Way>::new([0.5], [f64::INFINITY]),
        ))
        .on(Horizon::free(6, 0.05..=0.6, 0.3))?;
    ocp.free_initial_state().set_parameters(.., &[f64::MAX, 1.0])?;
    for k in 0..=6 {
        let (s, c) = (1.8 * k as f64 / 6.0).sin_cos();
        ocp.guess_stage(k, &[0.9 * c, 0.9 * s], &[])?;
    }
    for mut ocp in solve_both_forms(&ocp)? {
        let solution = ocp.solution()?;
        let expected = 1.0 / (2.0 * std::f64::consts::PI);
        assert!((solution.end_time() - expected).abs() < 1e-6, "{}", solution.end_time());
        assert!((solution.terminal("Way")?[0] - 2.0 * (1.0 - 1.0_f64.cos())).abs() < 1e-3);
        assert_eq!(solution.get("Way")?.lower, [Some(0.5)]);
    }
    Ok(())
}

/// An inequality that holds a solution back, soft and hard, and its multiplier.
#[test]
fn hard_and_soft_inequalities() -> Test {
    let problem = |boundary: Boundary<Speed>| {
        let erk = Erk::<Pendulum, Rk4>::new(Options { steps: 2, ..Options::default() })?;
        let mut ocp = Problem::new(erk)
            .running_cost(GeneralCost::<Effort>::new())
            .terminal_constraints(boundary)
            .on(Horizon::uniform(5, 0.2))?;
        ocp.free_initial_state().guess(&[0.2, 0.1], &[0.0])?.set_parameters(.., &[1.0])?;
        Ok::<_, Box<dyn std::error::Error>>(ocp)
    };
    let speed = || Boundary::<Speed>::new([1.0], [f64::INFINITY]);
    for mut ocp in solve_both_forms(&problem(speed())?)? {
        let solution = ocp.solution()?;
        let (value, force) = (solution.terminal("Speed")?[0], solution.multiplier("Speed")?[0]);
        assert!((value - 1.0).abs() < 1e-6 && force < -0.1, "{value} {force}");
        let (x0, x) = (ocp.stage(0)?.x[1], ocp.stage(5)?.x[1]);
        assert!((x - x0 + 0.2 - value).abs() < 1e-7);
    }
    for mut ocp in solve_both_forms(&problem(speed().soft(0.05, 0.0))?)? {
        let solution = ocp.solution()?;
        let (value, force) = (solution.terminal("Speed")?[0], solution.multiplier("Speed")?[0]);
        assert!(value < 0.99 && (force + 0.05).abs() < 1e-5, "{value} {force}");
        assert_eq!(solution.violations(1e-3)[0].side, Side::Lower);
    }
    Ok(())
}

#[test]
fn invalid_arguments() -> Test {
    let erk = || Erk::<Pendulum, Rk4>::new(Options::default());
    let everywhere = Problem::new(erk()?)
        .path_constraints(Boundary::<Speed>::new([0.0], [0.0]))
        .on(Horizon::uniform(2, 0.1));
    let error = everywhere.err().ok_or("it is accepted")?;
    assert!(matches!(error, OcpError::Unsupported { .. }), "{error}");
    let crossed = Problem::new(erk()?)
        .terminal_constraints(Boundary::<Speed>::new([1.0], [0.0]))
        .on(Horizon::uniform(2, 0.1));
    assert!(matches!(crossed.err(), Some(OcpError::CrossedBounds { name: "Speed", stage: 2, .. })));
    Ok(())
}
