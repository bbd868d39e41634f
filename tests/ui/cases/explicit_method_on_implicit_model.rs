use casados::{Erk, Rk4, dae};

#[dae]
fn model(xdot: [f64; 2], x: [f64; 2]) -> [f64; 2] {
    [xdot[0] - x[1], xdot[0] * xdot[1] + x[0]]
}

fn main() {
    let _ = Erk::<Model, Rk4>::new(Default::default());
}
