//! Reactors and fermenters.

use super::{FREE, fix, intervals, line, made, over, rk4};
use crate::{Entry, Facts};
use casados::ocp::{GeneralCost, Problem, WithIntegral};
use casados::{Quadrature, function, ode};

/// A catalyst's mixture along a reactor: two substances; the part of the first catalyst.
#[ode]
pub fn mixture(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    let first = u[0] * (10.0 * x[1] - x[0]);
    [first, -first - (1.0 - u[0]) * x[1]]
}

#[function]
fn unconverted(x: [f64; 2], _u: [f64; 1]) -> f64 {
    x[0] + x[1] - 1.0
}

/// As much of the third substance as possible; the arc in the middle is singular.
fn catalyst_mixing() -> made!() {
    let n = intervals(50);
    let mut ocp =
        Problem::new(rk4::<Mixture>(1)?).terminal_cost(GeneralCost::<Unconverted>::new()).on(over(n, 1.0))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.bound("u", .., 0.0, 1.0)?.guess(&[1.0, 0.0], &[0.5])?;
    Ok(ocp)
}

/// Parallel reactions in a tube.
#[ode]
pub fn parallel(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    [-(u[0] + 0.5 * u[0] * u[0]) * x[0], u[0] * x[0]]
}

#[function]
fn less_product(x: [f64; 2], _u: [f64; 1]) -> f64 {
    -x[1]
}

/// As much of the product as possible.
fn tubular_reactor() -> made!() {
    let n = intervals(50);
    let mut ocp = Problem::new(rk4::<Parallel>(1)?)
        .terminal_cost(GeneralCost::<LessProduct>::new())
        .on(over(n, 1.0))?;
    ocp.fix_initial_state(&[1.0, 0.0])?.bound("u", .., 0.0, 5.0)?.guess(&[1.0, 0.0], &[1.0])?;
    Ok(ocp)
}

/// A stirred tank near an unstable steady state: deviations of temperature and concentration; the
/// flow of coolant.
#[ode]
pub fn stirred_tank(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
    let rate = (x[1] + 0.5) * (25.0 * x[0] / (x[0] + 2.0)).exp();
    [-2.0 * (x[0] + 0.25) + rate - u[0] * (x[0] + 0.25), 0.5 - x[1] - rate]
}

#[function]
fn deviations(x: [f64; 2], u: [f64; 1]) -> f64 {
    x[0] * x[0] + x[1] * x[1] + 0.1 * u[0] * u[0]
}

/// Back to the steady state; there is a second minimum, 0.2446.
fn cstr() -> made!() {
    let n = intervals(50);
    let dynamics = WithIntegral::new(rk4::<StirredTank>(1)?, Quadrature::<Deviations>::new());
    let mut ocp = Problem::new(dynamics).on(over(n, 0.78))?;
    ocp.fix_initial_state(&[0.09, 0.09])?.guess(&[0.0, 0.0], &[0.0])?;
    Ok(ocp)
}

/// Penicillin over `τ ∈ [0, 1]`: biomass, product, substrate, volume, time in h; the feed.
#[ode]
pub fn fed_batch(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let [biomass, product, substrate, volume, time] = x;
    let growth = 0.11 * substrate / (0.006 * biomass + substrate);
    let making = 0.0055 * substrate / (0.0001 + substrate * (1.0 + 10.0 * substrate));
    let dilution = u[0] / (500.0 * volume);
    [
        time * (growth - dilution) * biomass,
        time * (making * biomass - 0.01 * product - dilution * product),
        time * (-growth * biomass / 0.47
            - making * biomass / 1.2
            - biomass * 0.029 * substrate / (0.0001 + substrate)
            + u[0] / volume * (1.0 - substrate / 500.0)),
        time * u[0] / 500.0,
        0.0,
    ]
}

#[function]
fn less_penicillin(x: [f64; 5], _u: [f64; 1]) -> f64 {
    -x[1] * x[3]
}

/// Cuthrell and Biegler's fermenter: as much penicillin as possible in a free time.
fn penicillin() -> made!() {
    let n = intervals(60);
    let mut ocp = Problem::new(rk4::<FedBatch>(4)?)
        .terminal_cost(GeneralCost::<LessPenicillin>::new())
        .on(over(n, 1.0))?;
    ocp.free_initial_state();
    ocp.bound("x[0]", .., 0.0, 40.0)?.bound("x[1]", .., 0.0, 50.0)?.bound("x[2]", .., 0.0, 25.0)?;
    ocp.bound("x[3]", .., 0.0, 10.0)?.bound("x[4]", .., 72.0, 200.0)?.bound("u", .., 0.0, 50.0)?;
    fix(&mut ocp, 0, &[1.5, 0.0, 0.0, 7.0])?;
    line(&mut ocp, &[1.5, 0.0, 0.0, 7.0, 130.0], &[30.0, 8.0, 0.0, 10.0, 130.0], &[11.0])?;
    Ok(ocp)
}

