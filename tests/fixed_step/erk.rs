//! Explicit integrators against an independent implementation over dual numbers.

use casados::{Butcher6, DormandPrince5, DormandPrince8, Euler, Heun, Method, Midpoint, Rk4};
use casados::{Custom, Erk, Error, Ode, Options, Tableau, dae};
use casados::{Inline, mode};
use nalgebra::{SMatrix, SVector, vector};
use num_dual::HyperDual64;

/// `ẋ₀ = x₁ + u t`, `ẋ₁ = p (1 − x₀²) x₁ − x₀ + u²`, with equations exchanged and scaled.
#[dae]
fn oscillator(xdot: [f64; 2], x: [f64; 2], u: f64, p: f64, t: f64) -> [f64; 2] {
    [-2.0 * (xdot[1] - (p * (1.0 - x[0] * x[0]) * x[1] - x[0] + u * u)), 0.5 * (xdot[0] - (x[1] + u * t))]
}

fn g(x: [HyperDual64; 2], u: HyperDual64, p: HyperDual64, t: f64) -> [HyperDual64; 2] {
    [x[1] + u * t, p * (-x[0] * x[0] + 1.0) * x[1] - x[0] + u * u]
}

#[test]
fn permuted_and_scaled_equations() {
    assert_eq!(Oscillator::ROWS, [(1, 0.5), (0, -2.0)]);
}

const X0: [f64; 2] = [0.8, -0.6];
const U: f64 = 0.7;
const P: f64 = 1.3;
const T0: f64 = 0.4;
const H: f64 = 0.9;
const STEPS: usize = 3;

/// Runge-Kutta steps from the textbook, over hyper-dual numbers.
fn textbook_steps<const S: usize>(tableau: &Tableau<S>, w: [HyperDual64; 4]) -> [HyperDual64; 2] {
    let [x0, x1, u, p] = w;
    let mut x = [x0, x1];
    let h = H / STEPS as f64;
    for step in 0..STEPS {
        let mut k = [[HyperDual64::from(0.0); 2]; S];
        for i in 0..S {
            let xi = [0, 1].map(|r| (0..i).fold(x[r], |sum, j| sum + k[j][r] * (h * tableau.a()[i][j])));
            k[i] = g(xi, u, p, T0 + h * (step as f64 + tableau.c()[i]));
        }
        x = [0, 1].map(|r| (0..S).fold(x[r], |sum, i| sum + k[i][r] * (h * tableau.b()[i])));
    }
    x
}

/// `x₊`, `dx₊/dw` and `∇²x₊` over `w = (x₀, u, p)`.
type Derivatives = ([f64; 2], SMatrix<f64, 2, 4>, [SMatrix<f64, 4, 4>; 2]);

fn derivatives<const S: usize>(tableau: &Tableau<S>) -> Derivatives {
    let mut result: Derivatives = ([0.0; 2], SMatrix::zeros(), [SMatrix::zeros(); 2]);
    for i in 0..4 {
        for j in 0..4 {
            let w = [X0[0], X0[1], U, P];
            let w =
                core::array::from_fn(|m| HyperDual64::new(w[m], f64::from(m == i), f64::from(m == j), 0.0));
            for (r, x) in textbook_steps(tableau, w).iter().enumerate() {
                result.0[r] = x.re;
                result.1[(r, i)] = x.eps1;
                result.2[r][(i, j)] = x.eps1eps2;
            }
        }
    }
    result
}

/// Values are of size 1 to 30, each of some 100 operations: rounding stays below 1e-13 of the
/// largest.
#[track_caller]
fn close<const R: usize, const C: usize>(ours: &SMatrix<f64, R, C>, exact: &SMatrix<f64, R, C>) {
    let error = (ours - exact).amax();
    assert!(error <= 1e-13 * exact.amax().max(1.0), "{error:e}\n{ours}{exact}");
}

