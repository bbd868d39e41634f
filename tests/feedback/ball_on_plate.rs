//! A ball on a plate with fast servos. Nothing of the cost holds the rates of the plate, and the
//! costate of the ball's velocity, large outside of a wall, bends the Lagrangian in them: `p·ω²`.

use crate::Test;
use casados::ocp::{
    Curvature, Fallback, HeapOcp, HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, OcpError, Problem,
};
use casados::prelude::*;
use casados::qp::{HeapInteriorPoint, QpError};
use nalgebra::{SVector, Vector2};

const SAMPLE: f64 = 0.02;
const WALL: f64 = 0.15;

/// Position m, velocity m/s, angle rad, rate rad/s of each axis; angles that the servos are told.
#[ode]
fn plate(x: [f64; 8], u: [f64; 2]) -> [f64; 8] {
    let roll = |p: f64, angle: f64, rate: f64| 5.0 / 7.0 * (p * rate * rate - 9.81 * angle.sin());
    let servo = |angle: f64, rate: f64, u: f64| ((u - angle) / 0.02 - 2.0 * rate) / 0.02;
    [
        x[1],
        roll(x[0], x[2], x[3]),
        x[3],
        servo(x[2], x[3], u[0]),
        x[5],
        roll(x[4], x[6], x[7]),
        x[7],
        servo(x[6], x[7], u[1]),
    ]
}
#[function]
fn deviation(x: [f64; 8], u: [f64; 2]) -> [f64; 6] {
    [x[0], x[1], x[4], x[5], u[0], u[1]]
}
#[function]
fn end(x: [f64; 8], _u: [f64; 2]) -> [f64; 4] {
    [x[0], x[1], x[4], x[5]]
}

type State = SVector<f64, 8>;
type Controlled = Problem<Irk<Plate, Gauss<2>>, LeastSquaresCost<Deviation>, LeastSquaresCost<End>>;

/// 4.5 cm outside of a wall that is soft; the first plan is a solution.
fn problem() -> Result<(HeapOcp<Controlled>, State), Box<dyn std::error::Error>> {
    let mut x = State::zeros();
    x[0] = WALL + 0.045;
    let mut ocp = Problem::new(Irk::<Plate, Gauss<2>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[100.0, 10.0, 100.0, 10.0, 0.1, 0.1]))
        .terminal_cost(LeastSquaresCost::<End>::diagonal(&[100.0, 10.0, 100.0, 10.0]))
        .on(Horizon::uniform(25, SAMPLE))?;
    ocp.fix_initial_state(x.as_slice())?.bound("u", .., -0.5, 0.5)?.guess(x.as_slice(), &[0.0; 2])?;
    for position in ["x[0]", "x[4]"] {
        ocp.bound(position, 1.., -WALL, WALL)?.soften(position, 1.., 1000.0, 1000.0)?;
    }
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    Ok((ocp, x))
}

/// What a loop saw: the farthest ball, the farthest one at the end, in which sample divergence was
/// first reported, and how often controls went from one bound to the other.
#[derive(Debug, Default)]
struct LoopRecord {
    farthest: f64,
    /// Over the last second.
    settled: f64,
    diverging: Option<(usize, f64)>,
    sign_changes: usize,
}

/// A loop of so many samples; measurements have an error of up to a tenth of a millimetre and of
/// 1 mm/s.
fn run_loop<C: Curvature<Irk<Plate, Gauss<2>>, f64>>(
    controller: HeapRealTime<Controlled, HeapInteriorPoint, C>,
    mut x: State,
    samples: usize,
) -> Result<LoopRecord, Box<dyn std::error::Error>> {
    let mut controller = controller.monitored()?;
    let mut plant = Irk::<Plate, Gauss<3>>::new(Options { steps: 2, ..Default::default() })?;
    let (mut seen, mut before) = (LoopRecord::default(), 0.0);
    for sample in 0..samples {
        let mut measured = x;
        for (i, size) in [(0, 1e-4), (1, 1e-3), (4, 1e-4), (5, 1e-3)] {
            measured[i] += size * (1.7 * (sample * (i + 3)) as f64).sin();
        }
        let feedback = controller.prepare()?.feedback(measured.as_slice())?;
        let u = Vector2::new(feedback.u[0], feedback.u[1]);
        let convergence = feedback.convergence.ok_or("monitored")?;
        println!(
            "{sample:3} {:8.4} m {:8.4} m/s u {:7.4} ratio {:8.4} {:?} step {:.1e}, {}",
            x[0],
            x[1],
            u[0],
            convergence.reduction_ratio,
            convergence.contraction,
            convergence.step_size,
            convergence.residuals
        );
        if feedback.is_diverging() && seen.diverging.is_none() {
            seen.diverging = Some((sample, x[0].abs()));
        }
        seen.sign_changes += usize::from(u[0] * before < -0.2);
        before = u[0];
        x = plant.solve(&x, &u, SAMPLE)?.x;
        seen.farthest = seen.farthest.max(x[0].abs());
        if sample as f64 * SAMPLE >= samples as f64 * SAMPLE - 1.0 {
            seen.settled = seen.settled.max(x[0].hypot(x[4]));
        }
        controller.shift();
    }
    println!("{seen:?}");
    Ok(seen)
}

