use casados::function;

#[function(nominal(x = [1.0, 2.0]))]
fn square(x: [f64; 2]) -> f64 {
    x[0] * x[1]
}

fn main() {}
