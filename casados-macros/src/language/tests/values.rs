//! Numbers, arrays, tuples, structs.

use super::same;

same! {
    order_of_sums: fn f(x: [f64; 6]) -> f64 { x[0] + x[1] + x[2] * x[3] - x[4] / x[5] - -x[0] }
    parentheses: fn f(x: [f64; 6]) -> [f64; 2] { [x[0] + (x[1] + x[2]), (x[0] - x[1]) * (x[2] - (x[3] - x[4]))] }
    constants: fn f(x: [f64; 6]) -> f64 {
        const A: f64 = 2.0; const B: f64 = A * 3.0; static C: f64 = 1e-3; const N: usize = 2 + 1;
        A * x[0] + B * x[N] + C * x[N - 1]
    }
    lower_case_constants: fn f(x: [f64; 6]) -> f64 { const m: f64 = 0.1; const l: f64 = 0.8; m * l * x[0] }
    shadowing: fn f(x: [f64; 6]) -> f64 {
        let a = x[0]; let g = |b: f64| a * b; let a = x[1]; let a = a + g(a); g(a) + a
    }
    nested_arrays: fn f(x: [f64; 6]) -> [[f64; 2]; 3] {
        let mut m = [[0.0; 2]; 3];
        for i in 0..3 { for j in 0..2 { m[i][j] = x[i * 2 + j] * (i + 2 * j) as f64; } }
        m[1][0] += m[0][1]; m[2] = m[1]; m
    }
    tuples: fn f(x: [f64; 6]) -> (f64, f64) { let t = (x[0], (x[1], x[2])); let mut s = t; s.1.0 = 3.0 * t.0; (s.1.0 + t.1.1, s.0) }
    structs: fn f(x: [f64; 6]) -> f64 {
        #[derive(Clone, Copy)] struct P { a: f64, b: [f64; 2] }
        #[derive(Clone, Copy)] struct Q(f64, P);
        let p = P { a: x[0], b: [x[1], x[2]] };
        let mut q = Q(x[3], P { a: x[4], ..p });
        q.1.b[0] = q.0 * q.1.a; q.1.b[1] *= 2.0;
        q.1.b[0] + p.b[0] * q.1.b[1]
    }
    methods_of_structs: fn f(x: [f64; 6]) -> [f64; 3] {
        #[derive(Clone, Copy)] struct V { x: f64, y: f64 }
        impl V {
            const UNIT: V = V { x: 1.0, y: 0.0 };
            fn new(x: f64, y: f64) -> Self { Self { x, y } }
            fn dot(self, other: V) -> f64 { self.x * other.x + self.y * other.y }
            fn scale(&mut self, by: f64) -> &mut Self { self.x *= by; self.y *= by; self }
        }
        impl core::ops::Add for V { type Output = V; fn add(self, o: V) -> V { V::new(self.x + o.x, self.y + o.y) } }
        impl core::ops::Mul<V> for f64 { type Output = V; fn mul(self, o: V) -> V { V::new(self * o.x, self * o.y) } }
        impl core::ops::Mul<f64> for V { type Output = V; fn mul(self, o: f64) -> V { V::new(self.x * o, self.y * o) } }
        impl core::ops::AddAssign for V { fn add_assign(&mut self, o: V) { self.x += o.x; self.y += o.y; } }
        impl core::ops::Neg for V { type Output = V; fn neg(self) -> V { V { x: -self.x, y: -self.y } } }
        impl core::ops::Index<usize> for V { type Output = f64; fn index(&self, i: usize) -> &f64 { if i == 0 { &self.x } else { &self.y } } }
        impl core::ops::IndexMut<usize> for V { fn index_mut(&mut self, i: usize) -> &mut f64 { if i == 0 { &mut self.x } else { &mut self.y } } }
        let a = V::new(x[0], x[1]); let mut b = V { x: x[2], y: x[3] };
        b.scale(x[4]).scale(2.0);
        b += a * 3.0 + 2.0 * -b;
        b[1] *= 0.5; b[0] = b[1] - b[0];
        [V::dot(a, b), (a + V::UNIT).dot(b), b[0]]
    }
    traits: fn f(x: [f64; 6]) -> f64 {
        trait Shape { const SIDES: usize; fn area(&self) -> f64; fn twice(&self) -> f64 { 2.0 * self.area() + Self::SIDES as f64 } }
        struct Square(f64); struct Disc { r: f64 }
        impl Shape for Square { const SIDES: usize = 4; fn area(&self) -> f64 { self.0 * self.0 } }
        impl Shape for Disc { const SIDES: usize = 0; fn area(&self) -> f64 { 3.0 * self.r * self.r } fn twice(&self) -> f64 { self.area() } }
        fn total<S: Shape, T: Shape>(s: &S, t: &T) -> f64 { s.twice() + t.twice() * S::SIDES as f64 }
        total(&Square(x[0]), &Disc { r: x[1] }) + total(&Disc { r: x[2] }, &Square(x[3])) + <Square as Shape>::SIDES as f64
    }
    traits_on_numbers: fn f(x: [f64; 6]) -> f64 {
        trait Square { fn square(self) -> Self; }
        impl Square for f64 { fn square(self) -> f64 { self * self } }
        x[0].square() + Square::square(x[1]) - (x[2] + x[3]).square()
    }
    generic_structs: fn f(x: [f64; 6]) -> f64 {
        #[derive(Clone, Copy)] struct P<const N: usize>([f64; N]);
        impl<const N: usize> P<N> {
            const LEN: usize = N;
            fn filled(value: f64) -> Self { P([value; N]) }
            fn first(&self) -> f64 { self.0[N - 1] * Self::LEN as f64 }
        }
        let a = P([x[0], x[1], x[2]]); let b: P<2> = P::filled(x[3]); let c = P::<4>::filled(x[4]);
        a.first() + b.first() * c.first() + P::<5>::LEN as f64
    }
    enums: fn f(x: [f64; 6]) -> f64 {
        #[derive(Clone, Copy, PartialEq)] enum Law { Linear, Power(i32), Both { a: f64, b: f64 } }
        use Law::*;
        fn force(law: Law, s: f64) -> f64 {
            match law { Law::Linear => s, Law::Power(n) if n > 2 => s * s * s, Power(_) => s * s, Law::Both { a, b } => a * s + b }
        }
        let mut sum = 0.0;
        for law in [Linear, Power(2), Law::Power(3), Both { a: x[1], b: x[2] }] { sum += force(law, x[0]); if law == Linear { sum *= 2.0; } }
        sum
    }
    discriminants: fn f(x: [f64; 6]) -> f64 { enum E { A, B = 3, C } x[E::A as usize] + x[E::B as usize] * x[E::C as usize] }
    integers: fn f(x: [f64; 6]) -> f64 {
        let n: usize = 7; let k = n / 2 - 1; let s = -7i32; let m = (s % 4) as i8; let w = 300i32 as u8; let b = !0u8 >> 4;
        let h = (1 << 3) ^ 5 | 2 & 7;
        x[k] * s as f64 + m as f64 * x[(n % 4)] + w as f64 + b as f64 + h as f64 + (2.9f64 as i32) as f64 + (-1i32 as u32 >> 30) as f64
    }
    integer_wrap: fn f(x: [f64; 6]) -> f64 { (-129i32 as i8) as f64 + (511u16 as i8) as f64 + (u64::MAX as f64) * x[0] + true as u8 as f64 + (-1.5f64 as u8) as f64 }
    literals: fn f(x: [f64; 6]) -> f64 { 1f64 + 2.0_f64 * x[0] + 1_000.5e-1 + 0x1F as f64 + 1e3 + 3. }
    type_aliases: fn f(x: [f64; 6]) -> [f64; 2] { type Pair = [f64; 2]; type Of<const N: usize> = [f64; N]; let a: Pair = [x[0]; 2]; let b: Of<2> = [x[1], a[0]]; b }
    slices: fn f(x: [f64; 6]) -> f64 {
        fn sum(s: &[f64]) -> f64 { let mut t = 0.0; for v in s { t += v; } t }
        let mut y = x; { let part = &mut y[1..4]; part[0] = 2.0; part[2] *= 3.0; let inner = &mut part[1..=2]; inner[0] -= 1.0; }
        sum(&y[..2]) * sum(&y[2..]) + sum(&x[1..=4]) + y[3] + sum(&y)
    }
    copies: fn f(x: [f64; 6]) -> [f64; 6] { let mut a = x; let b = a; a[0] = b[1]; let mut c = [a, b]; c[1][2] = 9.0; a[5] = c[1][2] + c[0][2] + b[2]; a }
    modules: fn f(x: [f64; 6]) -> f64 {
        mod params { pub const K: f64 = 2.5; pub fn g(a: f64) -> f64 { K * helper(a) } fn helper(a: f64) -> f64 { a + 1.0 } }
        use params::g as gain;
        params::K * x[0] + params::g(x[1]) * gain(x[2])
    }
}
