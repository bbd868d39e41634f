use casados::ode;

#[ode]
fn model(x: [f64; 2]) -> [f64; 2] {
    if x[0] > 1.0 {
        return [0.0, 0.0];
    }
    [x[1], -x[0]]
}

fn main() {}
