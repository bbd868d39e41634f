//! Derivatives of adaptive runs: against the references of the IVP set, against each other, and as
//! those of one smooth function.

use casados::shape::Shape;
use casados::{
    Adaptive, AdaptiveOptions, Crossing, Dae, DormandPrince5, DormandPrince8, Error, Event, Gauss, Hybrid,
    Piecewise, Radau, RadauIIA,
};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

mod data;
#[path = "../examples/models/ivp/mod.rs"]
mod models;

use data::Record;
use models::chemistry::{AkzoNobel, Oregonator, Robertson};
use models::oscillators::{VanDerPol, VanDerPolScaled};

fn problem(name: &str) -> (Vec<f64>, Vec<f64>) {
    // Of this one there are derivatives only.
    if name == "van_der_pol_5" {
        return (vec![2.0, 0.0], vec![5.0]);
    }
    let set = Record::load("ivp/ends.json").expect("the reference is there");
    let record = set.record(name).expect("a problem");
    (record.list("x0").expect("x0"), record.list("p").expect("p"))
}

/// References of this order whose name is this.
fn references(order: &str, name: &str) -> Vec<Record> {
    let set = Record::load("ivp/sensitivities.json").expect("the reference is there");
    let mut records = set.records(order).expect("references");
    records.retain(|record| record.text("name").is_ok_and(|found| found == name));
    assert!(!records.is_empty());
    records
}

fn integrator<M, const NP: usize>(p: &[f64], rtol: f64, atol: f64) -> Adaptive<M, Radau>
where
    M: Dae,
    M::Shape: Shape<VectorP<f64> = SVector<f64, NP>>,
{
    let options = AdaptiveOptions { rtol, atol, ..Default::default() };
    let mut adaptive = Adaptive::<M, Radau>::new(options).expect("valid");
    adaptive.set_parameters(&SVector::from_column_slice(p)).expect("finite");
    adaptive
}

/// First derivatives by `(x₀, p)`; rows of `z` below those of `x`.
macro_rules! first {
    ($model:ty, $name:literal, $nx:literal, $nz:literal, $np:literal, $rtol:expr, $atol:expr, $controlled:expr, $bound:expr) => {
        let (x0, p) = problem($name);
        let mut before = SVector::<f64, { $nx + $np }>::zeros();
        for reference in references("first", $name) {
            let mut adaptive = integrator::<$model, $np>(&p, $rtol, $atol);
            adaptive.control_sensitivities($controlled).expect("memory");
            let t = reference.number("t").expect("t");
            let x0 = SVector::<f64, $nx>::from_column_slice(&x0);
            let result = adaptive.forward(&x0, &SVector::zeros(), t).expect("derivatives");
            let rows = $nx + $nz;
            let mut found = DMatrix::zeros(rows, $nx + $np);
            found.view_mut((0, 0), ($nx, $nx)).copy_from(&result.dx_dx0);
            found.view_mut((0, $nx), ($nx, $np)).copy_from(&result.dx_dp);
            found.view_mut(($nx, 0), ($nz, $nx)).copy_from(&result.dz_dx0);
            found.view_mut(($nx, $nx), ($nz, $np)).copy_from(&result.dz_dp);
            let list = |key, columns| {
                DMatrix::from_row_slice(
                    rows,
                    columns,
                    &reference.numbers(key, rows * columns).expect("a matrix"),
                )
            };
            let mut expected = DMatrix::zeros(rows, $nx + $np);
            expected.view_mut((0, 0), (rows, $nx)).copy_from(&list("dx_dx0", $nx));
            expected.view_mut((0, $nx), (rows, $np)).copy_from(&list("dx_dp", $np));
            for (column, before) in before.iter_mut().enumerate() {
                let size = expected.column(column).norm();
                let error = (found.column(column) - expected.column(column)).norm();
                *before = size.max(*before);
                let bound = $bound * size + 1300.0 * f64::EPSILON * *before;
                println!("{} at {t:e}, column {column}: {:e}", $name, error / size);
                assert!(error <= bound, "{} at {t:e}, column {column}: {error:e} of {size:e}", $name);
            }
            for (column, magnitude) in p.iter().enumerate() {
                found.column_mut($nx + column).scale_mut(*magnitude);
                expected.column_mut($nx + column).scale_mut(*magnitude);
            }
            for row in 0..rows {
                let size = expected.row(row).amax();
                let error = (found.row(row) - expected.row(row)).amax();
                println!("{} at {t:e}, row {row}: {:e}", $name, error / size);
                assert!(error <= $bound * size, "{} at {t:e}, row {row}: {error:e} of {size:e}", $name);
            }
        }
    };
}

