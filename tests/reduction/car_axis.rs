//! The car axis from its constraints, against the reference of the test set.

use super::mechanisms::CarAxis;
use casados::prelude::*;
use nalgebra::{Vector2, vector};

/// At `t = 3`, in quadruple precision by GAMD (Test Set for IVP Solvers, release 2.4, car axis).
const END: [f64; 10] = [
    0.493_455_784_275_402_8e-1,
    0.496_989_460_230_171_15,
    1.041_742_524_885_421_5,
    0.373_911_027_265_361_26,
    -0.770_583_684_040_972_4e-1,
    0.744_686_658_723_778_6e-2,
    0.175_568_157_537_232_22e-1,
    0.770_341_043_779_252,
    -0.473_688_659_084_893_3e-2,
    -0.110_468_033_125_734_37e-2,
];

/// Errors follow the tolerance: the velocities of the reference are of size one, and what is off at
/// the constraints grows linearly with time.
#[test]
fn reference_end_values() {
    for tolerance in [1e-6, 1e-8, 1e-10] {
        let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
        let mut radau = Adaptive::<CarAxis, Radau>::new(options).unwrap();
        let start = vector![0.0, 0.5, 1.0, 0.5, -0.5, 0.0, -0.5, 0.0];
        let end = radau.solve(&start, &vector![], 3.0).unwrap();
        for (state, expected) in end.x.iter().zip(END) {
            let error = (state - expected).abs() / (tolerance * (1.0 + expected.abs()));
            assert!(error < 30.0, "{tolerance}: {error}");
        }
        let multipliers = (end.z - Vector2::new(END[8], END[9])).amax();
        // The multipliers of masses of 5e-4 follow from accelerations of size one.
        assert!(multipliers < 30.0 * tolerance, "{tolerance}: {multipliers}");
    }
}
