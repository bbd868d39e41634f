//! What is drawn from a seed.

use casados::options::{Jacobian, Newton, Start};
use casados::{AdaptiveOptions, Options, Real};
use nalgebra::SVector;

/// Numbers out of a seed (splitmix64).
pub struct Source {
    state: u64,
    /// One number in so many is a special one; none if it is zero.
    special: usize,
}

impl Source {
    pub fn new(seed: u64) -> Self {
        let mut source = Self { state: seed, special: 0 };
        source.special = [0, 2, 10, 40][source.below(4)];
        source
    }
    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    pub fn below(&mut self, bound: usize) -> usize {
        (self.bits() % bound as u64) as usize
    }
    /// Between −3 and 3, or anything.
    pub fn number(&mut self) -> f64 {
        if self.special > 0 && self.below(self.special) == 0 {
            let special = [
                0.0,
                -0.0,
                1.0,
                f64::NAN,
                f64::INFINITY,
                f64::NEG_INFINITY,
                f64::MAX,
                -f64::MAX,
                f64::MIN_POSITIVE,
                5e-324,
                -1e-310,
                1e-300,
                1e300,
                -1e30,
                1e-30,
                f64::EPSILON,
            ];
            return match self.below(special.len() + 3) {
                any if any < special.len() => special[any],
                _ => f64::from_bits(self.bits()),
            };
        }
        6.0 * ((self.bits() >> 11) as f64 / (1u64 << 53) as f64) - 3.0
    }
    pub fn vector<T: Real, const N: usize>(&mut self) -> SVector<T, N> {
        SVector::from_fn(|_, _| T::from_f64(self.number()))
    }
    /// The length of an interval: mostly one that can be integrated.
    pub fn length(&mut self) -> f64 {
        self.number() * [0.01, 0.1, 1.0, 0.0][self.below(4)]
    }
    pub fn options(&mut self) -> Options {
        Options {
            steps: [1, 1, 2, 3, 0][self.below(5)],
            newton: Newton {
                tolerance: [0.0, 0.0, 1e-6, self.number()][self.below(4)],
                max_iterations: [50, 50, 7, 1, 0][self.below(5)],
                jacobian: [Jacobian::Auto, Jacobian::Simplified, Jacobian::Full, Jacobian::Frozen]
                    [self.below(4)],
                fixed_iterations: [None, None, None, Some(2), Some(self.below(4))][self.below(5)],
            },
            start: [Start::Zero, Start::Given, Start::Warm][self.below(3)],
            compensated: self.below(2) == 0,
        }
    }
    pub fn adaptive_options(&mut self) -> AdaptiveOptions {
        AdaptiveOptions {
            rtol: [1e-3, 1e-6, 1e-9, self.number()][self.below(4)],
            atol: [1e-3, 1e-6, 1e-12, self.number()][self.below(4)],
            initial_step: [None, None, Some(self.number())][self.below(3)],
            max_step: [f64::INFINITY, self.number()][self.below(2)],
            min_step: [0.0, 0.0, self.number()][self.below(3)],
            max_steps: [60, 20, 1, 0][self.below(4)],
            keep_steps: self.below(3) > 0,
        }
    }
}