/// At a tight tolerance the discrete map is the flow, and so are their derivatives: column by
/// column, and row by row with parameters in units of their own, since Robertson's smallest
/// component is 1e-13 of the largest and its derivatives keep their digits. A column that decays
/// keeps the rounding errors of each of 130 steps, of ten terms each, from when it was large: those
/// of Robertson's rates fall by a factor of four million, while what rounding does to the mass
/// stays. Where derivatives move otherwise than states they take part in the choice of the steps:
/// those of the Oregonator are 8e-11 off without, 6e-14 with it.
///
/// Those of Van der Pol grow by a million in the jump between the slow branches, with the velocity,
/// and shrink again where it ends: rounding errors from the middle stay. What they do at the end is
/// at most `ε Σ_n |∂x(T)/∂x(t_n)| |∂x(t_n)/∂x₀|`, summed over the steps `2.0e7 ε = 4.5e-9` of the
/// derivative itself, and 1.4e6 ε for the worst of them; no order of the products avoids it,
/// forwards or backwards. In binary128, where nothing but states and derivatives at the ends of
/// these steps is rounded to doubles, they are 1.4e-10 to 8.0e-10 off (twenty draws of the rounding
/// errors).
#[test]
fn t14_first_order() {
    first!(Robertson, "robertson", 3, 0, 3, 1e-12, 1e-20, false, 1e-12);
    first!(AkzoNobel, "akzo_nobel", 5, 1, 9, 1e-12, 1e-16, false, 1e-12);
    first!(Oregonator, "oregonator", 3, 0, 4, 1e-13, 1e-14, true, 1e-12);
    first!(VanDerPol, "van_der_pol_1e3", 2, 0, 1, 1e-13, 1e-16, false, 4e-9);
    first!(VanDerPolScaled, "van_der_pol_scaled_1e-6", 2, 0, 1, 1e-13, 1e-13, false, 4e-9);
}

/// The gradient and the Hessian over `(x₀, p)` of `λᵀx`.
fn second<M, const NX: usize, const NP: usize>(
    adaptive: &mut Adaptive<M, Radau>,
    x0: &SVector<f64, NX>,
    t: f64,
    lambda: &SVector<f64, NX>,
) -> (DVector<f64>, DMatrix<f64>)
where
    M: Dae,
    M::Shape: Shape<
            VectorX<f64> = SVector<f64, NX>,
            VectorU<f64> = SVector<f64, 0>,
            VectorP<f64> = SVector<f64, NP>,
            MatrixXX<f64> = SMatrix<f64, NX, NX>,
            MatrixXP<f64> = SMatrix<f64, NX, NP>,
            MatrixPP<f64> = SMatrix<f64, NP, NP>,
        >,
{
    let result = adaptive.hessian(x0, &SVector::zeros(), t, lambda).expect("second derivatives");
    let mut gradient = DVector::zeros(NX + NP);
    gradient.rows_mut(0, NX).copy_from(&result.grad_x0);
    gradient.rows_mut(NX, NP).copy_from(&result.grad_p);
    let mut hessian = DMatrix::zeros(NX + NP, NX + NP);
    hessian.view_mut((0, 0), (NX, NX)).copy_from(&result.h_xx);
    hessian.view_mut((0, NX), (NX, NP)).copy_from(&result.h_xp);
    hessian.view_mut((NX, 0), (NP, NX)).copy_from(&result.h_xp.transpose());
    hessian.view_mut((NX, NX), (NP, NP)).copy_from(&result.h_pp);
    (gradient, hessian)
}

