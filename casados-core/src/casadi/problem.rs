//! A whole problem of optimal control as the functions that `casadi.nlpsol` asks a library for.
//!
//! Jacobian and Hessian have dense blocks for each stage. CasADi's Hessian is the upper triangle of
//! that of `γ = σ f + μᵀg`.

use super::function::{Call, Port, Signature};
use super::layout::Layout;
use super::library::{Client, Failure};
use super::program::Program;
use super::sparsity::Sparsity;
use crate::ocp::OcpError;
use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

/// What makes a problem.
pub type Make = fn() -> Result<Box<dyn Program>, Box<dyn core::error::Error>>;

/// The functions of a problem, in the order of their numbers: `nlp`, `nlp_f`, `nlp_g`,
/// `nlp_grad_f`, `nlp_jac_g`, `nlp_hess_l`, `nlp_grad`, `nlp_bounds`.
pub struct Problems {
    make: Make,
    layout: Layout,
    signatures: Vec<Signature>,
    /// What was wrong with the problem when it was made first.
    wrong: Option<String>,
    integrations: AtomicU64,
}

/// A problem, and what is known at the last point.
pub struct Worker {
    program: Box<dyn Program>,
    x: Vec<f64>,
    input: Vec<f64>,
    /// `σ`, then `μ`.
    multipliers: Vec<f64>,
    input_multipliers: Vec<f64>,
    known: Known,
    objective: f64,
    ends: Vec<f64>,
    gradient: Vec<f64>,
    jacobian: Vec<f64>,
    hessian: Vec<f64>,
}

/// What is known at the last point.
#[derive(Clone, Copy, Default)]
struct Known {
    value: bool,
    first: bool,
    second: bool,
}

const NOT_MADE: &str = "the problem could not be made";

impl Problems {
    /// The functions of what `make` makes.
    #[must_use]
    pub fn new(make: Make) -> Self {
        let made = make().map_err(|error| error.to_string());
        let made = made.and_then(|mut program| {
            program.check().map_err(|error| error.to_string())?;
            Ok(program)
        });
        let integrations = AtomicU64::new(0);
        match made {
            Ok(mut program) => {
                let (layout, patterns) = Layout::new(program.dims(), program.periodic());
                let signatures = signatures(&layout, patterns);
                Self { make, layout, signatures, wrong: None, integrations }
            }
            Err(wrong) => {
                let (layout, patterns) = Layout::new(Vec::new(), Vec::new());
                let signatures = signatures(&layout, patterns);
                Self { make, layout, signatures, wrong: Some(wrong), integrations }
            }
        }
    }

    fn count(&self) {
        let intervals = self.layout.dims.len().saturating_sub(1) as u64;
        self.integrations.fetch_add(intervals, Ordering::Relaxed);
    }

    fn value(&self, worker: &mut Worker) -> Result<(), OcpError> {
        if !worker.known.value {
            self.count();
            worker.objective = worker.program.value(&worker.x, &mut worker.ends)?;
            worker.known.value = true;
        }
        Ok(())
    }

    fn first(&self, worker: &mut Worker) -> Result<(), OcpError> {
        if !worker.known.first {
            self.count();
            let Worker { program, x, gradient, jacobian, .. } = worker;
            let qp = program.first(x)?;
            self.layout.gradient(&qp, x, gradient);
            self.layout.write(&qp, &self.layout.jacobian, |stage| stage.0, jacobian);
            worker.known.first = true;
        }
        Ok(())
    }

    /// `σ H(μ/σ)`, and where `σ` is zero what is linear in `μ`: `H(μ) − H(0)`, both with `σ = 1`.
    fn second(&self, worker: &mut Worker) -> Result<(), OcpError> {
        if worker.known.second {
            return Ok(());
        }
        let Worker { program, x, multipliers, gradient, jacobian, hessian, .. } = worker;
        let Some((&sigma, mu)) = multipliers.split_first() else { return Ok(()) };
        let factor = if sigma == 0.0 { 1.0 } else { sigma };
        let scaled: Vec<f64> = mu.iter().map(|mu| mu / factor).collect();
        self.count();
        let qp = program.second(x, &scaled)?;
        self.layout.gradient(&qp, x, gradient);
        self.layout.write(&qp, &self.layout.jacobian, |stage| stage.0, jacobian);
        self.layout.write(&qp, &self.layout.hessian, |stage| stage.1, hessian);
        for value in hessian.iter_mut() {
            *value *= factor;
        }
        if sigma == 0.0 {
            self.count();
            let qp = program.second(x, &vec![0.0; mu.len()])?;
            let mut objective = Vec::new();
            self.layout.write(&qp, &self.layout.hessian, |stage| stage.1, &mut objective);
            for (value, objective) in hessian.iter_mut().zip(&objective) {
                *value -= objective;
            }
        }
        worker.known.first = true;
        worker.known.second = true;
        Ok(())
    }
}

impl Client for Problems {
    type Worker = Worker;

    fn signatures(&self) -> &[Signature] {
        &self.signatures
    }

    fn worker(&self) -> Result<Worker, Failure> {
        if let Some(wrong) = &self.wrong {
            return Err(Failure(wrong.clone()));
        }
        let program = (self.make)().map_err(|error| Failure(error.to_string()))?;
        if program.dims() != self.layout.dims {
            return Err(Failure(NOT_MADE.into()));
        }
        let (n, m) = (self.layout.variables, self.layout.constraints);
        Ok(Worker {
            program,
            x: vec![f64::NAN; n],
            input: vec![0.0; n],
            multipliers: vec![f64::NAN; m + 1],
            input_multipliers: vec![0.0; m + 1],
            known: Known::default(),
            objective: 0.0,
            ends: Vec::new(),
            gradient: Vec::new(),
            jacobian: Vec::new(),
            hessian: Vec::new(),
        })
    }

