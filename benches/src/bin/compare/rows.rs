//! What is measured, line by line.

use super::acados::{self, Acados};
use super::casadi::Casadi;
use super::reference_times::ReferenceTimes;
use super::{Failure, MeasurementBudget};
use casados::prelude::*;
use casados_benches::calls::{BatchCalls, IntegratorCalls, open_batch, open_calls, options};
use casados_benches::case::{Case, Family, Mode};
use casados_benches::time::{Summary, measure};
use std::ops::Range;

/// A time and the error of what was computed in it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Measured {
    /// Seconds of one call.
    pub time: Summary,
    /// Relative to the largest element of the reference; none without a reference.
    pub error: Option<f64>,
    /// Iterations of Newton's method in the last call; zero for peers.
    pub iterations: usize,
    /// Factorisations of it in which the whole matrix was pivoted.
    pub dense: usize,
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
    pub batch_of_forty: Measured,
    /// The same in one call of a batch; one of them.
    pub batch: Option<Measured>,
    /// CasADi, in the same rounds.
    pub casadi: Option<Measured>,
    /// acados' IRK (or ERK) and GNSF.
    pub acados: [Option<AcadosTime>; 2],
}

/// What is known about acados.
#[derive(Clone, Copy, Debug)]
pub enum AcadosTime {
    /// Measured in the same rounds.
    Measured(Measured),
    /// Seconds, carried over from another machine; see [`ReferenceTimes`].
    CarriedOver(f64),
}

impl AcadosTime {
    /// None if it was carried over.
    pub fn measured(&self) -> Option<Measured> {
        match self {
            Self::Measured(measured) => Some(*measured),
            Self::CarriedOver(_) => None,
        }
    }

    /// Of one call.
    pub fn seconds(&self) -> f64 {
        match self {
            Self::Measured(measured) => measured.time.median,
            Self::CarriedOver(seconds) => *seconds,
        }
    }
}

/// Peers in processes of their own, as many as there are.
#[derive(Default)]
pub struct Peers {
    pub casadi: Option<Casadi>,
    /// The same acados for several targets; the fastest counts.
    pub acados: Vec<Acados>,
}

/// Jacobians of this size and Hessians of that keep CasADi busy for minutes.
fn is_affordable(case: &Case, mode: Mode) -> bool {
    let work = case.nx * case.stages * case.steps;
    match mode {
        Mode::Simulation => true,
        Mode::Adjoint | Mode::Forward => work <= 1200,
        Mode::Hessian => work <= 800,
    }
}

/// All questions to one case, the peers and casados in turn.
pub fn measure_case(case: &Case, peers: &mut Peers, effort: MeasurementBudget) -> Result<Vec<Row>, Failure> {
    let mut case = case.clone();
    let modes: Vec<Mode> = Mode::ALL_MODES.into_iter().filter(|m| is_affordable(&case, *m)).collect();
    if case.reference.is_none()
        && let Some(casadi) = peers.casadi.as_mut()
    {
        case.reference = casadi.values(&case, &modes).ok().map(|values| ("CasADi", values));
    }
    Mode::ALL_MODES.into_iter().map(|mode| measure_row(&case, mode, peers, effort)).collect()
}

/// A question to a peer, given the seconds that it may take.
type Ask<'a> = Box<dyn FnMut(f64) -> Result<Measured, String> + 'a>;

/// A question to a peer, and the times of the rounds.
struct PeerTimer<'a> {
    /// Whose it is: zero for CasADi, one and two for acados' columns.
    column: usize,
    ask: Ask<'a>,
    first: Measured,
    rounds: Vec<Summary>,
}

impl<'a> PeerTimer<'a> {
    /// Builds what is asked and calls it once before the clock runs; what the peer cannot do is
    /// left out.
    fn new(column: usize, mut ask: Ask<'a>) -> Option<Self> {
        let first = ask(0.0).inspect_err(|why| eprintln!("    without a peer: {why}")).ok()?;
        Some(Self { column, ask, first, rounds: Vec::new() })
    }

    fn round(&mut self, effort: MeasurementBudget) -> Result<(), Failure> {
        self.rounds.push((self.ask)(effort.seconds / ROUNDS as f64)?.time);
        Ok(())
    }

