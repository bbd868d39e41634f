//! Hessians of the Lagrangian from its gradients, stage by stage.
//!
//! ```text
//! s = v⁺ − v        y = ∇L(v⁺, λ⁺) − ∇L(v, λ⁺)        v = (x, u)
//! L = l + πᵀφ + (λ_u − λ_l)ᵀg
//! r = θ y + (1 − θ) B s        B ← B − B s sᵀB / sᵀB s + r rᵀ / sᵀr
//! ```
//!
//! `θ` is one where `sᵀy ≥ 0.2 sᵀB s`, and such that `sᵀr = 0.2 sᵀB s` elsewhere: `B` stays
//! positive definite (M. J. D. Powell, "A fast algorithm for nonlinearly constrained optimization
//! calculations", 1978). The Lagrangian is a sum over stages, and each has a matrix of its own, so
//! that one step tells as much as there are stages (H. G. Bock, K. J. Plitt, "A multiple shooting
//! algorithm for direct solution of optimal control problems", 1984).
//!
//! `r = y − B s` and `B ← B + r rᵀ / sᵀr` is the symmetric update of rank one: it finds Hessians of
//! stages that are indefinite, too, and only the reduced one has to be positive definite at the
//! solution (A. R. Conn, N. I. M. Gould, P. L. Toint, Math. Program. 50, 1991).
//!
//! Both gradients have the multipliers after the step. What the cost of a stage is made of does not
//! matter: the QP at an iterate has the gradient of all of it, integrals and arrival costs too.

use super::Sqp;
use crate::linalg::dot;
use crate::ocp::assembly::convexify::{Convexification, convexify};
use crate::ocp::assembly::curvature::{Curvature, Secant, Update};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::split;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::{Arrays, QpField, StageDims, Store, add_symmetric, assign, pad, part, part_mut, take_mut};
use crate::scalar::Real;

/// What `sᵀr` is of `sᵀB s` at least.
const LEAST: f64 = 0.2;
/// Steps that are shorter, as a part of the point, tell of rounding alone.
const SHORT: f64 = 1e-12;
/// `sᵀr` is this part of `‖s‖ ‖r‖` at least, or a rank-one update is left out.
const FLAT: f64 = 1e-8;
/// Variables without curvature begin with this part of the largest one, or of one.
const FIRST: f64 = 1e-2;

/// How many numbers a stage remembers: `B`, `[A B; C D]ᵀ`, `∇l` and `v`.
const fn of_stage<T>(dims: StageDims, next: usize) -> usize {
    let n = dims.nx.saturating_add(dims.nu);
    let columns = n.saturating_add(next).saturating_add(dims.ng).saturating_add(2);
    pad::<T>(n).saturating_mul(columns)
}

/// How many numbers all stages remember.
pub(super) const fn length<T>(dims: &[StageDims]) -> usize {
    let (mut sum, mut rest) = (0_usize, dims);
    while let Some((&first, others)) = rest.split_first() {
        let next = if let Some(next) = others.first() { next.nx } else { 0 };
        sum = sum.saturating_add(of_stage::<T>(first, next));
        rest = others;
    }
    sum
}

impl<S, C, T: Real, D: AsRef<[StageDims]>, M> Sqp<S, C, T, D, M> {
    /// The same with Hessians from differences of gradients, one for each stage.
    ///
    /// It needs no second derivatives of dynamics, as [`Sqp::gauss_newton`], and is for costs that
    /// are no least squares with small residuals. By [`Update::DampedBfgs`] convergence is
    /// superlinear where the Hessian of every stage is positive definite at the solution, else
    /// linear and slow; by [`Update::RankOne`] it is superlinear where the reduced one is.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]; in given memory [`OcpError::Qp`] if it is shorter than
    /// [`Sqp::memory`] and `Sqp::memory_of_secant` together.
    ///
    /// # Example
    /// ```
    /// use casados::ocp::{GeneralCost, HeapSqp, Horizon, Problem, Update};
    /// use casados::prelude::*;
    ///
    /// #[ode]
    /// fn push(x: [f64; 2], u: [f64; 1]) -> [f64; 2] { [x[1], u[0] - x[0].powi(3)] }
    /// #[function]
    /// fn effort(x: [f64; 2], u: [f64; 1]) -> f64 { x[0].cosh() + x[1] * x[1] + u[0].powi(2) }
    ///
    /// let mut ocp = Problem::new(Erk::<Push, Rk4>::new(Options::default())?)
    ///     .stage_cost(GeneralCost::<Effort>::new())
    ///     .on(Horizon::uniform(10, 0.1))?;
    /// ocp.fix_initial_state(&[1.0, 0.0])?.guess(&[1.0, 0.0], &[0.0])?;
    /// assert!(HeapSqp::new(&ocp)?.secant(Update::DampedBfgs)?.solve(&mut ocp)?.is_converged());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn secant(mut self, update: Update) -> Result<Sqp<S, Secant, T, D, M>, OcpError>
    where
        M: Store<T>,
    {
        let length = length::<T>(self.solution.dims());
        self.history.at_least(length, QpField::Numbers)?;
        Ok(self.with(Secant(update)))
    }
}

