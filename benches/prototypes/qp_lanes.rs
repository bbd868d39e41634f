//! The linear algebra of an interior point's iteration, a factorisation and two solves, over K
//! problems side by side: what record 0119 measures. Copied to `benches/src/bin` it runs by
//!
//! ```text
//! RUSTFLAGS="-C target-cpu=native -C target-feature=-prefer-256-bit" \
//!     cargo run --release --manifest-path benches/Cargo.toml --bin qp_lanes
//! ```
use core::ops::{Add, Div, Mul, Neg, Sub};
trait Num:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    const W: usize;
    fn s(a: f64) -> Self;
    fn fma(self, a: Self, b: Self) -> Self; // self - a b
    fn sqrt(self) -> Self;
    fn lane(self, l: usize) -> f64;
    fn set(&mut self, l: usize, v: f64);
}
impl Num for f64 {
    const W: usize = 1;
    #[inline(always)]
    fn s(a: f64) -> f64 {
        a
    }
    #[inline(always)]
    fn fma(self, a: f64, b: f64) -> f64 {
        (-a).mul_add(b, self)
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    fn lane(self, _: usize) -> f64 {
        self
    }
    fn set(&mut self, _: usize, v: f64) {
        *self = v
    }
}
macro_rules! lanes {
    ($name:ident, $w:literal, $align:literal) => {
        #[derive(Clone, Copy)]
        #[repr(C, align($align))]
        struct $name([f64; $w]);
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                let mut r = self;
                for i in 0..$w {
                    r.0[i] += o.0[i]
                }
                r
            }
        }
        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                let mut r = self;
                for i in 0..$w {
                    r.0[i] -= o.0[i]
                }
                r
            }
        }
        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, o: Self) -> Self {
                let mut r = self;
                for i in 0..$w {
                    r.0[i] *= o.0[i]
                }
                r
            }
        }
        impl Div for $name {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: Self) -> Self {
                let mut r = self;
                for i in 0..$w {
                    r.0[i] /= o.0[i]
                }
                r
            }
        }
        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let mut r = self;
                for i in 0..$w {
                    r.0[i] = -r.0[i]
                }
                r
            }
        }
        impl Num for $name {
            const W: usize = $w;
            #[inline(always)]
            fn s(a: f64) -> Self {
                $name([a; $w])
            }
            #[inline(always)]
            fn fma(self, a: Self, b: Self) -> Self {
                let mut r = self;
                for i in 0..$w {
                    r.0[i] = (-a.0[i]).mul_add(b.0[i], r.0[i])
                }
                r
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                let mut r = self;
                for i in 0..$w {
                    r.0[i] = r.0[i].sqrt()
                }
                r
            }
            fn lane(self, l: usize) -> f64 {
                self.0[l]
            }
            fn set(&mut self, l: usize, v: f64) {
                self.0[l] = v
            }
        }
    };
}
lanes!(L4, 4, 32);
lanes!(L8, 8, 64);

