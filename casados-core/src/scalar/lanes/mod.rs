//! Registers of several numbers as scalars.
//!
//! `F64x4<3>` is a register of four `f64` of which three are used: in memory it is `[f64; 3]`.
//! Lanes that are not used hold copies of one that is, so that they cost nothing: no special case
//! is ever taken for their sake alone.
//!
//! | machine | registers |
//! | --- | --- |
//! | x86-64 | [`F64x2`], [`F32x4`] (SSE2) |
//! | with AVX2 and FMA | [`F64x4`], [`F32x8`] |
//! | with AVX-512 F, DQ and VL | [`F64x8`], [`F32x16`] |
//! | 64-bit Arm | [`F64x2`], [`F32x4`] (NEON) |
//!
//! **Who may use them.** Types of the second and third row may be computed with only where
//! [`level`] says that the machine has them: the types are not reachable from outside of the crate,
//! and its drivers ask first. All operations are inlined; they become single instructions inside
//! [`Scalar::vectorize`](super::Scalar::vectorize), and are slow (but right) outside of it.
//!
//! **Bits.** `+ − × ÷ √`, comparisons and `powi` give in each lane the bits that `f64` (`f32`)
//! gives. Elementary functions are those of [`functions`], with the bounds that are listed there.
#![allow(dead_code)]

#[cfg(feature = "alloc")]
mod cache;
pub mod functions;
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
mod neon;
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
mod register;
#[cfg(all(test, any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
mod tests;
#[cfg(target_arch = "x86_64")]
mod together;
#[cfg(target_arch = "x86_64")]
mod x86;

use core::sync::atomic::{AtomicU8, Ordering};
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
#[allow(unused_imports)]
pub use register::*;

/// Whether there are any registers of several numbers.
pub const REGISTERS: bool =
    cfg!(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")));

/// The registers that may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// None: numbers one at a time.
    Single,
    /// Those that every machine of this kind has: `F64x2`, `F32x4`.
    Base,
    /// `F64x4`, `F32x8` as well.
    Avx2,
    /// `F64x8`, `F32x16` as well.
    Avx512,
}

/// The numbers of each lane beside each other, where no instructions do it.
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
#[inline(always)]
fn transpose_in_memory<T: Copy + Default, R: Copy, const W: usize>(
    mut rows: [R; W],
    store: fn(R, &mut [T; W]),
    load: fn(&[T; W]) -> R,
) -> [R; W] {
    let mut cells = [[T::default(); W]; W];
    for (row, cell) in rows.iter().zip(&mut cells) {
        store(*row, cell);
    }
    for (lane, row) in rows.iter_mut().enumerate() {
        let mut column = [T::default(); W];
        for (to, cell) in column.iter_mut().zip(&cells) {
            *to = cell[lane];
        }
        *row = load(&column);
    }
    rows
}

/// Runs a computation on `S` numbers side by side in the narrowest register that holds them.
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
macro_rules! side_by_side {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        #[inline(always)]
        fn side_by_side<const S: usize, C: crate::scalar::SideBySide<Self, S>>(
            computation: C,
        ) -> Result<(), C> {
            use crate::scalar::lanes;
            // Two numbers have a register of four where there is one: with fused products,
            // elementary functions in it take half the time of those in a register of two.
            #[cfg(target_arch = "x86_64")]
            if const { S > 1 && S <= $more } && lanes::level() >= lanes::Level::Avx2 {
                computation.call::<lanes::$avx2<S>>();
                return Ok(());
            }
            #[cfg(target_arch = "x86_64")]
            if const { S > $more && S <= $most } && lanes::level() >= lanes::Level::Avx512 {
                computation.call::<lanes::$avx512<S>>();
                return Ok(());
            }
            #[cfg(target_arch = "aarch64")]
            if const { S > 1 && S <= $few } {
                computation.call::<lanes::$base<S>>();
                return Ok(());
            }
            Err(computation)
        }
    };
}
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
macro_rules! side_by_side {
    ($($register:tt)*) => {};
}
pub(crate) use side_by_side;

/// Runs a computation with whole registers.
#[cfg(target_arch = "x86_64")]
macro_rules! widest_register {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        fn widest<C: crate::scalar::Widest<Self>>(lanes: usize, computation: C) -> Result<C::Output, C> {
            use crate::scalar::lanes::{Level, level};
            match level() {
                Level::Avx512 if lanes >= $most => {
                    Ok(computation.call::<crate::scalar::lanes::$avx512<$most>>())
                }
                Level::Avx512 | Level::Avx2 if lanes >= $more => {
                    Ok(computation.call::<crate::scalar::lanes::$avx2<$more>>())
                }
                _ => Err(computation),
            }
        }
    };
}
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
macro_rules! widest_register {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        fn widest<C: crate::scalar::Widest<Self>>(lanes: usize, computation: C) -> Result<C::Output, C> {
            use crate::scalar::lanes::{Level, level};
            if level() < Level::Base || lanes < $few {
                return Err(computation);
            }
            Ok(computation.call::<crate::scalar::lanes::$base<$few>>())
        }
    };
}
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
macro_rules! widest_register {
    ($($register:tt)*) => {};
}
pub(crate) use widest_register;

