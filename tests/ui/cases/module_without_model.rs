use casados::dae;

#[dae]
mod model {
    pub fn rate(x: [f64; 1]) -> [f64; 1] {
        x
    }
}

fn main() {}
