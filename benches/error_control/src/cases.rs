//! What is solved: random problems, the test set, kinks and jumps.

use crate::models::knots;
use crate::problems;
use reference_data::Record;
use std::f64::consts::PI;

/// A problem.
#[derive(Clone)]
pub struct Case {
    pub x0: Vec<f64>,
    pub p: Vec<f64>,
    pub t: f64,
    /// Where its force is not smooth.
    pub breaks: Vec<f64>,
    /// The states at the end, if they are known; else a method of order 18 finds them.
    pub expected: Option<Vec<f64>>,
    /// The absolute tolerance over the relative one.
    pub atol: f64,
}

impl Case {
    fn new(x0: Vec<f64>, p: Vec<f64>, t: f64) -> Self {
        Self { x0, p, t, breaks: vec![], expected: None, atol: 1.0 }
    }

    fn ends_at(self, expected: Vec<f64>) -> Self {
        Self { expected: Some(expected), ..self }
    }
}

/// One of a random family, by the parameters of the few models.
pub fn random(family: &'static str, seed: u64) -> Case {
    let problem = problems::problem(family, seed);
    let breaks = problem.discontinuity_times();
    let q = &problem.p;
    let mut x0 = problem.x0;
    let p = match family {
        "orbit" => vec![0.0, 1.0, 0.0],
        "spring pendulum" => vec![q[0], 0.0, 9.81],
        "relaxation" => vec![1.0, 0.0, 0.0, q[0], 0.0, 0.0],
        "forced" => vec![q[1], q[0], q[2], 0.0, q[3], q[4]],
        "pushed" => vec![q[0] * q[0], 2.0 * q[1] * q[0], 0.0, 0.0, 0.0, 0.0, 0.0, q[2], q[3], 0.0, 0.0],
        "kinked" => {
            vec![q[0], q[1], q[2], q[3], q[4], q[5], q[6], 0.0, f64::MAX, 0.0, 0.0]
        }
        "contact" => vec![q[0], q[1], q[2], 0.0],
        "kinetics" => {
            let mut of = Quadratic::default();
            // A → B ⇌ C, B + C → D, D ⇌ E, 2 E → A, A + D → C + B.
            for (i, j, sign) in [(0, 0, -1.0), (1, 0, 1.0)] {
                of.linear(i, j, sign * q[0]);
            }
            for (i, sign) in [(1, -1.0), (2, 1.0)] {
                of.linear(i, 1, sign * q[1]);
                of.linear(i, 2, -sign * q[2]);
            }
            for (i, sign) in [(1, -1.0), (2, -1.0), (3, 1.0)] {
                of.square(i, 1, 2, sign * q[3]);
            }
            for (i, sign) in [(3, -1.0), (4, 1.0)] {
                of.linear(i, 3, sign * q[4]);
                of.linear(i, 4, -sign * q[5]);
            }
            of.square(0, 4, 4, q[6]);
            of.square(4, 4, 4, -2.0 * q[6]);
            for (i, sign) in [(0, -1.0), (2, 1.0), (3, -1.0), (4, 1.0)] {
                of.square(i, 0, 3, sign * q[7]);
            }
            of.p
        }
        "prey" => {
            let mut of = Quadratic::default();
            of.linear(0, 0, q[0]);
            of.square(0, 0, 1, -q[0]);
            of.linear(1, 1, -q[1]);
            of.square(1, 0, 1, q[1]);
            x0.resize(5, 0.0);
            of.p
        }
        "body" => {
            let mut of = Quadratic::default();
            of.square(0, 1, 2, q[0]);
            of.square(1, 0, 2, q[1]);
            of.square(2, 0, 1, q[2]);
            x0.resize(5, 0.0);
            of.p
        }
        _ => problem.p.clone(),
    };
    Case { breaks, ..Case::new(x0, p, problem.t) }
}

/// Coefficients of a quadratic system.
struct Quadratic {
    p: Vec<f64>,
}

impl Default for Quadratic {
    fn default() -> Self {
        Self { p: vec![0.0; 105] }
    }
}

impl Quadratic {
    fn linear(&mut self, i: usize, j: usize, value: f64) {
        self.p[5 + 5 * i + j] += value;
    }

    fn square(&mut self, i: usize, j: usize, k: usize, value: f64) {
        let first = [0, 5, 9, 12, 14][j];
        self.p[30 + 15 * i + first + k - j] += value;
    }
}

/// One of the test set, at its first end.
pub fn of_set(file: &str, name: &str, states: usize, atol: f64) -> Case {
    let set = Record::load(file).expect("the reference is there");
    let record = set.record(name).expect("a problem");
    let mut x0 = record.list("x0").expect("start values");
    x0.truncate(states);
    let p = record.list("p").unwrap_or_default();
    let (t, y) = match record.records("ends") {
        Ok(ends) => (ends[0].number("t").expect("a time"), ends[0].list("y").expect("values")),
        Err(_) => (record.number("t").expect("a time"), record.list("y").expect("values")),
    };
    Case { atol, ..Case::new(x0, p, t).ends_at(y[..states].to_vec()) }
}

