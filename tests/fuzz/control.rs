//! Problems of optimal control with any bounds, guesses and options: the nonlinear interior point
//! and sequential quadratic programming, by shooting and by collocation, and of a model whose index
//! was reduced.

use super::source::Source;
use super::*;
use casados::ocp::{
    Barrier, Collocation, GeneralCost, Globalisation, HeapIpm, HeapSqp, Horizon, LeastSquaresCost, OcpError,
    Outcome, Problem, Status,
};
use casados::prelude::*;

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}
#[function]
fn effort(x: [f64; 2], u: f64) -> [f64; 3] {
    [x[0], 0.3 * x[1], 0.3 * u]
}
#[function]
fn economy(x: [f64; 2], u: f64) -> f64 {
    u * u + (x[0] - 1.0).cos()
}

/// A bead on a circle that is pushed: the index is reduced.
#[dae(index_reduction, nominal(x = [0.0, -1.0, 0.0, 0.0], z = 9.81))]
fn bead(xdot: [f64; 4], x: [f64; 4], z: f64, u: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z * x[0] - u,
        xdot[3] + z * x[1] + 9.81,
        x[0] * x[0] + x[1] * x[1] - 1.0,
    ]
}

/// A run of a random problem with these dynamics and costs, and whether its iterate is finite.
macro_rules! run {
    ($problem:expr, $source:expr) => {{
        let source: &mut Source = $source;
        let solve = || -> Result<(Outcome, bool), OcpError> {
            let intervals = [3, 5, 1, 4, 0][source.below(5)];
            let horizon = Horizon::uniform(intervals, [0.1, 0.2, source.number()][source.below(3)]);
            let mut ocp = $problem.on(horizon)?;
            let (x0, guess) = ([source.number(), source.number()], [source.number(), source.number()]);
            ocp.fix_initial_state(&x0)?.guess(&guess, &[source.number()])?;
            for name in ["u", "x[0]", "x[1]"] {
                if source.below(3) == 0 {
                    let (a, b) = (source.number(), source.number());
                    ocp.bound(name, [0, 1, 2][source.below(3)].., a.min(b), a.max(b))?;
                    if source.below(3) == 0 {
                        ocp.soften(name, 2.., source.number(), source.number())?;
                    }
                }
            }
            let outcome = if source.below(2) == 0 {
                let mut ipm = HeapIpm::new(&ocp)?;
                ipm.options.max_iterations = [60, 60, 3, 0][source.below(4)];
                ipm.options.barrier = [Barrier::Adaptive, Barrier::Monotone][source.below(2)];
                if source.below(4) == 0 {
                    (ipm.options.start_mu, ipm.options.elastic_penalty) = (source.number(), source.number());
                }
                ipm.solve(&mut ocp)?
            } else {
                let mut sqp = HeapSqp::new(&ocp)?;
                sqp.options.max_iterations = [60, 60, 3, 0][source.below(4)];
                sqp.options.globalisation = [Globalisation::Filter, Globalisation::Merit][source.below(2)];
                sqp.options.elastic = source.below(4) > 0;
                if source.below(4) == 0 {
                    sqp.options.tolerance = source.number();
                }
                sqp.solve(&mut ocp)?
            };
            let finite =
                ocp.iterate().stages().all(|stage| stage.x.iter().chain(stage.u).all(|v| v.is_finite()));
            let text = outcome.to_string();
            assert!(!text.is_empty());
            Ok((outcome, finite))
        };
        solve()
    }};
}

#[test]
fn random_problems() {
    let mut counts = Counts::new("problems of optimal control");
    for seed in seeds(200) {
        let mut source = Source::new(seed);
        let cost = || LeastSquaresCost::<Effort>::diagonal(&[1.0; 3]);
        let irk = || Irk::<Pendulum, Gauss<2>>::new(Options::default());
        let found = match source.below(2) {
            0 => irk().map_err(OcpError::from).and_then(|irk| {
                run!(Problem::new(irk).running_cost(GeneralCost::<Economy>::new()), &mut source)
            }),
            _ => irk()
                .and_then(Collocation::new)
                .map_err(OcpError::from)
                .and_then(|collocation| run!(Problem::new(collocation).running_cost(cost()), &mut source)),
        };
        if let Ok((outcome, finite)) = &found {
            let verdict = matches!(outcome.status, Status::Converged | Status::Acceptable);
            let numbers = outcome.objective.is_finite() && outcome.residuals.largest().is_finite();
            assert!(!verdict || numbers && *finite, "seed {seed}: {outcome}");
            // Costs are not less than −1.
            assert!(outcome.status != Status::Unbounded, "seed {seed}: {outcome}");
        }
        match found {
            Ok((Outcome { status: Status::Converged | Status::Acceptable, .. }, _)) => counts.count("Ok"),
            Ok((outcome, _)) => {
                if prints_verdicts() {
                    println!("seed {seed}: {outcome}");
                }
                let text = format!("{:?}", outcome.status);
                counts.count(text.split([' ', '(', '{']).next().unwrap_or_default());
            }
            Err(error) => counts.count_result::<(), _>(&Err(error)),
        }
    }
    enough(&counts, 15);
}

/// A reduced model from any start and by any options: also where `x` is on no circle.
#[test]
fn index_reduced_models() {
    let mut counts = Counts::new("reduced index");
    for seed in seeds(INTEGRATORS) {
        let mut source = Source::new(seed);
        let Ok(mut irk) = Irk::<Bead, RadauIIA<2>>::new(source.options()) else { continue };
        for _ in 0..CALLS {
            let (x0, u, lambda) = (source.vector(), source.vector(), source.vector());
            let x0 = if source.below(2) == 0 { x0 } else { nalgebra::vector![0.6, -0.8, 0.0, 0.0] };
            let h = source.length();
            let found = match source.below(4) {
                0 => irk.solve(&x0, &u, h).map(|result| nominal!(result)),
                1 => irk.forward(&x0, &u, h).map(|result| numbers!(result; x z dx_dx0 dx_du)),
                2 => irk.adjoint(&x0, &u, h, &lambda).map(|result| numbers!(result; x grad_x0 grad_u)),
                _ => irk.hessian(&x0, &u, h, &lambda).map(|result| numbers!(result; h_xx h_xu h_uu)),
            };
            judge(&mut counts, seed, &found, None);
        }
    }
    enough(&counts, 50);
}
