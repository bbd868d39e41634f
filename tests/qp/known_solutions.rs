//! Random problems whose solution is known: a point, multipliers and active sides are drawn first,
//! and the gradient is what makes them satisfy the conditions of optimality. Where the Hessian is
//! positive semidefinite that point is a minimum, whatever else is degenerate.

use casados::qp::{HeapQp, HeapSolution, QpError, SolutionStage, StageDims};

const INFINITY: f64 = f64::INFINITY;

/// Numbers from a seed (splitmix64: Steele, Lea, Flood, "Fast splittable pseudorandom number
/// generators", OOPSLA 2014).
pub struct Numbers(u64);

impl Numbers {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In −1 .. 1.
    pub fn next(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    pub fn chance(&mut self, probability: f64) -> bool {
        self.next() * 0.5 + 0.5 < probability
    }
    /// Below a number.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count.max(1) as u64) as usize
    }
    /// Powers of ten, uniformly in their exponents.
    pub fn power(&mut self, exponent: f64) -> f64 {
        10_f64.powf(exponent * self.next())
    }
}

/// All numbers of a solution.
pub fn numbers(solution: &HeapSolution<f64>) -> impl Iterator<Item = f64> {
    let parts = |s: SolutionStage<'_, f64>| -> Vec<f64> {
        let sides = [s.x_lower, s.x_upper, s.u_lower, s.u_upper, s.g_lower, s.g_upper];
        [s.x, s.u, s.dynamics].into_iter().chain(sides).flatten().copied().collect()
    };
    solution.stages().flat_map(parts)
}

/// Numbers of all sizes and signs, and now and then none.
pub fn invalid_numbers(random: &mut Numbers, solution: &mut HeapSolution<f64>) {
    let size = [0.0, 1.0, 8.0, 100.0][random.below(4)];
    for k in 0..solution.dims().len() {
        let Some(stage) = solution.stage_mut(k) else { return };
        let parts = [
            stage.x,
            stage.u,
            stage.dynamics,
            stage.x_lower,
            stage.x_upper,
            stage.u_lower,
            stage.u_upper,
            stage.g_lower,
            stage.g_upper,
        ];
        for value in parts.into_iter().flatten() {
            let number = random.next() * random.power(size);
            *value = if random.chance(0.001) { f64::NAN } else { number };
        }
    }
}

/// The Hessians of the stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HessianKind {
    /// Eigenvalues of 1e-3 and more.
    Definite,
    /// Of a lower rank than it has rows.
    LowRank,
    Zero,
}

/// What a problem is like.
#[derive(Clone, Copy, Debug)]
pub struct ProblemKind {
    pub hessian: HessianKind,
    /// Dependent rows, rows of zeros, fixed variables, multipliers of zero at active sides.
    pub degenerate: bool,
    /// Soft sides, some of them violated, and the size of soft bounds that mean none.
    pub soft: Option<f64>,
    /// Stages without states, controls, both.
    pub empty: bool,
    /// Variables and constraints in units that differ by this power of ten, up and down.
    pub units: f64,
}

pub const PLAIN: ProblemKind =
    ProblemKind { hessian: HessianKind::Definite, degenerate: false, soft: None, empty: false, units: 0.0 };

/// A problem and its solution.
pub struct KnownProblem {
    pub qp: HeapQp<f64>,
    pub solution: HeapSolution<f64>,
}

/// Bounds, penalties and multipliers of one row.
struct Row {
    lower: f64,
    upper: f64,
    /// Linear and quadratic, of both sides.
    penalty: Option<(f64, f64)>,
    lower_multiplier: f64,
    upper_multiplier: f64,
}

const FREE_ROW: Row =
    Row { lower: -INFINITY, upper: INFINITY, penalty: None, lower_multiplier: 0.0, upper_multiplier: 0.0 };

