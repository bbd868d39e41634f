//! Algebraic states in costs and constraints at nodes.

use crate::Test;
use casados::ocp::{
    Constraint, Convexification, Exact, GaussNewton, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map,
    OcpError, Problem, Sensitivities, Shooting,
};
use casados::prelude::*;
use casados::qp::QpView;

/// `z = 0.7 c + 0.4 u − 0.3 p` with a state `c` that does not change: the polynomial of the stages is exact at the start.
mod implicit {
    use casados::prelude::*;

    #[dae]
    pub fn cart(xdot: [f64; 3], x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 4] {
        [
            xdot[0] - x[1],
            xdot[1] + x[0].sin() * x[2] - z[0] - 0.5 * u[0],
            xdot[2],
            z[0] - 0.7 * x[2] - 0.4 * u[0] + 0.3 * p[0],
        ]
    }
    #[function]
    pub fn tracking(x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 3] {
        [x[0] - 0.2 * z[0], z[0] * z[0] + 0.1 * p[0], 0.5 * u[0] + z[0] * x[1]]
    }
    #[function]
    pub fn power(x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
        [x[1] * z[0] + 0.2 * p[0] * z[0], u[0] + z[0] * z[0]]
    }
}

/// The same without `z`.
mod explicit {
    use casados::prelude::*;

    #[ode]
    pub fn cart(x: [f64; 3], u: [f64; 1], p: [f64; 1]) -> [f64; 3] {
        let z = 0.7 * x[2] + 0.4 * u[0] - 0.3 * p[0];
        [x[1], -x[0].sin() * x[2] + z + 0.5 * u[0], 0.0]
    }
    #[function]
    pub fn tracking(x: [f64; 3], u: [f64; 1], p: [f64; 1]) -> [f64; 3] {
        let z = 0.7 * x[2] + 0.4 * u[0] - 0.3 * p[0];
        [x[0] - 0.2 * z, z * z + 0.1 * p[0], 0.5 * u[0] + z * x[1]]
    }
    #[function]
    pub fn power(x: [f64; 3], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
        let z = 0.7 * x[2] + 0.4 * u[0] - 0.3 * p[0];
        [x[1] * z + 0.2 * p[0] * z, u[0] + z * z]
    }
}

const N: usize = 8;
const X0: [f64; 3] = [0.7, -0.2, 0.9];

macro_rules! ocp {
    ($module:ident, $dynamics:expr) => {{
        let mut ocp = Problem::new($dynamics)
            .running_cost(LeastSquaresCost::<$module::Tracking>::new(&nalgebra::matrix![
                2.0, 0.3, 0.0; 0.3, 1.0, -0.2; 0.0, -0.2, 0.5
            ]))
            .path_constraints(Constraint::<$module::Power>::new([-0.1, -0.3], [0.05, 0.4]))
            .on(Horizon::uniform(N, 0.25))?;
        ocp.fix_initial_state(&X0)?.bound("u", .., -1.0, 1.0)?.guess(&X0, &[0.0])?;
        ocp.set_parameters(.., &[0.6])?;
        ocp
    }};
}

fn implicit_irk() -> Result<Irk<implicit::Cart, Gauss<2>>, casados::Error> {
    Irk::<implicit::Cart, Gauss<2>>::new(Options::default())
}
fn explicit_irk() -> Result<Irk<explicit::Cart, Gauss<2>>, casados::Error> {
    Irk::<explicit::Cart, Gauss<2>>::new(Options::default())
}

/// All that a QP is made of.
fn data(qp: QpView<'_, f64>) -> Vec<f64> {
    let mut all = Vec::new();
    for stage in qp.stages() {
        // Of symmetric blocks the lower triangle is read.
        let blocks = [stage.a(), stage.b(), stage.c(), stage.d(), stage.s()].map(|block| (block, false));
        for (block, symmetric) in blocks.into_iter().chain([(stage.q(), true), (stage.r(), true)]) {
            let (rows, columns) = block.shape();
            for i in 0..rows {
                all.extend((0..columns).filter(|&j| !symmetric || j <= i).filter_map(|j| block.get(i, j)));
            }
        }
        all.extend([stage.offset(), stage.gradient_x(), stage.gradient_u()].concat());
        all.extend([stage.g_bounds().lower, stage.g_bounds().upper].concat());
    }
    all
}

/// The QP at a point where nothing is zero.
macro_rules! at_a_point {
    ($ocp:expr, $curvature:expr) => {{
        let mut ocp = $ocp;
        for k in 0..=N {
            let wave = |i: usize| (1.7 * i as f64 + 0.6 * k as f64).sin();
            let Some(stage) = ocp.iterate_mut().stage_mut(k) else { break };
            for (place, vector) in [stage.x, stage.u, stage.dynamics, stage.g_upper].into_iter().enumerate() {
                for (i, value) in vector.iter_mut().enumerate() {
                    *value = wave(3 * place + i);
                }
            }
        }
        ocp.linearise($curvature)?;
        data(ocp.qp())
    }};
}

