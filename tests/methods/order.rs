//! Order of convergence of every method, down to rounding.

use crate::{explicit, system};
use casados::testing::{Convergence, convergence};
use casados::{
    Butcher6, DormandPrince5, DormandPrince8, Erk, Error, Euler, Gauss, Heun, Irk, Method, Midpoint, Options,
    RadauIIA, Rk4,
};
use nalgebra::{DMatrix, DVector, SVector, vector};

system! {
    /// `ẋ = x (1 − x)`
    Logistic [1, 0, 0, 0] S |v, f| {
        let [xdot, x] = [v[0], v[1]];
        f[0] = xdot - x * (S::from_f64(1.0) - x);
    }
}
explicit!(Logistic: 0);

const LOGISTIC_TIME: f64 = 4.0;

fn logistic(x0: f64) -> f64 {
    1.0 / (1.0 + (1.0 / x0 - 1.0) * f64::exp(-LOGISTIC_TIME))
}

system! {
    /// A planet around a sun: `q̈ = −q/|q|³`.
    Kepler [4, 0, 0, 0] S |v, f| {
        let (xdot, [qx, qy, vx, vy]) = (&v[..4], [v[4], v[5], v[6], v[7]]);
        let r2 = qx * qx + qy * qy;
        let r3 = r2 * r2.sqrt();
        (f[0], f[1], f[2], f[3]) = (xdot[0] - vx, xdot[1] - vy, xdot[2] + qx / r3, xdot[3] + qy / r3);
    }
}
explicit!(Kepler: 0 1 2 3);

const ECCENTRICITY: f64 = 0.6;
const KEPLER_TIME: f64 = 1.5;

/// At the perihelion.
fn kepler_start() -> SVector<f64, 4> {
    vector![1.0 - ECCENTRICITY, 0.0, 0.0, ((1.0 + ECCENTRICITY) / (1.0 - ECCENTRICITY)).sqrt()]
}

/// By Kepler's equation `t = E − e sin E`; semi-major axis one.
fn kepler(time: f64) -> [f64; 4] {
    let e = ECCENTRICITY;
    let anomaly = (0..100).fold(time, |a, _| a - (a - e * a.sin() - time) / (1.0 - e * a.cos()));
    let (sin, cos) = anomaly.sin_cos();
    let (b, rate) = ((1.0 - e * e).sqrt(), 1.0 / (1.0 - e * cos));
    [cos - e, b * sin, -sin * rate, b * cos * rate]
}

/// Step numbers in a geometric sequence.
fn steps(first: f64, ratio: f64, count: i32) -> Vec<usize> {
    let mut steps: Vec<usize> = (0..count).map(|k| (first * ratio.powi(k)).round() as usize).collect();
    steps.dedup();
    steps
}

/// The order in the limit of small steps: `log e = log C + p log h + D h^m + E h^2m`, fitted to the
/// errors above 1e-12.
///
/// The last terms are those of the next orders of the expansion, `m = 2` for symmetric methods.
/// Methods of high order are at rounding long before these are negligible.
fn fitted_order(report: &Convergence, m: i32) -> f64 {
    let rows: Vec<_> = report.rows.iter().filter(|row| row.1 > 1e-12 && row.1 < 0.03).collect();
    let rows = &rows[rows.len().saturating_sub(9)..];
    if rows.len() < 5 {
        return f64::NAN;
    }
    let h = |row: usize| rows[0].0 as f64 / rows[row].0 as f64;
    let matrix = DMatrix::from_fn(rows.len(), 4, |r, c| [1.0, h(r).ln(), h(r).powi(m), h(r).powi(2 * m)][c]);
    let errors = DVector::from_fn(rows.len(), |r, _| rows[r].1.ln());
    matrix.svd(true, true).solve(&errors, 1e-14).map_or(f64::NAN, |solution| solution[1])
}

/// The slope is within 0.1 of the order above errors of 1e-12, unless the order is larger than
/// `visible`: then the asymptote of this problem is below rounding. Methods of order 8 and more
/// reach rounding.
#[track_caller]
fn check(name: &str, order: usize, m: i32, visible: usize, report: &Convergence) {
    let found = fitted_order(report, m);
    assert!(report.failure.is_none(), "{name}\n{report}");
    assert!(order > visible || (found - order as f64).abs() <= 0.1, "{name}: {found}\n{report}");
    assert!(order < 8 || report.best() <= 1e-14, "{name}\n{report}");
}

