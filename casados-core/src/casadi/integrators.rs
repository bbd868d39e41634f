//! One integrator as the functions `F`, `jac_F`, `adj1_F` and `jac_adj1_F`.
//!
//! With `w = (x₀, u, p)` and the outputs `y = (x, q)` they are `y`, `∂y/∂w`, `∇(λᵀy)`, and the
//! derivatives of `∇(λᵀy)`, which are `∇²(λᵀy)` by `w` and `(∂y/∂w)ᵀ` by `λ`.

use super::blocks::{
    Wanted, gradient, gradient_of, hessian, jacobian, read_inputs, read_multipliers, rows, write,
};
use super::cache::{Answer, Cache};
use super::dependence::{self, Dimensions};
use super::function::{Call, Signature};
use super::integral::{Integral, Nothing};
use super::interval::{Interval, Point};
use super::library::{Client, Failure};
use super::signature::{self, Output};
use super::sparsity::Relation;
use crate::batch::vector;
use crate::model::{Dae, VectorX};
use crate::shape::{Matrix, Shape};
use alloc::vec;
use alloc::vec::Vec;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// What can be chosen about the functions of an integrator.
#[derive(Clone, Debug)]
pub struct Settings<O> {
    /// The length of the interval.
    pub interval: f64,
    /// The options of the integrator.
    pub options: O,
    /// The time at the start; zero by default.
    pub time: f64,
    /// How many inputs are remembered with what was computed at them; 512 by default. As many as a
    /// problem has intervals are needed, or none is found again.
    pub cache: usize,
    /// `(x₀, u, p)` at which an adaptive integrator chooses the steps that all calls then take.
    pub steps_at: &'static [f64],
}

impl<O: Default> Settings<O> {
    /// The defaults, for an interval of this length.
    #[must_use]
    pub fn new(interval: f64) -> Self {
        Self { interval, options: O::default(), time: 0.0, cache: 512, steps_at: &[] }
    }
}

/// The functions of the integrator `I` with the integrals `Q`.
pub struct Integrators<I: Interval, Q = Nothing> {
    settings: Settings<I::Options>,
    signatures: Vec<Signature>,
    outputs: Vec<Vec<Output>>,
    cache: Mutex<Cache<I::Tape>>,
    integrations: AtomicU64,
    integrals: PhantomData<fn() -> Q>,
}

/// What a thread has to itself.
pub struct Worker<I: Interval, Q: Integral<I::Model>> {
    integrator: I,
    integrals: Q::Memory,
    /// `(x₀, u, p)` and the multipliers `λ`.
    inputs: Vec<f64>,
    lambda: Vec<f64>,
    answer: Answer<I::Tape>,
}

impl<I: Interval, Q: Integral<I::Model>> Integrators<I, Q> {
    const NX: usize = <<I::Model as Dae>::Shape as Shape>::NX;
    const NU: usize = <<I::Model as Dae>::Shape as Shape>::NU;
    const NW: usize = <<I::Model as Dae>::Shape as Shape>::NW;
    const NY: usize = Self::NX + Q::COUNT;

    /// The functions with these settings.
    #[must_use]
    pub fn new(settings: Settings<I::Options>) -> Self {
        let (nx, nu, nw, ny) = (Self::NX, Self::NU, Self::NW, Self::NY);
        let at =
            |depth| dependence::variables(Dimensions::of::<I::Model>(), I::Model::STRUCTURE.jacobian, depth);
        // The last evaluation of an explicit method is at a point that does not depend on it.
        let depth = I::depth(&settings.options);
        let (end, stages) = (at(depth), at(depth.map(|depth| depth.saturating_sub(1))));
        let (mut value, mut hessian) = (Relation::zero(ny, nw), Relation::zero(nw, nw));
        for state in 0..nx {
            value.join(state, &end, nx + state);
        }
        dependence::curvature(&stages, I::Model::STRUCTURE.hessian, &mut hessian, nw);
        Q::depend(&stages, nx, &mut value, &mut hessian);
        let mut outputs: Vec<_> = [0..nx, nx..ny].into();
        outputs.truncate(1 + usize::from(Q::COUNT > 0));
        let inputs = [0..nx, nx..nx + nu, nx + nu..nw];
        let shape =
            signature::Shape { count: 1, inputs, outputs: &outputs, value: &value, hessian: &hessian };
        let (signatures, outputs) = shape.functions().into_iter().unzip();
        let cache = Mutex::new(Cache::new(settings.cache));
        let integrations = AtomicU64::new(0);
        Self { settings, signatures, outputs, cache, integrations, integrals: PhantomData }
    }

    /// Takes what is known from the cache: whether that is enough.
    fn known(
        &self,
        worker: &mut Worker<I, Q>,
        wanted: &Wanted,
        outputs: &[Output],
        call: &mut dyn Call,
    ) -> bool {
        let cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        worker.answer.clear();
        let Some(answer) = cache.find(&worker.inputs) else { return false };
        if wanted.is_in(answer, &worker.lambda) {
            write(answer, outputs, call);
            return true;
        }
        if let Some(tape) = answer.tape.get() {
            worker.answer.tape.open().clone_from(tape);
        }
        false
    }

