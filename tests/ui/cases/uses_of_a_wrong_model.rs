use casados::ocp::{GeneralCost, Horizon, Problem};
use casados::prelude::*;

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[2].sin()]
}

#[function]
fn effort(x: [f64; 2], u: f64) -> f64 {
    u * x[3]
}

// Only what is wrong is said: not that these have no integrator, nor what that has not.
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
    irk.solve(&nalgebra::vector![0.0, 1.0], &nalgebra::vector![1.0], 0.1)?;
    println!("{}", Pendulum::STRUCTURE);
    let problem = Problem::new(irk).stage_cost(GeneralCost::<Effort>::new());
    problem.on(Horizon::uniform(10, 0.1))?;
    Ok(())
}
