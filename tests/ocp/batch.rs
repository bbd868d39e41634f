//! Batches of problems: each instance is solved, differentiated or refused as it is alone, to the
//! bit; derivatives against differences of solutions.

use crate::Test;
use crate::runs::{Counts, error_kind, seeds};
use casados::ocp::{
    BatchOcp, BatchRealTime, ConvexCost, Exact, ExactFormulation, GeneralCost, HeapIpm, HeapOcp,
    HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, OcpError, OcpSolver, Outcome, Problem, PseudoHuber,
    Sample, SolutionFactors, Status, closed_loop, plant,
};
use casados::prelude::*;
use casados::qp::HeapSolution;

/// Angle from upright and rate; torque; weights of the angle, of the rate, and friction.
#[ode]
fn pendulum(x: [f64; 2], u: [f64; 1], p: [f64; 3]) -> [f64; 2] {
    [x[1], 4.0 * x[0].sin() - p[2] * x[1] + 6.0 * u[0]]
}

#[function]
fn price(x: [f64; 2], u: [f64; 1], p: [f64; 3]) -> f64 {
    p[0] * (1.0 - x[0].cos()) + 0.5 * p[1] * x[1] * x[1] + 0.5 * u[0] * u[0]
}

const N: usize = 20;

fn problem() -> Result<HeapOcp<impl ExactFormulation<f64> + Send + Sync>, OcpError> {
    let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Price>::new())
        .on(Horizon::uniform(N, 0.1))?;
    ocp.fix_initial_state(&[0.5, 0.0])?.set_parameters(.., &[2.0, 0.2, 0.1])?;
    ocp.bound("u", .., -1.0, 1.0)?.bound("x[1]", 1.., -4.0, 4.0)?.guess(&[0.0; 2], &[0.0])?;
    Ok(ocp)
}

/// Numbers between −1 and 1 (splitmix64: Steele, Lea, Flood, OOPSLA 2014).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    fn with_probability(&mut self, share: f64) -> bool {
        0.5 * (self.next() + 1.0) < share
    }
}

/// A problem as nobody asks for it: far away, with NaN, without a way.
fn spoil_problem<P: ExactFormulation<f64>>(
    ocp: &mut HeapOcp<P>,
    random: &mut Numbers,
) -> Result<(), OcpError> {
    let x0 = [2.0 * random.next(), 2.0 * random.next()];
    let p = [3.0 + 2.0 * random.next(), 0.3 + 0.2 * random.next(), 0.1 + 0.1 * random.next()];
    ocp.fix_initial_state(&x0)?.set_parameters(.., &p)?.guess(&x0, &[0.0])?;
    if random.with_probability(0.1) {
        ocp.iterate_mut().stage_mut(3).into_iter().for_each(|stage| stage.x[0] = f64::NAN);
    } else if random.with_probability(0.1) {
        // No torque is enough.
        ocp.bound("x[0]", 2.., 3.0, 4.0)?;
    } else if random.with_probability(0.1) {
        // Angles are rewarded: the QP is not convex.
        ocp.set_parameters(.., &[-30.0, 0.1, 0.0])?;
    }
    Ok(())
}

/// All that a run says but for what it took of time.
fn said(outcome: &Result<Outcome, OcpError>) -> String {
    match outcome {
        Ok(outcome) => {
            let Outcome { status, iterations, objective, residuals, qp_iterations, violated, .. } = outcome;
            format!("{status:?} {iterations} {objective:?} {residuals:?} {qp_iterations} {violated:?}")
        }
        Err(error) => format!("{error:?}"),
    }
}

/// The bits of states, controls and multipliers.
fn bits_of_iterate(point: &HeapSolution<f64>) -> Vec<u64> {
    let parts = point.stages().flat_map(|at| {
        [at.x, at.u, at.dynamics, at.x_lower, at.x_upper, at.u_lower, at.u_upper].into_iter().flatten()
    });
    parts.map(|value| value.to_bits()).collect()
}

