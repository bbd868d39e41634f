//! Covariances of estimates against dense normal equations on closed forms, and Monte Carlo.

use crate::Test;
use casados::ocp::{
    Covariance, Exact, GaussNewton, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem,
};
use casados::prelude::*;
use nalgebra::{DMatrix, SMatrix, SVector, U5};
use num_dual::{DualNum, DualSVec64};

/// A → B → C: x = [a, b, ln k₁, ln k₂, ln g]; p = [weight, value] of `g b`, then of `a`.
#[ode]
fn reaction(x: [f64; 5], _p: [f64; 4]) -> [f64; 5] {
    let [a, b, k1, k2, _] = x;
    let (first, second) = (k1.exp() * a, k2.exp() * b);
    [-first, first - second, 0.0, 0.0, 0.0]
}
#[function]
fn deviation(x: [f64; 5], p: [f64; 4]) -> [f64; 2] {
    [p[0] * (x[4].exp() * x[1] - p[1]), p[2] * (x[0] - p[3])]
}

type Vector = SVector<f64, 5>;
type Matrix = SMatrix<f64, 5, 5>;
type Seen = LeastSquaresCost<Deviation>;
type Estimation = HeapOcp<Problem<Irk<Reaction, Gauss<4>>, Seen, Seen>>;

const INTERVALS: usize = 20;
const SIGMA: [f64; 2] = [0.01, 0.02];

fn truth() -> Vector {
    Vector::from([1.3, 0.1, 0.15_f64.ln(), 0.06_f64.ln(), 0.8_f64.ln()])
}

type Dual = DualSVec64<5>;

/// The closed form of the states after a time, with derivatives by the first ones.
fn closed_form(x: &Vector, t: f64) -> [Dual; 5] {
    let [a, b, ln_k1, ln_k2, g] = [0, 1, 2, 3, 4].map(|i| Dual::from_re(x[i]).derivative(i));
    let (k1, k2) = (ln_k1.exp(), ln_k2.exp());
    let (first, second) = ((-k1 * t).exp(), (-k2 * t).exp());
    let made = a * k1 / (k2 - k1) * (first - second);
    [a * first, b * second + made, ln_k1, ln_k2, g]
}

fn derivatives(x: &Vector, t: f64) -> (Vector, Matrix) {
    let states = closed_form(x, t);
    let rows = Matrix::from_fn(|i, j| states[i].eps.unwrap_generic(U5, nalgebra::Const::<1>)[j]);
    (Vector::from_fn(|i, _| states[i].re), rows)
}

/// Times of nodes, and which of both instruments has a sample there.
fn time(k: usize) -> f64 {
    1.5 * k as f64
}
fn weights(k: usize, laboratory: bool) -> [f64; 2] {
    let second = laboratory && k % 7 == 2;
    [if k % 4 == 3 { 0.0 } else { 1.0 / SIGMA[0] }, if second { 1.0 / SIGMA[1] } else { 0.0 }]
}

fn problem() -> Result<Estimation, Box<dyn std::error::Error>> {
    Ok(Problem::new(Irk::<Reaction, Gauss<4>>::new(Options::default())?)
        .stage_cost(Seen::diagonal(&[1.0; 2]))
        .terminal_cost(Seen::diagonal(&[1.0; 2]))
        .on(Horizon::uniform(INTERVALS, time(1)))?)
}

/// The estimate from samples with these errors, and its covariance.
fn estimate(
    ocp: &mut Estimation,
    laboratory: bool,
    mut noise: impl FnMut() -> f64,
) -> Result<(Vector, Covariance<f64>), Box<dyn std::error::Error>> {
    for k in 0..=INTERVALS {
        let (x, _) = derivatives(&truth(), time(k));
        let [spectrometer, analysis] = weights(k, laboratory);
        let values = [x[4].exp() * x[1] + SIGMA[0] * noise(), x[0] + SIGMA[1] * noise()];
        ocp.set_parameters(k..=k, &[spectrometer, values[0], analysis, values[1]])?;
    }
    ocp.free_initial_state().guess(truth().as_slice(), &[])?.guess_by_simulation()?;
    let outcome = HeapSqp::new(ocp)?.gauss_newton().solve(ocp)?;
    if !outcome.is_converged() {
        return Err(outcome.to_string().into());
    }
    Ok((Vector::from_column_slice(ocp.stage(0)?.x), ocp.covariance(GaussNewton::default())?))
}

