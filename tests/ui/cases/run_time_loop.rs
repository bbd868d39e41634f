use casados::ode;

#[ode]
fn model(x: [f64; 1]) -> [f64; 1] {
    let mut a = x[0];
    while a > 1.0 {
        a /= 2.0;
    }
    [a]
}

fn main() {}