/// Every control is `Ok`, and the ball leaves: the status says so while it is near.
#[test]
fn divergence_of_gauss_newton() -> Test {
    let (ocp, x) = problem()?;
    let seen = run_loop(HeapRealTime::new(ocp)?, x, 40)?;
    assert!(seen.farthest > 1.0 && seen.sign_changes > 5, "{seen:?}");
    let (_, place) = seen.diverging.ok_or("nothing was reported")?;
    assert!(place < 2.0 * WALL + 0.2, "{seen:?}");
    Ok(())
}

/// With exact Hessians the ball comes back, is within 5 mm all of the last second, and nothing is
/// reported.
#[test]
fn closed_loop_with_exact_hessians() -> Test {
    let (ocp, x) = problem()?;
    let seen = run_loop(HeapRealTime::exact(ocp)?, x, 160)?;
    assert!(seen.settled < 5e-3 && seen.farthest < WALL + 0.05, "{seen:?}");
    assert_eq!(seen.diverging, None);
    Ok(())
}

/// With the same state in every sample exact iterations converge to a solution, more than one in a
/// sample too.
#[test]
fn convergence_with_exact_hessians() -> Test {
    let (ocp, x) = problem()?;
    let mut solution = ocp.clone();
    assert!(HeapSqp::new(&solution)?.solve(&mut solution)?.is_converged());
    let mut controller = HeapRealTime::exact(ocp)?.monitored()?;
    let mut other = x;
    other[0] -= 0.01;
    controller.prepare()?.feedback(other.as_slice())?;
    controller.contraction_test.tolerance = 1e-7;
    let mut late = 2;
    let feedback = controller.prepare()?.feedback_iterated(x.as_slice(), 40, &mut || {
        late -= 1;
        late < 0
    });
    assert!(feedback.is_err() || feedback.is_ok_and(|feedback| feedback.iterations <= 3));
    let feedback = controller.prepare()?.feedback_iterated(x.as_slice(), 40, &mut || false)?;
    assert!(feedback.iterations < 40, "{}", feedback.iterations);
    // Residuals of 1e-7, and curvatures of controls of 0.002 at least.
    let expected = solution.stage(0)?.u;
    assert!(
        feedback.u.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3),
        "{:?} {expected:?}",
        feedback.u
    );
    Ok(())
}

/// Where a measurement is broken the control is the one that was chosen for that.
#[test]
fn controls_after_invalid_measurements() -> Test {
    let (ocp, x) = problem()?;
    let mut controller = HeapRealTime::exact(ocp)?;
    let first = controller.prepare()?.feedback(x.as_slice())?.u.to_vec();
    controller.shift();
    let next = controller.ocp().stage(0)?.u.to_vec();
    let broken = [f64::NAN; 8];
    let (u, feedback) = controller.prepare()?.feedback_or(&broken, &mut || false, Fallback::Plan);
    assert!(u == next && matches!(feedback, Err(OcpError::InvalidValue { .. })));
    let held = Fallback::Control(&first);
    let (u, feedback) = controller.prepare()?.feedback_or(x.as_slice(), &mut || true, held);
    assert!(u == first && matches!(feedback, Err(OcpError::Qp(QpError::OutOfTime { .. }))));
    let (u, feedback) = controller.prepare()?.feedback_or(x.as_slice(), &mut || false, held);
    assert_eq!(u, feedback?.u);
    Ok(())
}
