//! Catalyst mixing in a plug-flow reactor, and the isomerisation of α-pinene.

use crate::Test;
use casados::ocp::{Continuous, GeneralCost, HeapIpm, HeapSqp, Horizon, Phases, Problem};
use casados::prelude::*;

/// Two substances along a reactor, and the position; `u` is the fraction of the first catalyst.
#[ode(duration = p)]
mod reactor {
    pub struct State {
        pub substances: [f64; 2],
        pub place: f64,
    }
    pub fn reactor(x: &State, u: f64, _p: f64) -> State {
        let [a, b] = x.substances;
        let rate = u * (10.0 * b - a);
        State { substances: [rate, -rate - (1.0 - u) * b], place: 1.0 }
    }
    #[function]
    fn rest(x: &State, _u: f64, _p: f64) -> f64 {
        x.substances[0] + x.substances[1] - 1.0
    }
}

/// Maximum yield of the third substance: the first catalyst alone, a mixture, the second alone.
/// COPS has −4.80556e-2 from 100 intervals of Gauss's method of order 6.
#[test]
fn catalyst_mixing() -> Test {
    const COPS: f64 = -4.80556e-2;
    let part =
        |n: usize, guess: f64, u: f64| {
            let mut part = Problem::new(Irk::<Reactor, Gauss<3>>::new(Options::default())?)
                .on(Horizon::free(n, 0.01..=1.0, guess))?;
            part.guess(&[0.9, 0.07, 0.5], &[u])?.bound("u", .., 0.0, 1.0)?;
            Ok::<_, Box<dyn std::error::Error>>(part)
        };
    for by_sqp in [false, true] {
        let (mut first, mut mixture) = (part(5, 0.2, 1.0)?, part(20, 0.5, 0.3)?);
        let mut last = Problem::new(Irk::<Reactor, Gauss<3>>::new(Options::default())?)
            .terminal_cost(GeneralCost::<Rest>::new())
            .on(Horizon::free(5, 0.01..=1.0, 0.3))?;
        last.guess(&[0.9, 0.05, 0.9], &[0.0])?.bound("u", .., 0.0, 0.0)?.bound("x.place", 5.., 1.0, 1.0)?;
        first.fix_initial_state(&[1.0, 0.0, 0.0])?.bound("u", .., 1.0, 1.0)?;
        let mut reactor =
            Phases::new(&mut first).then(Continuous, &mut mixture).then(Continuous, &mut last).join()?;
        let outcome = if by_sqp {
            HeapSqp::new(&reactor)?.solve(&mut reactor)?
        } else {
            HeapIpm::new(&reactor)?.solve(&mut reactor)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        assert!((outcome.objective - COPS).abs() < 1e-4 * COPS.abs(), "{outcome}");
    }
    Ok(())
}

/// Five substances in percent, five rates per minute.
#[ode]
pub mod pinene {
    pub struct Sample {
        pub rates: [f64; 5],
        pub measured: [f64; 5],
    }
    pub fn pinene(x: [f64; 5], p: &Sample) -> [f64; 5] {
        let [a, b, c, d, e] = p.rates;
        [-(a + b) * x[0], a * x[0], b * x[0] - (c + d) * x[2] + e * x[4], c * x[2], d * x[2] - e * x[4]]
    }
    fn square(a: f64) -> f64 {
        a * a
    }
    #[function]
    pub fn misfit(x: [f64; 5], p: &Sample) -> f64 {
        let [a, b, c, d, e] = p.measured;
        square(x[0] - a) + square(x[1] - b) + square(x[2] - c) + square(x[3] - d) + square(x[4] - e)
    }
}

/// Minutes, and percents (R. E. Fuguitt, J. E. Hawkins, J. Am. Chem. Soc. 69 (1947); COPS 3.0).
pub const SAMPLES: [(f64, [f64; 5]); 9] = [
    (0.0, [100.0, 0.0, 0.0, 0.0, 0.0]),
    (1230.0, [88.35, 7.3, 2.3, 0.4, 1.75]),
    (3060.0, [76.4, 15.6, 4.5, 0.7, 2.8]),
    (4920.0, [65.1, 23.1, 5.3, 1.1, 5.8]),
    (7800.0, [50.4, 32.9, 6.0, 1.5, 9.3]),
    (10680.0, [37.5, 42.7, 6.0, 1.9, 12.0]),
    (15030.0, [25.9, 49.1, 5.9, 2.2, 17.0]),
    (22620.0, [14.0, 57.4, 5.1, 2.6, 21.0]),
    (36420.0, [4.5, 63.1, 3.8, 2.9, 25.7]),
];

/// Five rates from eight measurements, with nodes at their times.
#[test]
fn isomerisation_of_pinene() -> Test {
    const COPS: f64 = 19.8721;
    let times = SAMPLES.map(|(time, _)| time);
    for by_sqp in [false, true] {
        let irk = Irk::<Pinene, Gauss<3>>::new(Options { steps: 3, ..Options::default() })?;
        let mut ocp = Problem::new(irk)
            .stage_cost(GeneralCost::<Misfit>::new())
            .terminal_cost(GeneralCost::<Misfit>::new())
            .on(Horizon::nodes(&times))?;
        ocp.fix_initial_state(&SAMPLES[0].1)?;
        for (k, (_, measured)) in SAMPLES.iter().enumerate() {
            let mut p = [0.0; 10];
            p[5..].copy_from_slice(measured);
            ocp.set_parameters(k..=k, &p)?.guess_stage(k, measured, &[])?;
        }
        ocp.free("p.rates", 0.0.., 1e-5)?;
        let outcome = if by_sqp {
            HeapSqp::new(&ocp)?.solve(&mut ocp)?
        } else {
            HeapIpm::new(&ocp)?.solve(&mut ocp)?
        };
        assert!(outcome.is_converged(), "{outcome}");
        assert!((outcome.objective - COPS).abs() < 1e-4 * COPS, "{outcome}");
    }
    Ok(())
}
