use casados::ocp::{Constraint, Horizon, LeastSquaresCost, Problem};
use casados::prelude::*;

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}

#[function]
fn effort(_x: [f64; 2], u: [f64; 2]) -> f64 {
    u[0]
}

#[function]
fn height(x: [f64; 3]) -> f64 {
    x[2]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
    let cost = LeastSquaresCost::<Effort>::diagonal(&[1.0]);
    Problem::new(irk).stage_cost(cost).on(Horizon::uniform(10, 0.1))?;

    let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
    let limit = Constraint::<Height>::new([0.0], [1.0]);
    Problem::new(irk).path_constraints(limit).on(Horizon::uniform(10, 0.1))?;
    Ok(())
}
