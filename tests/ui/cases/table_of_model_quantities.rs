use casados::ode;
use casados::tables::Linear;

#[ode]
fn model(x: f64, p: [f64; 2]) -> f64 {
    let table = Linear::new([0.0, 1.0], p);
    -table.value(x)
}

fn main() {}
