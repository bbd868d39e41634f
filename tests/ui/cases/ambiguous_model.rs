use casados::ode;

#[ode]
mod model {
    pub fn first(x: [f64; 1]) -> [f64; 1] {
        x
    }
    pub fn second(x: [f64; 1]) -> [f64; 1] {
        x
    }
}

fn main() {}
