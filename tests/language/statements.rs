//! Patterns, assignments, loops, branches, functions, closures, structs and enums in a body.

use crate::{same_bits, subarray};
use casados::{dae, ode};

#[dae]
fn patterns(xdot: [f64; 4], mut x: [f64; 4], u: [f64; 2], z: f64, t: f64) -> ([f64; 4], f64) {
    let [first, .., last] = x;
    let [_, middle @ .., _] = x;
    let (a, (b, c)) = (first, (middle[0], middle[1]));
    let s @ [u0, u1] = u;
    x[1] += a * b;
    x[2] -= last / (2.0 + c * c);
    x[3] *= s[0] - u1;
    x[0] = -x[0];
    let shadow = u0;
    let shadow = shadow * z + t;
    let late;
    if true {
        late = shadow * 2.0;
    } else {
        late = 0.0;
    }
    let &[p, q, _, _] = &x;
    (
        [
            xdot[0] - p,
            xdot[1] - q,
            xdot[2] - x[2] + late,
            xdot[3] - {
                let y = x[3];
                y * y
            },
        ],
        z - u0 * a,
    )
}

#[dae]
fn loops(xdot: [f64; 6], x: [f64; 6], u: [[f64; 2]; 3]) -> [f64; 6] {
    const N: usize = 6;
    const WEIGHTS: [f64; N] = [0.5, 0.25, 2.0, -1.0, 3.0, 1.5];
    let mut f = xdot;
    for i in 0..N {
        f[i] -= WEIGHTS[i] * x[i];
    }
    for i in (0..N).rev().step_by(2) {
        f[i] += x[N - 1 - i] * u[i / 2][i % 2];
    }
    for (i, row) in u.iter().enumerate() {
        for value in row {
            f[2 * i] -= value * value;
        }
    }
    for element in f.iter_mut().skip(1).take(3) {
        *element *= 2.0;
    }
    let mut k = 1;
    while k < N {
        f[k] += x[k - 1] / k as f64;
        k *= 2;
    }
    let mut n = 0;
    let found = loop {
        n += 1;
        if n % 5 == 0 {
            break n;
        }
        if n == 2 {
            continue;
        }
        f[0] += n as f64;
    };
    'outer: for i in 0.. {
        for j in 0..3 {
            if i * j == 4 {
                break 'outer;
            }
            f[5] -= (i + j) as f64 * x[j];
        }
    }
    f[found] += 1.0;
    f
}

#[dae]
fn branches(xdot: [f64; 4], x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    // At run time: a selection.
    let friction = if x[0] > 0.0 { 0.3 * x[0] } else { 0.7 * x[0] * x[0] };
    let mut force = u[0];
    if x[1].abs() <= 1.0 && u[1] != 0.25 || !(x[2] < 0.0) {
        force -= x[2];
        force *= 2.0;
    } else if x[1] >= 1.5 {
        force = x[3];
    }
    let pair = match x[3] < u[1] {
        true => (x[3], 1.0),
        false => (u[1], -1.0),
    };
    // At compile time.
    const LINEAR: bool = false;
    let spring = if LINEAR { x[0] } else { x[0].powi(3) };
    let stiffness = match 7 / 2 {
        0 => 0.0,
        1..=2 => 1.0,
        n if n == 3 => 5.0,
        _ => 9.0,
    };
    [xdot[0] - friction, xdot[1] - force, xdot[2] - pair.0 * pair.1, xdot[3] - stiffness * spring]
}

#[ode]
fn functions(x: [f64; 3], u: f64) -> [f64; 3] {
    fn square(a: f64) -> f64 {
        a * a
    }
    fn mean<const N: usize>(a: [f64; N]) -> f64 {
        let mut sum = 0.0;
        for a in a {
            sum += a;
        }
        sum / N as f64
    }
    fn early(n: usize, a: f64) -> f64 {
        if n == 0 {
            return a;
        }
        a * n as f64
    }
    fn apply(f: impl Fn(f64) -> f64, a: f64) -> f64 {
        f(f(a))
    }
    fn accumulate(sum: &mut f64, a: f64) {
        *sum += a;
    }
    let gain = 0.5 + u;
    let scaled = |a: f64| gain * a;
    let mut calls = 0;
    let mut counted = |a: f64| {
        calls += 1;
        a / calls as f64
    };
    let (first, second) = (counted(x[0]), counted(x[1]));
    let mut sum = mean(x);
    accumulate(&mut sum, square(x[2]));
    [apply(scaled, x[0]) + first, early(0, x[1]) - early(2, second), mean([sum, u]) + f64::from(calls)]
}

#[dae]
fn structures(xdot: [f64; 2], x: [f64; 2], u: f64) -> [f64; 2] {
    #[derive(Clone, Copy)]
    struct Body {
        mass: f64,
        inertia: [f64; 2],
    }
    impl Body {
        const GRAVITY: f64 = 9.81;
        fn new(mass: f64) -> Self {
            Self { mass, inertia: [mass / 2.0, mass / 3.0] }
        }
        fn weight(&self) -> f64 {
            self.mass * Self::GRAVITY
        }
        fn double(&mut self) {
            self.mass *= 2.0;
        }
    }
    struct Pair(f64, f64);
    enum Spring {
        Linear(f64),
        Hard { linear: f64, cubic: f64 },
    }
    let force = |spring: &Spring, q: f64| match spring {
        Spring::Linear(k) => k * q,
        Spring::Hard { linear, cubic } => linear * q + cubic * q * q * q,
    };
    let mut body = Body::new(2.5);
    body.double();
    body.inertia[1] += u;
    let heavier = Body { mass: body.mass + 1.0, ..body };
    let Body { mass, inertia: [i0, _] } = heavier;
    let pair = Pair(mass, i0);
    let pull = force(&Spring::Linear(3.0), x[0]) + force(&Spring::Hard { linear: 1.0, cubic: 0.1 }, x[1]);
    [xdot[0] * pair.0 - body.weight() * x[1], xdot[1] * heavier.inertia[1].abs() + pair.1 * pull + xdot[1]]
}

#[test]
fn patterns_and_assignments() {
    same_bits::<Patterns>(|v| {
        let (f, g) = patterns(subarray(v, 0), subarray(v, 4), subarray(v, 9), v[8], v[11]);
        f.into_iter().chain([g]).collect()
    });
}

#[test]
fn kinds_of_loops() {
    same_bits::<Loops>(|v| {
        loops(subarray(v, 0), subarray(v, 6), [subarray(v, 12), subarray(v, 14), subarray(v, 16)]).to_vec()
    });
}

#[test]
fn branches_at_run_time_and_compile_time() {
    same_bits::<Branches>(|v| branches(subarray(v, 0), subarray(v, 4), subarray(v, 8)).to_vec());
}

#[test]
fn functions_and_closures() {
    same_bits::<Functions>(|v| {
        let g = functions(subarray(v, 3), v[6]);
        (0..3).map(|i| v[i] - g[i]).collect()
    });
}

#[test]
fn structs_and_enums() {
    same_bits::<Structures>(|v| structures(subarray(v, 0), subarray(v, 2), v[4]).to_vec());
}
