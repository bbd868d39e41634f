//! Learns the weights of a predictive controller from demonstrations: gradient descent, with 64
//! problems solved and differentiated for each gradient. A picture in `plots/learn_weights.svg`.
//!
//! ```text
//! cargo run --release --features parallel --example learn_weights [FOLDER]
//! ```

use casados::ocp::{
    BatchOcp, Exact, ExactFormulation, GeneralCost, HeapOcp, HeapRealTime, HeapSqp, Horizon, OcpError,
    Problem, closed_loop, plant,
};
use casados::plot::{Figure, Panel};
use casados::prelude::*;
use nalgebra::Vector2;
use std::error::Error;
use std::path::PathBuf;

/// A pendulum that stands at zero: angle rad, rate rad/s; torque. Its weights are not in it.
#[ode]
fn pendulum(x: [f64; 2], u: f64, _p: [f64; 2]) -> [f64; 2] {
    [x[1], 9.81 * x[0].sin() + u]
}
/// Parameters are logarithms of the weights of angle and rate.
#[function]
fn price(x: [f64; 2], u: f64, p: [f64; 2]) -> f64 {
    0.5 * (p[0].exp() * x[0] * x[0] + p[1].exp() * x[1] * x[1] + u * u)
}

const DEMONSTRATIONS: usize = 64;
/// What the demonstrator pays, and what the learner begins with.
const TRUE_WEIGHTS: [f64; 2] = [3.0, 0.5];
const INITIAL_WEIGHTS: [f64; 2] = [0.0, -2.0];

fn problem() -> Result<HeapOcp<impl ExactFormulation<f64> + Send + Sync>, OcpError> {
    let mut ocp = Problem::new(Erk::<Pendulum, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<Price>::new())
        .on(Horizon::uniform(20, 0.05))?;
    ocp.fix_initial_state(&[0.0; 2])?.set_parameters(.., &TRUE_WEIGHTS)?.guess(&[0.0; 2], &[0.0])?;
    ocp.bound("u", .., -8.0, 8.0)?;
    Ok(ocp)
}

/// The first controls of all instances with these weights.
fn controls<P>(batch: &mut BatchOcp<P>, weights: [f64; 2]) -> Result<Vec<f64>, OcpError>
where
    P: ExactFormulation<f64> + Send + Sync,
{
    for ocp in batch.instances_mut() {
        ocp.set_parameters(.., &weights)?;
    }
    for outcome in batch.solve()? {
        (*outcome)?;
    }
    batch.instances().iter().map(|ocp| Ok(ocp.stage(0)?.u[0])).collect()
}

/// Half the mean of the squares of what first controls are off by, and its gradient.
fn loss<P>(batch: &mut BatchOcp<P>, shown: &[f64], weights: [f64; 2]) -> Result<(f64, Vector2<f64>), OcpError>
where
    P: ExactFormulation<f64> + Send + Sync,
{
    let found = controls(batch, weights)?;
    let off = |instance: usize| (found[instance] - shown[instance]) / shown.len() as f64;
    let loss = (0..shown.len()).map(|i| 0.5 * off(i) * off(i) * shown.len() as f64).sum();
    let gradients = batch.adjoint(Exact::default(), |instance, _, seed| {
        seed.stage_mut(0).into_iter().for_each(|stage| stage.u[0] = off(instance));
    })?;
    let mut sum = Vector2::zeros();
    for gradient in gradients.iter() {
        sum += Vector2::from_column_slice(gradient?.p);
    }
    Ok((loss, sum))
}

/// Weights and losses on the way.
fn learn_weights(iterations: usize) -> Result<(Vec<[f64; 2]>, Vec<f64>), OcpError> {
    let ocp = problem()?;
    let mut batch = BatchOcp::new(&ocp, DEMONSTRATIONS, HeapSqp::new(&ocp)?)?;
    for (i, instance) in batch.instances_mut().iter_mut().enumerate() {
        let (row, column) = ((i / 8) as f64 - 3.5, (i % 8) as f64 - 3.5);
        instance.fix_initial_state(&[0.12 * row, 0.4 * column])?;
    }
    let shown = controls(&mut batch, TRUE_WEIGHTS)?;
    let mut weights = Vector2::from(INITIAL_WEIGHTS);
    let (mut path, mut losses) = (Vec::new(), Vec::new());
    let (mut rate, mut before) = (0.1_f64, None::<[Vector2<f64>; 2]>);
    for _ in 0..iterations {
        let (loss, gradient) = loss(&mut batch, &shown, weights.into())?;
        path.push(weights.into());
        losses.push(loss);
        // Controls are off by 1e-5: less than that solutions are not known.
        if loss < 1e-10 {
            break;
        }
        // Step lengths of Barzilai and Borwein, IMA J. Numer. Anal. 8 (1988).
        if let Some([weights_before, gradient_before]) = before {
            let (step, change) = (weights - weights_before, gradient - gradient_before);
            if step.dot(&change) > 0.0 {
                rate = step.norm_squared() / step.dot(&change);
            }
        }
        before = Some([weights, gradient]);
        let step = rate * gradient;
        // No step is longer than the logarithm of a weight may change at once.
        weights -= step * (1.0 / step.norm()).min(1.0);
    }
    Ok((path, losses))
}

/// The angle of a closed loop with these weights.
fn closed_loop_angle(weights: [f64; 2]) -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
    let mut ocp = problem()?;
    ocp.set_parameters(.., &weights)?.fix_initial_state(&[0.3, 0.0])?;
    HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    let mut controller = HeapRealTime::exact(ocp)?;
    let mut erk = Erk::<Pendulum, Rk4>::new(Options { steps: 2, ..Default::default() })?;
    let run = closed_loop(&mut controller, plant(&mut erk, &Vector2::zeros()), |_, _| {}, &[0.3, 0.0], 60)?;
    let angle = run.trajectory.state("x[0]")?;
    Ok(run.trajectory.times().iter().copied().zip(angle.iter().copied()).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let (path, losses) = learn_weights(60)?;
    let learned = *path.last().ok_or("there is a first one")?;
    println!(
        "weights {:.3?} after {} gradients; loss {:.1e}",
        learned,
        losses.len(),
        losses[losses.len() - 1]
    );
    let curve = losses.iter().enumerate().map(|(i, &loss)| (i as f64, loss.max(1e-16)));
    let loops = Panel::new("Closed loops")
        .x("time, s")
        .y("angle, rad")
        .line("before", closed_loop_angle(INITIAL_WEIGHTS)?)
        .line("after", closed_loop_angle(learned)?)
        .line("demonstrated", closed_loop_angle(TRUE_WEIGHTS)?);
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "plots".into()));
    Figure::new()
        .size(900, 320)
        .with(Panel::new("Learning").x("gradients").y("loss").log_y().line("loss", curve))
        .column(1.0)
        .with(loops)
        .save(folder.join("learn_weights.svg"))?;
    Ok(())
}

/// The weights of the demonstrator are found to three digits: the loss is a billion times less.
#[test]
fn learned_weights() -> Result<(), Box<dyn Error>> {
    let (path, losses) = learn_weights(60)?;
    let (first, last) = (losses[0], losses[losses.len() - 1]);
    assert!(last < 1e-9 * first, "{losses:?}");
    let learned = Vector2::from(path[path.len() - 1]);
    assert!((learned - Vector2::from(TRUE_WEIGHTS)).norm() < 1e-3, "{learned}");
    Ok(())
}
