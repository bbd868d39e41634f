use casados::ode;

#[ode]
fn model(x: [f32; 2]) -> [f32; 2] {
    x
}

fn main() {}
