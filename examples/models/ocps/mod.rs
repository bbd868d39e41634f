//! Twenty problems of optimal control, each with a plain guess: a straight line or a constant.
//!
//! Intervals are integrated by the classical Runge-Kutta method of order four, those of the
//! differential-algebraic model by Gauss' method of two stages. `benches/peers/ocps.py` has the
//! same problems for CasADi, written independently.

pub mod flight;
pub mod mechanics;
pub mod processes;
pub mod textbook;
pub mod vehicles;

use casados::ocp::{Formulation, HeapOcp, Horizon, OcpError};
use casados::{Erk, Error, Ode, Options, Rk4};

/// Intervals and length of a horizon, as parts of those that a problem is given with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    pub intervals: f64,
    pub length: f64,
}

/// The grids that problems are given with.
pub const GIVEN: Grid = Grid { intervals: 1.0, length: 1.0 };

impl Grid {
    /// So many intervals of so many.
    pub fn intervals(self, given: usize) -> usize {
        (self.intervals * given as f64).round() as usize
    }
    /// As many uniform intervals as there are, over a horizon of that length if nothing is varied.
    pub fn over(self, intervals: usize, length: f64) -> Horizon<'static, f64> {
        Horizon::uniform(intervals, self.length * length / intervals as f64)
    }
}

/// What may go wrong while a problem is put together.
pub type Failure = Box<dyn std::error::Error>;

/// The classical Runge-Kutta method with some steps in each interval.
fn rk4<M: Ode>(steps: usize) -> Result<Erk<M, Rk4>, Error> {
    Erk::<M, Rk4>::new(Options { steps, ..Options::default() })
}

/// The straight line between two states, and a constant control, as the guess.
pub fn line<P: Formulation<f64>>(
    ocp: &mut HeapOcp<P>,
    from: &[f64],
    to: &[f64],
    u: &[f64],
) -> Result<(), OcpError> {
    let n = ocp.intervals();
    for k in 0..=n {
        let part = k as f64 / n as f64;
        let x: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + part * (b - a)).collect();
        ocp.guess_stage(k, &x, if k < n { u } else { &[] })?;
    }
    Ok(())
}

/// Gives the first states values at a stage: not more than are in the list.
fn fix<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, stage: usize, values: &[f64]) -> Result<(), OcpError> {
    for (i, &value) in values.iter().enumerate() {
        ocp.bound(&format!("x[{i}]"), stage..=stage, value, value)?;
    }
    Ok(())
}

/// Calls a macro with the names of all problems, each `module::function`.
macro_rules! each_ocp {
    ($call:ident) => {
        $call! {
            vehicles::car, vehicles::tyres, vehicles::obstacles, flight::quadrotor, flight::landing,
            flight::goddard, mechanics::cart_pole, mechanics::crane, mechanics::arm, mechanics::pendulum,
            mechanics::robot, mechanics::motor, textbook::bang_bang, textbook::van_der_pol,
            textbook::bryson_denham, textbook::rayleigh, textbook::zermelo, textbook::hanging_chain,
            processes::batch_reactor, processes::fishing
        }
    };
}
pub(crate) use each_ocp;