/// A row whose value at the solution is known.
fn known_row(random: &mut Numbers, kind: &ProblemKind, value: f64) -> Row {
    let far = |random: &mut Numbers, sign: f64| {
        let distance = 0.02 + 2.0 * random.next().abs();
        if random.chance(0.7) { value + sign * distance } else { sign * INFINITY }
    };
    let weak = kind.degenerate && random.chance(0.3);
    let force = if weak { 0.0 } else { 0.01 + 2.0 * random.next().abs() };
    if let Some(huge) = kind.soft.filter(|_| random.chance(0.3)) {
        return soft_row(random, value, huge);
    }
    match random.below(if kind.degenerate { 12 } else { 9 }) {
        0..3 => Row { lower: far(random, -1.0), upper: far(random, 1.0), ..FREE_ROW },
        3..5 => Row { lower: value, upper: far(random, 1.0), lower_multiplier: force, ..FREE_ROW },
        5..7 => Row { upper: value, lower: far(random, -1.0), upper_multiplier: force, ..FREE_ROW },
        7 => FREE_ROW,
        _ if random.chance(0.5) => Row { lower: value, upper: value, lower_multiplier: force, ..FREE_ROW },
        _ => Row { lower: value, upper: value, upper_multiplier: force, ..FREE_ROW },
    }
}

/// A row with soft sides: violated, at its bound, or not reached; the other side may mean that
/// there is none.
fn soft_row(random: &mut Numbers, value: f64, huge: f64) -> Row {
    let linear = if random.chance(0.2) { 0.0 } else { 0.1 + 3.0 * random.next().abs() };
    let quadratic = if linear > 0.0 && random.chance(0.5) { 0.0 } else { 0.1 + 3.0 * random.next().abs() };
    let violation = random.next().abs();
    let (distance, force) = match random.below(3) {
        0 => (-violation, linear + quadratic * violation),
        1 => (0.0, linear * random.next().abs()),
        _ => (violation + 0.02, 0.0),
    };
    let none = if random.chance(0.5) { huge } else { INFINITY };
    let penalty = Some((linear, quadratic));
    if random.chance(0.5) {
        Row { lower: value - distance, upper: none, penalty, lower_multiplier: force, upper_multiplier: 0.0 }
    } else {
        Row { upper: value + distance, lower: -none, penalty, lower_multiplier: 0.0, upper_multiplier: force }
    }
}

/// Dimensions of up to seven stages.
pub fn random_dims(random: &mut Numbers, empty: bool) -> Vec<StageDims> {
    let stages = 1 + random.below(7);
    (0..stages)
        .map(|_| {
            let least = usize::from(!empty);
            let (nx, nu) = (least + random.below(6), random.below(4));
            if empty && random.chance(0.2) {
                StageDims::new(0, 0, random.below(2))
            } else {
                StageDims::new(nx, nu, random.below(4))
            }
        })
        .collect()
}

/// Writes `½ G Gᵀ`, and more on the diagonal.
fn hessian(random: &mut Numbers, kind: HessianKind, n: usize) -> Vec<f64> {
    let rank = match kind {
        HessianKind::Definite => n,
        HessianKind::LowRank => random.below(n.max(1)),
        HessianKind::Zero => 0,
    };
    let g: Vec<f64> = (0..n * rank).map(|_| random.next()).collect();
    let least = if kind == HessianKind::Definite { 1e-3 } else { 0.0 };
    let mut h = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            let sum: f64 = (0..rank).map(|c| g[c * n + i] * g[c * n + j]).sum();
            h[j * n + i] = sum + if i == j { least } else { 0.0 };
        }
    }
    h
}

/// The data of one stage over `v = (x, u)`, dense and by columns.
struct StageData {
    h: Vec<f64>,
    ab: Vec<f64>,
    cd: Vec<f64>,
    rows: Vec<Row>,
}

