//! Functions: generic parameters, inference, scopes.

use super::same;

same! {
    const_generics: fn f(x: [f64; 6]) -> f64 {
        fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 { let mut s = 0.0; for i in 0..N { s += a[i] * b[i]; } s }
        fn zeros<const N: usize>() -> [f64; N] { [0.0; N] }
        fn head<const N: usize>(a: &[f64; 6]) -> [f64; N] { let mut h = [0.0; N]; for i in 0..N { h[i] = a[i]; } h }
        fn product<const R: usize, const C: usize>(m: &[[f64; C]; R], v: &[f64; C]) -> [f64; R] {
            let mut y = zeros(); for r in 0..R { y[r] = dot(m[r], *v); } y
        }
        let a: [f64; 2] = head(&x); let b = head::<2>(&x); let z = zeros::<3>();
        let p = product(&[[x[0], x[1]], [x[2], x[3]], [x[4], x[5]]], &a);
        dot(a, b) + dot(x, x) + z[2] + p[2] * p[0]
    }
    generic_types: fn f(x: [f64; 6]) -> f64 {
        fn pair<A, B>(a: A, b: B) -> (B, A) { (b, a) }
        fn last<T: Copy, const N: usize>(a: [T; N]) -> T { a[N - 1] }
        let (a, b) = pair(x[0], [x[1], x[2]]); last(a) * b + last([(x[3], 1), (x[4], 2)]).0
    }
    nested_functions: fn f(x: [f64; 6]) -> f64 {
        fn outer(a: f64) -> f64 { const K: f64 = 2.0; fn inner(a: f64) -> f64 { a * K } inner(a) + inner(K) }
        outer(x[0]) * second_function(x[1]);
        fn second_function(a: f64) -> f64 { a - outer(1.0) }
        second_function(outer(x[2]))
    }
    argument_patterns: fn f(x: [f64; 6]) -> f64 {
        fn g([a, b]: [f64; 2], (c, _): (f64, f64), mut d: f64) -> f64 { d += a; c * b - d }
        let h = |[a, .., b]: [f64; 6], &c: &f64| a * b + c;
        g([x[0], x[1]], (x[2], x[3]), x[4]) + h(x, &x[5])
    }
    functions_as_values: fn f(x: [f64; 6]) -> f64 {
        fn a(v: f64) -> f64 { v + 1.0 } fn b(v: f64) -> f64 { v * 2.0 }
        let table: [fn(f64) -> f64; 2] = [a, b]; let mut s = x[0]; for g in table { s = g(s); } let h: fn(f64) -> f64 = b; h(s) + table[0](x[1])
    }
    functions_of_matrices: fn f(x: [f64; 6]) -> [[f64; 3]; 3] {
        fn skew(a: [f64; 3]) -> [[f64; 3]; 3] { [[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]] }
        fn multiply<const N: usize>(a: [[f64; N]; N], b: [[f64; N]; N]) -> [[f64; N]; N] {
            let mut c = [[0.0; N]; N]; for i in 0..N { for j in 0..N { for k in 0..N { c[i][j] += a[i][k] * b[k][j]; } } } c
        }
        multiply(skew([x[0], x[1], x[2]]), skew([x[3], x[4], x[5]]))
    }
    mutated_arguments: fn f(x: [f64; 6]) -> f64 { fn g(mut a: [f64; 6]) -> f64 { a[0] = 0.0; a[0] + a[1] } g(x) + x[0] }
}