/// A seed that asks for everything.
fn weights(instance: usize, seed: &mut HeapSolution<f64>) {
    for k in 0..=N {
        if let Some(stage) = seed.stage_mut(k) {
            let all = stage.x.iter_mut().chain(stage.u).enumerate();
            all.for_each(|(i, weight)| *weight = ((1 + instance + 3 * k + i) as f64).sin());
        }
    }
}

/// Solves and differentiates batches, and each problem alone with memory that nobody used before.
fn check_against_single_solves<P, S>(ocp: &HeapOcp<P>, solver: &S, counts: &mut Counts) -> Test
where
    P: ExactFormulation<f64> + Send + Sync,
    S: OcpSolver<P, f64>,
{
    for seed in seeds(3) {
        let mut random = Numbers(seed);
        let mut batch = BatchOcp::new(ocp, 1 + 9 * seed as usize, solver.clone())?;
        for instance in batch.instances_mut() {
            spoil_problem(instance, &mut random)?;
        }
        let mut alone = batch.instances().to_vec();
        // Derivatives that are smoothed, or not.
        batch.smoothing = if seed == 1 { 1e-3 } else { 0.0 };
        let smoothing = batch.smoothing;
        let outcomes: Vec<_> = batch.solve()?.iter().map(said).collect();
        assert_eq!(outcomes.len(), alone.len());
        let mut solved = Vec::new();
        for ((together, said_of_it), alone) in batch.instances().iter().zip(&outcomes).zip(&mut alone) {
            let outcome = solver.clone().solve(alone);
            assert_eq!(&said(&outcome), said_of_it);
            assert_eq!(bits_of_iterate(together.iterate()), bits_of_iterate(alone.iterate()));
            counts.count(&outcome.as_ref().map_or_else(error_kind, |outcome| error_kind(&outcome.status)));
            solved.push(outcome);
        }
        let gradients = batch.adjoint(Exact::default(), |i, _, seed| weights(i, seed))?;
        assert_eq!(gradients.iter().len(), alone.len());
        let mut factors = SolutionFactors::new(ocp)?;
        factors.smoothing = smoothing;
        for (i, ((found, alone), outcome)) in gradients.iter().zip(&mut alone).zip(&solved).enumerate() {
            if !outcome.as_ref().is_ok_and(Outcome::is_solved) {
                let expected = outcome.as_ref().err().copied().unwrap_or(OcpError::NoSolution);
                assert_eq!(format!("{:?}", found.err()), format!("{:?}", Some(expected)));
                continue;
            }
            let mut of = HeapSolution::new(ocp.qp().dims())?;
            weights(i, &mut of);
            match alone.factorise(Exact::default(), &mut factors) {
                Ok(()) => {
                    let (found, alone) = (found?, factors.adjoint(&of)?);
                    assert_eq!((found.x0, found.p), (alone.x0, alone.p));
                }
                Err(error) => assert_eq!(format!("{:?}", found.err()), format!("{:?}", Some(error))),
            }
        }
    }
    Ok(())
}

#[test]
fn batches_and_single_solves() -> Test {
    let ocp = problem()?;
    let mut counts = Counts::new("batches of optimal control problems, some NaN, infeasible or not convex");
    let (mut sqp, mut ipm) = (HeapSqp::new(&ocp)?, HeapIpm::new(&ocp)?);
    (sqp.options.max_iterations, ipm.options.max_iterations) = (60, 60);
    check_against_single_solves(&ocp, &sqp, &mut counts)?;
    check_against_single_solves(&ocp, &ipm, &mut counts)?;
    println!("{counts}");
    let failures = ["InvalidValue", "Infeasible"].map(|verdict| counts.count_of(verdict));
    assert!(failures.iter().all(|&count| count > 0) && counts.count_of("Converged") > 10, "{counts}");
    Ok(())
}

