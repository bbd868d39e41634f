//! One integrator as the functions `F`, `jac_F`, `adj1_F` and `jac_adj1_F`.
//!
//! With `w = (x₀, u, p)` and the outputs `y = (x, z, q)` they are `y`, `∂y/∂w`, `∇(λᵀy)`, and the
//! derivatives of `∇(λᵀy)`: `∇²(λᵀy)` with respect to `w` and `(∂y/∂w)ᵀ` with respect to `λ`.

use super::algebraic::{self, OutputDimensions};
use super::blocks::{
    ResultBlocks, WantedDerivatives, adjoint_gradient_blocks, concatenate, hessian_gradient_blocks, jacobian,
    jacobian_blocks, read_inputs, read_multipliers, rows, second, write,
};
use super::cache::{self, Cache, ComputedDerivatives, IntervalResults, Part, key};
use super::dependence::{self, Dimensions};
use super::function::{Call, Signature};
use super::integral::{Integral, Nothing};
use super::interval::{Consistent, Interval, IntervalStart};
use super::library::{CallFailure, FunctionLibrary};
use super::signature::{self, Output};
use super::sparsity::Dependence;
use crate::batch::vector;
use crate::model::{Dae, VectorX};
use crate::quadrature::OptionalIntegrand;
use crate::shape::{Matrix, Shape};
use alloc::vec;
use alloc::vec::Vec;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Settings of the functions of an integrator.
#[doc(hidden)]
#[derive(Clone, Debug)]
pub struct Settings<O> {
    /// The length of the interval; if negative, the model runs backwards in time.
    pub interval: f64,
    /// The options of the integrator.
    pub options: O,
    /// The time at the start. Default zero.
    pub time: f64,
    /// Whether the algebraic states at the end are the output `zf`. Default false.
    pub algebraic: bool,
    /// The number of inputs whose results are cached. Default 512. The cache is effective only if
    /// it has at least as many entries as the problem has intervals.
    pub cache: usize,
    /// The point `(x₀, u, p)` at which an adaptive integrator chooses the steps of all calls.
    /// Default empty.
    pub steps_at: &'static [f64],
}

impl<O: Default> Settings<O> {
    /// The defaults for an interval of this length.
    #[must_use]
    pub fn new(interval: f64) -> Self {
        Self { interval, options: O::default(), time: 0.0, algebraic: false, cache: 512, steps_at: &[] }
    }

    /// Checks the length of the interval: with length zero the end would equal the start for every
    /// model.
    pub(super) fn check(&self) -> Result<(), CallFailure> {
        if self.interval == 0.0 { Err(CallFailure("`interval` has no length".into())) } else { Ok(()) }
    }
}

/// The functions of the integrator `I` with the integrals `Q`.
#[doc(hidden)]
pub struct Integrators<I: Interval, Q = Nothing> {
    settings: Settings<I::Options>,
    signatures: Vec<Signature>,
    outputs: Vec<Vec<Output>>,
    cache: Mutex<Cache<I::Tape>>,
    integrations: AtomicU64,
    integrals: PhantomData<fn() -> Q>,
}

/// The memory of a thread.
pub struct Worker<I: Interval, Q: Integral<I::Model>> {
    integrator: I,
    integrals: Q::Memory,
    /// `(x₀, u, p)` and the multipliers `λ`.
    inputs: Vec<f64>,
    lambda: Vec<f64>,
    answer: IntervalResults<I::Tape>,
    /// Whether the cache stores derivatives.
    keeps: bool,
    /// The algebraic states at the end.
    zeta: Consistent,
}

impl<I: Interval, Q: Integral<I::Model>> Integrators<I, Q> {
    const NX: usize = <<I::Model as Dae>::Shape as Shape>::NX;
    const NU: usize = <<I::Model as Dae>::Shape as Shape>::NU;
    const NW: usize = <<I::Model as Dae>::Shape as Shape>::NW;
    const NZ: usize = <<I::Model as Dae>::Shape as Shape>::NZ;

    /// The dimensions, including algebraic states that are outputs.
    const fn sizes(settings: &Settings<I::Options>) -> OutputDimensions {
        let nz = if settings.algebraic { Self::NZ } else { 0 };
        OutputDimensions { nx: Self::NX, nz, nw: Self::NW, ny: Self::NX + nz + Q::COUNT }
    }

