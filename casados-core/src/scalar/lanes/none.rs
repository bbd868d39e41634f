//! Machines without SIMD registers: single numbers.

/// Whether there are registers of several numbers.
pub const REGISTERS: bool = false;

macro_rules! no_registers {
    ($($register:tt)*) => {};
}
pub(crate) use {
    no_registers as packed_registers, no_registers as side_by_side, no_registers as widest_register,
};
