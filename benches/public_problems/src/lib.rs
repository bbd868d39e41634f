//! Problems of optimal control from public collections, typed as users would type them, each with a
//! plain guess and a published optimal value: the set on which mechanisms of solvers are judged.
//! No solver is tuned on it.
//!
//! Half of them are [held out](Facts::is_held_out): the final table alone shows these.

mod export;

pub mod families;
#[path = "../../../examples/models/ocps/mod.rs"]
#[allow(dead_code)]
pub mod ocps;
pub mod ipopt;
pub mod run;
pub mod sets;
pub mod switches;
pub mod table;
#[path = "../../src/bin/ocp_collection/variations.rs"]
mod variations;

use casados::casadi::Program;
use casados::ocp::{Formulation, HeapOcp, SecondOrder};
use run::{Made, Task};

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
    /// How far the optimum of the discretised problem may be from it: four thirds of the difference
    /// between this grid and one of half the intervals' length (Richardson, order two), by IPOPT,
    /// and half a unit of the last published digit.
    pub tolerance: f64,
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
        tolerance: f64,
        tags: &'static [&'static str],
    ) -> Self {
        Self { name: name.into(), source, published: Some(published), tolerance, tags }
    }

    /// Whether the final table alone shows the problem: if the sum of the bytes of its name is odd.
    /// The rule was written before any problem was solved, and names are not chosen by it.
    #[must_use]
    pub fn is_held_out(&self) -> bool {
        self.published.is_some() && self.name.bytes().map(u32::from).sum::<u32>() % 2 == 1
    }

    /// Whether an objective is that of the published optimum.
    #[must_use]
    pub fn is_optimum(&self, objective: f64) -> bool {
        self.published.is_none_or(|f| (objective - f).abs() <= self.tolerance)
    }
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
