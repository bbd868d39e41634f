use casados::function;

#[function]
fn cost(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[0] * u, x[2]]
}

fn main() {}
