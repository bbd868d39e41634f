//! Problems as text, and copies of problems.

use crate::Test;
use casados::ocp::{
    Collocation, Constraint, ConvexCost, GeneralCost, HeapIpm, HeapSqp, Horizon, Huber, LeastSquaresCost,
    Problem, Shooting, WithIntegral,
};
use casados::prelude::*;

#[ode]
fn slider(x: [f64; 2], u: [f64; 2], p: f64) -> [f64; 2] {
    [x[1] + u[1], p * u[0]]
}

#[function]
fn place(x: [f64; 2], _u: [f64; 2], _p: f64) -> f64 {
    x[0]
}

#[function]
fn effort(_x: [f64; 2], u: [f64; 2], _p: f64) -> [f64; 2] {
    u
}

#[function]
fn heat(_x: [f64; 2], u: [f64; 2], _p: f64) -> f64 {
    u[0] * u[0]
}

#[function]
fn corners(x: [f64; 2], _u: [f64; 2], _p: f64) -> [f64; 2] {
    [x[0] + x[1], x[0] - x[1]]
}

#[test]
fn printed_problems() -> Test {
    let infinity = f64::INFINITY;
    let integral = casados::LeastSquares::<Effort>::new(&nalgebra::matrix![1.0, 0.0; 0.0, 1.0]);
    let mut ocp =
        Problem::new(WithIntegral::new(Irk::<Slider, Gauss<2>>::new(Options::default())?, integral))
            .running_cost((
                GeneralCost::<Heat>::new(),
                ConvexCost::<Place, _>::new(Huber { weights: [1.0], delta: [1.0] }),
            ))
            .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[2.0]))
            .path_constraints((
                Constraint::<Corners>::new([-infinity, -1.5], [2.0, infinity]).soft(10.0, 3.0),
                Constraint::<Place>::new([0.0], [4.0]),
            ))
            .on(Horizon::uniform(6, 0.25))?;
    ocp.bound("u[0]", .., -1.0, 2.0)?.soften_upper("u", 2..4, 0.0, 8.0)?;
    for k in 0..6 {
        ocp.bound("x[1]", k + 1..=k + 1, -infinity, 2.0 + k as f64)?;
    }
    ocp.soften_lower("Place", .., 7.0, 0.0)?.set_arrival_cost(&[0.0; 2], &[1.0, 0.0, 0.0, 1.0])?;
    ocp.periodic("x[0]")?.shared("u[1]")?;
    let expected = "\
Slider: 6 intervals, t from 0 to 1.5
  min    Σ ½∫‖Effort‖²_W dt + Σ h Heat + Σ h φ(Place − r) + ½‖Place − r‖²_W + ½‖x₀ − x̄‖²_W
  over   2 states x[0], x[1]; 2 controls u[0], u[1]
  s.t.   x₊ = φ(x, u, p)
         (initial state not said: `fix_initial_state` or `free_initial_state`)
         x[1] ≤ 2 at stage 1
         x[1] ≤ 3 at stage 2
         x[1] ≤ 4 at stage 3
         x[1] ≤ 5 at stage 4
         … and other bounds of x[1] at 2 more stages
         -1 ≤ u[0] ≤ 2 at stages 0..=1
         -1 ≤ u[0] ≤ 2 at stages 2..=3, soft above: ½ 8 e²
         -1 ≤ u[0] ≤ 2 at stages 4..=5
         Corners[0] ≤ 2 at stages 0..=5, soft: 10 e + ½ 3 e²
         Corners[1] ≥ -1.5 at stages 0..=5, soft: 10 e + ½ 3 e²
         0 ≤ Place ≤ 4 at stages 0..=5, soft below: 7 e
         x[0] at stage 0 = x[0] at stage 6
         u[1] the same at all stages
  size   26 variables, 12 equations of dynamics, 42 bounds, 20 of them soft
";
    assert_eq!(ocp.to_string(), expected);
    assert!(format!("{ocp:?}").starts_with("Ocp { model: \"Slider\", intervals: 6, initial: Unknown"));
    let problem = format!("{:?}", ocp.problem());
    for part in ["Irk { model: \"Slider\", options: Options { steps: 1", "outer: Huber { weights: [1.0]"] {
        assert!(problem.contains(part), "{part}: {problem}");
    }
    Ok(())
}

/// A copy is solved as the original is, and neither knows of the other.
#[test]
fn copies_of_problems() -> Test {
    macro_rules! problem {
        ($dynamics:expr) => {{
            let mut ocp = Problem::new($dynamics)
                .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0; 2]))
                .terminal_cost(LeastSquaresCost::<Place>::diagonal(&[10.0]))
                .path_constraints(Constraint::<Corners>::new([-1.0; 2], [0.8; 2]))
                .on(Horizon::uniform(8, 0.25))?;
            ocp.fix_initial_state(&[0.0; 2])?.set_parameters(.., &[1.5])?.set_terminal_reference(&[1.0])?;
            ocp.guess(&[0.0; 2], &[0.0; 2])?;
            ocp
        }};
    }
    macro_rules! check {
        ($dynamics:expr, $solver:ident) => {
            let mut ocp = problem!($dynamics);
            let mut copy = ocp.clone();
            assert!($solver::new(&ocp)?.solve(&mut ocp)?.is_converged());
            assert_eq!(copy.stage(8)?.x, [0.0; 2]);
            let mut other = ocp.clone();
            assert!($solver::new(&copy)?.solve(&mut copy)?.is_converged());
            assert_eq!(copy.solution()?, ocp.solution()?);
            other.set_terminal_reference(&[0.5])?;
            assert!($solver::new(&other)?.solve(&mut other)?.is_converged());
            assert!(other.stage(8)?.x[0] < ocp.stage(8)?.x[0] - 0.1);
            assert_eq!(copy.solution()?, ocp.solution()?);
        };
    }
    let options = Options { steps: 2, ..Default::default() };
    check!(Irk::<Slider, Gauss<2>>::new(options)?, HeapSqp);
    check!(Erk::<Slider, Rk4>::new(options)?, HeapSqp);
    check!(Shooting::new(Batch::<Slider, Gauss<2>>::new(options)?), HeapIpm);
    check!(Collocation::new(Irk::<Slider, Gauss<2>>::new(options)?)?, HeapIpm);
    Ok(())
}

/// A copy of an integrator has its parameters and its time.
#[test]
fn copies_of_integrators() -> Test {
    use nalgebra::vector;
    let (x0, u) = (vector![1.0, 2.0], vector![0.5, 0.1]);
    let mut irk = Irk::<Slider, RadauIIA<2>>::new(Options::default())?;
    irk.set_parameters(&vector![3.0])?;
    let mut copy = irk.clone();
    assert_eq!(copy.forward(&x0, &u, 0.2)?, irk.forward(&x0, &u, 0.2)?);
    irk.set_parameters(&vector![4.0])?;
    assert_ne!(copy.solve(&x0, &u, 0.2)?, irk.solve(&x0, &u, 0.2)?);

    let mut erk = Erk::<Slider, Rk4>::new(Options::default())?;
    assert_eq!(erk.clone().solve(&x0, &u, 0.2).map(|_| ()), Err(casados::Error::ParametersNotSet));
    erk.set_parameters(&vector![3.0])?;
    assert_eq!(erk.clone().forward(&x0, &u, 0.2)?, erk.forward(&x0, &u, 0.2)?);
    Ok(())
}
