//! In which ways a problem is varied: its horizon, bounds of its controls, its guess.

use crate::ocps::{self, Failure, Grid};
use casados::ocp::{Formulation, HeapOcp};

/// Where a solver begins.
#[derive(Clone, Copy)]
pub enum Guess {
    /// As it is given.
    Given,
    /// Everywhere the point at this part of the horizon.
    Constant(f64),
    /// States moved by up to this part of how far they go, and of 0.1.
    Disturbed { part: f64, seed: f64 },
}

/// A variation.
pub struct Variation {
    pub name: &'static str,
    pub grid: Grid,
    /// What bounds of controls are multiplied by.
    pub bounds: f64,
    pub guess: Guess,
}

/// None.
pub const ORIGINAL: Variation = Variation { name: "", grid: ocps::GIVEN, bounds: 1.0, guess: Guess::Given };

const fn intervals(name: &'static str, intervals: f64) -> Variation {
    Variation { name, grid: Grid { intervals, ..ocps::GIVEN }, ..ORIGINAL }
}
const fn length(name: &'static str, length: f64) -> Variation {
    Variation { name, grid: Grid { length, ..ocps::GIVEN }, ..ORIGINAL }
}
const fn bounds(name: &'static str, bounds: f64) -> Variation {
    Variation { name, bounds, ..ORIGINAL }
}
const fn guess(name: &'static str, guess: Guess) -> Variation {
    Variation { name, guess, ..ORIGINAL }
}

/// All of them.
pub const VARIATIONS: [Variation; 14] = [
    intervals(", intervals × 0.5", 0.5),
    intervals(", intervals × 1.5", 1.5),
    intervals(", intervals × 2", 2.0),
    length(", horizon × 0.8", 0.8),
    length(", horizon × 1.25", 1.25),
    bounds(", bounds × 0.8", 0.8),
    bounds(", bounds × 1.5", 1.5),
    guess(", guess of the start", Guess::Constant(0.0)),
    guess(", guess of the middle", Guess::Constant(0.5)),
    guess(", guess of the end", Guess::Constant(1.0)),
    guess(", guess ± 0.1, first", Guess::Disturbed { part: 0.1, seed: 1.0 }),
    guess(", guess ± 0.1, second", Guess::Disturbed { part: 0.1, seed: 2.0 }),
    guess(", guess ± 0.3, first", Guess::Disturbed { part: 0.3, seed: 3.0 }),
    guess(", guess ± 0.3, second", Guess::Disturbed { part: 0.3, seed: 4.0 }),
];

impl Variation {
    /// Bounds and guess of a problem that has the grid already.
    pub fn apply_variation<P: Formulation<f64>>(&self, ocp: &mut HeapOcp<P>) -> Result<(), Failure> {
        let n = ocp.intervals();
        if self.bounds != 1.0 {
            let of_controls = |stage: casados::qp::Stage<'_, f64>| {
                let bounds = stage.u_bounds();
                bounds.lower.iter().copied().zip(bounds.upper.iter().copied()).collect::<Vec<_>>()
            };
            let given: Vec<_> = ocp.qp().stages().take(n).map(of_controls).collect();
            for (k, bounds) in given.iter().enumerate() {
                for (j, (lower, upper)) in bounds.iter().enumerate() {
                    ocp.bound(&format!("u[{j}]"), k..=k, self.bounds * lower, self.bounds * upper)?;
                }
            }
        }
        match self.guess {
            Guess::Given => {}
            Guess::Constant(part) => {
                let at = (part * n as f64).round() as usize;
                let x = ocp.stage(at)?.x.to_vec();
                let u = ocp.stage(at.min(n - 1))?.u.to_vec();
                ocp.guess(&x, &u)?;
            }
            Guess::Disturbed { part, seed } => disturb_guess(ocp, part, seed)?,
        }
        Ok(())
    }
}

/// A number from −1 to 1 for each stage and state.
fn noise(seed: f64, stage: usize, state: usize) -> f64 {
    let angle = 12.9898 * (stage as f64 + 1.0) + 78.233 * (state as f64 + 1.0) + 37.719 * seed;
    let value = angle.sin() * 4375.85453;
    2.0 * (value - value.floor()) - 1.0
}

fn disturb_guess<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, part: f64, seed: f64) -> Result<(), Failure> {
    let last = ocp.intervals();
    let ends = (ocp.stage(0)?.x.to_vec(), ocp.stage(last)?.x.to_vec());
    for k in 0..=last {
        let x = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?.x;
        for (i, (x, (a, b))) in x.iter_mut().zip(ends.0.iter().zip(&ends.1)).enumerate() {
            *x += part * ((a - b).abs() + 0.1) * noise(seed, k, i);
        }
    }
    Ok(())
}
