use casados::ode;

struct Plant;

impl Plant {
    #[ode]
    fn model(&self, x: f64) -> f64 {
        -x
    }
}

fn main() {}
