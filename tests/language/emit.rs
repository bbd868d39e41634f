//! Emitted code computes the bits of the function that it was made from, in one piece or in
//! several.

use casados::testing::{Points, check_derivatives};
use casados::{Dae, dae};

const RATE: f64 = 0.37;

/// A selection, a constant that the macro does not see, an algebraic state, time.
#[dae]
fn valve(t: f64, xdot: f64, z: f64, x: f64, p: f64) -> [f64; 2] {
    let level = if x > 0.0 { x.sqrt() * RATE } else { x };
    [xdot * z - p * level, z + t.sin() * x - 2.0]
}

/// Long enough for several functions, with values that cross the cuts.
#[dae]
fn long(xdot: [f64; 3], x: [f64; 3]) -> [f64; 3] {
    let mut a = x;
    for i in 0..250 {
        let open = a[0] < a[1];
        a = [
            a[1] * 0.7 + x[2],
            (a[2] - a[0] * x[1]).sin(),
            if open { a[0] + x[0] } else { a[2] * 0.9 - i as f64 },
        ];
    }
    [xdot[0] - a[0], xdot[1] - a[1] * x[0], xdot[2] - a[2]]
}

#[test]
fn emitted_values() {
    for x in [-1.5, -0.0, 0.0, 0.3, 2.0] {
        let mut f = [0.0; 2];
        Valve::residual::<f64>(&[0.3, x, 1.7, -0.4, 0.9], &mut f);
        assert_eq!(f.map(f64::to_bits), valve(0.9, 0.3, 1.7, x, -0.4).map(f64::to_bits));

        let mut f = [0.0; 3];
        Long::residual::<f64>(&[0.1, 0.2, 0.3, x, 0.4, -0.6, 0.0], &mut f);
        assert_eq!(f.map(f64::to_bits), long([0.1, 0.2, 0.3], [x, 0.4, -0.6]).map(f64::to_bits));
    }
    const { assert!(Long::STRUCTURE.operations.residual > 1000) };
}

#[test]
fn emitted_derivatives() {
    check_derivatives::<Valve>(&Points::random(10).x(0, 0.2..=1.0)).assert();
}
