//! States that follow another in every iteration of Newton's method.
//!
//! The derivative of a state that is [implied](crate::model::Steady::implied), `ẋ = c v`, is no unknown: with a state `v`
//!
//! ```text
//! k_i = c (x_v + h Σ_j a_ij k_vj)
//! ```
//!
//! holds before the first iteration and after each of them, so that its equations have no residual, nothing is subtracted below its pivot, and
//! nobody solves for it. With a control or a parameter `k_i = c v`.

use super::evaluate::{entry, stages};
use super::record::{Coefficients, Work};
use crate::linalg::{Arithmetic, Kernel, coupling, dispatch, follows, slot};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayV, ArrayX, Dae};
use crate::scalar::Lanes;
use crate::shape::{Plain, Shape};

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// Writes what follows.
    pub(super) fn follow(
        &mut self,
        coefficients: &Coefficients<E, S>,
        x: &ArrayX<M, E>,
        y: &mut ArrayK<M, [E; S]>,
    ) {
        if const { !has_followers::<M>() } {
            return;
        }
        dispatch(Follow::<M, E, S> {
            jacobian: &self.linear.jacobian,
            points: &mut self.points,
            x,
            rest: &self.rest,
            y,
            a: &coefficients.a,
            h: self.inputs.time.step,
        });
    }

    /// Whether stages are all alike as long as nothing follows, so that the model, with its Jacobian, is evaluated there once: what follows is
    /// [expected](Self::expect_followers) then.
    pub(super) fn expects_followers(&mut self, jacobian: bool) -> bool {
        if const { !has_followers::<M>() } {
            return false;
        }
        self.alike &= jacobian;
        self.alike
    }

    /// The residual after what follows will have been written, with a Jacobian that all stages share as they share the point where it is: what
    /// `k` adds to `x` differs between them only by the nodes.
    pub(super) fn expect_followers(&mut self, coefficients: &Coefficients<E, S>) {
        if const { !has_followers::<M>() } {
            return;
        }
        let Self { f, linear, inputs, .. } = self;
        dispatch(Expect::<M, E, S> {
            jacobian: &linear.jacobian,
            f,
            a: &coefficients.a,
            h: inputs.time.step,
        });
    }
}

/// Whether any state follows.
pub(super) const fn has_followers<M: Dae>() -> bool {
    let steady = M::STRUCTURE.elimination.steady;
    let mut index = 0;
    while index < steady.len() {
        if steady[index].implied {
            return true;
        }
        index += 1;
    }
    false
}

/// The unknowns but for followers before the first that is none, and behind the last: `(first, end)`.
pub(super) const fn led<M: Dae>() -> (usize, usize) {
    let steady = M::STRUCTURE.elimination.steady;
    let (mut first, mut end) = (0, M::Shape::NK);
    while first < end && first < steady.len() && steady[first].implied {
        first += 1;
    }
    while end > first && end <= steady.len() && steady[end - 1].implied {
        end -= 1;
    }
    (first, end)
}

/// `k_i` of a state, if it follows something that lies at these points.
#[inline(always)]
pub(super) fn follower<M: Dae, E: Lanes, const S: usize>(
    state: usize,
    jacobian: &M::Jacobian<[E; S]>,
    points: &[[E; S]],
) -> Option<[E; S]> {
    let (_, leader, minus_c) = entry::<M, _>(jacobian, follows::<M>(state)?.entry as usize)?;
    let (mut k, minus_c) = (*points.get(leader)?, minus_c[0]);
    for k in &mut k {
        *k = -(minus_c * *k);
    }
    Some(k)
}

struct Follow<'a, M: Dae, E: Plain, const S: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    points: &'a mut ArrayV<M, [E; S]>,
    x: &'a ArrayX<M, E>,
    /// What `x` has beyond its digits.
    rest: &'a ArrayX<M, E>,
    y: &'a mut ArrayK<M, [E; S]>,
    a: &'a [[E; S]; S],
    h: E,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Follow<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { jacobian, points, x, rest, y, a, h } = self;
        let (points, y) = (points.as_mut(), y.as_mut());
        let minus_ha = coupling(a, h);
        for state in 0..M::STRUCTURE.elimination.steady.len() {
            let entry = follows::<M>(state).and_then(|steady| entry::<M, _>(jacobian, steady.entry as usize));
            let Some((_, leader, _)) = entry else { continue };
            let leader = leader.wrapping_sub(M::Shape::NX);
            let (x, rest) = (x.as_ref().get(leader), rest.as_ref().get(leader));
            if let (Some(&x), Some(&rest), Some(k)) = (x, rest, y.get(leader))
                && let Some(xi) = points.get_mut(M::Shape::NX + leader)
            {
                *xi = stages::<A, E, S>(rest, &minus_ha, k);
                for xi in xi {
                    *xi = *xi + x;
                }
            }
            if let (Some(y), Some(k)) = (y.get_mut(state), follower::<M, E, S>(state, jacobian, points)) {
                *y = k;
            }
        }
    }
}

struct Expect<'a, M: Dae, E: Plain, const S: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    f: &'a mut ArrayK<M, [E; S]>,
    a: &'a [[E; S]; S],
    h: E,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Expect<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { jacobian, f, a, h } = self;
        // `h c_i`
        let mut nodes = [E::from_f64(0.0); S];
        for (node, a) in nodes.iter_mut().zip(a) {
            for &a in a {
                *node = *node + h * a;
            }
        }
        for state in 0..M::STRUCTURE.elimination.steady.len() {
            let Some(follower) = follows::<M>(state) else { continue };
            let Some((own, ..)) = entry::<M, _>(jacobian, follower.entry as usize) else { continue };
            // What is missing in `k`.
            let Some(f_own) = f.as_mut().get_mut(own) else { continue };
            let residual = f_own[0];
            *f_own = [E::from_f64(0.0); S];
            for index in follower.first..follower.end {
                let Some(&index) = M::STRUCTURE.by_column.get(index as usize) else { continue };
                let Some((row, _, felt)) = entry::<M, _>(jacobian, index as usize) else { continue };
                if slot::<M>(row) == state {
                    continue;
                }
                let Some(f) = f.as_mut().get_mut(row) else { continue };
                let share = felt[0] * residual;
                for (f, &node) in f.iter_mut().zip(&nodes) {
                    *f = A::subtract(*f, share, node);
                }
            }
        }
    }
}
