//! The chain of masses: what a library of one model has.

#[path = "../../../models/chain.rs"]
#[allow(dead_code)]
pub(crate) mod chain;
#[path = "../../../models/chain_problem.rs"]
#[allow(unused_macros, unused_imports)]
mod chain_problem;

use crate::numbers;
use casados::casadi::Program;
use casados::ocp::{Formulation, HeapOcp, Horizon, LeastSquaresCost, Problem, SecondOrder, Shooting};
use casados::prelude::*;
use chain::Chain;
use chain_problem::{Control, State};
use std::error::Error;

const MASSES: usize = {
    let choices = [
        (3, cfg!(feature = "masses-3")),
        (4, cfg!(feature = "masses-4")),
        (6, cfg!(feature = "masses-6")),
        (7, cfg!(feature = "masses-7")),
    ];
    let (mut masses, mut i) = (5, 0);
    while i < choices.len() {
        if choices[i].1 {
            masses = choices[i].0;
        }
        i += 1;
    }
    masses
};
pub(crate) const NX: usize = 6 * (MASSES - 2) + 3;
const ORDER_8: bool = cfg!(feature = "order-8");
pub(crate) const STAGES: usize = if ORDER_8 { 4 } else { 2 };
const INTERVALS: usize = 40;
pub(crate) const SECONDS: f64 = 0.2;

pub(crate) fn options() -> Options {
    Options { steps: if ORDER_8 { 4 } else { 1 }, ..Default::default() }
}

casados::casadi::export! { chain = Irk<Chain<NX>, Gauss<STAGES>>, interval = SECONDS, options = options() }
casados::casadi::export_horizon! {
    chains = Batch<Chain<NX>, Gauss<STAGES>>, interval = SECONDS, intervals = INTERVALS, options = options()
}
casados::casadi::export_problem! { program }

fn program() -> Result<impl Program + 'static, Box<dyn Error>> {
    formulate()
}

pub(crate) fn formulate()
-> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<>>, Box<dyn Error>> {
    back_to_rest(Shooting::new(Batch::<Chain<NX>, Gauss<STAGES>>::new(options())?))
}

/// Back to rest from a disturbance; the environment has both states.
pub(crate) fn back_to_rest<D>(
    dynamics: D,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>> + Send + use<D>>, Box<dyn Error>>
where
    D: SecondOrder<f64, Shape = <Chain<NX> as Dae>::Shape> + Send,
{
    let numbers = numbers()?;
    let (rest, start) = numbers.split_at_checked(NX).ok_or("two states are to be given")?;
    let weights = chain_problem::weights::<NX>();
    let mut ocp = Problem::new(dynamics)
        .running_cost((
            LeastSquaresCost::<State<NX>>::diagonal(&weights),
            LeastSquaresCost::<Control<NX>>::diagonal(&[0.02; 3]),
        ))
        .terminal_cost(LeastSquaresCost::<State<NX>>::diagonal(&weights))
        .on(Horizon::uniform(INTERVALS, SECONDS))?;
    ocp.set_reference(.., &[rest, &[0.0; 3]].concat())?.set_terminal_reference(rest)?;
    ocp.fix_initial_state(start)?.bound("u", .., -1.0, 1.0)?;
    for mass in 0..MASSES - 1 {
        ocp.bound(&format!("x[{}]", 3 * mass + 1), 1..INTERVALS, -0.05, f64::INFINITY)?;
    }
    ocp.guess(rest, &[0.0; 3])?;
    Ok(ocp)
}