fn expected(reference: &Record, n: usize) -> (DVector<f64>, DMatrix<f64>) {
    let gradient = DVector::from_vec(reference.numbers("gradient", n).expect("a gradient"));
    let hessian = DMatrix::from_row_slice(n, n, &reference.numbers("hessian", n * n).expect("a Hessian"));
    (gradient, hessian)
}

/// Elements relative to the geometric mean of the diagonal, as parameters have very different
/// units.
fn close(found: &DMatrix<f64>, expected: &DMatrix<f64>, bound: f64) {
    let scale = |i: usize| expected.row(i).amax();
    for i in 0..expected.nrows() {
        for j in 0..expected.ncols() {
            let error = (found[(i, j)] - expected[(i, j)]).abs();
            let size = scale(i).min(scale(j));
            assert!(error <= bound * size, "({i}, {j}): {} instead of {}", found[(i, j)], expected[(i, j)]);
        }
    }
}

macro_rules! second_order {
    ($model:ty, $name:literal, $nx:literal, $np:literal, $rtol:expr, $atol:expr, $controlled:expr, $bound:expr) => {
        let (x0, p) = problem($name);
        for reference in references("second", $name) {
            let mut adaptive = integrator::<$model, $np>(&p, $rtol, $atol);
            adaptive.control_sensitivities($controlled).expect("memory");
            let t = reference.number("t").expect("t");
            let lambda = reference.vector("lambda").expect("lambda");
            let (gradient, hessian) =
                second::<$model, $nx, $np>(&mut adaptive, &SVector::from_column_slice(&x0), t, &lambda);
            let (expected_gradient, expected_hessian) = expected(&reference, $nx + $np);
            for (found, expected) in gradient.iter().zip(&expected_gradient) {
                assert!((found - expected).abs() <= $bound * expected.abs(), "{}: {found} {expected}", $name);
            }
            assert_eq!(hessian, hessian.transpose());
            close(&hessian, &expected_hessian, $bound);
        }
    };
}

/// Relative to the larger of row and column. Those of Van der Pol's equation, which grow in its
/// jumps, are 7e-10 off where steps are chosen for the states alone, and 1.5e-12 where derivatives
/// take part.
#[test]
fn t17_second_order() {
    second_order!(Robertson, "robertson", 3, 3, 1e-12, 1e-20, false, 1e-10);
    second_order!(Oregonator, "oregonator", 3, 4, 1e-13, 1e-14, false, 1e-10);
    second_order!(VanDerPol, "van_der_pol_5", 2, 1, 1e-13, 1e-13, true, 1e-10);
}

