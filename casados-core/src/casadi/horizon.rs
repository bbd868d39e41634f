//! A batch as the functions of one integrator, for all intervals of a horizon in one call: `x0`,
//! `u`, `p` and `xf` have one column for each interval, derivatives are block-diagonal.

use super::blocks::{
    ResultBlocks, WantedDerivatives, adjoint_gradient_blocks, concatenate, hessian_gradient_blocks, jacobian,
    read_inputs, read_multipliers, second, write,
};
use super::cache::{Cache, ComputedDerivatives, IntervalResults, key};
use super::dependence::{self, Dimensions};
use super::function::{Call, Signature};
use super::integrators::Settings;
use super::library::{CallFailure, FunctionLibrary};
use super::signature::{self, Output};
use super::sparsity::Dependence;
use crate::batch::{self, Intervals, Standard, vector};
use crate::error::Error;
use crate::model::{Dae, VectorP, VectorU, VectorX};
use crate::options::Options;
use crate::result::{Adjoint, Forward, Hessian, Nominal};
use crate::shape::{Matrix, Shape};
use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// An integrator of many intervals: `Batch` of `f64`.
#[doc(hidden)]
pub trait Horizon: Sized + Send + 'static {
    /// The model.
    type Model: Dae;

    /// Creates an integrator with these options.
    ///
    /// # Errors
    /// [`Error::InvalidOption`]
    fn build(options: &Options) -> Result<Self, Error>;
    /// Computes the requested results.
    ///
    /// # Errors
    /// Those of the integrator, with the interval.
    #[doc(hidden)]
    fn compute(
        &mut self,
        intervals: &Intervals<'_, Self::Model>,
        lambda: &[VectorX<Self::Model, f64>],
        wanted: WantedDerivatives,
        answer: &mut IntervalResults<()>,
    ) -> Result<(), CallFailure>;
}

impl<M: Dae, I: Standard<Model = M, Number = f64> + 'static> Horizon for batch::Integrator<I> {
    type Model = M;

    fn build(options: &Options) -> Result<Self, Error> {
        Self::new(*options)
    }

    fn compute(
        &mut self,
        intervals: &Intervals<'_, M>,
        lambda: &[VectorX<M, f64>],
        wanted: WantedDerivatives,
        answer: &mut IntervalResults<()>,
    ) -> Result<(), CallFailure> {
        let (nx, nw, count) = (M::Shape::NX, M::Shape::NW, intervals.x0.len());
        let failed = |error: batch::BatchError| CallFailure(error.to_string());
        let values = answer.value.set(count * nx).chunks_exact_mut(nx.max(1));
        if wanted.hessian {
            let mut results = vec![Hessian::default(); count];
            self.hessian(intervals, lambda, &mut results).map_err(failed)?;
            let slopes = answer.jacobian.set(count * nx * nw).chunks_exact_mut((nx * nw).max(1));
            let gradients = answer.gradient.set(count * nw).chunks_exact_mut(nw.max(1));
            let length = second::<M>().len();
            let curvatures = answer.hessian.set(count * length).chunks_exact_mut(length.max(1));
            let places = values.zip(slopes).zip(gradients.zip(curvatures));
            for (result, ((value, slope), (first, second))) in results.iter().zip(places) {
                value.copy_from_slice(result.x.as_slice());
                jacobian(result, nx, slope);
                concatenate(&hessian_gradient_blocks(result), first);
                concatenate(&result.second_derivative_blocks(), second);
            }
        } else if wanted.gradient {
            let mut results = vec![Adjoint::default(); count];
            self.adjoint(intervals, lambda, &mut results).map_err(failed)?;
            let gradients = answer.gradient.set(count * nw).chunks_exact_mut(nw.max(1));
            for (result, (value, first)) in results.iter().zip(values.zip(gradients)) {
                value.copy_from_slice(result.x.as_slice());
                concatenate(&adjoint_gradient_blocks(result), first);
            }
        } else if wanted.jacobian {
            let mut results = vec![Forward::default(); count];
            self.forward(intervals, &mut results).map_err(failed)?;
            let slopes = answer.jacobian.set(count * nx * nw).chunks_exact_mut((nx * nw).max(1));
            for (result, (value, slope)) in results.iter().zip(values.zip(slopes)) {
                value.copy_from_slice(result.x.as_slice());
                jacobian(result, nx, slope);
            }
        } else {
            let mut results = vec![Nominal::default(); count];
            self.solve(intervals, &mut results).map_err(failed)?;
            for (result, value) in results.iter().zip(values) {
                value.copy_from_slice(result.x.as_slice());
            }
        }
        Ok(())
    }
}

/// The functions of the batch `B`.
#[doc(hidden)]
pub struct Horizons<B: Horizon> {
    settings: Settings<Options>,
    count: usize,
    signatures: Vec<Signature>,
    outputs: Vec<Vec<Output>>,
    cache: Mutex<Cache<()>>,
    integrations: AtomicU64,
    batch: PhantomData<fn() -> B>,
}

