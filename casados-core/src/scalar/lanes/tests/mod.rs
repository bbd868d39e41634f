//! Registers against single numbers, lane by lane, for all kinds of registers of the machine.

mod elementary;
mod products;
mod reference;

use super::*;
use crate::scalar::{Lanes, Piece, Scalar, Strided};
use std::vec::Vec;

/// Special numbers and their neighbours.
fn specials() -> Vec<f64> {
    let mut values = std::vec![0.0, f64::INFINITY, f64::NAN];
    for magnitude in
        [f64::MIN_POSITIVE, 5e-324, 1e-310, 1e-300, 1e-30, 1e-8, 0.1, 0.5, 1.0, 1.5, 3.0, 710.0, 1e8]
            .into_iter()
            .chain([1e16, 1e100, 1e300, f64::MAX])
    {
        values.extend([magnitude, magnitude * (1.0 - 0.5 * f64::EPSILON), magnitude * (1.0 + f64::EPSILON)]);
    }
    values.iter().flat_map(|&value| [value, -value]).collect()
}

/// Runs a closure with the instructions of `L` enabled.
struct Inside<F>(F);
impl<F: FnMut()> Piece for Inside<F> {
    #[inline(always)]
    fn run(mut self) {
        (self.0)();
    }
}
fn inside<L: Scalar>(f: impl FnMut()) {
    L::vectorize(Inside(f));
}

/// Whether the bits are equal, or both are NaN.
fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

/// A cell whose lanes are `values[start], values[start + stride], ..`
fn cell<L: Lanes>(values: &[f64], start: usize, stride: usize) -> L::Cell {
    let mut cell = <L::Cell as bytemuck::Zeroable>::zeroed();
    for lane in 0..L::LANES {
        L::set_lane(&mut cell, lane, values[(start + stride * lane) % values.len()]);
    }
    cell
}

/// Arithmetic of registers is bitwise equal to arithmetic of `S`, one lane.
fn arithmetic<L: Lanes, S: Lanes<Mask = bool>>() {
    let values = specials();
    inside::<L>(|| {
        for i in 0..values.len() {
            for j in (i % 5..values.len()).step_by(5) {
                let (a_cell, b_cell) = (cell::<L>(&values, i, 1), cell::<L>(&values, j, 3));
                let (a, b) = (L::load(&a_cell), L::load(&b_cell));
                let less = [a.lt(b), a.le(b), a.eq(b), a.is_smaller(b), a.is_finite()];
                let masks = [less[0], less[1], less[2], less[3], less[4], L::and(less[0], less[3])];
                let masks = masks.into_iter().chain([L::or(less[0], less[2]), L::not(less[0])]);
                let results = [a + b, a - b, a * b, a / b, -a, a.abs(), a.signum(), a.sqrt(), a.max(b)]
                    .into_iter()
                    .chain([a.powi(3), a.powi(-2), a.powi(0), L::from_f64(0.1)])
                    .chain(masks.clone().map(|mask| L::select(mask, a, b)));
                let mut seen = std::vec![std::vec![]; L::LANES];
                for result in results {
                    let mut out = a_cell;
                    result.store(&mut out);
                    (0..L::LANES).for_each(|lane| seen[lane].push(L::lane(&out, lane)));
                }
                let mut truth = std::vec![[false; 8]; L::LANES];
                for lane in 0..L::LANES {
                    let single = |cell| {
                        let mut one = <S::Cell as bytemuck::Zeroable>::zeroed();
                        S::set_lane(&mut one, 0, L::lane(cell, lane));
                        S::load(&one)
                    };
                    let (a, b) = (single(&a_cell), single(&b_cell));
                    let less = [a.lt(b), a.le(b), a.eq(b), a.is_smaller(b), a.is_finite()];
                    let masks = [less[0], less[1], less[2], less[3], less[4], less[0] & less[3]];
                    let masks = masks.into_iter().chain([less[0] | less[2], !less[0]]);
                    let results = [a + b, a - b, a * b, a / b, -a, a.abs(), a.signum(), a.sqrt(), a.max(b)]
                        .into_iter()
                        .chain([a.powi(3), a.powi(-2), a.powi(0), S::from_f64(0.1)])
                        .chain(masks.clone().map(|mask| S::select(mask, a, b)));
                    masks.enumerate().for_each(|(index, mask)| truth[lane][index] = mask);
                    for (index, result) in results.enumerate() {
                        let mut one = <S::Cell as bytemuck::Zeroable>::zeroed();
                        result.store(&mut one);
                        let expected = S::lane(&one, 0);
                        assert!(
                            same(seen[lane][index], expected),
                            "operation {index} of {a:?} and {b:?}: {:e}, not {expected:e}",
                            seen[lane][index]
                        );
                    }
                }
                for (index, mask) in masks.enumerate() {
                    assert_eq!(
                        L::any(mask),
                        truth.iter().any(|lane| lane[index]),
                        "any {index} of {a:?}, {b:?}"
                    );
                    assert_eq!(
                        L::all(mask),
                        truth.iter().all(|lane| lane[index]),
                        "all {index} of {a:?}, {b:?}"
                    );
                }
                let twin = L::load(&a_cell);
                assert_eq!(a == twin, (0..L::LANES).all(|lane| !L::lane(&a_cell, lane).is_nan()));
            }
        }
    });
}