/// The reference has the algebraic state in its sum: `y6 = Ks y1 y4`, whose derivatives follow by
/// the product rule.
#[test]
fn second_order_of_a_product() {
    let (x0, p) = problem("akzo_nobel");
    let reference = references("second", "akzo_nobel").remove(0);
    let mut adaptive = integrator::<AkzoNobel, 9>(&p, 1e-12, 1e-16);
    let t = reference.number("t").expect("t");
    let x0 = SVector::<f64, 5>::from_column_slice(&x0);
    let forward = *adaptive.forward(&x0, &SVector::zeros(), t).expect("derivatives");
    let (y1, y4, solubility, index) = (forward.x[0], forward.x[3], p[6], 5 + 6);
    let mut lambda = SVector::<f64, 5>::repeat(1.0);
    lambda[0] += solubility * y4;
    lambda[3] += solubility * y1;
    let row = |i: usize| {
        let columns = forward.dx_dx0.row(i).iter().chain(forward.dx_dp.row(i).iter()).copied().collect();
        DVector::from_vec(columns)
    };
    let (d1, d4) = (row(0), row(3));
    let mut unit = DVector::zeros(14);
    unit[index] = 1.0;
    let (mut gradient, mut hessian) = second::<AkzoNobel, 5, 9>(&mut adaptive, &x0, t, &lambda);
    gradient += &unit * (y1 * y4);
    let product = &d1 * y4 + &d4 * y1;
    hessian += (&d1 * d4.transpose() + &d4 * d1.transpose()) * solubility;
    hessian += &unit * product.transpose() + &product * unit.transpose();
    let (expected_gradient, expected_hessian) = expected(&reference, 14);
    for (found, expected) in gradient.iter().zip(&expected_gradient) {
        assert!((found - expected).abs() <= 1e-9 * expected.abs(), "{found} {expected}");
    }
    close(&hessian, &expected_hessian, 1e-10);
}

/// All derivatives at a coarse tolerance are those of one discrete map, exactly: the adjoint is the
/// product with the forward derivatives, and both follow the frozen map by complex or real
/// differences.
#[test]
fn derivatives_of_the_frozen_map() {
    let (x0, p) = problem("akzo_nobel");
    let x0 = SVector::<f64, 5>::from_column_slice(&x0) + SVector::repeat(0.01);
    let (u, t) = (SVector::zeros(), 20.0);
    let mut adaptive = integrator::<AkzoNobel, 9>(&p, 1e-4, 1e-8);
    let lambda = SVector::<f64, 5>::from([1.0, -2.0, 0.5, 3.0, 1.5]);
    let run = *adaptive.hessian(&x0, &u, t, &lambda).expect("second derivatives");
    adaptive.freeze().expect("steps are remembered");
    let times: Vec<f64> = adaptive.times().collect();
    assert!(times.len() > 5);
    // Before, each step was taken from where the run was, which had solved its equations to a part
    // of the tolerance.
    let hessian = *adaptive.hessian(&x0, &u, t, &lambda).expect("second derivatives");
    for (run, frozen) in [
        (run.grad_x0.as_slice(), &hessian.grad_x0.as_slice()),
        (run.grad_p.as_slice(), &hessian.grad_p.as_slice()),
    ] {
        let size = frozen.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        assert!(run.iter().zip(*frozen).all(|(a, b)| (a - b).abs() <= 1e-4 * size));
    }

    // Rounding of Newton's method, ε, times the condition of sums of a few dozen terms.
    let forward = *adaptive.forward(&x0, &u, t).expect("derivatives");
    let adjoint = *adaptive.adjoint(&x0, &u, t, &lambda).expect("a gradient");
    let same = |a: f64, b: f64, size: f64| assert!((a - b).abs() <= 1e-12 * size, "{a} {b}");
    for w in 0..5 {
        let column = forward.dx_dx0.column(w);
        let size = column.component_mul(&lambda).abs().sum();
        same(adjoint.grad_x0[w], lambda.dot(&column), size);
        same(hessian.grad_x0[w], adjoint.grad_x0[w], size);
    }
    for w in 0..9 {
        let column = forward.dx_dp.column(w);
        let size = column.component_mul(&lambda).abs().sum();
        same(adjoint.grad_p[w], lambda.dot(&column), size);
        same(hessian.grad_p[w], adjoint.grad_p[w], size);
    }

    // Central differences of the frozen map: the error is δ² times a third derivative, and ε/δ.
    let delta = 1e-4;
    for w in 0..5 {
        let mut step = SVector::<f64, 5>::zeros();
        step[w] = delta * x0[w];
        let above = *adaptive.hessian(&(x0 + step), &u, t, &lambda).expect("the frozen map");
        assert_eq!(adaptive.times().collect::<Vec<_>>(), times);
        let below = *adaptive.hessian(&(x0 - step), &u, t, &lambda).expect("the frozen map");
        let width = 2.0 * step[w];
        let difference = (above.x - below.x) / width;
        let error = (difference - forward.dx_dx0.column(w)).amax();
        assert!(error <= 1e-6 * forward.dx_dx0.column(w).amax(), "x0[{w}]: {error:e}");
        let error = ((above.z - below.z) / width - forward.dz_dx0.column(w)).amax();
        assert!(error <= 1e-6 * forward.dz_dx0.column(w).amax().max(1e-3), "x0[{w}]: {error:e} of z");
        let difference = (above.z0 - below.z0) / width;
        let error = (difference - forward.dz0_dx0.column(w)).amax();
        assert!(error <= 1e-6 * forward.dz0_dx0.column(w).amax().max(1e-3), "x0[{w}]: {error:e} of z0");
        let difference = (above.grad_x0 - below.grad_x0) / width;
        let error = (difference - hessian.h_xx.column(w)).amax();
        assert!(error <= 1e-5 * hessian.h_xx.amax(), "x0[{w}]: {error:e} of the gradient");
        let difference = (above.grad_p - below.grad_p) / width;
        let error = (difference - hessian.h_xp.row(w).transpose()).amax();
        assert!(error <= 1e-5 * hessian.h_xp.amax(), "x0[{w}]: {error:e} of the gradient by p");
    }

    // Another interval is not that of the steps.
    assert!(matches!(adaptive.solve(&x0, &u, 21.0), Err(Error::OutsideInterval { .. })));
    adaptive.thaw();
    assert!(adaptive.solve(&x0, &u, 21.0).is_ok());
}

