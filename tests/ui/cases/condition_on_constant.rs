use casados::ode;

#[ode]
mod model {
    #[cfg(all())]
    const RATE: f64 = 1.0;
    #[cfg(any())]
    const RATE: f64 = 2.0;

    pub fn model(x: f64) -> f64 {
        -RATE * x
    }
}

fn main() {}
