use casados::function;
use num_dual::DualNum;

#[function]
fn square<T: DualNum<Primitive = f64> + Copy>(x: [T; 2]) -> [T; 1] {
    [x[0] * x[1]]
}

fn main() {}
