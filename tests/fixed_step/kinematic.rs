//! Kinematic states, with equations `q̇ = c v`: they are no unknowns of iterations, of the
//! elimination or of derivatives. Held against differences of what they are derivatives of, with
//! the plan of elimination and without.

use crate::lost::Lost;
use crate::models::chain::{Chain, stretched};
use casados::__private::Kinematic;
use casados::irk::Integrator;
use casados::prelude::*;
use casados::result::{Forward, Hessian};
use casados::{Method, Shape, Statistics};
use nalgebra::{SMatrix, SVector, Vector1, vector};

/// Positions that follow a state, a multiple of one, and a control; two velocities; a cost, of
/// positions or of their derivatives.
#[dae(COST = [0, 1])]
fn points<const COST: usize>(xdot: [f64; 6], x: [f64; 6], z: [f64; 2], u: [f64; 2], p: [f64; 2]) -> [f64; 8] {
    let of = if COST == 1 { [xdot[0], xdot[1], xdot[2]] } else { [x[0], x[1], x[2]] };
    [
        xdot[0] - x[3],
        xdot[1] + 2.0 * x[4],
        xdot[2] - u[0],
        xdot[3] + (x[0] - x[1]).sin() + (x[2] + 0.1 * x[3]) * x[4] + z[0],
        xdot[4] - x[0].cos() * x[1] + 0.2 * x[3] * x[4] + 0.3 * z[1] * x[2] - u[0] * x[0],
        xdot[5]
            - (of[0] * of[0] + of[1] * of[1] + of[2] * of[2])
            - (u[1] * u[1] + x[3] * x[3] + x[4] * x[4] + u[0] * u[0]),
        p[1] * z[0] + p[0] * z[1] - x[0] * x[0],
        p[0] * z[0] - p[1] * z[1] - x[1],
    ]
}

type X = SVector<f64, 6>;
/// Initial values, controls and parameters in one.
type W = SVector<f64, 10>;
type Test = Result<(), Box<dyn std::error::Error>>;
type Steps<M, B, const S: usize> = Integrator<M, B, S, f64, Heap>;

const LENGTH: f64 = 0.3;
/// Condition of the Newton matrix of order ten, over three steps.
const ROUNDING: f64 = 30.0 * f64::EPSILON;
/// Of differences, and what their weights add up to.
const STEP: f64 = 0.01;
const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
const SUM: f64 = 2.1;

const BEGIN: [f64; 10] = [0.4, -0.3, 0.8, 0.5, -0.6, 0.1, 0.7, -0.2, 1.2, 0.4];

fn split(w: &W) -> (X, SVector<f64, 2>, SVector<f64, 2>) {
    (w.fixed_rows::<6>(0).into(), vector![w[6], w[7]], vector![w[8], w[9]])
}

fn steps<M: Dae, B: Method<S>, const S: usize>() -> Result<Steps<M, B, S>, casados::Error> {
    Integrator::new(Options { steps: 3, ..Default::default() })
}

/// Differences of order eight in every direction.
fn differences<const R: usize>(
    at: &W,
    mut of: impl FnMut(&W) -> Result<SVector<f64, R>, casados::Error>,
) -> Result<SMatrix<f64, R, 10>, casados::Error> {
    let mut all = SMatrix::<f64, R, 10>::zeros();
    for c in 0..10 {
        for (k, weight) in WEIGHTS.into_iter().enumerate() {
            let mut by = W::zeros();
            by[c] = STEP * (k + 1) as f64;
            let change = (of(&(at + by))? - of(&(at - by))?) * (weight / STEP);
            all.column_mut(c).zip_apply(&change, |to, change| *to += change);
        }
    }
    Ok(all)
}

fn close<const R: usize>(found: &SMatrix<f64, R, 10>, expected: &SMatrix<f64, R, 10>, size: f64) {
    let (worst, tolerance) = ((found - expected).amax(), SUM * ROUNDING * size / STEP);
    assert!(worst <= tolerance, "{worst:e} is more than {tolerance:e}");
}

fn jacobian<M: Dae<Shape = <Points<0> as Dae>::Shape>>(of: &Forward<M>) -> SMatrix<f64, 6, 10> {
    SMatrix::from_fn(|r, c| match c {
        0..6 => of.dx_dx0[(r, c)],
        6..8 => of.dx_du[(r, c - 6)],
        _ => of.dx_dp[(r, c - 8)],
    })
}

