//! Branches on model variables become selections.

use super::same;

same! {
    value: fn f(x: [f64; 6]) -> f64 { if x[0] > x[1] { x[2] * 2.0 } else { x[3] } }
    chain: fn f(x: [f64; 6]) -> f64 { if x[0] < -0.5 { -1.0 } else if x[0] < 0.0 { x[0] } else if x[0] <= 1.0 { x[0] * x[0] } else { 9.0 } }
    comparisons: fn f(x: [f64; 6]) -> [f64; 6] {
        let g = |c: bool| if c { 1.0 } else { 2.0 };
        [g(x[0] < x[1]), g(x[0] <= x[1]), g(x[0] > x[1]), g(x[0] >= x[1]), g(x[0] == x[1]), g(x[0] != x[1])]
    }
    logic: fn f(x: [f64; 6]) -> [f64; 4] {
        let g = |c: bool| if c { x[4] } else { x[5] }; let (a, b) = (x[0] > 0.0, x[1] > 0.0);
        [g(a && b), g(a || b && !a), g(!(a && x[2] > 0.0) || false), g(a ^ b | (a == b) & true)]
    }
    variables: fn f(x: [f64; 6]) -> [f64; 3] {
        let mut a = x[0]; let mut b = [x[1], x[2]]; let mut c = 0.0;
        if x[3] > 0.0 { a *= 2.0; b[0] = a; c = 1.0; } else { b[1] -= 1.0; if x[4] > 0.0 { a = 7.0; } }
        if x[5] > 1.0 { c += b[0]; }
        [a + c, b[0], b[1]]
    }
    declared_before: fn f(x: [f64; 6]) -> f64 { let a; let b: f64; if x[0] > 0.0 { a = x[1]; b = 2.0; } else { a = x[2]; b = 3.0; } a * b }
    aggregates: fn f(x: [f64; 6]) -> f64 {
        #[derive(Clone, Copy)] struct P { a: f64, b: [f64; 2], n: usize }
        let p = P { a: x[0], b: [x[1], x[2]], n: 1 }; let q = P { a: x[3], ..p };
        let r = if x[4] > x[5] { p } else { q }; let (s, t) = if x[0] > 0.0 { (x[1], [x[2]; 2]) } else { (1.0, [2.0, 3.0]) };
        r.a * r.b[r.n] + s * t[1]
    }
    through_references: fn f(x: [f64; 6]) -> f64 {
        fn clip(v: &mut f64) -> f64 { if *v > 1.0 { *v = 1.0; } if *v < -1.0 { *v = -1.0 } *v }
        let mut y = x; for v in &mut y { clip(v); } let mut s = 0.0; let mut add = |v: f64| s += v; if x[0] > 0.0 { add(y[1]); } else { add(2.0); add(y[2]); } s + y[3] + y[5]
    }
    in_loops: fn f(x: [f64; 6]) -> f64 { let mut m = x[0]; for v in &x[1..] { if *v > m { m = *v; } } let mut n = 0.0; for i in 0..6 { if x[i] == m { n += 1.0; } else { continue_not(&mut n); } } fn continue_not(n: &mut f64) { *n -= 0.25; } m * n }
    loops_inside: fn f(x: [f64; 6]) -> f64 { let mut s = 0.0; if x[0] > 0.0 { for i in 0..6 { if i == 4 { break; } if i == 1 { continue; } s += x[i]; } } else { let mut k = 0; while k < 3 { k += 1; s -= x[k]; } } s }
    calls_inside: fn f(x: [f64; 6]) -> f64 { fn g(v: f64, n: usize) -> f64 { if n == 0 { return v; } v * n as f64 } if x[0] < 0.5 { g(x[1], 0) } else { g(x[2], 3) } }
    short_circuit: fn f(x: [f64; 6]) -> f64 { let mut n = 0.0; let mut count = |c: bool| { n += 1.0; c }; let a = count(x[0] > 0.0) && count(x[1] > 0.0) || count(x[2] > 0.0); if a { n + 10.0 } else { n } }
    matches: fn f(x: [f64; 6]) -> [f64; 3] {
        let a = match x[0] { v if v < 0.0 => -v, v if v > 0.5 => v * 2.0, _ => 7.0 };
        let b = match (x[1] > 0.0, x[2] > 0.0) { (true, true) => 1.0, (true, false) => x[3], (false, true) => 3.0, (false, false) => 4.0 };
        let c = match x[3] > 0.0 { true => a, false => b };
        [a, b, c]
    }
    range_patterns: fn f(x: [f64; 6]) -> f64 { match x[0] { 0.0..1.0 => 1.0, 1.0..=10.0 => x[1], _ => 3.0 } }
    known_conditions: fn f(x: [f64; 6]) -> f64 { const LIMIT: f64 = 2.0; let mut s = x[0]; if LIMIT > 1.0 { s += 1.0; } for i in 0..3 { if (i as f64) < LIMIT { s *= x[i]; } } s }
    same_in_both: fn f(x: [f64; 6]) -> f64 { let mut i = 0; let mut s = 0.0; if x[0] > 0.0 { s = x[1]; i += 1; } else { s = x[2]; i += 1; } x[i] * s }
}
