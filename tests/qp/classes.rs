//! Random problems by classes: what is solvable is solved, what is said of the others is true.
//!
//! A run has some hundred problems of each class; `CASADOS_RANDOM=100` multiplies that.

use crate::Test;
use crate::known_solutions::{
    HessianKind, KnownProblem, Numbers, PLAIN, ProblemKind, invalid_numbers, numbers, problem,
};
use crate::runs::{Counts, error_kind, prints_verdicts, seeds};
use casados::qp::{
    Block, BlockMut, Bounds, BoundsMut, HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpSolver, QpStart,
    QpStatistics, SolutionStage, Stage, StageDims, StageMut, residuals,
};

const TOLERANCE: f64 = 1e-8;

/// What became of the problems of a class, and the solver of all of them.
struct VerdictCounts {
    counts: Counts,
    solver: HeapInteriorPoint<f64>,
}

impl VerdictCounts {
    fn new(name: impl Into<String>) -> Self {
        Self { counts: Counts::new(name), solver: HeapInteriorPoint::new() }
    }
    /// Solves with the solver that has seen all problems before: one that never saw them says the
    /// same, to the bit.
    fn solve(
        &mut self,
        qp: &HeapQp<f64>,
        start: QpStart,
        solution: &mut HeapSolution<f64>,
    ) -> Result<QpStatistics, QpError> {
        let mut other = solution.clone();
        let mut fresh = HeapInteriorPoint::new();
        fresh.options = self.solver.options;
        let found = self.solver.solve(qp.view(), start, solution.view_mut());
        let again = fresh.solve(qp.view(), start, other.view_mut());
        assert_eq!(format!("{found:?}"), format!("{again:?}"));
        assert!(numbers(solution).zip(numbers(&other)).all(|(a, b)| a.to_bits() == b.to_bits()));
        found
    }
    /// Every verdict but `Ok` is false: the problem has a solution.
    fn count(&mut self, seed: u64, found: &Result<Option<String>, QpError>) {
        match found {
            Ok(None) => self.counts.count("Ok"),
            Ok(Some(_)) => self.counts.count("wrong"),
            Err(error) => self.counts.count(&error_kind(&error)),
        }
        if prints_verdicts() && !matches!(found, Ok(None)) {
            println!("{}, {seed}: {found:?}", self.counts);
        }
    }
    /// Whether no more than so many of a thousand, or one of a few, were given up with the
    /// residuals that were reached.
    fn unsolved(&self, most: u64) -> bool {
        1000 * self.gave_up() <= most * self.counts.all().max(1000)
    }
    fn gave_up(&self) -> u64 {
        self.counts.count_of_any(&["MaxIterations", "Stalled"])
    }
    fn false_verdicts(&self) -> u64 {
        self.counts.all() - self.counts.count_of("Ok") - self.gave_up()
    }
}

fn multipliers<'a>(stage: &SolutionStage<'a, f64>) -> impl Iterator<Item = &'a f64> + use<'a> {
    let sides = [stage.x_lower, stage.x_upper, stage.u_lower, stage.u_upper, stage.g_lower, stage.g_upper];
    sides.into_iter().flatten()
}

