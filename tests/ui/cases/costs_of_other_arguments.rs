use casados::ocp::{Constraint, GeneralCost, Horizon, LeastSquaresCost, Problem};
use casados::prelude::*;

#[ode]
fn tank(x: [f64; 2], u: f64, p: [f64; 3]) -> [f64; 2] {
    [p[0] * u - x[0], p[1] * x[0] - p[2] * x[1]]
}

#[function]
fn price(x: [f64; 2], u: f64) -> f64 {
    x[0] * u
}

#[function]
fn effort(_x: [f64; 2], u: [f64; 2], _p: [f64; 3]) -> f64 {
    u[0]
}

#[function]
fn level(x: [f64; 2], _u: f64, _p: [f64; 3]) -> f64 {
    x[1]
}

fn tank_problem() -> Result<Problem<Irk<Tank, Gauss<2>>>, Error> {
    Ok(Problem::new(Irk::<Tank, Gauss<2>>::new(Options::default())?))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let horizon = || Horizon::uniform(10, 0.1);
    // A function is no cost.
    tank_problem()?.running_cost(Level).on(horizon())?;
    // Its parameters are left out.
    tank_problem()?.running_cost(GeneralCost::<Price>::new()).on(horizon())?;
    // One of a pair has two controls.
    let pair = (GeneralCost::<Level>::new(), LeastSquaresCost::<Effort>::diagonal(&[1.0]));
    tank_problem()?.terminal_cost(pair).on(horizon())?;
    // A function is no constraint, nor is a cost.
    tank_problem()?.path_constraints(Level).on(horizon())?;
    tank_problem()?.terminal_constraints(Constraint::<Price>::new([0.0], [1.0])).on(horizon())?;
    // Numbers of the integrator are `f64`.
    tank_problem()?.stage_cost(GeneralCost::<Level, f32>::new()).on(horizon())?;
    Ok(())
}
