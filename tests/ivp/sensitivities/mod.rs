//! Derivatives of adaptive runs: against the references of the IVP set, against each other, and as
//! those of one smooth function.

mod controlled;
mod discrete;

use casados::Shape;
use casados::{
    Adaptive, AdaptiveOptions, Crossing, Dae, DormandPrince5, DormandPrince8, Error, Event, Gauss, Hybrid,
    Piecewise, Radau, RadauIIA,
};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::models::ivp::chemistry::{AkzoNobel, Oregonator, Robertson};
use crate::models::ivp::oscillators::{VanDerPol, VanDerPolScaled};
use reference_data::Record;

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