/// What is wrong with a point that is said to be the solution.
///
/// With residuals of at most `r`, convexity says
/// `f(v) − f* ≤ ∇f(v)ᵀ (v − v*) ≤ r (|v − v*|₁ + |λ|₁ + |π|₁ + sides)`, and weak duality
/// `f* − f(v) ≤ r (|λ*|₁ + |π*|₁)`.
fn point_errors(known: &KnownProblem, found: &HeapSolution<f64>, tolerance: f64) -> Option<String> {
    let (r, objective) = residuals(known.qp.view(), found);
    let judged = [r.stationarity, r.dynamics, r.inequalities, r.complementarity, objective];
    let largest = judged[..4].iter().fold(0.0, |largest: f64, &r| largest.max(r));
    // Sums of some tens of terms as large as the numbers of the point, or 10, in another order.
    let size = numbers(found).fold(10.0, |size: f64, number| size.max(number.abs()));
    // Where numbers are above 32 the tolerance is meant in units.
    let allowed = tolerance * (size / 32.0).max(1.0) + 32.0 * f64::EPSILON * size;
    if judged.iter().any(|r| !r.is_finite()) || largest > allowed {
        return Some(format!("{r}, of numbers up to {size:.1e}"));
    }
    let (_, expected) = residuals(known.qp.view(), &known.solution);
    let (mut distance, mut terms) = (0.0, 1.0);
    let (mut forces, mut known_forces, mut sides) = (0.0, 0.0, 0.0);
    let sum = |stage: &SolutionStage<'_, f64>| {
        stage.dynamics.iter().chain(multipliers(stage)).map(|force| force.abs()).sum::<f64>()
    };
    for ((a, b), data) in found.stages().zip(known.solution.stages()).zip(known.qp.view().stages()) {
        let pairs = a.x.iter().zip(b.x).chain(a.u.iter().zip(b.u));
        distance += pairs.map(|(a, b)| (a - b).abs()).sum::<f64>();
        forces += sum(&a);
        known_forces += sum(&b);
        sides += 2.0 * multipliers(&b).count() as f64;
        terms += objective_terms(&data, &a) + objective_terms(&data, &b);
    }
    let rounding = 1e2 * f64::EPSILON * terms;
    let (above, below) =
        (largest * (sides + distance + forces) + rounding, largest * known_forces + rounding);
    let difference = objective - expected;
    (difference > above || -difference > below)
        .then(|| format!("objective {objective} instead of {expected}: {difference:e}, {above:e}, {below:e}"))
}

/// The sizes of the terms whose sum the objective is, without penalties.
fn objective_terms(data: &Stage<'_, f64>, point: &SolutionStage<'_, f64>) -> f64 {
    let entry = |block: Block<'_, f64>, i, j| block.get(i, j).map_or(0.0, f64::abs);
    let mut sum = 0.0;
    for (i, x) in point.x.iter().enumerate() {
        sum += x.abs() * data.gradient_x()[i].abs();
        sum += point.x.iter().enumerate().map(|(j, y)| (x * y).abs() * entry(data.q(), i, j)).sum::<f64>();
        sum += point.u.iter().enumerate().map(|(j, u)| (x * u).abs() * entry(data.s(), j, i)).sum::<f64>();
    }
    for (i, u) in point.u.iter().enumerate() {
        sum += u.abs() * data.gradient_u()[i].abs();
        sum += point.u.iter().enumerate().map(|(j, w)| (u * w).abs() * entry(data.r(), i, j)).sum::<f64>();
    }
    sum
}

/// Solves problems of a kind; `start` may write something senseless into the solution first.
fn run_class(name: &str, kind: &ProblemKind, few: u64, start: QpStart) -> Result<VerdictCounts, QpError> {
    let mut class = VerdictCounts::new(name);
    if kind.units > 0.0 {
        // Terms of other sizes: a part of them is what can be asked for.
        class.solver.options.relative_tolerance = 1e-9;
    }
    for seed in seeds(few) {
        let mut random = Numbers::new(seed.wrapping_mul(2).wrapping_add(1));
        let known = problem(&mut random, kind)?;
        let (own, _) = residuals(known.qp.view(), &known.solution);
        assert!(own.largest() < 1e-11 * 10_f64.powf(2.0 * kind.units), "{seed}: {own}");
        let mut solution = HeapSolution::new(known.qp.dims())?;
        if start == QpStart::Warm {
            invalid_numbers(&mut random, &mut solution);
        }
        let found = class.solve(&known.qp, start, &mut solution);
        let tolerance = if kind.units > 0.0 { f64::INFINITY } else { TOLERANCE };
        class.count(seed, &found.map(|_| point_errors(&known, &solution, tolerance)));
    }
    println!("{}", class.counts);
    Ok(class)
}

