//! Convex functions of residuals: closed forms, the same functions written out, other Hessians.

use crate::Test;
use casados::ocp::{
    Convex, ConvexCost, Convexification, Exact, GaussNewton, GeneralCost, HeapOcp, HeapSqp, Horizon, Huber,
    LeastSquaresCost, Map, OcpError, Problem, PseudoHuber, SolutionFactors,
};
use casados::prelude::*;

const EXACT: Exact = Exact { convexification: Convexification::None };
const GAUSS_NEWTON: GaussNewton = GaussNewton { convexification: Convexification::None };

#[function]
fn turn(x: [f64; 2], u: [f64; 1], _p: [f64; 1]) -> [f64; 2] {
    [x[0] + 0.1 * x[1], x[1] - 0.1 * x[0].sin() + 0.1 * u[0]]
}

/// The distance of a datum `p` from the angle, and a disturbance.
#[function]
fn distance(x: [f64; 2], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
    [x[0] - p[0], 3.0 * u[0]]
}

const DELTA: f64 = 0.05;

/// `½ ψ(r)² = δ² (√(1 + (r/δ)²) − 1)`, as a least-squares residual.
#[function]
fn root(x: [f64; 2], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
    let r = x[0] - p[0];
    let a = r / DELTA;
    [r * (2.0 / (1.0 + (1.0 + a * a).sqrt())).sqrt(), 3.0 * u[0]]
}

const N: usize = 30;

/// Data far from each other beside `δ`: more than half of all forces are those of outliers.
fn datum(k: usize) -> f64 {
    let noise = (12.9898 * k as f64 + 1.0).sin() * 43758.5453;
    let noise = noise - noise.floor() - 0.5;
    0.5 * (0.1 * k as f64).cos() + 0.6 * noise
}

/// A square loss of disturbances, as that of Huber with a `δ` that is never reached.
const SQUARE_LOSS_DELTA: PseudoHuber<f64, 2> = PseudoHuber { weights: [1.0, 1.0], delta: [DELTA, 1e6] };

macro_rules! estimation {
    ($cost:expr) => {{
        let mut ocp = Problem::new(Map::<Turn, f64>::new()).stage_cost($cost).on(Horizon::uniform(N, 0.1))?;
        ocp.free_initial_state().guess(&[0.0; 2], &[0.0])?;
        for k in 0..N {
            ocp.set_parameters(k..=k, &[datum(k)])?;
        }
        ocp.set_parameters(N..=N, &[0.0])?;
        ocp
    }};
}

fn states<P: casados::ocp::Formulation<f64>>(ocp: &HeapOcp<P>) -> Vec<f64> {
    ocp.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()).collect()
}

/// Least squares of the root of a pseudo-Huber cost have too much curvature where residuals are
/// large, and converge slowly; `Jᵀ φ″ J` has what there is.
#[test]
fn generalised_gauss_newton() -> Test {
    let mut convex = estimation!(ConvexCost::<Distance, _>::new(SQUARE_LOSS_DELTA));
    let mut sqp = HeapSqp::new(&convex)?.gauss_newton();
    (sqp.options.tolerance, sqp.options.max_iterations) = (1e-8, 500);
    let fast = sqp.solve(&mut convex)?;
    println!("{}{fast}", sqp.log());
    let mut plain = estimation!(LeastSquaresCost::<Root>::diagonal(&[1.0, 1.0]));
    let mut sqp = HeapSqp::new(&plain)?.gauss_newton();
    (sqp.options.tolerance, sqp.options.max_iterations) = (1e-8, 500);
    let slow = sqp.solve(&mut plain)?;
    println!("{}{slow}", sqp.log());
    assert!(fast.is_converged() && slow.is_converged());
    // Both objectives are one, and gradients are 1e-8 over curvatures of 1e-2 at least.
    assert!((fast.objective - slow.objective).abs() < 1e-9);
    let worst = states(&convex).iter().zip(&states(&plain)).fold(0.0_f64, |w, (a, b)| w.max((a - b).abs()));
    assert!(worst < 1e-5, "{worst}");
    assert!(3 * fast.iterations <= slow.iterations, "{} {}", fast.iterations, slow.iterations);
    Ok(())
}

