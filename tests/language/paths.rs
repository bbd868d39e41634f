//! Paths: `self`, `super`, modules in modules, modules that the macro does not see.

use casados::prelude::*;

use crate::emitted_residual;

const G: f64 = 9.0;
const OFFSET: f64 = 0.25;

/// A module of ordinary name.
mod consts {
    pub const E: f64 = 210e9;
}

mod other {
    pub const SCALE: f64 = 3.0;
    pub struct Motor;
    impl Motor {
        pub const K: f64 = 11.0;
    }
}

/// Beside a function alone there is nothing that the macro sees.
#[ode]
fn beam(x: f64) -> f64 {
    -consts::E * x + self::G + core::f64::consts::E + other::Motor::K
}

#[ode]
mod outer {
    use core::f64::consts;

    const G: f64 = 5.0;
    const OFFSET: f64 = super::OFFSET;

    pub struct Motor;
    impl Motor {
        pub const K: f64 = 1.0;
    }
    pub struct State {
        pub a: f64,
    }

    fn twice(x: f64) -> f64 {
        2.0 * x
    }

    pub mod inner {
        use super::super::other;
        use super::State;

        const G: f64 = 7.0;

        pub fn twice(x: f64) -> f64 {
            -super::twice(x) * self::G * G
        }

        pub fn sum(x: &State) -> f64 {
            x.a * super::G + super::super::G + other::SCALE + super::super::other::Motor::K
        }

        pub mod deep {
            use super::super::*;

            pub fn all(x: &State) -> f64 {
                twice(x.a) + super::twice(x.a) * super::super::OFFSET + G
            }
        }
    }

    use inner::deep;

    pub fn outer(x: &State) -> State {
        let a =
            super::G * x.a + self::G + OFFSET * self::inner::twice(x.a) + super::other::Motor::K * Motor::K;
        State { a: a + inner::sum(x) + deep::all(x) * consts::PI }
    }
}

#[test]
fn path_resolution() {
    for x in [0.3, -1.7, 2.9] {
        assert_eq!(emitted_residual::<Beam>(&[0.0, x, 0.0]), [-beam(x)]);
        let expected = outer::outer(&outer::State { a: x }).a;
        assert_eq!(emitted_residual::<Outer>(&[0.0, x, 0.0]), [-expected]);
    }
}
