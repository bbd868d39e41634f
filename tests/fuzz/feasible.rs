//! Problems of optimal control that a known trajectory satisfies: no run may call them infeasible,
//! or, since their costs are not negative, unbounded.

use super::source::Source;
use super::*;
use casados::ocp::{GeneralCost, HeapIpm, HeapOcp, HeapSqp, Horizon, OcpError, Outcome, Problem, Status};
use casados::prelude::*;
use nalgebra::{Vector1, vector};

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}
#[function]
fn economy(x: [f64; 2], u: f64) -> f64 {
    u * u + 1.0 + (x[0] - 1.0).cos()
}

type Swing = HeapOcp<Problem<Irk<Pendulum, Gauss<2>>, GeneralCost<Economy>>>;

/// A number from −1 to 1.
fn symmetric(source: &mut Source) -> f64 {
    source.below(2001) as f64 / 1000.0 - 1.0
}

/// A problem with bounds around the states and controls of a simulation, and a guess elsewhere.
fn feasible_problem(source: &mut Source) -> Result<Swing, OcpError> {
    let options = Options { steps: 2, ..Default::default() };
    let (n, h) = (2 + source.below(8), [0.05, 0.1, 0.2][source.below(3)]);
    let economy = Problem::new(Irk::<Pendulum, Gauss<2>>::new(options)?);
    let mut ocp = economy.running_cost(GeneralCost::<Economy>::new()).on(Horizon::uniform(n, h))?;
    let mut x = vector![3.0 * symmetric(source), 2.0 * symmetric(source)];
    ocp.fix_initial_state(x.as_slice())?;
    let mut irk = Irk::<Pendulum, Gauss<2>>::new(options)?;
    // A bound that leaves no room is the hardest.
    let room = [0.0, 1e-3, 0.1, 1.0][source.below(4)];
    for k in 0..n {
        let u = 4.0 * symmetric(source);
        if source.below(3) > 0 {
            ocp.bound("u", k..=k, u - room, u + 2.0 * room)?;
        }
        x = irk.solve(&x, &Vector1::new(u), h)?.x;
        // What solvers leave of gaps is a violation where there is no room.
        let room = room + 1e-6;
        for (i, name) in ["x[0]", "x[1]"].into_iter().enumerate() {
            if source.below(4) == 0 {
                ocp.bound(name, k + 1..=k + 1, x[i] - room, x[i] + 3.0 * room)?;
            }
        }
    }
    let size = [0.0, 1.0, 10.0][source.below(3)];
    ocp.guess(&[size * symmetric(source), size * symmetric(source)], &[size * symmetric(source)])?;
    Ok(ocp)
}

#[test]
fn feasible_problems_are_not_called_infeasible() -> Result<(), OcpError> {
    let mut counts = Counts::new("problems with a known feasible trajectory");
    for seed in seeds(300) {
        let mut source = Source::new(seed);
        let mut first = feasible_problem(&mut source)?;
        let mut second = first.clone();
        let by_sqp = HeapSqp::new(&first)?.solve(&mut first)?;
        let by_ipm = HeapIpm::new(&second)?.solve(&mut second)?;
        for (solver, Outcome { status, .. }) in [("Sqp", &by_sqp), ("Ipm", &by_ipm)] {
            let is_false =
                matches!(status, Status::Infeasible { .. } | Status::InfeasibleQp { .. } | Status::Unbounded);
            assert!(!is_false, "seed {seed}, {solver}: {status}");
            let text = format!("{status:?}");
            counts.count(match status {
                Status::Converged | Status::Acceptable => "Ok",
                _ => text.split([' ', '(', '{']).next().unwrap_or_default(),
            });
        }
    }
    enough(&counts, 590);
    Ok(())
}