/// With a parameter in residuals, and a reference.
#[function]
fn residual(x: [f64; 2], u: [f64; 1], p: [f64; 1]) -> [f64; 2] {
    [x[0] * x[1] - p[0] * p[0], u[0] + p[0] * x[0].sin()]
}

/// The pseudo-Huber cost of [`residual`] with the reference (0.3, −0.2), written out.
#[function]
fn written(x: [f64; 2], u: [f64; 1], p: [f64; 1]) -> f64 {
    let (a, b) = (x[0] * x[1] - p[0] * p[0] - 0.3, u[0] + p[0] * x[0].sin() + 0.2);
    let f = |r: f64, w: f64, d: f64| w * d * d * ((1.0 + (r / d) * (r / d)).sqrt() - 1.0);
    f(a, 2.0, 0.5) + f(b, 0.7, 0.3)
}

/// A coupled function: `ln Σ exp r`.
struct LogSumExp;

impl Convex<f64> for LogSumExp {
    fn evaluate(&self, r: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
        let sum: f64 = r.iter().map(|r| r.exp()).sum();
        for (i, (slope, r)) in gradient.iter_mut().zip(r).enumerate() {
            *slope = r.exp() / sum;
            hessian[i * matrix_side(hessian.len()) + i] = *slope;
        }
        for (i, a) in gradient.iter().enumerate() {
            for (j, b) in gradient.iter().enumerate() {
                hessian[i * gradient.len() + j] -= a * b;
            }
        }
        sum.ln()
    }
}

/// The side of a square matrix with so many elements.
fn matrix_side(elements: usize) -> usize {
    (1..).find(|n| n * n >= elements).unwrap_or(1)
}

#[function]
fn written_sum(x: [f64; 2], u: [f64; 1], p: [f64; 1]) -> f64 {
    let (a, b) = (x[0] * x[1] - p[0] * p[0] - 0.3, u[0] + p[0] * x[0].sin() + 0.2);
    (a.exp() + b.exp()).ln()
}

/// Value, gradient, Hessian, and what parameters change, are those of the same function written
/// out, with exact derivatives by the macro.
#[test]
fn derivatives_of_convex_costs() -> Test {
    macro_rules! all {
        ($cost:expr, $references:expr) => {{
            let mut ocp =
                Problem::new(Map::<Turn, f64>::new()).running_cost($cost).on(Horizon::uniform(3, 0.5))?;
            ocp.fix_initial_state(&[0.7, 0.4])?.guess(&[0.7, 0.4], &[0.3])?.set_parameters(.., &[0.6])?;
            if $references {
                ocp.set_reference(.., &[0.3, -0.2])?;
            }
            ocp.linearise(EXACT)?;
            let mut data = vec![ocp.residuals().1];
            for stage in ocp.qp().stages() {
                for (block, symmetric) in [(stage.q(), true), (stage.r(), true), (stage.s(), false)] {
                    let (rows, columns) = block.shape();
                    for i in 0..rows {
                        let here = (0..columns).filter(|&j| !symmetric || j <= i);
                        data.extend(here.filter_map(|j| block.get(i, j)));
                    }
                }
                data.extend([stage.gradient_x(), stage.gradient_u()].concat());
            }
            // Where it is no solution these are numbers without a meaning, but the same ones.
            let mut factors = SolutionFactors::new(&ocp)?;
            ocp.factorise(EXACT, &mut factors)?;
            data.extend([factors.value_gradient_x0(), factors.value_gradient_p()].concat());
            let hessian = factors.value_hessian();
            data.extend([hessian.xx, hessian.xp, hessian.pp].concat());
            data
        }};
    }
    let huber = PseudoHuber { weights: [2.0, 0.7], delta: [0.5, 0.3] };
    let pairs = [
        (all!(ConvexCost::<Residual, _>::new(huber), true), all!(GeneralCost::<Written>::new(), false)),
        (
            all!(ConvexCost::<Residual, _>::new(LogSumExp), true),
            all!(GeneralCost::<WrittenSum>::new(), false),
        ),
    ];
    for (a, b) in pairs {
        assert_eq!(a.len(), b.len());
        assert!(a.iter().filter(|a| a.abs() > 1e-3).count() > a.len() / 2);
        for (i, (a, b)) in a.iter().zip(&b).enumerate() {
            // Some ten operations on numbers of size one, and quotients by pivots of 0.1.
            assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{i} {a} {b}");
        }
    }
    Ok(())
}

