//! The problems, and the methods of this library on them.

use super::models::chemistry::{AkzoNobel, E5Conserved, Hires, Oregonator, Robertson};
use super::models::circuits::{RingModulator, TransistorAmplifier};
use super::models::mechanics::{Pleiades, Squeezer};
use super::models::oscillators::VanDerPol;
use casados::{
    Adaptive, AdaptiveOptions, DormandPrince5, DormandPrince8, Error, Irk, Options, Radau, RadauIIA,
};
use nalgebra::SVector;
use reference_data::Record;

/// What a call gave: the values at the end, and what it took.
#[derive(Clone, Debug, Default)]
pub struct Call {
    pub y: Vec<f64>,
    /// `dx/d(x₀, p)`, row by row, if it was asked for.
    pub derivatives: Vec<f64>,
    pub steps: usize,
    pub factorizations: usize,
}

/// A solver that is ready to be called again and again.
pub type Solver = Box<dyn FnMut() -> Result<Call, Error>>;

/// A method of this library.
pub struct Method {
    pub name: &'static str,
    /// Whether the accuracy is a number of steps instead of a tolerance.
    pub fixed: bool,
    /// A solver for an accuracy, with derivatives or without.
    pub open: Box<dyn Fn(f64, bool) -> Result<Solver, Error>>,
}

/// A problem of the set.
pub struct Problem {
    pub name: &'static str,
    pub title: &'static str,
    pub x0: Vec<f64>,
    pub p: Vec<f64>,
    pub t: f64,
    /// Absolute tolerance relative to the relative one.
    pub atol: f64,
    /// The solution at the end, and its derivatives where they are known.
    pub y: Vec<f64>,
    pub derivatives: Option<Vec<f64>>,
    pub methods: Vec<Method>,
}

impl Problem {
    fn load(name: &'static str, title: &'static str, t: f64, atol: f64) -> Result<Self, String> {
        let set = Record::load("ivp/ends.json")?;
        let record = set.record(name)?;
        let (x0, p) = (record.list("x0")?, record.list("p")?);
        let same = |end: &Record| end.number("t").is_ok_and(|found| found == t);
        let end = record.records("ends")?.into_iter().find(same);
        let y = end.ok_or_else(|| format!("{name}: no values at {t}"))?.list("y")?;
        let known = Record::load("ivp/sensitivities.json")?.records("first")?.into_iter();
        let known = known.filter(same).find(|record| record.text("name").is_ok_and(|found| found == name));
        let derivatives = match known {
            Some(record) => {
                let rows = |key, columns| record.numbers(key, y.len() * columns);
                let (left, right) = (rows("dx_dx0", x0.len())?, rows("dx_dp", p.len())?);
                let pairs = (0..x0.len()).flat_map(|i| {
                    let row = |all: &[f64], columns: usize| all[i * columns..(i + 1) * columns].to_vec();
                    [row(&left, x0.len()), row(&right, p.len())].concat()
                });
                Some(pairs.collect())
            }
            None => None,
        };
        Ok(Self { name, title, x0, p, t, atol, y, derivatives, methods: Vec::new() })
    }
}

/// A method with a tolerance, with derivatives that are known or not.
macro_rules! adaptive {
    ($problem:ident, $model:ty, $method:ty, $name:literal, $values:expr, $derivatives:ident) => {{
        let (x0, p, t, ratio) = ($problem.x0.clone(), $problem.p.clone(), $problem.t, $problem.atol);
        let open = move |rtol: f64, derivatives: bool| -> Result<Solver, Error> {
            let options =
                AdaptiveOptions { rtol, atol: ratio * rtol, keep_steps: derivatives, ..Default::default() };
            let mut solver = Adaptive::<$model, $method>::new(options)?;
            solver.set_parameters(&SVector::from_column_slice(&p))?;
            let x0 = SVector::from_column_slice(&x0);
            Ok(Box::new(move || {
                let mut call = Call::default();
                if derivatives {
                    derivatives!($derivatives, solver, x0, t, $values, call);
                } else {
                    let result = solver.solve(&x0, &SVector::zeros(), t)?;
                    call.y = $values(result.x.as_slice(), result.z.as_slice());
                }
                let work = solver.statistics();
                call.steps = work.steps + work.rejected + work.failed;
                call.factorizations = work.factorizations;
                Ok(call)
            }))
        };
        $problem.methods.push(Method { name: $name, fixed: false, open: Box::new(open) });
    }};
}

