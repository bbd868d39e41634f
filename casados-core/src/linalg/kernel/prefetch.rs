//! Prefetching of memory that will be written.
#![allow(unsafe_code)]

/// Memory that may be in no cache, prefetched line by line.
pub struct Prefetch<'a, T>(pub &'a [T]);

impl<T> Prefetch<'_, T> {
    /// Prefetches the next line; does nothing for SIMD registers.
    #[inline(always)]
    pub fn prefetch_line(&mut self) {
        if const { size_of::<T>() <= 8 }
            && let Some((line, rest)) = self.0.split_at_checked(const { 64 / size_of::<T>() })
        {
            #[cfg(all(target_arch = "x86_64", not(miri)))]
            {
                use core::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
                // SAFETY: the instruction has no observable effect, for any address.
                unsafe { _mm_prefetch::<_MM_HINT_T1>(line.as_ptr().cast()) };
            }
            #[cfg(not(all(target_arch = "x86_64", not(miri))))]
            let _ = line;
            self.0 = rest;
        }
    }
}
