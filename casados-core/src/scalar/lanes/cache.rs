//! The size of the second-level cache: how much may lie in it decides how many intervals are
//! computed side by side.

#[cfg(target_arch = "x86_64")]
use core::sync::atomic::{AtomicUsize, Ordering};

/// What machines have that do not tell: half a megabyte or more.
const DEFAULT_CACHE_SIZE: usize = 1 << 19;

/// What the processor said: asking takes long, above all in a virtual machine. Zero until somebody
/// does.
#[cfg(target_arch = "x86_64")]
static CACHE_SIZE: AtomicUsize = AtomicUsize::new(0);

/// For tests: from now on the second-level cache has so many bytes, if machines of this kind are
/// asked for it; zero stands for what the machine says.
#[doc(hidden)]
#[cfg(feature = "testing")]
pub fn limit_cache(bytes: usize) {
    #[cfg(target_arch = "x86_64")]
    CACHE_SIZE.store(bytes, Ordering::Relaxed);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = bytes;
}

/// Bytes of the second-level cache.
#[cfg(target_arch = "x86_64")]
pub fn second_level_cache() -> usize {
    match CACHE_SIZE.load(Ordering::Relaxed) {
        0 => {
            let bytes = if cfg!(miri) {
                DEFAULT_CACHE_SIZE
            } else {
                cache_size_from_cpuid().unwrap_or(DEFAULT_CACHE_SIZE)
            };
            CACHE_SIZE.store(bytes, Ordering::Relaxed);
            bytes
        }
        bytes => bytes,
    }
}

/// Bytes of the second-level cache.
#[cfg(not(target_arch = "x86_64"))]
pub fn second_level_cache() -> usize {
    DEFAULT_CACHE_SIZE
}

/// What the processor says, in kilobytes in the upper half of a register: AMD64 Architecture
/// Programmer's Manual 3, Intel 64 Software Developer's Manual 2A, both under CPUID, function
/// 8000_0006h.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, unused_unsafe)]
fn cache_size_from_cpuid() -> Option<usize> {
    use core::arch::x86_64::__cpuid;
    const FUNCTION: u32 = 0x8000_0006;
    // SAFETY: every processor of this architecture has the instruction, and functions that it does
    // not know are not asked for.
    let kilobytes = unsafe {
        if __cpuid(0x8000_0000).eax < FUNCTION {
            return None;
        }
        __cpuid(FUNCTION).ecx >> 16
    };
    (kilobytes > 0).then_some(kilobytes as usize * 1024)
}
