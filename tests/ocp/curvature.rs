//! The exact Hessian of the QP is that of the Lagrangian: against differences of its gradient.

use crate::Test;
use casados::ocp::{
    Constraint, Convexification, Exact, Formulation, GeneralCost, HeapOcp, HeapSqp, Horizon,
    LeastSquaresCost, Map, Problem, SecondOrder, Shooting, WithIntegral,
};
use casados::prelude::*;

#[ode]
fn swing(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[1], -x[0].sin() + u[0] * x[0].cos()]
}

#[function]
fn swing_map(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0] + 0.1 * x[1] * u[0], x[1] - 0.1 * x[0].sin() + 0.1 * u[0] * u[0]]
}

#[function]
fn tip(x: [f64; 2], u: [f64; 1]) -> [f64; 3] {
    [x[0].sin(), x[0].cos() * x[1], u[0] * x[1]]
}

#[function]
fn energy(x: [f64; 2], u: [f64; 1]) -> f64 {
    0.5 * x[1] * x[1] - x[0].cos() + (0.5 * u[0]).exp()
}

#[function]
fn product(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0] * u[0], x[1] * x[1] * u[0]]
}

#[function]
fn circle(x: [f64; 2], _u: [f64; 1]) -> f64 {
    x[0] * x[0] + x[1].sin()
}

/// The torque is an algebraic state, nonlinear in everything.
#[dae]
fn motor(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], u: [f64; 1]) -> [f64; 3] {
    [
        xdot[0] - x[1],
        xdot[1] + x[0].sin() - z[0] * x[0].cos(),
        z[0] + 0.5 * z[0].powi(3) - u[0] * x[0].cos() + 0.8 * x[1] * x[1],
    ]
}

#[function]
fn load(x: [f64; 2], z: [f64; 1], u: [f64; 1]) -> [f64; 3] {
    [x[0].sin() + z[0], x[1] * z[0], u[0] * x[1] - z[0] * z[0]]
}

#[function]
fn heat(x: [f64; 2], z: [f64; 1], u: [f64; 1]) -> f64 {
    z[0] * z[0] * (1.0 + x[0] * x[0]) + (u[0] * z[0]).sin()
}

#[function]
fn power(x: [f64; 2], z: [f64; 1], _u: [f64; 1]) -> [f64; 2] {
    [x[1] * z[0], z[0] + x[0]]
}

/// A point with multipliers where nothing is zero.
fn random_iterate<P: Formulation<f64>>(ocp: &mut HeapOcp<P>) -> Test {
    for k in 0..=ocp.intervals() {
        let wave = |i: usize| ((3 * k + i + 1) as f64).sin();
        let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
        stage.x.iter_mut().enumerate().for_each(|(i, x)| *x = wave(i));
        stage.u.iter_mut().for_each(|u| *u = wave(5));
        stage.dynamics.iter_mut().enumerate().for_each(|(i, pi)| *pi = wave(7 + i));
        stage.g_upper.iter_mut().enumerate().for_each(|(i, g)| *g = 1.0 + wave(11 + i));
    }
    Ok(())
}

