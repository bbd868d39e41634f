//! Products of numbers side by side have the bits that one number after the other gives, in
//! registers of any width.

#[cfg(target_arch = "x86_64")]
use super::{super::*, inside};
use crate::scalar::{Known, Real};
use core::array::from_fn;
use std::vec::Vec;

/// Numbers of all signs and several magnitudes, the same ones every time.
fn number<T: Real>(seed: &mut u64) -> T {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    let fraction = (*seed >> 33) as f64 / (1u64 << 31) as f64 - 0.5;
    T::from_f64(fraction * [1e-3, 1.0, 30.0][(*seed >> 20) as usize % 3])
}

/// `target − left right` of blocks that lie column after column, one number after the other. Of a
/// row it is `target − left · right`.
#[inline(never)]
fn subtracted<T: Real>(target: &[T], left: &[T], right: &[T], size: usize) -> Vec<T> {
    let mut expected = target.to_vec();
    for (column, right) in expected.chunks_exact_mut(size).zip(right.chunks_exact(left.len() / size)) {
        for (left, &b) in left.chunks_exact(size).zip(right) {
            for (to, &a) in column.iter_mut().zip(left) {
                *to = to.subtract_product(a, b);
            }
        }
    }
    expected
}

/// `target − a b`, element by element.
#[inline(never)]
fn subtracted_products<T: Real>(target: &[T], a: &[T], b: &[T]) -> Vec<T> {
    target.iter().zip(a).zip(b).map(|((t, &a), &b)| t.subtract_product(a, b)).collect()
}

/// `target − a b` of complex numbers, real parts before imaginary parts, and of a real one behind.
#[inline(never)]
fn subtracted_complex<T: Real>(target: &[T], a: &[T], b: &[T]) -> Vec<T> {
    let m = target.len() / 2;
    let mut expected = subtracted_products(target, a, b);
    for (re, im) in (0..m).zip(m..2 * m) {
        expected[re] = expected[re].subtract_product(-a[im], b[im]);
        expected[im] = target[im].subtract_product(a[re], b[im]).subtract_product(a[im], b[re]);
    }
    expected
}

/// Of functions on `size` numbers.
#[inline(never)]
fn same<T: Real>(found: &[T], expected: &[T], what: &str, size: usize) {
    assert_eq!(found, expected, "{what} of {size}");
}

/// `target − left right` and `target = left`, of blocks that lie column after column, of columns,
/// of rows, element by element.
fn blocks<T: Real, const S: usize, const WIDE: bool>() {
    let seed = &mut (S as u64);
    let [target, left, right]: [[[T; S]; S]; 3] = from_fn(|_| from_fn(|_| from_fn(|_| number(seed))));

    let mut found = target;
    T::subtract_blocks(&mut found, &left, &right, Known::<WIDE>::here());
    let expected = subtracted(target.as_flattened(), left.as_flattened(), right.as_flattened(), S);
    same(found.as_flattened(), &expected, "blocks", S);
    T::write_block(&mut found, &left, Known::<WIDE>::here());
    same(found.as_flattened(), left.as_flattened(), "a written block", S);
    for (target, right) in target.iter().zip(&right) {
        let mut found = *target;
        T::subtract_columns(&mut found, &left, right, Known::<WIDE>::here());
        same(&found, &subtracted(target, left.as_flattened(), right, S), "columns", S);

        let mut found = *target;
        T::subtract_row(&mut found, left[0][0], right, Known::<WIDE>::here());
        same(&found, &subtracted(target, right, &[left[0][0]], S), "rows", S);

        let mut found = *target;
        T::subtract_products(&mut found, &left[0], right, Known::<WIDE>::here());
        same(&found, &subtracted_products(target, &left[0], right), "products", S);
    }
    let mut found = target[0];
    T::subtract_complex(&mut found, &left[0], &right[0], Known::<WIDE>::here());
    same(&found, &subtracted_complex(&target[0], &left[0], &right[0]), "complex numbers", S);
}

fn all<T: Real, const WIDE: bool>() {
    macro_rules! sizes {
        ($($size:literal)*) => { $( blocks::<T, $size, WIDE>(); )* };
    }
    sizes!(1 2 3 4 5 6 7 8 12 16);
}

#[test]
fn they_are() {
    #[cfg(target_arch = "x86_64")]
    if is_there(Level::Avx2) {
        inside::<F64x4<4>>(all::<f64, false>);
        inside::<F64x4<4>>(all::<f32, false>);
    }
    #[cfg(target_arch = "x86_64")]
    if is_there(Level::Avx512) {
        inside::<F64x8<8>>(all::<f64, true>);
        inside::<F64x8<8>>(all::<f32, true>);
    }
    #[cfg(target_arch = "aarch64")]
    {
        all::<f64, false>();
        all::<f32, false>();
    }
}
