//! Real-time iterations at random states.

use super::{Draw, Numbers, linear, nonlinear, pendulum_step, spring_step};
use crate::Test;
use crate::runs::{Counts, error_kind, prints_verdicts, seeds};
use casados::ocp::{Formulation, HeapOcp, HeapRealTime, OcpError};
use casados::qp::{QpError, QpView, residuals};

/// Whether clarabel finds a solution, too.
fn is_solved_by_clarabel(qp: QpView<'_, f64>) -> Result<bool, QpError> {
    use casados::qp::{Clarabel, HeapSolution, QpSolver, QpStart};
    let mut solution = HeapSolution::new(qp.dims())?;
    Ok(Clarabel::new().solve(qp, QpStart::Cold, solution.view_mut()).is_ok())
}

/// Some samples of a controller, of states near the start and far from it, beside another one that
/// sees only those which the first has an answer for. Of equations that are linear the start itself
/// has a plan always.
fn run_controller<P: Formulation<f64>>(
    counts: &mut Counts,
    seed: u64,
    random: &mut Numbers,
    [first, second]: [HeapOcp<P>; 2],
    (start, linear): (&[f64; 2], bool),
) -> Test {
    let mut controller = HeapRealTime::new(first)?;
    let mut same = HeapRealTime::new(second)?;
    for _ in 0..6 {
        let far = [0.0, 0.0, 0.01, 0.1, 1.0, f64::NAN][random.below(6)];
        let measured = start.map(|x| x + far * random.next());
        let found = match controller.prepare() {
            Ok(prepared) => prepared.feedback(&measured).map(|feedback| feedback.u[0]),
            Err(error) => Err(error),
        };
        let ocp = controller.ocp();
        match found {
            Ok(u) => {
                let again = same.prepare()?.feedback(&measured)?.u[0];
                assert_eq!(u.to_bits(), again.to_bits(), "{seed}: {u} {again}");
                let (all, others) = (numbers!(ocp), numbers!(same.ocp()));
                assert!(all.iter().zip(&others).all(|(a, b)| a.to_bits() == b.to_bits()), "{seed}");
                // Residuals are sums of a few products of data of size ten and the numbers of the
                // plan.
                let size = all.iter().fold(1.0, |size: f64, number| size.max(number.abs()));
                let (judged, _) = residuals(ocp.qp(), ocp.iterate());
                // Where numbers are above 32 the tolerance is meant in units.
                let tolerance = controller.qp_solver.options.tolerance * (size / 32.0).max(1.0);
                let allowed = tolerance + 1e3 * f64::EPSILON * size;
                assert!(judged.largest() <= allowed, "{seed}: {judged}, allowed {allowed:e}");
                counts.count("Ok");
            }
            Err(error) => {
                if let OcpError::Qp(QpError::Infeasible { .. }) = error {
                    assert!(far > 0.0 || !linear, "{seed}: {error}");
                    assert!(!is_solved_by_clarabel(ocp.qp())?, "{seed}: {error}");
                }
                if prints_verdicts() {
                    println!("{counts} {seed}: {error}");
                }
                match error {
                    OcpError::Qp(error) => counts.count(&error_kind(&error)),
                    error => counts.count(&error_kind(&error)),
                }
            }
        }
    }
    Ok(())
}

/// Controllers whose bounds are hard: states from where no plan satisfies them are said to be so,
/// which is true, and leave nothing behind.
#[test]
fn real_time_iterations() -> Test {
    let mut spring = Counts::new("real-time iterations, spring");
    let mut pendulum = Counts::new("real-time iterations, pendulum with bounded power");
    for seed in seeds(100) {
        let random = &mut Numbers(seed ^ (1 << 40));
        let draw = Draw::new(random, spring_step);
        let both = [linear(&draw)?, linear(&draw)?];
        run_controller(&mut spring, seed, random, both, (&draw.x[0], true))?;
        let draw = Draw::new(random, pendulum_step);
        let both = [nonlinear(&draw)?, nonlinear(&draw)?];
        run_controller(&mut pendulum, seed, random, both, (&draw.x[0], false))?;
    }
    println!("{spring}\n{pendulum}");
    // Guesses far away leave linearisations of the pendulum that no plan satisfies.
    for (counts, part) in [(spring, 2), (pendulum, 10)] {
        let given_up = counts.count_of_any(&["MaxIterations", "Stalled"]);
        assert!(part * counts.count_of("Ok") >= counts.all() && 100 * given_up <= counts.all(), "{counts}");
    }
    Ok(())
}