macro_rules! explicit_orders {
    ($name:ident, $model:ident, $x0:expr, $time:expr, $exact:expr, $visible:expr, $($method:ident $first:literal $ratio:literal $count:literal,)*) => {
        #[test]
        fn $name() {
            let exact = $exact;
            $({
                let report = convergence(&steps($first, $ratio, $count), &exact, 1e-13, |steps| {
                    let options = Options { steps, ..Default::default() };
                    let mut erk = Erk::<$model, $method>::new(options)?;
                    Ok::<_, Error>(erk.solve(&$x0, &SVector::zeros(), $time)?.x.as_slice().to_vec())
                });
                check(stringify!($method), <$method as Method<_>>::TABLEAU.order(), 1, $visible, &report);
            })*
        }
    };
}

explicit_orders!(t04_explicit_on_logistic, Logistic, vector![0.2], LOGISTIC_TIME, [logistic(0.2)], 4,
    Euler 100.0 2.0 8, Midpoint 100.0 2.0 8, Heun 100.0 2.0 8, Rk4 32.0 2.0 8, DormandPrince8 4.0 1.3 12,
);
explicit_orders!(t04_explicit_on_kepler, Kepler, kepler_start(), KEPLER_TIME, kepler(KEPLER_TIME), 6,
    Euler 400.0 1.6 9, Midpoint 100.0 2.0 8, Heun 100.0 2.0 8, Rk4 32.0 2.0 8, Butcher6 16.0 1.5 10,
    DormandPrince8 8.0 1.3 14,
);

system! {
    /// A pendulum of length one with the tension `z`, index 1: `q̈ = −z q − (0, g)`,
    /// `0 = q·q̈ + |q̇|²`.
    Pendulum [4, 1, 0, 0] S |v, f| {
        let (xdot, [qx, qy, vx, vy, z]) = (&v[..4], [v[4], v[5], v[6], v[7], v[8]]);
        let g = S::from_f64(GRAVITY);
        (f[0], f[1], f[2], f[3]) = (xdot[0] - vx, xdot[1] - vy, xdot[2] + z * qx, xdot[3] + z * qy + g);
        f[4] = qx * xdot[2] + qy * xdot[3] + vx * vx + vy * vy;
    }
}

const GRAVITY: f64 = 9.81;
const PENDULUM_TIME: f64 = 0.8;
/// From the lowest point, rad.
const PENDULUM_ANGLE: f64 = 2.0;

/// Elliptic functions `(sn, cn, dn)(u, k)` by descending Landen transformations (Abramowitz and
/// Stegun 16.4).
fn jacobi_elliptic_functions(u: f64, k: f64) -> (f64, f64, f64) {
    let (mut a, mut c) = (vec![1.0], vec![k]);
    let mut b = (1.0 - k * k).sqrt();
    while c[c.len() - 1].abs() > 1e-16 {
        let last = a[a.len() - 1];
        c.push((last - b) / 2.0);
        a.push((last + b) / 2.0);
        b = (last * b).sqrt();
    }
    let n = a.len() - 1;
    let mut phi = 2f64.powi(n as i32) * a[n] * u;
    for i in (1..=n).rev() {
        phi = (phi + (c[i] / a[i] * phi.sin()).asin()) / 2.0;
    }
    let (sn, cn) = phi.sin_cos();
    (sn, cn, (1.0 - k * k * sn * sn).sqrt())
}

fn pendulum_start() -> SVector<f64, 4> {
    let (sin, cos) = PENDULUM_ANGLE.sin_cos();
    vector![sin, -cos, 0.0, 0.0]
}

/// `θ = 2 asin(k cd(ω t))` for a pendulum that is released at rest, `k = sin(θ₀/2)`.
fn pendulum() -> [f64; 4] {
    let (k, omega) = ((PENDULUM_ANGLE / 2.0).sin(), GRAVITY.sqrt());
    let (sn, cn, dn) = jacobi_elliptic_functions(omega * PENDULUM_TIME, k);
    let half = k * cn / dn;
    let angle = 2.0 * half.asin();
    // d cd/du = −(1 − k²) sn/dn²
    let rate = -2.0 * k * omega * (1.0 - k * k) * sn / (dn * dn) / (1.0 - half * half).sqrt();
    [angle.sin(), -angle.cos(), rate * angle.cos(), rate * angle.sin()]
}

macro_rules! implicit_orders {
    ($name:ident, $method:ident, $m:literal, $model:ident, $x0:expr, $time:expr, $exact:expr, $visible:expr, $($s:literal $first:literal $ratio:literal $count:literal,)*) => {
        #[test]
        fn $name() {
            let exact = $exact;
            $({
                let report = convergence(&steps($first, $ratio, $count), &exact, 1e-13, |steps| {
                    let options = Options { steps, ..Default::default() };
                    let mut irk = Irk::<$model, $method<$s>>::new(options)?;
                    Ok::<_, Error>(irk.solve(&$x0, &SVector::zeros(), $time)?.x.as_slice().to_vec())
                });
                let tableau = <$method<$s> as Method<$s>>::TABLEAU;
                check(tableau.name(), tableau.order(), $m, $visible, &report);
            })*
        }
    };
}

