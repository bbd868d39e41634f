//! Adaptive integration of the IVP set: errors at the end beside tolerances, and how much work that
//! was.
//!
//! The tolerance bounds the error of one step. At the end there are those of all steps, propagated
//! by the problem: on the stiff problems they are damped, and a hundred steps leave at most some
//! tolerances; the oscillators have neutral directions, in which errors add up and shift the phase.
//! So each problem has its factor, `amplification`, between tolerance and the relative error of the
//! worst component; a mistake in an estimate or in an order shows as powers of ten.

use casados::Shape;
use casados::{
    Adaptive, AdaptiveOptions, AdaptiveStatistics, Dae, DormandPrince5, DormandPrince8, Error, Ode, Radau,
    RadauIIA,
};
use nalgebra::SVector;

use crate::models::ivp::chemistry::{
    AkzoNobel, E5, E5Conserved, Hires, Oregonator, Robertson, RobertsonConserved,
};
use crate::models::ivp::circuits::{RingModulator, TransistorAmplifier, TransistorCapacitors};
use crate::models::ivp::mechanics::{Pleiades, Squeezer};
use crate::models::ivp::oscillators::{VanDerPol, VanDerPolScaled};
use reference_data::Record;

/// A problem of the set: its data, and how its values follow from the states of a model.
struct Problem {
    record: Record,
    /// The part of the start values that are states.
    states: Vec<f64>,
    /// Absolute tolerance relative to the relative one.
    atol: f64,
    amplification: f64,
}

impl Problem {
    fn load(name: &str, atol: f64, amplification: f64) -> Self {
        let set = Record::load("ivp/ends.json").expect("the reference is there");
        let record = set.record(name).expect("a problem");
        let states = record.list("x0").expect("start values");
        Self { record, states, atol, amplification }
    }
}

/// What a run gave: for each end time the relative error of the worst component, and the work.
struct Outcome {
    t: f64,
    error: f64,
    work: AdaptiveStatistics,
}

macro_rules! runner {
    ($name:ident, $method:ty, $model:path) => {
        fn $name<M, const NX: usize, const NZ: usize, const NP: usize>(
            problem: &Problem,
            rtol: f64,
            most_time: f64,
            values: impl Fn(&[f64], &[f64]) -> Vec<f64>,
        ) -> Result<Vec<Outcome>, Error>
        where
            M: $model,
            M::Shape: Shape<
                    VectorX<f64> = SVector<f64, NX>,
                    VectorZ<f64> = SVector<f64, NZ>,
                    VectorP<f64> = SVector<f64, NP>,
                    VectorU<f64> = SVector<f64, 0>,
                >,
        {
            let options = AdaptiveOptions { rtol, atol: problem.atol * rtol, ..Default::default() };
            let mut adaptive = Adaptive::<M, $method>::new(options)?;
            if NP > 0 {
                let p = problem.record.vector("p").expect("parameters");
                adaptive.set_parameters(&p)?;
            }
            let x0 = SVector::from_column_slice(&problem.states);
            let mut outcomes = Vec::new();
            for end in problem.record.records("ends").expect("end values") {
                let t = end.number("t").expect("a time");
                if t > most_time {
                    continue;
                }
                let result = *adaptive.solve(&x0, &SVector::zeros(), t)?;
                let found = values(result.x.as_slice(), result.z.as_slice());
                let expected = end.list("y").expect("end values");
                assert_eq!(found.len(), expected.len());
                let error =
                    found.iter().zip(&expected).map(|(f, e)| (f - e).abs() / e.abs()).fold(0.0, f64::max);
                outcomes.push(Outcome { t, error, work: *adaptive.statistics() });
            }
            Ok(outcomes)
        }
    };
}
runner!(variable, Radau, Dae);
runner!(three, RadauIIA<3>, Dae);

