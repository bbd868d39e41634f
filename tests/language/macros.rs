//! Models out of `macro_rules!`, names that emitted code could meet, and text that other programs
//! write.

use crate::same_bits;
use casados::ode;

macro_rules! scaled {
    ($name:ident, $factor:expr) => {
        #[ode]
        fn $name(x: f64) -> f64 {
            x * $factor
        }
    };
}

scaled!(precedence, 1.0 + 2.0);

/// A macro's `s` is not that of its caller.
macro_rules! two_variables {
    ($s:ident, $value:expr) => {
        #[ode]
        fn hygiene(x: [f64; 2]) -> [f64; 2] {
            let $s = x[0] + 0.5;
            let s = 7.0 * x[1];
            [$value, s - [1.0, s].map(|s| s * x[0])[1]]
        }
    };
}

two_variables!(s, s * 2.0);

/// The same for raw names.
macro_rules! raw_variables {
    ($s:ident) => {
        #[ode]
        fn raw_names(x: f64) -> f64 {
            let $s = x + 0.5;
            let r#in = 2.0 * x;
            $s * r#in - x
        }
    };
}

raw_variables!(r#in);

/// Constants with the names of what is emitted.
#[ode]
#[allow(non_upper_case_globals)]
mod some {
    const v: f64 = 2.0;
    const f: f64 = 3.0;
    const jacobian: f64 = 4.0;
    const hessian: f64 = 5.0;
    const gradient: f64 = 6.0;
    const mu: f64 = 7.0;

    pub fn some(x: [f64; 2]) -> [f64; 2] {
        [v * x[0] * x[1] * mu, f * x[1] * jacobian + hessian * gradient]
    }
}

#[ode]
fn 模型(x: f64) -> f64 {
    2.0 * x
}

/// Modules of tests are not part of a model.
#[ode]
mod tested {
    const RATE: f64 = 3.0;

    pub fn tested(x: f64) -> f64 {
        -RATE * x
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn decays() {
            assert_eq!(tested(2.0), -6.0);
        }
    }
}

#[test]
fn operator_precedence() {
    same_bits::<Precedence>(|v| vec![v[0] - precedence(v[1])]);
    assert_eq!(precedence(2.0), 6.0);
}

#[test]
fn macro_hygiene() {
    same_bits::<RawNames>(|v| vec![v[0] - raw_names(v[1])]);
    same_bits::<Hygiene>(|v| {
        let rate = hygiene([v[2], v[3]]);
        vec![v[0] - rate[0], v[1] - rate[1]]
    });
    assert_eq!(hygiene([1.0, 1.0])[0], 3.0);
}

#[test]
fn names_of_constants() {
    same_bits::<some::Some>(|v| {
        let rate = some::some([v[2], v[3]]);
        vec![v[0] - rate[0], v[1] - rate[1]]
    });
}

#[test]
fn names_without_upper_case() {
    same_bits::<M模型>(|v| vec![v[0] - 模型(v[1])]);
}

#[test]
fn modules_of_tests() {
    same_bits::<tested::Tested>(|v| vec![v[0] - tested::tested(v[1])]);
}
