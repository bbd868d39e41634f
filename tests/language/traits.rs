//! Traits that a model implements for its own types.

use crate::same_bits;
use casados::{dae, ode};

/// Conversions: which `From` is meant depends on both types.
#[ode]
mod conversions {
    #[derive(Clone, Copy)]
    pub struct Polar {
        pub r: f64,
        pub angle: f64,
    }

    #[derive(Clone, Copy)]
    pub struct Cartesian {
        pub r: f64,
        pub angle: f64,
    }

    impl From<Polar> for Cartesian {
        fn from(p: Polar) -> Self {
            Self { r: p.r * p.angle.cos(), angle: p.r * p.angle.sin() }
        }
    }

    impl From<f64> for Cartesian {
        fn from(r: f64) -> Self {
            Self { r, angle: 0.5 }
        }
    }

    impl From<[f64; 2]> for Cartesian {
        fn from([angle, r]: [f64; 2]) -> Self {
            Self { r, angle }
        }
    }

    impl From<Cartesian> for f64 {
        fn from(c: Cartesian) -> f64 {
            c.r * 2.0 + c.angle
        }
    }

    fn sum(c: Cartesian) -> f64 {
        c.into()
    }

    pub fn conversions(x: [f64; 2]) -> [f64; 2] {
        let polar = Polar { r: x[0], angle: x[1] };
        let c: Cartesian = polar.into();
        let d = Cartesian::from(x[1]);
        let e = Cartesian::from(x);
        [c.r + d.angle * d.r + sum(polar.into()), c.angle - e.angle * 3.0 + sum(x[0].into())]
    }
}

/// One method name of one trait, for arguments of several types.
#[ode]
mod overloads {
    pub trait Push<T> {
        fn push(self, by: T) -> Self;
    }

    #[derive(Clone, Copy)]
    pub struct Mass(pub f64);

    impl Push<f64> for Mass {
        fn push(self, by: f64) -> Self {
            Mass(self.0 + by)
        }
    }

    impl Push<[f64; 2]> for Mass {
        fn push(self, by: [f64; 2]) -> Self {
            Mass(self.0 * by[0] - by[1])
        }
    }

    pub fn overloads(x: [f64; 2]) -> [f64; 2] {
        [Mass(x[0]).push(x[1]).0, Mass(x[1]).push(x).0]
    }
}

/// Defaults, derived and implemented, and `matches!`.
#[dae]
mod defaults {
    #[derive(Clone, Copy, Default)]
    pub struct Total {
        pub gain: Gain,
        pub offset: f64,
    }

    #[derive(Clone, Copy)]
    pub struct Gain(pub f64);

    impl Default for Gain {
        fn default() -> Self {
            Self(3.0)
        }
    }

    #[derive(Clone, Copy)]
    pub enum Element {
        Spring { stiffness: f64 },
        Damper(f64),
    }

    impl Element {
        fn is_stiff(&self) -> bool {
            matches!(self, Element::Spring { stiffness } if *stiffness > 1.0)
        }
    }

    pub fn defaults(xdot: f64, x: f64) -> f64 {
        let total = Total { offset: 0.25, ..Default::default() };
        let elements =
            [Element::Spring { stiffness: 2.0 }, Element::Damper(1.0), Element::Spring { stiffness: 0.5 }];
        let stiff = elements.iter().filter(|element| element.is_stiff()).count();
        let near = if matches!(elements[1], Element::Damper(d) if d * x > 0.5) { 2.0 } else { 1.0 };
        xdot - total.gain.0 * x - total.offset * stiff as f64 * near - Total::default().offset
    }
}

/// A method of nalgebra comes before one of a trait that takes `&self`, not before one that takes
/// `self`.
#[ode]
mod hidden {
    use nalgebra::Vector3;

    trait Smooth {
        fn norm(&self) -> f64;
        fn sum(self) -> f64;
    }
    impl Smooth for Vector3<f64> {
        fn norm(&self) -> f64 {
            (self.dot(self) + 0.01).sqrt()
        }
        fn sum(self) -> f64 {
            self.x * self.y * self.z
        }
    }

    fn of_any<T: Smooth>(v: &T) -> f64 {
        v.norm()
    }

    pub fn hidden(x: Vector3<f64>) -> [f64; 3] {
        let rate = x.norm() + 2.0 * Smooth::norm(&x) + 3.0 * of_any(&x);
        [rate, x.sum(), Vector3::norm(&x)]
    }
}

#[test]
fn method_resolution() {
    same_bits::<hidden::Hidden>(|v| {
        let rates = hidden::hidden(nalgebra::Vector3::new(v[3], v[4], v[5]));
        (0..3).map(|i| v[i] - rates[i]).collect()
    });
}

#[test]
fn conversions_between_types() {
    same_bits::<Conversions>(|v| {
        let g = conversions::conversions([v[2], v[3]]);
        vec![v[0] - g[0], v[1] - g[1]]
    });
}

#[test]
fn trait_implementations_for_several_types() {
    same_bits::<Overloads>(|v| {
        let g = overloads::overloads([v[2], v[3]]);
        vec![v[0] - g[0], v[1] - g[1]]
    });
}

#[test]
fn defaults_and_matches_macro() {
    same_bits::<Defaults>(|v| vec![defaults::defaults(v[0], v[1])]);
}
