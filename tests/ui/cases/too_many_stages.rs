use casados::{Gauss, Irk, ode};

#[ode]
fn model(x: [f64; 1]) -> [f64; 1] {
    [-x[0]]
}

fn main() {
    let _ = Irk::<Model, Gauss<10>>::new(Default::default());
}
