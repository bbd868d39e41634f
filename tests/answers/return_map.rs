//! Orbits that are periodic up to a map: half of a symmetric period beside the whole of it, and a
//! map beside dynamics that contain it.

use crate::Test;
use crate::solution_derivatives::EXACT;
use casados::ocp::{
    Formulation, GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem,
    ReturnMap, SecondOrder, Sensitivities, Shooting,
};
use casados::prelude::*;
use core::f64::consts::PI;

/// Duffing's oscillator, driven by `cos t` and a control.
#[ode]
fn duffing(x: [f64; 2], u: f64, t: f64) -> [f64; 2] {
    [x[1], t.cos() + u - x[0] - x[0] * x[0] * x[0] - 0.2 * x[1]]
}
#[function]
fn opposite(x: [f64; 2], _u: f64) -> [f64; 2] {
    [-x[0], -x[1]]
}
/// Motion and control, even in both.
#[function]
fn price(x: [f64; 2], u: f64) -> f64 {
    0.5 * (x[0] * x[0] + 0.1 * x[1] * x[1]) + u * u
}

fn batch() -> Result<Shooting<Irk<Duffing, Gauss<3>>>, Error> {
    Ok(Shooting::new(Batch::<Duffing, Gauss<3>>::new(Options::default())?))
}

/// What belongs to the other half of a period has the opposite sign, `x(t + π) = −x(t)`: the cost
/// is even, and twice that of a half. Solutions are those of the tolerance 1e-6 of the solvers
/// with curvatures of one, whose last step is quadratic.
#[test]
fn half_period_of_a_symmetric_orbit() -> Test {
    const HALF: usize = 12;
    let cost = || GeneralCost::<Price>::new();
    let mut whole =
        Problem::new(batch()?).running_cost(cost()).on(Horizon::uniform(2 * HALF, PI / HALF as f64))?;
    whole.free_initial_state().periodic("x")?.guess(&[0.0, 0.0], &[0.0])?;
    let outcome = HeapSqp::new(&whole)?.solve(&mut whole)?;
    assert!(outcome.is_converged(), "{outcome}");

    for interior in [false, true] {
        let dynamics = ReturnMap::<Opposite, _>::new(batch()?);
        let mut half =
            Problem::new(dynamics).running_cost(cost()).on(Horizon::uniform(HALF, PI / HALF as f64))?;
        half.free_initial_state().periodic("x")?.guess(&[0.0, 0.0], &[0.0])?;
        let of_half = match interior {
            true => HeapIpm::new(&half)?.solve(&mut half)?,
            false => HeapSqp::new(&half)?.solve(&mut half)?,
        };
        assert!(of_half.is_converged(), "{of_half}");
        assert!((outcome.objective - 2.0 * of_half.objective).abs() < 1e-6, "{outcome} {of_half}");
        for k in 0..HALF {
            let (x, u) = (half.stage(k)?.x[0], half.stage(k)?.u[0]);
            assert!((whole.stage(k)?.x[0] - x).abs() < 1e-6 && (whole.stage(k)?.u[0] - u).abs() < 1e-6);
            assert!((whole.stage(HALF + k)?.x[0] + x).abs() < 1e-6);
        }
        // It moves.
        assert!((half.stage(0)?.x[0] - half.stage(HALF / 2)?.x[0]).abs() > 0.1);
    }
    Ok(())
}