/// Errors at these tolerances are below `amplification · rtol`, for all end times; the work of the
/// first end time.
macro_rules! follows {
    ($runner:ident::<$model:ty, $nx:literal, $nz:literal, $np:literal>($problem:expr, $tolerances:expr, $most:expr, $values:expr)) => {{
        let problem = $problem;
        let mut work = Vec::new();
        for rtol in $tolerances {
            let outcomes =
                $runner::<$model, $nx, $nz, $np>(&problem, rtol, $most, $values).expect("a solution");
            assert!(!outcomes.is_empty());
            for Outcome { t, error, work } in &outcomes {
                let bound = problem.amplification * rtol;
                assert!(
                    *error <= bound,
                    "t = {t:e}, rtol = {rtol:e}: {error:e} instead of {bound:e}, {work:?}"
                );
                // A step of an implicit method takes at least one iteration, and no more Jacobians
                // than were tried.
                let tried = work.steps + work.rejected + work.failed;
                let iterated = work.iterations >= work.steps || work.jacobians == 0;
                assert!(iterated && work.jacobians <= tried, "{work:?}");
            }
            work.push(outcomes[0].work);
        }
        work
    }};
}

fn states(x: &[f64], _: &[f64]) -> Vec<f64> {
    x.to_vec()
}

const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];

#[test]
fn robertson() {
    let problem = || Problem::load("robertson", 1e-8, 20.0);
    let work = follows!(variable::<Robertson, 3, 0, 3>(problem(), TOLERANCES, 1e12, states));
    assert!(work.iter().all(|work| work.steps < 150 && work.jacobians < 120), "{work:?}");
    follows!(three::<Robertson, 3, 0, 3>(problem(), [1e-4, 1e-7], 1e12, states));
    let mut problem = problem();
    problem.states.truncate(2);
    let all = |x: &[f64], z: &[f64]| [x, z].concat();
    follows!(variable::<RobertsonConserved, 2, 1, 3>(problem, TOLERANCES, 1e12, all));
}

/// The first end lies in the fall after the induction, where the rounding of the data alone changes
/// digits 25 times as much as at the second.
#[test]
fn hires() {
    let work =
        follows!(variable::<Hires, 8, 0, 0>(Problem::load("hires", 1e-3, 100.0), TOLERANCES, 1e3, states));
    assert!(work.iter().all(|work| work.steps < 150 && work.jacobians < 120), "{work:?}");
}

/// Errors shift the phase of the next jump: the longer it runs, the more.
#[test]
fn van_der_pol() {
    let problem = Problem::load("van_der_pol_1e3", 1e-3, 100.0);
    let work = follows!(variable::<VanDerPol, 2, 0, 1>(problem, TOLERANCES, 1e9, states));
    assert!(work.iter().all(|work| work.steps < 400), "{work:?}");
    let problem = Problem::load("van_der_pol_1e6", 1e-6, 100.0);
    follows!(variable::<VanDerPol, 2, 0, 1>(problem, TOLERANCES, 1e9, states));
    let problem = Problem::load("van_der_pol_scaled_1e-6", 1.0, 100.0);
    follows!(variable::<VanDerPolScaled, 2, 0, 1>(problem, TOLERANCES, 1e9, states));
    let problem = Problem::load("van_der_pol_scaled_1e-12", 1.0, 100.0);
    follows!(variable::<VanDerPolScaled, 2, 0, 1>(problem, TOLERANCES, 1e9, states));
}

#[test]
fn oregonator() {
    let problem = Problem::load("oregonator", 1e-2, 100.0);
    let work = follows!(variable::<Oregonator, 3, 0, 4>(problem, TOLERANCES, 1e9, states));
    assert!(work.iter().all(|work| work.steps < 400), "{work:?}");
}

/// Written as four rates, y4 at late times is the difference of numbers that carry rounding errors
/// of early ones, 1e-20; with the invariant as an equation it is not.
#[test]
fn e5() {
    let problem = Problem::load("e5", 1e-22, 100.0);
    follows!(variable::<E5, 4, 0, 0>(problem, [1e-4, 1e-6, 1e-7], 1e5, states));
    // At 1e11 the smallest, y4, is 3.7e-65: no absolute tolerance may hide it.
    let mut problem = Problem::load("e5", 1e-80, 10.0);
    problem.states = vec![1.76e-3, 0.0, 0.0];
    let values = |x: &[f64], z: &[f64]| vec![x[0], x[1], z[0], x[2]];
    follows!(variable::<E5Conserved, 3, 1, 0>(problem, TOLERANCES, 1e12, values));
}

