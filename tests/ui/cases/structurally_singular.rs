use casados::dae;

#[dae]
fn model(xdot: [f64; 2], x: [f64; 2], z: f64) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] + z * x[0], x[0] * x[0] + x[1] * x[1] - 1.0]
}

fn main() {}