    /// The functions with these settings.
    #[must_use]
    pub fn new(settings: Settings<I::Options>) -> Self {
        let (OutputDimensions { nx, nz, nw, ny }, nu) = (Self::sizes(&settings), Self::NU);
        let at =
            |depth| dependence::variables(Dimensions::of::<I::Model>(), I::Model::STRUCTURE.jacobian, depth);
        // The point of an explicit method's last evaluation does not depend on that evaluation.
        let depth = I::depth(&settings.options);
        let (end, stages) = (at(depth), at(depth.map(|depth| depth.saturating_sub(1))));
        let (mut value, mut hessian) = (Dependence::zero(ny, nw), Dependence::zero(nw, nw));
        for state in 0..nx {
            value.add_row(state, &end, nx + state);
        }
        for output in 0..nz {
            value.add_row(nx + output, &end, 2 * nx + output);
        }
        dependence::curvature(&stages, I::Model::STRUCTURE.hessian, &mut hessian);
        Q::add_dependence(&stages, nx + nz, &mut value, &mut hessian);
        let outputs = [0..nx, nx..nx + nz, nx + nz..ny];
        let inputs = [0..nx, nx..nx + nu, nx + nu..nw];
        let shape = signature::Shape { count: 1, inputs, outputs, value: &value, hessian: &hessian };
        let (signatures, outputs) = shape.functions().into_iter().unzip();
        let cache = Mutex::new(Cache::new(settings.cache, !I::RECORDS));
        let integrations = AtomicU64::new(0);
        Self { settings, signatures, outputs, cache, integrations, integrals: PhantomData }
    }

    /// Loads results from the cache; returns whether they suffice.
    fn load_cached(
        &self,
        worker: &mut Worker<I, Q>,
        key: u64,
        wanted: &WantedDerivatives,
        outputs: &[Output],
        call: &mut dyn Call,
    ) -> bool {
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        worker.answer.clear();
        worker.keeps = cache.keeps_derivatives();
        let Some(answer) = cache.find(key, &worker.inputs) else { return false };
        if wanted.is_in(answer, &worker.lambda) {
            write(&ResultBlocks::of(answer), outputs, call);
            return true;
        }
        if let Some(tape) = answer.tape.get() {
            worker.answer.tape.open().clone_from(tape);
        }
        let lambda = (wanted.gradient || wanted.hessian).then_some(&worker.lambda[..]);
        cache.record_miss(key, &worker.inputs, wanted.jacobian, lambda);
        worker.keeps = cache.keeps_derivatives();
        false
    }

    /// Sets parameters and known stages; without stages the next call counts as an integration.
    fn prepare_integrator(
        &self,
        integrator: &mut I,
        p: &[f64],
        tape: Option<&I::Tape>,
    ) -> Result<(), CallFailure> {
        if !p.is_empty() {
            integrator.set_parameters(&vector(p))?;
        }
        match tape {
            Some(tape) => Ok(integrator.restore_stages(tape)?),
            None => {
                self.integrations.fetch_add(1, Ordering::Relaxed);
                Ok(())
            }
        }
    }