#[test]
fn akzo_nobel() {
    let problem = || Problem::load("akzo_nobel", 1e-3, 20.0);
    let all = |x: &[f64], z: &[f64]| [x, z].concat();
    let work = follows!(variable::<AkzoNobel, 5, 1, 9>(problem(), TOLERANCES, 1e9, all));
    assert!(work.iter().all(|work| work.steps < 80 && work.rejected < 5), "{work:?}");
    follows!(three::<AkzoNobel, 5, 1, 9>(problem(), TOLERANCES, 1e9, all));
}

/// Both forms: with a matrix of `ẋ` that has not full rank, and with algebraic states. At the
/// tightest tolerance, the rounding errors of nodes at 6 V are above what Newton's method is asked
/// for at nodes around 0 V.
#[test]
fn transistor_amplifier() {
    let problem = Problem::load("transistor_amplifier", 1e-2, 100.0);
    follows!(variable::<TransistorAmplifier, 8, 0, 0>(problem, [1e-4, 1e-7, 1e-10, 1e-12], 1.0, states));
    let mut problem = Problem::load("transistor_amplifier", 1e-2, 100.0);
    let y = problem.states;
    problem.states = vec![y[1] - y[0], y[2], y[4] - y[3], y[5], y[7] - y[6]];
    let values =
        |x: &[f64], z: &[f64]| vec![z[0], z[0] + x[0], x[1], z[1], z[1] + x[2], x[3], z[2], z[2] + x[4]];
    follows!(variable::<TransistorCapacitors, 5, 3, 0>(problem, [1e-4, 1e-7], 1.0, values));
}

#[test]
fn ring_modulator() {
    let problem = Problem::load("ring_modulator", 1e-4, 100.0);
    follows!(variable::<RingModulator, 15, 0, 0>(problem, [1e-6], 1.0, states));
}

/// Close encounters multiply errors by ten thousand.
#[test]
fn pleiades() {
    let problem = Problem::load("pleiades", 1.0, 1e4);
    follows!(variable::<Pleiades, 28, 0, 0>(problem, [1e-5, 1e-8], 5.0, states));
}

/// The angles turn several times, and are not stabilised.
#[test]
fn squeezer() {
    let problem = Problem::load("squeezer", 1.0, 1e3);
    let all = |x: &[f64], z: &[f64]| [x, z].concat();
    follows!(variable::<Squeezer, 14, 13, 0>(problem, [1e-5, 1e-8], 1.0, all));
}

/// Beside the Fortran code: E. Hairer's driver for RADAU5 at Van der Pol's equation reports 242
/// steps accepted and 8 refused, 280 tried, 2248 evaluations, 162 Jacobians and 253 factorisations
/// (reproduced in the tests of russell_ode by D. Pedroso). The algorithm is the same but for the
/// norm in which Newton's method is stopped, its start in the first step, and the Jacobian, which
/// is that of the middle of the step: the same steps with less work.
#[test]
fn steps_of_radau5() {
    let options = AdaptiveOptions { rtol: 1e-4, atol: 1e-4, initial_step: Some(1e-6), ..Default::default() };
    let mut adaptive = Adaptive::<VanDerPolScaled, RadauIIA<3>>::new(options).expect("valid");
    adaptive.set_parameters(&SVector::from([1e6])).expect("finite");
    adaptive.solve(&SVector::from([2.0, -0.66]), &SVector::zeros(), 2.0).expect("a solution");
    let work = *adaptive.statistics();
    let near = |found: usize, published: usize| {
        assert!(found.abs_diff(published) <= published / 10, "{found} instead of {published}: {work:?}");
    };
    near(work.steps, 242);
    // The Jacobian in the middle of a step leaves 4 failures of 30, and with them 38 attempts,
    // their factors and their stages.
    let fewer = |found: usize, published: usize, spared: usize| {
        let range = published - spared * 5 / 4..=published - spared * 3 / 4;
        assert!(range.contains(&found), "{found} instead of {published} − {spared}: {work:?}");
    };
    near(work.jacobians, 162);
    fewer(work.steps + work.rejected + work.failed, 280, 33);
    fewer(work.residuals, 2248, 404);
    fewer(work.factorizations, 253, 47);
}

