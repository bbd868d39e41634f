use casados::dae;
use num_dual::DualNum;

#[derive(Clone, Copy)]
struct State<T> {
    position: T,
}

#[dae]
fn model<T: DualNum<Primitive = f64> + Copy>(xdot: [T; 1], x: State<T>) -> [T; 1] {
    [xdot[0] + x.position]
}

fn main() {}