/// The same of an explicit pair: adjoint and forward derivatives agree, and follow the frozen map.
#[test]
fn derivatives_of_frozen_explicit_steps() {
    let x0 = SVector::from([2.0, 0.5]);
    let (u, t, lambda) = (SVector::zeros(), 3.0, SVector::from([1.0, -2.0]));
    let options = AdaptiveOptions { rtol: 1e-5, atol: 1e-5, ..Default::default() };
    let mut adaptive = Adaptive::<VanDerPol, DormandPrince5>::new(options).expect("valid");
    adaptive.set_parameters(&SVector::from([2.0])).expect("finite");
    let solved = *adaptive.solve(&x0, &u, t).expect("a solution");
    let hessian = *adaptive.hessian(&x0, &u, t, &lambda).expect("second derivatives");
    // The steps are explicit: taking them again gives the same, but for the order of sums.
    assert!((solved.x - hessian.x).amax() <= 1e-13);
    adaptive.freeze().expect("steps are remembered");
    let adjoint = *adaptive.adjoint(&x0, &u, t, &lambda).expect("a gradient");
    assert!((adjoint.grad_x0 - hessian.dx_dx0.transpose() * lambda).amax() <= 1e-12 * hessian.dx_dx0.amax());
    assert!((adjoint.grad_p - hessian.dx_dp.transpose() * lambda).amax() <= 1e-12 * hessian.dx_dp.amax());
    let delta = 1e-5;
    for w in 0..2 {
        let mut step = SVector::<f64, 2>::zeros();
        step[w] = delta;
        let above = *adaptive.adjoint(&(x0 + step), &u, t, &lambda).expect("the frozen map");
        let below = *adaptive.adjoint(&(x0 - step), &u, t, &lambda).expect("the frozen map");
        let error = ((above.x - below.x) / (2.0 * delta) - hessian.dx_dx0.column(w)).amax();
        assert!(error <= 1e-7 * hessian.dx_dx0.amax(), "{error:e}");
        let error = ((above.grad_x0 - below.grad_x0) / (2.0 * delta) - hessian.h_xx.column(w)).amax();
        assert!(error <= 1e-6 * hessian.h_xx.amax(), "{error:e}");
    }
}

