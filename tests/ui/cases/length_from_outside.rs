use casados::ode;

const N: usize = 2;

#[ode]
fn model(x: [f64; N]) -> [f64; N] {
    x
}

fn main() {}