impl<S, C, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Sqp<S, C, T, D, M> {
    /// Linearises at the iterate; Hessians from differences of gradients stay as they are.
    ///
    /// # Errors
    /// Those of [`Ocp::linearise`].
    pub(super) fn linearise<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>) -> Result<(), OcpError>
    where
        C: Curvature<P::Dynamics, T>,
    {
        ocp.linearise(self.curvature)?;
        if self.curvature.update().is_some() {
            self.take_hessians(ocp, Take::Kept);
        }
        Ok(())
    }

    /// Writes the Hessians of the history to the QP that was written at the iterate.
    pub(super) fn take_hessians<P: Formulation<T>>(&mut self, ocp: &mut Ocp<P, T, D, M>, take: Take) {
        let layout = ocp.layout();
        let Ocp { qp, iterate, data, .. } = ocp;
        let scratch = split::<P, T>(data.as_mut(), layout).scratch;
        let (all, _) = iterate.vectors();
        let mut rest = self.history.as_mut();
        let mut begin = 0;
        for (mut stage, point) in qp.stages_mut().zip(iterate.stages()) {
            let arrays = stage.arrays();
            let (n, ld) = (arrays.n, arrays.ld);
            let v = part(all, begin, ld);
            begin += ld;
            let mut memory = Remembered {
                hessian: take_mut(&mut rest, n * ld),
                matrix: take_mut(&mut rest, arrays.matrix.len()),
                gradient: take_mut(&mut rest, ld),
                v: take_mut(&mut rest, ld),
            };
            // The gradient of the cost itself, whatever Hessian there is.
            add_symmetric(arrays.gradient, arrays.hessian, ld, v, n);
            match take {
                Take::First => {
                    assign(memory.hessian, arrays.hessian);
                    begin_with(memory.hessian, ld, n, scratch);
                }
                Take::Updated(update) => {
                    let multipliers = [point.dynamics, point.g_upper, point.g_lower];
                    memory.learn(update, &arrays, v, multipliers, scratch);
                }
                Take::Kept | Take::Moved => {}
            }
            if take != Take::Kept {
                memory.remember(&arrays, v);
            }
            assign(arrays.hessian, memory.hessian);
            let product = part_mut(scratch, 0, ld);
            product.fill(T::ZERO);
            add_symmetric(product, arrays.hessian, ld, v, n);
            for (gradient, &product) in arrays.gradient.iter_mut().zip(&*product) {
                *gradient = *gradient - product;
            }
        }
    }
}

/// What becomes of Hessians.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Take {
    /// They begin: those of costs.
    First,
    /// They learn from the last step.
    Updated(Update),
    /// They stay, and the next step begins here.
    Moved,
    /// They stay.
    Kept,
}

/// What a stage remembers of the iterate before.
struct Remembered<'a, T> {
    /// `B`, of which the lower triangle counts.
    hessian: &'a mut [T],
    /// `[A B; C D]ᵀ`
    matrix: &'a mut [T],
    /// `∇l`
    gradient: &'a mut [T],
    v: &'a mut [T],
}

