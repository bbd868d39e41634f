use casados::function;

#[function]
fn power(xdot: [f64; 2], x: [f64; 2]) -> f64 {
    xdot[1] * x[1]
}

fn main() {}