/// Quadratic problems of the stiff DETEST set (W. H. Enright, T. E. Hull, B. Lindberg, BIT 15
/// (1975)): A1, A3, B1, C1 to C5, D1 to D4, D6, E3, F2; Robertson's reactions and the Oregonator.
pub fn quadratic(number: u64) -> Case {
    let mut of = Quadratic::default();
    let ones = vec![1.0; 4];
    let (x0, t) = match number {
        0 => {
            for (i, rate) in [0.5, 1.0, 100.0, 90.0].into_iter().enumerate() {
                of.linear(i, i, -rate);
            }
            (ones, 20.0)
        }
        1 => {
            let rows = [
                [-1e4, 100.0, -10.0, 1.0],
                [0.0, -1e3, 10.0, -10.0],
                [0.0, 0.0, -1.0, 10.0],
                [0.0, 0.0, 0.0, -0.1],
            ];
            for (i, row) in rows.into_iter().enumerate() {
                for (j, value) in row.into_iter().enumerate() {
                    of.linear(i, j, value);
                }
            }
            (ones, 20.0)
        }
        2 => {
            for (i, j, value) in [
                (0, 0, -1.0),
                (0, 1, 1.0),
                (1, 0, -100.0),
                (1, 1, -1.0),
                (2, 2, -100.0),
                (2, 3, 1.0),
                (3, 2, -1e4),
                (3, 3, -100.0),
            ] {
                of.linear(i, j, value);
            }
            (vec![1.0, 0.0, 1.0, 0.0], 20.0)
        }
        3 => {
            for (i, rate) in [1.0, 10.0, 40.0, 100.0].into_iter().enumerate() {
                of.linear(i, i, -rate);
            }
            for (i, from, factor) in [(0, 1, 1.0), (1, 2, 10.0), (2, 3, 40.0)] {
                for j in from..4 {
                    of.square(i, j, j, factor);
                }
            }
            of.p[3] = 2.0;
            (ones, 20.0)
        }
        4..=7 => {
            let beta = [0.1, 1.0, 10.0, 20.0][number as usize - 4];
            for (i, rate) in [1.0, 10.0, 40.0, 100.0].into_iter().enumerate() {
                of.linear(i, i, -rate);
            }
            of.p[0] = 2.0;
            for (i, factor) in [(1, 1.0), (2, 4.0), (3, 10.0)] {
                for j in 0..i {
                    of.square(i, j, j, factor * beta);
                }
            }
            (ones, 20.0)
        }
        8 => {
            of.linear(0, 0, -0.2);
            of.linear(0, 1, 0.2);
            of.linear(1, 0, 10.0);
            of.linear(1, 1, -60.0);
            of.linear(1, 2, 0.125);
            of.square(1, 1, 2, 0.125);
            of.p[2] = 1.0;
            (vec![0.0; 4], 400.0)
        }
        9 => {
            of.linear(0, 0, -0.04);
            of.square(0, 1, 2, 0.01);
            of.linear(1, 0, 400.0);
            of.square(1, 1, 2, -100.0);
            of.square(1, 1, 1, -3000.0);
            of.square(2, 1, 1, 30.0);
            (vec![1.0, 0.0, 0.0, 0.0], 40.0)
        }
        10 => {
            of.linear(0, 2, 1.0);
            of.square(0, 0, 1, -100.0);
            of.linear(1, 2, 1.0);
            of.linear(1, 3, 2.0);
            of.square(1, 0, 1, -100.0);
            of.square(1, 1, 1, -2e4);
            of.linear(2, 2, -1.0);
            of.square(2, 0, 1, 100.0);
            of.linear(3, 3, -1.0);
            of.square(3, 1, 1, 1e4);
            (vec![1.0, 1.0, 0.0, 0.0], 20.0)
        }
        11 => {
            of.linear(0, 0, -0.013);
            of.square(0, 0, 2, -1000.0);
            of.square(1, 1, 2, -2500.0);
            of.linear(2, 0, -0.013);
            of.square(2, 0, 2, -1000.0);
            of.square(2, 1, 2, -2500.0);
            (vec![1.0, 1.0, 0.0, 0.0], 50.0)
        }
        12 => {
            of.linear(0, 0, -1.0);
            of.linear(0, 2, 1e8);
            of.square(0, 0, 2, -1e8);
            of.linear(1, 1, -10.0);
            of.linear(1, 2, 3e7);
            of.square(1, 1, 2, -3e7);
            of.linear(2, 0, 1.0);
            of.linear(2, 1, 10.0);
            of.linear(2, 2, -1.3e8);
            of.square(2, 0, 2, 1e8);
            of.square(2, 1, 2, 3e7);
            (vec![1.0, 0.0, 0.0, 0.0], 1.0)
        }
        13 => {
            of.linear(0, 0, -55.0);
            of.square(0, 0, 2, -1.0);
            of.linear(0, 1, 65.0);
            of.linear(1, 0, 0.0785);
            of.linear(1, 1, -0.0785);
            of.linear(2, 0, 0.1);
            (vec![1.0, 1.0, 0.0, 0.0], 50.0)
        }
        15 => {
            for (i, j, value) in [(0, 0, -0.04), (1, 0, 0.04)] {
                of.linear(i, j, value);
            }
            for (i, value) in [(0, 1e4), (1, -1e4)] {
                of.square(i, 1, 2, value);
            }
            of.square(1, 1, 1, -3e7);
            of.square(2, 1, 1, 3e7);
            (vec![1.0, 0.0, 0.0], 1e4)
        }
        16 => {
            of.linear(0, 0, 77.27);
            of.linear(0, 1, 77.27);
            of.square(0, 0, 0, -77.27 * 8.375e-6);
            of.square(0, 0, 1, -77.27);
            of.linear(1, 1, -1.0 / 77.27);
            of.square(1, 0, 1, -1.0 / 77.27);
            of.linear(1, 2, 1.0 / 77.27);
            of.linear(2, 0, 0.161);
            of.linear(2, 2, -0.161);
            (vec![1.0, 2.0, 3.0], 30.0)
        }
        _ => {
            of.linear(0, 0, -1.0);
            of.square(0, 0, 1, -1.0);
            of.linear(0, 1, 294.0);
            of.linear(1, 0, 1.0 / 98.0);
            of.square(1, 0, 1, -1.0 / 98.0);
            of.linear(1, 1, -3.0);
            (vec![1.0, 0.0, 0.0, 0.0], 240.0)
        }
    };
    let mut x0: Vec<f64> = x0;
    x0.resize(5, 0.0);
    Case::new(x0, of.p, t)
}