impl<T: Real> Remembered<'_, T> {
    fn remember(&mut self, arrays: &Arrays<'_, T>, v: &[T]) {
        assign(self.matrix, arrays.matrix);
        assign(self.gradient, arrays.gradient);
        assign(self.v, v);
    }

    /// Learns from the step to `v`, where the QP has the gradient of the cost itself.
    fn learn(
        &mut self,
        update: Update,
        arrays: &Arrays<'_, T>,
        v: &[T],
        [dynamics, upper, lower]: [&[T]; 3],
        scratch: &mut [T],
    ) {
        let (n, ld, next) = (arrays.n, arrays.ld, arrays.next);
        let mut rest = scratch;
        let [s, y, bs] = [(); 3].map(|()| take_mut(&mut rest, ld));
        s.iter_mut().zip(v).zip(&*self.v).for_each(|((s, &now), &before)| *s = now - before);
        let slopes = arrays.gradient.iter().zip(&*self.gradient);
        y.iter_mut().zip(slopes).for_each(|(y, (&now, &before))| *y = now - before);
        let columns = || arrays.matrix.chunks_exact(ld.max(1)).zip(self.matrix.chunks_exact(ld.max(1)));
        let forces = upper.iter().zip(lower).map(|(&upper, &lower)| upper - lower);
        let multipliers = dynamics.iter().copied().take(next).chain(forces);
        for ((now, before), multiplier) in columns().zip(multipliers) {
            for ((y, &now), &before) in y.iter_mut().zip(now).zip(before).take(n) {
                *y = *y + multiplier * (now - before);
            }
        }
        let (steps, y) = ([&*s, v], part_mut(y, 0, n));
        match update {
            Update::DampedBfgs => damped_bfgs(self.hessian, ld, steps, y, bs),
            Update::RankOne => rank_one(self.hessian, ld, steps, y, bs),
        }
    }
}

/// Makes the Hessian of a cost one to begin with: positive definite, and by how much in each
/// variable.
fn begin_with<T: Real>(hessian: &mut [T], ld: usize, n: usize, scratch: &mut [T]) {
    let diagonal =
        |hessian: &[T]| hessian.iter().step_by(ld + 1).take(n).fold(T::ZERO, |m, h| h.abs().max(m));
    let largest = diagonal(hessian);
    let least = T::from_f64(FIRST) * if largest > T::ZERO { largest } else { T::ONE };
    convexify(Convexification::Project, hessian, ld, n, scratch);
    for h in hessian.iter_mut().step_by(ld + 1).take(n) {
        *h = h.max(least);
    }
}

/// The damped update of the lower triangle of `B`, whose columns are `ld` apart, by the step `s` to
/// the point `v` and the difference `y` of gradients, which becomes `r`; `B s` is computed in `bs`.
/// Steps that tell nothing change nothing. `s` and `v` are padded with zeros, `y` is not.
fn damped_bfgs<T: Real>(b: &mut [T], ld: usize, [s, v]: [&[T]; 2], y: &mut [T], bs: &mut [T]) {
    let n = y.len();
    bs.fill(T::ZERO);
    add_symmetric(bs, b, ld, s, n);
    let (bs, s, v) = (part(bs, 0, n), part(s, 0, n), part(v, 0, n));
    let (curved, seen) = (dot(bs, s), dot(y, s));
    let short = T::from_f64(SHORT * SHORT);
    let is_step = dot(s, s) > short * dot(v, v) && curved > T::ZERO && seen.is_finite();
    if !is_step {
        return;
    }
    let least = T::from_f64(LEAST) * curved;
    let theta = if seen >= least { T::ONE } else { (curved - least) / (curved - seen) };
    for (r, &bs) in y.iter_mut().zip(bs) {
        *r = theta * *r + (T::ONE - theta) * bs;
    }
    let seen = dot(y, s);
    for (j, column) in b.chunks_exact_mut(ld.max(1)).enumerate().take(n) {
        let at = |values: &[T]| values.get(j).copied().unwrap_or(T::ZERO);
        let (down, up) = (at(bs) / curved, at(y) / seen);
        for ((b, &bs), &r) in column.iter_mut().zip(bs).zip(&*y).skip(j) {
            *b = *b - down * bs + up * r;
        }
    }
}

