//! Kernels compiled for every machine, and for those that multiply and add in one instruction:
//! AVX2, AVX-512.
//!
//! A plain x86-64 binary must run on machines without AVX2 and FMA. So a kernel is generic over its
//! [`Arithmetic`], everything in it is inlined, and [`dispatch`] enters it through a function that
//! is compiled for the better machine if this is one. Results differ by rounding only.

use crate::linalg::block::Block;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
use crate::scalar::Known;
#[cfg(target_arch = "x86_64")]
use crate::scalar::lanes::{Level, level};
use crate::scalar::{Field, transposed};
#[cfg(target_arch = "x86_64")]
use core::mem::ManuallyDrop;

/// How `t − a b` is computed.
pub trait Arithmetic {
    /// Whether it rounds once: it is that of machines that matter, which loops become straight
    /// lines for.
    const FUSED: bool = false;
    /// Whether numbers side by side fill the registers of AVX-512.
    const WIDE: bool = false;
    /// `t − a b`
    fn subtract<E: Field>(t: E, a: E, b: E) -> E;
    /// `target − left · right`
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_blocks<E: Field, const S: usize>(
        target: &mut Block<E, S>,
        left: &Block<E, S>,
        right: &Block<E, S>,
    ) {
        for (target, right) in target.iter_mut().zip(right) {
            Self::subtract_columns(target, left, right);
        }
    }
    /// `target − block · x`
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_columns<E: Field, const S: usize>(target: &mut [E; S], block: &Block<E, S>, x: &[E; S]) {
        for (column, &x) in block.iter().zip(x) {
            for (target, &element) in target.iter_mut().zip(column) {
                *target = Self::subtract(*target, element, x);
            }
        }
    }
    /// `target − factor · row`
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_row<E: Field, const W: usize>(target: &mut [E; W], factor: E, row: &[E; W]) {
        for (target, &element) in target.iter_mut().zip(row) {
            *target = Self::subtract(*target, factor, element);
        }
    }
    /// `target = block`, in as few instructions as the numbers will be read in: until all that it
    /// wants has arrived in the nearest cache, a wider one would wait.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn write<E: Field, const S: usize>(target: &mut Block<E, S>, block: &Block<E, S>) {
        *target = *block;
    }
    /// Rows as columns.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn transposed<E: Field, const N: usize>(rows: &[[E; N]; N]) -> [[E; N]; N] {
        transposed(rows)
    }
    /// `target − a b`, element by element
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_products<E: Field, const W: usize>(target: &mut [E; W], a: &[E; W], b: &[E; W]) {
        for ((target, &a), &b) in target.iter_mut().zip(a).zip(b) {
            *target = Self::subtract(*target, a, b);
        }
    }
}

/// Rounded twice.
#[cfg(any(test, not(target_arch = "aarch64")))]
pub struct Separate;

#[cfg(any(test, not(target_arch = "aarch64")))]
impl Arithmetic for Separate {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract<E: Field>(t: E, a: E, b: E) -> E {
        t - a * b
    }
}

