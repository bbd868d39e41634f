//! The points of a check: given ones, or random ones in given ranges.

use crate::model::{ArrayV, Dae};
use crate::shape::{Array, Shape};
use core::ops::RangeInclusive;
use std::vec::Vec;

/// Points `v = (ẋ, x, z, u, p, t)` at which a model is checked.
///
/// Random points are the same in every run: the generator has a fixed seed, which can be changed.
///
/// ```
/// use casados::prelude::*;
/// use casados::testing::{Points, check_derivatives};
///
/// #[ode]
/// fn cooling(x: [f64; 1], u: [f64; 1]) -> [f64; 1] {
///     [u[0] - x[0].sqrt()]
/// }
///
/// // Where there is a root.
/// check_derivatives::<Cooling>(&Points::random(10).x(0, 0.1..=2.0)).assert();
/// ```
#[derive(Clone, Debug)]
pub struct Points<M: Dae> {
    given: Vec<ArrayV<M, f64>>,
    count: usize,
    seed: u64,
    ranges: Vec<(f64, f64)>,
}

impl<M: Dae> Points<M> {
    /// `count` random points, every variable in its range of the model, [`Dae::RANGES`], by default
    /// in `[-1, 1]`, unless another range is set.
    #[must_use]
    pub fn random(count: usize) -> Self {
        let range = |variable: usize| {
            let range =
                M::RANGES.get(variable).filter(|range| range.low.is_finite() && range.high.is_finite());
            range.map_or((-1.0, 1.0), |range| (range.low, range.high))
        };
        Self { given: Vec::new(), count, seed: 1, ranges: (0..M::Shape::NV).map(range).collect() }
    }

    /// The given points, `v = (ẋ, x, z, u, p, t)`.
    #[must_use]
    pub fn given(points: impl IntoIterator<Item = ArrayV<M, f64>>) -> Self {
        Self { given: points.into_iter().collect(), ..Self::random(0) }
    }

    /// Random points around a given one: each variable within `radius · max(|v|, 1)`.
    #[must_use]
    pub fn around(point: &ArrayV<M, f64>, radius: f64, count: usize) -> Self {
        let mut points = Self::random(count);
        for (range, &value) in points.ranges.iter_mut().zip(point.as_ref()) {
            let width = radius * value.abs().max(1.0);
            *range = (value - width, value + width);
        }
        points
    }

    /// Sets the seed of the random points.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Sets the range of all variables.
    #[must_use]
    pub fn all(mut self, range: RangeInclusive<f64>) -> Self {
        self.ranges.fill((*range.start(), *range.end()));
        self
    }
    /// Sets the range of `ẋ[i]`.
    ///
    /// # Panics
    /// If the index is out of range; so do the methods for other variables.
    #[must_use]
    #[track_caller]
    pub fn xdot(self, i: usize, range: RangeInclusive<f64>) -> Self {
        self.set_range("xdot", (0, M::Shape::NX), i, &range)
    }
    /// Sets the range of `x[i]`.
    #[must_use]
    #[track_caller]
    pub fn x(self, i: usize, range: RangeInclusive<f64>) -> Self {
        self.set_range("x", (M::Shape::NX, M::Shape::NX), i, &range)
    }
    /// Sets the range of `z[i]`.
    #[must_use]
    #[track_caller]
    pub fn z(self, i: usize, range: RangeInclusive<f64>) -> Self {
        self.set_range("z", (2 * M::Shape::NX, M::Shape::NZ), i, &range)
    }
    /// Sets the range of `u[i]`.
    #[must_use]
    #[track_caller]
    pub fn u(self, i: usize, range: RangeInclusive<f64>) -> Self {
        self.set_range("u", (2 * M::Shape::NX + M::Shape::NZ, M::Shape::NU), i, &range)
    }
    /// Sets the range of `p[i]`.
    #[must_use]
    #[track_caller]
    pub fn p(self, i: usize, range: RangeInclusive<f64>) -> Self {
        let first = 2 * M::Shape::NX + M::Shape::NZ + M::Shape::NU;
        self.set_range("p", (first, M::Shape::NP), i, &range)
    }
    /// Sets the range of `t`.
    #[must_use]
    pub fn t(self, range: RangeInclusive<f64>) -> Self {
        self.set_range("t", (M::Shape::NV - 1, 1), 0, &range)
    }

    #[track_caller]
    fn set_range(
        mut self,
        name: &str,
        (first, count): (usize, usize),
        i: usize,
        range: &RangeInclusive<f64>,
    ) -> Self {
        let model = M::STRUCTURE.name;
        assert!(i < count, "there is no {name}[{i}]: `{model}` has {count} of them");
        self.ranges[first + i] = (*range.start(), *range.end());
        self
    }

    /// The points, the given ones first; random ones are generated on the fly.
    ///
    /// ```
    /// # use casados::prelude::*;
    /// # use casados::testing::Points;
    /// # #[ode]
    /// # fn growth(x: [f64; 1]) -> [f64; 1] { x }
    /// // ẋ, x and t.
    /// let points = Points::<Growth>::random(3).x(0, 0.0..=1.0);
    /// assert!(points.iter().all(|[_, x, t]| x >= 0.0 && t.abs() <= 1.0));
    /// ```
    pub fn iter(&self) -> impl Iterator<Item = ArrayV<M, f64>> {
        let mut random = Random::new(self.seed);
        let draw = move |_| {
            <ArrayV<M, f64> as Array<f64>>::from_fn(|i| {
                let (low, high) = self.ranges[i];
                low + (high - low) * random.unit()
            })
        };
        self.given.iter().copied().chain((0..self.count).map(draw))
    }
}

/// The generator SplitMix64 (Steele, Lea, Flood 2014): the same numbers on every machine.
///
/// ```
/// use casados::testing::Random;
///
/// let (mut one, mut other) = (Random::new(7), Random::new(7));
/// assert!((0..100).all(|_| one.symmetric() == other.symmetric()));
/// assert!((0..100).all(|_| (0.0..1.0).contains(&one.unit())));
/// ```
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A generator; equal seeds give equal sequences.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in `[0, 1)`.
    pub const fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A number in `[-1, 1)`.
    pub const fn symmetric(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// An integer in `0..n`; `n` must not be zero.
    pub const fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}
