//! Adjoints in place of Jacobians: the solutions of those that compute all Jacobians.

use crate::Test;
use casados::ocp::{
    Adjoints, Formulation, GaussNewton, GeneralCost, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, OcpError,
    Outcome, Problem, SecondOrder, Shooting,
};
use casados::prelude::*;
use casados::qp::residuals;

type Solution = (Outcome, Vec<f64>);

const TOLERANCE: f64 = 1e-7;

fn exact<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    mut ocp: HeapOcp<P>,
) -> Result<Solution, Box<dyn std::error::Error>> {
    let mut sqp = HeapSqp::new(&ocp)?;
    sqp.options.tolerance = TOLERANCE;
    let outcome = sqp.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{}{outcome}", sqp.log());
    Ok((outcome, variables(&ocp)))
}

fn variables<P: Formulation<f64>>(ocp: &HeapOcp<P>) -> Vec<f64> {
    ocp.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()).collect()
}

fn close(a: &Solution, b: &Solution, tolerance: f64) {
    let worst = a.1.iter().zip(&b.1).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
    assert_eq!(a.1.len(), b.1.len());
    assert!(worst < tolerance, "{worst}");
    assert!((a.0.objective - b.0.objective).abs() < tolerance * (1.0 + a.0.objective.abs()));
}

/// A pendulum on a cart that swings: dynamics curve.
#[ode]
fn cart(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let (s, c) = x[1].sin_cos();
    let m = 1.1 - 0.1 * c * c;
    let turn = -0.08 * s * x[3] * x[3];
    [x[2], x[3], (turn + 0.981 * c * s + u[0]) / m, (turn * c + u[0] * c + 10.791 * s) / (0.8 * m)]
}
#[function]
fn effort(x: [f64; 4], u: [f64; 1]) -> [f64; 5] {
    [x[0], 3.0 * x[1], 0.3 * x[2], 0.3 * x[3], 0.1 * u[0]]
}
#[function]
fn rest(x: [f64; 4], _u: [f64; 1]) -> [f64; 4] {
    [3.0 * x[0], 5.0 * x[1], x[2], x[3]]
}

const X0: [f64; 4] = [0.2, 0.6, 0.0, -0.3];

macro_rules! balance {
    ($dynamics:expr) => {{
        let mut ocp = Problem::new($dynamics)
            .stage_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0; 5]))
            .terminal_cost(LeastSquaresCost::<Rest>::diagonal(&[1.0; 4]))
            .on(Horizon::uniform(20, 0.05))?;
        ocp.fix_initial_state(&X0)?.bound("u", .., -9.0, 9.0)?.guess(&X0, &[0.0])?;
        ocp
    }};
}

fn irk() -> Result<Irk<Cart, Gauss<2>>, casados::Error> {
    Irk::<Cart, Gauss<2>>::new(Options::default())
}

/// With kept Jacobians: the solution, and how often Jacobians and adjoints were computed.
fn kept<P: Formulation<f64, Dynamics: Adjoints<f64>>>(
    mut ocp: HeapOcp<P>,
    contraction: f64,
) -> Result<(Solution, usize, usize), Box<dyn std::error::Error>> {
    let mut sqp = HeapSqp::new(&ocp)?.keep_jacobians();
    sqp.curvature.contraction = contraction;
    (sqp.options.tolerance, sqp.options.max_iterations) = (TOLERANCE, 200);
    let outcome = sqp.solve(&mut ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged(), "{outcome}");
    let counts = (sqp.curvature.jacobians(), sqp.curvature.adjoints());
    // The conditions of optimality with all Jacobians, element by element.
    ocp.linearise(GaussNewton::default())?;
    let (judged, _) = residuals(ocp.qp(), ocp.iterate());
    assert!(judged.largest() <= 1.1 * TOLERANCE, "{judged}");
    Ok(((outcome, variables(&ocp)), counts.0, counts.1))
}

/// Adjoints in place of Jacobians: the solution of full Jacobians, with fewer of these; from single
/// intervals and from a batch.
#[test]
fn kept_jacobians_have_the_same_solution() -> Test {
    let reference = exact(balance!(irk()?))?;
    let (always, jacobians, adjoints) = kept(balance!(irk()?), 0.0)?;
    // All of them are computed in each iteration.
    assert_eq!(adjoints, 0);
    close(&reference, &always, 1e-4);
    for contraction in [0.5, 0.8] {
        let (found, fewer, adjoints) = kept(balance!(irk()?), contraction)?;
        println!(
            "{} {jacobians}; {contraction} {} {fewer} {adjoints}",
            always.0.iterations, found.0.iterations
        );
        close(&reference, &found, 1e-4);
        assert!(fewer < jacobians && adjoints > 0, "{fewer} {jacobians} {adjoints}");
        let batch = Batch::<Cart, Gauss<2>>::new(Options::default())?;
        let (of_batch, jacobians, same) = kept(balance!(Shooting::new(batch)), contraction)?;
        close(&found, &of_batch, 1e-6);
        assert_eq!((jacobians, same), (fewer, adjoints));
    }
    Ok(())
}

/// What keeps Jacobians has no algebraic states at nodes, and says so by name.
#[dae]
fn algebraic(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], u: [f64; 1]) -> [f64; 2] {
    [xdot[0] - z[0], z[0] - u[0] + x[0]]
}
#[function]
fn of_z(_x: [f64; 1], z: [f64; 1], _u: [f64; 1]) -> f64 {
    z[0] * z[0]
}

#[test]
fn kept_jacobians_refuse_costs_of_algebraic_states() -> Test {
    let irk = Irk::<Algebraic, Gauss<2>>::new(Options::default())?;
    let problem = Problem::new(irk).stage_cost(GeneralCost::<OfZ>::new());
    let mut ocp = problem.on(Horizon::uniform(2, 0.1))?;
    ocp.fix_initial_state(&[0.5])?.guess(&[0.5], &[0.0])?;
    let refused = HeapSqp::new(&ocp)?.keep_jacobians().solve(&mut ocp);
    assert!(matches!(refused, Err(OcpError::NotThere { function: "OfZ", .. })));
    Ok(())
}
