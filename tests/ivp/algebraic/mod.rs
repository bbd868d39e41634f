//! Differential-algebraic equations of index one beside the same models with their algebraic states
//! eliminated by hand: errors follow the tolerance in both, and both are solved at every one.
//!
//! Errors are relative to `atol + rtol |x|` of the worst component, fifty at most: those of
//! hundreds of steps, each a part of its tolerance.

mod plants;

use super::tolerances::tell;
use casados::{Adaptive, AdaptiveOptions, Gauss, Radau};
use nalgebra::SVector;
use plants::{
    Exchanger, ExchangerEliminated, LongBeam, LongBeamInRanges, Pipes, PipesEliminated, Tanks,
    TanksEliminated,
};
use reference_data::Record;

const ALLOWED: f64 = 50.0;

/// The states at the end of a record, at each tolerance.
macro_rules! follows {
    ($name:literal, $model:ty, $method:ty, $tolerances:expr) => {{
        let set = Record::load("ivp/algebraic.json").expect("the reference is there");
        let record = set.record($name).expect("a problem");
        let (x0, t) = (record.list("x0").expect("states"), record.number("t").expect("a time"));
        let expected = record.list("y").expect("values");
        for tolerance in $tolerances {
            let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, $method>::new(options).expect("valid");
            let x = adaptive.solve(&SVector::from_column_slice(&x0), &SVector::zeros(), t);
            let x = x.unwrap_or_else(|error| panic!("{tolerance:e}: {error}")).x;
            let relative =
                |(found, expected): (&f64, &f64)| (found - expected).abs() / (1.0 + expected.abs());
            let error = x.iter().zip(&expected).map(relative).fold(0.0, f64::max) / tolerance;
            tell(
                concat!(stringify!($model), " | ", stringify!($method)),
                tolerance,
                error,
                adaptive.statistics(),
            );
            assert!(error <= ALLOWED, "{error} tolerances of {tolerance:e}");
        }
    }};
}

const TOLERANCES: [f64; 4] = [1e-4, 1e-6, 1e-8, 1e-10];

/// To thousands of steps at finer tolerances: nothing damps the fast oscillations.
const COARSE_TOLERANCES: [f64; 3] = [1e-4, 1e-6, 1e-8];

#[test]
fn elastic_beam() {
    follows!("beam_40", LongBeam, Radau, COARSE_TOLERANCES);
}

/// What is said about values changes which pivots are planned, and no result.
#[test]
fn beam_with_ranges() {
    follows!("beam_40", LongBeamInRanges, Radau, COARSE_TOLERANCES);
}

#[test]
fn hydraulic_network() {
    follows!("pipes", Pipes, Radau, TOLERANCES);
    follows!("pipes", PipesEliminated, Radau, TOLERANCES);
    follows!("pipes", Pipes, Gauss<3>, TOLERANCES);
}

#[test]
fn stirred_tanks() {
    follows!("tanks", Tanks, Radau, TOLERANCES);
    follows!("tanks", TanksEliminated, Radau, TOLERANCES);
    follows!("tanks", Tanks, Gauss<3>, TOLERANCES);
}

#[test]
fn heat_exchanger() {
    follows!("exchanger", Exchanger, Radau, TOLERANCES);
    follows!("exchanger", ExchangerEliminated, Radau, TOLERANCES);
    follows!("exchanger", Exchanger, Gauss<3>, TOLERANCES);
}
