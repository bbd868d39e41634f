//! A whole problem of optimal control as the functions that `casadi.nlpsol` asks a library for.
//!
//! Jacobian and Hessian have dense blocks for each stage. IPOPT takes the upper triangle of that of
//! `γ = σ f + μᵀg`. Other solvers ask for other functions: they get those that CasADi makes of
//! `nlp` and its derivatives, which have the form of those of any external function.

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
/// `nlp_grad_f`, `nlp_jac_g`, `nlp_hess_l`, `nlp_grad`, `nlp_bounds`, `jac_nlp`, `adj1_nlp`,
/// `jac_adj1_nlp`.
pub struct Problems {
    make: Make,
    layout: Layout,
    signatures: Vec<Signature>,
    patterns: Patterns,
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

/// Where the matrices of a problem have entries.
struct Patterns {
    jacobian: Sparsity,
    hessian: Sparsity,
    /// Where the entries of the transposed Jacobian are among those of the Jacobian.
    transposed: Vec<usize>,
}

const NOT_MADE: &str = "the problem could not be made";

impl Problems {
    /// The functions of what `make` makes.
    #[must_use]
    pub fn new(make: Make) -> Self {
        let made = make().map_err(|error| error.to_string());
        let made = made.and_then(|mut program| {
            program.check()?;
            Ok(program)
        });
        let (dims, periodic, wrong) = match made {
            Ok(mut program) => (program.dims(), program.periodic(), None),
            Err(wrong) => (Vec::new(), Vec::new(), Some(wrong)),
        };
        let (layout, [jacobian, hessian]) = Layout::new(dims, periodic);
        let (transposed_pattern, transposed) = jacobian.transposed();
        let signatures = signatures(&layout, &jacobian, &hessian, transposed_pattern);
        let patterns = Patterns { jacobian, hessian, transposed };
        Self { make, layout, signatures, patterns, wrong, integrations: AtomicU64::new(0) }
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
        let seed = |port: &Port| [c"lam_f", c"adj_f"].contains(&port.name);
        if let Some(input) = signature.inputs.iter().position(seed) {
            if let Some((sigma, mu)) = worker.input_multipliers.split_first_mut() {
                call.read(input, core::slice::from_mut(sigma));
                call.read(input + 1, mu);
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
            b"grad_f_x" | b"jac_f_x" | b"jac_g_x" | b"grad_gamma_x" | b"adj_x" => self.first(worker),
            b"jac_adj_x_adj_f" | b"jac_adj_x_adj_g" => self.first(worker),
            b"triu_hess_gamma_x_x" | b"jac_adj_x_x" => self.second(worker),
            _ => Ok(()),
        }
    }

    /// An output; those of other names have no entries.
    fn write(&self, worker: &Worker, port: &Port, to: &mut [f64]) {
        match port.name.to_bytes() {
            b"f" => to.fill(worker.objective),
            b"g" => self.layout.constraints(&worker.x, &worker.ends, to),
            b"grad_f_x" | b"jac_f_x" | b"jac_adj_x_adj_f" => to.copy_from_slice(&worker.gradient),
            b"jac_g_x" => to.copy_from_slice(&worker.jacobian),
            b"jac_adj_x_adj_g" => {
                for (to, &entry) in to.iter_mut().zip(&self.patterns.transposed) {
                    *to = worker.jacobian[entry];
                }
            }
            b"jac_adj_x_x" => to.copy_from_slice(&worker.hessian),
            b"triu_hess_gamma_x_x" => {
                let entries = self.patterns.hessian.entries().iter().zip(&worker.hessian);
                let upper = entries.filter(|((row, column), _)| row <= column);
                for (to, (_, value)) in to.iter_mut().zip(upper) {
                    *to = *value;
                }
            }
            b"grad_gamma_x" | b"adj_x" => {
                let Some((sigma, mu)) = worker.multipliers.split_first() else { return };
                for (to, gradient) in to.iter_mut().zip(&worker.gradient) {
                    *to = sigma * gradient;
                }
                for (&(row, column), value) in self.patterns.jacobian.entries().iter().zip(&worker.jacobian) {
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
fn signatures(
    layout: &Layout,
    jacobian: &Sparsity,
    hessian: &Sparsity,
    transposed: Sparsity,
) -> Vec<Signature> {
    let (n, m) = (layout.variables, layout.constraints);
    let port = |name, rows| Port::new(name, Sparsity::vector(rows));
    let zero = |name, rows, columns| Port::new(name, Sparsity::zero(rows, columns));
    let point = vec![port(c"x", n), port(c"p", 0)];
    let lagrangian = [point.clone(), vec![port(c"lam_f", 1), port(c"lam_g", m)]].concat();
    let (f, g) = (port(c"f", 1), port(c"g", m));
    let jac_g = Port::new(c"jac_g_x", jacobian.clone());
    let nominal = [point.clone(), vec![zero(c"out_f", 1, 1), zero(c"out_g", m, 1)]].concat();
    let adjoint = [nominal.clone(), vec![port(c"adj_f", 1), port(c"adj_g", m)]].concat();
    let second = [adjoint.clone(), vec![zero(c"out_adj_x", n, 1), zero(c"out_adj_p", 0, 1)]].concat();
    let of_point = |outputs| Signature { inputs: point.clone(), outputs };
    let of_lagrangian = |outputs| Signature { inputs: lagrangian.clone(), outputs };
    vec![
        of_point(vec![f.clone(), g.clone()]),
        of_point(vec![f.clone()]),
        of_point(vec![g.clone()]),
        of_point(vec![f.clone(), port(c"grad_f_x", n)]),
        of_point(vec![g.clone(), jac_g.clone()]),
        of_lagrangian(vec![Port::new(c"triu_hess_gamma_x_x", hessian.upper())]),
        of_lagrangian(vec![f, g, port(c"grad_gamma_x", n), port(c"grad_gamma_p", 0)]),
        Signature {
            inputs: Vec::new(),
            outputs: vec![port(c"lbx", n), port(c"ubx", n), port(c"x0", n), port(c"lbg", m), port(c"ubg", m)],
        },
        Signature {
            inputs: nominal,
            outputs: vec![
                Port::new(c"jac_f_x", Sparsity::new(1, n, |_, _| true)),
                zero(c"jac_f_p", 1, 0),
                jac_g,
                zero(c"jac_g_p", m, 0),
            ],
        },
        Signature { inputs: adjoint, outputs: vec![port(c"adj_x", n), port(c"adj_p", 0)] },
        Signature {
            inputs: second,
            outputs: vec![
                Port::new(c"jac_adj_x_x", hessian.clone()),
                zero(c"jac_adj_x_p", n, 0),
                zero(c"jac_adj_x_out_f", n, 1),
                zero(c"jac_adj_x_out_g", n, m),
                port(c"jac_adj_x_adj_f", n),
                Port::new(c"jac_adj_x_adj_g", transposed),
                zero(c"jac_adj_p_x", 0, n),
                zero(c"jac_adj_p_p", 0, 0),
                zero(c"jac_adj_p_out_f", 0, 1),
                zero(c"jac_adj_p_out_g", 0, m),
                zero(c"jac_adj_p_adj_f", 0, 1),
                zero(c"jac_adj_p_adj_g", 0, m),
            ],
        },
    ]
}
