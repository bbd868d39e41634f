use casados::ode;

type Quaternion = [f64; 4];

#[ode]
fn model(x: Quaternion) -> Quaternion {
    x
}

fn main() {}
