//! Anything at all into the solver: data, starts and options that no problem has.
//!
//! A verdict is an answer that is finite and satisfies its conditions, or an error that is true. A
//! solver that has seen all of it says the same as one that never did.

use crate::Test;
use crate::known_solutions::{HessianKind, Numbers, PLAIN, ProblemKind, numbers, problem};
use crate::runs::{Counts, prints_verdicts, seeds};
use casados::qp::{
    Bounds, BoundsMut, HeapInteriorPoint, HeapQp, HeapSolution, InteriorPointOptions, QpError, QpSolver,
    QpStart, QpStatistics, Residuals, StageMut, residuals,
};

const SPECIAL: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    -f64::MAX,
    f64::MIN_POSITIVE,
    5e-324,
    1e-300,
    1e300,
    -1e30,
    1e-30,
    f64::EPSILON,
    1e15,
];

fn any_number(random: &mut Numbers) -> f64 {
    match random.below(4) {
        0 => random.next() * random.power(300.0),
        1 => random.next() * random.power(8.0),
        _ => SPECIAL[random.below(SPECIAL.len())],
    }
}

/// An element of the data of a stage.
fn spoil_stage(random: &mut Numbers, stage: &mut StageMut<'_, f64>) {
    let value = any_number(random);
    let element = |values: &mut [f64], random: &mut Numbers| {
        let at = random.below(values.len());
        if let Some(element) = values.get_mut(at) {
            *element = value;
        }
    };
    match random.below(14) {
        0 => element(stage.offset_mut(), random),
        1 => element(stage.gradient_x_mut(), random),
        2 => element(stage.gradient_u_mut(), random),
        3..9 => {
            let (i, j) = (random.below(9), random.below(9));
            let mut block = match random.below(7) {
                0 => stage.a_mut(),
                1 => stage.b_mut(),
                2 => stage.q_mut(),
                3 => stage.r_mut(),
                4 => stage.s_mut(),
                5 => stage.c_mut(),
                _ => stage.d_mut(),
            };
            let (rows, columns) = block.as_block().shape();
            block.set(i % rows.max(1), j % columns.max(1), value);
        }
        kind => {
            let bounds = bounds_of(stage, kind % 3);
            let sides = [
                bounds.lower,
                bounds.upper,
                bounds.lower_linear,
                bounds.upper_linear,
                bounds.upper_quadratic,
            ];
            let which = random.below(sides.len());
            if let Some(side) = sides.into_iter().nth(which) {
                element(side, random);
            }
        }
    }
}

fn bounds_of<'a>(stage: &'a mut StageMut<'_, f64>, kind: usize) -> BoundsMut<'a, f64> {
    match kind {
        0 => stage.x_bounds_mut(),
        1 => stage.u_bounds_mut(),
        _ => stage.g_bounds_mut(),
    }
}

fn options(random: &mut Numbers) -> InteriorPointOptions {
    let mut options = InteriorPointOptions::new::<f64>();
    let positive = |random: &mut Numbers| any_number(random).abs();
    match random.below(10) {
        0 => options.tolerance = positive(random),
        1 => options.relative_tolerance = positive(random),
        2 => options.max_iterations = [0, 1, 3, 1000][random.below(4)],
        3 => options.start_mu = positive(random),
        4 => options.active_sets = [0, 1, 100][random.below(3)],
        5 => options.warm_distance = positive(random),
        // Above the bounds that there are: below they mean none.
        6 => options.no_bound = 1e3 + positive(random),
        7 => options.locate = false,
        _ => {}
    }
    options
}

/// Numbers of all kinds.
fn random_start(random: &mut Numbers, solution: &mut HeapSolution<f64>) -> QpStart {
    for k in 0..solution.dims().len() {
        let Some(stage) = solution.stage_mut(k) else { break };
        for value in stage.x.iter_mut().chain(stage.u).chain(stage.g_lower).chain(stage.x_upper) {
            *value = if random.chance(0.1) { any_number(random) } else { random.next() };
        }
    }
    if random.chance(0.5) { QpStart::Warm } else { QpStart::Cold }
}

/// What residuals may be of a point that is a solution: the tolerance, the relative one of the
/// largest terms, and what another order of summation rounds.
fn allowed_residual(options: &InteriorPointOptions, qp: &HeapQp<f64>, solution: &HeapSolution<f64>) -> f64 {
    let size = |values: &[f64]| {
        values.iter().filter(|value| value.is_finite()).fold(0.0, |size: f64, value| size.max(value.abs()))
    };
    let (mut data, mut bounds): (f64, f64) = (1.0, 0.0);
    for stage in qp.view().stages() {
        for block in [stage.a(), stage.b(), stage.c(), stage.d(), stage.q(), stage.r(), stage.s()] {
            let (rows, columns) = block.shape();
            for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
                data = data.max(block.get(i, j).map_or(0.0, f64::abs));
            }
        }
        bounds = bounds.max(size(stage.gradient_x()).max(size(stage.gradient_u())).max(size(stage.offset())));
        for Bounds { lower, upper, .. } in [stage.x_bounds(), stage.u_bounds(), stage.g_bounds()] {
            bounds = bounds.max(size(lower)).max(size(upper));
        }
    }
    let point = size(&numbers(solution).collect::<Vec<_>>());
    // Products of distances and multipliers are the largest.
    let terms = (data * point + bounds) * point.max(1.0);
    let relative = options.relative_tolerance.max(1e2 * f64::EPSILON);
    (options.tolerance + relative * terms).min(f64::MAX)
}

