//! An optimal control problem as the functions of a library for `casadi.nlpsol`.
//!
//! IPOPT uses the upper triangle of the Hessian of `γ = σ f + μᵀg`. Other solvers use other
//! functions, which CasADi derives from `nlp` and its derivatives, as for any external function.

use super::function::{Call, Port, Signature};
use super::groups::{Group, groups};
use super::layout::Layout;
use super::library::{CallFailure, FunctionLibrary};
use super::nlp::signatures;
use super::program::{Derivatives, Program, Trial};
use crate::ocp::OcpError;
use crate::qp::{Solution, StageDims};
use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::{AtomicU64, Ordering};

/// Creates a problem.
pub type ProgramConstructor = fn() -> Result<Box<dyn Program>, Box<dyn core::error::Error>>;

/// The functions of a problem, in the order of their indices: `nlp`, `nlp_f`, `nlp_g`,
/// `nlp_grad_f`, `nlp_jac_g`, `nlp_hess_l`, `nlp_grad`, `nlp_bounds`, `jac_nlp`, `adj1_nlp`,
/// `jac_adj1_nlp`, `nlp_trajectory`.
#[doc(hidden)]
pub struct Problems {
    make: ProgramConstructor,
    layout: Layout,
    signatures: Vec<Signature>,
    /// The groups of states and controls.
    groups: Vec<Group>,
    /// The indices of the entries of the transposed Jacobian in the Jacobian.
    transposed: Vec<usize>,
    /// The error of the first construction of the problem, if any.
    wrong: Option<String>,
    integrations: AtomicU64,
}

/// A problem, with the results at the last point.
pub struct Worker {
    program: Box<dyn Program>,
    x: Vec<f64>,
    /// The states and controls of all stages at the last point.
    v: Vec<f64>,
    input: Vec<f64>,
    /// `σ`, followed by `μ`.
    multipliers: Vec<f64>,
    input_multipliers: Vec<f64>,
    known: PointCache,
    /// Whether derivatives were requested at the last point with requested values.
    derivatives_requested: bool,
    objective: f64,
    ends: Vec<f64>,
    gradient: Vec<f64>,
    jacobian: Vec<f64>,
    /// The upper triangle of the Hessian.
    hessian: Vec<f64>,
    /// Memory for a point, and for multipliers divided by `σ`.
    trial_point: Trial,
    scaled: Vec<f64>,
}

/// The results that are valid at the last point.
#[derive(Clone, Copy, Default)]
struct PointCache {
    value: bool,
    /// Whether gradient and Jacobian are valid.
    first: bool,
    /// Whether the Hessian is valid, for the last multipliers.
    second: bool,
}

const CONSTRUCTION_FAILED: &str = "the problem could not be made";

impl Problems {
    /// The functions of the problem that `make` creates.
    #[must_use]
    pub fn new(make: ProgramConstructor) -> Self {
        let made = make().map_err(|error| error.to_string());
        let made = made.and_then(|mut program| {
            program.check()?;
            Ok((Layout::new(program.as_mut()), groups(program.names())))
        });
        let ((layout, groups), wrong) = match made {
            Ok(made) => (made, None),
            Err(wrong) => (Default::default(), Some(wrong)),
        };
        let (transposed_pattern, transposed) = layout.jacobian.sparsity.transposed();
        let signatures = signatures(&layout, &groups, transposed_pattern);
        Self { make, layout, signatures, groups, transposed, wrong, integrations: AtomicU64::new(0) }
    }

    /// Prepares the integration of intervals, or the differentiation of known stages.
    fn prepare_intervals(&self, program: &mut dyn Program, known: bool) {
        let known = program.keep_stages(known);
        let intervals = if known { 0 } else { self.layout.dims.len().saturating_sub(1) as u64 };
        self.integrations.fetch_add(intervals, Ordering::Relaxed);
    }

    /// Evaluates the problem at a point: values, with derivatives if these were requested after the
    /// last values.
    fn value(&self, worker: &mut Worker) -> Result<(), OcpError> {
        if worker.known.value {
            return Ok(());
        }
        if worker.derivatives_requested {
            self.first(worker)?;
            // Reset until derivatives are requested.
            worker.derivatives_requested = false;
            return Ok(());
        }
        self.prepare_intervals(worker.program.as_mut(), false);
        worker.objective = worker.program.value(&worker.v, &mut worker.trial_point, &mut worker.ends)?;
        worker.known.value = true;
        Ok(())
    }

    fn first(&self, worker: &mut Worker) -> Result<(), OcpError> {
        worker.derivatives_requested = true;
        if worker.known.first {
            return Ok(());
        }
        // After an error no results are valid.
        let known = core::mem::take(&mut worker.known);
        self.prepare_intervals(worker.program.as_mut(), known.value);
        let Layout { jacobian: slopes, upper, .. } = &self.layout;
        let Worker { program, x, v, ends, jacobian, gradient, .. } = worker;
        let apart = Derivatives {
            clear: &|stage, matrix| upper.zero_node_terms(stage, matrix),
            interval: &mut |stage, blocks| slopes.write_interval(stage, blocks, 1.0, jacobian),
        };
        worker.objective = program.first(v, ends, apart)?;
        let qp = program.qp();
        slopes.write_nodes(qp.stages().map(|stage| stage.arrays().matrix), 1.0, jacobian);
        self.layout.gradient(&qp, x, gradient);
        worker.known = PointCache { value: true, first: true, ..known };
        Ok(())
    }