/// Dense output is as good as the method between its steps: order `s + 1`, so that it follows the
/// tolerance too. And output while integrating is the same.
#[test]
fn dense_output() {
    let problem = Problem::load("akzo_nobel", 1e-3, 20.0);
    let options = AdaptiveOptions { rtol: 1e-8, atol: 1e-11, ..Default::default() };
    let mut adaptive = Adaptive::<AkzoNobel, Radau>::new(options).expect("valid");
    adaptive.set_parameters(&problem.record.vector("p").expect("parameters")).expect("finite");
    let x0 = SVector::from_column_slice(&problem.states);
    let times: Vec<f64> = (0..=18).map(|i| 10.0 * f64::from(i)).collect();
    let mut passed = Vec::new();
    adaptive
        .solve_at(&x0, &SVector::zeros(), 180.0, &times, |t, dense| passed.push((t, dense.x, dense.z)))
        .expect("a solution");
    assert_eq!(passed.len(), times.len());
    for (t, x, z) in &passed {
        let dense = adaptive.dense(*t).expect("inside");
        // At a time between two steps either polynomial may be taken.
        assert!((dense.x - x).amax() <= 1e-12 && (dense.z - z).amax() <= 1e-12);
    }
    for (t, x, _) in passed.iter().skip(1) {
        let options = AdaptiveOptions { rtol: 1e-11, atol: 1e-14, keep_steps: false, ..Default::default() };
        let mut exact = Adaptive::<AkzoNobel, Radau>::new(options).expect("valid");
        exact.set_parameters(&problem.record.vector("p").expect("parameters")).expect("finite");
        let exact = exact.solve(&x0, &SVector::zeros(), *t).expect("a solution");
        let error = (x - exact.x).component_div(&exact.x).amax();
        assert!(error <= 1e-6, "t = {t}: {error:e}");
    }
}

/// What has no solution ends with an error that says why.
#[test]
fn errors_of_unsolvable_problems() {
    let x0 = SVector::from([2.0, 0.0]);
    let run = |options: AdaptiveOptions| {
        let mut adaptive = Adaptive::<VanDerPol, Radau>::new(options)?;
        adaptive.set_parameters(&SVector::from([1e3]))?;
        adaptive.solve(&x0, &SVector::zeros(), 2e3).map(|result| result.x)
    };
    let default = AdaptiveOptions::default();
    assert!(matches!(
        run(AdaptiveOptions { max_steps: 10, ..default }),
        Err(Error::TooManySteps { steps: 10, .. })
    ));
    assert!(matches!(
        run(AdaptiveOptions { min_step: 1.0, ..default }),
        Err(Error::StepSizeUnderflow { .. })
    ));
    for rtol in [0.0, -1.0, 1e-17, 2.0, f64::NAN] {
        assert!(matches!(
            run(AdaptiveOptions { rtol, ..default }),
            Err(Error::InvalidOption { option: "rtol", .. })
        ));
    }
    for atol in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        assert!(matches!(
            run(AdaptiveOptions { atol, ..default }),
            Err(Error::InvalidOption { option: "atol", .. })
        ));
    }
    let mut adaptive = Adaptive::<VanDerPol, Radau>::new(default).expect("valid");
    assert_eq!(adaptive.solve(&x0, &SVector::zeros(), 1.0).err(), Some(Error::ParametersNotSet));
    adaptive.set_parameters(&SVector::from([1.0])).expect("finite");
    assert_eq!(adaptive.dense(0.5).err(), Some(Error::NoResult));
    let nothing = *adaptive.solve(&x0, &SVector::zeros(), 0.0).expect("nothing to do");
    assert_eq!(nothing.x, x0);
    assert_eq!(adaptive.dense(0.0).expect("the start").x, x0);
    assert!(adaptive.solve(&x0, &SVector::zeros(), f64::NAN).is_err());
}

