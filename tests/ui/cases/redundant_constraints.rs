use casados::dae;

#[dae(index_reduction)]
fn model(xdot: [f64; 4], x: [f64; 4], z: [f64; 2]) -> [f64; 6] {
    let square = x[0] * x[0] + x[1] * x[1];
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + (z[0] + z[1]) * x[0],
        xdot[3] + (z[0] + z[1]) * x[1],
        square - 1.0,
        square.sqrt() - 1.0,
    ]
}

fn main() {}
