//! Patterns.

use super::same;

same! {
    slices: fn f(x: [f64; 6]) -> f64 {
        let [a, b, ..] = x; let [.., y, z] = x; let [first, middle @ .., last] = x; let [_, c, rest @ ..] = &x;
        a * b + y * z + first * last + middle[1] + c + rest[3] * middle.len() as f64 + rest.len() as f64
    }
    nested: fn f(x: [f64; 6]) -> f64 { let ((a, [b, c]), d) = ((x[0], [x[1], x[2]]), x[3]); let (e, .., g) = (x[4], 1, 2, x[5]); a * b + c * d - e * g }
    structs: fn f(x: [f64; 6]) -> f64 {
        struct P { a: f64, b: (f64, f64) } struct Q(P, f64);
        let q = Q(P { a: x[0], b: (x[1], x[2]) }, x[3]); let Q(P { a, b: (b, c) }, d) = q; let P { a: mut e, .. } = P { a: x[4], b: (0.0, 0.0) }; e += 1.0; a * b + c * d + e
    }
    by_reference: fn f(x: [f64; 6]) -> f64 {
        let mut t = (x[0], [x[1], x[2]]);
        { let (ref mut a, [b, _]) = t; *a += b; }
        { let (a, [_, b]) = &mut t; *a *= 2.0; *b = *a; }
        match &mut t { (a, [b, c]) => { *b += *a; *c -= 1.0; } }
        let ref r = t.0; *r + t.1[0] * t.1[1]
    }
    bindings: fn f(x: [f64; 6]) -> f64 { let n @ k = 3usize; let whole @ [a, ..] = x; match n { m @ 1..=4 => whole[m] * a, _ => 0.0 } }
    annotated: fn f(x: [f64; 6]) -> f64 { let (a, b): (f64, usize) = (x[0], 2); let c: [[f64; 2]; 1] = [[a, x[b]]]; c[0][1] * b as f64 }
    constants: fn f(x: [f64; 6]) -> f64 { const N: usize = 3; const m: usize = 4; let mut s = 0.0; for i in 0..6 { s += match i { N => x[0], m => x[1] * 2.0, usize::MAX => 0.0, _ => 1.0 }; } s }
    matched_mutation: fn f(x: [f64; 6]) -> f64 { let mut o = Some(x[0]); if let Some(v) = &mut o { *v += x[1]; } if let Some(ref mut v) = o { *v *= 2.0; } match o { Some(v) => v, None => 0.0 } }
    loops: fn f(x: [f64; 6]) -> f64 { let mut s = 0.0; for (i, [a, b]) in [(1usize, [x[0], x[1]]), (2, [x[2], x[3]])] { s += a * b * i as f64; } for &(i, v) in &[(0usize, 1.0), (3, 2.0)] { s += x[i] * v; } s }
    results: fn f(x: [f64; 6]) -> [f64; 6] {
        core::array::from_fn(|i| {
            let Ok(small) = u8::try_from(i as i32 * 100) else { return x[5] };
            let r = match i8::try_from(i as i32 * 50) { Ok(v) if v > 60 => 3.0, Ok(_) => 1.0, Err(_) => 2.0 };
            let m = matches!(usize::try_from(i as i32 - 3), Ok(1 | 2));
            let e = if let Err(_) = usize::try_from(i as i32 - 2) { 5.0 } else { 0.5 };
            if let Ok(j) = usize::try_from(i as i32 - 1) { x[j] * r + e } else { small as f64 + m as u8 as f64 }
        })
    }
}