    /// The Hessian `σ H(μ/σ)`; for `σ = 0` the part linear in `μ`: `H(μ) − H(0)`, both with
    /// `σ = 1`. It is stored unless written to `to`.
    fn evaluate_hessian(&self, worker: &mut Worker, to: Option<&mut [f64]>) -> Result<(), OcpError> {
        if worker.known.second && to.is_none() {
            return Ok(());
        }
        let known = core::mem::take(&mut worker.known);
        let Some((&sigma, mu)) = worker.multipliers.split_first() else { return Ok(()) };
        let factor = if sigma == 0.0 { 1.0 } else { sigma };
        worker.scaled.clear();
        worker.scaled.extend(mu.iter().take(self.layout.functions).map(|mu| mu / factor));
        let mut own = core::mem::take(&mut worker.hessian);
        let (is_kept, to) = (to.is_none(), to.unwrap_or(&mut own));
        let mut outcome = self.assemble_hessian(worker, known, factor, to);
        if sigma == 0.0 && outcome.is_ok() {
            let mut objective = vec![0.0; to.len()];
            worker.scaled.fill(0.0);
            let known = PointCache { value: true, first: true, second: false };
            outcome = self.assemble_hessian(worker, known, 1.0, &mut objective);
            to.iter_mut().zip(&objective).for_each(|(to, objective)| *to -= objective);
        }
        worker.hessian = own;
        outcome?;
        worker.known = PointCache { value: true, first: true, second: is_kept };
        Ok(())
    }

    /// Assembles the Hessian times `factor`; also gradient and Jacobian, unless they are `known`.
    fn assemble_hessian(
        &self,
        worker: &mut Worker,
        known: PointCache,
        factor: f64,
        to: &mut [f64],
    ) -> Result<(), OcpError> {
        let Layout { jacobian: slopes, upper, .. } = &self.layout;
        let Worker { program, x, v, scaled, ends, gradient, jacobian, .. } = worker;
        self.prepare_intervals(program.as_mut(), known.value);
        let apart = Derivatives {
            clear: &|stage, matrix| upper.zero_node_terms(stage, matrix),
            interval: &mut |stage, blocks| {
                if !known.first {
                    slopes.write_interval(stage, blocks, 1.0, jacobian);
                }
                upper.write_interval(stage, blocks, factor, to);
            },
        };
        worker.objective = program.second(v, scaled, ends, apart)?;
        let qp = program.qp();
        upper.write_nodes(qp.stages().map(|stage| stage.arrays().hessian), factor, to);
        if !known.first {
            slopes.write_nodes(qp.stages().map(|stage| stage.arrays().matrix), 1.0, jacobian);
            self.layout.gradient(&qp, x, gradient);
        }
        Ok(())
    }
}

impl FunctionLibrary for Problems {
    type Worker = Worker;

    fn signatures(&self) -> &[Signature] {
        &self.signatures
    }

    fn worker(&self) -> Result<Worker, CallFailure> {
        if let Some(wrong) = &self.wrong {
            return Err(CallFailure(wrong.clone()));
        }
        let program = (self.make)().map_err(|error| CallFailure(error.to_string()))?;
        if program.dims() != self.layout.dims {
            return Err(CallFailure(CONSTRUCTION_FAILED.into()));
        }
        let (n, m) = (self.layout.variables, self.layout.constraints);
        Ok(Worker {
            program,
            x: vec![f64::NAN; n],
            v: Vec::new(),
            input: vec![0.0; n],
            multipliers: vec![f64::NAN; m + 1],
            input_multipliers: vec![0.0; m + 1],
            known: PointCache::default(),
            derivatives_requested: false,
            objective: 0.0,
            ends: Vec::new(),
            gradient: vec![0.0; n],
            jacobian: vec![0.0; self.transposed.len()],
            hessian: vec![0.0; self.layout.upper.sparsity.entries().len()],
            trial_point: Solution::new(&self.layout.dims).map_err(|error| CallFailure(error.to_string()))?,
            scaled: Vec::new(),
        })
    }

