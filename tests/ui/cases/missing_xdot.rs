use casados::dae;

#[dae]
fn model(x: [f64; 1]) -> [f64; 1] {
    [-x[0]]
}

fn main() {}
