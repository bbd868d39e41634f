//! Which root of several is taken: that of the start, wherever Newton's method from there leads to
//! it.
//!
//! Ten thousand starts of random models with two to four roots in each algebraic equation. The
//! reference is Newton's method with the current Jacobian in every iteration, written here, with
//! derivatives by hand. A tenth of them go through all integrators, multiple shooting and
//! collocation.

use casados::ocp::{Collocation, HeapSqp, Horizon, Kind, Problem as Control};
use casados::options::{Jacobian, Newton};
use casados::prelude::*;
use casados::testing::Random;
use nalgebra::{SVector, vector};

/// Equations `c₀ + c₁ w + … + c₄ w⁴ + c₅ exp w + c₆ sin(c₇ w) + e sin z_{j+1} = 0` with
/// `w_j = z_j + m z_{j+1}`, beside two states and two linear algebraic states. Each `z_j` may be
/// what is added to an origin: then zero is the start there.
#[dae(N = [1, 2, 3, 4, 5])]
fn family<const N: usize>(
    xdot: [f64; 2],
    x: [f64; 2],
    z: ([f64; 2], [f64; N]),
    p: ([[f64; 8]; N], [f64; 2], [f64; N]),
) -> ([f64; 2], [f64; 2], [f64; N]) {
    let ([first, second], roots) = z;
    let (coefficients, [m, e], origins) = p;
    let roots: [f64; N] = core::array::from_fn(|j| origins[j] + roots[j]);
    let equations: [f64; N] = core::array::from_fn(|j| {
        let next = roots[(j + 1) % N];
        let w = roots[j] + m * next;
        let c = coefficients[j];
        let polynomial = c[0] + w * (c[1] + w * (c[2] + w * (c[3] + w * c[4])));
        polynomial + c[5] * w.exp() + c[6] * (c[7] * w).sin() + e * next.sin() - 0.1 * (x[0] - 1.0)
    });
    (
        [xdot[0] + x[0] - 0.01 * first, xdot[1] - x[0] + 0.1 * second],
        [first - 40.0 * x[0] - roots[0], second - 30.0 * x[1] + first],
        equations,
    )
}

/// A model of the family, its roots (of each equation without coupling), and a start near one.
struct Problem<const N: usize> {
    coefficients: [[f64; 8]; N],
    coupling: [f64; 2],
    /// The solution near which it starts, and how far the next root of each equation is.
    solution: SVector<f64, N>,
    separation: [f64; N],
    start: SVector<f64, N>,
}

/// The coefficients of an equation, one of its roots and the distance to the next.
fn random_equation(random: &mut Random) -> ([f64; 8], f64, f64) {
    let mut c = [0.0; 8];
    let scale = (2.0 * random.symmetric()).exp() * if random.below(2) == 0 { 1.0 } else { -1.0 };
    let mut roots = [0.0; 4];
    let count = match random.below(4) {
        // Roots of a polynomial, at least half apart.
        0 | 1 => {
            let count = 2 + random.below(3);
            let mut root = 3.0 * random.symmetric();
            let mut polynomial = [scale, 0.0, 0.0, 0.0, 0.0];
            for to in roots.iter_mut().take(count) {
                *to = root;
                for k in (0..5).rev() {
                    polynomial[k] = if k > 0 { polynomial[k - 1] } else { 0.0 } - root * polynomial[k];
                }
                root += 0.5 + 2.5 * random.unit();
            }
            c[..5].copy_from_slice(&polynomial);
            count
        }
        // A chord of the exponential function.
        2 => {
            let first = 2.0 * random.symmetric();
            let second = first + 0.5 + 2.0 * random.unit();
            let slope = (second.exp() - first.exp()) / (second - first);
            (c[0], c[1], c[5]) = (-scale * (first.exp() - slope * first), -scale * slope, scale);
            (roots[0], roots[1]) = (first, second);
            2
        }
        // `sin(k (w − q)) = s (w − q)`, with q = 0: three roots.
        _ => {
            let (k, s) = (0.5 + 2.0 * random.unit(), 0.25 + 0.5 * random.unit());
            let mut root = 2.5;
            for _ in 0..40 {
                root -= (f64::sin(root) - s * root) / (f64::cos(root) - s);
            }
            (c[1], c[6], c[7]) = (-scale * s * k, scale, k);
            (roots[0], roots[2]) = (-root / k, root / k);
            3
        }
    };
    let own = random.below(count);
    let mut apart = f64::INFINITY;
    for other in (0..count).filter(|other| *other != own) {
        apart = apart.min((roots[other] - roots[own]).abs());
    }
    (c, roots[own], apart)
}

