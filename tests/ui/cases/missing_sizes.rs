use casados::ode;

#[ode]
fn model<const N: usize>(x: [f64; N]) -> [f64; N] {
    x
}

fn main() {}