    /// Computes and writes the requested outputs, from known stages if available.
    fn compute(
        &self,
        worker: &mut Worker<I, Q>,
        wanted: &WantedDerivatives,
        outputs: &[Output],
        call: &mut dyn Call,
    ) -> Result<(), CallFailure> {
        let Worker { integrator, integrals, inputs, lambda, answer, keeps, zeta } = worker;
        let sizes @ OutputDimensions { nx, nz, ny, .. } = Self::sizes(&self.settings);
        let (x0, rest) = inputs.split_at(nx);
        let (u, p) = rest.split_at(Self::NU);
        let point = IntervalStart { x0: vector(x0), u: vector(u), h: self.settings.interval };
        self.prepare_integrator(integrator, p, answer.tape.get())?;
        let (of_states, rest) = lambda.split_at(nx);
        let (nu, of_integrals) = rest.split_at(nz);
        let mut seed: VectorX<I::Model, f64> = vector(of_states);
        let adjoint = wanted.gradient || wanted.hessian;
        let algebraic = wanted.algebraic.contains(&true) || adjoint && nu.iter().any(|&nu| nu != 0.0);
        if algebraic && adjoint {
            // The multipliers of the state depend on the end of the interval.
            let end = integrator.solve(&point.x0, &point.u, point.h)?.x;
            record_tape(integrator, &mut answer.tape)?;
            self.algebraic_states_at_end(
                integrator,
                IntervalStart { x0: end, u: vector(u), h: 0.0 },
                nu,
                zeta,
            )?;
            algebraic::add_to_seed(sizes, zeta, nu, seed.as_mut_slice());
            if let Some(tape) = answer.tape.get() {
                integrator.restore_stages(tape)?;
            }
        }
        // With algebraic states or integrals the outputs are more than the integrator's own
        // results.
        let whole = !algebraic && Q::COUNT == 0;
        let asked = IntervalRequest {
            point: &point,
            seed: &seed,
            wanted: *wanted,
            copies: *keeps || !whole,
            keeps: *keeps || algebraic,
            sizes,
            outputs: if whole { outputs } else { &[] },
        };
        asked.of(integrator, Q::integrand(integrals, of_integrals), answer, call)?;
        record_tape(integrator, &mut answer.tape)?;
        if adjoint {
            answer.lambda.set(ny).copy_from_slice(lambda);
        }
        answer.algebraic = [algebraic; 2];
        if whole {
            return Ok(());
        }
        let values = answer.value.open();
        values[nx + nz..].copy_from_slice(Q::value(integrals));
        if answer.jacobian.get().is_some() {
            rows(Q::jacobian(integrals), Q::COUNT, nx + nz, ny, answer.jacobian.open());
        }
        if algebraic {
            if !adjoint {
                let end = IntervalStart { x0: vector(&values[..nx]), u: vector(u), h: 0.0 };
                self.algebraic_states_at_end(integrator, end, &[], zeta)?;
            }
            values[nx..nx + nz].copy_from_slice(&zeta.z);
            if answer.jacobian.get().is_some() {
                algebraic::write_jacobian(sizes, zeta, answer.jacobian.open());
            }
            if adjoint {
                algebraic::add_to_gradient(sizes, zeta, nu, answer.gradient.open());
            }
            if wanted.hessian {
                let Some(jacobian) = answer.jacobian.get() else { return Ok(()) };
                algebraic::add_to_hessian(sizes, second::<I::Model>(), zeta, jacobian, answer.hessian.open());
            }
        }
        write(&ResultBlocks::of(answer), outputs, call);
        Ok(())
    }

    /// Computes the algebraic states at the end of the interval.
    fn algebraic_states_at_end(
        &self,
        integrator: &mut I,
        at: IntervalStart<I::Model>,
        nu: &[f64],
        zeta: &mut Consistent,
    ) -> Result<(), CallFailure> {
        self.integrations.fetch_add(1, Ordering::Relaxed);
        integrator.set_time(self.settings.time + self.settings.interval)?;
        let outcome = integrator.consistent(&at, nu, zeta);
        integrator.set_time(self.settings.time)?;
        Ok(outcome?)
    }
}

/// A request to an integrator.
struct IntervalRequest<'a, M: Dae> {
    point: &'a IntervalStart<M>,
    seed: &'a VectorX<M, f64>,
    wanted: WantedDerivatives,
    /// Whether derivatives are copied to the cache entry.
    copies: bool,
    /// Whether the Jacobian is also copied if it is computed for the Hessian.
    keeps: bool,
    sizes: OutputDimensions,
    /// The outputs to be written.
    outputs: &'a [Output],
}