fn second_order_differences<M: Dae<Shape = <Points<0> as Dae>::Shape>>(
    of: &Hessian<M>,
) -> SMatrix<f64, 10, 10> {
    SMatrix::from_fn(|r, c| match (r.min(c), r.max(c)) {
        (r, c @ 0..6) => of.h_xx[(r, c)],
        (r @ 0..6, c @ 6..8) => of.h_xu[(r, c - 6)],
        (r @ 0..6, c) => of.h_xp[(r, c - 8)],
        (r, c @ 6..8) => of.h_uu[(r - 6, c - 6)],
        (r @ 6..8, c) => of.h_up[(r - 6, c - 8)],
        (r, c) => of.h_pp[(r - 8, c - 8)],
    })
}

/// Forward, directional and second-order sensitivities.
fn check<M, B, const S: usize>(mut irk: Steps<M, B, S>, dense: bool) -> Test
where
    M: Dae<Shape = <Points<0> as Dae>::Shape>,
    B: Method<S>,
{
    let (at, lambda) = (W::from(BEGIN), X::from_fn(|i, _| (0.7 * i as f64).cos()));
    let (x, u, p) = split(&at);
    irk.set_parameters(&p)?;
    let found = jacobian(irk.forward(&x, &u, LENGTH)?);
    assert_eq!(irk.statistics().dense > 0, dense, "{:?}", irk.statistics());
    let hessian = *irk.hessian(&x, &u, LENGTH, &lambda)?;
    let expected = differences(&at, |w| {
        let (x, u, p) = split(w);
        irk.set_parameters(&p)?;
        Ok(irk.solve(&x, &u, LENGTH)?.x)
    })?;
    let size = found.amax().max(1.0);
    close(&found, &expected, size);
    let expected = differences(&at, |w| {
        let (x, u, p) = split(w);
        irk.set_parameters(&p)?;
        let adjoint = irk.adjoint(&x, &u, LENGTH, &lambda)?;
        let parts = [adjoint.grad_x0.as_slice(), adjoint.grad_u.as_slice(), adjoint.grad_p.as_slice()];
        Ok(W::from_iterator(parts.concat()))
    })?;
    close(&second_order_differences(&hessian), &expected, expected.amax().max(1.0));
    Ok(())
}

/// The kinematic states of a model, none of which has a pivot.
fn kinematic_states<M: Dae>() -> Vec<usize> {
    let plan = &M::STRUCTURE.elimination;
    let is_kinematic = |&state: &usize| plan.kinematic[state].equation != Kinematic::NONE;
    let found: Vec<usize> = (0..plan.kinematic.len()).filter(is_kinematic).collect();
    assert!(plan.pivots.iter().all(|pivot| !found.contains(&(pivot.slot as usize))));
    assert_eq!(plan.pivots.len() + found.len(), plan.slot_of_equation.len());
    found
}

#[test]
fn derivatives_by_differences() -> Test {
    assert_eq!(kinematic_states::<Points<0>>(), [0, 1, 2]);
    assert_eq!(<Points<1> as Dae>::STRUCTURE.diagonal_controls.len(), 1);
    check(steps::<Points<0>, Gauss<2>, 2>()?, false)?;
    check(steps::<Points<0>, Gauss<1>, 1>()?, false)?;
    check(steps::<Points<0>, RadauIIA<3>, 3>()?, false)?;
    check(steps::<Points<1>, Gauss<2>, 2>()?, false)?;
    check(steps::<Points<1>, Gauss<4>, 4>()?, false)
}

/// The whole matrix pivoted.
#[test]
fn dense_fallback() -> Test {
    check(steps::<Lost<Points<0>>, Gauss<2>, 2>()?, true)?;
    check(steps::<Lost<Points<1>>, Gauss<2>, 2>()?, true)
}