    fn evaluate(&self, worker: &mut Worker, function: usize, call: &mut dyn Call) -> Result<(), Failure> {
        let signature = self.signatures.get(function).ok_or_else(|| Failure(NOT_MADE.into()))?;
        if signature.inputs.is_empty() {
            self.bounds(worker, call);
            return Ok(());
        }
        call.read(0, &mut worker.input);
        if !super::cache::equal(&worker.x, &worker.input) {
            worker.known = Known::default();
            worker.x.copy_from_slice(&worker.input);
        }
        if signature.inputs.len() > 2 {
            if let Some((sigma, mu)) = worker.input_multipliers.split_first_mut() {
                call.read(2, core::slice::from_mut(sigma));
                call.read(3, mu);
            }
            if !super::cache::equal(&worker.multipliers, &worker.input_multipliers) {
                worker.known.second = false;
                worker.multipliers.copy_from_slice(&worker.input_multipliers);
            }
        }
        for (output, port) in signature.outputs.iter().enumerate() {
            if call.wants(output) {
                self.compute(worker, port).map_err(|error| Failure(error.to_string()))?;
            }
        }
        for (output, port) in signature.outputs.iter().enumerate() {
            if let Some(to) = call.output(output) {
                self.write(worker, port, to);
            }
        }
        Ok(())
    }

    fn integrations(&self) -> u64 {
        self.integrations.load(Ordering::Relaxed)
    }
}

impl Problems {
    fn compute(&self, worker: &mut Worker, port: &Port) -> Result<(), OcpError> {
        match port.name.to_bytes() {
            b"f" | b"g" => self.value(worker),
            b"grad_f_x" | b"jac_g_x" | b"grad_gamma_x" => self.first(worker),
            b"triu_hess_gamma_x_x" => self.second(worker),
            _ => Ok(()),
        }
    }

    fn write(&self, worker: &Worker, port: &Port, to: &mut [f64]) {
        let layout = &self.layout;
        match port.name.to_bytes() {
            b"f" => to.fill(worker.objective),
            b"g" => layout.constraints(&worker.x, &worker.ends, to),
            b"grad_f_x" => to.copy_from_slice(&worker.gradient),
            b"jac_g_x" => to.copy_from_slice(&worker.jacobian),
            b"triu_hess_gamma_x_x" => to.copy_from_slice(&worker.hessian),
            b"grad_gamma_x" => {
                let Some((sigma, mu)) = worker.multipliers.split_first() else { return };
                for (to, gradient) in to.iter_mut().zip(&worker.gradient) {
                    *to = sigma * gradient;
                }
                let pattern = self.signatures.get(4).and_then(|signature| signature.outputs.get(1));
                let entries = pattern.map_or(&[][..], |port| port.sparsity.entries());
                for (&(row, column), value) in entries.iter().zip(&worker.jacobian) {
                    to[column] += mu[row] * value;
                }
            }
            _ => {}
        }
    }

    /// Bounds, the iterate as a start, and bounds of the constraints.
    fn bounds(&self, worker: &Worker, call: &mut dyn Call) {
        let (n, m) = (self.layout.variables, self.layout.constraints);
        let (lower, upper): (Vec<_>, Vec<_>) = worker.program.bounds().into_iter().unzip();
        let mut start = vec![0.0; n];
        worker.program.point(&mut start);
        // What is to be zero is, but for general constraints.
        let [mut g_lower, mut g_upper] = [vec![0.0; m], vec![0.0; m]];
        let mut begin = 0;
        for (stage, dims) in self.layout.dims.iter().enumerate() {
            begin += self.layout.dims.get(stage + 1).map_or(0, |next| next.nx);
            for row in 0..dims.ng {
                [g_lower[begin], g_upper[begin]] = worker.program.limits(stage, row);
                begin += 1;
            }
        }
        for (output, from) in [lower, upper, start, g_lower, g_upper].iter().enumerate() {
            if let Some(to) = call.output(output) {
                to.copy_from_slice(from);
            }
        }
    }
}

/// Inputs and outputs of all functions.
fn signatures(layout: &Layout, [jacobian, hessian]: [Sparsity; 2]) -> Vec<Signature> {
    let (n, m) = (layout.variables, layout.constraints);
    let port = |name, rows| Port::new(name, Sparsity::vector(rows));
    let point = vec![port(c"x", n), port(c"p", 0)];
    let lagrangian = [point.clone(), vec![port(c"lam_f", 1), port(c"lam_g", m)]].concat();
    let (f, g) = (port(c"f", 1), port(c"g", m));
    let of_point = |outputs| Signature { inputs: point.clone(), outputs };
    let of_lagrangian = |outputs| Signature { inputs: lagrangian.clone(), outputs };
    vec![
        of_point(vec![f.clone(), g.clone()]),
        of_point(vec![f.clone()]),
        of_point(vec![g.clone()]),
        of_point(vec![f.clone(), port(c"grad_f_x", n)]),
        of_point(vec![g.clone(), Port::new(c"jac_g_x", jacobian)]),
        of_lagrangian(vec![Port::new(c"triu_hess_gamma_x_x", hessian)]),
        of_lagrangian(vec![f, g, port(c"grad_gamma_x", n), port(c"grad_gamma_p", 0)]),
        Signature {
            inputs: Vec::new(),
            outputs: vec![port(c"lbx", n), port(c"ubx", n), port(c"x0", n), port(c"lbg", m), port(c"ubg", m)],
        },
    ]
}