    fn finish(self) -> (usize, Measured) {
        (self.column, Measured { time: from_rounds(&self.rounds), ..self.first })
    }
}

fn ask_all_peers<'a>(case: &'a Case, mode: Mode, peers: &'a mut Peers) -> Vec<PeerTimer<'a>> {
    let reference = case.reference.as_ref().map(|(_, values)| values);
    let solver = if case.family == Family::Rk4 { "rk" } else { "collocation" };
    let mut all = Vec::new();
    if let Some(casadi) = peers.casadi.as_mut().filter(|_| is_affordable(case, mode)) {
        let ask = move |seconds| casadi.time(case, solver, mode, seconds, reference);
        all.extend(PeerTimer::new(0, Box::new(ask)));
    }
    for acados in &mut peers.acados {
        let acados = std::rc::Rc::new(std::cell::RefCell::new(acados));
        for (column, integrator) in (1..).zip(acados::integrators_of_row(case, mode)) {
            let Some(integrator) = integrator else { continue };
            let acados = acados.clone();
            let ask = move |seconds| acados.borrow_mut().time(case, integrator, mode, seconds, reference);
            all.extend(PeerTimer::new(column, Box::new(ask)));
        }
    }
    all
}

fn measure_row(
    case: &Case,
    mode: Mode,
    peers: &mut Peers,
    effort: MeasurementBudget,
) -> Result<Row, Failure> {
    let warm = case.family != Family::Rk4;
    let single = 0..case.single;
    let mut timers = vec![
        Timer::new(case, 1e-8, Start::Zero, mode, single.clone())?,
        Timer::new(case, 0.0, Start::Zero, mode, single)?,
        Timer::new(case, 1e-8, Start::Zero, mode, 0..case.inputs.len())?.keeping_results(),
    ];
    if warm {
        timers.push(Timer::new(case, 1e-8, Start::Warm, mode, 0..2)?);
    }
    let mut batch = BatchTimer::new(case, mode)?;
    let mut asked = ask_all_peers(case, mode, peers);
    for _ in 0..ROUNDS {
        asked.iter_mut().try_for_each(|timer| timer.round(effort))?;
        timers.iter_mut().try_for_each(|timer| timer.round(effort))?;
        batch.iter_mut().try_for_each(|timer| timer.round(effort))?;
    }
    let measured: Vec<_> = timers.into_iter().map(Timer::finish).collect();
    let mut theirs = [None::<Measured>; 3];
    for (column, measured) in asked.into_iter().map(PeerTimer::finish) {
        let faster = theirs[column].is_none_or(|other| measured.time.median < other.time.median);
        if faster {
            theirs[column] = Some(measured);
        }
    }
    Ok(Row {
        case: case.name.clone(),
        nx: case.nx,
        mode,
        reference: match &case.reference {
            Some((source, values)) if !values.part_of_mode(mode).is_empty() => source,
            _ => "none",
        },
        cold: measured[0],
        rounding: measured[1],
        batch_of_forty: measured[2],
        batch: batch.map(BatchTimer::finish),
        warm: measured.get(3).copied(),
        casadi: theirs[0],
        acados: [theirs[1], theirs[2]].map(|measured| measured.map(AcadosTime::Measured)),
    })
}

/// Measurements that are compared are taken in turn, this often: what else the machine does comes
/// and goes in seconds.
const ROUNDS: usize = 5;

/// The median round, the least, and the greatest.
fn from_rounds(rounds: &[Summary]) -> Summary {
    let all = Summary::from_samples(rounds.iter().map(|r| r.median).collect());
    let (least, greatest) =
        rounds.iter().fold((f64::INFINITY, 0.0f64), |(a, b), r| (a.min(r.median), b.max(r.median)));
    Summary { q1: least, q3: greatest, samples: rounds.iter().map(|r| r.samples).sum(), ..all }
}

/// Passes over some inputs of a case: the time of one call, and the error at the first of them.
pub struct Timer {
    calls: Box<dyn IntegratorCalls>,
    mode: Mode,
    inputs: Range<usize>,
    /// Whether the results of all inputs are kept, as a batch keeps them.
    keeps_results: bool,
    error: Option<f64>,
    rounds: Vec<Summary>,
}

