//! A problem of a model with names, whose intervals are integrated one by one.

use casados::casadi::Program;
use casados::dae;
use casados::ocp::{Horizon, LeastSquaresCost, Problem};
use casados::prelude::*;
use std::error::Error;

/// A mass on a table, in a wind.
#[dae]
mod slider {
    pub struct State {
        pub place: [f64; 2],
        pub speed: [f64; 2],
    }

    pub struct Control {
        pub push: [f64; 2],
    }

    pub fn slider(xdot: &State, x: &State, u: &Control) -> State {
        let drag = (1.0 + x.speed[0] * x.speed[0] + x.speed[1] * x.speed[1]).sqrt();
        State {
            place: [xdot.place[0] - x.speed[0], xdot.place[1] - x.speed[1]],
            speed: [
                xdot.speed[0] - (u.push[0] - drag * x.speed[0] + 0.1),
                xdot.speed[1] - (u.push[1] - drag * x.speed[1]),
            ],
        }
    }
}

#[function]
fn displacement(x: [f64; 4], u: [f64; 2]) -> [f64; 6] {
    [x[0], x[1], x[2], x[3], u[0], u[1]]
}

casados::casadi::export_problem! { slide = slide }

fn slide() -> Result<impl Program + 'static, Box<dyn Error>> {
    let irk = Irk::<Slider, Gauss<2>>::new(crate::steps(1))?;
    let mut ocp = Problem::new(irk)
        .running_cost(LeastSquaresCost::<Displacement>::diagonal(&[1.0, 1.0, 0.1, 0.1, 0.01, 0.01]))
        .on(Horizon::uniform(4, 0.1))?;
    ocp.fix_initial_state(&[1.0, -1.0, 0.0, 0.0])?.bound("u.push", .., -2.0, 2.0)?;
    Ok(ocp)
}
