//! What has no answer is an error that says why; what was asked before and after it is not touched.

use crate::models::oscillators::VanDerPol;
use casados::error::Quantity;
use casados::options::{Newton, Start};
use casados::{
    Adaptive, AdaptiveOptions, Dae, DormandPrince8, Erk, Error, Gauss, Heap, Integrator, Irk, Options, Radau,
    RadauIIA, Rk4, Shape, dae, ode,
};
use nalgebra::{SVector, vector};

#[ode]
fn growth(x: f64, p: f64) -> f64 {
    p * x
}

/// The second equation vanishes with `p`.
#[dae]
fn empty_row(xdot: f64, x: f64, z: f64, p: f64) -> [f64; 2] {
    [xdot + x - z, p * (z - x)]
}

/// Index two where `p` is zero: `x = sin t`, `z = ẋ`.
#[dae]
fn hidden(xdot: f64, x: f64, z: f64, p: f64, t: f64) -> [f64; 2] {
    [xdot - z, x - t.sin() + p * z]
}

/// No value beyond `t = 1/2`.
#[ode]
fn square_root(x: f64, t: f64) -> f64 {
    (0.5 - t).sqrt() - 0.1 * x
}

/// With a pole at `t = 1` from `x = 1`.
#[ode]
fn riccati(x: f64) -> f64 {
    x * x
}

/// Beyond the largest number soon after `t = 1/2`.
#[ode]
fn overflow(x: f64, t: f64) -> f64 {
    (1e4 * (t - 0.45)).exp() - 0.1 * x
}

/// The level falls below zero, where there is no logarithm.
#[ode]
fn logarithm(x: f64) -> f64 {
    1e-3 * x.ln() - 1.0
}

/// `e^1000`
#[ode]
fn exponential(x: f64) -> f64 {
    -x.exp()
}

fn none() -> SVector<f64, 0> {
    SVector::zeros()
}

fn options(steps: usize) -> Options {
    Options { steps, ..Default::default() }
}

/// `1 − hλ = 0` of implicit Euler, a row of zeros: an error, and the bits of a fresh integrator
/// afterwards.
#[test]
fn t20_singular_matrices() {
    let mut irk = Irk::<Growth, RadauIIA<1>>::new(options(1)).expect("valid");
    irk.set_parameters(&vector![1.0]).expect("finite");
    let before = irk.solve(&vector![1.0], &none(), 0.5).expect("a solution").x;
    let error = irk.solve(&vector![1.0], &none(), 1.0).map(|step| step.x);
    assert!(matches!(error, Err(Error::Singular { unknown: "x", .. })), "{error:?}");
    let error = irk.hessian(&vector![1.0], &none(), 1.0, &vector![1.0]).map(|step| step.x);
    assert!(matches!(error, Err(Error::Singular { .. })), "{error:?}");
    assert_eq!(irk.solve(&vector![1.0], &none(), 0.5).expect("a solution").x, before);

    macro_rules! check {
        ($integrator:expr) => {
            let mut integrator = $integrator.expect("valid");
            integrator.set_parameters(&vector![0.0]).expect("finite");
            match integrator.solve(&vector![1.0], &none(), 0.1).map(|step| step.x) {
                Err(
                    Error::Singular { unknown, .. }
                    | Error::InconsistentStart { unknown, singular: true, .. },
                ) => {
                    assert_eq!(unknown, "z");
                }
                other => panic!("{other:?}"),
            }
            integrator.set_parameters(&vector![1e-200]).expect("finite");
            let x = integrator.solve(&vector![1.0], &none(), 0.1).expect("a solution").x[0];
            // ẋ = 0
            assert!((x - 1.0).abs() <= 4.0 * f64::EPSILON, "{x}");
        };
    }
    check!(Irk::<EmptyRow, Gauss<1>>::new(options(1)));
    check!(Irk::<EmptyRow, Gauss<3>>::new(options(2)));
    check!(Irk::<EmptyRow, RadauIIA<2>>::new(options(1)));
    check!(Irk::<EmptyRow, RadauIIA<5>>::new(options(1)));
    check!(Adaptive::<EmptyRow, Radau>::new(AdaptiveOptions::default()));
}

