use casados::ode;

#[ode]
fn model(x: f64) -> f64 {
    let rate = -x;
    #[cfg(not(test))]
    let rate = rate - 0.1 * x * x;
    rate
}

fn main() {}
