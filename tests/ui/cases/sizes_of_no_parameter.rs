use casados::ode;

#[ode(M = [1, 2])]
fn model<const N: usize>(x: [f64; N]) -> [f64; N] {
    x
}

fn main() {}