macro_rules! for_methods {
    (|$method:ident, $erk:ident| $body:block) => {
        for_methods!(@ $method $erk $body Euler Midpoint Heun Rk4 DormandPrince5 Butcher6 DormandPrince8)
    };
    (@ $name:ident $erk:ident $body:block $($method:ident)*) => {
        $({
            type $name = $method;
            let mut $erk =
                Erk::<Oscillator, $method>::new(Options { steps: STEPS, ..Default::default() }).unwrap();
            $erk.set_parameters(&vector![P]).unwrap();
            $erk.set_time(T0).unwrap();
            $body
        })*
    };
}

#[test]
fn agreement_with_dual_numbers() {
    let (x0, u, lambda) = (SVector::from(X0), vector![U], vector![0.9, -1.7]);
    for_methods!(|Method_, erk| {
        let (x, jacobian, hessians) = derivatives(&<Method_ as Method<_>>::TABLEAU);
        let x = SVector::from(x);
        let hessian = hessians[0] * lambda[0] + hessians[1] * lambda[1];
        let gradient = jacobian.transpose() * lambda;

        close(&erk.solve(&x0, &u, H).unwrap().x, &x);

        let forward = erk.forward(&x0, &u, H).unwrap();
        close(&forward.x, &x);
        close(&forward.dx_dx0, &jacobian.fixed_columns::<2>(0).into());
        close(&forward.dx_du, &jacobian.fixed_columns::<1>(2).into());
        close(&forward.dx_dp, &jacobian.fixed_columns::<1>(3).into());

        let adjoint = erk.adjoint(&x0, &u, H, &lambda).unwrap();
        close(&adjoint.x, &x);
        close(&adjoint.grad_x0, &gradient.fixed_rows::<2>(0).into());
        close(&adjoint.grad_u, &gradient.fixed_rows::<1>(2).into());
        close(&adjoint.grad_p, &gradient.fixed_rows::<1>(3).into());

        // More seeds than directions: several passes.
        let seeds = SMatrix::<f64, 2, 9>::from_fn(|r, c| (1 + r + 2 * c) as f64 * 0.25 - 1.0);
        let many = erk.adjoint_many(&x0, &u, H, &seeds).unwrap();
        let gradients = jacobian.transpose() * seeds;
        close(&many.x, &x);
        close(&many.grad_x0, &gradients.fixed_rows::<2>(0).into());
        close(&many.grad_u, &gradients.fixed_rows::<1>(2).into());
        close(&many.grad_p, &gradients.fixed_rows::<1>(3).into());

        let both = erk.forward_adjoint(&x0, &u, H, &lambda).unwrap();
        close(&both.x, &x);
        close(&both.dx_du, &jacobian.fixed_columns::<1>(2).into());
        close(&both.grad_x0, &gradient.fixed_rows::<2>(0).into());
        close(&both.grad_u, &gradient.fixed_rows::<1>(2).into());
        close(&both.grad_p, &gradient.fixed_rows::<1>(3).into());

        let second = erk.hessian(&x0, &u, H, &lambda).unwrap();
        close(&second.x, &x);
        close(&second.dx_dx0, &jacobian.fixed_columns::<2>(0).into());
        close(&second.grad_x0, &gradient.fixed_rows::<2>(0).into());
        close(&second.grad_p, &gradient.fixed_rows::<1>(3).into());
        close(&second.h_xx, &hessian.fixed_view::<2, 2>(0, 0).into());
        close(&second.h_xu, &hessian.fixed_view::<2, 1>(0, 2).into());
        close(&second.h_uu, &hessian.fixed_view::<1, 1>(2, 2).into());
        close(&second.h_xp, &hessian.fixed_view::<2, 1>(0, 3).into());
        close(&second.h_up, &hessian.fixed_view::<1, 1>(2, 3).into());
        close(&second.h_pp, &hessian.fixed_view::<1, 1>(3, 3).into());
        assert_eq!(second.h_xx, second.h_xx.transpose());
    });
}