#[function]
fn stays(x: f64, _u: f64) -> f64 {
    x
}
#[function]
fn state(x: f64, _u: f64) -> f64 {
    x
}
#[function]
fn both(x: f64, u: f64) -> [f64; 2] {
    [x, u]
}

fn location<C: Convex<f64>>(stage: C, last: C1) -> Result<HeapOcp<Location<C>>, OcpError> {
    let problem = Problem::new(Map::<Stays, f64>::new())
        .stage_cost(ConvexCost::<Both, _>::new(stage))
        .terminal_cost(ConvexCost::<State, _>::new(last));
    let mut ocp = problem.on(Horizon::uniform(3, 1.0))?;
    ocp.free_initial_state().guess(&[0.0], &[0.0])?;
    for (k, data) in [0.0, 0.2, 0.4].into_iter().enumerate() {
        ocp.set_reference(k..=k, &[data, 0.0])?;
    }
    ocp.set_terminal_reference(&[10.0])?;
    Ok(ocp)
}
type C1 = Huber<f64, 1>;
type Location<C> = Problem<Map<Stays, f64>, ConvexCost<Both, C>, ConvexCost<State, C1>>;

/// Huber's estimate of a location: of data 0, 0.2, 0.4 and 10 the last one pulls with `w δ` alone,
/// `3 x = 0.6 + w δ`. Mistakes have names.
#[test]
fn huber_estimate_with_an_outlier() -> Test {
    let stage = Huber { weights: [1.0, 1.0], delta: [1.0, 1.0] };
    for (weight, delta) in [(1.0, 1.0), (2.0, 0.25), (0.0, 1.0)] {
        let mut ocp = location(stage, Huber { weights: [weight], delta: [delta] })?;
        for exact in [false, true] {
            ocp.guess(&[0.0], &[0.0])?;
            let outcome = match exact {
                true => HeapSqp::new(&ocp)?.solve(&mut ocp)?,
                false => HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?,
            };
            assert!(outcome.is_converged(), "{outcome}");
            // Stationarity of 1e-6 over a curvature of three.
            assert!((ocp.stage(0)?.x[0] - (0.6 + weight * delta) / 3.0).abs() < 1e-6);
        }
    }
    for (weight, delta) in [(-1.0, 1.0), (f64::NAN, 1.0), (1.0, 0.0), (1.0, -1.0), (1.0, f64::NAN)] {
        let refused = location(stage, Huber { weights: [weight], delta: [delta] });
        assert!(matches!(refused, Err(OcpError::InvalidWeight { function: "State", outputs: [0, 0], .. })));
    }
    // A function that is not convex says so where it is not.
    struct Concave;
    impl Convex<f64> for Concave {
        fn evaluate(&self, r: &[f64], gradient: &mut [f64], hessian: &mut [f64]) -> f64 {
            gradient[1] = -2.0 * r[1];
            hessian[3] = -2.0;
            -r[1] * r[1]
        }
    }
    let mut ocp = location(Concave, Huber { weights: [1.0], delta: [1.0] })?;
    let refused = ocp.linearise(GAUSS_NEWTON);
    assert!(matches!(refused, Err(OcpError::InvalidWeight { function: "Both", outputs: [1, 1], .. })));
    Ok(())
}