/// The derivatives of all states by `(x₀, p)`, where they are known; a model is not differentiated
/// where they are not.
macro_rules! derivatives {
    (unknown, $($rest:tt)*) => {};
    (known, $solver:ident, $x0:ident, $t:ident, $values:expr, $call:ident) => {
        let result = $solver.forward(&$x0, &SVector::zeros(), $t)?;
        $call.y = $values(result.nominal.x.as_slice(), result.nominal.z.as_slice());
        for (left, right) in result.dx_dx0.row_iter().zip(result.dx_dp.row_iter()) {
            $call.derivatives.extend(left.iter().chain(right.iter()));
        }
    };
}

/// A method with a number of equal steps.
macro_rules! fixed {
    ($problem:ident, $model:ty, $method:ty, $name:literal, $values:expr) => {{
        let (x0, p, t) = ($problem.x0.clone(), $problem.p.clone(), $problem.t);
        let open = move |steps: f64, _: bool| -> Result<Solver, Error> {
            let steps = steps as usize;
            let mut solver = Irk::<$model, $method>::new(Options { steps, ..Default::default() })?;
            solver.set_parameters(&SVector::from_column_slice(&p))?;
            let x0 = SVector::from_column_slice(&x0);
            Ok(Box::new(move || {
                let result = solver.solve(&x0, &SVector::zeros(), t)?;
                let y = $values(result.x.as_slice(), result.z.as_slice());
                let factorizations = solver.statistics().factorizations;
                Ok(Call { y, steps, factorizations, ..Default::default() })
            }))
        };
        $problem.methods.push(Method { name: $name, fixed: true, open: Box::new(open) });
    }};
}

/// The problem with its methods.
macro_rules! problem {
    ($model:ty, $problem:expr, $values:expr) => {
        problem!($model, $problem, $values, unknown)
    };
    ($model:ty, $problem:expr, $values:expr, $derivatives:ident) => {{
        let mut problem = $problem;
        adaptive!(problem, $model, Radau, "Radau", $values, $derivatives);
        adaptive!(problem, $model, RadauIIA<3>, "Radau IIA, s = 3", $values, $derivatives);
        adaptive!(problem, $model, RadauIIA<5>, "Radau IIA, s = 5", $values, $derivatives);
        adaptive!(problem, $model, RadauIIA<7>, "Radau IIA, s = 7", $values, $derivatives);
        fixed!(problem, $model, RadauIIA<3>, "Radau IIA, s = 3, equal steps", $values);
        problem
    }};
}

fn states(x: &[f64], z: &[f64]) -> Vec<f64> {
    [x, z].concat()
}

/// All of them.
///
/// # Errors
/// Data that is not there.
pub fn all_problems() -> Result<Vec<Problem>, String> {
    let load = Problem::load;
    let mut e5 = load("e5", "E5", 1e11, 1e-80)?;
    e5.x0.truncate(3);
    let rest = |x: &[f64], z: &[f64]| vec![x[0], x[1], z[0], x[2]];
    let mut pleiades = problem!(Pleiades, load("pleiades", "Pleiades", 3.0, 1.0)?, states);
    adaptive!(pleiades, Pleiades, DormandPrince5, "Dormand-Prince 5", states, unknown);
    adaptive!(pleiades, Pleiades, DormandPrince8, "Dormand-Prince 8", states, unknown);
    Ok(vec![
        problem!(Robertson, load("robertson", "Robertson", 1e11, 1e-8)?, states, known),
        problem!(Hires, load("hires", "HIRES", 321.8122, 1e-3)?, states),
        problem!(VanDerPol, load("van_der_pol_1e3", "Van der Pol, μ = 1e3", 2e3, 1e-3)?, states, known),
        problem!(VanDerPol, load("van_der_pol_1e6", "Van der Pol, μ = 1e6", 2e6, 1e-6)?, states),
        problem!(Oregonator, load("oregonator", "Oregonator", 360.0, 1e-2)?, states, known),
        problem!(E5Conserved, e5, rest),
        problem!(AkzoNobel, load("akzo_nobel", "Chemical Akzo Nobel", 180.0, 1e-3)?, states, known),
        problem!(
            TransistorAmplifier,
            load("transistor_amplifier", "Transistor amplifier", 0.2, 1e-2)?,
            states
        ),
        problem!(RingModulator, load("ring_modulator", "Ring modulator", 1e-3, 1e-4)?, states),
        pleiades,
        problem!(Squeezer, load("squeezer", "Andrews' squeezer", 0.03, 1.0)?, states),
    ])
}