/// At any tolerance derivatives are those of the run that was made: jumps, which amplify by a
/// million, do not lead elsewhere what is taken again.
#[test]
fn derivatives_of_coarse_runs() {
    let (x0, p) = problem("van_der_pol_1e3");
    let (x0, t) = (SVector::<f64, 2>::from_column_slice(&x0), 2000.0);
    let references = references("first", "van_der_pol_1e3");
    let reference = references.iter().find(|r| r.number("t").is_ok_and(|at| at == t)).expect("the end");
    let expected = reference.matrix::<2, 1>("dx_dp").expect("derivatives")[0];
    for rtol in [1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6] {
        let mut adaptive = integrator::<VanDerPol, 1>(&p, rtol, rtol);
        let solved = adaptive.solve(&x0, &SVector::zeros(), t).expect("a solution").x;
        let forward = *adaptive.forward(&x0, &SVector::zeros(), t).expect("derivatives");
        // The last step begins within the tolerance of where it began.
        let apart = (forward.x[0] - solved[0]).abs();
        let error = (forward.dx_dp[0] - expected).abs();
        println!("{rtol:e}: {apart:e} {error:e}");
        assert!(apart <= 3.0 * rtol * (1.0 + solved[0].abs()), "{rtol:e}: {} {}", forward.x[0], solved[0]);
        // At the coarsest two the period itself is wrong.
        assert!(rtol > 1e-2 || error <= 20.0 * rtol, "{rtol:e}: {error:e}");
    }
}

#[casados::function]
fn level(x: [f64; 2], _p: f64) -> f64 {
    x[0] - 1.8
}

#[casados::function]
fn unchanged(x: [f64; 2], _p: f64) -> [f64; 2] {
    x
}

/// So are those over events on the slow branch, and over intervals one after the other, and both
/// ways to a gradient give the same. Other steps have other errors, which the jumps amplify by a
/// million: found are up to 83 tolerances.
#[test]
fn derivatives_of_coarse_runs_in_parts() {
    let (x0, p) = problem("van_der_pol_1e3");
    let (x0, t) = (SVector::<f64, 2>::from_column_slice(&x0), 2000.0);
    let references = references("first", "van_der_pol_1e3");
    let reference = references.iter().find(|r| r.number("t").is_ok_and(|at| at == t)).expect("the end");
    let expected = reference.matrix::<2, 1>("dx_dp").expect("derivatives")[0];
    let (u, lambda) = (SVector::zeros(), SVector::from([1.0, 0.0]));
    for rtol in [3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6] {
        let event = Event::jump::<Level, Unchanged>(Crossing::Falling);
        let mut hybrid = Hybrid::new(integrator::<VanDerPol, 1>(&p, rtol, rtol), &[event]).expect("memory");
        let forward = hybrid.forward(&x0, &u, t).expect("derivatives");
        let adjoint = hybrid.adjoint(&x0, &u, t, &lambda).expect("a gradient");
        assert_eq!(forward.solution.occurrences.len(), 2);
        let mut piecewise = Piecewise::new(integrator::<VanDerPol, 1>(&p, rtol, rtol));
        let (controls, ends) = ([u; 3], [500.0, 1500.0, t]);
        let parts = piecewise.forward(&x0, &controls, &ends).expect("derivatives");
        let backwards = piecewise.adjoint(&x0, &controls, &ends, &lambda).expect("a gradient");
        for (found, gradient) in
            [(forward.dx_dp[0], adjoint.grad_p[0]), (parts.dx_dp[0], backwards.grad_p[0])]
        {
            let error = (found - expected).abs();
            println!("{rtol:e}: {error:e}");
            assert!(error <= 100.0 * rtol, "{rtol:e}: {error:e}");
            // Rounding, which the jumps amplify: 4.5e-9 of a derivative, see above.
            assert!((gradient - found).abs() <= 4.5e-9 * found.abs(), "{rtol:e}: {found:e} {gradient:e}");
        }
    }
}

