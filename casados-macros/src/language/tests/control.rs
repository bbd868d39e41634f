//! Loops, branches on compile-time values, closures, references.

use super::same;

same! {
    for_ranges: fn f(x: [f64; 6]) -> f64 {
        let mut s = 0.0;
        for i in 0..3 { s += x[i]; } for i in 1..=2 { s *= x[i] + i as f64; } for _ in 3..3 { s = 0.0; }
        for i in (0..6).rev() { s = s * 0.5 + x[i]; }
        for i in (0..6).step_by(2) { s -= x[i]; }
        s
    }
    for_arrays: fn f(x: [f64; 6]) -> f64 {
        let mut s = 0.0; let mut y = x;
        for v in x { s += v; } for v in &x { s *= *v; } for v in x.iter() { s -= v; }
        for v in &mut y { *v *= 2.0; } for v in y.iter_mut() { *v += s; }
        for (i, v) in y.iter_mut().enumerate() { *v -= i as f64; }
        for row in [[x[0], x[1]], [y[2], y[3]]] { for v in row { s += v; } }
        s + y[5]
    }
    while_loops: fn f(x: [f64; 6]) -> f64 {
        let mut i = 0; let mut s = 1.0;
        while i < 5 { i += 1; if i == 3 { continue; } s += x[i] * s; }
        loop { i -= 1; if i < 2 { break; } s -= x[i]; }
        let t = loop { i += 1; if i > 3 { break x[i] * 2.0; } };
        s * t
    }
    labels: fn f(x: [f64; 6]) -> f64 {
        let mut s = 0.0;
        'outer: for i in 0..6 { for j in 0..6 { if j > i { continue 'outer; } if i + j > 7 { break 'outer; } s += x[i] * x[j]; } }
        let v = 'block: { if x.len() == 6 { break 'block s * 2.0; } s };
        v
    }
    while_let: fn f(x: [f64; 6]) -> f64 {
        let mut it = x.iter(); let mut s = 0.0;
        while let Some(v) = it.next() { s = s * 2.0 + v; if let Some(w) = it.next() { s -= w; } }
        let mut stack = Some(3usize);
        while let Some(n) = stack { s += x[n]; stack = if n > 1 { Some(n - 1) } else { None }; }
        s
    }
    compile_time_branches: fn f(x: [f64; 6]) -> f64 {
        const FRICTION: bool = true; let n = x.len();
        let a = if n > 3 && FRICTION { x[0] } else { x[3] };
        let b = match n { 0 => x[5], 1..=5 => x[4], 6 | 7 => x[1], _ => 0.0 };
        let c = match (n % 2 == 0, n) { (true, 6) => 2.0, (_, k) if k > 100 => 3.0, _ => 4.0 };
        if !FRICTION { return 0.0; }
        a + b * c
    }
    early_return: fn f(x: [f64; 6]) -> f64 {
        fn pick(x: &[f64; 6], i: usize) -> f64 { if i == 0 { return x[0]; } for k in 0..i { if k == 2 { return x[k] * 2.0; } } x[i] }
        pick(&x, 0) + pick(&x, 1) * pick(&x, 5)
    }
    closures: fn f(x: [f64; 6]) -> f64 {
        let mut count = 0; let mut sum = 0.0;
        let mut add = |v: f64| { sum += v; count += 1; sum };
        let a = add(x[0]); let b = add(x[1] * a);
        let k = 2.0; let by_value = move |v: f64| v * k; let k = 5.0;
        let twice = |g: &dyn Fn(f64) -> f64, v| g(g(v));
        let [p, q] = [0, 1].map(|i: usize| x[i + 2]);
        sum * count as f64 + b + twice(&by_value, x[2]) * k + p * q
    }
    closure_returns: fn f(x: [f64; 6]) -> f64 { let g = |i: usize| -> f64 { if i > 2 { return x[i]; } x[i] * 2.0 }; g(1) + g(4) }
    closures_as_arguments: fn f(x: [f64; 6]) -> f64 {
        fn apply(g: impl Fn(f64) -> f64, v: f64) -> f64 { g(v) + 1.0 }
        fn call_for_indices<F: FnMut(usize)>(mut g: F) { for i in 0..3 { g(i); } }
        fn compose(a: impl Fn(f64) -> f64, b: impl Fn(f64) -> f64) -> impl Fn(f64) -> f64 { move |v| b(a(v)) }
        fn double(v: f64) -> f64 { 2.0 * v }
        let mut s = 0.0; call_for_indices(|i| s += x[i]);
        apply(|v| apply(|w| w * v, v), x[0]) + apply(double, s) + compose(double, |v| v - 3.0)(x[1])
    }
    moved_state: fn f(x: [f64; 6]) -> f64 { let mut n = 0; let mut next = move || { n += 1; x[n] }; let a = next(); let b = next(); a - b * n as f64 }
    references: fn f(x: [f64; 6]) -> f64 {
        fn add_to(v: &mut f64, by: f64) { *v += by; }
        fn swap(a: &mut [f64; 6], i: usize, j: usize) { let t = a[i]; a[i] = a[j]; a[j] = t; }
        let mut y = x; add_to(&mut y[0], x[1]); swap(&mut y, 0, 3);
        let r = &mut y; r[2] = 7.0; let q = &mut r[4]; *q *= 2.0; add_to(q, 1.0);
        let (a, b) = (&x[0], &&y[1]); *a * **b + y[3] + y[4] + y[2]
    }
    reference_fields: fn f(x: [f64; 6]) -> f64 {
        struct S<'a> { v: &'a mut [f64; 6], n: usize }
        impl S<'_> { fn push(&mut self, a: f64) { self.v[self.n] = a; self.n += 1; } }
        let mut y = [0.0; 6]; let mut s = S { v: &mut y, n: 0 };
        for a in x { s.push(a * s.n as f64); } let n = s.n; y[1] + y[5] * n as f64
    }
    returned_references: fn f(x: [f64; 6]) -> f64 {
        fn element_mut(a: &mut [f64; 6], i: usize) -> &mut f64 { &mut a[i] }
        let mut y = x; *element_mut(&mut y, 2) = 4.0; *element_mut(&mut y, 3) += y[2]; y[3] * y[2]
    }
    uninitialised: fn f(x: [f64; 6]) -> f64 { let a; let b: f64; if x.len() > 3 { a = x[0]; b = 1.0; } else { a = x[1]; b = 2.0; } a * b }
    destructuring_assignment: fn f(x: [f64; 6]) -> f64 {
        let (mut a, mut b) = (x[0], x[1]); (a, b) = (b, a); [a, _, b] = [a + b, 0.0, a - b]; (_, a) = (1, a * 2.0);
        let mut y = x; (y[0], y[1], ..) = (b, a, 1, 2); a * b + y[0] - y[1]
    }
    blocks: fn f(x: [f64; 6]) -> f64 { let a = { let b = x[0]; let c = { b * 2.0 }; c + b }; { const K: f64 = 3.0; fn g(v: f64) -> f64 { v * K } g(a) } }
    asserts: fn f(x: [f64; 6]) -> f64 { assert!(x.len() == 6, "six"); debug_assert!(1 + 1 == 2); assert_eq!(x.len(), 6); assert_ne!(1, 2); x[0] }
    let_else: fn f(x: [f64; 6]) -> f64 { let Some(a) = Some(x[0]) else { return 0.0 }; let None::<f64> = None else { panic!() }; a }
    let_chains: fn f(x: [f64; 6]) -> f64 { let o = Some(2usize); if let Some(n) = o && n > 1 && let Some(k) = Some(n + 1) { x[n] * x[k] } else { 0.0 } }
    question_mark: fn f(x: [f64; 6]) -> f64 { fn g(x: &[f64; 6], n: Option<usize>) -> Option<f64> { let n = n?; Some(x[n]) } g(&x, Some(2)).unwrap() + if g(&x, None).is_none() { 1.0 } else { 2.0 } }
    long_sums: fn f(x: [f64; 6]) -> f64 { let a = x[0];
        a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a
        +a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a
        +a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a
        +a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a+a }
}