/// The index is one by construction: what a model shows to be more is no program (see
/// `tests/ui/cases/structurally_singular.rs`, the pendulum of index two). What shows at run time
/// alone is an error at the start of adaptive integration, and of an interval without length: there
/// the Newton matrix is `∂f/∂(ẋ, z)`. Steps of a given size have a solution all the same, which is
/// right: that of the method for index two.
#[test]
fn t22_index_two() {
    let mut adaptive = Adaptive::<Hidden, Radau>::new(AdaptiveOptions::default()).expect("valid");
    adaptive.set_parameters(&vector![0.0]).expect("finite");
    let error = adaptive.solve(&vector![0.0], &none(), 1.0).map(|result| result.x);
    assert!(matches!(error, Err(Error::InconsistentStart { unknown: "z", singular: true, .. })), "{error:?}");
    let mut irk = Irk::<Hidden, RadauIIA<3>>::new(options(4)).expect("valid");
    irk.set_parameters(&vector![0.0]).expect("finite");
    let error = irk.solve(&vector![0.0], &none(), 0.0).map(|step| step.x);
    assert!(matches!(error, Err(Error::Singular { unknown: "z", .. })), "{error:?}");
    // x is exact at the nodes, and z = ẋ of a polynomial of degree three: its error falls by 2³ as
    // steps are halved.
    let mut before = f64::INFINITY;
    for steps in [4, 8, 16, 32] {
        let mut irk = Irk::<Hidden, RadauIIA<3>>::new(options(steps)).expect("valid");
        irk.set_parameters(&vector![0.0]).expect("finite");
        let (x, z) =
            irk.solve(&vector![0.0], &none(), 1.0).map(|step| (step.x[0], step.z[0])).expect("a solution");
        let error = (z - 1.0f64.cos()).abs();
        println!("{steps} steps: {:e} {error:e}", x - 1.0f64.sin());
        assert!((x - 1.0f64.sin()).abs() <= 1e-14 && error <= 1e-3);
        assert!(before / error >= 7.0, "{before:e} {error:e}");
        before = error;
    }
}

/// An integrator that fails, and then gives the bits of a fresh one.
fn fails<M: Dae, I: Integrator<Model = M, Number = f64, Memory = Heap>>(
    make: impl Fn() -> I,
    x0: f64,
    [h, good]: [f64; 2],
    expected: impl Fn(&Error) -> bool,
) where
    M::Shape: Shape<VectorX<f64> = SVector<f64, 1>, VectorU<f64> = SVector<f64, 0>>,
{
    let (mut integrator, one, lambda) = (make(), vector![1.0], vector![1.0]);
    for mode in 0..4 {
        let x0 = vector![x0];
        let error = match mode {
            0 => integrator.solve(&x0, &none(), h).map(|step| step.x),
            1 => integrator.forward(&x0, &none(), h).map(|step| step.x),
            2 => integrator.adjoint(&x0, &none(), h, &lambda).map(|step| step.x),
            _ => integrator.hessian(&x0, &none(), h, &lambda).map(|step| step.x),
        };
        match &error {
            Err(error) => assert!(expected(error), "{error:?}"),
            Ok(x) => panic!("{x}"),
        }
        let after = *integrator.hessian(&one, &none(), good, &lambda).expect("a solution");
        let mut fresh = make();
        assert_eq!(&after, fresh.hessian(&one, &none(), good, &lambda).expect("a solution"));
        assert!(after.x[0].is_finite() && after.h_xx[(0, 0)].is_finite());
    }
}

