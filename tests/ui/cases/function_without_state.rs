use casados::function;

#[function]
fn effort(u: [f64; 2]) -> f64 {
    u[0] * u[0] + u[1] * u[1]
}

fn main() {}
