//! Algebraic states in costs and constraints at nodes.

use crate::Test;
use casados::ocp::{
    Constraint, Convexification, Dynamics, Exact, GaussNewton, GeneralCost, HeapOcp, HeapSqp, Horizon,
    LeastSquaresCost, Map, Names, Nodes, OcpError, Problem, SecondOrder, Sensitivities, Shooting, Sink,
};
use casados::prelude::*;
use casados::qp::QpView;

/// `sinh z = 0.7 c + 0.4 u − 0.3 p + 0.5 c u p` with a state `c` that does not change: the
/// polynomial of the stages is exact at the start.
mod implicit {
    use casados::prelude::*;

    #[dae]
    pub fn cart(xdot: [f64; 3], x: [f64; 3], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 4] {
        [
            xdot[0] - x[1],
            xdot[1] + x[0].sin() * x[2] - z[0] - 0.5 * u[0],
            xdot[2],
            z[0].sinh() - 0.7 * x[2] - 0.4 * u[0] + 0.3 * p[0] - 0.5 * x[2] * u[0] * p[0],
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
        let z = (0.7 * x[2] + 0.4 * u[0] - 0.3 * p[0] + 0.5 * x[2] * u[0] * p[0]).asinh();
        [x[1], -x[0].sin() * x[2] + z + 0.5 * u[0], 0.0]
    }
    #[function]
    pub fn tracking(x: [f64; 3], u: [f64; 1], p: [f64; 1]) -> [f64; 3] {
        let z = (0.7 * x[2] + 0.4 * u[0] - 0.3 * p[0] + 0.5 * x[2] * u[0] * p[0]).asinh();
        [x[0] - 0.2 * z, z * z + 0.1 * p[0], 0.5 * u[0] + z * x[1]]
    }
    #[function]
    pub fn power(x: [f64; 3], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
        let z = (0.7 * x[2] + 0.4 * u[0] - 0.3 * p[0] + 0.5 * x[2] * u[0] * p[0]).asinh();
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

/// To rounding: all derivatives of `z`, second ones in exact Hessians too, are those that are
/// written down in the other problem.
#[test]
fn quadratic_programs_with_algebraic_states() -> Test {
    let exact = Exact { convexification: Convexification::None };
    let gauss_newton = GaussNewton::default();
    let batch = || Batch::<implicit::Cart, Gauss<2>>::new(Options::default());
    let pairs = [
        (
            at_a_point!(ocp!(implicit, implicit_irk()?), gauss_newton),
            at_a_point!(ocp!(explicit, explicit_irk()?), gauss_newton),
        ),
        (
            at_a_point!(ocp!(implicit, Shooting::new(batch()?)), gauss_newton),
            at_a_point!(ocp!(explicit, explicit_irk()?), gauss_newton),
        ),
        (
            at_a_point!(ocp!(implicit, implicit_irk()?), exact),
            at_a_point!(ocp!(explicit, explicit_irk()?), exact),
        ),
        (
            at_a_point!(ocp!(implicit, Shooting::new(batch()?)), exact),
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

/// The same solution, by line search too, with a constraint on `z` that is active, and the same
/// derivatives of it.
#[test]
fn solutions_with_algebraic_states() -> Test {
    macro_rules! solved {
        ($ocp:expr) => {{
            let mut ocp = $ocp;
            let mut sqp = HeapSqp::new(&ocp)?;
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
            // Two solutions to 1e-10 with multipliers of at least 1e-3; active bounds are springs
            // of 1e8.
            assert!((a - b).abs() < 1e-5, "{k}: {a} {b}");
        }
    }
    assert!(derivatives.dx_dp(N).iter().any(|value| value.abs() > 1e-3));
    Ok(())
}

/// Counts simulations, and second-order passes that are given weights.
struct Counted<I> {
    inner: I,
    simulations: usize,
    weighted: [usize; 2],
}
impl<I: Dynamics<f64>> Dynamics<f64> for Counted<I> {
    type Shape = I::Shape;
    const NAMES: Names = I::NAMES;
    const ALGEBRAIC: bool = I::ALGEBRAIC;
    fn simulate(&mut self, nodes: &Nodes<'_, f64>, sink: Sink<'_, f64>) -> Result<(), OcpError> {
        self.simulations += 1;
        self.inner.simulate(nodes, sink)
    }
    fn linearise(&mut self, nodes: &Nodes<'_, f64>, sink: Sink<'_, f64>) -> Result<(), OcpError> {
        self.inner.linearise(nodes, sink)
    }
}
impl<I: SecondOrder<f64>> SecondOrder<f64> for Counted<I> {
    fn second_order(&mut self, nodes: &Nodes<'_, f64>, sink: Sink<'_, f64>) -> Result<(), OcpError> {
        for interval in nodes.iter() {
            self.weighted[usize::from(!interval.nu.is_empty())] += 1;
        }
        self.inner.second_order(nodes, sink)
    }
}

#[function]
fn speed(x: [f64; 3], _z: [f64; 1], u: [f64; 1], _p: [f64; 1]) -> f64 {
    x[1] * x[1] + u[0] * u[0]
}

/// Nothing more is simulated where nothing depends on algebraic states, or where Hessians are not
/// exact.
#[test]
fn evaluations_of_unused_algebraic_states() -> Test {
    macro_rules! count {
        ($cost:ty, $constraint:ty, $curvature:expr) => {{
            let dynamics = Counted { inner: implicit_irk()?, simulations: 0, weighted: [0; 2] };
            let mut ocp = Problem::new(dynamics)
                .stage_cost(GeneralCost::<$cost>::new())
                .path_constraints(Constraint::<$constraint>::new(Default::default(), Default::default()))
                .on(Horizon::uniform(N, 0.25))?;
            ocp.fix_initial_state(&X0)?.guess(&X0, &[0.0])?.set_parameters(.., &[0.6])?;
            ocp.linearise($curvature)?;
            (ocp.problem().dynamics.simulations, ocp.problem().dynamics.weighted)
        }};
    }
    assert_eq!(count!(Speed, Speed, Exact::default()), (0, [N, 0]));
    assert_eq!(count!(implicit::Tracking, Speed, Exact::default()), (1, [0, N]));
    assert_eq!(count!(Speed, implicit::Power, Exact::default()), (1, [0, N]));
    assert_eq!(count!(implicit::Tracking, implicit::Power, GaussNewton::default()), (0, [0, 0]));
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
fn problems_without_algebraic_states() -> Test {
    let problem = Problem::new(Map::<Next, f64>::new())
        .path_constraints(Constraint::<Hidden>::new([0.0], [1.0]))
        .on(Horizon::uniform(3, 0.1));
    let Err(error) = problem.map(|_: HeapOcp<_, f64>| ()) else { return Err("no error".into()) };
    assert_eq!(
        error.to_string(),
        "`Hidden` depends on `z[0]`, which does not exist at the nodes: maps have no algebraic states"
    );
    let problem = Problem::new(implicit_irk()?)
        .terminal_constraints(Constraint::<Last>::new([0.0], [1.0]))
        .on(Horizon::uniform(3, 0.1));
    assert!(matches!(problem.map(|_: HeapOcp<_, f64>| ()), Err(OcpError::NotThere { terminal: true, .. })));
    Ok(())
}

/// A motor whose torque is an algebraic state, nonlinear in everything, with friction as a
/// parameter; at the start of an interval it is what the polynomial of the stages continues to.
#[dae]
fn motor(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 3] {
    [
        xdot[0] - x[1],
        xdot[1] + x[0].sin() - z[0] * x[0].cos(),
        z[0] + 0.5 * z[0].powi(3) - u[0] * (1.0 + 0.5 * x[0] * x[0]) + p[0] * x[1] * x[1],
    ]
}
#[function]
fn task(x: [f64; 2], z: [f64; 1], u: [f64; 1], p: [f64; 1]) -> [f64; 4] {
    [x[0] - 1.0, 0.4 * x[1], z[0] - p[0], 0.1 * u[0]]
}
#[function]
fn heat(x: [f64; 2], z: [f64; 1], _u: [f64; 1], _p: [f64; 1]) -> f64 {
    z[0] + 0.5 * x[1] * z[0]
}

macro_rules! motor_problem {
    ($dynamics:expr) => {{
        let mut ocp = Problem::new($dynamics)
            .stage_cost(LeastSquaresCost::<Task>::diagonal(&[1.0, 1.0, 2.0, 1.0]))
            .path_constraints(Constraint::<Heat>::new([f64::NEG_INFINITY], [1.2]))
            .on(Horizon::uniform(N, 0.2))?;
        ocp.fix_initial_state(&MOTOR_X0)?.guess(&MOTOR_X0, &[0.0])?.set_parameters(.., &[MOTOR_P])?;
        let mut sqp = HeapSqp::new(&ocp)?;
        (sqp.options.tolerance, sqp.options.qp_accuracy) = (1e-11, 0.0);
        sqp.qp_solver.options.tolerance = 1e-13;
        (ocp, sqp)
    }};
}
const MOTOR_X0: [f64; 2] = [-0.6, 0.3];
const MOTOR_P: f64 = 0.8;

/// With second derivatives of everything, full steps are those of Newton's method: `r₊ ≤ C r²` of
/// the largest residuals. Linear convergence has a quotient that grows without bound. What is below
/// is rounding.
macro_rules! quadratic {
    ($problem:expr) => {{
        let (mut ocp, mut sqp) = $problem;
        let outcome = sqp.solve(&mut ocp)?;
        assert!(outcome.is_converged(), "{}{outcome}", sqp.log());
        let all: Vec<f64> = sqp.log().0.iter().map(|row| row.residuals.largest()).collect();
        let near: Vec<f64> = all.into_iter().skip_while(|&r| r > 0.1).collect();
        let [first, second, ..] = near[..] else { return Err("no iterations".into()) };
        let constant = second / (first * first);
        assert!(near.len() >= 4, "{near:?}");
        for pair in near.windows(2).skip(1) {
            assert!(pair[1] < 2.0 * constant * pair[0] * pair[0] + 1e-14, "{near:?}");
        }
        let active = ocp.iterate().stages().filter(|stage| stage.g_upper.iter().any(|&mu| mu > 1e-2)).count();
        assert!((1..N).contains(&active), "{active}");
    }};
}

#[test]
fn quadratic_convergence() -> Test {
    let batch = Batch::<Motor, RadauIIA<2>>::new(Options { steps: 3, ..Options::default() })?;
    quadratic!(motor_problem!(Irk::<Motor, Gauss<2>>::new(Options::default())?));
    quadratic!(motor_problem!(Shooting::new(batch)));
    Ok(())
}

/// Against differences of order eight of problems that are solved again.
#[test]
fn derivatives_of_solutions() -> Test {
    let (mut ocp, mut sqp) = motor_problem!(Irk::<Motor, Gauss<2>>::new(Options::default())?);
    assert!(sqp.solve(&mut ocp)?.is_converged());
    let mut result = Sensitivities::new(&ocp)?;
    ocp.differentiate(Exact { convexification: Convexification::None }, &mut result)?;
    let (step, weights) = (2e-3, [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0]);
    for direction in 0..3 {
        let mut solve = |change: f64| -> Result<Vec<f64>, Box<dyn std::error::Error>> {
            let (mut x0, mut p) = (MOTOR_X0, MOTOR_P);
            *(if direction < 2 { &mut x0[direction] } else { &mut p }) += change;
            ocp.fix_initial_state(&x0)?.set_parameters(.., &[p])?;
            assert!(sqp.solve(&mut ocp)?.is_converged());
            Ok(ocp.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()).collect())
        };
        let mut differences = vec![0.0; 3 * N + 2];
        for (i, weight) in weights.into_iter().enumerate() {
            let change = (i + 1) as f64 * step;
            let sides = solve(change)?.into_iter().zip(solve(-change)?);
            differences
                .iter_mut()
                .zip(sides)
                .for_each(|(sum, (plus, minus))| *sum += weight / step * (plus - minus));
        }
        for (k, differences) in differences.chunks(3).enumerate() {
            let (x, u) = if direction < 2 {
                (&result.dx(k)[2 * direction..][..2], result.du(k).get(direction..))
            } else {
                (&result.dx_dp(k)[..2], Some(result.du_dp(k)))
            };
            for (found, expected) in x.iter().chain(u.unwrap_or_default().first()).zip(differences) {
                assert!((found - expected).abs() < 1e-7, "{direction} {k}: {found} {expected}");
            }
        }
    }
    Ok(())
}
