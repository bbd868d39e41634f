use casados::dae;

#[dae(name = Pair)]
mod pair {
    #[ode]
    fn one(x: f64) -> f64 {
        -x
    }

    #[ode]
    fn two(x: f64) -> f64 {
        -2.0 * x
    }
}

fn main() {}
