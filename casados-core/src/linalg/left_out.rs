//! Which pivots of a plan a solve leaves out: of states whose right-hand side or solution is known without it; and which of these the elimination
//! leaves out, with what blocks are made of then.

use crate::model::{Assembly, Dae, Follower, Led, Pivot, Steady};

/// Every pivot.
pub const ALL: u8 = 0;
/// What [steady](Steady) states subtract has been subtracted, their right-hand side is that of the first stage, and those that are
/// [implied] are not found.
pub const STEADY: u8 = 1;
/// States that [follow](follows) have no right-hand side, and are found only where they are asked for.
pub const LED: u8 = 2;

/// Whether a pivot is left out on the way down.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn is_left_out<M: Dae>(pivots: u8, pivot: &Pivot) -> bool {
    match pivots {
        STEADY => pivot.steady,
        LED => pivot.identity && follows::<M>(pivot.slot as usize).is_some(),
        _ => false,
    }
}

/// Whether a pivot that is left out on the way down is left out on the way up.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn is_not_found<M: Dae, E, const S: usize>(pivots: u8, slot: usize) -> bool {
    match pivots {
        LED => follows::<M>(slot).is_some_and(|follower| !follower.asked),
        _ => implied::<M, E, S>(slot).is_some(),
    }
}

/// In firmware models are small and lines are loops, where it takes as many instructions to see who follows as to find it (models of 4 and
/// 6 states took 6 to 9 % more, and 1.5 kB of flash): nobody does.
const WANTED: bool = cfg!(feature = "std");

/// Whether a state follows another.
pub const fn is_follower(of: &Follower) -> bool {
    WANTED && of.entry != Follower::NONE
}

/// What is known of the state of a slot, if it [follows](Follower) another in every iteration of Newton's method.
#[inline(always)]
pub fn follows<M: Dae>(slot: usize) -> Option<&'static Follower> {
    M::STRUCTURE.elimination.followers.get(slot).filter(|follower| is_follower(follower))
}

/// Whether iterations leave states out of the elimination.
pub const fn is_led<M: Dae>() -> bool {
    WANTED && !M::STRUCTURE.elimination.led.is_empty()
}

/// Whether the elimination leaves a pivot out: its state has gone into whom it follows.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn is_absorbed<M: Dae>(pivots: u8, pivot: &Pivot) -> bool {
    pivots == LED && pivot.identity && follows::<M>(pivot.slot as usize).is_some_and(|of| of.absorbed)
}

/// Whether any state follows.
pub const fn has_followers<M: Dae>() -> bool {
    let followers = M::STRUCTURE.elimination.followers;
    let mut index = 0;
    while index < followers.len() {
        if is_follower(&followers[index]) {
            return true;
        }
        index += 1;
    }
    false
}

/// Whether a slot is a [steady](Steady) state.
#[cfg_attr(not(debug_assertions), inline(always))]
pub fn is_steady<M: Dae>(slot: usize) -> bool {
    matches!(M::STRUCTURE.elimination.steady.get(slot), Some(of) if of.entry != Steady::NONE)
}

/// Whether nobody solves for a steady state, as it is [implied](Steady::implied). Of plain numbers, of which a register holds a row, what is
/// made of it would be as much work as it is.
#[inline(always)]
pub const fn is_implied<E, const S: usize>(steady: &Steady) -> bool {
    size_of::<E>() > 8 && S > 2 && steady.implied
}

/// What is known of the steady state of a slot, if it is such.
#[inline(always)]
pub fn implied<M: Dae, E, const S: usize>(slot: usize) -> Option<&'static Steady> {
    M::STRUCTURE.elimination.steady.get(slot).filter(|steady| is_implied::<E, S>(steady))
}

/// How many blocks there are, of all or where states that are absorbed are left out.
pub const fn rows<M: Dae>(led: bool) -> usize {
    let plan = &M::STRUCTURE.elimination;
    if led { plan.led.len() } else { plan.assembly.len() }
}

/// How many of them are fill, which are the first.
pub const fn fill<M: Dae>(led: bool) -> usize {
    let plan = &M::STRUCTURE.elimination;
    if led { plan.fill_led() } else { plan.fill() }
}

/// What one of them is made of: its own entries, and those of a state that is absorbed.
#[inline(always)]
pub fn row_of<M: Dae>(led: bool, row: usize) -> Option<(&'static Assembly, Option<&'static Led>)> {
    let plan = &M::STRUCTURE.elimination;
    if led {
        plan.led.get(row).map(|led| (&led.own, Some(led)))
    } else {
        plan.assembly.get(row).map(|own| (own, None))
    }
}

/// Whether only elimination puts something there.
#[inline(always)]
pub fn is_fill(own: &Assembly, led: Option<&Led>) -> bool {
    led.map_or(own.is_fill(), Led::is_fill)
}