/// An interval without length: the identity.
#[test]
fn no_time() {
    let (x0, p) = problem("akzo_nobel");
    let x0 = SVector::<f64, 5>::from_column_slice(&x0);
    let mut adaptive = integrator::<AkzoNobel, 9>(&p, 1e-6, 1e-9);
    let lambda = SVector::<f64, 5>::repeat(2.0);
    let result = adaptive.hessian(&x0, &SVector::zeros(), 0.0, &lambda).expect("nothing to do");
    assert_eq!(result.x, x0);
    assert_eq!(result.dx_dx0, SMatrix::<f64, 5, 5>::identity());
    assert_eq!(result.grad_x0, lambda);
    assert_eq!(result.h_xx, SMatrix::<f64, 5, 5>::zeros());
    // z = Ks y1 y4
    assert!((result.dz_dx0[(0, 0)] - p[6] * x0[3]).abs() <= 1e-14);
    assert_eq!(result.dz_dx0, result.dz0_dx0);
}

/// A pendulum, `p = ω²`.
#[casados::ode]
fn swing(x: [f64; 2], p: [f64; 1]) -> [f64; 2] {
    [x[1], -p[0] * x[0].sin()]
}

/// The same with the force as an algebraic state.
#[casados::dae]
fn pulled(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], p: [f64; 1]) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] + z[0], z[0] - p[0] * x[0].sin()]
}

/// At rest nothing moves, so that the states accept every step, while derivatives swing with `ω`:
/// without control they are those of nine steps at any tolerance. With it the errors of all steps
/// add up to no more than their number times the tolerance of `1 + |V|`, `|V| ≤ ω`, and the
/// condition of the swing, `ω`: found are one to six tolerances.
macro_rules! at_rest {
    ($model:ty, $method:ty) => {{
        let (omega, t, u) = (2.0f64, 5.0, SVector::zeros());
        let (sin, cos) = (omega * t).sin_cos();
        let expected = nalgebra::matrix![cos, sin / omega; -omega * sin, cos];
        for tolerance in [1e-2, 1e-4, 1e-6, 1e-8] {
            let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
            adaptive.set_parameters(&SVector::from([omega * omega])).expect("finite");
            let without = *adaptive.forward(&SVector::zeros(), &u, t).expect("derivatives");
            assert!((without.dx_dx0 - expected).amax() > 1e-2);
            let fewest = adaptive.statistics().steps;
            adaptive.control_sensitivities(true).expect("memory");
            let with = *adaptive.forward(&SVector::zeros(), &u, t).expect("derivatives");
            let (error, steps) = ((with.dx_dx0 - expected).amax(), adaptive.statistics().steps);
            assert!(error <= steps as f64 * (1.0 + omega) * omega * tolerance, "{error:e}, {steps} steps");
            assert!(error <= 20.0 * tolerance, "{error:e} at {tolerance:e}");
            // The parameter moves nothing, and neither do the states.
            assert_eq!((with.x, with.dx_dp), (SVector::zeros(), SVector::zeros()));
            // All calls choose the same steps, until they are chosen for the states alone again.
            let times: Vec<f64> = adaptive.times().collect();
            adaptive.solve(&SVector::zeros(), &u, t).expect("a solution");
            assert_eq!(adaptive.times().collect::<Vec<_>>(), times);
            adaptive.control_sensitivities(false).expect("nothing");
            adaptive.solve(&SVector::zeros(), &u, t).expect("a solution");
            assert_eq!(adaptive.statistics().steps, fewest);
        }
    }};
}

#[test]
fn controlled_derivatives_where_states_rest() {
    at_rest!(Swing, Radau);
    at_rest!(Pulled, Radau);
    at_rest!(Pulled, RadauIIA<5>);
    at_rest!(Swing, Gauss<2>);
    at_rest!(Pulled, Gauss<3>);
    at_rest!(Swing, DormandPrince5);
    at_rest!(Swing, DormandPrince8);
}

