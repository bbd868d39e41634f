use casados::dae;

#[dae]
fn model(xdot: [f64; 1], x: &[f64]) -> [f64; 1] {
    [xdot[0] - x[0]]
}

fn main() {}
