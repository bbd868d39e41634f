//! A number as a register of one, for machines without registers.

use super::DoubleRegister;

impl DoubleRegister for f64 {
    const FUSED: bool = false;

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn and_bits(self, other: Self) -> Self {
        Self::from_bits(self.to_bits() & other.to_bits())
    }
    #[inline(always)]
    fn or_bits(self, other: Self) -> Self {
        Self::from_bits(self.to_bits() | other.to_bits())
    }
    #[inline(always)]
    fn xor_bits(self, other: Self) -> Self {
        Self::from_bits(self.to_bits() ^ other.to_bits())
    }
    #[inline(always)]
    fn add_bits(self, other: Self) -> Self {
        Self::from_bits(self.to_bits().wrapping_add(other.to_bits()))
    }
    #[inline(always)]
    fn shift_left<const BITS: i32>(self) -> Self {
        Self::from_bits(self.to_bits() << BITS)
    }
    #[inline(always)]
    fn shift_right<const BITS: i32>(self) -> Self {
        Self::from_bits(self.to_bits() >> BITS)
    }
    #[inline(always)]
    fn bits_of(mask: bool) -> u32 {
        u32::from(mask)
    }
}
