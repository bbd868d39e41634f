//! The solvers of diffsol on the initial value problems, for `examples/work_precision`.
//!
//! Reads one JSON object a line from standard input and answers each with one on standard output:
//!
//! ```text
//! {"problem": "hires", "x0": [..], "p": [..], "t": 321.8, "atol": 1e-3, "tolerances": [..], "derivatives": false, "seconds": 0.02}
//! {"runs": [{"solver": "diffsol, BDF", "tolerance": 1e-4, "y": [..], "derivatives": [..], "time": 2e-4, "steps": 80} | {.., "error": ".."}]}
//! ```
//!
//! Equations are those of the models, derivatives their directional derivatives by dual numbers:
//! what diffsol asks for. `atol` is relative to the tolerance. Times are the least CPU seconds of a
//! call that makes a solver and integrates.

use casados::GraphDae;
use casados::Shape;
use cpu_time::ThreadTime;
use diffsol::{MatrixCommon, NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};
use models::chemistry::{AkzoNobel, E5Conserved, Hires, Oregonator, Robertson};
use models::circuits::{RingModulator, TransistorCapacitors};
use models::mechanics::{Pleiades, Squeezer};
use models::oscillators::VanDerPol;
use num_dual::Dual64;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::io::{BufRead, Write};
use std::time::Instant;

#[path = "../../../examples/models/ivp/mod.rs"]
mod models;

type Matrix = NalgebraMat<f64>;
type Linear = NalgebraLU<f64>;
type Numbers = <Matrix as MatrixCommon>::V;

/// A run that takes longer is given up, and tighter tolerances are not tried.
const PATIENCE: f64 = 3.0;

/// What is asked.
struct Request {
    x0: Vec<f64>,
    p: Vec<f64>,
    t: f64,
    atol: f64,
    tolerances: Vec<f64>,
    derivatives: bool,
    seconds: f64,
}

impl Request {
    fn read(value: &Value) -> Option<Self> {
        let list =
            |key: &str| -> Option<Vec<f64>> { value[key].as_array()?.iter().map(Value::as_f64).collect() };
        Some(Self {
            x0: list("x0")?,
            p: list("p")?,
            t: value["t"].as_f64()?,
            atol: value["atol"].as_f64()?,
            tolerances: list("tolerances")?,
            derivatives: value["derivatives"].as_bool()?,
            seconds: value["seconds"].as_f64()?,
        })
    }
}

/// A model by its residual, in real and in dual numbers: diffsol is compiled once for all of them.
#[derive(Clone, Copy)]
struct Model {
    nx: usize,
    nz: usize,
    residual: fn(&[f64], &mut [f64]),
    dual: fn(&[Dual64], &mut [Dual64]),
}

impl Model {
    fn by_name<M: GraphDae>() -> Self {
        let (residual, dual) = (M::residual_of::<f64>, M::residual_of::<Dual64>);
        Self { nx: M::Shape::NX, nz: M::Shape::NZ, residual, dual }
    }
}

/// A call: values at the end, their derivatives by `(x₀, p)` row by row, steps.
type Call = Result<(Vec<f64>, Vec<f64>, usize), String>;

fn run_tolerances(model: Model, request: &Request) -> Vec<Value> {
    let mut runs = Vec::new();
    for name in ["BDF", "ESDIRK34", "TR-BDF2"] {
        for &tolerance in &request.tolerances {
            let begin = Instant::now();
            let mut least = f64::INFINITY;
            let mut timed = |call: &dyn Fn() -> Call| {
                let result = call()?;
                let begin = Instant::now();
                for count in 0.. {
                    if count >= 2 && begin.elapsed().as_secs_f64() > request.seconds {
                        break;
                    }
                    let start = ThreadTime::now();
                    call()?;
                    least = least.min(start.elapsed().as_secs_f64());
                }
                Ok(result)
            };
            let result = if request.derivatives {
                forward(model, request, name, tolerance, &mut timed)
            } else {
                simulate(model, request, name, tolerance, &mut timed)
            };
            let solver = format!("diffsol, {name}");
            runs.push(match result {
                Ok((y, derivatives, steps)) => json!({
                    "solver": solver, "tolerance": tolerance, "y": y, "derivatives": derivatives, "steps": steps, "time": least
                }),
                Err(error) => json!({ "solver": solver, "tolerance": tolerance, "error": error }),
            });
            if begin.elapsed().as_secs_f64() > PATIENCE {
                break;
            }
        }
    }
    runs
}

/// The variables of the model, `ẋ = 0` in front, then the states, parameters and time, and its
/// residual: memory of a call.
#[derive(Clone)]
struct Buffers<T> {
    v: Vec<T>,
    f: Vec<T>,
}

impl<T> Default for Buffers<T> {
    fn default() -> Self {
        Self { v: Vec::new(), f: Vec::new() }
    }
}

