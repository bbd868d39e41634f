use casados::ode;

#[ode]
fn model(x: [f64; 2]) -> [f64; 2] {
    const TABLE: [f64; 3] = [1.0, 2.0, 4.0];
    let cell = x[0].floor() as usize;
    [TABLE[cell], x[1]]
}

fn main() {}
