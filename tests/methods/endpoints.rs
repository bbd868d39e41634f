//! The edges: no variables, no time, the end of a step, polynomials that are solved exactly.

use crate::system;
use casados::{
    Adaptive, AdaptiveOptions, DormandPrince8, Erk, Gauss, Irk, Method, Options, Radau, RadauIIA, Rk4, dae,
    ode,
};
use nalgebra::{SMatrix, SVector, vector};

system! {
    /// No state: `z + z³ = u`.
    Algebra [0, 1, 1, 0] S |v, f| {
        f[0] = v[0] + v[0] * v[0] * v[0] - v[1];
    }
}

#[dae]
fn cubic(xdot: f64, x: f64, z: f64, u: f64) -> [f64; 2] {
    [xdot + x * z, z - u * x * x]
}

#[ode]
fn lonely(x: f64) -> f64 {
    -x
}

/// A Jordan block: polynomials of degree three.
#[ode]
fn jordan(x: [f64; 4]) -> [f64; 4] {
    [x[1], x[2], x[3], 0.0]
}

/// `∫ t^p dt`
#[ode]
fn power(_x: f64, p: f64, t: f64) -> f64 {
    t.powf(p)
}

fn none() -> SVector<f64, 0> {
    SVector::zeros()
}

/// No states, no inputs, no time.
#[test]
fn t37_empty_models() {
    let mut irk = Irk::<Algebra, RadauIIA<2>>::new(Options::default()).expect("valid");
    let hessian = irk.hessian(&none(), &vector![10.0], 0.3, &none()).expect("a root");
    // 2 + 8 = 10, and dz/du = 1/(1 + 3 z²).
    assert!((hessian.z[0] - 2.0).abs() <= 4.0 * f64::EPSILON);
    assert!((hessian.dz_du[(0, 0)] * 13.0 - 1.0).abs() <= 8.0 * f64::EPSILON);
    assert_eq!((hessian.h_uu[(0, 0)], hessian.grad_u[0]), (0.0, 0.0));

    macro_rules! check {
        ($integrator:expr) => {
            let mut integrator = $integrator.expect("valid");
            let hessian = *integrator.hessian(&vector![0.7], &none(), 0.0, &vector![2.0]).expect("no time");
            assert_eq!((hessian.x, hessian.dx_dx0), (vector![0.7], vector![1.0]));
            assert_eq!((hessian.grad_x0, hessian.h_xx), (vector![2.0], vector![0.0]));
            assert_eq!(
                integrator.adjoint(&vector![0.7], &none(), 0.0, &vector![2.0]).expect("no time").grad_x0,
                vector![2.0]
            );
            assert_eq!(
                integrator.forward(&vector![0.7], &none(), 0.0).expect("no time").dx_dx0,
                vector![1.0]
            );
            assert_eq!(integrator.dense(0.0).expect("the start").x, vector![0.7]);
        };
    }
    check!(Irk::<Lonely, Gauss<1>>::new(Options::default()));
    check!(Irk::<Lonely, Gauss<4>>::new(Options { steps: 3, ..Default::default() }));
    check!(Irk::<Lonely, RadauIIA<3>>::new(Options::default()));
    check!(Adaptive::<Lonely, Radau>::new(AdaptiveOptions::default()));
    check!(Adaptive::<Lonely, DormandPrince8>::new(AdaptiveOptions::default()));
    let mut erk = Erk::<Lonely, Rk4>::new(Options { steps: 3, ..Default::default() }).expect("valid");
    let hessian = *erk.hessian(&vector![0.7], &none(), 0.0, &vector![2.0]).expect("no time");
    assert_eq!((hessian.x, hessian.dx_dx0, hessian.h_xx), (vector![0.7], vector![1.0], vector![0.0]));
}

