//! Kernels compiled twice: for every machine, and for those that multiply and add in one instruction.
//!
//! A plain x86-64 binary must run on machines without AVX2 and FMA. So a kernel is generic over its [`Arithmetic`],
//! everything in it is inlined, and [`dispatch`] enters it through a function that is compiled for the better
//! machine if this is one. Results differ by rounding only.

use crate::scalar::Field;

/// How `t − a b` is computed.
pub trait Arithmetic {
    /// `t − a b`
    fn subtract<E: Field>(t: E, a: E, b: E) -> E;
}

/// Rounded twice.
pub struct Separate;

impl Arithmetic for Separate {
    #[inline(always)]
    fn subtract<E: Field>(t: E, a: E, b: E) -> E {
        t - a * b
    }
}

/// Rounded once, in one instruction.
#[cfg(all(feature = "std", any(target_arch = "x86_64", target_arch = "aarch64")))]
pub struct Fused;

#[cfg(all(feature = "std", any(target_arch = "x86_64", target_arch = "aarch64")))]
impl Arithmetic for Fused {
    #[inline(always)]
    fn subtract<E: Field>(t: E, a: E, b: E) -> E {
        t.subtract_product(a, b)
    }
}

/// A computation that is worth being compiled for the machine it runs on.
pub trait Kernel {
    /// Its result.
    type Output;
    /// To be `#[inline(always)]`, with everything that it calls.
    fn run<A: Arithmetic>(self) -> Self::Output;
}

/// Runs a kernel as this machine does it best.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
#[allow(unsafe_code)]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    #[target_feature(enable = "avx2,fma")]
    fn fused<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Fused>()
    }
    if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") {
        // SAFETY: the one condition of calling a function with target features is that the machine has
        // them, which the line above has found out.
        return unsafe { fused(kernel) };
    }
    kernel.run::<Separate>()
}

/// Runs a kernel as this machine does it best: every 64-bit Arm multiplies and adds in one instruction.
#[cfg(all(feature = "std", target_arch = "aarch64"))]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Fused>()
}

/// Runs a kernel in the way that every machine has.
#[cfg(not(all(feature = "std", any(target_arch = "x86_64", target_arch = "aarch64"))))]
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Separate>()
}
