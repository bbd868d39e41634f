use casados::ode;

#[ode]
fn model(x: [f64; 1], z: f64) -> [f64; 1] {
    [x[0] - z]
}

fn main() {}
