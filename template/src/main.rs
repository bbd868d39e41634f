//! A closed loop of model predictive control by real-time iterations.

mod model;

use casados::ocp::{HeapRealTime, HeapSqp, Horizon, LeastSquaresCost, Problem};
use casados::prelude::*;
use model::{Deviation, Pendulum, TerminalDeviation};
use nalgebra::{Vector1, Vector2, vector};

/// Seconds between two samples.
const SAMPLE: f64 = 0.05;

/// The state after `samples` samples from `x`.
fn closed_loop(mut x: Vector2<f64>, samples: usize) -> Result<Vector2<f64>, Box<dyn std::error::Error>> {
    let mut ocp = Problem::new(Irk::<Pendulum, Gauss<2>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Deviation>::diagonal(&[10.0, 0.1, 0.01]))
        .terminal_cost(LeastSquaresCost::<TerminalDeviation>::diagonal(&[10.0, 1.0]))
        .on(Horizon::uniform(20, SAMPLE))?;
    ocp.fix_initial_state(x.as_slice())?.bound("u", .., -6.0, 6.0)?;
    // The first plan is a solution; each sample improves it by one iteration.
    let outcome = HeapSqp::new(&ocp)?.gauss_newton().solve(&mut ocp)?;
    println!("{outcome}");
    let mut controller = HeapRealTime::new(ocp)?;
    let mut plant = Irk::<Pendulum, Gauss<4>>::new(Options { steps: 2, ..Default::default() })?;
    for sample in 0..samples {
        let feedback = controller.prepare()?.feedback(x.as_slice())?;
        let u = Vector1::new(feedback.u[0]);
        if sample % 5 == 0 {
            println!("{:.2} s   {:6.3} rad   {:6.2} 1/s²", SAMPLE * sample as f64, x[0], u[0]);
        }
        x = plant.solve(&x, &u, SAMPLE)?.x;
        controller.shift();
    }
    Ok(x)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    closed_loop(vector![0.3, 0.0], 60)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use casados::testing::{Points, check_derivatives};

    #[test]
    fn derivatives_of_the_model() {
        check_derivatives::<Pendulum>(&Points::random(10)).assert();
    }

    #[test]
    fn the_controller_reaches_the_upright_position() -> Result<(), Box<dyn std::error::Error>> {
        let end = closed_loop(vector![0.3, 0.0], 60)?;
        assert!(end.norm() < 0.01, "{end}");
        Ok(())
    }
}
