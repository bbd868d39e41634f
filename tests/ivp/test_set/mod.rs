//! Differential-algebraic problems of the Test Set for IVP Solvers beside their references: errors
//! follow the tolerance.
//!
//! Errors are relative to `atol + rtol |x|` of the worst component, fifty at most, as in
//! [`algebraic`](super::algebraic).

mod fekete;
mod nand;
// The equations of nodes are a loop, as the others are.
#[allow(clippy::manual_memcpy)]
mod water_tubes;

use super::tolerances::tell;
use casados::{Adaptive, AdaptiveOptions, Radau};
use nalgebra::SVector;

const ALLOWED: f64 = 50.0;

/// The states at the end, at each tolerance; `atol` is relative to the relative one.
macro_rules! follows {
    ($model:ty, $start:expr, $t:expr, $expected:expr, $atol:expr, $tolerances:expr) => {{
        for tolerance in $tolerances {
            let options = AdaptiveOptions { rtol: tolerance, atol: $atol * tolerance, ..Default::default() };
            let mut adaptive = Adaptive::<$model, Radau>::new(options).expect("valid");
            let x = adaptive.solve(&SVector::from_column_slice(&$start), &SVector::zeros(), $t);
            let x = x.unwrap_or_else(|error| panic!("{tolerance:e}: {error}")).x;
            let relative =
                |(found, expected): (&f64, &f64)| (found - expected).abs() / ($atol + expected.abs());
            let expected: &[f64] = &$expected;
            let error = x.iter().zip(expected).map(relative).fold(0.0, f64::max) / tolerance;
            tell(concat!(stringify!($model), " | Radau"), tolerance, error, adaptive.statistics());
            assert!(error <= ALLOWED, "{error} tolerances of {tolerance:e}");
        }
    }};
}

/// Fully implicit, with a mass matrix of voltages and 24 corners of its inputs.
#[test]
fn nand_gate() {
    follows!(nand::equations::Nand, nand::START, 80.0, nand::END, 1.0, [1e-4, 1e-6, 1e-8]);
}

/// Of index 2.
#[test]
fn water_tubes() {
    let mut start = [0.0; 20];
    (start[18], start[19]) = (109_800.0, 109_800.0);
    let expected = [&water_tubes::FLOWS[..], &water_tubes::PRESSURES[..]].concat();
    follows!(water_tubes::equations::WaterTubes, start, 17.0 * 3600.0, expected, 1e-3, [1e-4, 1e-6, 1e-8]);
}

/// Of index 2, twenty constraints of positions and of velocities each; the positions.
#[test]
fn fekete_points() {
    let end = fekete::END.as_flattened();
    follows!(fekete::equations::Fekete, fekete::start(), 1000.0, end, 1.0, [1e-4, 1e-6, 1e-8]);
}
