//! Forward sensitivities in given directions.

use super::matrices::SingleMatrix;
use super::sweep::{ForwardSweep, LinearizedStep, StepOutputs};
use crate::error::Error;
use crate::finite::check_output;
use crate::irk::directions::SeedDirections;
use crate::irk::driver::CallContext;
use crate::irk::workspace::StageWorkspace;
use crate::memory::{Fallback, Family};
use crate::model::{ArrayW, Dae};
use crate::result::{Directional, Seeds};
use crate::scalar::Real;
use crate::shape::{Matrix, Plain, Shape};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Memory of sensitivities in `C` directions.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct DirectionalMemory<M: Dae, T: Plain, const S: usize, const C: usize> {
    pub(crate) result: Directional<M, T, C>,
    sweep: ForwardSweep<M, T, [T; C], S>,
    /// The seeds, one row for each element of `w`.
    seeds: ArrayW<M, [T; C]>,
}

/// The memory of sensitivities in any number of directions.
pub struct Directionals<M, T, const S: usize>(PhantomData<fn() -> (M, T)>);
impl<M: Dae, T: Real, const S: usize> Family for Directionals<M, T, S> {
    type Of<const C: usize> = DirectionalMemory<M, T, S, C>;
}

impl<M: Dae, T: Real, const S: usize, const C: usize> DirectionalMemory<M, T, S, C> {
    pub(crate) fn set_seeds(&mut self, seeds: &Seeds<M, T, C>) {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        for (w, row) in self.seeds.as_mut().iter_mut().enumerate() {
            *row = core::array::from_fn(|column| {
                if w < nx {
                    seeds.x0[(w, column)]
                } else if w < nx + nu {
                    seeds.u[(w - nx, column)]
                } else {
                    seeds.p[(w - nx - nu, column)]
                }
            });
        }
    }

    /// Differentiates a linearised step.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn step<F: Fallback>(
        &mut self,
        context: &mut CallContext<'_, M, T, S, F>,
        n: usize,
        count: usize,
    ) -> Result<(), Error> {
        let CallContext { workspace: work, coefficients, statistics, .. } = context;
        let Self { result, sweep, seeds } = self;
        let linearized = LinearizedStep {
            stored_linearization: None,
            coefficients,
            directions: SeedDirections(seeds.as_ref()),
            is_first: n == 0,
        };
        if n == 0 {
            sweep.set_initial_directions(linearized.directions);
        }
        let nx = M::Shape::NX;
        let result_output =
            (n + 1 == count).then(|| SingleMatrix { matrix: result.dx.as_mut_slice(), rows: nx });
        let outputs =
            &mut StepOutputs { stage_sensitivities: None, result: result_output, prefetch_output: false };
        if !sweep.step(work, linearized, outputs) && work.linearization.factors.is_from_plan() {
            work.factor_dense(coefficients, n, 0, statistics)?;
            sweep.repeat_step(work, linearized, outputs);
        }
        let nz = M::Shape::NZ;
        if n == 0 {
            let to = &mut SingleMatrix { matrix: result.dz0.as_mut_slice(), rows: nz };
            sweep.write_algebraic((F::plan::<M>(), linearized.directions), &coefficients.lagrange_start, to);
        }
        if n + 1 == count {
            let to = &mut SingleMatrix { matrix: result.dz.as_mut_slice(), rows: nz };
            sweep.write_algebraic((F::plan::<M>(), linearized.directions), &coefficients.lagrange_end, to);
        }
        Ok(())
    }

    /// The derivatives of the stages of the last step, with directions innermost.
    #[cfg(feature = "alloc")]
    pub(crate) fn stage_derivatives(&self) -> &[T] {
        self.sweep.dy()
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish<F: Fallback>(
        &mut self,
        work: &StageWorkspace<M, T, S, F>,
        step: usize,
    ) -> Result<(), Error> {
        self.result.nominal = work.result;
        check_output(self.result.dx.as_slice(), step)?;
        check_output(self.result.dz.as_slice(), step)?;
        check_output(self.result.dz0.as_slice(), step)
    }
}