#[test]
fn t26_models_without_a_value() {
    let residual = |stage: Option<usize>| {
        move |error: &Error| match error {
            Error::NonFiniteModel { quantity: Quantity::Residual, equation: 0, value, at } => {
                !value.is_finite() && stage.is_none_or(|stage| at.stage == stage) && at.step == 0
            }
            _ => false,
        }
    };
    macro_rules! check {
        ($($integrator:ident $method:ty;)*) => {$(
            // NaN at the second stage, or where there is one beyond the middle: in the first step
            // of one.
            fails::<SquareRoot, _>(|| $integrator::<SquareRoot, $method>::new(options(1)).expect("valid"), 1.0, [1.0, 0.4], residual(None));
            fails::<Overflow, _>(|| $integrator::<Overflow, $method>::new(options(1)).expect("valid"), 1.0, [1.0, 0.4], residual(None));
            fails::<Exponential, _>(|| $integrator::<Exponential, $method>::new(options(1)).expect("valid"), 1000.0, [0.1, 0.1], residual(Some(0)));
            fails::<Logarithm, _>(|| $integrator::<Logarithm, $method>::new(options(1)).expect("valid"), -1.0, [0.1, 0.1], residual(Some(0)));
        )*};
    }
    check! { Irk Gauss<2>; Irk Gauss<4>; Irk RadauIIA<3>; Irk RadauIIA<5>; Erk Rk4; Erk DormandPrince8; }
    // The nodes of Gauss with two stages are 0.21 and 0.79: the second is beyond the middle.
    let second = |error: &Error| residual(Some(1))(error);
    fails::<SquareRoot, _>(
        || Irk::<SquareRoot, Gauss<2>>::new(options(1)).expect("valid"),
        1.0,
        [1.0, 0.4],
        second,
    );
    fails::<Overflow, _>(
        || Irk::<Overflow, Gauss<2>>::new(options(1)).expect("valid"),
        1.0,
        [1.0, 0.4],
        second,
    );
    // The level crosses zero in a later step: the error says in which.
    let mut irk = Irk::<Logarithm, RadauIIA<2>>::new(options(10)).expect("valid");
    match irk.solve(&vector![0.1], &none(), 0.2).map(|step| step.x) {
        Err(Error::NonFiniteModel { at, .. }) => assert!((4..=5).contains(&at.step), "{at}"),
        other => panic!("{other:?}"),
    }
}

/// The polynomial of the last step of Van der Pol's oscillator satisfies its equations at the
/// stages: `D x = h f(x)`, with the derivatives `D` of the Lagrange polynomials of the start and
/// the stages, to rounding of the terms.
fn satisfies_collocation_conditions(irk: &mut Irk<VanDerPol, RadauIIA<3>>, mu: f64, h: f64) {
    let root = 6.0f64.sqrt();
    let nodes = [0.0, (4.0 - root) / 10.0, (4.0 + root) / 10.0, 1.0];
    let values = nodes.map(|c| irk.dense(c * h).expect("inside of the step").x);
    let others = |i: usize, j: usize| (0..4).filter(move |&k| k != i && k != j);
    let derivative = |j: usize, i: usize| {
        if i == j {
            return others(i, i).map(|k| 1.0 / (nodes[i] - nodes[k])).sum::<f64>();
        }
        let above: f64 = others(i, j).map(|k| nodes[i] - nodes[k]).product();
        above / others(j, j).map(|k| nodes[j] - nodes[k]).product::<f64>()
    };
    // States are sums that begin at the start of the step: they are rounded as the largest of them.
    let largest = |state: usize| values.iter().fold(0.0, |most: f64, x| most.max(x[state].abs()));
    let rates = |y1: f64, y2: f64| [vec![y2], vec![mu * y2, -mu * y1 * y1 * y2, -y1]];
    let sizes = rates(largest(0), largest(1));
    for i in 1..4 {
        for (state, rate) in rates(values[i][0], values[i][1]).iter().enumerate() {
            let slopes: Vec<f64> = (0..4).map(|j| derivative(j, i) * values[j][state]).collect();
            let sum = slopes.iter().sum::<f64>() - h * rate.iter().sum::<f64>();
            let size = slopes.iter().map(|slope| slope.abs()).sum::<f64>()
                + h * sizes[state].iter().map(|size| size.abs()).sum::<f64>();
            // Interpolation and differentiation of four values, and Newton's method to rounding:
            // some tens of ε.
            assert!(
                f64::abs(sum) <= 100.0 * f64::EPSILON * size,
                "stage {i}, state {state}: {sum:e} of {size:e}"
            );
        }
    }
}