#[function]
fn stir(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[0] + 0.3 * x[1] + 0.1 * u * x[0], 0.8 * x[1] - 0.3 * (p[1] * x[0]).sin() + u]
}
#[function]
fn bend(x: [f64; 2], _u: f64, _p: [f64; 2]) -> [f64; 2] {
    [x[0] + 0.3 * x[1] * x[1], 0.9 * x[1] - 0.2 * x[0] * x[1]]
}
/// The second after the first where `p[0]` is one.
#[function]
fn stir_and_bend(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
    let y = [x[0] + 0.3 * x[1] + 0.1 * u * x[0], 0.8 * x[1] - 0.3 * (p[1] * x[0]).sin() + u];
    let bent = [y[0] + 0.3 * y[1] * y[1], 0.9 * y[1] - 0.2 * y[0] * y[1]];
    [y[0] + p[0] * (bent[0] - y[0]), y[1] + p[0] * (bent[1] - y[1])]
}
#[function]
fn distance(x: [f64; 2], u: f64, _p: [f64; 2]) -> [f64; 3] {
    [x[0], x[1] - 0.5, 0.3 * u]
}

const N: usize = 5;

fn on<D: SecondOrder<f64>>(
    dynamics: D,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics = D, Shape = D::Shape>>, OcpError>
where
    Distance: Function<Shape = D::Shape>,
{
    let cost = LeastSquaresCost::<Distance>::diagonal(&[1.0, 1.0, 1.0]);
    let mut ocp = Problem::new(dynamics).stage_cost(cost).on(Horizon::uniform(N, 1.0))?;
    ocp.free_initial_state().periodic("x")?.guess(&[0.1, 0.2], &[0.1])?.set_parameters(.., &[0.0, 1.3])?;
    for k in 0..N {
        ocp.set_reference(k..=k, &[1.0 + 0.2 * k as f64, 0.0, 0.0])?;
    }
    ocp.set_parameters(N - 1..N, &[1.0, 1.3])?;
    Ok(ocp)
}

/// The same numbers up to rounding, iterates too, since all derivatives are the same.
#[test]
fn return_map_within_the_dynamics() -> Test {
    let mut apart = on(ReturnMap::<Bend, _>::new(Map::<Stir, f64>::new()))?;
    let mut whole = on(Map::<StirAndBend, f64>::new())?;
    let (mut one, mut other) = (HeapSqp::new(&apart)?, HeapSqp::new(&whole)?);
    let (a, b) = (one.solve(&mut apart)?, other.solve(&mut whole)?);
    assert!(a.is_converged() && a.iterations == b.iterations && a.iterations > 2, "{a} {b}");
    let (mut by_p, mut same) = (Sensitivities::new(&apart)?, Sensitivities::new(&whole)?);
    apart.differentiate(EXACT, &mut by_p)?;
    whole.differentiate(EXACT, &mut same)?;
    for k in 0..=N {
        let (a, b) = (apart.stage(k)?, whole.stage(k)?);
        for i in 0..2 {
            // A hundred roundings of numbers of one, some of which the iterations multiply.
            assert!((a.x[i] - b.x[i]).abs() < 1e-12, "{k} {i}");
            // By the second parameter, which is the second column.
            let (a, b) = (by_p.dx_dp(k)[2 + i], same.dx_dp(k)[2 + i]);
            assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{k} {i}: {a} {b}");
        }
    }
    assert!(by_p.dx_dp(0)[2].abs() > 1e-3);
    Ok(())
}

#[function]
fn logarithm(x: f64, _u: f64) -> f64 {
    x.ln()
}
#[function]
fn climb(x: f64, u: f64) -> f64 {
    x + u
}
#[function]
fn effort(_x: f64, u: f64) -> f64 {
    u * u
}

/// The error has the name of the map and the number of the interval.
#[test]
fn return_maps_that_are_not_finite() -> Test {
    let dynamics = ReturnMap::<Logarithm, _>::new(Map::<Climb, f64>::new());
    let mut ocp =
        Problem::new(dynamics).stage_cost(GeneralCost::<Effort>::new()).on(Horizon::uniform(3, 1.0))?;
    ocp.free_initial_state().periodic("x")?.guess(&[-1.0], &[0.0])?;
    match HeapSqp::new(&ocp)?.solve(&mut ocp) {
        Err(OcpError::NonFiniteFunction { function: "Logarithm", stage: 2, output: 0, .. }) => Ok(()),
        other => panic!("{other:?}"),
    }
}
