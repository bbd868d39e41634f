use casados::dae;

#[dae(index_reduction)]
fn model(xdot: f64, x: f64, u: f64, z: f64) -> [f64; 2] {
    [xdot - z, x - u]
}

fn main() {}
