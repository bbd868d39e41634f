//! States far below the absolute tolerance, of a model that has no solution where they are
//! negative: iterations that leave nothing of the tolerance have to leave little of them, too.

use casados::{Adaptive, AdaptiveOptions, Error, Gauss, Radau, ode};
use nalgebra::{SVector, vector};

/// Problem E5 of W. H. Enright, T. E. Hull, B. Lindberg, Comparing numerical methods for stiff
/// systems of O.D.E.s, BIT 15 (1975).
#[ode]
fn gear(x: [f64; 4]) -> [f64; 4] {
    let (first, second) = (7.89e-10 * x[0], 1.1e7 * x[0] * x[2]);
    let (third, fourth) = (1.13e9 * x[1] * x[2], 1.13e3 * x[3]);
    [-first - second, first - third, first - second + fourth - third, second - fourth]
}

/// At `t = 1000`: SciPy 1.17, `Radau`, `rtol = 1e-11` and `atol = 1e-22`.
const END: [f64; 4] =
    [0.0016180769999072624, 1.3822370304977638e-10, 8.251573500690435e-12, 1.2997212954925493e-10];

#[test]
fn states_below_the_tolerance() -> Result<(), Error> {
    let x0 = vector![1.76e-3, 0.0, 0.0, 0.0];
    macro_rules! follows {
        ($method:ty) => {
            for tolerance in [1e-4, 1e-5, 1e-6, 1e-8, 1e-10] {
                let options = AdaptiveOptions { rtol: tolerance, atol: tolerance, ..Default::default() };
                let mut adaptive = Adaptive::<Gear, $method>::new(options)?;
                let x = adaptive.solve(&x0, &SVector::zeros(), 1000.0)?.x;
                for (x, end) in x.iter().zip(END) {
                    assert!((x - end).abs() <= 30.0 * tolerance * (1.0 + end), "{tolerance:e}: {x} is {end}");
                }
            }
        };
    }
    follows!(Radau);
    follows!(Gauss<3>);
    follows!(Gauss<4>);
    Ok(())
}