/// Rounded once, in one instruction. Kernels are run with it by [`dispatch`] alone, where the
/// machine has the instructions; so it says that these are [`Known`]. On numbers side by side in
/// registers as `WIDE` as those of AVX-512 are, or half as wide.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
pub struct Fused<const WIDE: bool>;

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
impl<const WIDE: bool> Arithmetic for Fused<WIDE> {
    const FUSED: bool = true;
    const WIDE: bool = WIDE;
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract<E: Field>(t: E, a: E, b: E) -> E {
        t.subtract_product(a, b)
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_blocks<E: Field, const S: usize>(
        target: &mut Block<E, S>,
        left: &Block<E, S>,
        right: &Block<E, S>,
    ) {
        E::subtract_blocks(target, left, right, Known::<WIDE>::here());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_columns<E: Field, const S: usize>(target: &mut [E; S], block: &Block<E, S>, x: &[E; S]) {
        E::subtract_columns(target, block, x, Known::<WIDE>::here());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_row<E: Field, const W: usize>(target: &mut [E; W], factor: E, row: &[E; W]) {
        E::subtract_row(target, factor, row, Known::<WIDE>::here());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn write<E: Field, const S: usize>(target: &mut Block<E, S>, block: &Block<E, S>) {
        E::write_block(target, block, Known::<WIDE>::here());
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn transposed<E: Field, const N: usize>(rows: &[[E; N]; N]) -> [[E; N]; N] {
        E::transposed(rows, Known::<WIDE>::here())
    }
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn subtract_products<E: Field, const W: usize>(target: &mut [E; W], a: &[E; W], b: &[E; W]) {
        E::subtract_products(target, a, b, Known::<WIDE>::here());
    }
}

/// A computation that is worth being compiled for the machine it runs on.
pub trait Kernel {
    /// What it computes with.
    type Number;
    /// Its result.
    type Output;
    /// Whether it is long: AVX-512 then takes fewer instructions, as it multiplies by numbers that
    /// are still in memory.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))] // Nobody asks elsewhere.
    const WIDE: bool = false;
    /// To be `#[inline(always)]`, with everything that it calls.
    fn run<A: Arithmetic>(self) -> Self::Output;
}

/// What kernels are compiled for. Each has a module of its own, since the compiler works on modules
/// side by side: with all kernels in one the aircraft would take a tenth longer.
///
/// Those with instructions that not every machine has find the kernel where it was made: it is made
/// of pointers, one after the other, and a copy would be made of two at a time, which the processor
/// waits for until both have arrived in the nearest cache. (Calls of the pendulum took up to a
/// fifth more.)
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod compiled {
    pub mod base {
        use super::super::{Kernel, Separate};

        // Never inlined beside others, so that callers are small. Where it is the only one, the
        // optimiser is to see from outside that nothing in it panics.
        #[cfg_attr(feature = "std", inline(never))]
        #[cfg_attr(not(feature = "std"), inline(always))]
        pub fn run<K: Kernel>(kernel: K) -> K::Output {
            kernel.run::<Separate>()
        }
    }

    pub mod avx2 {
        use super::super::{Fused, Kernel};
        use core::mem::ManuallyDrop;

        /// # Safety
        /// Nobody else may take the kernel.
        #[target_feature(enable = "avx2,fma")]
        pub unsafe fn run<K: Kernel>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the caller's promise; and nobody drops it.
            unsafe { ManuallyDrop::take(kernel) }.run::<Fused<false>>()
        }
    }

    pub mod avx512 {
        use super::super::{Fused, Kernel};
        use core::mem::ManuallyDrop;

        /// # Safety
        /// Nobody else may take the kernel.
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
        pub unsafe fn run<K: Kernel>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the caller's promise; and nobody drops it.
            unsafe { ManuallyDrop::take(kernel) }.run::<Fused<true>>()
        }
    }
}

/// Runs a kernel as this machine does it best.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    use compiled::{avx2, avx512, base};
    // Numbers that are registers, which are aligned to themselves, need what these are made of, and
    // nothing else. Of other kernels short ones are up to a tenth faster without AVX-512; and
    // unoptimised programs, where each copy of a kernel is much to compile and none is fast, have
    // the one copy that runs everywhere.
    if const { cfg!(debug_assertions) && align_of::<K::Number>() < 32 } {
        return base::run(kernel);
    }
    // One of those that follow takes it, and nobody after that.
    let mut kernel = ManuallyDrop::new(kernel);
    if const { align_of::<K::Number>() > 32 } {
        // SAFETY: the other condition of calling a function with target features is that the
        // machine has them. Numbers are `Real`, registers, or made of such, and no type of a user's
        // can be any of these (`Lanes` is sealed). So what is aligned like this is made of
        // registers of AVX-512, with which drivers compute only after detection; see the head of
        // `lanes`.
        unsafe { avx512::run(&mut kernel) }
    } else if const { align_of::<K::Number>() == 32 && !K::WIDE } {
        // SAFETY: the same of AVX2.
        unsafe { avx2::run(&mut kernel) }
    } else if const { align_of::<K::Number>() == 32 } {
        match level() {
            // SAFETY: `level` says what the machine has.
            Level::Avx512 => unsafe { avx512::run(&mut kernel) },
            // SAFETY: as above.
            _ => unsafe { avx2::run(&mut kernel) },
        }
    } else if const { K::WIDE } {
        match level() {
            // SAFETY: `level` says what the machine has.
            Level::Avx512 => unsafe { avx512::run(&mut kernel) },
            // SAFETY: as above.
            Level::Avx2 => unsafe { avx2::run(&mut kernel) },
            _ => base::run(ManuallyDrop::into_inner(kernel)),
        }
    } else {
        match level() {
            // SAFETY: as above.
            Level::Avx512 | Level::Avx2 => unsafe { avx2::run(&mut kernel) },
            _ => base::run(ManuallyDrop::into_inner(kernel)),
        }
    }
}

/// Runs a kernel as this machine does it best: every 64-bit Arm multiplies and adds in one
/// instruction.
#[cfg(target_arch = "aarch64")]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Fused<false>>()
}

/// Runs a kernel in the way that every machine has.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Separate>()
}