/// target(r × c) −= X(r × d) Y(c × d)ᵀ, columns ld apart; tiles of R × C in registers.
#[inline(always)]
fn tile<T: Num, const R: usize, const C: usize>(
    t: &mut [T],
    tl: usize,
    x: &[T],
    xl: usize,
    y: &[T],
    yl: usize,
    d: usize,
) {
    let mut s = [[T::s(0.0); R]; C];
    for (c, s) in s.iter_mut().enumerate() {
        if let Some(v) = t[c * tl..].first_chunk::<R>() {
            *s = *v;
        }
    }
    for (x, y) in x.chunks(xl).zip(y.chunks(yl)).take(d) {
        let (Some(x), Some(y)) = (x.first_chunk::<R>(), y.first_chunk::<C>()) else { return };
        for (s, &y) in s.iter_mut().zip(y) {
            for (s, &x) in s.iter_mut().zip(x) {
                *s = s.fma(x, y);
            }
        }
    }
    for (c, s) in s.iter().enumerate() {
        if let Some(v) = t[c * tl..].first_chunk_mut::<R>() {
            *v = *s;
        }
    }
}
#[inline(always)]
fn product<T: Num>(
    t: &mut [T],
    tl: usize,
    x: &[T],
    xl: usize,
    y: &[T],
    yl: usize,
    (r, c, d): (usize, usize, usize),
    lower: bool,
) {
    let mut j = 0;
    while j < c {
        let mut i = if lower { j / 4 * 4 } else { 0 };
        while i < r {
            tile::<T, 4, 4>(&mut t[j * tl + i..], tl, &x[i..], xl, &y[j..], yl, d);
            i += 4;
        }
        j += 4;
    }
}
struct P<T> {
    n: usize,
    ab: Vec<T>,
    h: Vec<T>,
    w: Vec<T>,
    g: Vec<T>,
    r: Vec<T>,
    k: Vec<T>,
    inv: Vec<T>,
    y: Vec<T>,
    v: Vec<T>,
}
const NX: usize = 8;
const NU: usize = 4;
const M: usize = 12;
fn problem<T: Num>(seed: u64) -> P<T> {
    let n = 20;
    let mut st = seed;
    let mut rnd = || {
        let mut t = T::s(0.0);
        for l in 0..T::W {
            st = st.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            t.set(l, (st >> 33) as f64 / (1u64 << 31) as f64 - 0.5)
        }
        t
    };
    let ab = (0..n)
        .flat_map(|_| (0..M * NX).map(|i| (i % M, i / M)).collect::<Vec<_>>())
        .map(|(i, j)| if i == j { T::s(0.9) + T::s(0.2) * rnd() } else { T::s(0.3) * rnd() })
        .collect();
    let h = (0..=n)
        .flat_map(|_| (0..M * M))
        .map(|i| if i % M == i / M { T::s(1.0) } else { T::s(0.0) })
        .collect();
    P {
        n,
        ab,
        h,
        w: vec![T::s(0.1); M * (n + 1)],
        g: (0..M * (n + 1)).map(|_| rnd()).collect(),
        r: (0..NX * n).map(|_| rnd()).collect(),
        k: vec![T::s(0.0); M * NU * n],
        inv: vec![T::s(0.0); NU * n],
        y: vec![T::s(0.0); NU * n],
        v: vec![T::s(0.0); M * (n + 1)],
    }
}
#[inline(never)]
fn solve<T: Num>(p: &mut P<T>, factor: bool) {
    let P { n, ab, h, w, g, r, k, inv, y, v } = p;
    let mut pp = [T::s(0.0); NX * NX];
    let mut wm = [T::s(0.0); M * NX];
    let mut m = [T::s(0.0); M * M];
    if factor {
        for j in 0..NX {
            for i in 0..NX {
                pp[j * NX + i] = h[*n * M * M + j * M + i]
            }
            pp[j * NX + j] = pp[j * NX + j] + w[*n * M + j];
        }
    }
    let mut q = [T::s(0.0); NX];
    q.copy_from_slice(&g[*n * M..*n * M + NX]);
    for s in (0..*n).rev() {
        let ab = &ab[s * M * NX..][..M * NX];
        let kk = &mut k[s * M * NU..][..M * NU];
        let inv = &mut inv[s * NU..][..NU];
        // q = -(p + P r)
        let mut mq = [T::s(0.0); NX];
        for i in 0..NX {
            mq[i] = -q[i];
        }
        if factor {
            for j in 0..NX {
                for i in 0..NX {
                    mq[i] = mq[i].fma(pp[j * NX + i], r[s * NX + j]);
                }
            }
        }
        if factor {
            wm = [T::s(0.0); M * NX];
            product(&mut wm, M, ab, M, &pp, NX, (M, NX, NX), false);
            m.copy_from_slice(&h[s * M * M..][..M * M]);
            product(&mut m, M, ab, M, &wm, M, (M, M, NX), true);
            for i in 0..M {
                m[i * M + i] = m[i * M + i] + w[s * M + i];
            }
            // rows of controls → columns
            for j in 0..NU {
                for i in 0..NX {
                    kk[j * M + i] = m[i * M + NX + j];
                }
                for i in NX + j..M {
                    kk[j * M + i] = m[(NX + j) * M + i];
                }
            }
            for i in 0..NU {
                for j in 0..i {
                    let f = kk[j * M + NX + i];
                    for row in 0..M {
                        kk[i * M + row] = kk[i * M + row].fma(kk[j * M + row], f);
                    }
                }
                let size = T::s(1.0) / kk[i * M + NX + i].sqrt();
                inv[i] = size;
                for row in 0..M {
                    kk[i * M + row] = kk[i * M + row] * size;
                }
            }
            for j in 0..NX {
                for i in 0..NX {
                    pp[j * NX + i] = m[j * M + i];
                }
            }
            product(&mut pp, NX, kk, M, kk, M, (NX, NX, NU), true);
            for j in 0..NX {
                for i in j + 1..NX {
                    pp[i * NX + j] = pp[j * NX + i];
                }
            }
        }
        let mut gg = [T::s(0.0); M];
        gg.copy_from_slice(&g[s * M..][..M]);
        for j in 0..NX {
            for i in 0..M {
                gg[i] = gg[i].fma(ab[j * M + i], mq[j]);
            }
        }
        for i in 0..NU {
            let f = gg[NX + i] * inv[i];
            y[s * NU + i] = f;
            for row in 0..M {
                gg[row] = gg[row].fma(kk[i * M + row], f);
            }
        }
        q.copy_from_slice(&gg[..NX]);
    }
    for i in 0..NX {
        v[i] = T::s(0.0);
    }
    for s in 0..*n {
        let ab = &ab[s * M * NX..][..M * NX];
        let kk = &k[s * M * NU..][..M * NU];
        let inv = &inv[s * NU..][..NU];
        let (here, next) = v.split_at_mut((s + 1) * M);
        let here = &mut here[s * M..];
        let mut u = [T::s(0.0); NU];
        for j in 0..NU {
            let mut t = -y[s * NU + j];
            for i in 0..NX {
                t = t.fma(kk[j * M + i], here[i]);
            }
            u[j] = t;
        }
        for i in (0..NU).rev() {
            let mut t = u[i];
            for j in i + 1..NU {
                t = t.fma(kk[i * M + NX + j], u[j]);
            }
            u[i] = t * inv[i];
        }
        here[NX..M].copy_from_slice(&u);
        for j in 0..NX {
            let mut t = -r[s * NX + j];
            for i in 0..M {
                t = t.fma(ab[j * M + i], here[i]);
            }
            next[j] = -t;
        }
    }
}
fn time<T: Num>(name: &str) {
    let groups = 128 / T::W;
    let mut ps: Vec<P<T>> = (0..groups as u64).map(problem).collect();
    let (mut best, mut bf) = (f64::INFINITY, f64::INFINITY);
    // A group stays in the cache until it has converged: eight iterations.
    for _ in 0..40 {
        let (mut f, mut all) = (0.0, 0.0);
        for p in &mut ps {
            let t = cpu_time::ThreadTime::now();
            for _ in 0..8 {
                solve(p, true);
            }
            f += t.elapsed().as_secs_f64() / 8.0;
            for _ in 0..8 {
                solve(p, false);
            }
            all += t.elapsed().as_secs_f64() / 8.0;
        }
        bf = bf.min(f);
        best = best.min(all);
    }
    let sum: f64 = (0..T::W).map(|l| ps[0].v[5 * M + 9].lane(l)).sum();
    println!(
        "{name}: factor+solve {:.2} us, +second solve {:.2} us a problem; check {sum:.6}",
        bf * 1e6 / 128.0,
        best * 1e6 / 128.0
    );
}
fn main() {
    time::<f64>("f64");
    time::<L4>("f64x4");
    time::<L8>("f64x8");
}
