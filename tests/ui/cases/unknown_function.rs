use casados::ode;

fn drag(v: f64) -> f64 {
    0.1 * v * v.abs()
}

#[ode]
fn model(x: [f64; 2]) -> [f64; 2] {
    [x[1], -drag(x[1])]
}

fn main() {}
