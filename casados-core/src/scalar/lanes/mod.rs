//! Registers of several numbers as scalars.
//!
//! `F64x4<3>` is a register of four `f64` of which three are used: in memory it is `[f64; 3]`. Lanes that are not
//! used hold copies of one that is, so that they cost nothing: no special case is ever taken for their sake alone.
//!
//! | machine | registers |
//! | --- | --- |
//! | x86-64 | [`F64x2`], [`F32x4`] (SSE2) |
//! | with AVX2 and FMA | [`F64x4`], [`F32x8`] |
//! | with AVX-512 F, DQ and VL | [`F64x8`], [`F32x16`] |
//! | 64-bit Arm | [`F64x2`], [`F32x4`] (NEON) |
//!
//! **Who may use them.** Types of the second and third row may be computed with only where [`level`] says that the
//! machine has them: the types are not reachable from outside of the crate, and its drivers ask first. All
//! operations are inlined; they become single instructions inside
//! [`Scalar::vectorize`](super::Scalar::vectorize), and are slow (but right) outside of it.
//!
//! **Bits.** `+ − × ÷ √`, comparisons and `powi` give in each lane the bits that `f64` (`f32`) gives. Elementary
//! functions are those of [`functions`], with the bounds that are listed there.
#![allow(dead_code)]

#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
mod functions;
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
mod neon;
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
mod register;
#[cfg(all(test, any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
mod tests;
#[cfg(target_arch = "x86_64")]
mod x86;

use core::sync::atomic::{AtomicU8, Ordering};
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
#[allow(unused_imports)]
pub use register::*;

/// The registers that may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// None: numbers one at a time.
    Single,
    /// Those that every machine of this kind has: [`F64x2`], [`F32x4`].
    Base,
    /// [`F64x4`], [`F32x8`] as well.
    Avx2,
    /// [`F64x8`], [`F32x16`] as well.
    Avx512,
}

static LIMIT: AtomicU8 = AtomicU8::new(Level::Avx512 as u8);

/// For tests: from now on no calculation of the process uses wider registers than these.
pub fn limit(level: Level) {
    LIMIT.store(level as u8, Ordering::Relaxed);
}

/// The widest registers that this machine has and [`limit`] allows.
#[inline]
pub fn level() -> Level {
    let limit = LIMIT.load(Ordering::Relaxed);
    for level in [Level::Avx512, Level::Avx2, Level::Base] {
        if level as u8 <= limit && is_there(level) {
            return level;
        }
    }
    Level::Single
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
