//! Elementary functions of several arguments in one call: in wider registers, and interleaved, so
//! that the processor works on one while another waits for its own results.

use super::functions::{CallWithEight, CallWithFour, Double, Elementary, Two};
use super::register::{F64x4, join_halves, split_halves};
use core::marker::PhantomData;

/// The first and the last arguments of two functions, and of four.
macro_rules! ends {
    ($name:ident, $ops:ident, $a:ident: $($index:literal)*) => {
        [$(whole!($name, $ops, $a[$index][0]), whole!($name, $ops, $a[$index][K - 1])),*]
    };
}

/// The results as registers with all lanes used.
macro_rules! results {
    ($results:expr) => {{
        let (found, mut results) = ($results, [[Self::splat(0.0); R]; COUNT]);
        crate::scalar::each!(n < COUNT => {
            crate::scalar::each!(r < R => {
                results[n][r] = Self(found[n][r].0);
            });
        });
        results
    }};
}

/// The elementary functions of doubles, two or four of them interleaved: the processor works on one
/// while another waits for its own results. Special cases, a condition with its results, are tested
/// first.
macro_rules! abreast {
    ($name:ident, $ops:ident [$($functions:tt)*] |$a:ident| $($condition:expr => $first:expr),*) => {
        of_doubles!($name, $ops: $($functions)*);
        #[inline(always)]
        fn together<F: Elementary<K, R>, const K: usize, const R: usize, const COUNT: usize>(
            $a: [[Self; K]; COUNT],
        ) -> [[Self; R]; COUNT] {
            $(if $condition {
                return $first;
            })*
            if const { COUNT == 4 && $ops::WIDTH == 8 } {
                results!($ops::enter_with_eight::<Abreast<F, K, R>, _>(ends!($name, $ops, $a: 0 1 2 3)))
            } else if const { COUNT == 4 } {
                // All of them would not fit sixteen registers.
                let first = $ops::enter_with_four::<Abreast<F, K, R>, _>(ends!($name, $ops, $a: 0 1));
                let second = $ops::enter_with_four::<Abreast<F, K, R>, _>(ends!($name, $ops, $a: 2 3));
                results!([first[0], first[1], second[0], second[1]])
            } else if const { COUNT == 2 } {
                results!($ops::enter_with_four::<Abreast<F, K, R>, _>(ends!($name, $ops, $a: 0 1)))
            } else {
                let mut results = [[Self::splat(0.0); R]; COUNT];
                crate::scalar::each!(n < COUNT => {
                    results[n] = F::of($a[n]);
                });
                results
            }
        }
    };
}

/// For registers of eight.
macro_rules! of_eights {
    ($name:ident, $ops:ident: $($functions:tt)*) => {
        abreast!($name, $ops [$($functions)*] |a|);
    };
}

/// For registers of four: two in one register if each uses half of it, or if there are registers
/// twice as wide.
macro_rules! of_fours {
    ($name:ident, $ops:ident: $($functions:tt)*) => {
        abreast!($name, $ops [$($functions)*] |a|
            const { 2 * N <= $ops::WIDTH && COUNT % 2 == 0 } => {
                let mut results = [[Self($ops::splat(0.0)); R]; COUNT];
                for k in (0..COUNT - 1).step_by(2) {
                    let mut joined = [whole!($name, $ops, a[k][0]); K];
                    crate::scalar::each!(j < K => {
                        joined[j] = $name($ops::low_halves(a[k][j].0, a[k + 1][j].0));
                    });
                    let of_both = F::of(joined);
                    crate::scalar::each!(r < R => {
                        results[k][r] = Self($ops::low_halves(of_both[r].0, of_both[r].0));
                        results[k + 1][r] = Self($ops::high_halves(of_both[r].0, of_both[r].0));
                    });
                }
                results
            },
            const { COUNT == 4 && may_be_available(Level::Avx512) } && level() == Level::Avx512 =>
                results!(avx512_f64::enter_with_eight::<Wider<F, K, R>, _>(ends!($name, $ops, a: 0 1 2 3))),
            const { COUNT == 2 && may_be_available(Level::Avx512) } && level() == Level::Avx512 =>
                results!(avx512_f64::enter_with_four::<Wider<F, K, R>, _>(ends!($name, $ops, a: 0 1)))
        );
    };
}
pub(super) use {abreast, ends, of_eights, of_fours, results};

/// Interleaved functions, each given by its first and its last argument.
pub struct Abreast<F, const K: usize, const R: usize>(PhantomData<F>);

/// The arguments of a function.
#[inline(always)]
fn first_and_last_arguments<D: Copy, const K: usize>(first: D, last: D) -> [D; K] {
    let mut all = [first; K];
    if K > 1 {
        all[K - 1] = last;
    }
    all
}

impl<D: Double, F: Elementary<K, R>, const K: usize, const R: usize> CallWithFour<D> for Abreast<F, K, R> {
    type Output = [[D; R]; 2];
    #[inline(always)]
    fn call([a, b, c, d]: [D; 4]) -> Self::Output {
        let results = F::inside(first_and_last_arguments(Two(a, c), Two(b, d)));
        let mut apart = [[a; R]; 2];
        for (r, Two(first, second)) in results.into_iter().enumerate() {
            [apart[0][r], apart[1][r]] = [first, second];
        }
        apart
    }
}

impl<D: Double, F: Elementary<K, R>, const K: usize, const R: usize> CallWithEight<D> for Abreast<F, K, R> {
    type Output = [[D; R]; 4];
    #[inline(always)]
    fn call([a, b, c, d, e, f, g, h]: [D; 8]) -> Self::Output {
        let results =
            F::inside(first_and_last_arguments(Two(Two(a, c), Two(e, g)), Two(Two(b, d), Two(f, h))));
        let mut apart = [[a; R]; 4];
        for (r, Two(Two(first, second), Two(third, fourth))) in results.into_iter().enumerate() {
            [apart[0][r], apart[1][r], apart[2][r], apart[3][r]] = [first, second, third, fourth];
        }
        apart
    }
}

/// Functions in registers twice as wide, two in each, given by their first and last arguments.
pub struct Wider<F, const K: usize, const R: usize>(PhantomData<F>);

impl<F: Elementary<K, R>, const K: usize, const R: usize> CallWithFour<F64x4<4>> for Wider<F, K, R> {
    type Output = [[F64x4<4>; R]; 2];
    #[inline(always)]
    fn call([a, b, c, d]: [F64x4<4>; 4]) -> Self::Output {
        let joined = F::inside(first_and_last_arguments(join_halves(a, c), join_halves(b, d)));
        let mut results = [[a; R]; 2];
        for r in 0..R {
            [results[0][r], results[1][r]] = split_halves(joined[r]);
        }
        results
    }
}

impl<F: Elementary<K, R>, const K: usize, const R: usize> CallWithEight<F64x4<4>> for Wider<F, K, R> {
    type Output = [[F64x4<4>; R]; 4];
    #[inline(always)]
    fn call([a, b, c, d, e, f, g, h]: [F64x4<4>; 8]) -> Self::Output {
        let joined = F::inside(first_and_last_arguments(
            Two(join_halves(a, c), join_halves(e, g)),
            Two(join_halves(b, d), join_halves(f, h)),
        ));
        let mut results = [[a; R]; 4];
        for (r, Two(first, second)) in joined.into_iter().enumerate() {
            [results[0][r], results[1][r]] = split_halves(first);
            [results[2][r], results[3][r]] = split_halves(second);
        }
        results
    }
}