/// Between a stiff and a soft spring, from `x = 0`.
pub fn two_springs(number: u64) -> Case {
    let (v, t) = (1.0 + 0.1 * number as f64, 5.0 + 0.37 * number as f64);
    let (stiff, soft) = ([5.0, 30.0][number as usize % 2], 2.0);
    let (right, left) = (PI / stiff, PI / soft);
    let rest = t.rem_euclid(right + left);
    let (sign, omega, rest): (f64, f64, f64) =
        if rest < right { (1.0, stiff, rest) } else { (-1.0, soft, rest - right) };
    let (sin, cos) = (omega * rest).sin_cos();
    let end = vec![sign * v * sin / omega, sign * v * cos];
    Case::new(vec![0.0, v], vec![0.0, soft * soft - stiff * stiff, 0.0, stiff * stiff], t).ends_at(end)
}

/// From rest: half a turn about the friction, half a turn about its negative.
pub fn rubbed(number: u64) -> Case {
    let (x0, end, force) = (5.0 + 0.1 * number as f64, 7.0 + 0.7 * number as f64, 0.1 + 0.01 * number as f64);
    let half = (end / PI).floor();
    let sign = if half % 2.0 == 0.0 { 1.0 } else { -1.0 };
    let radius = x0 - 2.0 * force * half - force;
    let phase = end - half * PI;
    let y = vec![sign * (force + radius * phase.cos()), -sign * radius * phase.sin()];
    Case::new(vec![x0, 0.0], vec![force], end).ends_at(y)
}

/// `x` decays to `z`, which jumps.
pub fn switched(number: u64) -> Case {
    let (x0, end) = (0.2 * number as f64, 6.0 + 0.31 * number as f64);
    let (mut x, mut t, mut k) = (x0, 0.0, 1);
    while t < end {
        let z = if k % 2 == 1 { 2.0 } else { 0.2 };
        let next = end.min((f64::from(k) * PI - 0.2) / 1.7);
        x = z + (x - z) * (t - next).exp();
        (t, k) = (next, k + 1);
    }
    Case::new(vec![x0], vec![], end).ends_at(vec![x])
}

/// Pulses of each width.
pub fn converter(number: u64) -> Case {
    let (part, load) = (0.1 + 0.04 * number as f64, 1.5 - 0.05 * number as f64);
    let t = 5.3 + 0.71 * number as f64;
    let breaks = (0..20).flat_map(|k| [k as f64, k as f64 + part]).filter(|b| *b > 0.0 && *b < t);
    Case { breaks: breaks.collect(), ..Case::new(vec![0.0, 0.0], vec![part, load], t) }
}

/// Under a spline.
pub fn splined(number: u64) -> Case {
    let n = number as f64;
    let t = 5.0 + 0.8 * n;
    let breaks = knots().into_iter().filter(|b| *b > 0.0 && *b < t).collect();
    Case {
        breaks,
        ..Case::new(
            vec![1.0, -0.5 + 0.1 * n],
            vec![1.0 + n * n, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f64::MAX, 1.0, 1.0],
            t,
        )
    }
}
