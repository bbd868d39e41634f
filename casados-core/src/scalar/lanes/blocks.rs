//! Products of blocks and rows of numbers, in registers.

/// Products of blocks with their columns in registers. Compilers would put rows into registers, and
/// transpose every block.
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
            if const { S == 2 } {
                // The whole block fits a register.
                let Some(target) = target.as_flattened_mut().first_chunk_mut::<4>() else { return };
                let Some(&[l00, l10, l01, l11]) = left.as_flattened().first_chunk() else { return };
                let Some(&[r00, r10, r01, r11]) = right.as_flattened().first_chunk() else { return };
                let (first, second) = ([l00, l10, l00, l10], [l01, l11, l01, l11]);
                let (by_first, by_second) = ([r00, r00, r01, r01], [r10, r10, r11, r11]);
                Register::<4>::load(target)
                    .subtract_product(Register::load(&first), Register::load(&by_first))
                    .subtract_product(Register::load(&second), Register::load(&by_second))
                    .store(target);
                return;
            }
            if const { WIDE && S == 4 } {
                use crate::scalar::lanes::$avx512 as Wide;
                // Several columns fit a register; the factors of each are the numbers of its row on
                // the right, one after the other.
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
            if const { S == 2 } {
                let Some(block) = block.as_flattened().first_chunk::<4>() else { return };
                let Some(target) = target.as_flattened_mut().first_chunk_mut() else { return };
                Register::<4>::load(block).store(target);
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
                // Two slices in one loop, which the optimiser may take for a long one.
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
            if const { W == $more } {
                let (t, a, b) = (Register::<W>::load(target), Register::<W>::load(a), Register::<W>::load(b));
                return t.subtract_product(a, b).store(target);
            }
            let (target, target_rest) = target.as_chunks_mut::<$more>();
            let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<$more>(), b.as_chunks::<$more>());
            crate::scalar::each!(n < W / $more => {
                let (t, a, b) = (Register::<$more>::load(&target[n]), Register::load(&a[n]), Register::load(&b[n]));
                t.subtract_product(a, b).store(&mut target[n]);
            });
            if const { !W.is_multiple_of($more) } {
                for ((target, &a), &b) in target_rest.iter_mut().zip(a_rest).zip(b_rest) {
                    *target = target.subtract_product(a, b);
                }
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
            // One register, without a loop: the most frequent case, which compiles faster.
            if const { WIDE && W == $most } {
                let (t, r) = (Wide::<W>::load(target), Wide::<W>::load(row));
                return t.subtract_product(Wide::<W>::splat(factor), r).store(target);
            }
            if const { W == $more } {
                let (t, r) = (Register::<W>::load(target), Register::<W>::load(row));
                return t.subtract_product(Register::<W>::splat(factor), r).store(target);
            }
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
            let factor_of_each = Register::<$more>::splat(factor);
            crate::scalar::each!(n < W / $more => {
                let (t, r) = (Register::<$more>::load(&target[n]), Register::<$more>::load(&row[n]));
                t.subtract_product(factor_of_each, r).store(&mut target[n]);
            });
            if const { !W.is_multiple_of($more) } {
                for (target, &element) in target_rest.iter_mut().zip(row_rest) {
                    *target = target.subtract_product(factor, element);
                }
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
            // The complex numbers, followed by the real one.
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
