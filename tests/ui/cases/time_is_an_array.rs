use casados::ode;

#[ode]
fn model(x: [f64; 1], t: [f64; 1]) -> [f64; 1] {
    [x[0] * t[0]]
}

fn main() {}
