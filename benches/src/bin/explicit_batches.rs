//! Explicit methods: forty intervals in a batch, beside one call after the other.
//!
//! Both by turns, median of the CPU times of the thread; microseconds of one interval. The first
//! argument is the number of turns.

use casados::__private::Matrix;
use casados::model::{VectorU, VectorX};
use casados::prelude::*;
use casados::result::{Adjoint, Forward, Hessian, Nominal};
use casados::{Heap, batch, erk};
use casados_benches::models::{Chain, Pendulum, stretched};
use casados_benches::time::Summary;
use cpu_time::ThreadTime;
use quadrotor::Quadrotor;
use std::hint::black_box;

#[allow(dead_code)]
#[path = "../../../examples/models/quadrotor.rs"]
mod quadrotor;

const COUNT: usize = 40;

type Failure = Box<dyn std::error::Error>;

/// A wave around some numbers.
fn perturbed_by_wave<V: Matrix<f64>>(k: usize, size: f64, around: &[f64]) -> V {
    let mut vector = V::zeroed();
    for (i, element) in vector.as_mut_slice().iter_mut().enumerate() {
        let base = around.get(i).copied().unwrap_or(0.0);
        *element = base + size * ((k * (i + 3)) as f64).sin();
    }
    vector
}

/// Times of both, and how many times longer the first takes.
fn by_turns(
    turns: usize,
    mut alone: impl FnMut() -> Result<(), Failure>,
    mut together: impl FnMut() -> Result<(), Failure>,
) -> Result<String, Failure> {
    let mut samples = [Vec::new(), Vec::new()];
    for _ in 0..turns {
        let calls: [&mut dyn FnMut() -> Result<(), Failure>; 2] = [&mut alone, &mut together];
        for (samples, call) in samples.iter_mut().zip(calls) {
            let start = ThreadTime::now();
            call()?;
            samples.push(1e6 * start.elapsed().as_secs_f64() / COUNT as f64);
        }
    }
    let [alone, together] = samples.map(|samples| Summary::from_samples(samples).median);
    Ok(format!(" {alone:.3} / {together:.3} = {:.2} |", alone / together))
}

/// A row of the table.
fn row<M: Ode>(name: &str, x0: &[f64], h: f64, steps: usize, turns: usize) -> Result<(), Failure> {
    let x0: Vec<VectorX<M, f64>> = (0..COUNT).map(|k| perturbed_by_wave(k, 0.01, x0)).collect();
    let u: Vec<VectorU<M, f64>> = (0..COUNT).map(|k| perturbed_by_wave(k + 7, 0.3, &[])).collect();
    let lambda: Vec<VectorX<M, f64>> = (0..COUNT).map(|k| perturbed_by_wave(k + 9, 1.0, &[])).collect();
    let options = Options { steps, ..Default::default() };
    let mut erk = erk::Integrator::<M, Rk4, 4, f64, Heap>::new(options)?;
    let mut batch = batch::Integrator::<erk::Integrator<M, Rk4, 4, f64, Heap>>::new(options)?;
    let intervals = Intervals { x0: &x0, u: &u, h: &[h], ..Default::default() };
    let mut text = format!("| {name}, {steps} |");
    macro_rules! turns {
        ($result:ident, $call:ident $(, $lambda:ident)?) => {{
            let mut alone = vec![$result::default(); COUNT];
            let mut together = vec![$result::default(); COUNT];
            text += &by_turns(
                turns,
                || {
                    for (k, to) in alone.iter_mut().enumerate() {
                        *to = *black_box(erk.$call(&x0[k], &u[k], h $(, &$lambda[k])?)?);
                    }
                    Ok(())
                },
                || Ok(batch.$call(&intervals $(, &$lambda)?, black_box(&mut together))?),
            )?;
        }};
    }
    turns!(Nominal, solve);
    turns!(Forward, forward);
    turns!(Adjoint, adjoint, lambda);
    turns!(Hessian, hessian, lambda);
    println!("{text}");
    Ok(())
}

fn main() -> Result<(), Failure> {
    let turns = std::env::args().nth(1).map_or(Ok(100), |turns| turns.parse())?;
    println!("| model, steps | simulation | forward | adjoint | Hessian |\n| --- | --- | --- | --- | --- |");
    for steps in [1, 4] {
        row::<Pendulum>("pendulum", &[0.0, 0.3, 1.0, 0.3], 0.05, steps, turns)?;
        row::<Quadrotor>("quadrotor", &[0.1, 0.2, 0.3, 0.1, 0.2, 0.3], 0.05, steps, turns)?;
        row::<Chain<9>>("3 masses", stretched::<9>().as_slice(), 0.05, steps, turns)?;
        row::<Chain<21>>("5 masses", stretched::<21>().as_slice(), 0.05, steps, turns)?;
        row::<Chain<33>>("7 masses", stretched::<33>().as_slice(), 0.05, steps, turns)?;
    }
    Ok(())
}
