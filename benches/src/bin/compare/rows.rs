//! What is measured, line by line.

use super::anchors::Anchors;
use super::casadi::Casadi;
use super::{Effort, Failure};
use casados::prelude::*;
use casados_benches::calls::{open, options};
use casados_benches::case::{Case, Family, Mode, Values};
use casados_benches::time::{Summary, measure};

/// A time and the error of what was computed in it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Measured {
    /// Seconds of one call.
    pub time: Summary,
    /// Relative to the largest element of the reference; none without a reference.
    pub error: Option<f64>,
}

/// One question to one case.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: String,
    /// Differential states.
    pub nx: usize,
    /// The question.
    pub mode: Mode,
    /// Where the reference is from.
    pub reference: &'static str,
    /// From zero, Newton's method to 1e-8 / steps.
    pub cold: Measured,
    /// From zero, to rounding.
    pub rounding: Measured,
    /// From the stages of an interval that is 1e-2 away, to 1e-8 / steps.
    pub warm: Option<Measured>,
    /// Forty calls for the intervals of a horizon; one of them.
    pub forty: Measured,
    /// CasADi before and after.
    pub casadi: Option<[Measured; 2]>,
    /// acados' IRK and GNSF, carried over; seconds.
    pub acados: [Option<f64>; 2],
}

impl Row {
    /// CasADi's time: the mean of before and after.
    pub fn casadi_time(&self) -> Option<f64> {
        self.casadi.map(|[a, b]| (a.time.median + b.time.median) / 2.0)
    }
}

/// Jacobians of this size and Hessians of that keep CasADi busy for minutes.
fn affordable(case: &Case, mode: Mode) -> bool {
    let work = case.nx * case.stages * case.steps;
    match mode {
        Mode::Simulation => true,
        Mode::Adjoint | Mode::Forward => work <= 1200,
        Mode::Hessian => work <= 800,
    }
}

/// All questions to one case; to each CasADi before and after.
pub fn measure_case(case: &Case, casadi: Option<&mut Casadi>, effort: Effort) -> Result<Vec<Row>, Failure> {
    let mut case = case.clone();
    let modes: Vec<Mode> = Mode::ALL.into_iter().filter(|m| affordable(&case, *m)).collect();
    let solver = if case.family == Family::Rk4 { "rk" } else { "collocation" };
    let mut casadi = casadi;
    if case.reference.is_none()
        && let Some(casadi) = casadi.as_mut()
    {
        case.reference = casadi.values(&case, &modes).ok().map(|values| ("CasADi", values));
    }
    let reference = case.reference.as_ref().map(|(_, values)| values);

    let mut rows = Vec::new();
    for mode in Mode::ALL {
        let ask = |casadi: &mut Option<&mut Casadi>| {
            let casadi = casadi.as_mut().filter(|_| affordable(&case, mode))?;
            casadi.time(&case, solver, mode, effort.seconds, reference).ok()
        };
        let before = ask(&mut casadi);
        let single = 0..case.single;
        let cold = time(&case, 1e-8, Start::Zero, mode, single.clone(), effort)?;
        let rounding = time(&case, 0.0, Start::Zero, mode, single, effort)?;
        let implicit = case.family != Family::Rk4;
        let warm = implicit.then(|| time(&case, 1e-8, Start::Warm, mode, 0..2, effort)).transpose()?;
        let forty = time(&case, 1e-8, Start::Zero, mode, 0..case.inputs.len(), effort)?;
        let after = ask(&mut casadi);
        rows.push(Row {
            case: case.name.clone(),
            nx: case.nx,
            mode,
            reference: match &case.reference {
                Some((source, values)) if !values.of(mode).is_empty() => source,
                _ => "none",
            },
            cold,
            rounding,
            warm,
            forty,
            casadi: before.zip(after).map(|(before, after)| [before, after]),
            acados: [None; 2],
        });
    }
    Ok(rows)
}

/// Passes over some inputs of a case: the time of one call, and the error at the first of them.
pub fn time(
    case: &Case,
    tolerance: f64,
    start: Start,
    mode: Mode,
    inputs: std::ops::Range<usize>,
    effort: Effort,
) -> Result<Measured, Failure> {
    let mut calls = open(case, options(case, tolerance, start))?;
    let values = calls.values(mode, 0).map_err(|e| format!("{}: {e}", case.name))?;
    let error =
        case.reference.as_ref().and_then(|(_, reference): &(_, Values)| values.error(reference, mode));
    let count = inputs.len() as f64;
    let time = measure(effort.budget(), || inputs.clone().try_for_each(|k| calls.call(mode, k)))
        .map_err(|e| format!("{}: {e}", case.name))?;
    Ok(Measured { time: time.divided(count), error })
}

/// Carries acados' times over; see [`Anchors`].
pub fn carry(rows: &mut [Row], anchors: &Anchors) {
    let general = anchors.general_scale(rows);
    let scales: Vec<_> =
        rows.iter().map(|row| anchors.scale(rows, &row.case).map(|s| s.min(general))).collect();
    for (row, scale) in rows.iter_mut().zip(scales) {
        let scale = scale.unwrap_or(general);
        let carried =
            |key| anchors.seconds(&row.case, key, row.mode).map(|t| t * scale).filter(|t| t.is_finite());
        row.acados = [carried("irk"), carried("gnsf")];
    }
}