impl<M: Dae> IntervalRequest<'_, M> {
    /// Writes outputs and the cache entry: values, and derivatives if requested.
    fn of<I: Interval<Model = M>>(
        &self,
        integrator: &mut I,
        along: OptionalIntegrand<'_, '_, M, f64>,
        answer: &mut IntervalResults<I::Tape>,
        call: &mut dyn Call,
    ) -> Result<(), CallFailure> {
        let Self { point, seed, wanted, copies, keeps, sizes, outputs } = *self;
        let (IntervalStart { x0, u, h }, OutputDimensions { nx, nw, ny, .. }) = (point, sizes);
        let mut numbers = ResultBlocks::default();
        if wanted.hessian {
            let result = integrator.hessian_with_quadrature(x0, u, *h, seed, along)?;
            if keeps || copies && wanted.jacobian {
                jacobian(result, ny, answer.jacobian.set(ny * nw));
            }
            if copies {
                concatenate(&hessian_gradient_blocks(result), answer.gradient.set(nw));
                concatenate(&result.second_derivative_blocks(), answer.hessian.set(second::<M>().len()));
            }
            (numbers.gradient, numbers.hessian) =
                (hessian_gradient_blocks(result), result.second_derivative_blocks());
            (numbers.value, numbers.jacobian) = ([result.x.as_slice()], jacobian_blocks(result));
        } else if wanted.gradient {
            let result = integrator.adjoint_with_quadrature(x0, u, *h, seed, along)?;
            if copies {
                concatenate(&adjoint_gradient_blocks(result), answer.gradient.set(nw));
            }
            (numbers.value, numbers.gradient) = ([result.x.as_slice()], adjoint_gradient_blocks(result));
        } else if wanted.jacobian {
            let result = integrator.forward_with_quadrature(x0, u, *h, along)?;
            if copies {
                jacobian(result, ny, answer.jacobian.set(ny * nw));
            }
            (numbers.value, numbers.jacobian) = ([result.x.as_slice()], jacobian_blocks(result));
        } else {
            numbers.value = [integrator.solve_with_quadrature(x0, u, *h, along)?.x.as_slice()];
        }
        answer.value.set(ny)[..nx].copy_from_slice(numbers.value[0]);
        write(&numbers, outputs, call);
        Ok(())
    }
}

/// Records the stages of the last call, unless they are recorded.
fn record_tape<I: Interval>(integrator: &mut I, tape: &mut Part<I::Tape>) -> Result<(), CallFailure> {
    if tape.get().is_none() && !integrator.record_stages(tape.open())? {
        tape.clear();
    }
    Ok(())
}

impl<I: Interval, Q: Integral<I::Model>> FunctionLibrary for Integrators<I, Q> {
    type Worker = Worker<I, Q>;

    fn signatures(&self) -> &[Signature] {
        &self.signatures
    }

    fn worker(&self) -> Result<Self::Worker, CallFailure> {
        self.settings.check()?;
        if self.settings.algebraic && Self::NZ > 0 && !I::FINDS_ALGEBRAIC_STATES {
            return Err(CallFailure("`algebraic` is for implicit methods with steps of equal size".into()));
        }
        let mut integrator = I::build(&self.settings.options)?;
        integrator.set_time(self.settings.time)?;
        if I::CHOOSES {
            let at = self.settings.steps_at;
            if at.len() != Self::NW {
                return Err(CallFailure(alloc::format!(
                    "`steps_at` has {} numbers: (x0, u, p) where an adaptive integrator chooses its steps are {}",
                    at.len(),
                    Self::NW
                )));
            }
            let (x0, rest) = at.split_at(Self::NX);
            let (u, p) = rest.split_at(Self::NU);
            if !p.is_empty() {
                integrator.set_parameters(&vector(p))?;
            }
            integrator.choose_steps(&IntervalStart {
                x0: vector(x0),
                u: vector(u),
                h: self.settings.interval,
            })?;
        }
        Ok(Worker {
            integrator,
            integrals: Q::memory()?,
            inputs: vec![0.0; Self::NW],
            lambda: vec![0.0; Self::sizes(&self.settings).ny],
            answer: IntervalResults::default(),
            keeps: false,
            zeta: Consistent::default(),
        })
    }

    fn evaluate(
        &self,
        worker: &mut Self::Worker,
        function: usize,
        call: &mut dyn Call,
    ) -> Result<(), CallFailure> {
        let (Some(signature), Some(outputs)) = (self.signatures.get(function), self.outputs.get(function))
        else {
            return Err(CallFailure("there is no such function".into()));
        };
        let wanted = WantedDerivatives::by(outputs, call);
        if wanted.is_empty() {
            return Ok(());
        }
        read_inputs(signature, call, &mut worker.inputs);
        read_multipliers(signature, call, &mut worker.lambda);
        let key = key(&worker.inputs);
        if self.load_cached(worker, key, &wanted, outputs, call) {
            return Ok(());
        }
        // After an error the restored stages must not be used in the next call.
        self.compute(worker, &wanted, outputs, call).inspect_err(|_| worker.integrator.discard_stages())?;
        let adjoint = wanted.gradient || wanted.hessian;
        let given = ComputedDerivatives {
            jacobian: wanted.jacobian,
            second: adjoint.then(|| cache::key(&worker.lambda)),
        };
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        cache.store(key, &worker.inputs, &mut worker.answer, given);
        Ok(())
    }

    fn integrations(&self) -> u64 {
        self.integrations.load(Ordering::Relaxed)
    }
}