/// At the end of a step `z` of Radau IIA satisfies its equation to rounding, whatever the step;
/// with Gauss methods it is the polynomial through the stages, of order `s`.
#[test]
fn t38_algebraic_states_at_the_end() {
    let u = 0.9;
    macro_rules! defects {
        ($method:ty, $h:expr) => {{
            let mut irk = Irk::<Cubic, $method>::new(Options::default()).expect("valid");
            let step = irk.solve(&vector![1.1], &vector![u], $h).expect("a step");
            (step.z[0] / (u * step.x[0] * step.x[0]) - 1.0).abs()
        }};
    }
    macro_rules! check {
        ($($s:literal)*) => {$(
            for h in [1e-3, 0.1, 1.0, 10.0] {
                // Newton's method is as exact as the largest stage.
                let defect = defects!(RadauIIA<$s>, h);
                assert!(defect <= 1e-14, "s = {}, h = {h}: {defect:e}", $s);
            }
            let [coarse, fine] = [defects!(Gauss<$s>, 0.08), defects!(Gauss<$s>, 0.04)];
            let slope = (coarse / fine).log2();
            // The defect of one step is the local error: of order s, and one more where it cancels.
            assert!($s > 5 || (($s as f64 - 0.3)..($s as f64 + 1.2)).contains(&slope), "s = {}: {slope} {coarse:e}", $s);
        )*};
    }
    check!(1 2 3 4 5 6 7 8 9);
}

/// The integral of a product of squares over `[0, 1]`, `∫ (t − 1)^r Π (t − c_i)² dt`, by the
/// formula of Gauss with nine nodes: exact to degree 17.
fn error_constant(nodes: &[f64], end: bool) -> f64 {
    let rule = <Gauss<9> as Method<9>>::TABLEAU;
    let terms = rule.c().iter().zip(rule.b()).map(|(t, b)| {
        let product: f64 = nodes.iter().map(|c| (t - c).powi(2)).product();
        b * product * if end { t - 1.0 } else { 1.0 }
    });
    terms.sum()
}

/// Polynomials of degree `p − 1` are integrated exactly, and `t^p` with the error of the formula.
#[test]
fn t40_exact_polynomials() {
    macro_rules! check {
        ($($method:ident $s:literal)*) => {$(
            let tableau = <$method<$s> as Method<$s>>::TABLEAU;
            let (p, radau) = (tableau.order(), tableau.is_stiffly_accurate());
            let mut irk = Irk::<Power, $method<$s>>::new(Options::default()).expect("valid");
            for degree in 0..=p {
                irk.set_parameters(&vector![degree as f64]).expect("finite");
                let x = irk.solve(&vector![0.0], &none(), 1.0).expect("an integral").x[0];
                let mut exact = 1.0 / (degree as f64 + 1.0);
                if degree == p {
                    let nodes = if radau { &tableau.c()[..$s - 1] } else { &tableau.c()[..] };
                    exact -= error_constant(nodes, radau);
                }
                assert!((x - exact).abs() <= 4.0 * f64::EPSILON, "{} t^{degree}: {:e}", tableau.name(), x - exact);
            }
            if p >= 3 {
                let mut irk = Irk::<Jordan, $method<$s>>::new(Options::default()).expect("valid");
                let step = irk.forward(&vector![1.0, -2.0, 3.0, 0.5], &none(), 1.0).expect("a polynomial");
                let (half, sixth) = (0.5, 1.0 / 6.0);
                let expected = vector![1.0 - 2.0 + 3.0 * half + 0.5 * sixth, -2.0 + 3.0 + 0.5 * half, 3.5, 0.5];
                // Terms up to three.
                assert!((step.x - expected).amax() <= 3.0 * 4.0 * f64::EPSILON, "{}", step.x - expected);
                let taylor = [1.0, 1.0, half, sixth];
                let expected = SMatrix::<f64, 4, 4>::from_fn(|i, j| if j >= i { taylor[j - i] } else { 0.0 });
                assert!((step.dx_dx0 - expected).amax() <= 4.0 * f64::EPSILON, "{}", step.dx_dx0 - expected);
            }
        )*};
    }
    check!(Gauss 1 Gauss 2 Gauss 3 Gauss 4 Gauss 5 Gauss 6 Gauss 7 Gauss 8);
    check!(RadauIIA 1 RadauIIA 2 RadauIIA 3 RadauIIA 4 RadauIIA 5 RadauIIA 6 RadauIIA 7 RadauIIA 8 RadauIIA 9);
}