#[test]
fn directional_derivatives() {
    let (x0, u) = (SVector::from(X0), vector![U]);
    for_methods!(|Method_, erk| {
        let (_, jacobian, _) = derivatives(&<Method_ as Method<_>>::TABLEAU);
        let seed = SMatrix::<f64, 4, 7>::from_fn(|r, c| ((3 * r + 5 * c) % 7) as f64 - 2.5);
        let mut seeds = no_seeds();
        seeds.x0 = seed.fixed_rows::<2>(0).into();
        seeds.u = seed.fixed_rows::<1>(2).into();
        seeds.p = seed.fixed_rows::<1>(3).into();
        let result = erk.directional(&x0, &u, H, &seeds).unwrap();
        close(&result.dx, &(jacobian * seed));
        assert_eq!(result.x, erk.solve(&x0, &u, H).unwrap().x);
    });
}

fn no_seeds() -> casados::result::Seeds<Oscillator, f64, 7> {
    casados::result::Seeds { x0: SMatrix::zeros(), u: SMatrix::zeros(), p: SMatrix::zeros() }
}

#[test]
fn repeated_calls() {
    let (x0, u, lambda) = (SVector::from(X0), vector![U], vector![0.9, -1.7]);
    for_methods!(|Method_, erk| {
        let _: Option<Method_> = None;
        let first = *erk.hessian(&x0, &u, H, &lambda).unwrap();
        erk.solve(&(2.0 * x0), &u, 0.1).unwrap();
        erk.adjoint(&x0, &vector![-3.0], 0.2, &lambda).unwrap();
        assert_eq!(*erk.hessian(&x0, &u, H, &lambda).unwrap(), first);
    });
}

#[test]
fn evaluations_in_statistics() {
    let (x0, u, lambda) = (SVector::from(X0), vector![U], vector![0.9, -1.7]);
    for_methods!(|Method_, erk| {
        let stages = <Method_ as Method<_>>::TABLEAU.c().len();
        let all = STEPS * stages;
        erk.solve(&x0, &u, H).unwrap();
        let s = erk.statistics();
        assert_eq!((s.steps, s.residuals, s.jacobians), (STEPS, all, 0));
        erk.forward(&x0, &u, H).unwrap();
        let s = erk.statistics();
        assert_eq!((s.steps, s.residuals, s.jacobians), (STEPS, 0, all));
        erk.adjoint(&x0, &u, H, &lambda).unwrap();
        let s = erk.statistics();
        assert_eq!((s.steps, s.residuals, s.jacobians), (STEPS, all, 0));
        erk.hessian(&x0, &u, H, &lambda).unwrap();
        let s = erk.statistics();
        assert_eq!((s.steps, s.residuals, s.jacobians), (STEPS, all, all));
    });
}

#[test]
fn errors_of_failed_calls() {
    let (x0, u) = (SVector::from(X0), vector![U]);
    let mut erk = Erk::<Oscillator, Rk4>::new(Options::default()).unwrap();
    assert!(matches!(erk.solve(&x0, &u, H), Err(Error::ParametersNotSet)));
    assert!(matches!(erk.set_parameters(&vector![f64::NAN]), Err(Error::NonFiniteInput { .. })));
    assert!(matches!(erk.solve(&x0, &u, H), Err(Error::ParametersNotSet)));
    erk.set_parameters(&vector![P]).unwrap();
    let good = *erk.forward(&x0, &u, H).unwrap();

    let bad = vector![0.0, f64::NAN];
    assert!(matches!(
        erk.solve(&bad, &u, H),
        Err(Error::NonFiniteInput { argument: casados::error::Argument::X0, index: 1, .. })
    ));
    assert!(matches!(erk.forward(&x0, &u, f64::INFINITY), Err(Error::NonFiniteInput { .. })));
    assert!(matches!(erk.adjoint(&x0, &u, H, &bad), Err(Error::NonFiniteInput { .. })));
    assert!(matches!(erk.set_time(f64::NAN), Err(Error::NonFiniteInput { .. })));
    // (1 − x₀²) x₁ overflows in the model at the first stage.
    let huge = vector![1e200, 1e200];
    let error = erk.solve(&huge, &u, H).unwrap_err();
    let Error::NonFiniteModel { at, equation: 0, .. } = error else { panic!("{error}") };
    assert_eq!((at.step, at.stage), (0, 0));
    // The state overflows although the model does not: 1e10 after a step of 1e300.
    assert!(matches!(
        erk.solve(&vector![0.0, 1e10], &vector![0.0], 1e300),
        Err(Error::Overflow { step: 0, .. })
    ));
    assert_eq!(*erk.forward(&x0, &u, H).unwrap(), good);

    assert!(matches!(
        Erk::<Oscillator, Rk4>::new(Options { steps: 0, ..Default::default() }),
        Err(Error::InvalidOption { .. })
    ));
    // More memory than there is.
    let mut erk =
        Erk::<Oscillator, Rk4>::new(Options { steps: usize::MAX / 2, ..Default::default() }).unwrap();
    erk.set_parameters(&vector![P]).unwrap();
    assert!(matches!(erk.adjoint(&x0, &u, H, &x0), Err(Error::OutOfMemory { .. })));
}