#[test]
fn iteration_limit_of_an_instance() -> Test {
    let ocp = problem()?;
    let mut batch = BatchOcp::new(&ocp, 4, HeapSqp::new(&ocp)?)?;
    batch.solve()?;
    // Three begin at the solution, one far from it.
    batch.instances_mut()[2].guess(&[3.0, 0.0], &[0.0])?;
    batch.configure(|sqp| sqp.options.max_iterations = 1);
    let statuses: Vec<_> = batch.solve()?.iter().flatten().map(|outcome| outcome.status).collect();
    let expected = [Status::Converged, Status::Converged, Status::MaxIterations, Status::Converged];
    assert_eq!(statuses, expected);
    assert_eq!(batch.outcomes().len(), 4);
    // Of that one there are no derivatives, of the others there are.
    let found = batch.value_gradient(Exact::default())?;
    assert!(matches!(found.get(2), Err(OcpError::NoSolution)) && found.get(3).is_ok());
    assert!(matches!(found.get(4), Err(OcpError::NoSolution)));
    assert!(batch.differentiate(Exact::default())?[2].is_err());
    assert!(batch.sensitivities(2).is_none() && batch.sensitivities(1).is_some());
    Ok(())
}

/// Gradients of values, adjoints of the first control and forward derivatives against central
/// differences of solutions, in each parameter and each initial state. With `h = 1e-5` these are
/// off by `h²` times third derivatives and `1e-11 / h` of the tolerance: 1e-5 is above both.
#[test]
fn derivatives_of_solutions() -> Test {
    let ocp = problem()?;
    let h = 1e-5;
    let starts = [[0.3, 0.1], [-0.4, 0.5], [0.1, -0.2]];
    // Each start, then moved by ±h in x₀[0], x₀[1], p[0], p[1], p[2].
    let mut batch = BatchOcp::new(&ocp, 3 * 11, HeapSqp::new(&ocp)?)?;
    batch.configure(|sqp| sqp.options.tolerance = 1e-11);
    for (i, instance) in batch.instances_mut().iter_mut().enumerate() {
        let (mut x0, mut p) = (starts[i / 11], [2.0, 0.2, 0.1]);
        if let Some(moved) = (i % 11).checked_sub(1) {
            let step = if moved % 2 == 0 { h } else { -h };
            match moved / 2 {
                state @ (0 | 1) => x0[state] += step,
                parameter => p[parameter - 2] += step,
            }
        }
        instance.fix_initial_state(&x0)?.set_parameters(.., &p)?;
    }
    let outcomes = batch.solve()?;
    assert!(outcomes.iter().all(|outcome| outcome.as_ref().is_ok_and(Outcome::is_converged)));
    let values: Vec<_> = outcomes.iter().flatten().map(|outcome| outcome.objective).collect();
    let mut controls = Vec::new();
    for instance in batch.instances() {
        controls.push(instance.stage(0)?.u[0]);
    }
    assert!(controls.iter().all(|u| u.abs() < 0.99), "no bound is active: {controls:?}");
    let slopes = |of: &[f64], start: usize| -> Vec<f64> {
        (0..5).map(|i| (of[11 * start + 1 + 2 * i] - of[11 * start + 2 + 2 * i]) / (2.0 * h)).collect()
    };
    let close = |found: &[f64], expected: &[f64]| {
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {expected:?}");
    };
    for start in 0..3 {
        let gradients = batch.value_gradient(Exact::default())?;
        let found = gradients.get(11 * start)?;
        close(&[found.x0, found.p].concat(), &slopes(&values, start));
        let gradients = batch.adjoint(Exact::default(), |_, _, seed| {
            seed.stage_mut(0).into_iter().for_each(|stage| stage.u[0] = 1.0);
        })?;
        let found = gradients.get(11 * start)?;
        close(&[found.x0, found.p].concat(), &slopes(&controls, start));
    }
    batch.differentiate(Exact::default())?;
    for start in 0..3 {
        let found = batch.sensitivities(11 * start).ok_or("it was differentiated")?;
        close(&[found.du(0), found.du_dp(0)].concat(), &slopes(&controls, start));
    }
    Ok(())
}

#[function]
fn output(x: [f64; 2], u: [f64; 1], p: [f64; 3]) -> [f64; 2] {
    [x[0] + 0.1 * u[0].sin(), x[1] + p[2] * x[0] * x[0]]
}
#[function]
fn torque(_x: [f64; 2], u: [f64; 1], _p: [f64; 3]) -> f64 {
    u[0]
}
#[function]
fn rest(x: [f64; 2], _u: [f64; 1], _p: [f64; 3]) -> [f64; 2] {
    x
}

