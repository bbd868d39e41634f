//! One step of a Radau IIA method with `S` stages: simplified Newton, the estimate of its error, and its polynomial.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8; for `f(ẋ, x, z, t) = 0` with unknowns
//! `k_i`, `z_i` instead of increments of `y`.

use super::norm::{mean, norm};
use super::replay::{Replay, Single, single};
use crate::error::Error;
use crate::irk::not_finite;
use crate::linalg::{Arithmetic, Complex, EigenFactors, Eigenbasis, Kernel, Rows, dispatch, slot};
use crate::model::{ArrayK, ArrayV, Dae};
use crate::scalar::{Real, Scalar};
use crate::shape::{Array, Plain, Shape};
use crate::tableau::{Method, RadauIIA, Tableau};
use alloc::boxed::Box;
use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_box;

/// The most stages.
pub(super) const MOST: usize = 9;

/// The Newton matrix is that of the last Jacobian, so that the iteration converges linearly. It is expected to take no
/// more than this many iterations, and this many more with each stage above three.
const ITERATIONS: f64 = 7.0;
const MORE_ITERATIONS: f64 = 2.5;

/// An iteration that converges at this rate, or is over at once, keeps its Jacobian for the next step.
pub(super) const FAST: f64 = 1e-3;

/// Where a step begins and what it is measured by.
pub struct Start<'a, M: Dae, T: Real> {
    /// The variables at its start: a solution of the equations.
    pub point: &'a ArrayV<M, T>,
    /// Reciprocals of the tolerated errors of `(x, z)`.
    pub scale: &'a ArrayK<M, T>,
    /// Its length.
    pub h: T,
}

/// How an iteration ended that did not converge.
pub enum Failure {
    /// It converges, but not soon enough: the factor by which a shorter step would.
    Slow(f64),
    /// It does not converge.
    Diverges,
    /// The model has a value that is not finite.
    NotFinite,
}

/// What is known about the convergence of the last iteration.
#[derive(Clone, Copy, Debug)]
pub struct Convergence {
    /// How many iterations it took.
    pub iterations: usize,
    /// How many it might have taken.
    pub most: usize,
    /// By what the increments shrank.
    pub rate: f64,
    /// `θ/(1 − θ)`, which carries over to the next step.
    factor: f64,
}

impl Default for Convergence {
    fn default() -> Self {
        Self { iterations: 0, most: ITERATIONS as usize, rate: 0.0, factor: 1.0 }
    }
}