/// Steps that no iteration solves, and iterations that are not allowed to: with how far they came.
#[test]
fn t31_newton_divergence() {
    let mut irk = Irk::<VanDerPol, RadauIIA<3>>::new(options(1)).expect("valid");
    irk.set_parameters(&vector![1e6]).expect("finite");
    // In the jump between the slow branches.
    let fast = vector![0.5, -1e6];
    match irk.solve(&fast, &none(), 1e5).map(|step| step.x) {
        Err(Error::NotConverged { residual, increment, at, .. }) => {
            assert!(residual.is_finite() && residual > 0.0 && increment.is_finite());
            assert_eq!((at.step, at.iteration), (0, 50));
            assert!(irk.statistics().iterations >= 50);
        }
        // Or it finds another solution of the equations of collocation, far away.
        Ok(_) => satisfies_collocation_conditions(&mut irk, 1e6, 1e5),
        Err(Error::Overflow { .. }) => {}
        Err(other) => panic!("{other}"),
    }
    // A step of implicit Euler with `h = 1` has no solution: `k = (1 + k)²` has no real root.
    // Relative to its terms, `|k|` and `2 (1 + k)²`, the residual is
    // `(k² + k + 1)/(|k| + 2 (1 + k)²) ≥ 1/3`, which it is at `k = 1`.
    let mut irk = Irk::<Riccati, RadauIIA<1>>::new(options(1)).expect("valid");
    match irk.solve(&vector![1.0], &none(), 1.0).map(|step| step.x) {
        Err(Error::NotConverged { residual, increment, at, .. }) => {
            assert!(
                residual >= 0.333 && increment > 0.0 && at.iteration == 50,
                "{residual} {increment} {at}"
            );
        }
        other => panic!("{other:?}"),
    }
    let newton = Newton { max_iterations: 1, ..Default::default() };
    let mut irk = Irk::<VanDerPol, RadauIIA<3>>::new(Options { newton, ..options(1) }).expect("valid");
    irk.set_parameters(&vector![5.0]).expect("finite");
    let x0 = vector![2.0, -0.5];
    match irk.solve(&x0, &none(), 0.5).map(|step| step.x) {
        Err(Error::NotConverged { residual, increment, at, .. }) => {
            assert!(residual > 1e-6 && increment > 0.0 && at.iteration == 1, "{residual} {increment} {at}");
        }
        other => panic!("{other:?}"),
    }
    // One iteration is enough for who asks for no more.
    let newton = Newton { fixed_iterations: Some(1), ..Default::default() };
    let mut irk = Irk::<VanDerPol, RadauIIA<3>>::new(Options { newton, ..options(1) }).expect("valid");
    irk.set_parameters(&vector![5.0]).expect("finite");
    assert!(irk.solve(&x0, &none(), 0.5).is_ok());
    assert_eq!(irk.statistics().iterations, 1);
}

/// With one stage the stage is known from outside: `k = (x₊ − x)/h`. Its residual is rounding, at a
/// thousand points; and no iteration went round in circles.
#[test]
fn t32_newton_to_rounding() {
    let mut seed = 3u64;
    let mut next = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let start = Start::Zero;
    let mut gauss = Irk::<VanDerPol, Gauss<1>>::new(Options { start, ..options(1) }).expect("valid");
    let mut radau = Irk::<VanDerPol, RadauIIA<1>>::new(Options { start, ..options(1) }).expect("valid");
    let mut most = 0;
    for _ in 0..1000 {
        let (x, mu, h) = (vector![2.0 * next(), 2.0 * next()], 2.0 + next(), 0.05 * (1.5 + next()));
        for method in 0..2 {
            let (end, iterations) = if method == 0 {
                gauss.set_parameters(&vector![mu]).expect("finite");
                (gauss.solve(&x, &none(), h).expect("a step").x, gauss.statistics().iterations)
            } else {
                radau.set_parameters(&vector![mu]).expect("finite");
                (radau.solve(&x, &none(), h).expect("a step").x, radau.statistics().iterations)
            };
            most = most.max(iterations);
            let stage = if method == 0 { (x + end) / 2.0 } else { end };
            let [y1, y2] = [stage[0], stage[1]];
            let terms = [[y2, 0.0, 0.0], [mu * y2, -mu * y1 * y1 * y2, -y1]];
            for c in 0..2 {
                let residual = (end[c] - x[c]) / h - terms[c].iter().sum::<f64>();
                let size =
                    terms[c].iter().map(|term| term.abs()).sum::<f64>() + (x[c].abs() + end[c].abs()) / h;
                assert!(residual.abs() <= 10.0 * f64::EPSILON * size, "{residual:e} of {size}");
            }
        }
    }
    println!("{most} iterations");
    assert!(most <= 15, "{most}");
}
