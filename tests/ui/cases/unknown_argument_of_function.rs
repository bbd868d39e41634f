use casados::function;

#[function]
fn cost(x: [f64; 2], reference: [f64; 2]) -> f64 {
    let error = x[0] - reference[0];
    error * error
}

fn main() {}
