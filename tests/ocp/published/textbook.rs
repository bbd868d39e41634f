//! The Bryson-Denham problem, and an interior-point condition.

use crate::Test;
use casados::ocp::{Continuous, GeneralCost, HeapIpm, HeapSqp, Horizon, Phases, Problem};
use casados::prelude::*;

/// A cart before a wall; `q` is the integral of half the squared force.
#[ode(linear = u, integrals(effort = 0.5 * u * u))]
mod cart {
    pub fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
        [x[1], u]
    }
    #[function]
    fn total(_x: [f64; 2], _u: f64, q: f64) -> f64 {
        q
    }
}

/// `4/(9 l)` with `l = 1/9` (A. E. Bryson, Y.-C. Ho, "Applied optimal control", 1975, section
/// 3.11): the force is linear until a third, zero until two thirds, linear again; all of these are
/// nodes, so that the solution is among linear controls.
#[test]
fn cart_before_a_wall() -> Test {
    const N: usize = 12;
    for by_sqp in [false, true] {
        let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
            .terminal_cost(GeneralCost::<Total>::new())
            .on(Horizon::uniform(N, 1.0 / N as f64))?;
        ocp.inside(&[0.25, 0.5, 0.75])?.fix_initial_state(&[0.0, 1.0])?.guess(&[0.0, 0.0], &[0.0])?;
        ocp.bound("x[0]", .., f64::NEG_INFINITY, 1.0 / 9.0)?;
        ocp.bound("x[0]", N.., 0.0, 0.0)?.bound("x[1]", N.., -1.0, -1.0)?;
        let outcome = if by_sqp {
            HeapSqp::new(&ocp)?.solve(&mut ocp)?
        } else {
            HeapIpm::new(&ocp)?.solve(&mut ocp)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        assert!((outcome.objective - 4.0).abs() < 1e-6, "{outcome}");
        // `u = −2/(3 l) (1 − t/(3 l))` until `3 l`.
        let solution = ocp.solution()?;
        for (k, u) in solution.control("u")?.iter().enumerate().take(N / 2) {
            let expected = -6.0 * (1.0 - 3.0 * k as f64 / N as f64).max(0.0);
            assert!((u - expected).abs() < 1e-3, "{k}: {u} {expected}");
        }
        assert!(solution.inside("x[0]@0.5")?.iter().all(|x| *x < 1.0 / 9.0 + 1e-6));
    }
    Ok(())
}

/// The cost is the integral `q`.
#[ode(linear = u, integrals(cost = x * x + u * u))]
mod way {
    pub fn way(_x: f64, u: f64) -> f64 {
        u
    }
    #[function]
    fn total_cost(_x: f64, _u: f64, q: f64) -> f64 {
        q
    }
}

/// From one over 0.9 at 0.75 to 0.75 at one (MISER3's manual, L. S. Jennings et al.; PSOPT's
/// example `interior_point`): `ẍ = x` on both sides, `((a² + b²) cosh T − 2 a b)/sinh T`.
#[test]
fn condition_in_the_middle() -> Test {
    let of = |a: f64, b: f64, length: f64| ((a * a + b * b) * length.cosh() - 2.0 * a * b) / length.sinh();
    let expected = of(1.0, 0.9, 0.75) + of(0.9, 0.75, 0.25);
    assert!((expected - 0.9205314414730).abs() < 1e-12);
    let part = |n: usize, length: f64, end: f64| {
        let mut part = Problem::new(Irk::<Way, Gauss<3>>::new(Options::default())?)
            .terminal_cost(GeneralCost::<TotalCost>::new())
            .on(Horizon::uniform(n, length / n as f64))?;
        part.guess(&[0.8], &[0.0])?.bound("x", .., -1.0, 1.0)?.bound("x", n.., end, end)?;
        Ok::<_, Box<dyn std::error::Error>>(part)
    };
    for by_sqp in [false, true] {
        let (mut before, mut after) = (part(15, 0.75, 0.9)?, part(5, 0.25, 0.75)?);
        before.fix_initial_state(&[1.0])?;
        let mut way = Phases::new(&mut before).then(Continuous, &mut after).join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&way)?.solve(&mut way)?
        } else {
            HeapIpm::new(&way)?.solve(&mut way)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        drop(way);
        assert!((outcome.objective - expected).abs() < 1e-4 * expected, "{outcome}");
        // The control `u = ẋ` jumps at the interior point.
        let (one, other) = (before.solution()?, after.solution()?);
        let slope = |a: f64, b: f64, length: f64| (b * length.cosh() - a) / length.sinh();
        let (left, right) = (slope(1.0, 0.9, 0.75), -slope(0.75, 0.9, 0.25));
        assert!((one.control("u")?[15] - left).abs() < 2e-3);
        assert!((other.control("u")?[0] - right).abs() < 2e-3);
    }
    Ok(())
}