    /// Computes what is wanted, from stages that are known if there are any.
    fn compute(&self, worker: &mut Worker<I, Q>, wanted: &Wanted) -> Result<(), Failure> {
        let Worker { integrator, integrals, inputs, lambda, answer } = worker;
        let (nx, nu, nw, ny) = (Self::NX, Self::NU, Self::NW, Self::NY);
        let (x0, rest) = inputs.split_at(nx);
        let (u, p) = rest.split_at(nu);
        let point = Point { x0: vector(x0), u: vector(u), h: self.settings.interval };
        if !p.is_empty() {
            integrator.parameters(&vector(p))?;
        }
        match answer.tape.get() {
            Some(tape) => integrator.restore(tape)?,
            None => {
                self.integrations.fetch_add(1, Ordering::Relaxed);
            }
        }
        let (of_states, of_integrals) = lambda.split_at(nx);
        let along = Q::along(integrals, of_integrals);
        let seed: VectorX<I::Model, f64> = vector(of_states);
        if wanted.hessian {
            let result = integrator.curvature(&point, &seed, along)?;
            jacobian(result, ny, answer.jacobian.set(ny * nw));
            hessian(result, answer.hessian.set(nw * nw));
            answer.value.set(ny)[..nx].copy_from_slice(result.x.as_slice());
            gradient_of(result, answer.gradient.set(nw));
        } else if wanted.gradient {
            let result = integrator.gradient(&point, &seed, along)?;
            answer.value.set(ny)[..nx].copy_from_slice(result.x.as_slice());
            gradient(result, answer.gradient.set(nw));
        } else if wanted.jacobian {
            let result = integrator.jacobian(&point, along)?;
            jacobian(result, ny, answer.jacobian.set(ny * nw));
            answer.value.set(ny)[..nx].copy_from_slice(result.x.as_slice());
        } else {
            let result = integrator.value(&point, along)?;
            answer.value.set(ny)[..nx].copy_from_slice(result.x.as_slice());
        }
        if wanted.gradient || wanted.hessian {
            answer.lambda.set(ny).copy_from_slice(lambda);
        }
        answer.value.open()[nx..].copy_from_slice(Q::value(integrals));
        if answer.jacobian.get().is_some() {
            rows(Q::jacobian(integrals), Q::COUNT, nx, ny, answer.jacobian.open());
        }
        if answer.tape.get().is_none() && !integrator.record(answer.tape.open())? {
            answer.tape.clear();
        }
        Ok(())
    }
}

impl<I: Interval, Q: Integral<I::Model>> Client for Integrators<I, Q> {
    type Worker = Worker<I, Q>;

    fn signatures(&self) -> &[Signature] {
        &self.signatures
    }

    fn worker(&self) -> Result<Self::Worker, Failure> {
        let mut integrator = I::build(&self.settings.options)?;
        integrator.time(self.settings.time)?;
        if I::CHOOSES {
            let at = self.settings.steps_at;
            if at.len() != Self::NW {
                return Err(Failure(alloc::format!(
                    "`steps_at` has {} numbers: (x0, u, p) where an adaptive integrator chooses its steps are {}",
                    at.len(),
                    Self::NW
                )));
            }
            let (x0, rest) = at.split_at(Self::NX);
            let (u, p) = rest.split_at(Self::NU);
            if !p.is_empty() {
                integrator.parameters(&vector(p))?;
            }
            integrator.choose(&Point { x0: vector(x0), u: vector(u), h: self.settings.interval })?;
        }
        Ok(Worker {
            integrator,
            integrals: Q::memory()?,
            inputs: vec![0.0; Self::NW],
            lambda: vec![0.0; Self::NY],
            answer: Answer::default(),
        })
    }

    fn evaluate(
        &self,
        worker: &mut Self::Worker,
        function: usize,
        call: &mut dyn Call,
    ) -> Result<(), Failure> {
        let (Some(signature), Some(outputs)) = (self.signatures.get(function), self.outputs.get(function))
        else {
            return Err(Failure("there is no such function".into()));
        };
        let wanted = Wanted::by(outputs, call);
        if wanted.is_nothing() {
            return Ok(());
        }
        read_inputs(signature, call, &mut worker.inputs);
        read_multipliers(signature, call, &mut worker.lambda);
        if self.known(worker, &wanted, outputs, call) {
            return Ok(());
        }
        self.compute(worker, &wanted)?;
        write(&worker.answer, outputs, call);
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        cache.store(&worker.inputs, &mut worker.answer);
        Ok(())
    }

    fn integrations(&self) -> u64 {
        self.integrations.load(Ordering::Relaxed)
    }
}