/// `c − a b`, rounded once if the machine supports it.
fn check_fused_products<L: Lanes>(fused: bool) {
    inside::<L>(|| {
        let a = 1.0 + f64::EPSILON;
        let product = L::from_f64(1.0).subtract_product(L::from_f64(a), L::from_f64(1.0 - f64::EPSILON));
        let expected = if fused { f64::EPSILON * f64::EPSILON } else { 0.0 };
        let mut out = cell::<L>(&[0.0], 0, 1);
        product.store(&mut out);
        assert_eq!(L::lane(&out, L::LANES - 1), expected);
    });
}

/// Quotients by constants are bitwise equal to divisions, however they are computed.
fn quotients<L: Lanes>() {
    // `c`, and `1/c` as the sum that the macro has verified.
    let constants = [
        (3.0, [0.3333333333333333, 1.850371707708594e-17]),
        (-100.0, [-0.009999999999999998, -1.5265566588595903e-18]),
        (288.15, [0.0034704147145583897, 3.22005492639098e-19]),
    ];
    let mut values = specials();
    values.extend((1..2000).map(|k| f64::from(k).powi(5).sin() * 1e3));
    inside::<L>(|| {
        for (c, reciprocal) in constants {
            for start in (0..values.len()).step_by(L::LANES) {
                let cell = cell::<L>(&values, start, 1);
                let (mut found, mut expected) = (cell, cell);
                L::load(&cell).over(c, reciprocal).store(&mut found);
                (L::load(&cell) / L::from_f64(c)).store(&mut expected);
                for lane in 0..L::LANES {
                    let [a, found, expected] = [&cell, &found, &expected].map(|cell| L::lane(cell, lane));
                    // Where `h x` or `l x` is subnormal, digits are lost.
                    let tiny = a.abs() < 1e-290 && (found - expected).abs() <= 5e-324;
                    assert!(same(found, expected) || tiny, "{a:e} / {c}: {found:e}, not {expected:e}");
                }
            }
        }
    });
}

/// Demotion keeps the numbers, with fewer digits or with all.
fn demote<L: Lanes>() {
    let values = specials();
    inside::<L>(|| {
        for start in 0..values.len() {
            let cell = cell::<L>(&values, start, 1);
            let mut found = cell;
            L::promote(L::load(&cell).demote()).store(&mut found);
            for lane in 0..L::LANES {
                let [a, found] = [&cell, &found].map(|cell| L::lane(cell, lane));
                let halved = size_of::<L::Demoted>() < size_of::<L>();
                let expected = if halved { f64::from(a as f32) } else { a };
                assert!(same(found, expected), "{a:e}: {found:e}, not {expected:e}");
            }
        }
    });
}

