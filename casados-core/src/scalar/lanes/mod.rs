//! Registers of several numbers as scalars.
//!
//! `F64x4<3>` is a register of four `f64` of which three are used: in memory it is `[f64; 3]`.
//! Lanes that are not used hold copies of one that is, so that they cost nothing: no special case
//! is ever taken for their sake alone.
//!
//! | machine | registers |
//! | --- | --- |
//! | x86-64 | [`F64x2`], [`F32x4`] (SSE2) |
//! | with AVX2 and FMA | [`F64x4`], [`F32x8`] |
//! | with AVX-512 F, DQ and VL | [`F64x8`], [`F32x16`] |
//! | 64-bit Arm | [`F64x2`], [`F32x4`] (NEON) |
//!
//! **Who may use them.** Types of the second and third row may be computed with only where
//! [`level`] says that the machine has them: the types are not reachable from outside of the crate,
//! and its drivers ask first. All operations are inlined; they become single instructions inside
//! [`Scalar::vectorize`](super::Scalar::vectorize), and are slow (but right) outside of it.
//!
//! **Bits.** `+ − × ÷ √`, comparisons and `powi` give in each lane the bits that `f64` (`f32`)
//! gives. Elementary functions are those of [`functions`], with the bounds that are listed there.
#![allow(dead_code)]

mod blocks;
#[cfg(feature = "alloc")]
mod cache;
pub mod functions;
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
mod neon;
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
mod register;
#[cfg(all(test, any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
mod tests;
#[cfg(target_arch = "x86_64")]
mod together;
#[cfg(target_arch = "x86_64")]
mod x86;

use core::sync::atomic::{AtomicU8, Ordering};

pub(crate) use blocks::blocks;
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
#[allow(unused_imports)]
pub use register::*;

/// Whether there are any registers of several numbers.
pub const REGISTERS: bool =
    cfg!(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")));

/// The registers that may be used.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// None: numbers one at a time.
    Single,
    /// Those that every machine of this kind has: `F64x2`, `F32x4`.
    Base,
    /// `F64x4`, `F32x8` as well.
    Avx2,
    /// `F64x8`, `F32x16` as well.
    Avx512,
}

/// The numbers of each lane beside each other, where no instructions do it.
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
#[inline(always)]
fn transpose_in_memory<T: Copy + Default, R: Copy, const W: usize>(
    mut rows: [R; W],
    store: fn(R, &mut [T; W]),
    load: fn(&[T; W]) -> R,
) -> [R; W] {
    let mut cells = [[T::default(); W]; W];
    for (row, cell) in rows.iter().zip(&mut cells) {
        store(*row, cell);
    }
    for (lane, row) in rows.iter_mut().enumerate() {
        let mut column = [T::default(); W];
        for (to, cell) in column.iter_mut().zip(&cells) {
            *to = cell[lane];
        }
        *row = load(&column);
    }
    rows
}

/// Runs a computation on `S` numbers side by side in the narrowest register that holds them.
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
macro_rules! side_by_side {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        #[inline(always)]
        fn side_by_side<const S: usize, C: crate::scalar::SideBySide<Self, S>>(
            computation: C,
        ) -> Result<(), C> {
            use crate::scalar::lanes;
            // Two numbers have a register of four where there is one: with fused products,
            // elementary functions in it take half the time of those in a register of two.
            #[cfg(target_arch = "x86_64")]
            if const { S > 1 && S <= $more } && lanes::level() >= lanes::Level::Avx2 {
                computation.call::<lanes::$avx2<S>>();
                return Ok(());
            }
            #[cfg(target_arch = "x86_64")]
            if const { S > $more && S <= $most } && lanes::level() >= lanes::Level::Avx512 {
                computation.call::<lanes::$avx512<S>>();
                return Ok(());
            }
            #[cfg(target_arch = "aarch64")]
            if const { S > 1 && S <= $few } {
                computation.call::<lanes::$base<S>>();
                return Ok(());
            }
            Err(computation)
        }
    };
}
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
macro_rules! side_by_side {
    ($($register:tt)*) => {};
}
pub(crate) use side_by_side;

/// Runs a computation with whole registers.
#[cfg(target_arch = "x86_64")]
macro_rules! widest_register {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        fn widest<C: crate::scalar::Widest<Self>>(lanes: usize, computation: C) -> Result<C::Output, C> {
            use crate::scalar::lanes::{Level, level};
            match level() {
                Level::Avx512 if lanes >= $most => {
                    Ok(computation.call::<crate::scalar::lanes::$avx512<$most>>())
                }
                Level::Avx512 | Level::Avx2 if lanes >= $more => {
                    Ok(computation.call::<crate::scalar::lanes::$avx2<$more>>())
                }
                _ => Err(computation),
            }
        }
    };
}
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
macro_rules! widest_register {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        fn widest<C: crate::scalar::Widest<Self>>(lanes: usize, computation: C) -> Result<C::Output, C> {
            use crate::scalar::lanes::{Level, level};
            if level() < Level::Base || lanes < $few {
                return Err(computation);
            }
            Ok(computation.call::<crate::scalar::lanes::$base<$few>>())
        }
    };
}
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
macro_rules! widest_register {
    ($($register:tt)*) => {};
}
pub(crate) use widest_register;