/// Foreign protein: volume, cells, nutrient, protein, inducer, shock and recovery; feeds of
/// nutrient and inducer.
#[ode]
pub fn induction(x: [f64; 7], u: [f64; 2]) -> [f64; 7] {
    let [volume, cells, nutrient, protein, inducer, shock, recovery] = x;
    let k = 0.09 * inducer / (0.034 + inducer);
    let common = nutrient / (14.35 + nutrient + nutrient * nutrient / 111.5);
    let growth = common * (shock + 0.22 * recovery / (0.22 + inducer));
    let making = 0.233 * common * (0.0005 + inducer) / (0.022 + inducer);
    let dilution = (u[0] + u[1]) / volume;
    [
        u[0] + u[1],
        (growth - dilution) * cells,
        100.0 * u[0] / volume - dilution * nutrient - growth * cells / 0.51,
        making * cells - dilution * protein,
        4.0 * u[1] / volume - dilution * inducer,
        -k * shock,
        k * (1.0 - recovery),
    ]
}

#[function]
fn less_protein(x: [f64; 7], _u: [f64; 2]) -> f64 {
    -x[0] * x[3]
}

/// Lee and Ramirez' bioreactor.
fn lee_ramirez() -> made!() {
    let n = intervals(50);
    let mut ocp = Problem::new(rk4::<Induction>(2)?)
        .terminal_cost(GeneralCost::<LessProtein>::new())
        .on(over(n, 10.0))?;
    let start = [1.0, 0.1, 40.0, 0.0, 0.0, 1.0, 0.0];
    ocp.fix_initial_state(&start)?.bound("u", .., 0.0, 1.0)?.guess(&start, &[0.1, 0.0])?;
    Ok(ocp)
}

/// Secreted protein: secreted and all of it, cells, substrate, volume; the feed.
#[ode]
pub fn secretion(x: [f64; 5], u: [f64; 1]) -> [f64; 5] {
    let g3 = 21.87 * x[3] / ((x[3] + 0.4) * (x[3] + 62.5));
    let g1 = 4.75 * g3 / (0.12 + g3);
    let g2 = x[3] / (0.1 + x[3]) * (-5.0 * x[3]).exp();
    let dilution = u[0] / x[4];
    [
        g1 * (x[1] - x[0]) - dilution * x[0],
        g2 * x[2] - dilution * x[1],
        (g3 - dilution) * x[2],
        -7.3 * g3 * x[2] + dilution * (20.0 - x[3]),
        u[0],
    ]
}

#[function]
fn less_secreted(x: [f64; 5], _u: [f64; 1]) -> f64 {
    -x[0] * x[4]
}

/// Park and Ramirez' bioreactor, with several singular arcs.
fn park_ramirez() -> made!() {
    let n = intervals(60);
    let mut ocp = Problem::new(rk4::<Secretion>(4)?)
        .terminal_cost(GeneralCost::<LessSecreted>::new())
        .on(over(n, 15.0))?;
    let start = [0.0, 0.0, 1.0, 5.0, 1.0];
    ocp.fix_initial_state(&start)?.bound("u", .., 0.0, 2.0)?.bound("x", 1.., 0.0, FREE)?;
    ocp.guess(&start, &[0.5])?;
    Ok(ocp)
}

/// All of them.
pub fn all() -> Vec<Entry> {
    let facts = Facts::new;
    vec![
        Entry::new(
            facts("catalyst_mixing", "PSOPT, catmix; COPS 3.0", -0.0480532, 5e-8, &["singular arc"]),
            catalyst_mixing,
        ),
        Entry::new(
            facts("tubular_reactor", "S. A. Dadebo, K. B. McAuley 1995", -0.573530, 5e-7, &["smooth"]),
            tubular_reactor,
        ),
        Entry::new(
            facts("cstr", "R. Luus, Iterative Dynamic Programming, 2000", 0.133094, 5e-7, &["two minima"]),
            cstr,
        ),
        Entry::new(
            facts(
                "penicillin",
                "J. E. Cuthrell, L. T. Biegler 1989; PROPT",
                -87.99,
                5e-3,
                &["free time", "singular arc", "state constraint", "stiff"],
            ),
            penicillin,
        ),
        Entry::new(
            facts(
                "lee_ramirez",
                "J. Lee, W. F. Ramirez 1994; PROPT",
                -6.1516,
                5e-5,
                &["singular arc", "flat"],
            ),
            lee_ramirez,
        ),
        Entry::new(
            facts("park_ramirez", "E. Balsa-Canto et al. 2001; PROPT", -32.47, 5e-3, &["singular arc"]),
            park_ramirez,
        ),
    ]
}
