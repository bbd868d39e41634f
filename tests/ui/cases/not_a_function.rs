use casados::dae;

#[dae]
struct Model {
    x: f64,
}

fn main() {}