/// Runs a computation on slices in a function that is compiled for the registers.
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
macro_rules! packed_registers {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        #[inline]
        fn registers<C: crate::scalar::Registers<Self>>(computation: C) {
            use crate::scalar::Scalar;
            use crate::scalar::lanes::{Inside, Level, level, $base};
            match level() {
                #[cfg(target_arch = "x86_64")]
                Level::Avx512 => {
                    use crate::scalar::lanes::$avx512 as Register;
                    Register::<$most>::vectorize(Inside::<Register<$most>, _, Self>::new(computation));
                }
                #[cfg(target_arch = "x86_64")]
                Level::Avx2 => {
                    use crate::scalar::lanes::$avx2 as Register;
                    Register::<$more>::vectorize(Inside::<Register<$more>, _, Self>::new(computation));
                }
                Level::Single => computation.run::<Self>(),
                _ => $base::<$few>::vectorize(Inside::<$base<$few>, _, Self>::new(computation)),
            }
        }
    };
}
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))))]
macro_rules! packed_registers {
    ($($register:tt)*) => {};
}
pub(crate) use packed_registers;

/// A computation as the piece of code that a register enters.
pub struct Inside<E, C, T>(C, core::marker::PhantomData<(E, T)>);

impl<E, C, T> Inside<E, C, T> {
    /// With registers of type `E`.
    pub fn new(computation: C) -> Self {
        Self(computation, core::marker::PhantomData)
    }
}

impl<T, E: crate::scalar::Packed<T>, C: crate::scalar::Registers<T>> crate::scalar::Piece
    for Inside<E, C, T>
{
    #[inline(always)]
    fn run(self) {
        self.0.run::<E>();
    }
}