struct VerdictCounts {
    counts: Counts,
    solver: HeapInteriorPoint<f64>,
}

impl VerdictCounts {
    fn new(name: &str) -> Self {
        Self { counts: Counts::new(name), solver: HeapInteriorPoint::new() }
    }

    fn solve(
        &mut self,
        seed: u64,
        qp: &HeapQp<f64>,
        start: QpStart,
        solution: &mut HeapSolution<f64>,
    ) -> Result<QpStatistics, QpError> {
        let mut other = solution.clone();
        let found = self.solver.solve(qp.view(), start, solution.view_mut());
        let mut fresh = HeapInteriorPoint::new();
        fresh.options = self.solver.options;
        let again = fresh.solve(qp.view(), start, other.view_mut());
        assert_eq!(format!("{found:?}"), format!("{again:?}"), "{seed}");
        assert!(numbers(solution).zip(numbers(&other)).all(|(a, b)| a.to_bits() == b.to_bits()), "{seed}");
        if let Ok(statistics) = found {
            assert!(numbers(solution).all(f64::is_finite), "{seed}");
            assert!(statistics.objective.is_finite(), "{seed}: {statistics:?}");
            let (Residuals { stationarity, dynamics, inequalities, complementarity, .. }, _) =
                residuals(qp.view(), solution);
            let allowed = allowed_residual(&self.solver.options, qp, solution);
            for residual in [stationarity, dynamics, inequalities, complementarity] {
                assert!(residual <= 10.0 * allowed, "{seed}: {residual:e} {allowed:e} {statistics:?}");
            }
        }
        self.counts.count_result(&found);
        if prints_verdicts() && found.is_err() {
            println!("{} {seed}: {found:?}", self.counts);
        }
        found
    }
}

fn random_kind(random: &mut Numbers) -> ProblemKind {
    let hessian = [HessianKind::Definite, HessianKind::LowRank, HessianKind::Zero][random.below(3)];
    ProblemKind {
        hessian,
        degenerate: random.chance(0.3),
        soft: random.chance(0.3).then_some(1e9),
        empty: random.chance(0.5),
        ..PLAIN
    }
}

/// Some elements of the data, the start, and an option may be anything.
#[test]
fn arbitrary_problems() -> Test {
    let mut class = VerdictCounts::new("anything for data, starts, options");
    for seed in seeds(600) {
        let mut random = Numbers::new(seed ^ (7 << 40));
        let kind = random_kind(&mut random);
        let mut qp = problem(&mut random, &kind)?.qp;
        for _ in 0..random.below(4) {
            let stage = random.below(qp.dims().len());
            spoil_stage(&mut random, &mut qp.stage_mut(stage).ok_or("no stage")?);
        }
        let mut solution = HeapSolution::new(qp.dims())?;
        let start = random_start(&mut random, &mut solution);
        class.solver.options = options(&mut random);
        let _ = class.solve(seed, &qp, start, &mut solution);
    }
    println!("{}", class.counts);
    assert!(class.counts.count_of("Ok") > 0 && class.counts.count_of("InvalidValue") > 0, "{}", class.counts);
    Ok(())
}

/// Gradients, penalties and bounds of all sizes, of problems that have a feasible point and are
/// convex: it is never said that they are not.
#[test]
fn huge_and_tiny_data() -> Test {
    let mut class =
        VerdictCounts::new("feasible and convex, with anything finite for gradients and far bounds");
    for seed in seeds(600) {
        let mut random = Numbers::new(seed ^ (8 << 40));
        let kind = random_kind(&mut random);
        let mut qp = problem(&mut random, &kind)?.qp;
        for _ in 0..1 + random.below(4) {
            let stage = random.below(qp.dims().len());
            let mut stage = qp.stage_mut(stage).ok_or("no stage")?;
            let exponent = if random.chance(0.5) { 300.0 } else { 12.0 };
            let size = random.power(exponent);
            let which = random.below(5);
            let at = random.below(8);
            if which < 2 {
                let gradient = if which == 0 { stage.gradient_x_mut() } else { stage.gradient_u_mut() };
                gradient.iter_mut().skip(at).take(1).for_each(|g| *g = size * random.next());
            } else {
                // Farther away than where it is.
                let bounds = bounds_of(&mut stage, which - 2);
                let pair = bounds.lower.iter_mut().zip(bounds.upper).nth(at);
                if let Some((lower, upper)) = pair.filter(|(lower, upper)| **lower < **upper) {
                    (*lower, *upper) = (lower.min(-size), upper.max(size));
                }
            }
        }
        let mut solution = HeapSolution::new(qp.dims())?;
        let start = random_start(&mut random, &mut solution);
        let found = class.solve(seed, &qp, start, &mut solution);
        let is_true = matches!(found, Ok(_) | Err(QpError::Stalled { .. } | QpError::MaxIterations { .. }));
        assert!(is_true, "{seed}: {found:?}");
    }
    println!("{}", class.counts);
    assert!(class.counts.count_of("Ok") > class.counts.all() / 4, "{}", class.counts);
    Ok(())
}