/// A problem with a known solution.
pub fn problem(random: &mut Numbers, kind: &ProblemKind) -> Result<KnownProblem, QpError> {
    let dims = random_dims(random, kind.empty);
    let mut known = KnownProblem { qp: HeapQp::new(&dims)?, solution: HeapSolution::new(&dims)? };
    // Units of variables: v = unit · v̂ where v̂ is of size 1.
    let units: Vec<Vec<f64>> =
        dims.iter().map(|d| (0..d.nx + d.nu).map(|_| random.power(kind.units)).collect()).collect();
    let mut x: Vec<f64> = (0..dims[0].nx).map(|_| random.next()).collect();
    let mut arriving: Vec<f64> = vec![0.0; dims[0].nx];
    let fixed = random.chance(0.7);
    for (k, &StageDims { nx, nu, ng }) in dims.iter().enumerate() {
        let (n, next) = (nx + nu, dims.get(k + 1).map_or(0, |d| d.nx));
        let u: Vec<f64> = (0..nu).map(|_| random.next()).collect();
        let v: Vec<f64> = x.iter().chain(&u).copied().collect();
        let data = stage_data(random, kind, (n, next, ng), &v, if k == 0 && fixed { nx } else { 0 });
        let product = |m: &[f64], rows: usize, i: usize| (0..n).map(|j| m[j * rows + i] * v[j]).sum::<f64>();
        let offset: Vec<f64> = (0..next).map(|_| 0.3 * random.next()).collect();
        let coming: Vec<f64> = (0..next).map(|i| product(&data.ab, next, i) + offset[i]).collect();
        let pi: Vec<f64> = (0..next).map(|_| random.next()).collect();
        // The gradient that makes the point stationary.
        let force = |row: usize| data.rows[row].upper_multiplier - data.rows[row].lower_multiplier;
        let gradient: Vec<f64> = (0..n)
            .map(|j| {
                let dynamics: f64 = (0..next).map(|i| data.ab[j * next + i] * pi[i]).sum();
                let general: f64 = (0..ng).map(|i| data.cd[j * ng + i] * force(n + i)).sum();
                let before = if j < nx { arriving[j] } else { 0.0 };
                before - product(&data.h, n, j) - dynamics - general - force(j)
            })
            .collect();
        let next_units: Vec<f64> = units.get(k + 1).map_or(Vec::new(), |u| u[..next].to_vec());
        let row_units: Vec<f64> = (0..ng).map(|_| random.power(kind.units)).collect();
        write_stage(
            &mut known,
            k,
            (nx, nu),
            &data,
            (&gradient, &offset),
            (&units[k], &next_units, &row_units),
        );
        if let Some(mut point) = known.solution.stage_mut(k) {
            write_point(&mut point, &v, &pi, &data.rows, (&units[k], &next_units, &row_units));
        }
        (x, arriving) = (coming, pi);
    }
    Ok(known)
}

/// Random matrices and rows; the first `fixed` variables are given.
fn stage_data(
    random: &mut Numbers,
    kind: &ProblemKind,
    (n, next, ng): (usize, usize, usize),
    v: &[f64],
    fixed: usize,
) -> StageData {
    let h = hessian(random, kind.hessian, n);
    let ab: Vec<f64> = (0..n * next).map(|_| 0.7 * random.next()).collect();
    let mut cd: Vec<f64> = (0..n * ng).map(|_| random.next()).collect();
    if kind.degenerate {
        for i in 0..ng {
            match random.below(4) {
                // Nothing, or a multiple of another row.
                0 => (0..n).for_each(|j| cd[j * ng + i] = 0.0),
                1 if i > 0 => {
                    let (other, factor) = (random.below(i), random.next() * 2.0);
                    (0..n).for_each(|j| cd[j * ng + i] = factor * cd[j * ng + other]);
                }
                _ => {}
            }
        }
    }
    let mut rows = Vec::new();
    for i in 0..n + ng {
        let value = match i.checked_sub(n) {
            None => v[i],
            Some(i) => (0..n).map(|j| cd[j * ng + i] * v[j]).sum(),
        };
        rows.push(if i < fixed {
            let force = random.next();
            Row {
                lower: value,
                upper: value,
                lower_multiplier: force.max(0.0),
                upper_multiplier: (-force).max(0.0),
                ..FREE_ROW
            }
        } else {
            known_row(random, kind, value)
        });
    }
    StageData { h, ab, cd, rows }
}

