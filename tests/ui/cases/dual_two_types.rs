use casados::dae;
use num_dual::DualNum;

#[dae]
fn model<T: DualNum<Primitive = f64> + Copy, P: Into<T>>(xdot: [T; 1], x: [T; 1]) -> [T; 1] {
    [xdot[0] + x[0]]
}

fn main() {}