/// The largest error of a column of derivatives by `(x₀, p)`, in units of what is tolerated: the
/// root of the mean of the squares of its elements over `atol / s_c + rtol |V_rc|`.
fn oregonator(tolerance: f64, controlled: bool) -> f64 {
    let (start, p) = problem("oregonator");
    let reference = references("first", "oregonator").remove(0);
    let mut adaptive = integrator::<Oregonator, 4>(&p, tolerance, tolerance);
    adaptive.control_sensitivities(controlled).expect("memory");
    let t = reference.number("t").expect("t");
    let x0 = SVector::<f64, 3>::from_column_slice(&start);
    let found = *adaptive.forward(&x0, &SVector::zeros(), t).expect("derivatives");
    let by_x0 = reference.matrix::<3, 3>("dx_dx0").expect("a matrix");
    let by_p = reference.matrix::<3, 4>("dx_dp").expect("a matrix");
    let error = |found: &[f64], expected: &[f64], magnitude: f64| {
        let squares = found.iter().zip(expected).map(|(found, expected)| {
            ((found - expected) / (tolerance / magnitude + tolerance * expected.abs())).powi(2)
        });
        (squares.sum::<f64>() / 3.0).sqrt()
    };
    let columns = found.dx_dx0.as_slice().chunks(3).chain(found.dx_dp.as_slice().chunks(3));
    let expected = by_x0.as_slice().chunks(3).chain(by_p.as_slice().chunks(3));
    let magnitudes = start.iter().chain(&p);
    columns.zip(expected).zip(magnitudes).fold(0.0, |worst: f64, ((found, expected), magnitude)| {
        worst.max(error(found, expected, magnitude.abs()))
    })
}

/// Relaxation oscillations amplify errors between their jumps. With control the errors of some
/// hundred steps are those of a few at the tolerance, found 0.2 to 7; without it 30 to 130 at fine
/// tolerances, since derivatives are steeper than the states.
#[test]
fn controlled_derivatives_of_a_relaxation_oscillation() {
    for exponent in 2..=8 {
        let tolerance = 10f64.powi(-exponent);
        let (with, without) = (oregonator(tolerance, true), oregonator(tolerance, false));
        assert!(with <= 15.0, "{with} tolerances of {tolerance:e}");
        assert!(exponent < 5 || without > 2.0 * with, "{without} and {with} tolerances of {tolerance:e}");
    }
}

/// Magnitudes say which changes count: an input whose changes are small beside what is tolerated is
/// not controlled.
#[test]
fn scales_of_controlled_derivatives() {
    let options = AdaptiveOptions { rtol: 1e-6, atol: 1e-6, ..Default::default() };
    let mut adaptive = Adaptive::<Swing, Radau>::new(options).expect("valid");
    adaptive.set_parameters(&SVector::from([4.0])).expect("finite");
    adaptive.control_sensitivities(true).expect("memory");
    let mut steps = |scale: f64| {
        let (scales, none) = (SVector::repeat(scale), SVector::zeros());
        adaptive.set_sensitivity_scales(&scales, &none, &SVector::zeros()).expect("magnitudes");
        adaptive.solve(&SVector::zeros(), &none, 5.0).expect("a solution");
        adaptive.statistics().steps
    };
    let (default, unit, small) = (steps(0.0), steps(1.0), steps(1e-6));
    assert_eq!(default, unit);
    assert!(small < unit / 2, "{small} of {unit}");
    for scale in [-1.0, f64::NAN, f64::INFINITY] {
        let error =
            adaptive.set_sensitivity_scales(&SVector::zeros(), &SVector::zeros(), &SVector::from([scale]));
        assert!(matches!(error, Err(Error::InvalidOption { .. })));
    }
}
