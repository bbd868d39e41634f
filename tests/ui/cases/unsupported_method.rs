use casados::ode;

#[ode]
fn model(x: [f64; 1]) -> [f64; 1] {
    [x[0].floor()]
}

fn main() {}
