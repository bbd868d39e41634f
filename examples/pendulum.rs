//! First steps: a pendulum on a cart falls from nearly upright, and what its motion depends on.
//!
//! ```text
//! cargo run --example pendulum
//! ```

#[path = "models/pendulum.rs"]
mod pendulum;

use casados::prelude::*;
use nalgebra::vector;
use pendulum::Pendulum;

fn main() -> Result<(), casados::Error> {
    let mut irk = Irk::<Pendulum, Gauss<4>>::new(Options::default())?;
    let (h, u) = (0.05, vector![0.0]);
    let mut x = vector![0.0, 0.1, 0.0, 0.0];

    println!("time s   position m   angle rad");
    for k in 0..=40 {
        if k % 4 == 0 {
            println!("{:>6.2} {:>12.4} {:>11.4}", f64::from(k) * h, x[0], x[1]);
        }
        x = irk.solve(&x, &u, h)?.x;
    }

    let step = irk.forward(&x, &u, h)?;
    println!("\nOne more interval: how its end depends on its start, and on the force");
    println!("dx/dx0 ={:.4}dx/du ={:.4}", step.dx_dx0, step.dx_du);

    let lambda = vector![0.0, 1.0, 0.0, 0.0];
    let step = irk.hessian(&x, &u, h, &lambda)?;
    println!("The same of the angle alone, with its curvature");
    println!("gradient ={:.4}Hessian ={:.4}", step.grad_x0, step.h_xx);
    Ok(())
}
