use casados::ode;

#[ode]
fn model(x: [f64; 3]) -> [f64; 3] {
    let mut rate = x;
    for i in 0..3 {
        rate[i] = x[i + 1] - x[i];
    }
    rate
}

fn main() {}
