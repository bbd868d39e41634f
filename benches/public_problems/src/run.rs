//! One problem, one solver, timed.

use crate::Failure;
use casados::ocp::{Formulation, HeapIpm, HeapOcp, HeapSqp, Iteration, Outcome, SecondOrder};
use cpu_time::ThreadTime;
use std::ops::ControlFlow;
use std::time::Duration;

/// Who solves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    Sqp,
    Ipm,
}

impl Solver {
    pub const ALL: [Self; 2] = [Self::Sqp, Self::Ipm];

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sqp => "Sqp",
            Self::Ipm => "Ipm",
        }
    }
}

/// How it is to be solved.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    pub solver: Solver,
    /// Changes the solver from its defaults.
    pub sqp: &'a dyn Fn(&mut HeapSqp),
    /// Changes the solver from its defaults.
    pub ipm: &'a dyn Fn(&mut HeapIpm),
    /// The median is that of so many runs.
    pub repetitions: usize,
    /// CPU time after which a run is given up.
    pub limit: Duration,
    /// Whether the log of the first run is printed.
    pub log: bool,
}

impl Task<'_> {
    /// By default options.
    #[must_use]
    pub fn new(solver: Solver) -> Self {
        Self {
            solver,
            sqp: &|_| {},
            ipm: &|_| {},
            repetitions: 1,
            limit: Duration::from_secs(20),
            log: false,
        }
    }
}

/// What a solver made of a problem.
#[derive(Clone, Debug)]
pub struct Made {
    pub converged: bool,
    pub status: String,
    pub objective: f64,
    pub iterations: usize,
    /// Iterations of QPs, in sum; those of the interior point have one linear system each.
    pub qp_iterations: usize,
    /// Most of them in one step.
    pub worst_step: usize,
    /// CPU time of the thread, in seconds: the median of the runs.
    pub time: f64,
}

impl Made {
    /// Of a run that gave none.
    #[must_use]
    pub fn failed(status: String) -> Self {
        let (objective, time) = (f64::NAN, f64::NAN);
        let (iterations, qp_iterations, worst_step) = (0, 0, 0);
        Self { converged: false, status, objective, iterations, qp_iterations, worst_step, time }
    }

    fn of(outcome: &Outcome, log: &[Iteration], time: f64) -> Self {
        Self {
            converged: outcome.is_converged(),
            status: outcome.status.to_string(),
            objective: outcome.objective,
            iterations: outcome.iterations,
            qp_iterations: log.iter().map(|i| i.qp_iterations).sum(),
            worst_step: log.iter().map(|i| i.qp_iterations).max().unwrap_or(0),
            time,
        }
    }
}

/// Solves what `make` makes as often as the task says.
pub fn solve<P>(make: &dyn Fn() -> Result<HeapOcp<P>, Failure>, task: &Task<'_>) -> Made
where
    P: Formulation<f64, Dynamics: SecondOrder<f64>>,
{
    let mut made = Vec::new();
    for repetition in 0..task.repetitions.max(1) {
        let log = task.log && repetition == 0;
        match make().and_then(|mut ocp| once(&mut ocp, &Task { log, ..*task })) {
            Ok(run) => made.push(run),
            Err(error) => return Made::failed(error.to_string()),
        }
        // Nobody waits for the median of runs that last long.
        if made.iter().map(|run| run.time).sum::<f64>() > task.limit.as_secs_f64() {
            break;
        }
    }
    made.sort_by(|a, b| a.time.total_cmp(&b.time));
    made.swap_remove(made.len() / 2)
}

fn once<P>(ocp: &mut HeapOcp<P>, task: &Task<'_>) -> Result<Made, Failure>
where
    P: Formulation<f64, Dynamics: SecondOrder<f64>>,
{
    let start = ThreadTime::now();
    let mut observer = |_: &Iteration| match start.elapsed() > task.limit {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let made = match task.solver {
        Solver::Sqp => {
            let mut sqp = HeapSqp::new(ocp)?;
            (task.sqp)(&mut sqp);
            let outcome = sqp.solve_observed(ocp, &mut observer)?;
            let made = Made::of(&outcome, sqp.log().0, start.elapsed().as_secs_f64());
            if task.log {
                println!("{}{outcome}", sqp.log());
            }
            made
        }
        Solver::Ipm => {
            let mut ipm = HeapIpm::new(ocp)?;
            (task.ipm)(&mut ipm);
            let outcome = ipm.solve_observed(ocp, &mut observer)?;
            let made = Made::of(&outcome, ipm.log().0, start.elapsed().as_secs_f64());
            if task.log {
                println!("{}{outcome}", ipm.log());
            }
            made
        }
    };
    Ok(made)
}