/// Products of blocks with their columns in registers. Left to itself the compiler puts rows into
/// registers, and transposes every block for it.
#[cfg(target_arch = "x86_64")]
macro_rules! blocks {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        #[inline(always)]
        fn subtract_blocks<const S: usize, const WIDE: bool>(
            target: &mut [[Self; S]; S],
            left: &[[Self; S]; S],
            right: &[[Self; S]; S],
            known: crate::scalar::Known<WIDE>,
        ) {
            use crate::scalar::lanes::$avx2 as Register;
            if let (Some([t0, t1]), Some([l0, l1]), Some([r0, r1])) =
                (target.first_chunk::<2>(), left.first_chunk::<2>(), right.first_chunk::<2>())
                && let (&[t00, t10, ..], &[t01, t11, ..]) = (&t0[..], &t1[..])
                && let (&[l00, l10, ..], &[l01, l11, ..]) = (&l0[..], &l1[..])
                && let (&[r00, r10, ..], &[r01, r11, ..]) = (&r0[..], &r1[..])
                && const { S == 2 }
            {
                // A whole block fits a register.
                let mut sum = Register::<4>::load(&[t00, t10, t01, t11]);
                let columns = [[l00, l10, l00, l10], [l01, l11, l01, l11]];
                let factors = [[r00, r00, r01, r01], [r10, r10, r11, r11]];
                for (column, factor) in columns.iter().zip(&factors) {
                    sum = sum.subtract_product(Register::<4>::load(column), Register::<4>::load(factor));
                }
                let mut block = [0.0; 4];
                sum.store(&mut block);
                target.as_flattened_mut().copy_from_slice(&block);
                return;
            }
            if const { WIDE && S == 4 } {
                use crate::scalar::lanes::$avx512 as Wide;
                // Some columns are a register: in all places of each the numbers of its row on the
                // right, one after the other.
                let mut columns = [Wide::<$most>::splat(0.0); S];
                for (column, left) in columns.iter_mut().zip(left) {
                    if let Some(left) = left.first_chunk() {
                        *column = Wide::repeat_four(left);
                    }
                }
                let (targets, _) = target.as_flattened_mut().as_chunks_mut::<$most>();
                let (rights, _) = right.as_flattened().as_chunks::<$most>();
                for (target, right) in targets.iter_mut().zip(rights) {
                    let mut sum = Wide::<$most>::load(target);
                    let factors = Wide::<$most>::load(right).each_of_four();
                    for (&column, &factor) in columns.iter().zip(&factors) {
                        sum = sum.subtract_product(column, factor);
                    }
                    sum.store(target);
                }
                return;
            }
            for (target, right) in target.iter_mut().zip(right) {
                Self::subtract_columns(target, left, right, known);
            }
        }
        #[inline(always)]
        fn write_block<const S: usize, const WIDE: bool>(
            target: &mut [[Self; S]; S],
            block: &[[Self; S]; S],
            _: crate::scalar::Known<WIDE>,
        ) {
            use crate::scalar::lanes::$avx2 as Register;
            if let (&[a, b, c, d], [to]) =
                (block.as_flattened(), target.as_flattened_mut().as_chunks_mut::<4>().0)
            {
                Register::<4>::load(&[a, b, c, d]).store(to);
            } else {
                *target = *block;
            }
        }
        #[inline(always)]
        fn subtract_columns<const S: usize, const WIDE: bool>(
            target: &mut [Self; S],
            block: &[[Self; S]; S],
            x: &[Self; S],
            _: crate::scalar::Known<WIDE>,
        ) {
            use crate::scalar::lanes::$avx2 as Register;
            if const { WIDE && S == $most } {
                use crate::scalar::lanes::$avx512 as Wide;
                let mut sum = Wide::<S>::load(target);
                for (column, &x) in block.iter().zip(x) {
                    sum = sum.subtract_product(Wide::<S>::load(column), Wide::<S>::splat(x));
                }
                sum.store(target);
                return;
            }
            if const { S > 1 && S <= $more } {
                // Two slices side by side are a loop that the optimiser may take for a long one.
                let (mut sum, mut k) = (Register::<S>::load(target), 0);
                while k < S {
                    sum = sum.subtract_product(Register::<S>::load(&block[k]), Register::<S>::splat(x[k]));
                    k += 1;
                }
                sum.store(target);
                return;
            }
            for (column, &x) in block.iter().zip(x) {
                for (target, &element) in target.iter_mut().zip(column) {
                    *target = target.subtract_product(element, x);
                }
            }
        }
        #[inline(always)]
        fn subtract_products<const W: usize, const WIDE: bool>(
            target: &mut [Self; W],
            a: &[Self; W],
            b: &[Self; W],
            _: crate::scalar::Known<WIDE>,
        ) {
            use crate::scalar::lanes::{$avx2 as Register, $avx512 as Wide};
            if const { WIDE && W.is_multiple_of($most) } {
                let (target, _) = target.as_chunks_mut::<$most>();
                let ((a, _), (b, _)) = (a.as_chunks::<$most>(), b.as_chunks::<$most>());
                for ((target, a), b) in target.iter_mut().zip(a).zip(b) {
                    let (t, a, b) =
                        (Wide::<$most>::load(target), Wide::<$most>::load(a), Wide::<$most>::load(b));
                    t.subtract_product(a, b).store(target);
                }
                return;
            }
            let (target, target_rest) = target.as_chunks_mut::<$more>();
            let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<$more>(), b.as_chunks::<$more>());
            for ((target, a), b) in target.iter_mut().zip(a).zip(b) {
                let (t, a, b) =
                    (Register::<$more>::load(target), Register::<$more>::load(a), Register::<$more>::load(b));
                t.subtract_product(a, b).store(target);
            }
            for ((target, &a), &b) in target_rest.iter_mut().zip(a_rest).zip(b_rest) {
                *target = target.subtract_product(a, b);
            }
        }
        #[inline(always)]
        fn transposed<const N: usize, const WIDE: bool>(
            rows: &[[Self; N]; N],
            _: crate::scalar::Known<WIDE>,
        ) -> [[Self; N]; N] {
            use crate::scalar::{Lanes, lanes::$avx2 as Register};
            if const { N == $more } {
                let (mut registers, mut columns) = ([Register::<N>::splat(0.0); N], *rows);
                for (register, row) in registers.iter_mut().zip(rows) {
                    *register = Register::load(row);
                }
                Register::transpose(&registers, &mut columns);
                return columns;
            }
            crate::scalar::transposed(rows)
        }
        #[inline(always)]
        fn subtract_row<const W: usize, const WIDE: bool>(
            target: &mut [Self; W],
            factor: Self,
            row: &[Self; W],
            _: crate::scalar::Known<WIDE>,
        ) {
            use crate::scalar::lanes::{$avx2 as Register, $avx512 as Wide};
            if const { WIDE && W.is_multiple_of($most) } {
                let (target, _) = target.as_chunks_mut::<$most>();
                let (row, _) = row.as_chunks::<$most>();
                for (target, row) in target.iter_mut().zip(row) {
                    let (t, r) = (Wide::<$most>::load(target), Wide::<$most>::load(row));
                    t.subtract_product(Wide::<$most>::splat(factor), r).store(target);
                }
                return;
            }
            let (target, target_rest) = target.as_chunks_mut::<$more>();
            let (row, row_rest) = row.as_chunks::<$more>();
            for (target, row) in target.iter_mut().zip(row) {
                let (t, r) = (Register::<$more>::load(target), Register::<$more>::load(row));
                t.subtract_product(Register::<$more>::splat(factor), r).store(target);
            }
            for (target, &element) in target_rest.iter_mut().zip(row_rest) {
                *target = target.subtract_product(factor, element);
            }
        }
        #[inline(always)]
        fn subtract_complex<const N: usize, const WIDE: bool>(
            target: &mut [Self; N],
            a: &[Self; N],
            b: &[Self; N],
            _: crate::scalar::Known<WIDE>,
        ) {
            use crate::scalar::lanes::{$avx2 as Register, $avx512 as Wide};
            // The complex ones, and the real one behind them.
            if const { WIDE && N / 2 * 2 == $most } {
                Wide::<$most>::subtract_complex(target, a, b);
            } else if const { N / 2 * 2 == $more } {
                Register::<$more>::subtract_complex(target, a, b);
            } else {
                let (m, minus) = (const { N / 2 }, a.map(|a| -a));
                let ((re, im), (b_re, b_im)) = (target.split_at_mut(m), b.split_at(m));
                Register::<$more>::subtract_each(re, &a[..m], b_re);
                Register::<$more>::subtract_each(re, &minus[m..], b_im);
                Register::<$more>::subtract_each(im, &a[..m], b_im);
                Register::<$more>::subtract_each(im, &a[m..], b_re);
            }
            if const { N % 2 == 1 } {
                target[N - 1] = target[N - 1].subtract_product(a[N - 1], b[N - 1]);
            }
        }
    };
}
#[cfg(not(target_arch = "x86_64"))]
macro_rules! blocks {
    ($($register:tt)*) => {};
}
pub(crate) use blocks;

