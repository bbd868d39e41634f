use casados::ode;

const GAIN: f64 = 2.0;

trait Value {
    fn value(self, x: f64) -> f64;
}

impl Value for f64 {
    fn value(self, x: f64) -> f64 {
        self * x
    }
}

#[ode]
fn model(x: f64) -> f64 {
    GAIN.value(x)
}

fn main() {}
