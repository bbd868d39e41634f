use casados::dae;
use num_dual::DualNum;

const N: usize = 1;

#[dae]
fn model<T: DualNum<Primitive = f64> + Copy>(xdot: [T; N], x: [T; N]) -> [T; N] {
    [xdot[0] + x[0]]
}

fn main() {}
