//! Memory that will be written, fetched while something else is computed.
#![allow(unsafe_code)]

/// Memory that is far away, whose lines are asked for one after the other.
pub struct Prefetch<'a, T>(pub &'a [T]);

impl<T> Prefetch<'_, T> {
    /// Asks for the next line. Of numbers that are registers themselves nothing is asked for.
    #[inline(always)]
    pub fn prefetch_line(&mut self) {
        if const { size_of::<T>() <= 8 }
            && let Some((line, rest)) = self.0.split_at_checked(const { 64 / size_of::<T>() })
        {
            #[cfg(all(target_arch = "x86_64", not(miri)))]
            {
                use core::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
                // SAFETY: the instruction neither reads nor writes as far as a program can see,
                // whatever its address is.
                unsafe { _mm_prefetch::<_MM_HINT_T1>(line.as_ptr().cast()) };
            }
            #[cfg(not(all(target_arch = "x86_64", not(miri))))]
            let _ = line;
            self.0 = rest;
        }
    }
}
