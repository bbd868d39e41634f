use casados::ode;

#[ode]
fn model(x: f64) -> f64 {
    const LARGE: u128 = u128::MAX;
    x * (LARGE as f64)
}

fn main() {}
