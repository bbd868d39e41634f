//! Products in registers of any width are bitwise equal to those of single numbers.

#[cfg(target_arch = "x86_64")]
use super::{super::*, inside};
use crate::scalar::{Known, Real};
use core::array::from_fn;

/// Pseudo-random numbers of both signs and several magnitudes.
fn random_number<T: Real>(seed: &mut u64) -> T {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let fraction = (*seed >> 33) as f64 / (1u64 << 31) as f64 - 0.5;
    T::from_f64(fraction * [1e-3, 1.0, 30.0][(*seed >> 20) as usize % 3])
}

/// `target − left right` and `target = left` for blocks in column-major order, columns, rows, and
/// element by element.
fn blocks<T: Real, const S: usize, const WIDE: bool>() {
    let seed = &mut (S as u64);
    let [target, left, right]: [[[T; S]; S]; 3] = from_fn(|_| from_fn(|_| from_fn(|_| random_number(seed))));
    let subtract = |t: T, a: T, b: T| t.subtract_product(a, b);
    let columns: [[T; S]; S] =
        from_fn(|c| from_fn(|r| (0..S).fold(target[c][r], |t, k| subtract(t, left[k][r], right[c][k]))));

    let mut found = target;
    T::subtract_blocks(&mut found, &left, &right, Known::<WIDE>::assume_detected());
    assert_eq!(found, columns, "blocks of {S}, {WIDE}");
    T::write_block(&mut found, &left, Known::<WIDE>::assume_detected());
    assert_eq!(found, left, "a block of {S}");
    for (c, column) in columns.iter().enumerate() {
        let mut found = target[c];
        T::subtract_columns(&mut found, &left, &right[c], Known::<WIDE>::assume_detected());
        assert_eq!(found, *column, "columns of {S}, {WIDE}");

        let mut found = target[c];
        T::subtract_row(&mut found, left[c][0], &right[c], Known::<WIDE>::assume_detected());
        assert_eq!(found, from_fn(|k| subtract(target[c][k], left[c][0], right[c][k])), "rows of {S}");

        let mut found = target[c];
        T::subtract_products(&mut found, &left[c], &right[c], Known::<WIDE>::assume_detected());
        assert_eq!(found, from_fn(|k| subtract(target[c][k], left[c][k], right[c][k])), "products of {S}");
    }
    let (mut found, m) = (target[0], S / 2);
    let (target, a, b) = (target[0], left[0], right[0]);
    T::subtract_complex(&mut found, &a, &b, Known::<WIDE>::assume_detected());
    for l in 0..m {
        let im = m + l;
        assert_eq!(
            found[l],
            subtract(subtract(target[l], a[l], b[l]), -a[im], b[im]),
            "real parts of {S}, {WIDE}"
        );
        assert_eq!(
            found[im],
            subtract(subtract(target[im], a[l], b[im]), a[im], b[l]),
            "imaginary parts of {S}, {WIDE}"
        );
    }
    if S % 2 == 1 {
        assert_eq!(found[S - 1], subtract(target[S - 1], a[S - 1], b[S - 1]), "the real one of {S}, {WIDE}");
    }
}

fn all<T: Real, const WIDE: bool>() {
    macro_rules! sizes {
        ($($size:literal)*) => { $( blocks::<T, $size, WIDE>(); )* };
    }
    sizes!(1 2 3 4 5 6 7 8 12 16);
}

#[test]
fn products_of_blocks() {
    #[cfg(target_arch = "x86_64")]
    if is_detected(Level::Avx2) {
        inside::<F64x4<4>>(all::<f64, false>);
        inside::<F64x4<4>>(all::<f32, false>);
    }
    #[cfg(target_arch = "x86_64")]
    if is_detected(Level::Avx512) {
        inside::<F64x8<8>>(all::<f64, true>);
        inside::<F64x8<8>>(all::<f32, true>);
    }
    #[cfg(target_arch = "aarch64")]
    {
        all::<f64, false>();
        all::<f32, false>();
    }
}
