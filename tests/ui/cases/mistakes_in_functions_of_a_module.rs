use casados::ode;

#[ode]
mod cart {
    pub struct State {
        pub position: f64,
        pub velocity: f64,
    }

    pub fn cart(x: &State, u: f64) -> State {
        State { position: x.velocity, velocity: u }
    }

    #[function]
    fn rounded(x: &State, _u: f64) -> f64 {
        x.position.floor()
    }

    #[function]
    fn unknown(x: &State, _u: f64, force: f64) -> f64 {
        x.position * force
    }
}

fn used<A, B, C>() {}

fn main() {
    used::<Cart, Rounded, Unknown>();
}
