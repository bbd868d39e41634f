use casados::ode;

#[ode]
fn model(x: [f64; 2]) -> [f64; 2] {
    let mut y = x;
    y[0] = &mut y;
    y
}

fn main() {}
