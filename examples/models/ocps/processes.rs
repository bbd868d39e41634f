//! A reactor, and fish.

use super::{Failure, Grid, rk4};
use casados::ocp::{Formulation, GeneralCost, HeapOcp, Problem, SecondOrder};
use casados::{Gauss, Irk, Options, dae, function, ode};

/// Consecutive reactions `A → B → C` at a temperature in K.
#[ode]
pub fn reactions(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    let first = 4000.0 * (-2500.0 / u[0]).exp() * x[0] * x[0];
    let second = 620000.0 * (-5000.0 / u[0]).exp() * x[1];
    [-first, first - second]
}

#[function]
fn waste(x: [f64; 2], _u: [f64; 1]) -> f64 {
    -x[1]
}

/// As much of `B` as possible. W. H. Ray, "Advanced Process Control", 1981.
pub fn batch_reactor(
    grid: Grid,
) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(40);
    let mut ocp =
        Problem::new(rk4::<Reactions>(1)?).terminal_cost(GeneralCost::<Waste>::new()).on(grid.over(n, 1.0))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.bound("u", .., 298.0, 398.0)?.guess(&[1.0, 0.0], &[350.0])?;
    Ok(ocp)
}

/// The same reactions with their rates as algebraic states.
#[dae]
pub fn reactions_with_rates(xdot: [f64; 2], x: [f64; 2], z: [f64; 2], u: [f64; 1]) -> [f64; 4] {
    let [first, second] = z;
    [
        xdot[0] + first,
        xdot[1] - first + second,
        first - 4000.0 * (-2500.0 / u[0]).exp() * x[0] * x[0],
        second - 620000.0 * (-5000.0 / u[0]).exp() * x[1],
    ]
}

#[function]
fn waste_beside_rates(x: [f64; 2], _z: [f64; 2], _u: [f64; 1]) -> f64 {
    -x[1]
}

/// The batch reactor as a differential-algebraic model and as an ordinary one, both by Gauss'
/// method of two stages.
#[allow(clippy::type_complexity)]
#[allow(dead_code)] // Benchmarks solve the ODE alone.
pub fn batch_reactors(
    grid: Grid,
) -> Result<
    (
        HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>,
        HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>,
    ),
    Failure,
> {
    let n = grid.intervals(40);
    let mut implicit = Problem::new(Irk::<ReactionsWithRates, Gauss<2>>::new(Options::default())?)
        .terminal_cost(GeneralCost::<WasteBesideRates>::new())
        .on(grid.over(n, 1.0))?;
    let mut explicit = Problem::new(Irk::<Reactions, Gauss<2>>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Waste>::new())
        .on(grid.over(n, 1.0))?;
    implicit.fix_initial_state(&[1.0, 0.0])?.bound("u", .., 298.0, 398.0)?.guess(&[1.0, 0.0], &[350.0])?;
    explicit.fix_initial_state(&[1.0, 0.0])?.bound("u", .., 298.0, 398.0)?.guess(&[1.0, 0.0], &[350.0])?;
    Ok((implicit, explicit))
}

/// Lotka and Volterra's fish: prey and predators, of which a fleet takes some.
#[ode]
pub fn fish(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [x[0] - x[0] * x[1] - 0.4 * x[0] * u[0], -x[1] + x[0] * x[1] - 0.2 * x[1] * u[0]]
}

#[function]
fn imbalance(x: [f64; 2], _u: [f64; 1]) -> f64 {
    (x[0] - 1.0) * (x[0] - 1.0) + (x[1] - 1.0) * (x[1] - 1.0)
}

/// To the steady state. S. Sager, "Numerical methods for mixed-integer optimal control problems",
/// 2005, relaxed.
pub fn fishing(grid: Grid) -> Result<HeapOcp<impl Formulation<f64, Dynamics: SecondOrder<f64>>>, Failure> {
    let n = grid.intervals(60);
    let mut ocp =
        Problem::new(rk4::<Fish>(1)?).running_cost(GeneralCost::<Imbalance>::new()).on(grid.over(n, 12.0))?;
    ocp.fix_initial_state(&[0.5, 0.7])?.bound("u", .., 0.0, 1.0)?.guess(&[0.5, 0.7], &[0.5])?;
    Ok(ocp)
}
