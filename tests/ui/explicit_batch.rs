use casados::prelude::*;

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}

fn main() {
    let _: Option<Batch<Pendulum, Rk4>> = None;
}