/// Gradients by references against central differences, as above: of least squares with coupled
/// weights, of a convex function beside it, and of the terminal cost.
#[test]
fn derivatives_by_reference_values() -> Test {
    let weights = nalgebra::matrix![2.0, 0.5; 0.5, 1.0];
    let huber = PseudoHuber { weights: [1.0], delta: [0.7] };
    let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options::default())?)
        .running_cost((LeastSquaresCost::<Output>::new(&weights), ConvexCost::<Torque, _>::new(huber)))
        .terminal_cost(LeastSquaresCost::<Rest>::diagonal(&[3.0, 1.0]))
        .on(Horizon::uniform(4, 0.1))?;
    ocp.fix_initial_state(&[0.3, 0.1])?.set_parameters(.., &[2.0, 0.2, 0.1])?.guess(&[0.0; 2], &[0.0])?;
    // Three references of each of four stages, and two at the end.
    let (h, count) = (1e-5, 4 * 3 + 2);
    let mut batch = BatchOcp::new(&ocp, 1 + 2 * count, HeapSqp::new(&ocp)?)?;
    batch.configure(|sqp| sqp.options.tolerance = 1e-11);
    for (i, instance) in batch.instances_mut().iter_mut().enumerate() {
        let mut references: Vec<f64> = (0..count).map(|j| 0.1 * (j as f64).sin()).collect();
        if let Some(moved) = i.checked_sub(1) {
            references[moved / 2] += if moved % 2 == 0 { h } else { -h };
        }
        for k in 0..4 {
            instance.set_reference(k..=k, &references[3 * k..3 * k + 3])?;
        }
        instance.set_terminal_reference(&references[12..])?;
    }
    let outcomes = batch.solve()?;
    assert!(outcomes.iter().all(|outcome| outcome.as_ref().is_ok_and(Outcome::is_converged)));
    let values: Vec<_> = outcomes.iter().flatten().map(|outcome| outcome.objective).collect();
    let mut sums = Vec::new();
    for instance in batch.instances() {
        sums.push(instance.stage(0)?.u[0] + 0.5 * instance.stage(3)?.x[0]);
    }
    let check = |found: &[f64], of: &[f64]| {
        assert_eq!(found.len(), count);
        for (i, found) in found.iter().enumerate() {
            let expected = (of[1 + 2 * i] - of[2 + 2 * i]) / (2.0 * h);
            assert!((found - expected).abs() < 1e-5, "{i}: {found} {expected}");
        }
    };
    check(batch.value_gradient(Exact::default())?.get(0)?.references, &values);
    let gradients = batch.adjoint(Exact::default(), |_, _, seed| {
        seed.stage_mut(0).into_iter().for_each(|stage| stage.u[0] = 1.0);
        seed.stage_mut(3).into_iter().for_each(|stage| stage.x[0] = 0.5);
    })?;
    check(gradients.get(0)?.references, &sums);
    Ok(())
}

/// Many plants at once: controls and statuses are those of controllers alone, and one that is
/// broken leaves the others alone.
#[test]
fn real_time_iterations_of_many_plants() -> Test {
    let ocp = problem()?;
    let mut together = BatchRealTime::new(&ocp, 7)?.with_curvature(Exact::default());
    let mut alone: Vec<_> = (0..7).map(|_| HeapRealTime::exact(ocp.clone())).collect::<Result<_, _>>()?;
    let mut erk = Erk::<Pendulum, Rk4>::new(Options::default())?;
    erk.set_parameters(&nalgebra::vector![2.0, 0.2, 0.1])?;
    let mut x: Vec<f64> = (0..14).map(|i| 0.1 * (i as f64).sin()).collect();
    for sample in 0..10 {
        // A sensor is broken for a moment.
        let seen = if sample == 4 { f64::NAN } else { x[6] };
        let measured: Vec<f64> = x.iter().enumerate().map(|(i, &x)| if i == 6 { seen } else { x }).collect();
        let u = together.prepare()?.feedback(&measured)?.to_vec();
        for (i, controller) in alone.iter_mut().enumerate() {
            match controller.prepare()?.feedback(&measured[2 * i..2 * i + 2]) {
                Ok(feedback) => assert_eq!(feedback.u[0].to_bits(), u[i].to_bits()),
                Err(_) => assert!(i == 3 && sample == 4),
            }
            assert_eq!(together.statuses()[i].is_err(), i == 3 && sample == 4);
            controller.shift();
            let end = erk.solve(&nalgebra::vector![x[2 * i], x[2 * i + 1]], &nalgebra::vector![u[i]], 0.1)?;
            x[2 * i..2 * i + 2].copy_from_slice(end.x.as_slice());
        }
        together.shift();
    }
    assert!(matches!(together.prepare()?.feedback(&[0.0; 13]), Err(OcpError::Length { found: 13, .. })));
    Ok(())
}

