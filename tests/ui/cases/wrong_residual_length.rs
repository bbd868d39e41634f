use casados::dae;

#[dae]
fn model(xdot: [f64; 2], x: [f64; 2], z: f64) -> [f64; 2] {
    [xdot[0] - x[1], xdot[1] - z]
}

fn main() {}