#[test]
fn custom_tableau() {
    let tableau = <Rk4 as Method<4>>::TABLEAU;
    let own = Tableau::new(*tableau.a(), *tableau.b(), *tableau.c()).unwrap();
    let mut erk = Erk::<Oscillator, Custom<4>>::with_tableau(Options::default(), own).unwrap();
    let mut rk4 = Erk::<Oscillator, Rk4>::new(Options::default()).unwrap();
    erk.set_parameters(&vector![P]).unwrap();
    rk4.set_parameters(&vector![P]).unwrap();
    let (x0, u) = (SVector::from(X0), vector![U]);
    assert_eq!(erk.forward(&x0, &u, H).unwrap(), rk4.forward(&x0, &u, H).unwrap());

    let implicit = Tableau::new([[0.5]], [1.0], [0.5]).unwrap();
    assert!(matches!(
        Erk::<Oscillator, Custom<1>>::with_tableau(Options::default(), implicit),
        Err(Error::NotExplicit { stage: 0 })
    ));
}

#[test]
fn inline_memory() {
    let options = Options { steps: STEPS, ..Default::default() };
    let mut heap = Erk::<Oscillator, Rk4>::new(options).unwrap();
    let mut inline = Erk::<Oscillator, Rk4, f64, Inline<mode::Hessian, STEPS>>::inline(options).unwrap();
    heap.set_parameters(&vector![P]).unwrap();
    inline.set_parameters(&vector![P]).unwrap();
    let (x0, u, lambda) = (SVector::from(X0), vector![U], vector![0.9, -1.7]);
    assert_eq!(inline.hessian(&x0, &u, H, &lambda).unwrap(), heap.hessian(&x0, &u, H, &lambda).unwrap());
    assert_eq!(inline.adjoint(&x0, &u, H, &lambda).unwrap(), heap.adjoint(&x0, &u, H, &lambda).unwrap());
    assert_eq!(inline.forward(&x0, &u, H).unwrap(), heap.forward(&x0, &u, H).unwrap());

    let more = Options { steps: STEPS + 1, ..Default::default() };
    assert!(matches!(
        Erk::<Oscillator, Rk4, f64, Inline<mode::Nominal, STEPS>>::inline(more),
        Err(Error::InvalidOption { option: "steps", .. })
    ));
}

#[test]
fn single_precision() {
    let mut erk = Erk::<Oscillator, Rk4, f32>::new(Options { steps: STEPS, ..Default::default() }).unwrap();
    erk.set_parameters(&vector![P as f32]).unwrap();
    erk.set_time(T0 as f32).unwrap();
    let forward = erk.forward(&vector![X0[0] as f32, X0[1] as f32], &vector![U as f32], H as f32).unwrap();
    let (x, jacobian, _) = derivatives(&<Rk4 as Method<4>>::TABLEAU);
    // Some 100 roundings of 6e-8.
    for r in 0..2 {
        assert!((f64::from(forward.x[r]) - x[r]).abs() < 6e-6);
        assert!((f64::from(forward.dx_du[r]) - jacobian[(r, 2)]).abs() < 6e-6 * jacobian.amax().max(1.0));
    }
}
