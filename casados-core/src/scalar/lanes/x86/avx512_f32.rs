//! Sixteen `f32`.

pub use super::avx512_f64 as doubles;
use super::*;
pub type Register = __m512;
pub type Mask = __mmask16;

enter!("avx512f,avx512dq,avx512vl");
halves!(f32, avx2_f32, _mm512_castps512_ps256, _mm512_extractf32x8_ps);
masked!(f32, 16, u16, _mm512_mask_loadu_ps, _mm512_mask_storeu_ps, _mm512_mask_blend_ps);
transpose_in_memory!(f32);
wrap! {
    splat(a: f32) -> Register = _mm512_set1_ps;
    add(a: Register, b: Register) -> Register = _mm512_add_ps;
    sub(a: Register, b: Register) -> Register = _mm512_sub_ps;
    mul(a: Register, b: Register) -> Register = _mm512_mul_ps;
    div(a: Register, b: Register) -> Register = _mm512_div_ps;
    sqrt(a: Register) -> Register = _mm512_sqrt_ps;
    max(a: Register, b: Register) -> Register = _mm512_max_ps;
    and(a: Register, b: Register) -> Register = _mm512_and_ps;
    or(a: Register, b: Register) -> Register = _mm512_or_ps;
    xor(a: Register, b: Register) -> Register = _mm512_xor_ps;
    lt(a: Register, b: Register) -> Mask = _mm512_cmp_ps_mask::<_CMP_LT_OQ>;
    le(a: Register, b: Register) -> Mask = _mm512_cmp_ps_mask::<_CMP_LE_OQ>;
    eq(a: Register, b: Register) -> Mask = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>;
}
define! {
    swap_halves(a: Register) -> Register { _mm512_shuffle_f32x4::<0x4e>(a, a) }
    signs_below() -> Register {
        _mm512_setr_ps(
            -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, -0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        )
    }
    repeat_four(a: &[f32; 4]) -> Register { _mm512_broadcast_f32x4(_mm_loadu_ps(a.as_ptr())) }
    each_of_four(a: Register) -> [Register; 4] {
        [
            _mm512_permute_ps::<0x00>(a),
            _mm512_permute_ps::<0x55>(a),
            _mm512_permute_ps::<0xaa>(a),
            _mm512_permute_ps::<0xff>(a),
        ]
    }
    subtract_product(c: Register, a: Register, b: Register) -> Register { _mm512_fnmadd_ps(a, b, c) }
    widen(a: Register) -> [__m512d; 2] {
        [_mm512_cvtps_pd(_mm512_castps512_ps256(a)), _mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(a))]
    }
    narrow(a: [__m512d; 2]) -> Register {
        _mm512_insertf32x8::<1>(_mm512_castps256_ps512(_mm512_cvtpd_ps(a[0])), _mm512_cvtpd_ps(a[1]))
    }
}
