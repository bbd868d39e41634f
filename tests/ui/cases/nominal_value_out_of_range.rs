use casados::ode;

#[ode(nominal(x = [0.0, 3.0], p = 2), range(x = [-1.0..=1.0, 0.0..=2.0], p = 1..=2))]
fn model(x: [f64; 2], p: f64) -> [f64; 2] {
    [-x[0], -p * x[1]]
}

fn main() {}
