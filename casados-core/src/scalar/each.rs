//! Loops over indices.

/// A loop over indices from zero on, for kernels: iterators over arrays would be inlined and
/// simplified in each kernel, with long compile times. `continue` in its body loops forever.
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