/// Gaussian elimination with partial pivoting.
fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: SVector<f64, N>) -> Option<SVector<f64, N>> {
    for k in 0..N {
        let pivot = (k..N).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs()))?;
        a.swap(k, pivot);
        b.swap_rows(k, pivot);
        let row = a[k];
        if row[k] == 0.0 || row[k].is_nan() {
            return None;
        }
        for i in k + 1..N {
            let factor = a[i][k] / row[k];
            for (to, from) in a[i].iter_mut().zip(row).skip(k) {
                *to -= factor * from;
            }
            b[i] -= factor * b[k];
        }
    }
    for i in (0..N).rev() {
        let sum: f64 = (i + 1..N).map(|j| a[i][j] * b[j]).sum();
        b[i] = (b[i] - sum) / a[i][i];
    }
    Some(b)
}

impl<const N: usize> Problem<N> {
    fn residual(&self, z: &SVector<f64, N>) -> (SVector<f64, N>, [[f64; N]; N]) {
        let (mut f, mut jacobian) = (SVector::zeros(), [[0.0; N]; N]);
        let [m, e] = self.coupling;
        for (j, c) in self.coefficients.iter().enumerate() {
            let next = (j + 1) % N;
            let w = z[j] + m * z[next];
            let polynomial = c[0] + w * (c[1] + w * (c[2] + w * (c[3] + w * c[4])));
            let slope = c[1] + w * (2.0 * c[2] + w * (3.0 * c[3] + w * 4.0 * c[4]));
            f[j] = polynomial + c[5] * w.exp() + c[6] * (c[7] * w).sin() + e * z[next].sin();
            let slope = slope + c[5] * w.exp() + c[6] * c[7] * (c[7] * w).cos();
            jacobian[j][j] += slope;
            jacobian[j][next] += m * slope + e * z[next].cos();
        }
        (f, jacobian)
    }

    /// Newton's method with the current Jacobian in every iteration: where it ends, and how far it
    /// was from the solution on the way, in distances to the next root.
    fn newton_iteration(&self, mut z: SVector<f64, N>) -> Option<(SVector<f64, N>, f64)> {
        let mut astray = 0.0f64;
        for _ in 0..50 {
            let (f, jacobian) = self.residual(&z);
            let step = solve(jacobian, f)?;
            z -= step;
            if !z.iter().all(|z| z.is_finite()) {
                return None;
            }
            for j in 0..N {
                astray = astray.max((z[j] - self.solution[j]).abs() / self.separation[j]);
            }
            if step.amax() <= 1e-12 * (1.0 + z.amax()) {
                return Some((z, astray));
            }
        }
        None
    }

    /// Whether these are at the solution, and not at another.
    fn is_at_solution(&self, z: &[f64]) -> bool {
        (0..N).all(|j| (z[j] - self.solution[j]).abs() < 0.2 * self.separation[j])
    }