type Units<'a> = (&'a [f64], &'a [f64], &'a [f64]);

/// With `v = unit v̂`: `Ĥ / (unit unit)`, `next / unit`, and so on.
fn write_stage(
    known: &mut KnownProblem,
    k: usize,
    (nx, nu): (usize, usize),
    data: &StageData,
    (gradient, offset): (&[f64], &[f64]),
    (units, next_units, row_units): Units<'_>,
) {
    let Some(mut stage) = known.qp.stage_mut(k) else { return };
    let (n, next, ng) = (nx + nu, next_units.len(), row_units.len());
    let h = |i: usize, j: usize| data.h[j * n + i] / (units[i] * units[j]);
    stage.q_mut().fill_with(h);
    stage.r_mut().fill_with(|i, j| h(nx + i, nx + j));
    stage.s_mut().fill_with(|i, j| h(nx + i, j));
    let ab = |i: usize, j: usize| data.ab[j * next + i] * next_units[i] / units[j];
    stage.a_mut().fill_with(ab);
    stage.b_mut().fill_with(|i, j| ab(i, nx + j));
    let cd = |i: usize, j: usize| data.cd[j * ng + i] * row_units[i] / units[j];
    stage.c_mut().fill_with(cd);
    stage.d_mut().fill_with(|i, j| cd(i, nx + j));
    for (i, b) in stage.offset_mut().iter_mut().enumerate() {
        *b = offset[i] * next_units[i];
    }
    for (i, g) in stage.gradient_x_mut().iter_mut().enumerate() {
        *g = gradient[i] / units[i];
    }
    for (i, g) in stage.gradient_u_mut().iter_mut().enumerate() {
        *g = gradient[nx + i] / units[nx + i];
    }
    let all = units.iter().chain(row_units);
    for (i, (row, &unit)) in data.rows.iter().zip(all).enumerate() {
        let (mut bounds, i) = if i < nx {
            (stage.x_bounds_mut(), i)
        } else if i < n {
            (stage.u_bounds_mut(), i - nx)
        } else {
            (stage.g_bounds_mut(), i - n)
        };
        // What means none means none in any unit.
        let of = |bound: f64| if row.penalty.is_some() && bound.abs() > 1e6 { bound } else { bound * unit };
        bounds.set(i, of(row.lower), of(row.upper));
        if let Some((linear, quadratic)) = row.penalty {
            bounds.soften(i, linear / unit, quadratic / (unit * unit));
        }
    }
}

fn write_point(
    point: &mut casados::qp::SolutionStageMut<'_, f64>,
    v: &[f64],
    pi: &[f64],
    rows: &[Row],
    (units, next_units, row_units): Units<'_>,
) {
    let nx = point.x.len();
    let (vx, vu) = v.split_at(nx);
    for (x, (v, unit)) in point.x.iter_mut().zip(vx.iter().zip(units)) {
        *x = v * unit;
    }
    for (u, (v, unit)) in point.u.iter_mut().zip(vu.iter().zip(&units[nx..])) {
        *u = v * unit;
    }
    for (to, (pi, unit)) in point.dynamics.iter_mut().zip(pi.iter().zip(next_units)) {
        *to = pi / unit;
    }
    let lower = point.x_lower.iter_mut().chain(point.u_lower.iter_mut()).chain(point.g_lower.iter_mut());
    let upper = point.x_upper.iter_mut().chain(point.u_upper.iter_mut()).chain(point.g_upper.iter_mut());
    for ((lower, upper), (row, unit)) in lower.zip(upper).zip(rows.iter().zip(units.iter().chain(row_units)))
    {
        (*lower, *upper) = (row.lower_multiplier / unit, row.upper_multiplier / unit);
    }
}