/// Runs a computation on slices in a function that is compiled for the registers.
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
macro_rules! packed_registers {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        #[inline]
        fn registers<C: crate::scalar::Registers<Self>>(computation: C) {
            use crate::scalar::Scalar;
            use crate::scalar::lanes::{Inside, Level, level, $base};
            match level() {
                #[cfg(target_arch = "x86_64")]
                Level::Avx512 => {
                    use crate::scalar::lanes::$avx512 as Register;
                    Register::<$most>::vectorize(Inside::<Register<$most>, _, Self>::new(computation));
                }
                #[cfg(target_arch = "x86_64")]
                Level::Avx2 => {
                    use crate::scalar::lanes::$avx2 as Register;
                    Register::<$more>::vectorize(Inside::<Register<$more>, _, Self>::new(computation));
                }
                Level::Single => computation.run::<Self>(),
                _ => $base::<$few>::vectorize(Inside::<$base<$few>, _, Self>::new(computation)),
            }
        }
    };
}
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
macro_rules! packed_registers {
    ($($register:tt)*) => {};
}
pub(crate) use packed_registers;

/// A computation as the piece of code that a register enters.
pub struct Inside<E, C, T>(C, core::marker::PhantomData<(E, T)>);

impl<E, C, T> Inside<E, C, T> {
    /// With registers of type `E`.
    pub fn new(computation: C) -> Self {
        Self(computation, core::marker::PhantomData)
    }
}

impl<T, E: crate::scalar::Packed<T>, C: crate::scalar::Registers<T>> crate::scalar::Piece
    for Inside<E, C, T>
{
    #[inline(always)]
    fn run(self) {
        self.0.run::<E>();
    }
}

#[cfg(feature = "testing")]
pub use cache::limit_cache;
#[cfg(feature = "alloc")]
pub(crate) use cache::second_level_cache;

/// The level that is used; [`UNKNOWN`] until somebody asks.
static LEVEL: AtomicU8 = AtomicU8::new(UNKNOWN);
const UNKNOWN: u8 = u8::MAX;

/// For tests: from now on no calculation of the process uses wider registers than these, nor such
/// as the machine does not have.
#[doc(hidden)]
pub fn limit(limit: Level) {
    LEVEL.store(widest(limit) as u8, Ordering::Relaxed);
}

/// The widest registers that this machine has and [`limit`] allows.
#[inline(always)]
pub fn level() -> Level {
    let level = match LEVEL.load(Ordering::Relaxed) {
        level if level == Level::Single as u8 => Level::Single,
        level if level == Level::Base as u8 => Level::Base,
        level if level == Level::Avx2 as u8 => Level::Avx2,
        level if level == Level::Avx512 as u8 => Level::Avx512,
        _ => find(),
    };
    // What there cannot be the compiler leaves out.
    match level {
        Level::Avx512 if may_be(Level::Avx512) => Level::Avx512,
        Level::Avx2 | Level::Avx512 if may_be(Level::Avx2) => Level::Avx2,
        Level::Single => Level::Single,
        _ => Level::Base,
    }
}

/// Whether a machine that runs this may have these registers: without `std` nobody asks it, and it
/// has what the program was compiled for. What is for others is not in the program then.
#[inline(always)]
fn may_be(level: Level) -> bool {
    cfg!(feature = "std") || is_there(level)
}

#[cold]
fn find() -> Level {
    limit(Level::Avx512);
    widest(Level::Avx512)
}

/// The widest registers that this machine has, up to a limit.
fn widest(limit: Level) -> Level {
    let levels = [Level::Avx512, Level::Avx2, Level::Base];
    levels.into_iter().find(|&level| level <= limit && is_there(level)).unwrap_or(Level::Single)
}

/// Whether the machine has these registers.
#[inline(always)]
pub fn is_there(level: Level) -> bool {
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    macro_rules! has {
        ($($feature:tt)*) => { $(std::is_x86_feature_detected!($feature))&&* };
    }
    #[cfg(not(all(target_arch = "x86_64", feature = "std")))]
    macro_rules! has {
        ($($feature:tt)*) => { $(cfg!(target_feature = $feature))&&* };
    }
    match level {
        Level::Single => true,
        Level::Base => cfg!(any(target_arch = "x86_64", target_feature = "neon")),
        Level::Avx2 => has!("avx2" "fma"),
        Level::Avx512 => has!("avx512f" "avx512dq" "avx512vl" "avx2" "fma"),
    }
}