    /// A random one.
    fn new(random: &mut Random, reach: f64) -> Self {
        loop {
            let mut problem = Self {
                coefficients: [[0.0; 8]; N],
                coupling: [0.0; 2],
                solution: SVector::zeros(),
                separation: [0.0; N],
                start: SVector::zeros(),
            };
            let mut w = SVector::<f64, N>::zeros();
            for j in 0..N {
                (problem.coefficients[j], w[j], problem.separation[j]) = random_equation(random);
            }
            if N > 1 {
                problem.coupling = [0.2 * random.symmetric(), 0.1 * random.symmetric()];
            }
            let mut mixing = [[0.0; N]; N];
            for (j, row) in mixing.iter_mut().enumerate() {
                row[j] += 1.0;
                row[(j + 1) % N] += problem.coupling[0];
            }
            let Some(near) = solve(mixing, w) else { continue };
            let Some((solution, _)) = problem.newton_iteration(near) else { continue };
            problem.solution = solution;
            if !problem.is_at_solution(near.as_slice()) {
                continue;
            }
            problem.start = solution;
            for j in 0..N {
                problem.start[j] += reach * random.symmetric() * problem.separation[j];
            }
            return problem;
        }
    }
}

/// What became of the starts from which Newton's method leads to the root of the start, and is
/// never further from it than the next one is.
#[derive(Debug, Default)]
struct StartCounts {
    at_nearest_root: usize,
    elsewhere: usize,
    failed: usize,
    /// Where Newton's method was thrown beyond other roots and came back by chance.
    at_nearest_root_by_chance: [usize; 2],
    /// Where it ends elsewhere: the root is reached all the same, or not.
    lost: [usize; 2],
}

impl StartCounts {
    fn count_start(&mut self, newton: Option<f64>, there: Option<bool>) {
        let reached = usize::from(there != Some(true));
        match (newton, there) {
            (None, _) => self.lost[reached] += 1,
            (Some(astray), _) if astray > 1.0 => self.at_nearest_root_by_chance[reached] += 1,
            (_, Some(true)) => self.at_nearest_root += 1,
            (_, Some(false)) => self.elsewhere += 1,
            (_, None) => self.failed += 1,
        }
    }
}

const H: f64 = 1e-3;
const METHODS: [&str; 11] = [
    "auto",
    "simplified",
    "full",
    "frozen",
    "two stages",
    "five steps",
    "batch",
    "adaptive: consistent start values",
    "adaptive",
    "shooting",
    "collocation",
];
type Counts = [StartCounts; METHODS.len()];

fn campaign<const N: usize>(random: &mut Random, starts: usize, reach: f64, counts: &mut Counts)
where
    Problem<N>: Runs,
{
    for start in 0..starts {
        let problem = Problem::<N>::new(random, reach);
        let newton = problem.newton_iteration(problem.start);
        let newton = newton.filter(|(z, _)| problem.is_at_solution(z.as_slice())).map(|(_, astray)| astray);
        problem.run(start % 10 == 0, |method, there| counts[method].count_start(newton, there));
    }
}

trait Runs {
    /// By the default method, or by `all`.
    fn run(&self, all: bool, take: impl FnMut(usize, Option<bool>));
}

