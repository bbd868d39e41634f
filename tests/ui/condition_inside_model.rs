use casados::ode;

#[ode]
fn model(x: f64) -> f64 {
    let mut rate = -x;
    #[cfg(feature = "drag")]
    {
        rate -= 0.1 * x * x;
    }
    rate
}

fn main() {}