/// Kinematic states that follow another one, a control and a parameter, each felt by three more:
/// `a`, `b`, `c`.
#[dae(CURVED = [0, 1])]
fn led<const CURVED: usize>(xdot: [f64; 6], x: [f64; 6], u: [f64; 2], p: [f64; 2]) -> [f64; 6] {
    let [a, b, c, v, w, y] = x;
    let [q, r] = if CURVED == 1 { [(a - b).sin() * c, v * w] } else { [0.0, 0.0] };
    [
        xdot[0] - 2.0 * y,
        xdot[1] - u[0],
        xdot[2] + 3.0 * p[1],
        xdot[3] + a + b - 0.5 * c + 0.2 * w - 0.6 * y - q,
        xdot[4] - 0.7 * a + 0.3 * b + c + 0.1 * v - p[0] - q + 0.3 * xdot[0] - 0.2 * xdot[1],
        xdot[5] + 0.4 * a - b + c + 0.3 * y - 0.2 * v + w - u[1] - r,
    ]
}

/// No iteration finds kinematic states: the solution is that of the whole matrix, whose iterations
/// go on until every equation is satisfied.
fn check_against_dense_elimination<B: Method<S>, const S: usize, const CURVED: usize>(
    options: Options,
) -> Test
where
    Led<CURVED>: Dae<Shape = <Led<0> as Dae>::Shape>,
{
    assert_eq!(kinematic_states::<Led<CURVED>>(), [0, 1, 2]);
    let (at, whole) = (W::from(BEGIN), Options { newton: Newton::default(), ..options });
    let (x, u, p) = split(&at);
    let mut led = Integrator::<Led<CURVED>, B, S, f64, Heap>::new(options)?;
    let mut lost = Integrator::<Lost<Led<CURVED>>, B, S, f64, Heap>::new(whole)?;
    led.set_parameters(&p)?;
    lost.set_parameters(&p)?;
    let expected = lost.solve(&x, &u, LENGTH)?.x;
    assert_ne!(lost.statistics().dense, 0);
    let found = led.solve(&x, &u, LENGTH)?.x;
    assert_eq!(led.statistics().dense, 0);
    let error = (found - expected).amax();
    assert!(error <= ROUNDING * expected.amax(), "{error:e}");
    Ok(())
}

#[test]
fn kinematic_states_in_every_iteration() -> Test {
    let ordinary = Options { steps: 3, ..Default::default() };
    let fixed = |count| Newton { fixed_iterations: Some(count), ..Default::default() };
    let by = |jacobian| Options { newton: Newton { jacobian, ..Default::default() }, ..ordinary };
    for options in
        [ordinary, Options { compensated: true, ..ordinary }, by(Jacobian::Full), by(Jacobian::Frozen)]
    {
        check_against_dense_elimination::<Gauss<1>, 1, 1>(options)?;
        check_against_dense_elimination::<Gauss<2>, 2, 1>(options)?;
        check_against_dense_elimination::<RadauIIA<3>, 3, 1>(options)?;
        check_against_dense_elimination::<Gauss<4>, 4, 1>(options)?;
        check_against_dense_elimination::<RadauIIA<3>, 3, 0>(options)?;
    }
    check_against_dense_elimination::<Gauss<2>, 2, 1>(Options { newton: fixed(12), ..ordinary })?;
    // Linear equations take one iteration, from wherever it starts.
    for newton in [fixed(1), Newton::default()] {
        let options = Options { newton, ..ordinary };
        check_against_dense_elimination::<Gauss<1>, 1, 0>(options)?;
        check_against_dense_elimination::<Gauss<2>, 2, 0>(options)?;
        check_against_dense_elimination::<Gauss<4>, 4, 0>(options)?;
    }
    Ok(())
}

/// Positions that follow one velocity, another one, and a control, each felt by several more, as
/// are derivatives of two of them. Where `p = 0` the equations are linear, which nobody knows
/// before they run.
#[dae]
fn gone(xdot: [f64; 7], x: [f64; 7], u: [f64; 1], p: [f64; 1]) -> [f64; 7] {
    let [a, b, c, d, v, w, y] = x;
    [
        xdot[0] - 2.0 * v,
        xdot[1] + v,
        xdot[2] - w,
        xdot[3] - u[0],
        xdot[4] + 0.2 * a + 0.9 * b - 0.1 * c + 0.3 * v + 0.1 * w + 0.3 * xdot[1] + p[0] * v * v * v,
        xdot[5] - 0.2 * a + 0.5 * c + 0.1 * d + 0.2 * v - 0.1 * xdot[2] + p[0] * w * w * w,
        xdot[6] - v + 0.4 * w + 0.5 * y + p[0] * y * v,
    ]
}