/// To rounding: all derivatives of `z` are those that are written down in the other problem, whose second ones are zero.
#[test]
fn the_same_quadratic_programs() -> Test {
    let exact = Exact { convexification: Convexification::None };
    let gauss_newton = GaussNewton::default();
    let batch = Batch::<implicit::Cart, Gauss<2>>::new(Options::default())?;
    let pairs = [
        (
            at_a_point!(ocp!(implicit, implicit_irk()?), gauss_newton),
            at_a_point!(ocp!(explicit, explicit_irk()?), gauss_newton),
        ),
        (
            at_a_point!(ocp!(implicit, Shooting::new(batch)), gauss_newton),
            at_a_point!(ocp!(explicit, explicit_irk()?), gauss_newton),
        ),
        (
            at_a_point!(ocp!(implicit, implicit_irk()?), exact),
            at_a_point!(ocp!(explicit, explicit_irk()?), exact),
        ),
    ];
    for (with, without) in pairs {
        assert_eq!(with.len(), without.len());
        let count =
            with.iter().zip(&without).filter(|(a, b)| a.is_finite() && **a != 0.0 && **b != 0.0).count();
        assert!(count > 200, "{count}");
        for (a, b) in with.iter().zip(&without) {
            // Sums of some dozen products of order one.
            assert!(a == b || (a - b).abs() < 1e-13, "{a} {b}");
        }
    }
    Ok(())
}

/// The same solution, by line search too, with a constraint on `z` that is active, and the same derivatives of it.
#[test]
fn the_same_solutions() -> Test {
    macro_rules! solved {
        ($ocp:expr) => {{
            let mut ocp = $ocp;
            let mut sqp = HeapSqp::new(&ocp)?.exact(Exact::default());
            sqp.options.globalisation = casados::ocp::Globalisation::Merit;
            (sqp.options.tolerance, sqp.options.max_iterations) = (1e-10, 60);
            sqp.qp_solver.options.tolerance = 1e-12;
            let outcome = sqp.solve(&mut ocp)?;
            assert!(outcome.is_converged(), "{}{outcome}", sqp.log());
            let mut derivatives = Sensitivities::new(&ocp)?;
            ocp.differentiate(Exact { convexification: Convexification::None }, &mut derivatives)?;
            let stages: Vec<_> =
                ocp.iterate().stages().map(|s| [s.x, s.u, s.g_lower, s.g_upper].concat()).collect();
            (stages, derivatives)
        }};
    }
    let (with, derivatives) = solved!(ocp!(implicit, implicit_irk()?));
    let (without, others) = solved!(ocp!(explicit, explicit_irk()?));
    let active =
        with.iter().filter(|stage| stage.iter().skip(4).any(|&multiplier| multiplier > 1e-3)).count();
    assert!((1..N).contains(&active), "{active}");
    for (k, (a, b)) in with.iter().zip(&without).enumerate() {
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-8, "{k}: {a} {b}");
        }
        let parts = [
            (derivatives.dx(k), others.dx(k)),
            (derivatives.du(k), others.du(k)),
            (derivatives.dx_dp(k), others.dx_dp(k)),
            (derivatives.du_dp(k), others.du_dp(k)),
        ];
        for (a, b) in parts.into_iter().flat_map(|(a, b)| a.iter().zip(b)) {
            // Two solutions to 1e-10 with multipliers of at least 1e-3; active bounds are springs of 1e8.
            assert!((a - b).abs() < 1e-5, "{k}: {a} {b}");
        }
    }
    assert!(derivatives.dx_dp(N).iter().any(|value| value.abs() > 1e-3));
    Ok(())
}

#[function]
fn next(x: [f64; 1], _z: [f64; 1], u: [f64; 1]) -> [f64; 1] {
    [x[0] + u[0]]
}
#[function]
fn hidden(_x: [f64; 1], z: [f64; 1], _u: [f64; 1]) -> f64 {
    z[0]
}
#[function]
fn last(_x: [f64; 3], z: [f64; 1], _u: [f64; 1], _p: [f64; 1]) -> f64 {
    z[0]
}

/// A map has none, and nothing has any at the end of the horizon.
#[test]
fn where_there_are_none() -> Test {
    let problem = Problem::new(Map::<Next, f64>::new())
        .path_constraints(Constraint::<Hidden>::new([0.0], [1.0]))
        .on(Horizon::uniform(3, 0.1));
    let Err(error) = problem.map(|_: HeapOcp<_, f64>| ()) else { return Err("no error".into()) };
    assert_eq!(error.to_string(), "`Hidden` depends on `z[0]`, which does not exist at the nodes");
    let problem = Problem::new(implicit_irk()?)
        .terminal_constraints(Constraint::<Last>::new([0.0], [1.0]))
        .on(Horizon::uniform(3, 0.1));
    assert!(matches!(problem.map(|_: HeapOcp<_, f64>| ()), Err(OcpError::NotThere { terminal: true, .. })));
    Ok(())
}
