//! Implementations shared by all number types that are not registers.

/// A number that is its own cell.
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

/// The mask of a single number is a `bool`: its operations in [`Field`].
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

/// The operations of such a mask in [`Scalar`].
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

/// Numbers that are their own demoted type.
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