/// The gradient of the Lagrangian with respect to `(x, u)` of a stage, from the first derivatives
/// of the QP.
fn gradient<P: Formulation<f64>>(
    ocp: &mut HeapOcp<P>,
    k: usize,
) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
    ocp.linearise(casados::ocp::GaussNewton { convexification: Convexification::None })?;
    let (qp, iterate) = (ocp.qp().stage(k).ok_or("no stage")?, ocp.stage(k)?);
    let (nx, nu) = (iterate.x.len(), iterate.u.len());
    let element = |block: casados::qp::Block<'_, f64>, i, j| block.get(i, j).unwrap_or(0.0);
    let hessian = |i: usize, j: usize| {
        let (i, j) = (i.max(j), i.min(j));
        match (i.checked_sub(nx), j.checked_sub(nx)) {
            (None, _) => element(qp.q(), i, j),
            (Some(i), None) => element(qp.s(), i, j),
            (Some(i), Some(j)) => element(qp.r(), i, j),
        }
    };
    let v: Vec<f64> = iterate.x.iter().chain(iterate.u).copied().collect();
    let linear: Vec<f64> = qp.gradient_x().iter().chain(qp.gradient_u()).copied().collect();
    Ok((0..nx + nu)
        .map(|j| {
            let quadratic: f64 = (0..nx + nu).map(|i| hessian(i, j) * v[i]).sum();
            let column = |state: casados::qp::Block<'_, f64>, control: casados::qp::Block<'_, f64>, i| {
                if j < nx { element(state, i, j) } else { element(control, i, j - nx) }
            };
            let dynamics: f64 =
                iterate.dynamics.iter().enumerate().map(|(i, pi)| column(qp.a(), qp.b(), i) * pi).sum();
            let general: f64 =
                iterate.g_upper.iter().enumerate().map(|(i, g)| column(qp.c(), qp.d(), i) * g).sum();
            linear[j] + quadratic + dynamics + general
        })
        .collect())
}

fn check<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(ocp: &mut HeapOcp<P>) -> Test {
    ocp.free_initial_state();
    random_iterate(ocp)?;
    ocp.linearise(Exact { convexification: Convexification::None })?;
    let n = ocp.intervals();
    for k in [0, 1, n] {
        ocp.linearise(Exact { convexification: Convexification::None })?;
        let qp = ocp.qp().stage(k).ok_or("no stage")?;
        let nx = qp.dims().nx;
        let size = nx + qp.dims().nu;
        let mut hessian = vec![0.0; size * size];
        for (i, row) in hessian.chunks_exact_mut(size).enumerate() {
            for (j, element) in row.iter_mut().enumerate().take(i + 1) {
                let value = match (i.checked_sub(nx), j.checked_sub(nx)) {
                    (None, _) => qp.q().get(i, j),
                    (Some(i), None) => qp.s().get(i, j),
                    (Some(i), Some(j)) => qp.r().get(i, j),
                };
                *element = value.ok_or("no element")?;
            }
        }
        // Of order eight.
        let (step, weights) = (5e-3, [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0]);
        for j in 0..size {
            let stage = ocp.stage(k)?;
            let here = if j < nx { stage.x[j] } else { stage.u[j - nx] };
            let mut at = |change: f64| {
                let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
                *(if j < nx { &mut stage.x[j] } else { &mut stage.u[j - nx] }) = here + change;
                gradient(ocp, k)
            };
            let mut differences = vec![0.0; size];
            for (i, weight) in weights.into_iter().enumerate() {
                let change = (i + 1) as f64 * step;
                for (sum, (plus, minus)) in
                    differences.iter_mut().zip(at(change)?.into_iter().zip(at(-change)?))
                {
                    *sum += weight / step * (plus - minus);
                }
            }
            at(0.0)?;
            for i in j..size {
                let (difference, exact) = (differences[i], hessian[i * size + j]);
                // Gradients are sums of some dozen products of order ten, and the weights add up to
                // 420. What order eight leaves is 256 times smaller than with twice the step, where
                // it was 3e-11.
                assert!((difference - exact).abs() < 420.0 * 1e-14, "{k} {i} {j}: {difference} {exact}");
            }
        }
    }
    Ok(())
}