/// `(JᵀJ)⁻¹` by the closed form at an estimate.
fn normal_equations(x: &Vector, laboratory: bool) -> Result<Matrix, &'static str> {
    let mut information = Matrix::zeros();
    for k in 0..=INTERVALS {
        let (state, by_first) = derivatives(x, time(k));
        let [spectrometer, analysis] = weights(k, laboratory);
        let mut seen = state[4].exp() * by_first.row(1);
        seen[4] += state[4].exp() * state[1];
        information += spectrometer * spectrometer * seen.transpose() * seen;
        information += analysis * analysis * by_first.row(0).transpose() * by_first.row(0);
    }
    information.cholesky().map(|factors| factors.inverse()).ok_or("not definite")
}

const NAMES: [&str; 5] = ["x[0]", "x[1]", "x[2]", "x[3]", "x[4]"];

/// At the first and at the last stage, of all pairs of variables.
#[test]
fn covariance_of_normal_equations() -> Test {
    let mut ocp = problem()?;
    let mut k = 0.0;
    let noise = || {
        k += 1.0;
        f64::sin(7.0 * k)
    };
    let (x0, covariance) = estimate(&mut ocp, true, noise)?;
    assert!(covariance.is_identifiable(), "{:?}", covariance.unidentifiable());
    let dense = normal_equations(&x0, true)?;
    let (_, by_first) = derivatives(&x0, time(INTERVALS));
    let at_end = by_first * dense * by_first.transpose();
    for (stage, expected) in [(0, &dense), (INTERVALS, &at_end)] {
        for (i, a) in NAMES.iter().enumerate() {
            for (j, b) in NAMES.iter().enumerate() {
                let found = covariance.covariance((a, stage), (b, stage))?;
                let size = (expected[(i, i)] * expected[(j, j)]).sqrt();
                // Eight orders of the method with rates of 0.15 in steps of 1.5, 1e-9 of
                // sensitivities; 1e4 is the condition of the normal equations.
                assert!(
                    (found - expected[(i, j)]).abs() < 1e-5 * size,
                    "{stage} {a} {b}: {found} {expected}"
                );
            }
        }
    }
    // Twice the standard deviations of residuals.
    let scaled = covariance.clone().scaled(4.0);
    assert!((scaled.standard_deviation("x[2]", 0)? - 2.0 * dense[(2, 2)].sqrt()).abs() < 1e-5);
    assert!(matches!(covariance.variance("rate", 0), Err(OcpError::UnknownName { .. })));
    assert!(matches!(covariance.variance("x[0]", INTERVALS + 1), Err(OcpError::NoSuchStage { .. })));
    Ok(())
}

/// Of amounts and gain only products are seen: the direction is `δa/a = δb/b = −δ ln g`.
#[test]
fn unidentifiable_product() -> Test {
    let (x0, covariance) = estimate(&mut problem()?, false, || 0.0)?;
    let [direction] = covariance.unidentifiable() else {
        return Err(format!("{:?}", covariance.unidentifiable()).into());
    };
    let mut found = Vector::zeros();
    for &(name, stage, value) in &direction.parts {
        assert_eq!(stage, 0);
        found[NAMES.iter().position(|&known| known == name).ok_or("a state")?] = value;
    }
    let expected = Vector::from([1.0, x0[1] / x0[0], 0.0, 0.0, -1.0 / x0[0]]);
    // The gap to the next eigenvalue is 1e-4 at least, and sensitivities have nine digits.
    assert!((found - expected).amax() < 1e-4, "{direction}");
    for stage in [0, 5, INTERVALS] {
        for name in ["x[0]", "x[1]", "x[4]"] {
            assert!(
                matches!(covariance.variance(name, stage), Err(OcpError::NotIdentifiable { .. })),
                "{name}"
            );
        }
        for name in ["x[2]", "x[3]"] {
            let variance = covariance.variance(name, stage)?;
            assert!(variance > 0.0 && variance < 1.0, "{name}: {variance}");
        }
    }
    Ok(())
}

