//! Loops over the constant tables of a model, as straight lines where they are short.
//!
//! The optimiser sees through constant tables only where indices are constants too. In a straight line addresses of blocks and
//! rows are part of the instructions; in a loop most instructions of a small block are spent on finding it: a solve with the blocks of
//! two stages takes a fifth of the instructions.

use super::fused::Arithmetic;
use crate::model::{Dae, Elimination, Pivot};

/// Where nothing is optimised straight lines would only be long, and in firmware memory is dearer than time.
const WANTED: bool = cfg!(all(feature = "std", not(debug_assertions)));

/// They are not longer than so many instructions: they share the nearest cache, and take long to compile.
const MOST_INSTRUCTIONS: usize = 2000;

/// What is done with each row of a table.
pub trait AtRow {
    /// The rows of the table.
    const ROWS: usize;
    /// About how many instructions each takes.
    const INSTRUCTIONS: usize;
    /// To be `#[inline(always)]`.
    fn at<A: Arithmetic>(&mut self, row: usize);
    /// So many of the first rows need only what [`simple`](Self::simple) does.
    const SIMPLE: usize = 0;
    /// What a loop does with these instead, without branches. To be `#[inline(always)]`.
    #[inline(always)]
    fn simple(&mut self, _row: usize) {}
}

/// So many rows are left to the optimiser to unroll.
const CHUNK: usize = 8;

/// So many chunks, and so many pivots, can be written one after the other.
const MOST: usize = 48;

/// One expression for each number from zero on, or down to zero.
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

/// A chunk of rows.
macro_rules! chunk {
    ($A:ty, $V:ty, $visit:ident: $($n:literal)*) => {
        $(if const { $n * CHUNK < <$V>::ROWS } {
            for row in $n * CHUNK..const { smaller(($n + 1) * CHUNK, <$V>::ROWS) } {
                $visit.at::<$A>(row);
            }
        })*
    };
}

const fn smaller(a: usize, b: usize) -> usize {
    if a < b { a } else { b }
}

/// Whether the rows of a table are a straight line.
pub const fn is_short<A: Arithmetic, V: AtRow>() -> bool {
    WANTED && A::FUSED && V::ROWS <= MOST * CHUNK && V::ROWS * V::INSTRUCTIONS <= MOST_INSTRUCTIONS
}

/// All rows of a table.
#[inline(always)]
pub fn each_row<A: Arithmetic, V: AtRow>(visit: &mut V) {
    if const { is_short::<A, V>() } {
        rows_in_line::<A, V>(visit);
        return;
    }
    for row in 0..V::SIMPLE {
        visit.simple(row);
    }
    for row in V::SIMPLE..V::ROWS {
        visit.at::<A>(row);
    }
}

#[inline(always)]
fn rows_in_line<A: Arithmetic, V: AtRow>(visit: &mut V) {
    forwards!(chunk!(A, V, visit));
}