/// Points of four, three, two and one coordinates in a row, one of which follows another. Where
/// `p = 0` the equations are linear.
#[dae(NX = [11, 61])]
fn knots<const NX: usize>(xdot: [f64; NX], x: [f64; NX], u: [f64; 1], p: [f64; 1]) -> [f64; NX] {
    let point = |i: usize| 4 * (i / 10) + [0, 0, 0, 0, 1, 1, 1, 2, 2, 3][i % 10];
    let mut f = xdot;
    for i in 0..NX - 1 {
        f[i] += p[0] * x[i] * x[i] - 0.1 * u[0] * (i % 3) as f64;
        for (j, other) in x.iter().enumerate().take(NX - 1) {
            if point(i) <= point(j) + 1 && point(j) <= point(i) + 1 {
                f[i] += ((3 * i + 5 * j) % 7) as f64 * 0.1 * other - 0.3 * other;
            }
        }
    }
    f[2] += 0.4 * x[NX - 1];
    f[NX - 1] -= 2.0 * x[1];
    f
}

/// Newton's method finds the solution of linear equations in one iteration if columns of kinematic
/// states are part of the right ones, and its systems are solved.
fn check_linear_equations_in_one_iteration<M, B: Method<S>, const S: usize, const NX: usize>(
    x: SVector<f64, NX>,
) -> Test
where
    M: Dae<
        Shape: Shape<
            VectorX<f64> = SVector<f64, NX>,
            VectorU<f64> = Vector1<f64>,
            VectorP<f64> = Vector1<f64>,
        >,
    >,
{
    let (u, p) = (vector![0.3], vector![0.0]);
    let options = Options { steps: 3, ..Default::default() };
    let fixed = Newton { fixed_iterations: Some(1), ..Default::default() };
    let mut whole = Integrator::<Lost<M>, B, S, f64, Heap>::new(options)?;
    whole.set_parameters(&p)?;
    let expected = whole.solve(&x, &u, LENGTH)?.x;
    assert_ne!(whole.statistics().dense, 0);
    for newton in [Newton::default(), fixed] {
        let mut led = Integrator::<M, B, S, f64, Heap>::new(Options { newton, ..options })?;
        led.set_parameters(&p)?;
        let error = (led.solve(&x, &u, LENGTH)?.x - expected).amax();
        assert!(error <= ROUNDING, "{error:e}");
        let Statistics { steps, iterations, dense, .. } = *led.statistics();
        // Without their share, increments would shrink by `(hA)²`, a five-hundredth: to rounding in
        // six iterations. The second one is none.
        assert!(iterations <= 2 * steps && dense == 0, "{iterations} iterations, {dense} pivoted");
    }
    // Registers, whose factors may have half of the digits.
    let mut batch = casados::batch::Integrator::<Integrator<M, B, S, f64, Heap>>::new(options)?;
    let mut found = vec![Default::default(); 8];
    let (x0, h) = (vec![x; 8], [LENGTH]);
    batch.solve(&Intervals { x0: &x0, u: &[u; 8], p: &[p; 8], h: &h, ..Default::default() }, &mut found)?;
    for found in &found {
        assert!((found.x - expected).amax() <= ROUNDING);
    }
    let Statistics { steps, iterations, .. } = batch.statistics().work;
    assert!(
        iterations <= 3 * steps && batch.statistics().redone == 0,
        "{iterations} iterations of {steps} steps"
    );
    Ok(())
}

#[test]
fn columns_of_kinematic_states() -> Test {
    // Two follow one.
    assert_eq!(kinematic_states::<Gone>(), [0, 1, 2, 3]);
    let x = vector![0.4, -0.3, 0.8, 0.5, -0.6, 0.1, 0.7];
    check_linear_equations_in_one_iteration::<Gone, Gauss<1>, 1, 7>(x)?;
    check_linear_equations_in_one_iteration::<Gone, Gauss<2>, 2, 7>(x)?;
    check_linear_equations_in_one_iteration::<Gone, RadauIIA<3>, 3, 7>(x)?;
    check_linear_equations_in_one_iteration::<Gone, Gauss<4>, 4, 7>(x)
}

