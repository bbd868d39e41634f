//! What symplectic methods keep: quadratic invariants to rounding, and the energy of a planet without drift.

mod systems;

use casados::{Gauss, Irk, Options, RadauIIA};
use nalgebra::{SVector, vector};

system! {
    /// A planet around a sun: `q̈ = −q/|q|³`.
    Kepler [4, 0, 0, 0] S |v, f| {
        let (xdot, [qx, qy, vx, vy]) = (&v[..4], [v[4], v[5], v[6], v[7]]);
        let r2 = qx * qx + qy * qy;
        let r3 = r2 * r2.sqrt();
        (f[0], f[1], f[2], f[3]) = (xdot[0] - vx, xdot[1] - vy, xdot[2] + qx / r3, xdot[3] + qy / r3);
    }
}

const ECCENTRICITY: f64 = 0.6;
/// Three orbits with 80 steps each.
const STEPS: usize = 240;

/// At the perihelion; semi-major axis one, period 2π.
fn start() -> SVector<f64, 4> {
    vector![1.0 - ECCENTRICITY, 0.0, 0.0, ((1.0 + ECCENTRICITY) / (1.0 - ECCENTRICITY)).sqrt()]
}

fn angular_momentum(x: &SVector<f64, 4>) -> f64 {
    x[0] * x[3] - x[1] * x[2]
}

fn energy(x: &SVector<f64, 4>) -> f64 {
    (x[2] * x[2] + x[3] * x[3]) / 2.0 - 1.0 / x[0].hypot(x[1])
}

/// The largest relative changes of angular momentum and energy.
macro_rules! changes {
    ($method:ty) => {{
        let mut irk = Irk::<Kepler, $method>::new(Options::default()).unwrap();
        let (mut x, h) = (start(), core::f64::consts::TAU / 80.0);
        let (l0, e0) = (angular_momentum(&x), energy(&x));
        let mut worst = (0.0f64, 0.0f64);
        for _ in 0..STEPS {
            x = irk.solve(&x, &SVector::zeros(), h).unwrap().x;
            worst.0 = worst.0.max((angular_momentum(&x) / l0 - 1.0).abs());
            worst.1 = worst.1.max((energy(&x) / e0 - 1.0).abs());
        }
        println!("{} {worst:?}", stringify!($method));
        worst
    }};
}

/// Each step rounds `x` a few times: a random walk of steps of four roundings, and three standard deviations.
fn random_walk() -> f64 {
    3.0 * (STEPS as f64).sqrt() * 4.0 * f64::EPSILON / 2.0
}

#[test]
fn gauss_keeps_the_angular_momentum() {
    macro_rules! check {
        ($($s:literal)*) => {$(
            let (momentum, _) = changes!(Gauss<$s>);
            assert!(momentum <= random_walk(), "s = {}: {momentum:e}", $s);
        )*};
    }
    check!(1 2 3 4 5 6 7 8 9);
    // Radau IIA does not: it is no property of the test.
    assert!(changes!(RadauIIA<3>).0 > 1e-9);
}

#[test]
fn gauss_keeps_the_energy_as_far_as_it_solves_the_equation() {
    // Rounding of x changes the energy more than the momentum: at the perihelion 1/r and v² cancel, and each is
    // six times the energy.
    let tolerance = 6.0 * random_walk();
    let (_, energy) = changes!(Gauss<9>);
    assert!(energy <= tolerance, "{energy:e}");
    let (_, energy) = changes!(Gauss<8>);
    assert!(energy <= tolerance, "{energy:e}");
}