impl<T: Copy + From<f64>> Buffers<T> {
    fn residual(
        &mut self,
        nx: usize,
        y: impl ExactSizeIterator<Item = T>,
        p: impl Iterator<Item = T>,
        t: f64,
        residual: fn(&[T], &mut [T]),
    ) -> &[T] {
        self.f.resize(y.len(), T::from(0.0));
        self.v.clear();
        self.v.resize(nx, T::from(0.0));
        self.v.extend(y);
        self.v.extend(p);
        self.v.push(T::from(t));
        residual(&self.v, &mut self.f);
        &self.f
    }
}

/// `f(ẋ, y, p, t) = C ẋ − r(y, p, t)` as `C ẋ = r`; where `C` is one number in each row and column
/// it is divided by.
#[derive(Clone)]
struct Equations {
    model: Model,
    /// The row that determines each derivative, and its factor.
    explicit: Option<Vec<(usize, f64)>>,
    /// Rows of `C`.
    c: Vec<Vec<f64>>,
    real: RefCell<Buffers<f64>>,
    dual: RefCell<Buffers<Dual64>>,
}

impl Equations {
    fn new(model: Model, y: &[f64], p: &[f64]) -> Self {
        let (nx, n) = (model.nx, y.len());
        let mut c = vec![vec![0.0; nx]; n];
        for column in 0..nx {
            let mut v = vec![Dual64::from(0.0); nx];
            v[column] = Dual64::new(0.0, 1.0);
            v.extend(y.iter().chain(p).chain(&[0.0]).map(|value| Dual64::from(*value)));
            let mut f = vec![Dual64::from(0.0); n];
            (model.dual)(&v, &mut f);
            for (row, f) in c.iter_mut().zip(f) {
                row[column] = f.eps;
            }
        }
        let single = |column: usize| {
            let mut rows = (0..n).filter(|row| c[*row][column] != 0.0);
            let row = rows.next().filter(|_| rows.next().is_none())?;
            (c[row].iter().filter(|c| **c != 0.0).count() == 1).then_some((row, c[row][column]))
        };
        let explicit = if n == nx { (0..nx).map(single).collect() } else { None };
        Self { model, explicit, c, real: RefCell::default(), dual: RefCell::default() }
    }

    fn right_hand_side(&self, y: &[f64], p: &[f64], t: f64, to: &mut [f64]) {
        let mut buffers = self.real.borrow_mut();
        let f = buffers.residual(self.model.nx, y.iter().copied(), p.iter().copied(), t, self.model.residual);
        match &self.explicit {
            Some(rows) => to.iter_mut().zip(rows).for_each(|(to, (row, c))| *to = -f[*row] / c),
            None => to.iter_mut().zip(f).for_each(|(to, f)| *to = -f),
        }
    }

    /// In a direction of the states, or of the parameters.
    fn derivative(&self, (y, dy): (&[f64], &[f64]), (p, dp): (&[f64], &[f64]), t: f64, to: &mut [f64]) {
        let mut buffers = self.dual.borrow_mut();
        let y = y.iter().enumerate().map(|(i, y)| Dual64::new(*y, dy.get(i).copied().unwrap_or(0.0)));
        let p = p.iter().enumerate().map(|(i, p)| Dual64::new(*p, dp.get(i).copied().unwrap_or(0.0)));
        let f = buffers.residual(self.model.nx, y, p, t, self.model.dual);
        match &self.explicit {
            Some(rows) => to.iter_mut().zip(rows).for_each(|(to, (row, c))| *to = -f[*row].eps / c),
            None => to.iter_mut().zip(f).for_each(|(to, f)| *to = -f.eps),
        }
    }

    fn mass(&self, v: &[f64], beta: f64, to: &mut [f64]) {
        for (row, (to, c)) in to.iter_mut().zip(&self.c).enumerate() {
            let product: f64 = match &self.explicit {
                Some(_) => v[row],
                None => c.iter().zip(v).map(|(c, v)| c * v).sum(),
            };
            *to = product + beta * *to;
        }
    }
}

type Timed<'a> = &'a mut dyn FnMut(&dyn Fn() -> Call) -> Call;

macro_rules! run {
    ($problem:ident, $solver:ident, $t:expr, $timed:ident, $read:expr) => {
        $timed(&|| {
            let mut solver = $problem.$solver::<Linear>().map_err(|e| e.to_string())?;
            let (begin, mut steps) = (Instant::now(), 0);
            solver.set_stop_time($t).map_err(|e| e.to_string())?;
            loop {
                steps += 1;
                match solver.step().map_err(|e| e.to_string())? {
                    OdeSolverStopReason::TstopReached => break,
                    _ if steps % 1024 == 0 && begin.elapsed().as_secs_f64() > PATIENCE => {
                        return Err(format!("not there after {steps} steps"));
                    }
                    _ => {}
                }
            }
            let state = solver.state();
            let (y, derivatives): (Vec<f64>, Vec<f64>) = $read(state.y, state.s);
            Ok((y, derivatives, steps))
        })
    };
}