/// Estimates from other noise: `Σ (x₀ − x̂)ᵀ C⁻¹ (x₀ − x̂)` has the distribution χ² with five
/// degrees of freedom a repetition, but for what is not linear: noise of 1 % leaves that small.
#[test]
fn monte_carlo() -> Test {
    const REPETITIONS: usize = 120;
    let mut ocp = problem()?;
    let mut random = Random(3);
    let mut sum = 0.0;
    for _ in 0..REPETITIONS {
        let (x0, covariance) = estimate(&mut ocp, true, || random.normal())?;
        let mut matrix = Matrix::zeros();
        for (i, a) in NAMES.iter().enumerate() {
            for (j, b) in NAMES.iter().enumerate() {
                matrix[(i, j)] = covariance.covariance((a, 0), (b, 0))?;
            }
        }
        let error = x0 - truth();
        sum += error.dot(&(matrix.cholesky().ok_or("definite")?.inverse() * error));
    }
    let freedom = 5.0 * REPETITIONS as f64;
    // Four standard deviations of χ², √(2 · 600) each: 23 %.
    assert!((sum - freedom).abs() < 4.0 * (2.0 * freedom).sqrt(), "{sum} of {freedom}");
    Ok(())
}

/// SplitMix (Steele, Lea, Flood 2014), and sums of twelve.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

#[function]
fn walk(x: f64, u: f64) -> f64 {
    x + u
}
#[function]
fn step(x: f64, u: f64) -> [f64; 2] {
    [2.0 * (x - 1.0), 3.0 * u]
}
#[function]
fn last(x: f64, _u: f64) -> f64 {
    2.0 * (x - 1.0)
}

/// Controls are disturbances: the smoother of a random walk, whose information is a matrix of three
/// diagonals. Of a first state that is bounded to a value nothing is uncertain.
#[test]
fn smoother_of_a_random_walk() -> Test {
    const N: usize = 5;
    let mut ocp = Problem::new(Map::<Walk, f64>::new())
        .stage_cost(LeastSquaresCost::<Step>::diagonal(&[1.0; 2]))
        .terminal_cost(LeastSquaresCost::<Last>::diagonal(&[1.0]))
        .on(Horizon::uniform(N, 1.0))?;
    ocp.free_initial_state().guess(&[1.0], &[0.0])?;
    let mut information = DMatrix::<f64>::zeros(N + 1, N + 1);
    for k in 0..=N {
        information[(k, k)] += 4.0;
        if k < N {
            for (i, j, sign) in [(k, k, 1.0), (k + 1, k + 1, 1.0), (k, k + 1, -1.0), (k + 1, k, -1.0)] {
                information[(i, j)] += 9.0 * sign;
            }
        }
    }
    let dense = information.clone().cholesky().ok_or("definite")?.inverse();
    let covariance = ocp.covariance(GaussNewton::default())?;
    for i in 0..=N {
        for j in 0..=N {
            let found = covariance.covariance(("x", i), ("x", j))?;
            // Roundings of a well-conditioned matrix of six.
            assert!((found - dense[(i, j)]).abs() < 1e-13, "{i} {j}: {found} {}", dense[(i, j)]);
        }
    }
    ocp.bound("x", ..=0, 1.0, 1.0)?;
    let rest = information.remove_row(0).remove_column(0);
    let dense = rest.cholesky().ok_or("definite")?.inverse();
    let covariance = ocp.covariance(Exact::default())?;
    assert!(covariance.is_identifiable() && covariance.variance("x", 0)? < 1e-25);
    assert!((covariance.variance("x", N)? - dense[(N - 1, N - 1)]).abs() < 1e-13);
    Ok(())
}

/// Only the product of two parameters is measured.
#[function]
fn stays(x: [f64; 3]) -> [f64; 3] {
    x
}
#[function]
fn product(x: [f64; 3]) -> [f64; 2] {
    [10.0 * (x[0] - 1.0), 10.0 * (x[1] * x[2] - 2.0)]
}

/// Four samples with a standard deviation of 0.1: the mean has 0.05.
#[test]
fn estimates_as_a_table() -> Test {
    let cost = || LeastSquaresCost::<Product>::diagonal(&[1.0; 2]);
    let problem = Problem::new(Map::<Stays, f64>::new()).stage_cost(cost()).terminal_cost(cost());
    let mut ocp = problem.on(Horizon::uniform(3, 1.0))?;
    ocp.free_initial_state().guess(&[1.0, 2.0, 1.0], &[])?;
    let text = ocp.covariance(GaussNewton::default())?.to_string();
    let seen = "x[0]  1.0000e0 ± 5.00e-2              1.0000e0 ± 5.00e-2";
    let unseen = "x[1]  2.0000e0 ± not identifiable     2.0000e0 ± not identifiable";
    let lines: Vec<_> = text.lines().map(str::trim_end).collect();
    assert_eq!(lines[1..3], [seen, unseen], "{text}");
    assert_eq!(lines.last(), Some(&"not identifiable: +1.00 x[1] -0.50 x[2]"), "{text}");
    Ok(())
}
