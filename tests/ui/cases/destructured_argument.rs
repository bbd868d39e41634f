use casados::dae;

#[dae]
fn model(xdot: [f64; 2], [a, b]: [f64; 2]) -> [f64; 2] {
    [xdot[0] - a, xdot[1] - b]
}

fn main() {}