/// A step with any number of stages.
pub trait Stages<M: Dae, T: Real> {
    /// How many.
    fn count(&self) -> usize;
    /// Factors of the Newton matrix; whether those of the plan hold.
    ///
    /// # Errors
    /// The unknown for which there is no pivot.
    fn factor(&mut self, jacobian: &M::Jacobian<T>, h: T) -> Result<bool, usize>;
    /// From now on, whether every matrix is to be pivoted as a whole; whether that changes anything.
    fn set_pivoted(&mut self, pivoted: bool) -> bool;
    /// Starts from the same `ẋ` and `z` at all stages, those of the start of the step.
    fn begin(&mut self, point: &ArrayV<M, T>);
    /// Starts from the polynomial of the last accepted step, whose size is given relative to this one.
    fn continue_from_last(&mut self, ratio: f64);
    /// Takes over the last accepted step of another method.
    fn adopt(&mut self, other: &dyn Stages<M, T>);
    /// Solves the stages.
    ///
    /// # Errors
    /// [`Failure`]
    fn solve(
        &mut self,
        start: &Start<'_, M, T>,
        tolerance: f64,
        convergence: &mut Convergence,
        residuals: &mut usize,
    ) -> Result<(), Failure>;
    /// The estimated error relative to what is tolerated; `again` if a second, more careful look is to decide whether a
    /// large one is real.
    ///
    /// # Errors
    /// [`Failure::NotFinite`]
    fn error(&mut self, start: &Start<'_, M, T>, again: bool, residuals: &mut usize) -> Result<f64, Failure>;
    /// The variables at the end of the step.
    fn end(&self) -> &ArrayV<M, T>;
    /// The step is accepted.
    fn accept(&mut self);
    /// The unknowns `(k, z)` of the accepted step, stages innermost.
    fn accepted(&self) -> &[T];
    /// The Lagrange polynomials of the nodes at `theta`.
    fn lagrange(&self, theta: f64) -> [f64; MOST];
    /// Their integrals from zero to `theta`.
    fn weights(&self, theta: f64) -> [f64; MOST];
    /// What takes a step again.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    fn replay(&mut self) -> Result<&mut dyn Replay<M, T>, Error>;
}

/// Memory of a step.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
struct Memory<M: Dae, T: Plain, const S: usize, const L: usize> {
    /// The unknowns `(k, z)` at the stages.
    y: ArrayK<M, [T; S]>,
    /// Those of the last accepted step.
    accepted: ArrayK<M, [T; S]>,
    /// Variables of the model at the stages.
    points: [ArrayV<M, T>; S],
    /// Variables at the start of the step.
    start: ArrayV<M, T>,
    /// The residual at one stage.
    f: ArrayK<M, T>,
    /// The residual at all stages, then the increment.
    residual: ArrayK<M, [[T; 1]; S]>,
    rows: Rows<M, T, L>,
    /// The estimated error of `(x, z)`.
    error: ArrayK<M, T>,
    factors: EigenFactors<M, T, L>,
}

/// A step of the Radau IIA method with `S` stages, of which `L = ⌈S/2⌉` eigenvalues count.
pub struct Radau<M: Dae, T: Real, const S: usize, const L: usize>
where
    RadauIIA<S>: Method<S>,
{
    tableau: Tableau<S>,
    /// Column after column.
    a: [[T; S]; S],
    c: [T; S],
    /// Lagrange polynomials at the start of the step.
    lagrange: [T; S],
    basis: Eigenbasis<T, S, L>,
    memory: Box<Memory<M, T, S, L>>,
    replay: Option<Box<Single<M, T, S>>>,
}

impl<M: Dae, T: Real, const S: usize, const L: usize> Radau<M, T, S, L>
where
    RadauIIA<S>: Method<S>,
{
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn new() -> Result<Self, Error> {
        let tableau = <RadauIIA<S> as Method<S>>::TABLEAU;
        let out_of_memory = Error::OutOfMemory { bytes: size_of::<Memory<M, T, S, L>>() };
        let mut memory: Box<Memory<M, T, S, L>> = try_zeroed_box().map_err(|()| out_of_memory)?;
        memory.factors.set_pivoted(false);
        Ok(Self {
            a: core::array::from_fn(|j| core::array::from_fn(|i| T::from_f64(tableau.a()[i][j]))),
            c: tableau.c().map(T::from_f64),
            lagrange: tableau.lagrange(0.0).map(T::from_f64),
            // Radau IIA methods have one: tests construct all.
            basis: Eigenbasis::new(&tableau).ok_or(out_of_memory)?,
            tableau,
            memory,
            replay: None,
        })
    }

    /// The residual at all stages.
    fn evaluate(&mut self) -> Result<(), Failure> {
        let Memory { points, f, residual, .. } = &mut *self.memory;
        for (stage, point) in points.iter().enumerate() {
            M::residual::<T>(point, f);
            if not_finite(f.as_ref()).is_some() {
                return Err(Failure::NotFinite);
            }
            for (equation, f) in f.as_ref().iter().enumerate() {
                residual[slot::<M>(equation)][stage] = [*f];
            }
        }
        Ok(())
    }

    /// The estimated error of `(x, z)` from the defect at the point in `start`.
    fn defect(&mut self, h: T, residuals: &mut usize) -> Result<(), Failure> {
        let Memory { start, f, rows, error, factors, .. } = &mut *self.memory;
        *residuals += 1;
        M::residual::<T>(start, f);
        if not_finite(f.as_ref()).is_some() {
            return Err(Failure::NotFinite);
        }
        // The real system is the first.
        for (equation, f) in f.as_ref().iter().enumerate() {
            let [[row]] = &mut rows[slot::<M>(equation)];
            *row = Complex::ZERO;
            row.re[0] = -*f;
        }
        factors.solve(rows);
        let factor = h * self.basis.values().re[0];
        for (index, (error, [[row]])) in error.as_mut().iter_mut().zip(rows.as_ref()).enumerate() {
            *error = if index < M::Shape::NX { factor * row.re[0] } else { row.re[0] };
        }
        Ok(())
    }
}

impl<M: Dae, T: Real, const S: usize, const L: usize> Stages<M, T> for Radau<M, T, S, L>
where
    RadauIIA<S>: Method<S>,
{
    fn count(&self) -> usize {
        S
    }

    fn factor(&mut self, jacobian: &M::Jacobian<T>, h: T) -> Result<bool, usize> {
        self.memory.factors.factor(jacobian, self.basis.values(), h)
    }

    fn set_pivoted(&mut self, pivoted: bool) -> bool {
        let planned = self.memory.factors.is_planned();
        self.memory.factors.set_pivoted(pivoted);
        planned != self.memory.factors.is_planned()
    }

    fn begin(&mut self, point: &ArrayV<M, T>) {
        let nx = M::Shape::NX;
        let (xdot, z) = (&point.as_ref()[..nx], &point.as_ref()[2 * nx..]);
        for (y, value) in self.memory.y.as_mut().iter_mut().zip(xdot.iter().chain(z)) {
            *y = [*value; S];
        }
    }

    fn continue_from_last(&mut self, ratio: f64) {
        let weights: [[f64; S]; S] =
            core::array::from_fn(|i| self.tableau.lagrange(1.0 + self.tableau.c()[i] * ratio));
        // Column after column.
        let weights: [[T; S]; S] =
            core::array::from_fn(|j| core::array::from_fn(|i| T::from_f64(weights[i][j])));
        let Memory { y, accepted, .. } = &mut *self.memory;
        for (y, accepted) in y.as_mut().iter_mut().zip(accepted.as_ref()) {
            *y = [T::ZERO; S];
            for (weights, accepted) in weights.iter().zip(accepted) {
                for (y, weight) in y.iter_mut().zip(weights) {
                    *y = *y + *weight * *accepted;
                }
            }
        }
    }

    fn adopt(&mut self, other: &dyn Stages<M, T>) {
        let count = other.count();
        for (stage, node) in self.tableau.c().iter().enumerate() {
            let weights = other.lagrange(*node);
            let unknowns = other.accepted().chunks_exact(count);
            for (to, from) in self.memory.accepted.as_mut().iter_mut().zip(unknowns) {
                let terms = weights.iter().zip(from);
                to[stage] = terms.fold(T::ZERO, |sum, (weight, y)| sum + T::from_f64(*weight) * *y);
            }
        }
    }

    fn solve(
        &mut self,
        start: &Start<'_, M, T>,
        tolerance: f64,
        convergence: &mut Convergence,
        residuals: &mut usize,
    ) -> Result<(), Failure> {
        let Start { point, scale, h } = *start;
        let t = point.as_ref().last().copied().unwrap_or(T::ZERO);
        for (to, c) in self.memory.points.iter_mut().zip(&self.c) {
            *to = *point;
            if let Some(time) = to.as_mut().last_mut() {
                *time = t + *c * h;
            }
        }
        self.memory.residual.as_mut().fill([[T::ZERO]; S]);
        self.advance(point, scale, h);
        let most = (ITERATIONS + MORE_ITERATIONS * (S as f64 - 3.0)).max(4.0) as usize;
        convergence.most = most;
        convergence.factor = Scalar::powf(convergence.factor.max(f64::EPSILON), 0.8);
        convergence.rate = FAST;
        let (mut last, mut last_rate) = (0.0, 0.0);
        for iteration in 1..=most {
            *residuals += S;
            self.evaluate()?;
            let Memory { residual, rows, factors, .. } = &mut *self.memory;
            factors.solve_stages(&self.basis, residual, rows);
            let increment = mean(self.advance(point, scale, h), M::Shape::NK * S);
            convergence.iterations = iteration;
            if !increment.is_finite() {
                return Err(Failure::Diverges);
            }
            if iteration > 1 && iteration < most {
                let rate: f64 = increment / last;
                convergence.rate = if iteration == 2 { rate } else { Scalar::sqrt(rate * last_rate) };
                last_rate = rate;
                // Written so that NaN, after an increment of zero, is no divergence.
                if convergence.rate >= 0.99 {
                    return Err(Failure::Diverges);
                }
                if convergence.rate.is_finite() {
                    convergence.factor = convergence.rate / (1.0 - convergence.rate);
                    let left = (most - 1 - iteration) as i32;
                    let expected =
                        convergence.factor * increment * Scalar::powi(convergence.rate, left) / tolerance;
                    let left = f64::from(left);
                    if expected >= 1.0 {
                        let excess = expected.clamp(1e-4, 20.0);
                        return Err(Failure::Slow(0.8 * Scalar::powf(excess, -1.0 / (4.0 + left))));
                    }
                }
            }
            if convergence.factor * increment <= tolerance {
                return Ok(());
            }
            last = increment.max(f64::EPSILON);
        }
        Err(Failure::Diverges)
    }

    fn error(&mut self, start: &Start<'_, M, T>, again: bool, residuals: &mut usize) -> Result<f64, Failure> {
        // What the method misses is how far the derivative of its polynomial, extrapolated to the start of the step,
        // is from the solution there.
        self.memory.start = *start.point;
        for (xdot, k) in self.memory.start.as_mut().iter_mut().zip(&self.memory.y.as_ref()[..M::Shape::NX]) {
            *xdot = crate::irk::dot(&self.lagrange, k);
        }
        self.defect(start.h, residuals)?;
        let error = norm(self.memory.error.as_ref(), start.scale.as_ref());
        if !(again && error >= 1.0) {
            return Ok(error);
        }
        let states = &mut self.memory.start.as_mut()[M::Shape::NX..];
        for (state, error) in states.iter_mut().zip(self.memory.error.as_ref()) {
            *state = *state + *error;
        }
        self.defect(start.h, residuals)?;
        Ok(norm(self.memory.error.as_ref(), start.scale.as_ref()))
    }

    fn end(&self) -> &ArrayV<M, T> {
        // There is a last stage: methods have at least one.
        &self.memory.points[S - 1]
    }

    fn accept(&mut self) {
        self.memory.accepted = self.memory.y;
    }

    fn accepted(&self) -> &[T] {
        self.memory.accepted.as_ref().as_flattened()
    }

    fn lagrange(&self, theta: f64) -> [f64; MOST] {
        padded(self.tableau.lagrange(theta))
    }

    fn weights(&self, theta: f64) -> [f64; MOST] {
        padded(self.tableau.weights(theta))
    }

    fn replay(&mut self) -> Result<&mut dyn Replay<M, T>, Error> {
        Ok(match &mut self.replay {
            Some(replay) => &mut **replay,
            none => &mut **none.insert(Box::new(single()?)),
        })
    }
}

impl<M: Dae, T: Real, const S: usize, const L: usize> Radau<M, T, S, L>
where
    RadauIIA<S>: Method<S>,
{
    /// `y ← y − Δ` with `Δ` where the residual was, and the stages moved there: the sum of the squares of the changes
    /// of `(ξ, z)` relative to what is tolerated.
    fn advance(&mut self, point: &ArrayV<M, T>, scale: &ArrayK<M, T>, h: T) -> f64 {
        let Memory { y, points, residual, .. } = &mut *self.memory;
        let nx = M::Shape::NX;
        dispatch(Advance {
            a: self.a.map(|column| column.map(|a| h * a)),
            x: &point.as_ref()[nx..2 * nx],
            scale: scale.as_ref(),
            increment: residual.as_ref(),
            y: y.as_mut(),
            points,
        })
        .to_f64()
    }
}

fn padded<const S: usize>(weights: [f64; S]) -> [f64; MOST] {
    let mut all = [0.0; MOST];
    for (to, from) in all.iter_mut().zip(weights) {
        *to = from;
    }
    all
}

struct Advance<'a, V, T, const S: usize> {
    /// `h A`, column after column.
    a: [[T; S]; S],
    /// The states at the start of the step.
    x: &'a [T],
    scale: &'a [T],
    increment: &'a [[[T; 1]; S]],
    y: &'a mut [[T; S]],
    points: &'a mut [V; S],
}