impl Timer {
    pub fn new(
        case: &Case,
        tolerance: f64,
        start: Start,
        mode: Mode,
        inputs: Range<usize>,
    ) -> Result<Self, Failure> {
        let mut calls = open_calls(case, options(case, tolerance, start))?;
        let values = calls.results_of(mode, 0).map_err(|e| format!("{}: {e}", case.name))?;
        let error = case.reference.as_ref().and_then(|(_, reference)| values.relative_error(reference, mode));
        Ok(Self { calls, mode, inputs, keeps_results: false, error, rounds: Vec::new() })
    }

    /// With all inputs, whose results are kept.
    fn keeping_results(self) -> Self {
        Self { keeps_results: true, ..self }
    }

    pub fn round(&mut self, effort: MeasurementBudget) -> Result<(), Failure> {
        let budget = effort.budget() / ROUNDS as u32;
        let Self { calls, mode, inputs, keeps_results: keeps, .. } = &mut *self;
        let time = if *keeps {
            measure(budget, || calls.call_all(*mode))
        } else {
            measure(budget, || inputs.clone().try_for_each(|k| calls.call_input(*mode, k)))
        };
        let time = time.map_err(|e| e.to_string())?;
        self.rounds.push(time.divided(self.inputs.len() as f64));
        Ok(())
    }

    pub fn finish(self) -> Measured {
        let statistics = self.calls.statistics();
        Measured {
            time: from_rounds(&self.rounds),
            error: self.error,
            iterations: statistics.iterations,
            dense: statistics.dense,
        }
    }
}

/// Passes over all inputs of a case side by side.
struct BatchTimer {
    calls: Box<dyn BatchCalls>,
    mode: Mode,
    count: usize,
    error: Option<f64>,
    rounds: Vec<Summary>,
}

impl BatchTimer {
    fn new(case: &Case, mode: Mode) -> Result<Option<Self>, Failure> {
        let Some(mut calls) = open_batch(case, options(case, 1e-8, Start::Zero))? else { return Ok(None) };
        let values = calls.values(mode).map_err(|e| format!("{}, batch: {e}", case.name))?;
        let error = case.reference.as_ref().and_then(|(_, reference)| values.relative_error(reference, mode));
        Ok(Some(Self { calls, mode, count: case.inputs.len(), error, rounds: Vec::new() }))
    }

    fn round(&mut self, effort: MeasurementBudget) -> Result<(), Failure> {
        let time = measure(effort.budget() / ROUNDS as u32, || self.calls.call(self.mode));
        self.rounds.push(time.map_err(|e| e.to_string())?.divided(self.count as f64));
        Ok(())
    }

    fn finish(self) -> Measured {
        Measured { time: from_rounds(&self.rounds), error: self.error, ..Default::default() }
    }
}

/// All in turn.
pub fn run_in_turn(mut timers: Vec<Timer>, effort: MeasurementBudget) -> Result<Vec<Measured>, Failure> {
    for _ in 0..ROUNDS {
        timers.iter_mut().try_for_each(|timer| timer.round(effort))?;
    }
    Ok(timers.into_iter().map(Timer::finish).collect())
}

/// Carries acados' times over where they were not measured; see [`ReferenceTimes`].
pub fn carry_over(rows: &mut [Row], anchors: &ReferenceTimes) {
    let general = anchors.median_machine_ratio(rows);
    let scales: Vec<_> =
        rows.iter().map(|row| anchors.machine_ratio(rows, &row.case).map(|s| s.min(general))).collect();
    for (row, scale) in rows.iter_mut().zip(scales) {
        let scale = scale.unwrap_or(general);
        for (theirs, key) in row.acados.iter_mut().zip(["irk", "gnsf"]) {
            let carried = || anchors.seconds(&row.case, key, row.mode).map(|t| t * scale);
            *theirs = theirs.or_else(|| carried().filter(|t| t.is_finite()).map(AcadosTime::CarriedOver));
        }
    }
}
