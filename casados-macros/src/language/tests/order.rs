//! The order of execution, and its effects.

use super::same;

same! {
    right_side_first: fn f(x: [f64; 6]) -> f64 {
        let mut a = [0.0; 4];
        let mut i = 0;
        a[i] = { i += 1; x[0] };
        a[i] += { i += 1; x[1] };
        let mut k = 2usize;
        k += { k = 5; 1 };
        a[3] = { a[3] = 4.0; a[3] + x[2] };
        a[3] += { a[3] = 1.0; x[3] };
        a[0] + 10.0 * a[1] + 100.0 * a[2] + 1000.0 * a[3] + k as f64
    }
    rest_last: fn f(x: [f64; 6]) -> f64 {
        #[derive(Clone, Copy)]
        struct P { a: f64, b: f64, c: f64 }
        let mut p = P { a: x[0], b: x[1], c: x[2] };
        let q = P { a: { p.b = x[3]; p.c = 2.0; 1.0 }, c: p.c, ..p };
        q.a + 2.0 * q.b + 3.0 * q.c
    }
    conditional_closures: fn f(x: [f64; 6]) -> f64 {
        let (mut n, mut m) = (0.0, 0.0);
        let any = x.iter().any(|v| { n += 1.0; *v > 1.0 });
        let all = [1.0, x[1], x[2], -1.0].iter().all(|v| { m += *v; *v > 0.5 });
        n + 10.0 * m + if any { 0.5 } else { 0.0 } + if all { 100.0 } else { 0.0 }
    }
    copies_of_scans: fn f(x: [f64; 6]) -> f64 {
        let sums = x.iter().scan(0.0, |s, v| { *s += v; Some(*s) });
        let mut other = sums.clone();
        let first = other.next().unwrap();
        let twice: f64 = sums.clone().cycle().take(12).fold(0.0, |a, b| 0.5 * a + b);
        twice + first + sums.last().unwrap() + other.next().unwrap()
    }
    conversions: fn f(x: [f64; 6]) -> f64 {
        let k = 2i32;
        let n: usize = (k - 5).try_into().unwrap_or(0);
        let a = 4_000_000_000u32;
        let w: u64 = a.into();
        let two: usize = k.try_into().unwrap();
        let five: usize = (k + 3).try_into().unwrap();
        x[n] + w.wrapping_mul(w) as f64 + x[five] + x[two]
    }
    bits: fn f(x: [f64; 6]) -> f64 {
        x[0] + ((-1i32).count_ones() + 10 * (-2i8).count_ones() + (-3i128).count_ones() + 7u64.count_ones()) as f64
            + (-4i64).trailing_zeros() as f64
    }
    ranges_of_numbers: fn f(x: [f64; 6]) -> f64 {
        let (mut s, lower) = (0.0, x[5]);
        for v in x { if (0.0..1.0).contains(&v) { s += v; } if (lower..=2.0).contains(&v) { s -= 0.1; } }
        if (..3).contains(&2) && !(1..=2).contains(&3) && (0.0..=0.5).contains(&0.5) { s } else { 0.0 }
    }
    repeated_from_behind: fn f(x: [f64; 6]) -> f64 {
        let mut s = 0.0;
        for (i, v) in core::iter::repeat_n(x[0], 3).rev().zip([1.0, 2.0, 4.0]) { s += i * v; }
        s
    }
    discriminants: fn f(x: [f64; 6]) -> f64 {
        const BASE: usize = 1;
        enum Mode { A = BASE as isize, B }
        let cast = |mode: Mode| { mode as usize as f64 };
        { const BASE: usize = 7; x[Mode::B as usize] + cast(Mode::A) * x[BASE - 4] }
    }
    signs: fn f(x: [f64; 6]) -> f64 { x[0].copysign(f64::NAN) + 3.0 * x[1].copysign(-0.0) + x[2].copysign(2.0) * 9.0 }
    own_methods_first: fn f(x: [f64; 6]) -> f64 {
        trait Smooth { fn abs(self) -> f64; fn pow(self, n: u32) -> f64; fn half(self) -> f64; fn both(self) -> f64 where Self: Sized + Copy { self.abs() + self.half() } }
        impl Smooth for f64 {
            fn abs(self) -> f64 { (self * self + 1e-4).sqrt() }
            fn pow(self, n: u32) -> f64 { self.powi(n as i32) }
            fn half(self) -> f64 { 0.5 * self.abs() }
        }
        fn generic<T: Smooth>(a: T) -> f64 { a.abs() }
        x[0].abs() + 2.0 * Smooth::abs(x[1]) + 3.0 * <f64 as Smooth>::abs(x[2]) + 4.0 * f64::abs(x[3])
            + 5.0 * generic(x[4]) + 6.0 * x[5].both() + x[0].pow(2)
    }
}