macro_rules! runs {
    ($($n:literal),*) => {$(
        impl Runs for Problem<$n> {
            fn run(&self, all: bool, mut take: impl FnMut(usize, Option<bool>)) {
                type M = Family<$n>;
                let flat = self.coefficients.as_flattened().iter().chain(&self.coupling).copied();
                let mut p = SVector::<f64, { 9 * $n + 2 }>::zeros();
                p.iter_mut().zip(flat).for_each(|(to, from)| *to = from);
                let z = SVector::<f64, { $n + 2 }>::from_fn(|i, _| if i < 2 { 0.0 } else { self.start[i - 2] });
                let (x0, none, zero) = (vector![1.0, 0.5], SVector::<f64, 0>::zeros(), vector![0.0, 0.0]);
                macro_rules! irk {
                    ($index:literal, $method:ty, $jacobian:ident, $steps:literal) => {
                        let newton = Newton { jacobian: Jacobian::$jacobian, ..Default::default() };
                        let options = Options { newton, steps: $steps, ..Default::default() };
                        let mut irk = Irk::<M, $method>::new(options).unwrap();
                        irk.set_parameters(&p).unwrap();
                        irk.set_start(&zero, &z).unwrap();
                        let step = irk.solve(&x0, &none, $steps as f64 * H);
                        take($index, step.ok().map(|step| {
                            self.is_at_solution(&step.z0.as_slice()[2..]) && self.is_at_solution(&step.z.as_slice()[2..])
                        }));
                    };
                }
                irk!(0, RadauIIA<3>, Auto, 1);
                if !all {
                    return;
                }
                irk!(1, RadauIIA<3>, Simplified, 1);
                irk!(2, RadauIIA<3>, Full, 1);
                irk!(3, RadauIIA<3>, Frozen, 1);
                irk!(4, Gauss<2>, Auto, 1);
                irk!(5, RadauIIA<3>, Auto, 5);
                let mut batch = Batch::<M, RadauIIA<3>>::new(Options::default()).unwrap();
                batch.set_start(&zero, &z).unwrap();
                let (states, parameters) = ([x0; 4], [p; 4]);
                let mut results = [casados::result::Nominal::default(); 4];
                let intervals = Intervals { x0: &states, p: &parameters, h: &[H], ..Default::default() };
                let solved = batch.solve(&intervals, &mut results).is_ok();
                take(6, solved.then(|| self.is_at_solution(&results[2].z0.as_slice()[2..])));
                let mut radau = Adaptive::<M, Radau>::new(AdaptiveOptions::default()).unwrap();
                radau.set_parameters(&p).unwrap();
                radau.set_start(&zero, &z).unwrap();
                let step = radau.solve(&x0, &none, H);
                let ends = step.ok().map(|step| [step.z0, step.z].map(|z| self.is_at_solution(&z.as_slice()[2..])));
                take(7, ends.map(|[there, _]| there));
                take(8, ends.map(|[_, there]| there));
                // The start of a model is zero: from origins it is that of the problem.
                p.as_mut_slice()[8 * $n + 2..].copy_from_slice(self.start.as_slice());
                macro_rules! horizon {
                    ($index:literal, $dynamics:expr) => {
                        // Nothing to choose, and no cost.
                        let mut ocp = Control::new($dynamics).on(Horizon::uniform(3, H)).unwrap();
                        ocp.set_parameters(.., p.as_slice()).unwrap().guess(x0.as_slice(), &[]).unwrap();
                        ocp.fix_initial_state(x0.as_slice()).unwrap();
                        let solved = HeapSqp::new(&ocp).unwrap().solve(&mut ocp);
                        let solved = solved.is_ok_and(|outcome| outcome.is_solved());
                        let solution = ocp.solution().ok().filter(|_| solved);
                        take($index, solution.map(|solution| {
                            let all = solution.series().iter().filter(|series| series.kind == Kind::Algebraic);
                            let z: Vec<_> = all.map(|series| series.values.clone()).collect();
                            (0..3).all(|k| {
                                let z: Vec<_> = z[2..].iter().zip(&self.start).map(|(z, s)| z[k] + s).collect();
                                self.is_at_solution(&z)
                            })
                        }));
                    };
                }
                let irk = || Irk::<M, RadauIIA<3>>::new(Options::default()).unwrap();
                horizon!(9, irk());
                horizon!(10, Collocation::new(irk()).unwrap());
            }
        }
    )*};
}
runs!(1, 2, 3, 4, 5);

#[test]
fn starts_near_a_root() {
    let mut counts = Counts::default();
    let mut random = Random::new(7);
    // In parts of the distance to the next root.
    let reach = 0.4;
    campaign::<1>(&mut random, 2000, reach, &mut counts);
    campaign::<2>(&mut random, 2000, reach, &mut counts);
    campaign::<3>(&mut random, 2000, reach, &mut counts);
    campaign::<4>(&mut random, 2000, reach, &mut counts);
    campaign::<5>(&mut random, 2000, reach, &mut counts);
    for (name, count) in METHODS.iter().zip(&counts) {
        println!("{name}: {count:?}");
    }
    for (name, count) in METHODS.iter().zip(&counts) {
        assert!(count.elsewhere == 0 && count.failed == 0, "{name}: {count:?}");
    }
}