/// What is done at each pivot of a plan.
pub trait AtPivot {
    /// About how many instructions that takes for each block of the factors, or for each update of one.
    const INSTRUCTIONS: usize;
    /// Whether it is done for each update, or for each block.
    const UPDATES: bool = false;
    /// Whether it looks at the pivots that follow, on the way from the last to the first.
    const OTHERS: bool = false;
    /// With the pivots that follow in the plan. To be `#[inline(always)]`.
    fn at<A: Arithmetic>(&mut self, pivot: &'static Pivot, others: &'static [Pivot], updates: &'static [u32]);
}

/// A pivot.
macro_rules! pivot {
    ($A:ty, $M:ty, $visit:ident: $($n:literal)*) => {
        $(if const { $n < <$M>::STRUCTURE.elimination.pivots.len() } {
            let (pivot, others, updates) = const { nth(&<$M>::STRUCTURE.elimination, $n) };
            $visit.at::<$A>(pivot, others, updates);
        })*
    };
}

/// From the first pivot to the last.
#[inline(always)]
pub fn from_first<A: Arithmetic, M: Dae, V: AtPivot>(visit: &mut V) {
    if const { is_short_plan::<A, M, V>() } {
        pivots_in_line::<A, M, V>(visit);
        return;
    }
    let (mut pivots, mut updates) = (M::STRUCTURE.elimination.pivots, M::STRUCTURE.elimination.updates);
    while let Some((pivot, others)) = pivots.split_first() {
        let Some((own, rest)) = updates.split_at_checked(updates_of(pivot)) else { return };
        (pivots, updates) = (others, rest);
        visit.at::<A>(pivot, others, own);
    }
}

/// From the last pivot to the first, without updates; with those that follow where they are asked for.
#[inline(always)]
pub fn from_last<A: Arithmetic, M: Dae, V: AtPivot>(visit: &mut V) {
    if const { is_short_plan::<A, M, V>() } {
        pivots_in_line_backwards::<A, M, V>(visit);
        return;
    }
    let all = M::STRUCTURE.elimination.pivots;
    if const { !V::OTHERS } {
        for pivot in all.iter().rev() {
            visit.at::<A>(pivot, &[], &[]);
        }
        return;
    }
    let mut index = all.len();
    while index > 0 {
        index -= 1;
        if let Some((pivot, others)) = all.get(index..).and_then(|pivots| pivots.split_first()) {
            visit.at::<A>(pivot, others, &[]);
        }
    }
}

#[inline(always)]
fn pivots_in_line<A: Arithmetic, M: Dae, V: AtPivot>(visit: &mut V) {
    forwards!(pivot!(A, M, visit));
}

#[inline(always)]
fn pivots_in_line_backwards<A: Arithmetic, M: Dae, V: AtPivot>(visit: &mut V) {
    backwards!(pivot!(A, M, visit));
}

/// Whether kernels that go through all blocks of a plan are long.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))] // Nobody asks elsewhere.
pub const fn is_long<M: Dae, const S: usize>() -> bool {
    M::STRUCTURE.elimination.slots.len() * S * S > 250
}

const fn is_short_plan<A: Arithmetic, M: Dae, V: AtPivot>() -> bool {
    let plan = &M::STRUCTURE.elimination;
    let count = if V::UPDATES { plan.updates.len() } else { plan.slots.len() };
    WANTED && A::FUSED && plan.pivots.len() <= MOST && count * V::INSTRUCTIONS <= MOST_INSTRUCTIONS
}

/// A pivot, those that follow, and its updates; beyond the last, where nobody looks, any.
const fn nth(plan: &Elimination, n: usize) -> (&'static Pivot, &'static [Pivot], &'static [u32]) {
    if n >= plan.pivots.len() {
        const NONE: Pivot = Pivot {
            slot: 0,
            block: 0,
            upper: 1,
            end: 1,
            left: [0; 3],
            identity: true,
            scaled: false,
            steady: false,
            beside: 1,
        };
        return (&NONE, &[], &[]);
    }
    let (mut begin, mut index) = (0, 0);
    while index < n {
        begin += updates_of(&plan.pivots[index]);
        index += 1;
    }
    let pivot = &plan.pivots[n];
    (pivot, plan.pivots.split_at(n + 1).1, plan.updates.split_at(begin).1.split_at(updates_of(pivot)).0)
}

/// How many blocks a pivot updates.
const fn updates_of(pivot: &Pivot) -> usize {
    ((pivot.upper - pivot.block - 1) * (pivot.end - pivot.upper)) as usize
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::super::fused::Separate;
    use super::*;
    use alloc::vec::Vec;

    /// Writes down where it comes by.
    struct Path<const ROWS: usize>(Vec<usize>);

    impl<const ROWS: usize> AtRow for Path<ROWS> {
        const ROWS: usize = ROWS;
        const INSTRUCTIONS: usize = 1;
        fn at<A: Arithmetic>(&mut self, row: usize) {
            self.0.push(row);
        }
    }

    fn rows<const ROWS: usize>() {
        let mut path = Path::<ROWS>(Vec::new());
        rows_in_line::<Separate, _>(&mut path);
        assert_eq!(path.0, (0..ROWS).collect::<Vec<_>>());
    }

    #[test]
    fn a_line_has_every_row_once() {
        rows::<0>();
        rows::<1>();
        rows::<8>();
        rows::<9>();
        rows::<{ MOST * CHUNK - 1 }>();
        rows::<{ MOST * CHUNK }>();
    }
}