    fn evaluate(&self, worker: &mut Worker, function: usize, call: &mut dyn Call) -> Result<(), CallFailure> {
        let signature =
            self.signatures.get(function).ok_or_else(|| CallFailure(CONSTRUCTION_FAILED.into()))?;
        if signature.inputs.is_empty() {
            self.write_bounds(worker, call);
            return Ok(());
        }
        call.read(0, &mut worker.input);
        if !super::cache::equal(&worker.x, &worker.input) {
            worker.known = PointCache::default();
            worker.x.copy_from_slice(&worker.input);
            self.layout.gather(&worker.x, &mut worker.v);
        }
        let seed = |port: &Port| [c"lam_f", c"adj_f"].contains(&port.name.as_ref());
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
        // Derivatives first, which include values.
        let is_value = |port: &Port| [c"f", c"g"].contains(&port.name.as_ref());
        for values in [false, true] {
            for (output, port) in signature.outputs.iter().enumerate() {
                if is_value(port) == values
                    && let Some(to) = call.output(output)
                {
                    self.compute_output(worker, port, to).map_err(|error| CallFailure(error.to_string()))?;
                }
            }
        }
        Ok(())
    }

    fn integrations(&self) -> u64 {
        self.integrations.load(Ordering::Relaxed)
    }
}

impl Problems {
    /// Computes and writes an output; writes IPOPT's Hessian in place.
    fn compute_output(&self, worker: &mut Worker, port: &Port, to: &mut [f64]) -> Result<(), OcpError> {
        match port.name.to_bytes() {
            b"f" | b"g" => self.value(worker)?,
            b"grad_f_x" | b"jac_f_x" | b"jac_adj_x_adj_f" | b"jac_g_x" | b"jac_adj_x_adj_g" => {
                self.first(worker)?;
            }
            b"grad_gamma_x" | b"adj_x" => self.first(worker)?,
            b"triu_hess_gamma_x_x" if !worker.known.second => return self.evaluate_hessian(worker, Some(to)),
            b"jac_adj_x_x" => self.evaluate_hessian(worker, None)?,
            _ => {}
        }
        self.write(worker, port, to);
        Ok(())
    }

    /// Writes an output; ports with other names have no entries.
    fn write(&self, worker: &Worker, port: &Port, to: &mut [f64]) {
        let Some((&sigma, mu)) = worker.multipliers.split_first() else { return };
        match port.name.to_bytes() {
            b"f" => to.fill(worker.objective + self.layout.penalty(&worker.x)),
            b"g" => self.layout.constraints(&worker.x, &worker.v, &worker.ends, to),
            b"grad_f_x" | b"jac_f_x" | b"jac_adj_x_adj_f" => to.copy_from_slice(&worker.gradient),
            b"jac_g_x" => to.copy_from_slice(&worker.jacobian),
            b"jac_adj_x_adj_g" => copy_selected(&worker.jacobian, &self.transposed, to),
            b"jac_adj_x_x" => copy_selected(&worker.hessian, &self.layout.mirrored, to),
            b"triu_hess_gamma_x_x" => to.copy_from_slice(&worker.hessian),
            b"grad_gamma_x" | b"adj_x" => {
                for (to, gradient) in to.iter_mut().zip(&worker.gradient) {
                    *to = sigma * gradient;
                }
                for (&(row, column), value) in
                    self.layout.jacobian.sparsity.entries().iter().zip(&worker.jacobian)
                {
                    to[column] += mu[row] * value;
                }
            }
            b"x" => self.write_trajectory(worker, |dims| 0..dims.nx, to),
            b"u" => self.write_trajectory(worker, |dims| dims.nx..dims.nx + dims.nu, to),
            _ => {
                if let Some(group) = self.groups.iter().find(|group| *group.name == *port.name) {
                    self.write_trajectory(worker, |dims| group.variable_range(dims), to);
                }
            }
        }
    }

    /// Writes the states or controls of all stages, one after the other.
    fn write_trajectory(&self, worker: &Worker, choose: impl Fn(&StageDims) -> Range<usize>, to: &mut [f64]) {
        let (mut rest, mut to) = (&worker.v[..], to.iter_mut());
        for dims in &self.layout.dims {
            let (stage, behind) = rest.split_at(dims.nx + dims.nu);
            rest = behind;
            for (from, to) in stage[choose(dims)].iter().zip(to.by_ref()) {
                *to = *from;
            }
        }
    }

    /// Writes bounds, the iterate as the initial guess, and bounds of the constraints.
    fn write_bounds(&self, worker: &Worker, call: &mut dyn Call) {
        let mut start = vec![0.0; self.layout.variables];
        self.layout.scatter(&worker.program.point(), &mut start);
        let [x, g] = &self.layout.bounds;
        let side = |bounds: &[[f64; 2]], side: usize| bounds.iter().map(|bounds| bounds[side]).collect();
        let [lower, upper, g_lower, g_upper]: [Vec<f64>; 4] =
            [side(x, 0), side(x, 1), side(g, 0), side(g, 1)];
        for (output, from) in [lower, upper, start, g_lower, g_upper].iter().enumerate() {
            if let Some(to) = call.output(output) {
                to.copy_from_slice(from);
            }
        }
    }
}

/// Copies selected elements.
fn copy_selected(from: &[f64], places: &[usize], to: &mut [f64]) {
    for (to, &place) in to.iter_mut().zip(places) {
        *to = from[place];
    }
}