/// A controller that solves to the end gives the closed loop that was planned: nothing disturbs it,
/// the plant is the model, and the horizon is long.
#[test]
fn closed_loop_of_converged_controllers() -> Test {
    let mut ocp = problem()?;
    ocp.guess(&[0.0; 2], &[0.0])?;
    let mut plan = ocp.clone();
    assert!(HeapSqp::new(&plan)?.solve(&mut plan)?.is_converged());
    let sqp = HeapSqp::new(&ocp)?;
    let mut controller = (ocp, sqp);
    let mut erk = Erk::<Pendulum, Rk4>::new(Options::default())?;
    let p = nalgebra::vector![2.0, 0.2, 0.1];
    let run = closed_loop(&mut controller, plant(&mut erk, &p), |_, _| {}, &[0.5, 0.0], 30)?;
    assert!(run.failures.is_empty() && run.costs.len() == 30 && run.durations.len() == 30);
    let (x, u) = (run.trajectory.state("x[0]")?, run.trajectory.control("u")?);
    assert_eq!((x.len(), u.len(), run.trajectory.times()[30]), (31, 30, 30.0 * 0.1));
    assert!((u[0] - plan.stage(0)?.u[0]).abs() < 1e-6 && (x[1] - plan.stage(1)?.x[0]).abs() < 1e-6);
    // Costs are those of the states and controls as they were, over samples of 0.1 s.
    let mut sum = 0.0;
    for (k, cost) in run.costs.iter().enumerate() {
        let at = ([x[k], run.trajectory.state("x[1]")?[k]], [u[k]], [2.0, 0.2, 0.1]);
        assert!((cost - 0.1 * price(at.0, at.1, at.2)).abs() < 1e-12);
        sum += cost;
    }
    assert!((run.cost() - sum).abs() < 1e-12 && x[30].abs() < 0.1);
    assert_eq!(run.trajectory.get("u")?.lower[3], Some(-1.0));
    assert!(run.trajectory.violations(1e-6).is_empty());
    // A controller that cannot see holds its control, and says why.
    let blind = |sample: Sample<f64>, x: &mut [f64]| {
        if sample.index == 5 {
            x[0] = 100.0;
        }
    };
    controller.0.bound("x[0]", 1.., -3.0, 3.0)?.guess(&[0.0; 2], &[0.0])?;
    let run = closed_loop(&mut controller, plant(&mut erk, &p), blind, &[0.5, 0.0], 8)?;
    assert!(!run.failures.is_empty() && run.failures[0].0 == 6);
    assert_eq!(run.trajectory.control("u")?[6], run.trajectory.control("u")?[5]);
    assert!(!run.trajectory.violations(1.0).is_empty());
    Ok(())
}

#[test]
fn empty_batches() -> Test {
    let ocp = problem()?;
    let mut batch = BatchOcp::new(&ocp, 0, HeapIpm::new(&ocp)?)?;
    assert!(batch.solve()?.is_empty() && batch.outcomes().is_empty());
    assert_eq!(batch.adjoint(Exact::default(), |_, _, _| {})?.iter().len(), 0);
    assert!(batch.differentiate(Exact::default())?.is_empty() && batch.sensitivities(0).is_none());
    Ok(())
}
