//! Direct collocation has the solution of multiple shooting, for it is the same discretisation.

use crate::Test;
use crate::chain_model::Chain;
use crate::chain_problem;
use casados::ocp::{
    Collocation, Constraint, Formulation, GaussNewton, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon,
    LeastSquaresCost, Problem, SecondOrder,
};
use casados::prelude::*;
use reference_data::Record;

type Failure = Box<dyn std::error::Error>;

/// Both solve to this, which is a tenth of the stiffness of the least control (`h R = 0.004`) below
/// what solutions are held against.
const TOLERANCE: f64 = 1e-13;
const SOLUTION_TOLERANCE: f64 = 1e-9;

/// Solves by the interior point; states and controls, and how many iterations it took.
fn solve<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(
    ocp: &mut HeapOcp<P>,
) -> Result<(Vec<f64>, usize), Failure> {
    let mut ipm = HeapIpm::new(ocp)?;
    ipm.options.tolerance = TOLERANCE;
    // Roundings of the gradient are in the way of that.
    ipm.options.acceptable_tolerance = 1e-11;
    ipm.options.acceptable_iterations = 3;
    let outcome = ipm.solve(ocp)?;
    assert!(outcome.residuals.largest() <= 1e-11, "{outcome}\n{}", ipm.log());
    let solution = ocp.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat());
    Ok((solution.collect(), outcome.iterations))
}

fn assert_same_solution(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() <= SOLUTION_TOLERANCE, "{i}: {found} {expected}");
    }
}

macro_rules! chain {
    ($record:expr, $options:expr) => {{
        let irk = || Irk::<Chain<9>, Gauss<2>>::new($options);
        let (rest, x0) = ($record.list("xrest")?, $record.list("x0")?);
        let shooting = chain_problem::problem!(9, rest.clone(), x0.clone(), irk()?);
        (shooting, chain_problem::problem!(9, rest, x0, Collocation::new(irk()?)?))
    }};
}

/// Two steps in an interval; no iteration of Newton's method is taken for stages alone.
#[test]
fn chain_of_masses() -> Test {
    let record = Record::load("ocp/chain_3.json")?;
    let (mut shooting, mut collocation) = chain!(record, Options { steps: 2, ..Default::default() });
    let (expected, iterations) = solve(&mut shooting)?;
    let (found, more) = solve(&mut collocation)?;
    assert_same_solution(&found, &expected);
    assert!(more <= iterations + 3, "{more} {iterations}");
    assert_eq!(collocation.problem().dynamics.iterations(), 2);
    Ok(())
}

/// Stages are not those that the states lead to until the problem is solved: what is left of their
/// equations counts as violation.
#[test]
fn violations_of_stage_equations() -> Test {
    let record = Record::load("ocp/chain_3.json")?;
    let (_, mut collocation) = chain!(record, Options { steps: 2, ..Default::default() });
    // At rest everything is satisfied, and with other velocities nothing is but continuity.
    let rest = record.list("xrest")?;
    for k in 0..=40 {
        let mut x = rest.clone();
        x[6] = 0.3;
        collocation.guess_stage(k, if k == 0 { &rest } else { &x }, if k < 40 { &[0.0; 3] } else { &[] })?;
    }
    collocation.linearise(GaussNewton::default())?;
    let (residuals, _) = collocation.residuals();
    // `h (v − q̇)` with `q̇ = 0` and steps of 0.1 s.
    assert!(residuals.dynamics >= 0.1 * 0.3, "{residuals}");
    Ok(())
}

/// A solver that does not know stages finds the same solution.
#[test]
fn gauss_newton_without_stages() -> Test {
    let record = Record::load("ocp/chain_3.json")?;
    let (mut shooting, mut collocation) = chain!(record, Options { steps: 2, ..Default::default() });
    let (expected, _) = solve(&mut shooting)?;
    let mut sqp = HeapSqp::new(&collocation)?.gauss_newton();
    (sqp.options.tolerance, sqp.qp_solver.options.tolerance) = (1e-11, 1e-12);
    let outcome = sqp.solve(&mut collocation)?;
    assert!(outcome.is_converged() && outcome.iterations <= 15, "{outcome}\n{}", sqp.log());
    let found: Vec<f64> =
        collocation.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()).collect();
    assert_same_solution(&found, &expected);
    Ok(())
}

/// `sinh z = 0.7 c + 0.4 u − 0.3 p`, with `z` in the motion, the cost and a constraint.
#[dae]
fn cart(xdot: [f64; 3], x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 4] {
    [
        xdot[0] - x[1],
        xdot[1] + x[0].sin() * x[2] - z[0] - 0.5 * u[0],
        xdot[2] + 0.1 * x[2],
        z[0].sinh() - 0.7 * x[2] - 0.4 * u[0] + 0.3 * p[0],
    ]
}
#[function]
fn distance(x: [f64; 3], _z: [f64; 1], u: [f64; 1], _p: [f64; 1]) -> [f64; 3] {
    [x[0], x[1], u[0]]
}
#[function]
fn curved(_x: [f64; 3], z: [f64; 1], u: [f64; 1], _p: [f64; 1]) -> f64 {
    (z[0] - 0.2).powi(4) + 0.1 * z[0] * u[0]
}
#[function]
fn power(x: [f64; 3], z: [f64; 1], _u: [f64; 1], p: [f64; 1]) -> f64 {
    x[1] * z[0] + 0.2 * p[0] * z[0]
}

fn cart_problem() -> Result<[Vec<f64>; 2], Failure> {
    let irk = || Irk::<Cart, RadauIIA<3>>::new(Options::default());
    macro_rules! solved {
        ($dynamics:expr) => {{
            let mut ocp = Problem::new($dynamics)
                .stage_cost((
                    LeastSquaresCost::<Distance>::diagonal(&[2.0, 1.0, 0.5]),
                    GeneralCost::<Curved>::new(),
                ))
                .path_constraints(Constraint::<Power>::new([-0.1], [0.05]))
                .on(Horizon::uniform(8, 0.25))?;
            ocp.fix_initial_state(&[0.7, -0.2, 0.9])?.bound("u", .., -1.0, 1.0)?;
            ocp.guess(&[0.7, -0.2, 0.9], &[0.0])?.set_parameters(.., &[0.6])?;
            solve(&mut ocp)?.0
        }};
    }
    Ok([solved!(irk()?), solved!(Collocation::new(irk()?)?)])
}

#[test]
fn algebraic_states_in_costs_and_constraints() -> Test {
    let [shooting, collocation] = cart_problem()?;
    assert_same_solution(&collocation, &shooting);
    Ok(())
}