/// Backwards is the way back.
#[test]
fn integration_backwards() {
    let options = AdaptiveOptions { rtol: 1e-10, atol: 1e-10, ..Default::default() };
    let mut adaptive = Adaptive::<VanDerPol, Radau>::new(options).expect("valid");
    adaptive.set_parameters(&SVector::from([1.0])).expect("finite");
    let x0 = SVector::from([2.0, 0.0]);
    let there = adaptive.solve(&x0, &SVector::zeros(), 3.0).expect("a solution").x;
    adaptive.set_time(3.0).expect("finite");
    let back = adaptive.solve(&there, &SVector::zeros(), -3.0).expect("a solution").x;
    // Backwards its limit cycle repels: over half a turn, errors grow by a few hundred.
    assert!((back - x0).amax() <= 1e-7, "{back}");
}

runner!(fifth, DormandPrince5, Ode);
runner!(eighth, DormandPrince8, Ode);

/// Explicit pairs on what is not stiff: the tolerance bounds the estimate of the lower order, so
/// that the better method is better than asked.
#[test]
fn explicit_pairs() {
    let work =
        follows!(fifth::<Pleiades, 28, 0, 0>(Problem::load("pleiades", 1.0, 1e4), [1e-4, 1e-7], 5.0, states));
    assert!(work[1].steps < 600, "{work:?}");
    let problem = Problem::load("pleiades", 1.0, 1e4);
    let work = follows!(eighth::<Pleiades, 28, 0, 0>(problem, [1e-4, 1e-7, 1e-10], 5.0, states));
    // Errors that nothing takes back count once for ten steps of the interval.
    assert!(work[2].steps < 380, "{work:?}");
    // Twelve stages for each step, the one that is the next step's first included, which most that
    // are refused do without, and few to start. Rounding errors are measured by one evaluation in
    // twenty attempts.
    let AdaptiveStatistics { steps, rejected, residuals, .. } = work[2];
    let measured = (steps + rejected) / 20 + 1;
    assert!(residuals <= 12 * (steps + rejected) + measured + 4, "{work:?}");
    assert!(residuals >= 12 * steps + 11 * rejected, "{work:?}");
}

/// A circle, whose dense output is known: of order 4 and 7 between steps of orders 5 and 8.
#[test]
fn explicit_dense_output() {
    let x0 = SVector::from([1.0, 0.0]);
    macro_rules! circle {
        ($method:ty) => {{
            let mut errors = [0.0f64; 2];
            let mut steps = [0; 2];
            for (index, rtol) in [1e-6, 1e-10].into_iter().enumerate() {
                let options = AdaptiveOptions { rtol, atol: rtol, ..Default::default() };
                let mut adaptive = Adaptive::<VanDerPol, $method>::new(options).expect("valid");
                // Without damping it is a circle.
                adaptive.set_parameters(&SVector::from([0.0])).expect("finite");
                let times: Vec<f64> = (0..=60).map(|i| 0.1 * f64::from(i)).collect();
                let mut passed = Vec::new();
                adaptive
                    .solve_at(&x0, &SVector::zeros(), 6.0, &times, |t, dense| passed.push((t, dense.x)))
                    .expect("a solution");
                assert_eq!(passed.len(), times.len());
                steps[index] = adaptive.statistics().steps;
                for (t, x) in passed {
                    let error = (x - SVector::from([t.cos(), -t.sin()])).amax();
                    errors[index] = errors[index].max(error);
                    let dense = adaptive.dense(t).expect("inside");
                    assert!((dense.x - x).amax() <= 1e-14);
                }
                assert!(errors[index] <= 100.0 * rtol, "{rtol:e}: {errors:?}");
            }
            (errors, steps)
        }};
    }
    let (_, steps) = circle!(DormandPrince5);
    // Four digits more with order 5: 10^(4/5) times the steps.
    assert!((4.0..9.0).contains(&(steps[1] as f64 / steps[0] as f64)), "{steps:?}");
    let (_, steps) = circle!(DormandPrince8);
    assert!((2.0..5.0).contains(&(steps[1] as f64 / steps[0] as f64)), "{steps:?}");
}
