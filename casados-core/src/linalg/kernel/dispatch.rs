//! Kernels that are compiled for the baseline instruction set, and for fused multiply-add with AVX2
//! and AVX-512.
//!
//! A plain x86-64 binary must run on machines without AVX2 and FMA. So a kernel is generic over its
//! [`Arithmetic`], everything in it is inlined, and [`dispatch`] enters it through a function that
//! is compiled for the instruction set of the machine. Results differ by rounding only.

use super::arithmetic::Arithmetic;
#[cfg(target_arch = "aarch64")]
use super::arithmetic::Fused;
use super::arithmetic::Unfused;
#[cfg(target_arch = "x86_64")]
use crate::scalar::lanes::{Level, level, may_be_available};
#[cfg(target_arch = "x86_64")]
use core::{marker::PhantomData, mem::ManuallyDrop};

/// A computation that is compiled for several instruction sets.
pub trait Kernel {
    /// The number type of the kernel.
    type Number;
    /// Its result.
    type Output;
    /// Whether the kernel is long and its products of numbers fill AVX-512 registers. It then takes
    /// fewer instructions on such machines, with one more copy to compile. Its loops over tables
    /// are not unrolled: each step is so long that address computations do not matter.
    #[cfg_attr(not(any(target_arch = "x86_64", target_arch = "aarch64")), allow(dead_code))]
    const WIDE: bool = false;
    /// Runs the kernel; `#[inline(always)]`, with everything that it calls.
    fn run<A: Arithmetic>(self) -> Self::Output;
}

/// Defines functions that are kernels: `fn name [generics] [their names] <A>(arguments) { … }`,
/// with the lifetime `'k`, numbers `E` and the arithmetic `A`. They are run by [`dispatch`], or by
/// the function named in front of them: `by run;`.
macro_rules! kernels {
    (by $run:path; $(
        $(#[$meta:meta])*
        $visibility:vis fn $name:ident [$($generics:tt)*] [$($names:tt)*] <$arithmetic:ident>(
            $($argument:ident: $type:ty),* $(,)?
        ) $(-> $output:ty)? $body:block
    )*) => { $(
        $(#[$meta])*
        #[inline(always)]
        $visibility fn $name<'k, $($generics)*>($($argument: $type),*) $(-> $output)? {
            struct Call<'k, $($generics)*> {
                $($argument: $type),*
            }
            impl<'k, $($generics)*> $crate::linalg::Kernel for Call<'k, $($names)*> {
                type Number = E;
                type Output = $crate::linalg::kernels!(@output $($output)?);
                #[inline(always)]
                fn run<$arithmetic: $crate::linalg::Arithmetic>(self) -> Self::Output {
                    let Self { $($argument),* } = self;
                    $body
                }
            }
            $run(Call::<'k, $($names)*> { $($argument),* })
        }
    )* };
    (@output $output:ty) => { $output };
    (@output) => { () };
    ($($kernels:tt)*) => { $crate::linalg::kernels!(by $crate::linalg::dispatch; $($kernels)*); };
}
pub(crate) use kernels;

/// Runs a kernel on SIMD registers by [`dispatch`], and one on scalars as ordinary code, if
/// dispatching would cost more than it saves.
#[inline(always)]
pub fn run_plain<K: Kernel>(kernel: K) -> K::Output {
    if const { align_of::<K::Number>() < 32 } { kernel.run::<Unfused>() } else { dispatch(kernel) }
}

/// Entry functions for each instruction set. Each has its own module, since the compiler processes
/// modules in parallel.
///
/// Kernels are passed by reference to functions with optional instructions. A kernel consists of
/// adjacent pointers: a copy would load two of them at a time, and wait until both stores have
/// reached the L1 cache.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod compiled {
    pub mod base {
        use super::super::{Kernel, Unfused};
        use core::mem::ManuallyDrop;

        // Not inlined if there are other entry functions, so that callers are small. If it is the
        // only one it is inlined, so that the optimiser sees that it does not panic.
        /// # Safety
        /// The caller must not use the kernel afterwards.
        #[cfg_attr(feature = "std", inline(never))]
        #[cfg_attr(not(feature = "std"), inline(always))]
        pub unsafe fn run<K: Kernel>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the kernel is taken once, by the caller's promise, and never dropped.
            unsafe { ManuallyDrop::take(kernel) }.run::<Unfused>()
        }
    }

    pub mod avx2 {
        use super::super::Kernel;
        use crate::linalg::kernel::arithmetic::Fused;
        use core::mem::ManuallyDrop;

        /// # Safety
        /// The caller must not use the kernel afterwards, and the machine must have AVX2 and FMA.
        #[target_feature(enable = "avx2,fma")]
        pub unsafe fn run<K: Kernel, const UNROLLED: bool>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the kernel is taken once, by the caller's promise, and never dropped.
            unsafe { ManuallyDrop::take(kernel) }.run::<Fused<false, UNROLLED>>()
        }
    }

    pub mod avx512 {
        use super::super::Kernel;
        use crate::linalg::kernel::arithmetic::Fused;
        use core::mem::ManuallyDrop;

        /// # Safety
        /// The caller must not use the kernel afterwards, and the machine must have AVX-512.
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
        pub unsafe fn run<K: Kernel, const UNROLLED: bool>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the kernel is taken once, by the caller's promise, and never dropped.
            unsafe { ManuallyDrop::take(kernel) }.run::<Fused<true, UNROLLED>>()
        }
    }
}

