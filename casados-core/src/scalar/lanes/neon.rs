//! The registers of 64-bit Arm.
#![allow(unsafe_code)]

use super::functions::Call;
use super::shared::{define, through_memory};
use core::arch::aarch64::*;

// SAFETY of every `unsafe` of this file: these intrinsics require only that the machine has the
// instructions, and NEON is enabled at compile time (otherwise, on targets without `std`,
// `is_detected` returns false). Loads and stores, which take pointers, get arrays as large as the
// register, and require no alignment.

/// Two `f64`.
pub mod neon_f64 {
    use super::*;
    pub type Register = float64x2_t;
    pub type Mask = uint64x2_t;
    pub const FUSED: bool = true;

    through_memory!(f64, 2, |from| vld1q_f64(from), |to, a| vst1q_f64(to, a));
    define! {
        total(a: Register) -> f64 { vaddvq_f64(a) }
        largest(a: Register) -> f64 { vmaxvq_f64(a) }
        splat(a: f64) -> Register { vdupq_n_f64(a) }
        add(a: Register, b: Register) -> Register { vaddq_f64(a, b) }
        sub(a: Register, b: Register) -> Register { vsubq_f64(a, b) }
        mul(a: Register, b: Register) -> Register { vmulq_f64(a, b) }
        div(a: Register, b: Register) -> Register { vdivq_f64(a, b) }
        sqrt(a: Register) -> Register { vsqrtq_f64(a) }
        max(a: Register, b: Register) -> Register { vbslq_f64(vcgtq_f64(a, b), a, b) }
        and(a: Register, b: Register) -> Register {
            vreinterpretq_f64_u64(vandq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)))
        }
        or(a: Register, b: Register) -> Register {
            vreinterpretq_f64_u64(vorrq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)))
        }
        xor(a: Register, b: Register) -> Register {
            vreinterpretq_f64_u64(veorq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)))
        }
        mul_add(a: Register, b: Register, c: Register) -> Register { vfmaq_f64(c, a, b) }
        subtract_product(c: Register, a: Register, b: Register) -> Register { vfmsq_f64(c, a, b) }
        lt(a: Register, b: Register) -> Mask { vcltq_f64(a, b) }
        le(a: Register, b: Register) -> Mask { vcleq_f64(a, b) }
        eq(a: Register, b: Register) -> Mask { vceqq_f64(a, b) }
        mask_and(a: Mask, b: Mask) -> Mask { vandq_u64(a, b) }
        mask_or(a: Mask, b: Mask) -> Mask { vorrq_u64(a, b) }
        mask_not(a: Mask) -> Mask { veorq_u64(a, vdupq_n_u64(u64::MAX)) }
        select(m: Mask, a: Register, b: Register) -> Register { vbslq_f64(m, a, b) }
        bits(m: Mask) -> u32 { (vgetq_lane_u64::<0>(m) & 1 | vgetq_lane_u64::<1>(m) & 2) as u32 }
        add_bits(a: Register, b: Register) -> Register {
            vreinterpretq_f64_u64(vaddq_u64(vreinterpretq_u64_f64(a), vreinterpretq_u64_f64(b)))
        }
        shift_left<BITS>(a: Register) -> Register {
            vreinterpretq_f64_u64(vshlq_n_u64::<BITS>(vreinterpretq_u64_f64(a)))
        }
        shift_right<BITS>(a: Register) -> Register {
            vreinterpretq_f64_u64(vshrq_n_u64::<BITS>(vreinterpretq_u64_f64(a)))
        }
    }
}

/// Four `f32`.
pub mod neon_f32 {
    pub use super::neon_f64 as doubles;
    use super::*;
    pub type Register = float32x4_t;
    pub type Mask = uint32x4_t;

    through_memory!(f32, 4, |from| vld1q_f32(from), |to, a| vst1q_f32(to, a));
    define! {
        total(a: Register) -> f32 { vaddvq_f32(a) }
        largest(a: Register) -> f32 { vmaxvq_f32(a) }
        splat(a: f32) -> Register { vdupq_n_f32(a) }
        add(a: Register, b: Register) -> Register { vaddq_f32(a, b) }
        sub(a: Register, b: Register) -> Register { vsubq_f32(a, b) }
        mul(a: Register, b: Register) -> Register { vmulq_f32(a, b) }
        div(a: Register, b: Register) -> Register { vdivq_f32(a, b) }
        sqrt(a: Register) -> Register { vsqrtq_f32(a) }
        max(a: Register, b: Register) -> Register { vbslq_f32(vcgtq_f32(a, b), a, b) }
        and(a: Register, b: Register) -> Register {
            vreinterpretq_f32_u32(vandq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)))
        }
        or(a: Register, b: Register) -> Register {
            vreinterpretq_f32_u32(vorrq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)))
        }
        xor(a: Register, b: Register) -> Register {
            vreinterpretq_f32_u32(veorq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b)))
        }
        subtract_product(c: Register, a: Register, b: Register) -> Register { vfmsq_f32(c, a, b) }
        lt(a: Register, b: Register) -> Mask { vcltq_f32(a, b) }
        le(a: Register, b: Register) -> Mask { vcleq_f32(a, b) }
        eq(a: Register, b: Register) -> Mask { vceqq_f32(a, b) }
        mask_and(a: Mask, b: Mask) -> Mask { vandq_u32(a, b) }
        mask_or(a: Mask, b: Mask) -> Mask { vorrq_u32(a, b) }
        mask_not(a: Mask) -> Mask { vmvnq_u32(a) }
        select(m: Mask, a: Register, b: Register) -> Register { vbslq_f32(m, a, b) }
        bits(m: Mask) -> u32 {
            vgetq_lane_u32::<0>(m) & 1
                | vgetq_lane_u32::<1>(m) & 2
                | vgetq_lane_u32::<2>(m) & 4
                | vgetq_lane_u32::<3>(m) & 8
        }
        widen(a: Register) -> [float64x2_t; 2] { [vcvt_f64_f32(vget_low_f32(a)), vcvt_high_f64_f32(a)] }
        narrow(a: [float64x2_t; 2]) -> Register { vcvt_high_f32_f64(vcvt_f32_f64(a[0]), a[1]) }
    }
}
