//! Unrolled loops: an expression for each row or pivot.
//!
//! The compiler evaluates the constants of all expressions in each function that is unrolled,
//! whatever its length: without optimisation that dominates its time.
#![cfg_attr(any(debug_assertions, not(feature = "std")), allow(dead_code))] // Tests only.

use super::{PivotVisitor, RowVisitor, SupernodeVisitor, update_count};
use crate::linalg::kernel::arithmetic::Arithmetic;
use crate::model::{Elimination, Pivot, Update};
use crate::plan::Plan;
use core::marker::PhantomData;

/// Number of rows per chunk, which the optimiser unrolls: each expression costs compile time.
const CHUNK: usize = 10;

/// One expression for each number from zero up, or down to zero.
macro_rules! forwards {
    ($each:ident!($($arguments:tt)*)) => {
        $each!($($arguments)*: 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23
            24 25 26 27 28 29 30 31 32 33 34 35 36 37 38 39 40 41 42 43 44 45 46 47)
    };
}
macro_rules! backwards {
    ($each:ident!($($arguments:tt)*)) => {
        $each!($($arguments)*: 47 46 45 44 43 42 41 40 39 38 37 36 35 34 33 32 31 30 29 28 27 26 25 24
            23 22 21 20 19 18 17 16 15 14 13 12 11 10 9 8 7 6 5 4 3 2 1 0)
    };
}

/// The expression for a chunk of rows.
macro_rules! chunk {
    ($A:ty, $V:ty, $visit:ident: $($n:literal)*) => {
        $(if const { $n * CHUNK < rows::<$V>() } {
            for row in $n * CHUNK..const { smaller(($n + 1) * CHUNK, rows::<$V>()) } {
                $visit.at::<$A>(row);
            }
        })*
    };
}

/// The number of rows of a table.
const fn rows<V: RowVisitor>() -> usize {
    match V::ROWS {
        Some(rows) => rows,
        None => 0,
    }
}

const fn smaller(a: usize, b: usize) -> usize {
    if a < b { a } else { b }
}

#[inline(always)]
pub fn for_each_row<A: Arithmetic, V: RowVisitor>(visitor: &mut V) {
    forwards!(chunk!(A, V, visitor));
}

/// The expression for a pivot.
macro_rules! pivot {
    ($A:ty, $M:ty, $visit:ident: $($n:literal)*) => {
        $(if const { NthPivot::<$M, $n>::EXISTS } && let Some((pivot, updates)) = NthPivot::<$M, $n>::PIVOT {
            $visit.at::<$A>(pivot, updates);
        })*
    };
}

/// The expression for a supernode, with the code for its size only.
macro_rules! supernode {
    ($A:ty, $M:ty, $visit:ident: $($n:literal)*) => {
        $(sizes!($A, $M, $visit, $n: 1 2 3 4);)*
    };
}
macro_rules! sizes {
    ($A:ty, $M:ty, $visit:ident, $n:literal: $($size:literal)*) => {
        $(if const { NthSupernode::<$M, $n, $size>::EXISTS }
            && let Some(pivots) = NthSupernode::<$M, $n, $size>::PIVOTS
        {
            $visit.at::<$A, $size>(pivots);
        })*
    };
}

/// Pivot `N` of a plan, evaluated once for each model instead of once for each function.
struct NthPivot<M, const N: usize>(PhantomData<M>);

impl<M: Plan, const N: usize> NthPivot<M, N> {
    const EXISTS: bool = Self::PIVOT.is_some();
    const PIVOT: Option<(&'static Pivot, &'static [Update])> = match M::KNOWN_STRUCTURE {
        Some(structure) => nth(&structure.elimination, N),
        None => None,
    };
}

/// Returns pivot `n` and its updates.
const fn nth(plan: &Elimination, n: usize) -> Option<(&'static Pivot, &'static [Update])> {
    if n >= plan.pivots.len() {
        return None;
    }
    let (mut begin, mut index) = (0, 0);
    while index < n {
        begin += update_count(&plan.pivots[index]);
        index += 1;
    }
    let pivot = &plan.pivots[n];
    Some((pivot, plan.updates.split_at(begin).1.split_at(update_count(pivot)).0))
}

/// The pivots of supernode `N`, if it has `SIZE` of them.
struct NthSupernode<M, const N: usize, const SIZE: usize>(PhantomData<M>);

impl<M: Plan, const N: usize, const SIZE: usize> NthSupernode<M, N, SIZE> {
    const EXISTS: bool = Self::PIVOTS.is_some();
    const PIVOTS: Option<[&'static Pivot; SIZE]> = match M::KNOWN_STRUCTURE {
        Some(structure) => nth_supernode(&structure.elimination, N),
        None => None,
    };
}

const fn nth_supernode<const SIZE: usize>(plan: &Elimination, n: usize) -> Option<[&'static Pivot; SIZE]> {
    if n >= plan.supernodes.len() || plan.supernodes[n].count as usize != SIZE {
        return None;
    }
    let first = plan.supernodes[n].first as usize;
    let (mut all, mut index) = ([&plan.pivots[first]; SIZE], 1);
    while index < SIZE {
        all[index] = &plan.pivots[first + index];
        index += 1;
    }
    Some(all)
}

#[inline(always)]
pub fn pivots_forward<A: Arithmetic, M: Plan, V: PivotVisitor>(visitor: &mut V) {
    forwards!(pivot!(A, M, visitor));
}

#[inline(always)]
pub fn pivots_backward<A: Arithmetic, M: Plan, V: PivotVisitor>(visitor: &mut V) {
    backwards!(pivot!(A, M, visitor));
}

#[inline(always)]
pub fn supernodes_forward<A: Arithmetic, M: Plan, V: SupernodeVisitor>(visitor: &mut V) {
    forwards!(supernode!(A, M, visitor));
}

#[inline(always)]
pub fn supernodes_backward<A: Arithmetic, M: Plan, V: SupernodeVisitor>(visitor: &mut V) {
    backwards!(supernode!(A, M, visitor));
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::super::MAX_UNROLLED_PIVOTS;
    use super::*;
    use crate::linalg::kernel::arithmetic::Unfused;
    use alloc::vec::Vec;

    /// Records the visited rows.
    struct Path<const ROWS: usize>(Vec<usize>);

    impl<const ROWS: usize> RowVisitor for Path<ROWS> {
        const ROWS: Option<usize> = Some(ROWS);
        const INSTRUCTIONS: usize = 1;
        fn at<A: Arithmetic>(&mut self, row: usize) {
            self.0.push(row);
        }
    }

    fn rows<const ROWS: usize>() {
        let mut path = Path::<ROWS>(Vec::new());
        for_each_row::<Unfused, _>(&mut path);
        assert_eq!(path.0, (0..ROWS).collect::<Vec<_>>());
    }

    #[test]
    fn a_line_has_every_row_once() {
        rows::<0>();
        rows::<1>();
        rows::<CHUNK>();
        rows::<{ CHUNK + 1 }>();
        rows::<{ MAX_UNROLLED_PIVOTS * CHUNK - 1 }>();
        rows::<{ MAX_UNROLLED_PIVOTS * CHUNK }>();
    }
}
