//! The problems: numbers from seeds.
//!
//! Masses on springs with all their modes or in a smooth shape; linear systems with eigenvalues
//! anywhere to the left or near the imaginary axis; orbits; masses on two rods; kinetics;
//! relaxation oscillators; Duffing's oscillators; predators and prey; rigid bodies; oscillators
//! that are pushed until a time, or under a force whose derivatives jump; masses on a stiff spring,
//! and such that fall onto one.

/// A problem: its equations by name, and its numbers.
pub struct Problem {
    pub family: &'static str,
    pub x0: Vec<f64>,
    pub p: Vec<f64>,
    pub t: f64,
}

/// Sebastiano Vigna's splitmix64.
struct Random(u64);

impl Random {
    fn new(family: &str, seed: u64) -> Self {
        let start = family.bytes().fold(seed, |sum, byte| sum.wrapping_mul(31).wrapping_add(byte.into()));
        let mut random = Self(start);
        random.next();
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Between two numbers,
    fn uniform(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// and so that the logarithm is.
    fn log_uniform(&mut self, a: f64, b: f64) -> f64 {
        10f64.powf(self.uniform(a, b))
    }

    fn one_of(&mut self, list: &[f64]) -> f64 {
        list[(self.next() % list.len() as u64) as usize]
    }
}

/// Their names.
pub const FAMILIES: [&str; 15] = [
    "springs",
    "modes",
    "linear",
    "imaginary",
    "orbit",
    "rods",
    "kinetics",
    "relaxation",
    "forced",
    "prey",
    "body",
    "pushed",
    "spring pendulum",
    "kinked",
    "contact",
];

/// One of a family.
pub fn problem(family: &'static str, seed: u64) -> Problem {
    let r = &mut Random::new(family, seed);
    let (x0, p, t) = match family {
        // All modes are there,
        "springs" => springs(r, 1.0),
        // or a smooth shape.
        "modes" => springs(r, 0.0),
        "linear" => linear(r, false),
        "imaginary" => linear(r, true),
        "orbit" => {
            let e = r.uniform(0.0, 0.9);
            let t = std::f64::consts::TAU * r.uniform(0.5, 8.0);
            (vec![1.0 - e, 0.0, 0.0, ((1.0 + e) / (1.0 - e)).sqrt()], vec![], t)
        }
        "rods" => {
            let (a, b) = (r.uniform(-1.2, 1.2), r.uniform(-1.2, 1.2));
            let (l, m) = (r.uniform(0.5, 2.0), r.log_uniform(-1.0, 1.0));
            let x1 = [a.sin(), -a.cos()];
            let x2 = [x1[0] + l * b.sin(), x1[1] - l * b.cos()];
            (vec![x1[0], x1[1], x2[0], x2[1], 0.0, 0.0, 0.0, 0.0], vec![1.0, m], r.uniform(1.0, 6.0))
        }
        "kinetics" => {
            let p = (0..8).map(|_| r.log_uniform(-2.0, 4.0)).collect();
            (vec![1.0, 0.0, 0.0, r.uniform(0.0, 1.0), 0.0], p, r.log_uniform(-1.0, 3.0))
        }
        "relaxation" => {
            let mu = r.log_uniform(-0.5, 3.5);
            (vec![2.0, 0.0], vec![mu], (1.6 * mu + 6.0) * r.uniform(0.5, 2.0))
        }
        "forced" => {
            let p = vec![
                r.one_of(&[0.0, 0.01, 0.1]),
                r.one_of(&[-1.0, 0.0, 1.0, 10.0]),
                r.log_uniform(-1.0, 1.0),
                r.uniform(0.0, 2.0),
                r.log_uniform(-1.0, 1.0),
            ];
            (vec![r.uniform(-1.0, 1.0), r.uniform(-1.0, 1.0)], p, r.uniform(5.0, 25.0))
        }
        "prey" => {
            let rates = vec![r.log_uniform(-0.7, 0.7), r.log_uniform(-0.7, 0.7)];
            (vec![r.log_uniform(-0.7, 0.7), r.log_uniform(-0.7, 0.7)], rates, r.uniform(5.0, 50.0))
        }
        "body" => {
            let (a, b) = (r.uniform(0.1, 3.0), r.uniform(0.1, 3.0));
            (
                vec![r.uniform(-1.0, 1.0), r.uniform(-1.0, 1.0), r.uniform(-1.0, 1.0)],
                vec![a, -b, (b - a) / (1.0 - a * b * 0.1).max(0.2)],
                r.uniform(10.0, 100.0),
            )
        }
        "pushed" => {
            let t = r.uniform(4.0, 12.0);
            let p = vec![
                r.log_uniform(-0.5, 2.0),
                r.one_of(&[0.0, 0.01, 0.3]),
                r.log_uniform(-1.0, 1.0),
                r.uniform(0.3, 0.9) * t,
            ];
            (vec![r.one_of(&[0.0, 1.0]), 0.0], p, t)
        }
        "kinked" => kinked(r),
        "contact" => {
            let p = vec![r.uniform(1.0, 10.0), r.log_uniform(1.0, 4.0), r.one_of(&[0.0, 1.0, 10.0])];
            (vec![r.uniform(0.1, 1.0), 0.0], p, r.uniform(0.5, 4.0))
        }
        _ => {
            let a = r.uniform(0.3, 1.6);
            let stretch = 1.0 + r.one_of(&[0.0, 1e-3, 1e-2]);
            (
                vec![stretch * a.sin(), -stretch * a.cos(), 0.0, 0.0],
                vec![r.log_uniform(2.0, 6.0)],
                r.uniform(1.0, 5.0),
            )
        }
    };
    Problem { family, x0, p, t }
}

/// One of `max(0, sin)`, its square and its cube.
fn kinked(r: &mut Random) -> (Vec<f64>, Vec<f64>, f64) {
    let mut p = vec![
        r.log_uniform(-1.0, 2.0),
        r.one_of(&[0.0, 0.01, 0.4]),
        r.log_uniform(-0.3, 0.7),
        r.uniform(0.0, 6.0),
    ];
    let kind = r.one_of(&[0.0, 1.0, 2.0]);
    p.extend((0..3).map(|k| if f64::from(k) == kind { 1.0 } else { 0.0 }));
    (vec![r.uniform(-1.0, 1.0), r.uniform(-1.0, 1.0)], p, r.uniform(3.0, 25.0))
}

fn springs(r: &mut Random, rough: f64) -> (Vec<f64>, Vec<f64>, f64) {
    let stiff = r.uniform(0.5, 4.0);
    let mut p: Vec<f64> = (0..10).map(|_| r.log_uniform(-0.5, 0.5)).collect();
    p.extend((0..10).map(|_| r.log_uniform(0.0, stiff)));
    p.push(r.one_of(&[0.0, 0.0, 1e-4, 1e-3]));
    p.push(r.one_of(&[0.0, 0.0, 1.0]));
    let t = r.uniform(2.0, 15.0);
    let size = r.log_uniform(-1.0, 0.3);
    let mut x0 = vec![0.0; 20];
    // Under a force on the last mass, and pushed.
    let soft: f64 = p[10..20].iter().map(|k| 1.0 / k).sum();
    let mut at = 0.0;
    for i in 0..10 {
        at += size / p[10 + i] / soft;
        x0[i] = at + rough * size * r.uniform(-0.5, 0.5);
    }
    (x0, p, t)
}

/// Eigenvalues of three pairs in a random basis.
fn linear(r: &mut Random, imaginary: bool) -> (Vec<f64>, Vec<f64>, f64) {
    let mut a = [[0.0; 6]; 6];
    for pair in 0..3 {
        let size = r.log_uniform(0.0, 4.0);
        let angle = if imaginary { r.one_of(&[0.0, 0.0, 1e-3, 1e-2]) } else { r.uniform(0.0, 1.57) };
        let (re, im) = (-size * angle.sin(), size * angle.cos());
        let i = 2 * pair;
        a[i][i] = re;
        a[i + 1][i + 1] = re;
        a[i][i + 1] = im;
        a[i + 1][i] = -im;
    }
    // By two reflections on each side.
    for _ in 0..2 {
        let mut v: Vec<f64> = (0..6).map(|_| r.uniform(-1.0, 1.0)).collect();
        let n = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        v.iter_mut().for_each(|v| *v /= n);
        for row in &mut a {
            let s: f64 = row.iter().zip(&v).map(|(a, v)| a * v).sum();
            row.iter_mut().zip(&v).for_each(|(a, v)| *a -= 2.0 * s * v);
        }
        let mut sums = [0.0; 6];
        for (row, v) in a.iter().zip(&v) {
            sums.iter_mut().zip(row).for_each(|(sum, a)| *sum += a * v);
        }
        for (row, v) in a.iter_mut().zip(&v) {
            row.iter_mut().zip(&sums).for_each(|(a, sum)| *a -= 2.0 * sum * v);
        }
    }
    let mut p: Vec<f64> = a.concat();
    p.extend((0..6).map(|_| r.uniform(-1.0, 1.0)));
    // On the smooth solution, or beside it.
    let off = r.one_of(&[0.0, 0.0, 1e-3, 1.0]);
    let x0 = (0..6).map(|_| off * r.uniform(-1.0, 1.0)).collect();
    (x0, p, r.uniform(1.0, 10.0))
}

impl Problem {
    /// Where its force is not smooth.
    pub fn discontinuity_times(&self) -> Vec<f64> {
        let p = &self.p;
        match self.family {
            "pushed" => vec![p[3]],
            "kinked" => {
                let first = (p[3] / std::f64::consts::PI).ceil() as usize;
                let times = (first..).map(|k| (k as f64 * std::f64::consts::PI - p[3]) / p[2]);
                times.take_while(|t| *t < self.t).filter(|t| *t > 0.0).collect()
            }
            _ => vec![],
        }
    }
}
