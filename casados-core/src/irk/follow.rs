//! States that [follow](crate::model::Follower) another in every iteration of Newton's method: their derivatives are no unknowns.

use super::evaluate::{entry, stages};
use super::record::{Coefficients, Work};
use crate::linalg::{
    Arithmetic, AtRow, Kernel, coupling, dispatch, each_row, follows, has_followers, is_follower,
};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayV, ArrayX, Dae, Elimination};
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
    /// [expected](Self::expect_followers) then. Where stages are evaluated side by side that spares nothing, and of two stages little: what
    /// follows is then where it will be from the first evaluation on, whose Jacobians are better for it. (Simulations of 5 and 7 masses with two
    /// stages take 10 and 20 % less, with four 5 %; a batch of the aircraft with four stages would take a fifth more.)
    pub(super) fn expects_followers(&mut self, jacobian: bool) -> bool {
        if const { !has_followers::<M>() } {
            return false;
        }
        self.alike &= jacobian && E::LANES > 1 && S > 2;
        self.alike
    }

    /// The residual after what follows will have been written, with a Jacobian that all stages share as they share the point where it is: what
    /// `k` adds to `x` differs between them only by the nodes.
    pub(super) fn expect_followers(&mut self, coefficients: &Coefficients<E, S>) {
        if const { !has_followers::<M>() } {
            return;
        }
        let Self { f, points, linear, inputs, .. } = self;
        let (jacobian, a, h) = (&linear.jacobian, &coefficients.a, inputs.time.step);
        dispatch(Expect::<M, E, S> { jacobian, points, f, a, h });
    }

    /// Writes what follows sums that have been [compensated](super::compensated), to its last digit.
    pub(super) fn follow_compensated(&mut self, y: &mut ArrayK<M, [E; S]>) {
        if const { !has_followers::<M>() } {
            return;
        }
        dispatch(Round::<M, E, S> { jacobian: &self.linear.jacobian, points: &mut self.points, y });
    }

    /// Takes from the residual of the others what is missing in `k` beyond its digits, of what follows: `f ← f − f_x hA r`, with the residual `r` of
    /// its own equation.
    pub(super) fn correct_followers(&mut self, coefficients: &Coefficients<E, S>) {
        if const { !has_followers::<M>() } {
            return;
        }
        let Self { f, linear, inputs, .. } = self;
        let (jacobian, a, h) = (&linear.jacobian, &coefficients.a, inputs.time.step);
        dispatch(Correct::<M, E, S> { jacobian, f, a, h });
    }
}

/// The unknowns but for followers before the first that is none, and behind the last: `(first, end)`.
pub(super) const fn led<M: Dae>() -> (usize, usize) {
    let followers = M::STRUCTURE.elimination.followers;
    let (mut first, mut end) = (0, M::Shape::NK);
    while first < end && first < followers.len() && is_follower(&followers[first]) {
        first += 1;
    }
    while end > first && end <= followers.len() && is_follower(&followers[end - 1]) {
        end -= 1;
    }
    (first, end)
}

/// Whether [all that are left](led) are none that follow.
pub(super) const fn are_together<M: Dae>() -> bool {
    let (followers, (first, end)) = (M::STRUCTURE.elimination.followers, led::<M>());
    let mut index = first;
    while index < end && index < followers.len() {
        if is_follower(&followers[index]) {
            return false;
        }
        index += 1;
    }
    true
}

