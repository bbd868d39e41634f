//! Eight `f64`.

use super::*;
pub type Register = __m512d;
pub type Mask = __mmask8;
pub const FUSED: bool = true;

enter!("avx512f,avx512dq,avx512vl");
enter_with_many!("avx512f,avx512dq,avx512vl");
halves!(f64, avx2_f64, _mm512_castpd512_pd256, _mm512_extractf64x4_pd);
masked!(f64, 8, u8, _mm512_mask_loadu_pd, _mm512_mask_storeu_pd, _mm512_mask_blend_pd);
wrap! {
    splat(a: f64) -> Register = _mm512_set1_pd;
    add(a: Register, b: Register) -> Register = _mm512_add_pd;
    sub(a: Register, b: Register) -> Register = _mm512_sub_pd;
    mul(a: Register, b: Register) -> Register = _mm512_mul_pd;
    div(a: Register, b: Register) -> Register = _mm512_div_pd;
    sqrt(a: Register) -> Register = _mm512_sqrt_pd;
    max(a: Register, b: Register) -> Register = _mm512_max_pd;
    and(a: Register, b: Register) -> Register = _mm512_and_pd;
    or(a: Register, b: Register) -> Register = _mm512_or_pd;
    xor(a: Register, b: Register) -> Register = _mm512_xor_pd;
    mul_add(a: Register, b: Register, c: Register) -> Register = _mm512_fmadd_pd;
    lt(a: Register, b: Register) -> Mask = _mm512_cmp_pd_mask::<_CMP_LT_OQ>;
    le(a: Register, b: Register) -> Mask = _mm512_cmp_pd_mask::<_CMP_LE_OQ>;
    eq(a: Register, b: Register) -> Mask = _mm512_cmp_pd_mask::<_CMP_EQ_OQ>;
}
define! {
    transpose(rows: [Register; 8]) -> [Register; 8] {{
        let [a, b, c, d, e, f, g, h] = rows;
        // Pairs of rows; then the even and the odd quarters of two pairs, twice.
        let even = [
            _mm512_unpacklo_pd(a, b), _mm512_unpacklo_pd(c, d), _mm512_unpacklo_pd(e, f), _mm512_unpacklo_pd(g, h),
        ];
        let odd = [
            _mm512_unpackhi_pd(a, b), _mm512_unpackhi_pd(c, d), _mm512_unpackhi_pd(e, f), _mm512_unpackhi_pd(g, h),
        ];
        let [a, c, e, g] = quarters(even);
        let [b, d, f, h] = quarters(odd);
        [a, b, c, d, e, f, g, h]
    }}
    /// All first quarters, all second, third, and fourth ones.
    quarters(rows: [Register; 4]) -> [Register; 4] {{
        let [a, b, c, d] = rows;
        let (even, odd) = (
            [_mm512_shuffle_f64x2::<0x88>(a, b), _mm512_shuffle_f64x2::<0x88>(c, d)],
            [_mm512_shuffle_f64x2::<0xdd>(a, b), _mm512_shuffle_f64x2::<0xdd>(c, d)],
        );
        [
            _mm512_shuffle_f64x2::<0x88>(even[0], even[1]),
            _mm512_shuffle_f64x2::<0x88>(odd[0], odd[1]),
            _mm512_shuffle_f64x2::<0xdd>(even[0], even[1]),
            _mm512_shuffle_f64x2::<0xdd>(odd[0], odd[1]),
        ]
    }}
    join(low: __m256d, high: __m256d) -> Register { _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(low), high) }
    halves(a: Register) -> [__m256d; 2] { [_mm512_castpd512_pd256(a), _mm512_extractf64x4_pd::<1>(a)] }
    demote(a: Register) -> __m256 { _mm512_cvtpd_ps(a) }
    promote(a: __m256) -> Register { _mm512_cvtps_pd(a) }
    swap_halves(a: Register) -> Register { _mm512_shuffle_f64x2::<0x4e>(a, a) }
    signs_below() -> Register { _mm512_setr_pd(-0.0, -0.0, -0.0, -0.0, 0.0, 0.0, 0.0, 0.0) }
    repeat_four(a: &[f64; 4]) -> Register { _mm512_broadcast_f64x4(_mm256_loadu_pd(a.as_ptr())) }
    each_of_four(a: Register) -> [Register; 4] {
        [
            _mm512_permutex_pd::<0x00>(a),
            _mm512_permutex_pd::<0x55>(a),
            _mm512_permutex_pd::<0xaa>(a),
            _mm512_permutex_pd::<0xff>(a),
        ]
    }
    subtract_product(c: Register, a: Register, b: Register) -> Register { _mm512_fnmadd_pd(a, b, c) }
    add_bits(a: Register, b: Register) -> Register {
        _mm512_castsi512_pd(_mm512_add_epi64(_mm512_castpd_si512(a), _mm512_castpd_si512(b)))
    }
    shift_left<BITS>(a: Register) -> Register {
        _mm512_castsi512_pd(_mm512_sll_epi64(_mm512_castpd_si512(a), _mm_cvtsi32_si128(BITS)))
    }
    shift_right<BITS>(a: Register) -> Register {
        _mm512_castsi512_pd(_mm512_srl_epi64(_mm512_castpd_si512(a), _mm_cvtsi32_si128(BITS)))
    }
}