impl<T: Real, V: Array<T>, const S: usize> Kernel for Advance<'_, V, T, S> {
    type Output = T;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> T {
        let Self { a, x, scale, increment, y, points } = self;
        let nx = x.len();
        let mut sum = [T::ZERO; S];
        for (index, ((y, increment), scale)) in y.iter_mut().zip(increment).zip(scale).enumerate() {
            for (y, [increment]) in y.iter_mut().zip(increment) {
                *y = *y - *increment;
            }
            let Some(x) = x.get(index) else {
                for ((point, y), (sum, [increment])) in
                    points.iter_mut().zip(y.iter()).zip(sum.iter_mut().zip(increment))
                {
                    let relative = *increment * *scale;
                    *sum = A::subtract(*sum, -relative, relative);
                    if let Some(to) = point.as_mut().get_mut(nx + index) {
                        *to = *y;
                    }
                }
                continue;
            };
            let mut xi = [*x; S];
            for (a, k) in a.iter().zip(y.iter()) {
                for (xi, a) in xi.iter_mut().zip(a) {
                    *xi = A::subtract(*xi, -*a, *k);
                }
            }
            for (((point, y), xi), sum) in points.iter_mut().zip(y.iter()).zip(xi).zip(&mut sum) {
                let point = point.as_mut();
                if let Some(k) = point.get_mut(index) {
                    *k = *y;
                }
                if let Some(state) = point.get_mut(nx + index) {
                    let relative = (xi - *state) * *scale;
                    *sum = A::subtract(*sum, -relative, relative);
                    *state = xi;
                }
            }
        }
        sum.into_iter().fold(T::ZERO, |total, sum| total + sum)
    }
}
