use casados::ode;

#[ode]
fn model(x: [f64; 1]) -> [usize; 1] {
    [x.len()]
}

fn main() {}