/// Whom a state follows, if that is a state, and `−c`.
#[inline(always)]
pub(super) fn leader<M: Dae, E: Lanes, const S: usize>(
    state: usize,
    jacobian: &M::Jacobian<[E; S]>,
) -> Option<(usize, E)> {
    let (_, variable, minus_c) = entry::<M, _>(jacobian, follows::<M>(state)?.entry as usize)?;
    let leader = variable.checked_sub(M::Shape::NX)?;
    if leader < M::Shape::NX { Some((leader, *minus_c.first()?)) } else { None }
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

/// How many blocks of the factors an iteration needs.
pub(super) const fn blocks_of_iteration<M: Dae>() -> usize {
    let Elimination { pivots, followers, .. } = M::STRUCTURE.elimination;
    let (mut count, mut index) = (0, 0);
    while index < pivots.len() {
        let (pivot, slot) = (&pivots[index], pivots[index].slot as usize);
        let (lower, upper) = (pivot.upper - pivot.block - 1, pivot.end - pivot.upper);
        if slot >= followers.len() || !is_follower(&followers[slot]) {
            count += 1 + lower + upper;
        } else if followers[slot].asked {
            count += 1 + upper;
        }
        index += 1;
    }
    count as usize
}

/// See [`Work::follow`].
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
        for state in 0..M::STRUCTURE.elimination.followers.len() {
            let entry = follows::<M>(state).and_then(|of| entry::<M, _>(jacobian, of.entry as usize));
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

/// See [`Work::expect_followers`].
struct Expect<'a, M: Dae, E: Plain, const S: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    /// Where their `k` will be.
    points: &'a mut ArrayV<M, [E; S]>,
    f: &'a mut ArrayK<M, [E; S]>,
    a: &'a [[E; S]; S],
    h: E,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Expect<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        each_row::<A, _>(&mut self);
        let Self { jacobian, points, f, a, h } = self;
        // `h c_i`
        let mut nodes = [E::from_f64(0.0); S];
        for (node, a) in nodes.iter_mut().zip(a) {
            for &a in a {
                *node = *node + h * a;
            }
        }
        for state in 0..M::STRUCTURE.elimination.followers.len() {
            let Some(follower) = follows::<M>(state) else { continue };
            let Some((own, ..)) = entry::<M, _>(jacobian, follower.entry as usize) else { continue };
            let Some(f_own) = f.as_mut().get_mut(own) else { continue };
            let missing = f_own[0];
            *f_own = [E::from_f64(0.0); S];
            for k in points.as_mut().get_mut(state).into_iter().flatten() {
                *k = *k - missing;
            }
            for index in follower.first..follower.end {
                let Some(&index) = M::STRUCTURE.by_column.get(index as usize) else { continue };
                let Some((row, _, felt)) = entry::<M, _>(jacobian, index as usize) else { continue };
                let Some(f) = f.as_mut().get_mut(row) else { continue };
                let share = felt[0] * missing;
                for (f, &node) in f.iter_mut().zip(&nodes) {
                    *f = A::subtract(*f, share, node);
                }
            }
        }
    }
}

/// What other equations have of the derivatives of followers: the residual of its own equation is what is missing in each.
impl<M: Dae, E: Lanes, const S: usize> AtRow for Expect<'_, M, E, S> {
    const ROWS: usize = M::STRUCTURE.blocks[1];
    const INSTRUCTIONS: usize = 2;
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, index: usize) {
        let Some((row, state, felt)) = entry::<M, _>(self.jacobian, index) else { return };
        let own = follows::<M>(state).and_then(|of| entry::<M, _>(self.jacobian, of.entry as usize));
        let Some((own, ..)) = own.filter(|own| own.0 != row) else { return };
        let missing = self.f.as_ref().get(own).map(|f| f[0]);
        if let (Some(missing), Some(f)) = (missing, self.f.as_mut().get_mut(row)) {
            for f in f {
                *f = A::subtract(*f, felt[0], missing);
            }
        }
    }
}

/// See [`Work::follow_compensated`].
struct Round<'a, M: Dae, E: Plain, const S: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    points: &'a mut ArrayV<M, [E; S]>,
    y: &'a mut ArrayK<M, [E; S]>,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Round<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { jacobian, points, y } = self;
        for state in 0..M::STRUCTURE.elimination.followers.len() {
            let k = follower::<M, E, S>(state, jacobian, points.as_ref());
            if let (Some(k), Some(point), Some(y)) =
                (k, points.as_mut().get_mut(state), y.as_mut().get_mut(state))
            {
                (*point, *y) = (k, k);
            }
        }
    }
}

/// See [`Work::correct_followers`].
struct Correct<'a, M: Dae, E: Plain, const S: usize> {
    jacobian: &'a M::Jacobian<[E; S]>,
    f: &'a mut ArrayK<M, [E; S]>,
    a: &'a [[E; S]; S],
    h: E,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Correct<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { jacobian, f, a, h } = self;
        let minus_ha = coupling(a, h);
        for state in 0..M::STRUCTURE.elimination.followers.len() {
            let Some(follower) = follows::<M>(state) else { continue };
            let Some((own, ..)) = entry::<M, _>(jacobian, follower.entry as usize) else { continue };
            let Some(&residual) = f.as_ref().get(own) else { continue };
            let shift = stages::<A, E, S>(E::from_f64(0.0), &minus_ha, &residual);
            for index in follower.first..follower.end {
                let Some(&index) = M::STRUCTURE.by_column.get(index as usize) else { continue };
                let Some((row, _, felt)) = entry::<M, _>(jacobian, index as usize) else { continue };
                let Some(f) = f.as_mut().get_mut(row) else { continue };
                A::subtract_products(f, felt, &shift);
            }
        }
    }
}