#[test]
fn strictly_convex() -> Test {
    let class = run_class("strictly convex", &PLAIN, 300, QpStart::Cold)?;
    assert_eq!(class.counts.count_of("Ok"), class.counts.all());
    let kind = ProblemKind { empty: true, ..PLAIN };
    let class = run_class("strictly convex with empty stages", &kind, 300, QpStart::Cold)?;
    assert_eq!(class.counts.count_of("Ok"), class.counts.all());
    Ok(())
}

#[test]
fn convex() -> Test {
    for hessian in [HessianKind::LowRank, HessianKind::Zero] {
        let kind = ProblemKind { hessian, empty: true, ..PLAIN };
        let class = run_class(&format!("{hessian:?}"), &kind, 300, QpStart::Cold)?;
        assert!(class.false_verdicts() == 0 && class.unsolved(1), "{}", class.counts);
    }
    Ok(())
}

#[test]
fn degenerate() -> Test {
    for hessian in [HessianKind::Definite, HessianKind::LowRank, HessianKind::Zero] {
        let kind = ProblemKind { hessian, degenerate: true, empty: true, ..PLAIN };
        let class = run_class(&format!("degenerate, {hessian:?}"), &kind, 300, QpStart::Cold)?;
        assert!(class.false_verdicts() == 0 && class.unsolved(1), "{}", class.counts);
    }
    Ok(())
}

#[test]
fn soft() -> Test {
    for hessian in [HessianKind::Definite, HessianKind::LowRank] {
        for huge in [1e3, 1e8, 1e10, 1e12, 1e14, 1e20, f64::INFINITY] {
            let kind = ProblemKind { hessian, soft: Some(huge), empty: true, ..PLAIN };
            let class =
                run_class(&format!("soft, {hessian:?}, none is {huge:e}"), &kind, 100, QpStart::Cold)?;
            assert!(class.false_verdicts() == 0 && class.unsolved(1), "{}", class.counts);
        }
    }
    Ok(())
}

#[test]
fn invalid_start_points() -> Test {
    for hessian in [HessianKind::Definite, HessianKind::LowRank, HessianKind::Zero] {
        let kind = ProblemKind { hessian, soft: Some(1e12), degenerate: true, empty: true, ..PLAIN };
        let class = run_class(&format!("senseless start, {hessian:?}"), &kind, 200, QpStart::Warm)?;
        assert!(class.false_verdicts() == 0 && class.unsolved(5), "{}", class.counts);
    }
    Ok(())
}

#[test]
fn problems_in_other_units() -> Test {
    for hessian in [HessianKind::Definite, HessianKind::Zero] {
        for units in [1.0, 3.0] {
            let kind = ProblemKind { hessian, units, ..PLAIN };
            let class = run_class(&format!("units of 1e±{units}, {hessian:?}"), &kind, 200, QpStart::Cold)?;
            assert!(class.false_verdicts() == 0 && class.unsolved(5), "{}", class.counts);
        }
    }
    Ok(())
}