/// The memory of a thread.
pub struct Worker<B: Horizon> {
    batch: B,
    /// `x₀` of all intervals, followed by `u` and `p`; and the multipliers `λ`.
    inputs: Vec<f64>,
    lambda: Vec<f64>,
    answer: IntervalResults<()>,
}

impl<B: Horizon> Horizons<B> {
    const NX: usize = <<B::Model as Dae>::Shape as Shape>::NX;
    const NU: usize = <<B::Model as Dae>::Shape as Shape>::NU;
    const NW: usize = <<B::Model as Dae>::Shape as Shape>::NW;

    /// The functions for this number of intervals with these settings.
    ///
    /// # Errors
    /// A text for [`Error::OutOfMemory`].
    pub fn new(settings: Settings<Options>, count: usize) -> Result<Self, CallFailure> {
        let (nx, nu, nw) = (Self::NX, Self::NU, Self::NW);
        // The approximate size of the indices in the patterns of four functions, tested in advance.
        let bytes =
            (nx + nw).saturating_mul(nx + nw).saturating_mul(4 * size_of::<usize>()).saturating_mul(count);
        if Vec::<u8>::new().try_reserve_exact(bytes).is_err() {
            return Err(Error::OutOfMemory { bytes }.into());
        }
        let variables =
            dependence::variables(Dimensions::of::<B::Model>(), B::Model::STRUCTURE.jacobian, None);
        let (mut value, mut hessian) = (Dependence::zero(nx, nw), Dependence::zero(nw, nw));
        for state in 0..nx {
            value.add_row(state, &variables, nx + state);
        }
        dependence::curvature(&variables, B::Model::STRUCTURE.hessian, &mut hessian);
        let inputs = [0..nx, nx..nx + nu, nx + nu..nw];
        let outputs = [0..nx, nx..nx, nx..nx];
        let shape = signature::Shape { count, inputs, outputs, value: &value, hessian: &hessian };
        let (signatures, outputs) = shape.functions().into_iter().unzip();
        let cache = Mutex::new(Cache::new(settings.cache, true));
        let integrations = AtomicU64::new(0);
        Ok(Self { settings, count, signatures, outputs, cache, integrations, batch: PhantomData })
    }

    fn compute(&self, worker: &mut Worker<B>, wanted: WantedDerivatives) -> Result<(), CallFailure> {
        let Worker { batch, inputs, lambda, answer } = worker;
        let (nx, nu, nw) = (Self::NX, Self::NU, Self::NW);
        let (x, rest) = inputs.split_at(self.count * nx);
        let (u, p) = rest.split_at(self.count * nu);
        let x0: Vec<VectorX<B::Model, f64>> = x.chunks_exact(nx.max(1)).map(vector).collect();
        let u: Vec<VectorU<B::Model, f64>> = u.chunks_exact(nu.max(1)).map(vector).collect();
        let p: Vec<VectorP<B::Model, f64>> = p.chunks_exact((nw - nx - nu).max(1)).map(vector).collect();
        let seeds: Vec<VectorX<B::Model, f64>> = lambda.chunks_exact(nx.max(1)).map(vector).collect();
        let Settings { interval, time, .. } = self.settings;
        let t0: Vec<f64> = (0..self.count).map(|k| time + k as f64 * interval).collect();
        let intervals = Intervals { x0: &x0, u: &u, p: &p, h: &[interval], t0: &t0 };
        self.integrations.fetch_add(self.count as u64, Ordering::Relaxed);
        batch.compute(&intervals, &seeds, wanted, answer)?;
        if wanted.gradient || wanted.hessian {
            answer.lambda.set(lambda.len()).copy_from_slice(lambda);
        }
        Ok(())
    }
}

impl<B: Horizon> FunctionLibrary for Horizons<B> {
    type Worker = Worker<B>;

    fn signatures(&self) -> &[Signature] {
        &self.signatures
    }

    fn worker(&self) -> Result<Worker<B>, CallFailure> {
        self.settings.check()?;
        Ok(Worker {
            batch: B::build(&self.settings.options)?,
            inputs: vec![0.0; self.count * Self::NW],
            lambda: vec![0.0; self.count * Self::NX],
            answer: IntervalResults::default(),
        })
    }

    fn evaluate(
        &self,
        worker: &mut Worker<B>,
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
        {
            let cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(answer) =
                cache.find(key, &worker.inputs).filter(|answer| wanted.is_in(answer, &worker.lambda))
            {
                write(&ResultBlocks::of(answer), outputs, call);
                return Ok(());
            }
        }
        worker.answer.clear();
        self.compute(worker, wanted)?;
        write(&ResultBlocks::of(&worker.answer), outputs, call);
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        cache.store(key, &worker.inputs, &mut worker.answer, ComputedDerivatives::default());
        Ok(())
    }

    fn integrations(&self) -> u64 {
        self.integrations.load(Ordering::Relaxed)
    }
}