implicit_orders!(t04_gauss_on_logistic, Gauss, 2, Logistic, vector![0.2], LOGISTIC_TIME, [logistic(0.2)], 8,
    1 64.0 2.0 8, 2 16.0 1.5 12, 3 4.0 1.4 12, 4 3.0 1.3 10, 5 2.0 1.3 9, 6 2.0 1.3 8, 7 1.0 1.4 8, 8 1.0 1.3 8,
    9 1.0 1.3 8,
);
implicit_orders!(t04_radau_on_logistic, RadauIIA, 1, Logistic, vector![0.2], LOGISTIC_TIME, [logistic(0.2)], 7,
    1 64.0 2.0 8, 2 16.0 1.5 12, 3 4.0 1.4 12, 4 3.0 1.3 10, 5 2.0 1.3 9, 6 2.0 1.3 8, 7 1.0 1.4 8, 8 1.0 1.3 8,
    9 1.0 1.3 8,
);
implicit_orders!(t04_gauss_on_kepler, Gauss, 2, Kepler, kepler_start(), KEPLER_TIME, kepler(KEPLER_TIME), 6,
    1 64.0 2.0 8, 2 16.0 1.5 14, 3 6.0 1.4 14, 4 4.0 1.3 14, 5 3.0 1.3 12, 6 3.0 1.3 12, 7 2.0 1.3 12,
    8 2.0 1.3 12, 9 2.0 1.3 10,
);
implicit_orders!(t04_radau_on_kepler, RadauIIA, 1, Kepler, kepler_start(), KEPLER_TIME, kepler(KEPLER_TIME), 7,
    2 16.0 1.5 14, 3 6.0 1.4 14, 4 4.0 1.3 14, 5 3.0 1.3 14, 6 3.0 1.3 12, 7 2.0 1.3 12, 8 2.0 1.3 12,
    9 2.0 1.3 10,
);
implicit_orders!(t04_gauss_on_pendulum, Gauss, 2, Pendulum, pendulum_start(), PENDULUM_TIME, pendulum(), 8,
    1 64.0 2.0 8, 2 16.0 1.5 14, 3 6.0 1.4 14, 4 4.0 1.3 14, 5 3.0 1.3 12, 6 3.0 1.3 12, 7 2.0 1.3 12,
    8 2.0 1.3 12, 9 2.0 1.3 10,
);
implicit_orders!(t04_radau_on_pendulum, RadauIIA, 1, Pendulum, pendulum_start(), PENDULUM_TIME, pendulum(), 7,
    2 16.0 1.5 14, 3 6.0 1.4 14, 4 4.0 1.3 14, 5 3.0 1.3 12, 6 3.0 1.3 12, 7 2.0 1.3 12, 8 2.0 1.3 12,
    9 2.0 1.3 10,
);

system! {
    /// `ẋ = y`, `ẏ = −x`
    Oscillator [2, 0, 0, 0] S |v, f| {
        (f[0], f[1]) = (v[0] - v[3], v[1] + v[2]);
    }
}
explicit!(Oscillator: 0 1);

const OSCILLATOR_TIME: f64 = 40.0;

fn oscillator() -> [f64; 2] {
    let (sin, cos) = OSCILLATOR_TIME.sin_cos();
    [0.6 * cos + 0.8 * sin, 0.8 * cos - 0.6 * sin]
}

// The solution is entire: the asymptote is visible for every order, errors of 1e-12 are reached
// with long steps.
implicit_orders!(t04_gauss_on_oscillator, Gauss, 2, Oscillator, vector![0.6, 0.8], OSCILLATOR_TIME, oscillator(), 18,
    1 4096.0 1.2 8, 2 512.0 1.3 12, 3 128.0 1.3 12, 4 40.0 1.2 15, 5 24.0 1.15 16, 6 16.0 1.15 16, 7 12.0 1.12 16,
    8 10.0 1.1 16, 9 8.0 1.1 16,
);
implicit_orders!(t04_radau_on_oscillator, RadauIIA, 1, Oscillator, vector![0.6, 0.8], OSCILLATOR_TIME, oscillator(), 17,
    2 512.0 1.3 9, 3 128.0 1.3 14, 4 40.0 1.2 17, 5 24.0 1.2 14, 6 16.0 1.15 16, 7 12.0 1.12 16, 8 10.0 1.1 18,
    9 8.0 1.1 18,
);
explicit_orders!(t04_explicit_on_oscillator, Oscillator, vector![0.6, 0.8], OSCILLATOR_TIME, oscillator(), 8,
    Rk4 256.0 1.4 12, DormandPrince5 64.0 1.4 16, Butcher6 64.0 1.4 14, DormandPrince8 30.0 1.2 18,
);
