use casados::prelude::*;

#[ode]
fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
    [x[1], u - x[0].sin()]
}

#[function]
fn height(x: [f64; 3], _u: f64) -> f64 {
    x[2]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut irk = Irk::<Pendulum, Gauss<2>>::new(Options::default())?;
    let mut integral = Quadrature::<Height>::new();
    let _ = irk.with(&mut integral);
    Ok(())
}