/// `B ← B + r rᵀ / sᵀr` with `r = y − B s`, which `y` becomes; arguments are as those of
/// [`damped_bfgs`]. Nothing changes where `sᵀr` is a small part of what it can be.
fn rank_one<T: Real>(b: &mut [T], ld: usize, [s, v]: [&[T]; 2], y: &mut [T], bs: &mut [T]) {
    let n = y.len();
    bs.fill(T::ZERO);
    add_symmetric(bs, b, ld, s, n);
    let (s, v) = (part(s, 0, n), part(v, 0, n));
    for (r, &bs) in y.iter_mut().zip(&*bs) {
        *r = *r - bs;
    }
    let along = dot(y, s);
    let (short, flat) = (T::from_f64(SHORT * SHORT), T::from_f64(FLAT * FLAT));
    let is_step = dot(s, s) > short * dot(v, v) && along * along > flat * dot(s, s) * dot(y, y);
    if !(is_step && along.is_finite()) {
        return;
    }
    for (j, column) in b.chunks_exact_mut(ld.max(1)).enumerate().take(n) {
        let factor = y.get(j).map_or(T::ZERO, |&r| r / along);
        for (b, &r) in column.iter_mut().zip(&*y).skip(j) {
            *b = *b + factor * r;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;
    use alloc::vec::Vec;

    const LD: usize = pad::<f64>(3);

    /// Padded.
    fn padded(v: [f64; 3]) -> Vec<f64> {
        let mut padded = vec![0.0; LD];
        assign(&mut padded, &v);
        padded
    }

    /// A lower triangle from its columns.
    fn lower(columns: [[f64; 3]; 3]) -> Vec<f64> {
        columns.into_iter().flat_map(padded).collect()
    }

    /// `B s` of a lower triangle, element by element.
    fn product(b: &[f64], s: &[f64]) -> Vec<f64> {
        let entry = |i: usize, j: usize| b[i.min(j) * LD + i.max(j)];
        (0..s.len()).map(|i| s.iter().enumerate().map(|(j, s)| entry(i, j) * s).sum()).collect()
    }

    fn identity() -> Vec<f64> {
        lower([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    }

    /// `B⁺ s = y`, where nothing is damped.
    #[test]
    fn secant_equation() {
        let (mut b, v, mut bs) = (identity(), padded([1.0; 3]), vec![0.0; LD]);
        let given = lower([[3.0, 1.0, 0.5], [0.0, 2.0, -0.5], [0.0, 0.0, 4.0]]);
        for s in [[1.0, 0.0, 0.0], [0.5, -1.0, 0.25], [0.3, 0.2, -1.0]] {
            let mut y = product(&given, &s);
            let expected = y.clone();
            damped_bfgs(&mut b, LD, [&padded(s), &v], &mut y, &mut bs);
            for (b, y) in product(&b, &s).iter().zip(&expected) {
                assert!((b - y).abs() < 1e-12, "{b} {y}");
            }
        }
    }

    /// Of any quadratic function the Hessian itself, after as many steps as there are variables.
    #[test]
    fn rank_one_updates_are_exact() {
        let (mut b, v, mut bs) = (identity(), padded([1.0; 3]), vec![0.0; LD]);
        let given = lower([[3.0, 1.0, 0.5], [0.0, -2.0, -0.5], [0.0, 0.0, -4.0]]);
        for s in [[1.0, 0.0, 0.0], [0.5, -1.0, 0.25], [0.3, 0.2, -1.0]] {
            let mut y = product(&given, &s);
            rank_one(&mut b, LD, [&padded(s), &v], &mut y, &mut bs);
        }
        for (j, i) in (0..3).flat_map(|j| (j..3).map(move |i| (j, i))) {
            assert!((b[j * LD + i] - given[j * LD + i]).abs() < 1e-12, "{b:?}");
        }
    }

    /// A gradient that says "concave" leaves a fifth of the curvature along the step, and a
    /// positive definite matrix.
    #[test]
    fn damping() {
        let (mut b, v, mut bs) = (identity(), padded([1.0; 3]), vec![0.0; LD]);
        let s = [0.6, 0.0, 0.8];
        let mut y = [-3.0, 1.0, 0.5];
        damped_bfgs(&mut b, LD, [&padded(s), &v], &mut y, &mut bs);
        let along: f64 = product(&b, &s).iter().zip(&s).map(|(b, s)| b * s).sum();
        assert!((along - 0.2).abs() < 1e-14, "{along}");
        let mut rest = b.clone();
        for k in 0..3 {
            assert!(rest[k * LD + k] > 0.0);
            for i in k + 1..3 {
                for j in k + 1..=i {
                    rest[j * LD + i] -= rest[k * LD + i] * rest[k * LD + j] / rest[k * LD + k];
                }
            }
        }
    }

    /// No step, or one of rounding alone, and what is not finite.
    #[test]
    fn nothing_is_learned_from_nothing() {
        for (s, y) in [([0.0; 3], [1.0; 3]), ([1e-15; 3], [1.0; 3]), ([1.0; 3], [f64::NAN; 3])] {
            let (mut b, v, mut bs, mut y) = (identity(), padded([1.0; 3]), vec![0.0; LD], y);
            let mut other = y;
            damped_bfgs(&mut b, LD, [&padded(s), &v], &mut y, &mut bs);
            rank_one(&mut b, LD, [&padded(s), &v], &mut other, &mut bs);
            assert_eq!(b, identity());
        }
    }
}
