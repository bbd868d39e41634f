//! Forward sensitivities in given directions.

use super::matrices::Single;
use super::sweep::{Linearized, Outputs, Sweep};
use crate::error::Error;
use crate::finite::check_output;
use crate::irk::directions::Seeded;
use crate::irk::driver::Parts;
use crate::irk::workspace::Work;
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
    sweep: Sweep<M, T, [T; C], S>,
    /// The seeds, one row for each element of `w`.
    seeds: ArrayW<M, [T; C]>,
}

/// The memory of sensitivities in directions, of any number.
pub struct Directionals<M, T, const S: usize>(PhantomData<fn() -> (M, T)>);
impl<M: Dae, T: Real, const S: usize> Family for Directionals<M, T, S> {
    type Of<const C: usize> = DirectionalMemory<M, T, S, C>;
}

impl<M: Dae, T: Real, const S: usize, const C: usize> DirectionalMemory<M, T, S, C> {
    pub(crate) fn seed(&mut self, seeds: &Seeds<M, T, C>) {
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

    /// After a step that is linearised.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn step<F: Fallback>(
        &mut self,
        parts: &mut Parts<'_, M, T, S, F>,
        n: usize,
        count: usize,
    ) -> Result<(), Error> {
        let Parts { work, coefficients, statistics, .. } = parts;
        let Self { result, sweep, seeds } = self;
        let of = Linearized { kept: None, coefficients, directions: Seeded(seeds.as_ref()), first: n == 0 };
        if n == 0 {
            sweep.start(of.directions);
        }
        let nx = M::Shape::NX;
        let end = (n + 1 == count).then(|| Single { matrix: result.dx.as_mut_slice(), rows: nx });
        let outputs = &mut Outputs { curved: None, end, distant: false };
        if !sweep.step(work, of, outputs) && work.linear.factors.is_planned() {
            work.factor_dense(coefficients, n, 0, statistics)?;
            sweep.repeat(work, of, outputs);
        }
        let nz = M::Shape::NZ;
        if n == 0 {
            let to = &mut Single { matrix: result.dz0.as_mut_slice(), rows: nz };
            sweep.write_algebraic((F::plan::<M>(), of.directions), &coefficients.start, to);
        }
        if n + 1 == count {
            let to = &mut Single { matrix: result.dz.as_mut_slice(), rows: nz };
            sweep.write_algebraic((F::plan::<M>(), of.directions), &coefficients.end, to);
        }
        Ok(())
    }

    /// The derivatives of the stages of the last step, directions innermost.
    #[cfg(feature = "alloc")]
    pub(crate) fn stages(&self) -> &[T] {
        self.sweep.dy()
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish<F: Fallback>(&mut self, work: &Work<M, T, S, F>, step: usize) -> Result<(), Error> {
        self.result.nominal = work.result;
        check_output(self.result.dx.as_slice(), step)?;
        check_output(self.result.dz.as_slice(), step)?;
        check_output(self.result.dz0.as_slice(), step)
    }
}
