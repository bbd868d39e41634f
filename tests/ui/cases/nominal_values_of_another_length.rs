use casados::dae;

#[dae(nominal(x = [1.0, 2.0, 3.0], u = 1.0), range(z = 0.0..=1.0))]
fn model(xdot: [f64; 2], x: [f64; 2]) -> [f64; 2] {
    [xdot[0] - x[0], xdot[1] - x[1]]
}

fn main() {}
