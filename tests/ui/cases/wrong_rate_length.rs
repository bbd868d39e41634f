use casados::ode;

#[ode]
fn model(x: [f64; 3]) -> [f64; 2] {
    [x[1], x[2]]
}

fn main() {}
