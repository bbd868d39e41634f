//! SIMD registers as scalars.
//!
//! `F64x4<3>` is a register of four `f64` of which three are used: in memory it is `[f64; 3]`.
//! Unused lanes repeat a used one, so that they never cause a special case.
//!
//! | machine | registers |
//! | --- | --- |
//! | x86-64 | [`F64x2`], [`F32x4`] (SSE2) |
//! | with AVX2 and FMA | [`F64x4`], [`F32x8`] |
//! | with AVX-512 F, DQ and VL | [`F64x8`], [`F32x16`] |
//! | 64-bit Arm | [`F64x2`], [`F32x4`] (NEON) |
//! | WebAssembly | [`F64x2`], [`F32x4`] (with `simd128`) |
//!
//! **Detection.** Types of the second and third row may be used only if [`level`] reports them: the
//! types are private to the crate, and its drivers check first. All operations are inlined; they
//! become single instructions inside [`Scalar::vectorize`](super::Scalar::vectorize), and are slow
//! (but correct) elsewhere.
//!
//! **Bits.** `+ − × ÷ √`, comparisons and `powi` of each lane are bitwise equal to those of `f64`
//! (`f32`). Elementary functions are those of [`functions`], with the bounds listed there.
// Unused on machines without registers.
#![cfg_attr(
    not(any(
        target_arch = "x86_64",
        all(target_arch = "aarch64", target_feature = "neon"),
        all(target_arch = "wasm32", target_feature = "simd128")
    )),
    allow(dead_code)
)]

mod blocks;
#[cfg(feature = "alloc")]
mod cache;
#[cfg(any(
    target_arch = "x86_64",
    all(target_arch = "aarch64", target_feature = "neon"),
    all(target_arch = "wasm32", target_feature = "simd128")
))]
mod drivers;
#[cfg(not(any(
    target_arch = "x86_64",
    all(target_arch = "aarch64", target_feature = "neon"),
    all(target_arch = "wasm32", target_feature = "simd128")
)))]
#[path = "none.rs"]
mod drivers;
pub mod functions;
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
mod neon;
#[cfg(any(
    target_arch = "x86_64",
    all(target_arch = "aarch64", target_feature = "neon"),
    all(target_arch = "wasm32", target_feature = "simd128")
))]
mod register;
#[cfg(any(
    target_arch = "x86_64",
    all(target_arch = "aarch64", target_feature = "neon"),
    all(target_arch = "wasm32", target_feature = "simd128")
))]
mod shared;
#[cfg(all(
    test,
    any(
        target_arch = "x86_64",
        all(target_arch = "aarch64", target_feature = "neon"),
        all(target_arch = "wasm32", target_feature = "simd128")
    )
))]
mod tests;
#[cfg(target_arch = "x86_64")]
mod together;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
#[cfg(target_arch = "x86_64")]
mod x86;

use core::sync::atomic::{AtomicU8, Ordering};

pub(crate) use blocks::blocks;
pub use drivers::*;

/// The available registers.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// None: single numbers. Computations on slices use `Base` if it exists.
    Single,
    /// The registers of the baseline instruction set: `F64x2`, `F32x4`.
    Base,
    /// Also `F64x4`, `F32x8`.
    Avx2,
    /// Also `F64x8`, `F32x16`.
    Avx512,
}

#[cfg(feature = "testing")]
pub use cache::limit_cache;
#[cfg(feature = "alloc")]
pub(crate) use cache::second_level_cache;

/// The machine features that each level requires.
macro_rules! registers {
    ($level:expr, $has:ident) => {
        match $level {
            Level::Single => true,
            Level::Base => REGISTERS,
            Level::Avx2 => $has!("avx2" "fma"),
            Level::Avx512 => $has!("avx512f" "avx512dq" "avx512vl" "avx2" "fma"),
        }
    };
}

/// The level in use; [`UNKNOWN_LEVEL`] before the first query.
static SIMD_LEVEL: AtomicU8 = AtomicU8::new(UNKNOWN_LEVEL);
const UNKNOWN_LEVEL: u8 = u8::MAX;

/// For tests: limits the registers of the process to this level, and to those of the machine.
#[doc(hidden)]
pub fn limit_level(limit: Level) {
    SIMD_LEVEL.store(widest_level(limit) as u8, Ordering::Relaxed);
}

/// The registers enabled at compile time (`-C target-cpu=native`): every machine that runs the
/// program has them, and code for others is omitted.
const BUILD_LEVEL: Option<Level> = if is_enabled_by_build(Level::Avx512) {
    Some(Level::Avx512)
} else if is_enabled_by_build(Level::Avx2) {
    Some(Level::Avx2)
} else {
    None
};

/// Whether this may be the [`level`] of a machine that runs the program. Without `std` there is no
/// detection, and the level is that of the build.
pub const fn may_be_available(level: Level) -> bool {
    match BUILD_LEVEL {
        Some(named) => level as u8 == named as u8,
        None => cfg!(feature = "std") || (level as u8) <= Level::Base as u8,
    }
}

/// Whether a machine that runs the program may have AVX2.
pub const AVX2: bool = may_be_available(Level::Avx2) || may_be_available(Level::Avx512);

/// The widest registers of this machine within [`limit_level`]; those of the build, if it sets a
/// level.
#[inline(always)]
pub fn level() -> Level {
    if let Some(named) = BUILD_LEVEL {
        return named;
    }
    let level = match SIMD_LEVEL.load(Ordering::Relaxed) {
        level if level == Level::Single as u8 => Level::Single,
        level if level == Level::Base as u8 => Level::Base,
        level if level == Level::Avx2 as u8 => Level::Avx2,
        level if level == Level::Avx512 as u8 => Level::Avx512,
        _ => detect_level(),
    };
    // The compiler omits impossible levels.
    match level {
        Level::Avx512 | Level::Avx2 if !AVX2 => Level::Base,
        level => level,
    }
}

#[cold]
fn detect_level() -> Level {
    limit_level(Level::Avx512);
    widest_level(Level::Avx512)
}

/// The widest registers of this machine, up to a limit.
fn widest_level(limit: Level) -> Level {
    let levels = [Level::Avx512, Level::Avx2, Level::Base];
    levels.into_iter().find(|&level| level <= limit && is_detected(level)).unwrap_or(Level::Single)
}

/// Whether the build enables these registers.
const fn is_enabled_by_build(level: Level) -> bool {
    macro_rules! has {
        ($($feature:tt)*) => { $(cfg!(target_feature = $feature))&&* };
    }
    registers!(level, has)
}

/// Whether the machine has these registers.
#[inline(always)]
pub fn is_detected(level: Level) -> bool {
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    macro_rules! has {
        ($($feature:tt)*) => { $(std::is_x86_feature_detected!($feature))&&* };
    }
    #[cfg(not(all(target_arch = "x86_64", feature = "std")))]
    macro_rules! has {
        ($($feature:tt)*) => { $(cfg!(target_feature = $feature))&&* };
    }
    registers!(level, has)
}