/// A problem made infeasible: the rows `c` and `−c/2`, both of a stage with a solution, are bounded
/// such that no value is between. What is said must be true of the point that is left, and the
/// distance no more than what the rows lack.
#[test]
fn infeasible() -> Test {
    for (hessian, distance) in
        [(HessianKind::Definite, 1.0), (HessianKind::Zero, 1e-3), (HessianKind::LowRank, 1e4)]
    {
        let mut class = VerdictCounts::new(format!("infeasible by {distance:e}, {hessian:?}"));
        for seed in seeds(100) {
            let mut random = Numbers::new(!seed);
            let kind =
                ProblemKind { hessian, empty: seed % 2 == 0, soft: (seed % 3 == 0).then_some(1e9), ..PLAIN };
            let known = problem(&mut random, &kind)?;
            let Some((qp, stage)) = add_contradictory_rows(&known, &mut random, distance)? else { continue };
            let mut solution = HeapSolution::new(qp.dims())?;
            let found = class.solve(&qp, QpStart::Cold, &mut solution);
            class.count(seed, &found.map(|_| Some("solved".into())));
            let Err(QpError::Infeasible { violation, .. }) = found else { continue };
            // The named violation is the largest of the point, and at least half of what is missing
            // is at one of the rows.
            let (r, _) = residuals(qp.view(), &solution);
            assert!(
                (r.inequalities - violation).abs() <= 1e-9 * (1.0 + violation),
                "{seed}: {r} {violation:e}"
            );
            assert!(r.dynamics <= 1e-8 * (1.0 + violation), "{seed}: {r}");
            assert!(violation >= distance / (1e2 * qp.dims()[stage].ng as f64), "{seed}: {violation:e}");
        }
        println!("{}", class.counts);
        let (all, true_ones) = (class.counts.all(), class.counts.count_of("Infeasible"));
        assert!(all > 0 && true_ones + class.gave_up() == all && class.unsolved(5), "{}", class.counts);
    }
    Ok(())
}

/// The problem with two more rows in a stage that has variables.
fn add_contradictory_rows(
    known: &KnownProblem,
    random: &mut Numbers,
    distance: f64,
) -> Result<Option<(HeapQp<f64>, usize)>, QpError> {
    let mut dims = known.qp.dims().to_vec();
    let Some(stage) = (0..dims.len()).rev().find(|&k| dims[k].nx + dims[k].nu > 0) else { return Ok(None) };
    let old = dims[stage].ng;
    dims[stage].ng += 2;
    let mut qp = HeapQp::new(&dims)?;
    for (from, mut to) in known.qp.view().stages().zip(qp.stages_mut()) {
        copy(&from, &mut to);
    }
    let Some(mut to) = qp.stage_mut(stage) else { return Ok(None) };
    for j in 0..dims[stage].nx {
        let c = random.next();
        to.c_mut().set(old, j, c);
        to.c_mut().set(old + 1, j, -0.5 * c);
    }
    for j in 0..dims[stage].nu {
        let d = random.next();
        to.d_mut().set(old, j, d);
        to.d_mut().set(old + 1, j, -0.5 * d);
    }
    let at = random.next();
    to.g_bounds_mut().set(old, at + distance, f64::INFINITY);
    to.g_bounds_mut().set(old + 1, -0.5 * at, f64::INFINITY);
    Ok(Some((qp, stage)))
}

/// All data of a stage, into one that has at least as many rows.
fn copy(from: &Stage<'_, f64>, to: &mut StageMut<'_, f64>) {
    fn block(from: Block<'_, f64>, mut to: BlockMut<'_, f64>) {
        let (rows, columns) = from.shape();
        for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
            to.set(i, j, from.get(i, j).unwrap_or(f64::NAN));
        }
    }
    fn bounds(from: Bounds<'_, f64>, to: BoundsMut<'_, f64>) {
        let pairs = [
            (from.lower, to.lower),
            (from.upper, to.upper),
            (from.lower_linear, to.lower_linear),
            (from.lower_quadratic, to.lower_quadratic),
            (from.upper_linear, to.upper_linear),
            (from.upper_quadratic, to.upper_quadratic),
        ];
        for (from, to) in pairs {
            to[..from.len()].copy_from_slice(from);
        }
    }
    block(from.a(), to.a_mut());
    block(from.b(), to.b_mut());
    block(from.c(), to.c_mut());
    block(from.d(), to.d_mut());
    block(from.q(), to.q_mut());
    block(from.r(), to.r_mut());
    block(from.s(), to.s_mut());
    to.offset_mut().copy_from_slice(from.offset());
    to.gradient_x_mut().copy_from_slice(from.gradient_x());
    to.gradient_u_mut().copy_from_slice(from.gradient_u());
    bounds(from.x_bounds(), to.x_bounds_mut());
    bounds(from.u_bounds(), to.u_bounds_mut());
    bounds(from.g_bounds(), to.g_bounds_mut());
}