/// The entry functions of a kernel: those that suit its numbers and the machines that may run the
/// program. They are constants, so that the compiler analyses these only: it analyses every
/// function behind `if const`.
#[cfg(target_arch = "x86_64")]
struct EntryPoints<K>(PhantomData<K>);

/// Takes the kernel, which must not be used afterwards.
#[cfg(target_arch = "x86_64")]
type EntryPoint<K> = unsafe fn(&mut ManuallyDrop<K>) -> <K as Kernel>::Output;

#[cfg(target_arch = "x86_64")]
impl<K: Kernel> EntryPoints<K> {
    /// Whether its numbers are scalars in an optimised program. Unoptimised programs contain only
    /// the copy that runs everywhere, since each copy costs compile time and none is fast.
    const ARE_FAST_SCALARS: bool = align_of::<K::Number>() < 32 && !cfg!(debug_assertions);
    const IN_AVX512: EntryPoint<K> =
        if K::WIDE { compiled::avx512::run::<K, false> } else { compiled::avx512::run::<K, true> };
    const IN_AVX2: EntryPoint<K> =
        if K::WIDE { compiled::avx2::run::<K, false> } else { compiled::avx2::run::<K, true> };
    /// Short kernels are faster without AVX-512.
    const AVX512_ENTRY: Option<EntryPoint<K>> =
        if Self::ARE_FAST_SCALARS && K::WIDE && may_be_available(Level::Avx512) {
            Some(Self::IN_AVX512)
        } else {
            None
        };
    const AVX2_ENTRY: Option<EntryPoint<K>> = if Self::ARE_FAST_SCALARS
        && (may_be_available(Level::Avx2) || !K::WIDE && may_be_available(Level::Avx512))
    {
        Some(Self::IN_AVX2)
    } else {
        None
    };
    /// The entry for machines, or kernels, without these instruction sets. Kernels on SIMD
    /// registers, which are aligned to their size, need the instruction set of the register. If the
    /// build requires more than the baseline, it is the entry for the required instruction set.
    const FALLBACK: EntryPoint<K> = match (align_of::<K::Number>(), Self::AVX2_ENTRY, Self::AVX512_ENTRY) {
        (0..32, Some(run), _) | (0..32, _, Some(run)) if !may_be_available(Level::Base) => run,
        (0..32, ..) => compiled::base::run::<K>,
        (32, ..) => Self::IN_AVX2,
        _ => Self::IN_AVX512,
    };
    /// Whether this is the only entry, so that no detection is needed; also in unoptimised
    /// programs.
    const FALLBACK_ONLY: bool = Self::AVX2_ENTRY.is_none() && Self::AVX512_ENTRY.is_none();
}

/// Runs a kernel with the best instruction set of this machine.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    // One of the following entries takes the kernel; it is not used afterwards.
    let mut kernel = ManuallyDrop::new(kernel);
    if const { EntryPoints::<K>::FALLBACK_ONLY } {
        // SAFETY: as at the end of the function.
        return unsafe { EntryPoints::<K>::FALLBACK(&mut kernel) };
    }
    if let Some(run) = EntryPoints::<K>::AVX512_ENTRY
        && level() == Level::Avx512
    {
        // SAFETY: `level` detects the instruction sets of the machine.
        return unsafe { run(&mut kernel) };
    }
    if let Some(run) = EntryPoints::<K>::AVX2_ENTRY
        && level() >= Level::Avx2
    {
        // SAFETY: as above.
        return unsafe { run(&mut kernel) };
    }
    // SAFETY: the kernel is not used afterwards, and the machine has the required target features.
    // Kernels on scalars need none. Numbers are `Real`, SIMD registers, or composed of these;
    // user-defined types are not possible (`Lanes` is sealed). A larger alignment therefore means
    // AVX2 or AVX-512 registers, which drivers use only after detection; see the head of `lanes`.
    unsafe { EntryPoints::<K>::FALLBACK(&mut kernel) }
}

/// Runs a kernel: every 64-bit Arm processor has a fused multiply-add instruction.
#[cfg(target_arch = "aarch64")]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    if const { K::WIDE } { kernel.run::<Fused<false, false>>() } else { kernel.run::<Fused<false, true>>() }
}

/// Runs a kernel with the baseline instruction set.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Unfused>()
}
