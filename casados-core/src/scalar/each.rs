//! Loops over indices.

/// A loop over indices from zero on, for kernels: iterators over arrays would be inlined into each
/// kernel and simplified there again, which takes long to compile. `continue` in its body goes
/// round for ever.
macro_rules! each {
    ($index:ident < $count:expr => $body:block) => {{
        let mut $index = 0;
        while $index < $count {
            $body
            $index += 1;
        }
    }};
}
pub(crate) use each;