/// Points are supernodes, in straight lines and in loops.
#[test]
fn supernodes() -> Test {
    let plan = &<Knots<61> as Dae>::STRUCTURE.elimination;
    for count in 1..=4 {
        assert!(plan.supernodes.iter().any(|of| of.count == count), "{count} in {:?}", plan.supernodes);
    }
    let total: u32 = plan.supernodes.iter().map(|of| of.count).sum();
    assert_eq!(total as usize, plan.pivots.len());
    assert_eq!(kinematic_states::<Knots<61>>(), [60]);
    let (few, many) = (SVector::from_fn(|i, _| (i as f64).sin()), SVector::from_fn(|i, _| (i as f64).sin()));
    check_linear_equations_in_one_iteration::<Knots<11>, RadauIIA<3>, 3, 11>(few)?;
    check_linear_equations_in_one_iteration::<Knots<11>, Gauss<4>, 4, 11>(few)?;
    check_linear_equations_in_one_iteration::<Knots<61>, Gauss<2>, 2, 61>(many)?;
    check_linear_equations_in_one_iteration::<Knots<61>, RadauIIA<3>, 3, 61>(many)?;
    check_linear_equations_in_one_iteration::<Knots<61>, Gauss<4>, 4, 61>(many)?;
    check_linear_equations_in_one_iteration::<Knots<61>, Gauss<5>, 5, 61>(many)
}

/// From zero, positions are where they follow to in the first evaluation, so that its Jacobian is
/// one within the step; and the Jacobian after it is not taken anew because of an increment of the
/// first. (With positions at the start of the step 7 masses had three factorisations.)
#[test]
fn jacobians_from_zero_guesses() -> Test {
    let newton = Newton { tolerance: 1e-8, ..Default::default() };
    let mut irk = Irk::<Chain<33>, Gauss<2>>::new(Options { newton, ..Default::default() })?;
    irk.solve(&stretched(), &vector![-1.0, 1.0, 1.0], 0.2)?;
    let Statistics { iterations, factorizations, .. } = *irk.statistics();
    assert!(
        iterations <= 5 && factorizations <= 2,
        "{iterations} iterations, {factorizations} factorisations"
    );
    Ok(())
}

/// An angle that three equations feel.
#[dae]
fn swing(xdot: [f64; 4], x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    let all = x[1] * x[2] * x[3];
    [xdot[0] - x[1], xdot[1] + x[0].sin() - u[0] - all, xdot[2] + all - x[0].cos(), xdot[3] - x[0] - all]
}

/// Intervals side by side, of which none is redone: registers meet pivots in another order.
macro_rules! side_by_side {
    ($model:ty, $method:ty, $steps:literal) => {{
        let options = Options { steps: $steps, ..Default::default() };
        let mut batch = Batch::<$model, $method>::new(options)?;
        let mut single = Irk::<$model, $method>::new(options)?;
        let x0: Vec<_> = (0..8).map(|k| vector![0.2 * f64::from(k), 0.5, -0.3, 0.1]).collect();
        let (u, h) = (vec![vector![0.3]; 8], [LENGTH]);
        let mut found = vec![Forward::default(); 8];
        let intervals = Intervals { x0: &x0, u: &u, h: &h, ..Default::default() };
        batch.forward(&intervals, &mut found)?;
        let statistics = batch.statistics();
        assert_eq!((statistics.redone, statistics.work.dense), (0, 0));
        for (x0, found) in x0.iter().zip(&found) {
            let expected = single.forward(x0, &u[0], LENGTH)?;
            let error = (found.dx_dx0 - expected.dx_dx0).amax().max((found.dx_du - expected.dx_du).amax());
            assert!(error <= ROUNDING, "{error:e}");
        }
    }};
}

#[test]
fn pivots_in_registers() -> Test {
    assert_eq!(kinematic_states::<Swing>(), [0]);
    side_by_side!(Swing, Gauss<1>, 2);
    side_by_side!(Swing, Gauss<2>, 2);
    side_by_side!(Swing, RadauIIA<3>, 2);
    side_by_side!(Swing, Gauss<4>, 1);
    Ok(())
}
