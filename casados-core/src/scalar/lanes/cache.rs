//! The size of the second-level cache, which limits the number of intervals computed together.

#[cfg(target_arch = "x86_64")]
use core::sync::atomic::{AtomicUsize, Ordering};

/// Assumed size for machines that do not report it, in bytes.
const DEFAULT_CACHE_SIZE: usize = 1 << 19;

/// The size reported by the processor, cached because the query is slow, above all in a virtual
/// machine. Zero until the first query.
#[cfg(target_arch = "x86_64")]
static CACHE_SIZE: AtomicUsize = AtomicUsize::new(0);

/// For tests: overrides the size of the second-level cache in bytes, on architectures that report
/// it; zero restores the reported size.
#[doc(hidden)]
#[cfg(feature = "testing")]
pub fn limit_cache(bytes: usize) {
    #[cfg(target_arch = "x86_64")]
    CACHE_SIZE.store(bytes, Ordering::Relaxed);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = bytes;
}

/// The size of the second-level cache in bytes.
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

/// The size of the second-level cache in bytes.
#[cfg(not(target_arch = "x86_64"))]
pub fn second_level_cache() -> usize {
    DEFAULT_CACHE_SIZE
}

/// The size reported by the processor, in kilobytes in the upper half of a register: AMD64
/// Architecture Programmer's Manual 3, Intel 64 Software Developer's Manual 2A, both under CPUID,
/// function 8000_0006h.
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, unused_unsafe)]
fn cache_size_from_cpuid() -> Option<usize> {
    use core::arch::x86_64::__cpuid;
    const FUNCTION: u32 = 0x8000_0006;
    // SAFETY: every processor of this architecture has the instruction, and unsupported functions
    // are not queried.
    let kilobytes = unsafe {
        if __cpuid(0x8000_0000).eax < FUNCTION {
            return None;
        }
        __cpuid(FUNCTION).ecx >> 16
    };
    (kilobytes > 0).then_some(kilobytes as usize * 1024)
}