/// The algebraic states at the start are left to diffsol, which makes them consistent.
fn start(model: Model, x0: &[f64]) -> Vec<f64> {
    let mut y = x0.to_vec();
    y.resize(model.nx + model.nz, 0.0);
    y
}

fn simulate(model: Model, request: &Request, name: &str, tolerance: f64, timed: Timed) -> Call {
    let y0 = start(model, &request.x0);
    let equations = Equations::new(model, &y0, &request.p);
    let n = y0.len();
    let (a, b, c) = (equations.clone(), equations.clone(), equations.clone());
    let read = |y: &Numbers, _: &Numbers| (y.batch_as_slice(0).to_vec(), Vec::new());
    macro_rules! build {
        ($builder:expr) => {
            $builder.build().map_err(|e| e.to_string())?
        };
    }
    let builder = OdeBuilder::<Matrix>::new()
        .rtol(tolerance)
        .atol([request.atol * tolerance])
        .p(request.p.clone())
        .rhs_implicit(
            move |y, p, t, to| a.right_hand_side(y, p, t, to),
            move |y, p, t, v, to| b.derivative((y, v), (p, &[]), t, to),
        )
        .init(move |_, _, y| y.copy_from_slice(&y0), n);
    let t = request.t;
    if equations.explicit.is_some() {
        let problem = build!(builder);
        match name {
            "BDF" => run!(problem, bdf, t, timed, read),
            "ESDIRK34" => run!(problem, esdirk34, t, timed, read),
            _ => run!(problem, tr_bdf2, t, timed, read),
        }
    } else {
        let problem = build!(builder.mass(move |v, _, _, beta, to| c.mass(v, beta, to)));
        match name {
            "BDF" => run!(problem, bdf, t, timed, read),
            "ESDIRK34" => run!(problem, esdirk34, t, timed, read),
            _ => run!(problem, tr_bdf2, t, timed, read),
        }
    }
}

/// With derivatives by `(x₀, p)`, which are parameters here.
fn forward(model: Model, request: &Request, name: &str, tolerance: f64, timed: Timed) -> Call {
    let equations = Equations::new(model, &start(model, &request.x0), &request.p);
    if equations.explicit.is_none() {
        return Err("an equation with a mass matrix".into());
    }
    let nx = equations.model.nx;
    let (a, b, c) = (equations.clone(), equations.clone(), equations);
    let problem = OdeBuilder::<Matrix>::new()
        .rtol(tolerance)
        .atol([request.atol * tolerance])
        .sens_rtol(tolerance)
        .sens_atol([request.atol * tolerance])
        .p([&request.x0[..], &request.p[..]].concat())
        .rhs_sens_implicit(
            move |y, p, t, to| a.right_hand_side(y, &p[nx..], t, to),
            move |y, p, t, v, to| b.derivative((y, v), (&p[nx..], &[]), t, to),
            move |y, p, t, v, to| c.derivative((y, &[]), (&p[nx..], &v[nx..]), t, to),
        )
        .init_sens(
            move |p, _, y| y.copy_from_slice(&p[..nx]),
            move |_, _, v, y| y.copy_from_slice(&v[..nx]),
            nx,
        )
        .build()
        .map_err(|e| e.to_string())?;
    let t = request.t;
    let columns = nx + request.p.len();
    let read = |y: &Numbers, s: &Numbers| {
        let columns: Vec<_> = (0..columns).map(|column| s.batch_as_slice(column)).collect();
        let rows = (0..nx).flat_map(|i| columns.iter().map(move |column| column[i]));
        (y.batch_as_slice(0).to_vec(), rows.collect())
    };
    match name {
        "BDF" => run!(problem, bdf_sens, t, timed, read),
        "ESDIRK34" => run!(problem, esdirk34_sens, t, timed, read),
        _ => run!(problem, tr_bdf2_sens, t, timed, read),
    }
}

fn answer_request(line: &str) -> Option<Vec<Value>> {
    let value: Value = serde_json::from_str(line).ok()?;
    let request = Request::read(&value)?;
    let model = match value["problem"].as_str()? {
        "robertson" => Model::by_name::<Robertson>(),
        "hires" => Model::by_name::<Hires>(),
        "van_der_pol_1e3" | "van_der_pol_1e6" => Model::by_name::<VanDerPol>(),
        "oregonator" => Model::by_name::<Oregonator>(),
        "e5" => Model::by_name::<E5Conserved>(),
        "akzo_nobel" => Model::by_name::<AkzoNobel>(),
        "transistor_amplifier" => Model::by_name::<TransistorCapacitors>(),
        "ring_modulator" => Model::by_name::<RingModulator>(),
        "pleiades" => Model::by_name::<Pleiades>(),
        "squeezer" => Model::by_name::<Squeezer>(),
        _ => return None,
    };
    Some(run_tolerances(model, &request))
}

fn main() {
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let reply = match answer_request(&line) {
            Some(runs) => json!({ "runs": runs }),
            None => json!({ "error": "not a request" }),
        };
        println!("{reply}");
        if std::io::stdout().flush().is_err() {
            return;
        }
    }
}
