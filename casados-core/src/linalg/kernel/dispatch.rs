//! Kernels compiled for every machine, and for those that multiply and add in one instruction:
//! AVX2, AVX-512.
//!
//! A plain x86-64 binary must run on machines without AVX2 and FMA. So a kernel is generic over its
//! [`Arithmetic`], everything in it is inlined, and [`dispatch`] enters it through a function that
//! is compiled for the better machine if this is one. Results differ by rounding only.

use super::arithmetic::Arithmetic;
#[cfg(target_arch = "aarch64")]
use super::arithmetic::Fused;
use super::arithmetic::Unfused;
#[cfg(target_arch = "x86_64")]
use crate::scalar::lanes::{Level, level, may_be_available};
#[cfg(target_arch = "x86_64")]
use core::{marker::PhantomData, mem::ManuallyDrop};

/// A computation that is worth being compiled for the machine it runs on.
pub trait Kernel {
    /// What it computes with.
    type Number;
    /// Its result.
    type Output;
    /// Whether it is long, and its products of numbers fill registers of AVX-512. That takes fewer
    /// instructions there, and one more copy of the kernel to compile. Loops over tables stay loops
    /// in it: each step is so long that it matters little how its place is found.
    #[cfg_attr(not(any(target_arch = "x86_64", target_arch = "aarch64")), allow(dead_code))]
    const WIDE: bool = false;
    /// To be `#[inline(always)]`, with everything that it calls.
    fn run<A: Arithmetic>(self) -> Self::Output;
}

/// Functions that are kernels: `fn name [generics] [their names] <A>(arguments) { … }`, with the
/// lifetime `'k`, numbers `E` and the arithmetic `A`. What runs them is [`dispatch`], or said
/// before them: `by run;`.
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

/// Runs a kernel on registers as [`dispatch`] does, and one on single numbers as all code around it
/// is compiled: where that is more than kernels could save.
#[inline(always)]
pub fn run_plain<K: Kernel>(kernel: K) -> K::Output {
    if const { align_of::<K::Number>() < 32 } { kernel.run::<Unfused>() } else { dispatch(kernel) }
}

/// What kernels are compiled for. Each has a module of its own, since the compiler works on modules
/// side by side.
///
/// Those with instructions that not every machine has find the kernel where it was made: it is made
/// of pointers, one after the other, and a copy would be made of two at a time, which the processor
/// waits for until both have arrived in the nearest cache.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod compiled {
    pub mod base {
        use super::super::{Kernel, Unfused};
        use core::mem::ManuallyDrop;

        // Never inlined beside others, so that callers are small. Where it is the only one, the
        // optimiser is to see from outside that nothing in it panics.
        /// # Safety
        /// Nobody else may take the kernel.
        #[cfg_attr(feature = "std", inline(never))]
        #[cfg_attr(not(feature = "std"), inline(always))]
        pub unsafe fn run<K: Kernel>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the caller's promise; and nobody drops it.
            unsafe { ManuallyDrop::take(kernel) }.run::<Unfused>()
        }
    }

    pub mod avx2 {
        use super::super::Kernel;
        use crate::linalg::kernel::arithmetic::Fused;
        use core::mem::ManuallyDrop;

        /// # Safety
        /// Nobody else may take the kernel.
        #[target_feature(enable = "avx2,fma")]
        pub unsafe fn run<K: Kernel, const UNROLLED: bool>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the caller's promise; and nobody drops it.
            unsafe { ManuallyDrop::take(kernel) }.run::<Fused<false, UNROLLED>>()
        }
    }

    pub mod avx512 {
        use super::super::Kernel;
        use crate::linalg::kernel::arithmetic::Fused;
        use core::mem::ManuallyDrop;

        /// # Safety
        /// Nobody else may take the kernel.
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
        pub unsafe fn run<K: Kernel, const UNROLLED: bool>(kernel: &mut ManuallyDrop<K>) -> K::Output {
            // SAFETY: the caller's promise; and nobody drops it.
            unsafe { ManuallyDrop::take(kernel) }.run::<Fused<true, UNROLLED>>()
        }
    }
}

/// The functions by which a kernel is entered: those that are for its numbers and for machines that
/// may run the program. They are constants, so that the compiler looks into no others: of functions
/// behind `if const` it looks into all.
#[cfg(target_arch = "x86_64")]
struct EntryPoints<K>(PhantomData<K>);

/// It takes the kernel, which nobody may do after it.
#[cfg(target_arch = "x86_64")]
type EntryPoint<K> = unsafe fn(&mut ManuallyDrop<K>) -> <K as Kernel>::Output;

#[cfg(target_arch = "x86_64")]
impl<K: Kernel> EntryPoints<K> {
    /// Whether its numbers are single, and fast. Unoptimised programs, where each copy of a kernel
    /// is much to compile and none is fast, have the one copy that runs everywhere.
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
    /// Where the machine has neither, or the kernel. Numbers that are registers, which are aligned
    /// to themselves, need what these are made of. Where the build names more than every machine
    /// has, nobody gets here.
    const FALLBACK: EntryPoint<K> = match (align_of::<K::Number>(), Self::AVX2_ENTRY, Self::AVX512_ENTRY) {
        (0..32, Some(run), _) | (0..32, _, Some(run)) if !may_be_available(Level::Base) => run,
        (0..32, ..) => compiled::base::run::<K>,
        (32, ..) => Self::IN_AVX2,
        _ => Self::IN_AVX512,
    };
    /// Whether that is always so, and nothing is to be asked: also of unoptimised programs, where
    /// nobody else would find out.
    const FALLBACK_ONLY: bool = Self::AVX2_ENTRY.is_none() && Self::AVX512_ENTRY.is_none();
}

/// Runs a kernel as this machine does it best.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    // One of those that follow takes it, and nobody after that.
    let mut kernel = ManuallyDrop::new(kernel);
    if const { EntryPoints::<K>::FALLBACK_ONLY } {
        // SAFETY: as at the end.
        return unsafe { EntryPoints::<K>::FALLBACK(&mut kernel) };
    }
    if let Some(run) = EntryPoints::<K>::AVX512_ENTRY
        && level() == Level::Avx512
    {
        // SAFETY: `level` says what the machine has.
        return unsafe { run(&mut kernel) };
    }
    if let Some(run) = EntryPoints::<K>::AVX2_ENTRY
        && level() >= Level::Avx2
    {
        // SAFETY: as above.
        return unsafe { run(&mut kernel) };
    }
    // SAFETY: the other condition of calling a function with target features is that the machine
    // has them. Single numbers need none here. Numbers are `Real`, registers, or made of such, and
    // no type of a user's can be any of these (`Lanes` is sealed). So what is aligned more is made
    // of registers of AVX2 or AVX-512, with which drivers compute only after detection; see the
    // head of `lanes`.
    unsafe { EntryPoints::<K>::FALLBACK(&mut kernel) }
}

/// Runs a kernel as this machine does it best: every 64-bit Arm multiplies and adds in one
/// instruction.
#[cfg(target_arch = "aarch64")]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    if const { K::WIDE } { kernel.run::<Fused<false, false>>() } else { kernel.run::<Fused<false, true>>() }
}

/// Runs a kernel in the way that every machine has.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Unfused>()
}