/// Problems with a control without bounds whose square costs less than nothing, or, where later
/// stages cost enough, something: no verdict but `NotConvex` or a point that satisfies the
/// conditions of optimality, and `NotConvex` only where the Hessian that is left when states are
/// eliminated has a negative eigenvalue.
#[test]
fn nonconvex_problems() -> Test {
    let mut class = VerdictCounts::new("some not convex");
    let mut convex = 0;
    for seed in seeds(300) {
        let mut random = Numbers::new(seed.wrapping_mul(7));
        let dims: Vec<_> = (0..2 + random.below(4))
            .map(|_| StageDims::new(1 + random.below(3), 1 + random.below(2), 0))
            .collect();
        let mut qp = HeapQp::<f64>::new(&dims)?;
        for mut stage in qp.stages_mut() {
            stage.a_mut().fill_with(|_, _| 0.7 * random.next());
            stage.b_mut().fill_with(|_, _| random.next());
            stage.q_mut().fill_with(|i, j| if i == j { 1.0 + random.next() } else { 0.0 });
            stage.r_mut().fill_with(|i, j| if i == j { random.next() } else { 0.0 });
            stage.s_mut().fill_with(|_, _| 0.3 * random.next());
            stage.gradient_u_mut().iter_mut().for_each(|r| *r = random.next());
            if random.chance(0.3) {
                stage.u_bounds_mut().set(0, -1.0, 1.0);
            }
        }
        let x0: Vec<f64> = (0..dims[0].nx).map(|_| random.next()).collect();
        qp.fix_initial_state(&x0)?;
        let mut solution = HeapSolution::new(&dims)?;
        let found = class.solve(&qp, QpStart::Cold, &mut solution);
        let least = min_reduced_eigenvalue(&qp);
        convex += u64::from(least > 1e-6);
        match found {
            Ok(_) => assert!(residuals(qp.view(), &solution).0.largest() <= TOLERANCE),
            Err(QpError::NotConvex { pivot, .. }) => {
                assert!(pivot < 0.0 && least < 0.0, "{seed}: {pivot:e} {least:e}");
            }
            Err(_) => assert!(least < 1e-6, "{seed}: {found:?} {least:e}"),
        }
        class.count(seed, &found.map(|_| None));
    }
    println!("{}", class.counts);
    let said = class.counts.count_of("NotConvex");
    let known = said + class.counts.count_of("Ok") + class.gave_up();
    assert!(said > 0 && convex > 0 && known == class.counts.all(), "{}", class.counts);
    Ok(())
}

/// The least eigenvalue of the Hessian over all controls, states eliminated.
fn min_reduced_eigenvalue(qp: &HeapQp<f64>) -> f64 {
    let dims = qp.dims();
    let controls: usize = dims.iter().map(|d| d.nu).sum();
    // What a control does to all variables, column after column.
    let mut hessian = nalgebra::DMatrix::<f64>::zeros(controls, controls);
    let mut states = nalgebra::DMatrix::<f64>::zeros(dims[0].nx, controls);
    let mut first = 0;
    for stage in qp.view().stages() {
        let matrix = |block: Block<'_, f64>| {
            let (rows, columns) = block.shape();
            nalgebra::DMatrix::from_fn(rows, columns, |i, j| block.get(i, j).unwrap_or(0.0))
        };
        let nu = stage.dims().nu;
        let own = nalgebra::DMatrix::from_fn(nu, controls, |i, j| f64::from(u8::from(j == first + i)));
        let mixed = own.transpose() * matrix(stage.s()) * &states;
        hessian += states.transpose() * matrix(stage.q()) * &states;
        hessian += own.transpose() * matrix(stage.r()) * &own;
        hessian += &mixed + mixed.transpose();
        states = matrix(stage.a()) * &states + matrix(stage.b()) * own;
        first += nu;
    }
    hessian.symmetric_eigenvalues().min()
}
