//! The order of execution, and what depends on it.

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
}