#[cfg(feature = "testing")]
pub use cache::limit_cache;
#[cfg(feature = "alloc")]
pub(crate) use cache::second_level_cache;

/// The level that is used; [`UNKNOWN`] until somebody asks.
static LEVEL: AtomicU8 = AtomicU8::new(UNKNOWN);
const UNKNOWN: u8 = u8::MAX;

/// For tests: from now on no calculation of the process uses wider registers than these, nor such
/// as the machine does not have.
pub fn limit(limit: Level) {
    LEVEL.store(widest(limit) as u8, Ordering::Relaxed);
}

/// The widest registers that this machine has and [`limit`] allows.
#[inline(always)]
pub fn level() -> Level {
    let level = match LEVEL.load(Ordering::Relaxed) {
        level if level == Level::Single as u8 => Level::Single,
        level if level == Level::Base as u8 => Level::Base,
        level if level == Level::Avx2 as u8 => Level::Avx2,
        level if level == Level::Avx512 as u8 => Level::Avx512,
        _ => find(),
    };
    // What there cannot be the compiler leaves out.
    match level {
        Level::Avx512 if may_be(Level::Avx512) => Level::Avx512,
        Level::Avx2 | Level::Avx512 if may_be(Level::Avx2) => Level::Avx2,
        Level::Single => Level::Single,
        _ => Level::Base,
    }
}

/// Whether a machine that runs this may have these registers: without `std` nobody asks it, and it
/// has what the program was compiled for. What is for others is not in the program then.
#[inline(always)]
fn may_be(level: Level) -> bool {
    cfg!(feature = "std") || is_there(level)
}

#[cold]
fn find() -> Level {
    limit(Level::Avx512);
    widest(Level::Avx512)
}

/// The widest registers that this machine has, up to a limit.
fn widest(limit: Level) -> Level {
    let levels = [Level::Avx512, Level::Avx2, Level::Base];
    levels.into_iter().find(|&level| level <= limit && is_there(level)).unwrap_or(Level::Single)
}

/// Whether the machine has these registers.
#[inline(always)]
pub fn is_there(level: Level) -> bool {
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    macro_rules! has {
        ($($feature:tt)*) => { $(std::is_x86_feature_detected!($feature))&&* };
    }
    #[cfg(not(all(target_arch = "x86_64", feature = "std")))]
    macro_rules! has {
        ($($feature:tt)*) => { $(cfg!(target_feature = $feature))&&* };
    }
    match level {
        Level::Single => true,
        Level::Base => cfg!(any(target_arch = "x86_64", target_feature = "neon")),
        Level::Avx2 => has!("avx2" "fma"),
        Level::Avx512 => has!("avx512f" "avx512dq" "avx512vl" "avx2" "fma"),
    }
}
