use casados::dae;

#[dae]
fn model(xdot: [f64; 3], x: [f64; 2]) -> [f64; 2] {
    [xdot[0] - x[0], xdot[1] - xdot[2]]
}

fn main() {}
