//! A hanging chain, and a periodic orbit of three bodies.

use crate::Test;
use casados::ocp::{Boundary, GeneralCost, HeapIpm, HeapSqp, Horizon, Problem};
use casados::prelude::*;
use casados::qp::Clarabel;
use nalgebra::SVector;

/// Height as a function of distance; the control is its slope.
#[ode(linear = u, integrals(length = (1.0 + u * u).sqrt(), energy = x * (1.0 + u * u).sqrt()))]
mod chain {
    pub fn chain(_x: f64, u: f64) -> f64 {
        u
    }
    #[function]
    fn potential(_x: f64, _u: f64, q: [f64; 2]) -> f64 {
        q[1]
    }
}

/// The potential energy of a catenary of length `l` from `(0, a)` to `(1, b)`:
/// `y = m + c cosh((t − s)/c)` with `2 c sinh(1/(2c)) = √(l² − (b − a)²)` and
/// `tanh((1 − 2s)/(2c)) = (b − a)/l`.
fn catenary(a: f64, b: f64, l: f64) -> f64 {
    let chord = (l * l - (b - a) * (b - a)).sqrt();
    let (mut low, mut high) = (0.05, 10.0);
    for _ in 0..200 {
        let c: f64 = 0.5 * (low + high);
        if 2.0 * c * (0.5 / c).sinh() > chord { low = c } else { high = c }
    }
    let c = low;
    let s = 0.5 - c * ((b - a) / l).atanh();
    let (first, last) = (-s / c, (1.0 - s) / c);
    let m = a - c * first.cosh();
    c * (0.5 + 0.25 * c * ((2.0 * last).sinh() - (2.0 * first).sinh())) + m * l
}

#[test]
fn hanging_chain() -> Test {
    const COPS: f64 = 5.06891;
    const N: usize = 50;
    let expected = catenary(1.0, 3.0, 4.0);
    assert!((expected - COPS).abs() < 1e-4 * COPS, "{expected}");
    for by_sqp in [false, true] {
        let mut ocp = Problem::new(Irk::<Chain, Gauss<3>>::new(Options::default())?)
            .terminal_cost(GeneralCost::<Potential>::new())
            .on(Horizon::uniform(N, 1.0 / N as f64))?;
        ocp.fix_initial_state(&[1.0])?;
        for k in 0..=N {
            // COPS: a parabola, with its slope.
            let t = k as f64 / N as f64;
            let (x, slope) = (8.0 * t * (0.5 * t - 0.25) + 1.0, [8.0 * (t - 0.25)]);
            ocp.guess_stage(k, &[x], if k < N { &slope } else { &[] })?;
        }
        ocp.bound("x", N.., 3.0, 3.0)?.bound("length", N.., 4.0, 4.0)?;
        let outcome = if by_sqp {
            HeapSqp::new(&ocp)?.solve(&mut ocp)?
        } else {
            HeapIpm::new(&ocp)?.solve(&mut ocp)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        assert!((outcome.objective - expected).abs() < 1e-4 * expected, "{outcome}");
        assert!((ocp.solution()?.integral("length")?[N] - 4.0).abs() < 1e-7);
    }
    Ok(())
}

/// The restricted three-body problem in rotating axes, with a free period.
#[ode(duration = p)]
mod bodies {
    const MOON: f64 = 0.012277471;
    const EARTH: f64 = 1.0 - MOON;

    pub fn bodies(x: [f64; 4], _p: f64) -> [f64; 4] {
        let (e, m) = (x[0] + MOON, x[0] - EARTH);
        let (re, rm) = ((e * e + x[1] * x[1]).sqrt(), (m * m + x[1] * x[1]).sqrt());
        let (de, dm) = (re * re * re, rm * rm * rm);
        [
            x[2],
            x[3],
            x[0] + 2.0 * x[3] - EARTH * e / de - MOON * m / dm,
            x[1] - 2.0 * x[2] - EARTH * x[1] / de - MOON * x[1] / dm,
        ]
    }
    /// Periodicity of three states; by the Jacobi integral the fourth is periodic, too.
    #[function]
    fn returns(x0: [f64; 4], x: [f64; 4], _p: f64) -> [f64; 3] {
        [x[0] - x0[0], x[1] - x0[1], x[2] - x0[2]]
    }
}

/// Arenstorf's orbit (E. Hairer, S. P. Nørsett, G. Wanner, "Solving ordinary differential
/// equations I", 1993, section II.0): it starts at 0.994 across the axis with
/// −2.0015851063790825, and returns after 17.0652165601579626.
#[test]
fn periodic_orbit_of_three_bodies() -> Test {
    const PERIOD: f64 = 17.065_216_560_157_964;
    const SPEED: f64 = -2.0015851063790825;
    // A guess of four digits; nodes are dense near the moon and the earth.
    let (speed, period) = (-2.0016, 17.065);
    let (mut t, mut x) = (0.0, [0.994_f64, 0.0, 0.0, speed]);
    let (mut parts, mut guess) = (vec![t], vec![x]);
    let mut erk = Erk::<Bodies, DormandPrince8>::new(Options::default())?;
    erk.set_parameters(&SVector::from([period]))?;
    while t < 1.0 {
        let earth = (x[0] + 0.012277471).hypot(x[1]);
        let moon = (x[0] - 1.0 + 0.012277471).hypot(x[1]);
        let h: f64 = (0.3 * earth.min(moon) / (1.0 + x[2].hypot(x[3])) / period).min(1.0 - t);
        x = erk.solve(&SVector::from(x), &SVector::from([]), h)?.x.into();
        t += h;
        parts.push(t);
        guess.push(x);
    }
    let mut ocp =
        Problem::new(Erk::<Bodies, DormandPrince8>::new(Options { steps: 2, ..Options::default() })?)
            .terminal_constraints(Boundary::<Returns>::new([0.0; 3], [0.0; 3]))
            .on(Horizon::free_nodes(&parts, 10.0..=20.0, period))?;
    ocp.free_initial_state().bound("x[0]", ..1, 0.994, 0.994)?.bound("x[1]", ..1, 0.0, 0.0)?;
    for (k, x) in guess.iter().enumerate() {
        ocp.guess_stage(k, x, &[])?;
    }
    let mut sqp = HeapSqp::with_solver(&ocp, Clarabel::new())?;
    sqp.options.tolerance = 1e-10;
    let outcome = sqp.solve(&mut ocp)?;
    let solution = ocp.solution()?;
    assert!(outcome.is_converged(), "{outcome}");
    assert!((solution.end_time() - PERIOD).abs() < 1e-10, "{}", solution.end_time());
    assert!((solution.state("x[3]")?[0] - SPEED).abs() < 1e-10);
    Ok(())
}
