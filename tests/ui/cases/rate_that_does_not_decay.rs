use casados::dae;

#[dae(index_reduction(baumgarte = [2.0, -1.0]))]
fn model(xdot: [f64; 2], x: [f64; 2], z: f64) -> [f64; 3] {
    [xdot[0] - x[1], xdot[1] - z, x[0] - 1.0]
}

fn main() {}