#[test]
fn hessians_of_the_lagrangian() -> Test {
    let bounds = || Constraint::<Product>::new([-1.0; 2], [1.0; 2]);
    let end = || Constraint::<Circle>::new([-1.0], [1.0]);
    let weights = nalgebra::matrix![1.0, 0.2, 0.1; 0.2, 2.0, 0.3; 0.1, 0.3, 3.0];
    let cost = || (LeastSquaresCost::<Tip>::new(&weights), GeneralCost::<Energy>::new());
    let mut ocp = Problem::new(Irk::<Swing, Gauss<2>>::new(Options::default())?)
        .running_cost(cost())
        .terminal_cost(GeneralCost::<Circle>::new())
        .path_constraints(bounds())
        .terminal_constraints(end())
        .on(Horizon::uniform(3, 0.1))?;
    check(&mut ocp)?;
    let mut ocp = Problem::new(Erk::<Swing, Rk4>::new(Options::default())?)
        .stage_cost(cost())
        .path_constraints((bounds(), bounds()))
        .on(Horizon::uniform(3, 0.1))?;
    check(&mut ocp)?;
    let mut ocp =
        Problem::new(Map::<SwingMap, f64>::new()).stage_cost(cost()).on(Horizon::uniform(3, 0.1))?;
    check(&mut ocp)?;
    let irk = Irk::<Swing, RadauIIA<2>>::new(Options::default())?;
    let mut ocp =
        Problem::new(WithIntegral::new(irk, Quadrature::<Energy>::new())).on(Horizon::uniform(3, 0.1))?;
    check(&mut ocp)?;
    let irk = Irk::<Swing, RadauIIA<2>>::new(Options::default())?;
    let mut ocp = Problem::new(WithIntegral::new(irk, LeastSquares::<Tip>::new(&weights)))
        .on(Horizon::uniform(3, 0.1))?;
    check(&mut ocp)
}

/// With algebraic states in costs and constraints, whose second derivatives come from the
/// integrator.
#[test]
fn hessians_with_algebraic_states() -> Test {
    let weights = nalgebra::matrix![1.0, 0.2, 0.1; 0.2, 2.0, 0.3; 0.1, 0.3, 3.0];
    macro_rules! check {
        ($dynamics:expr) => {{
            let cost = (LeastSquaresCost::<Load>::new(&weights), GeneralCost::<Heat>::new());
            let constraint = Constraint::<Power>::new([-1.0; 2], [1.0; 2]);
            let problem = Problem::new($dynamics).path_constraints(constraint);
            check(&mut problem.running_cost(cost).on(Horizon::uniform(6, 0.2))?)?
        }};
    }
    let options = |steps: usize| Options { steps, ..Options::default() };
    check!(Irk::<Motor, Gauss<2>>::new(options(3))?);
    check!(Irk::<Motor, RadauIIA<2>>::new(options(1))?);
    check!(Shooting::new(Batch::<Motor, Gauss<2>>::new(options(1))?));
    check!(Shooting::new(Batch::<Motor, RadauIIA<3>>::new(options(3))?));
    check!(WithIntegral::new(Irk::<Motor, Gauss<2>>::new(options(2))?, Quadrature::<Heat>::new()));
    // A cost alone, a constraint alone.
    let irk = || Irk::<Motor, Gauss<2>>::new(options(1));
    let problem = Problem::new(irk()?).stage_cost(GeneralCost::<Heat>::new());
    check(&mut problem.on(Horizon::uniform(3, 0.2))?)?;
    let problem = Problem::new(irk()?).path_constraints(Constraint::<Power>::new([-1.0; 2], [1.0; 2]));
    check(&mut problem.on(Horizon::uniform(3, 0.2))?)
}

/// Swinging up from below by exact Hessians with line searches: where full steps of Gauss and
/// Newton would be far off.
#[test]
fn swing_up() -> Test {
    use casados::ocp::Globalisation;
    for globalisation in [Globalisation::Merit, Globalisation::Filter] {
        let mut ocp = Problem::new(Irk::<Swing, Gauss<2>>::new(Options::default())?)
            .running_cost(GeneralCost::<Energy>::new())
            .on(Horizon::uniform(30, 0.1))?;
        ocp.fix_initial_state(&[0.0, 0.0])?.bound("u", .., -2.0, 2.0)?;
        ocp.bound("x[0]", 30..=30, 1.0, 1.0)?.guess(&[0.5, 0.0], &[0.0])?;
        let mut sqp = HeapSqp::new(&ocp)?;
        sqp.options.globalisation = globalisation;
        let outcome = sqp.solve(&mut ocp)?;
        println!("{}{outcome}", sqp.log());
        assert!(outcome.is_converged());
        assert!((ocp.stage(30)?.x[0] - 1.0).abs() < 1e-6);
    }
    Ok(())
}
