//! What numbers that are no registers have in common.

/// A number that lies in memory as itself.
macro_rules! own_cell {
    () => {
        type Cell = Self;
        #[inline(always)]
        fn load(cell: &Self) -> Self {
            *cell
        }
        #[inline(always)]
        fn store(self, cell: &mut Self) {
            *cell = self;
        }
    };
}
pub(crate) use own_cell;

/// Comparisons of one number have one result: what a [`Field`] does with it.
macro_rules! one_mask {
    () => {
        type Mask = bool;
        #[inline(always)]
        fn select(mask: bool, a: Self, b: Self) -> Self {
            if mask { a } else { b }
        }
        #[inline(always)]
        fn any(mask: bool) -> bool {
            mask
        }
    };
}
pub(crate) use one_mask;

/// What a [`Scalar`] does with it.
macro_rules! mask_logic {
    () => {
        #[inline(always)]
        fn and(a: bool, b: bool) -> bool {
            a & b
        }
        #[inline(always)]
        fn or(a: bool, b: bool) -> bool {
            a | b
        }
        #[inline(always)]
        fn not(a: bool) -> bool {
            !a
        }
    };
}
pub(crate) use mask_logic;

/// Numbers that are their own demoted ones.
macro_rules! as_it_is {
    () => {
        type Demoted = Self;
        #[inline(always)]
        fn demote(self) -> Self {
            self
        }
        #[inline(always)]
        fn promote(demote: Self) -> Self {
            demote
        }
    };
}
pub(crate) use as_it_is;