/// Transposition keeps the numbers, for any number of registers.
fn transposed<L: Lanes>() {
    inside::<L>(|| {
        let number = |register: usize, lane: usize| (10 * register + lane) as f64;
        let rows: Vec<L> = (0..L::LANES)
            .map(|register| {
                let mut row = cell::<L>(&[0.0], 0, 1);
                (0..L::LANES).for_each(|lane| L::set_lane(&mut row, lane, number(register, lane)));
                L::load(&row)
            })
            .collect();
        for count in 0..=L::LANES {
            let mut columns = std::vec![cell::<L>(&[0.0], 0, 1); L::LANES];
            L::transpose(&rows[..count], &mut columns);
            for (lane, column) in columns.iter().enumerate() {
                for register in 0..count {
                    assert_eq!(
                        L::lane(column, register),
                        number(register, lane),
                        "{register} of {count}, lane {lane}"
                    );
                }
            }
        }
    });
}

/// Tests each kind of register of the machine, with the listed numbers of lanes.
macro_rules! on_every_register {
    ($check:ident) => {
        if is_detected(Level::Base) {
            $check!(F64x2, f64, 1, 2);
            $check!(F32x4, f32, 1, 2, 3, 4);
        }
        #[cfg(target_arch = "x86_64")]
        if is_detected(Level::Avx2) {
            $check!(F64x4, f64, 1, 2, 3, 4);
            $check!(F32x8, f32, 1, 3, 5, 8);
        }
        #[cfg(target_arch = "x86_64")]
        if is_detected(Level::Avx512) {
            $check!(F64x8, f64, 1, 3, 5, 6, 7, 8);
            $check!(F32x16, f32, 1, 7, 9, 16);
        }
    };
}

use on_every_register;

#[test]
fn arithmetic_has_the_bits_of_single_numbers() {
    macro_rules! check {
        ($name:ident, $single:ident, $($lanes:literal),*) => { $( arithmetic::<$name<$lanes>, $single>(); )* };
    }
    on_every_register!(check);
}

#[test]
fn products_are_subtracted_with_one_rounding_where_the_machine_can() {
    check_fused_products::<F64x2<2>>(cfg!(target_arch = "aarch64"));
    #[cfg(target_arch = "x86_64")]
    if is_detected(Level::Avx2) {
        check_fused_products::<F64x4<3>>(true);
    }
    #[cfg(target_arch = "x86_64")]
    if is_detected(Level::Avx512) {
        check_fused_products::<F64x8<5>>(true);
    }
}

#[test]
fn the_level_is_one_that_the_machine_has_and_the_limit_allows() {
    let widest = level();
    assert!(is_detected(widest) && widest >= Level::Base);
    for lower in [Level::Base, Level::Single] {
        limit_level(lower);
        assert_eq!(level(), lower);
    }
    limit_level(Level::Avx512);
    assert_eq!(level(), widest);
}

#[test]
fn transposition() {
    macro_rules! check {
        ($name:ident, $element:ident, $($n:literal),*) => { $(transposed::<$name<$n>>();)* };
    }
    on_every_register!(check);
    transposed::<f64>();
    transposed::<f32>();
}

#[test]
fn quotients_by_constants() {
    macro_rules! check {
        ($name:ident, f32, $($n:literal),*) => {};
        ($name:ident, $element:ident, $($n:literal),*) => {$(quotients::<$name<$n>>();)*};
    }
    on_every_register!(check);
    quotients::<f64>();
    quotients::<Strided<f64, 3>>();
}

#[test]
fn demoted_numbers() {
    macro_rules! check {
        ($name:ident, $element:ident, $($n:literal),*) => { $(demote::<$name<$n>>();)* };
    }
    on_every_register!(check);
    demote::<f64>();
    demote::<Strided<f64, 3>>();
}
