use casados::dae;
use num_dual::DualNum;

#[dae]
fn model<T: DualNum<Primitive = f64> + Copy>(xdot: [T; 2], x: [T; 2]) -> [T; 1] {
    [xdot[0] + x[1]]
}

fn main() {}
