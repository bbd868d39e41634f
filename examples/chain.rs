//! A chain of masses on springs falls while its end is drawn up: time of one call as the chain
//! grows.
//!
//! ```text
//! cargo run --release --example chain
//! ```

#[path = "models/chain.rs"]
mod chain;

use casados::prelude::*;
use chain::{Chain, stretched};
use nalgebra::{SVector, vector};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Gauss-Legendre with 2 stages, one step per call, for the chain with this many states.
macro_rules! row {
    ($nx:literal) => {{
        let mut irk = Irk::<Chain<$nx>, Gauss<2>>::new(Options { start: Start::Zero, ..Default::default() })?;
        let (x0, u, h) = (stretched::<$nx>(), vector![-1.0, 1.0, 1.0], 0.2);
        let lambda = SVector::repeat(1.0);
        println!(
            "{:>6} {:>6} {:>12.2} {:>10.2} {:>10.2} {:>10.2}",
            ($nx - 3) / 6 + 2,
            $nx,
            microseconds(|| irk.solve(black_box(&x0), &u, h).map(drop))?,
            microseconds(|| irk.forward(black_box(&x0), &u, h).map(drop))?,
            microseconds(|| irk.adjoint(black_box(&x0), &u, h, &lambda).map(drop))?,
            microseconds(|| irk.hessian(black_box(&x0), &u, h, &lambda).map(drop))?,
        );
    }};
}

fn main() -> Result<(), casados::Error> {
    println!("Microseconds of one call: Gauss-Legendre with 2 stages, one step of 0.2 s\n");
    println!("masses states   simulation   Jacobian    adjoint    Hessian");
    row!(9);
    row!(15);
    row!(21);
    row!(27);
    row!(33);
    row!(45);
    row!(69);
    println!("\nThe Jacobian and the adjoint include the simulation, the Hessian includes everything.");
    Ok(())
}

/// The median over many calls.
fn microseconds<E>(mut call: impl FnMut() -> Result<(), E>) -> Result<f64, E> {
    let mut times = Vec::new();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(100) {
        let start = Instant::now();
        for _ in 0..10 {
            call()?;
        }
        times.push(start.elapsed() / 10);
    }
    times.sort_unstable();
    Ok(1e6 * times[times.len() / 2].as_secs_f64())
}
