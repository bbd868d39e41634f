//! Problems of optimal control from public collections, typed as users would type them, each with a
//! plain guess and a published optimal value: the set on which mechanisms of solvers are judged.
//! No solver is tuned on it.
//!
//! Half of them are [held out](Facts::is_held_out): the final table alone shows these.

mod export;

pub mod families;
pub mod ipopt;
#[path = "../../../examples/models/ocps/mod.rs"]
#[allow(dead_code)]
pub mod ocps;
pub mod run;
pub mod sets;
pub mod switches;
pub mod table;
#[path = "../../src/bin/ocp_collection/variations.rs"]
mod variations;

use casados::casadi::Program;
use casados::ocp::{Formulation, HeapOcp, SecondOrder};
use run::{Made, Task};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// What may go wrong while a problem is put together.
pub type Failure = Box<dyn std::error::Error>;

/// What is known of a problem.
#[derive(Clone, Debug)]
pub struct Facts {
    pub name: String,
    /// Where the statement and the value are from.
    pub source: &'static str,
    /// The optimal value, as a minimum; none is known of the tuning sets.
    pub published: Option<f64>,
    /// Half a unit of its last digit; zero for a closed form, and a hundredth where the published
    /// value is that of a jumping control on a grid of 40 nodes.
    pub precision: f64,
    /// The kind of problem.
    pub tags: &'static [&'static str],
}

impl Facts {
    /// Of a problem with a published value.
    #[must_use]
    pub fn new(
        name: &str,
        source: &'static str,
        published: f64,
        precision: f64,
        tags: &'static [&'static str],
    ) -> Self {
        Self { name: name.into(), source, published: Some(published), precision, tags }
    }

    /// Whether the final table alone shows the problem: if the sum of the bytes of its name is odd.
    /// The rule was written before any problem was solved, and names are not chosen by it.
    #[must_use]
    pub fn is_held_out(&self) -> bool {
        self.published.is_some() && self.name.bytes().map(u32::from).sum::<u32>() % 2 == 1
    }

    /// How far the optimum of the discretised problem may be from the published one: twice the
    /// difference between this grid and one with twice as many intervals (Richardson's
    /// extrapolation, order one or more) by IPOPT, as `grids.json` has them, the precision of what
    /// is published, and what a solver's tolerance leaves; a hundredth where there is no entry.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        let Some(published) = self.published else { return f64::INFINITY };
        let size = published.abs().max(1e-3);
        let discretised = match grids().get(&self.name) {
            Some([coarse, fine]) => 2.0 * (coarse - fine).abs(),
            None => 1e-2 * size,
        };
        discretised + self.precision + 1e-6 * size
    }

    /// Whether an objective is that of the published optimum.
    #[must_use]
    pub fn is_optimum(&self, objective: f64) -> bool {
        self.published.is_none_or(|published| (objective - published).abs() <= self.tolerance())
    }
}

/// IPOPT's objectives of problems on their grids, and on grids with twice as many intervals.
fn grids() -> &'static BTreeMap<String, [f64; 2]> {
    static GRIDS: OnceLock<BTreeMap<String, [f64; 2]>> = OnceLock::new();
    GRIDS.get_or_init(|| {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/grids.json");
        let text = std::fs::read_to_string(path).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    })
}

/// A problem, ready to be solved.
pub struct Entry {
    pub facts: Facts,
    solve: Box<dyn Fn(&Task<'_>) -> Made>,
    program: Box<dyn Fn() -> Result<Box<dyn Program>, Failure>>,
}

impl Entry {
    /// What `make` makes.
    pub fn new<P>(facts: Facts, make: impl Fn() -> Result<HeapOcp<P>, Failure> + Clone + 'static) -> Self
    where
        P: Formulation<f64, Dynamics: SecondOrder<f64>> + Send + 'static,
    {
        let again = make.clone();
        let solve = Box::new(move |task: &Task<'_>| run::solve(&make, task));
        Self { facts, solve, program: Box::new(move || Ok(Box::new(again()?))) }
    }

    /// Solves it.
    #[must_use]
    pub fn solve(&self, task: &Task<'_>) -> Made {
        (self.solve)(task)
    }

    /// The problem for CasADi.
    ///
    /// # Errors
    /// Those of its maker.
    pub fn program(&self) -> Result<Box<dyn Program>, Failure> {
        (self.program)()
    }
}
