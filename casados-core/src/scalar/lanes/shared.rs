//! Macros shared by the register modules of several architectures.

/// Functions of an expression of intrinsics each, which the machine supports: see the heads of
/// their files.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
macro_rules! define {
    ($($(#[$attribute:meta])* $name:ident $(<$bits:ident>)? ($($argument:ident: $type:ty),*) -> $result:ty { $body:expr })*) => { $(
        $(#[$attribute])*
        #[inline(always)]
        #[allow(unused_unsafe)] // Some instructions are always enabled, so the block may be unnecessary.
        pub fn $name $(<const $bits: i32>)? ($($argument: $type),*) -> $result {
            // SAFETY: see the head of the file.
            unsafe { $body }
        }
    )* };
}
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
pub(super) use define;

/// Loads and stores of the first `N` numbers of a register, by whole unaligned accesses;
/// transposition, and a function that is not inlined.
#[cfg(any(target_arch = "aarch64", target_arch = "wasm32"))]
macro_rules! through_memory {
    ($element:ty, $width:literal, |$from:ident| $load:expr, |$to:ident, $a:ident| $store:expr) => {
        pub const WIDTH: usize = $width;

        /// Unused lanes repeat the last used one.
        #[inline(always)]
        pub fn load<const N: usize>(cell: &[$element; N]) -> Register {
            let all: [$element; $width] =
                core::array::from_fn(|lane| cell[if lane < N { lane } else { N - 1 }]);
            let $from = all.as_ptr();
            // SAFETY: the array is as large as the register.
            unsafe { $load }
        }
        #[inline(always)]
        pub fn store<const N: usize>($a: Register, cell: &mut [$element; N]) {
            let mut all = [0.0; $width];
            let $to = all.as_mut_ptr();
            // SAFETY: the array is as large as the register.
            unsafe { $store };
            cell.copy_from_slice(&all[..N]);
        }
        /// Transposes the registers.
        #[inline(always)]
        pub fn transpose(rows: [Register; WIDTH]) -> [Register; WIDTH] {
            super::super::transpose_in_memory::<$element, Register, WIDTH>(rows, store, load)
        }
        /// Calls `F`; not inlined.
        #[inline(never)]
        pub fn enter<F: Call<A>, A>(argument: A) -> F::Output {
            F::call(argument)
        }
    };
}
#[cfg(any(target_arch = "aarch64", target_arch = "wasm32"))]
pub(super) use through_memory;
