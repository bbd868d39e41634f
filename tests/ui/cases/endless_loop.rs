use casados::ode;

#[ode]
fn model(x: [f64; 1]) -> [f64; 1] {
    let mut n = 0_usize;
    while n < 10 {
        n = (n + 1) % 5;
    }
    [x[0] * n as f64]
}

fn main() {}
