//! Forward sensitivities: implicit function theorem at the converged stages.
//!
//! ```text
//! J dK = −(f_x,i V_n + f_w,i)        V_{n+1} = V_n + h Σ_i b_i dk_i
//! ```
//!
//! `V_n = dx_n/dw`, one row per state, all directions `w` side by side.

use super::directions::{Identity, Seeded};
use super::record::{Coefficients, Work, copy};
use super::step::check;
use super::sweep::Sweep;
use super::write::Target;
use crate::error::Error;
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::memory::Fallback;
#[cfg(feature = "alloc")]
use crate::model::ArrayX;
use crate::model::{ArrayW, Dae, NO_COLUMN};
use crate::result::{DenseForward, Directional, Forward, ForwardAdjoint, Nominal, Seeds};
use crate::scalar::{Lanes, Real};
use crate::shape::{Matrix, Plain, Shape};
use crate::statistics::Statistics;
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// Memory of forward sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: ForwardAdjoint<M, T>,
    pub(crate) dense: DenseForward<M, T>,
    pub(crate) sweep: Sweep<M, T, ArrayW<M, T>, S>,
    /// Zero if all derivatives of `z` are finite, else NaN.
    pub(crate) finite: [T; 1],
}
copy!([M: Dae, T: Plain, const S: usize] ForwardMemory<M, T, S>);

impl<M: Dae, E: Lanes, const S: usize> ForwardMemory<M, E, S> {
    /// A step that is linearised, by the factors that are there; whether the derivatives satisfy their equations.
    pub(crate) fn advance<F: Fallback>(
        &mut self,
        work: &mut Work<M, E, S, F>,
        coefficients: &Coefficients<E, S>,
        n: usize,
        curved: Option<&mut [E]>,
    ) -> E::Mask {
        let directions = &Identity::<M>::ALL;
        if n == 0 {
            self.sweep.start(directions);
        }
        self.sweep.step(work, coefficients, directions, n == 0, curved)
    }

    /// What a step contributes to derivatives of `z`.
    pub(crate) fn collect(&mut self, coefficients: &Coefficients<E, S>, n: usize, count: usize) {
        let Self { result: ForwardAdjoint { forward, .. }, sweep, finite: [finite], .. } = self;
        if n == 0 {
            let to = &mut Split::<M, _>::new(&mut forward.dz0_dx0, &mut forward.dz0_du, &mut forward.dz0_dp);
            *finite = sweep.write_algebraic::<Identity<M>>(&coefficients.start, to);
        }
        if n + 1 == count {
            let to = &mut Split::<M, _>::new(&mut forward.dz_dx0, &mut forward.dz_du, &mut forward.dz_dp);
            *finite = *finite + sweep.write_algebraic::<Identity<M>>(&coefficients.end, to);
        }
    }

    /// The result, after the last step: that of this memory, or one `elsewhere`. Zero if all derivatives are finite, else NaN.
    pub(crate) fn write(&mut self, nominal: &Nominal<M, E>, elsewhere: Option<&mut Forward<M, E>>) -> E {
        let Self { result: ForwardAdjoint { forward: own, .. }, sweep, finite: [finite], .. } = self;
        let forward = match elsewhere {
            Some(forward) => {
                forward.dz_dx0 = own.dz_dx0;
                forward.dz_du = own.dz_du;
                forward.dz_dp = own.dz_dp;
                forward.dz0_dx0 = own.dz0_dx0;
                forward.dz0_du = own.dz0_du;
                forward.dz0_dp = own.dz0_dp;
                forward
            }
            None => own,
        };
        forward.nominal = *nominal;
        let to = &mut Split::<M, _>::new(&mut forward.dx_dx0, &mut forward.dx_du, &mut forward.dx_dp);
        to.fill_others();
        *finite + sweep.write_end::<Identity<M>>(to)
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardMemory<M, T, S> {
    /// After a step that is linearised; refined where digits were lost, if that is asked for.
    ///
    /// # Errors
    /// [`Error::Singular`]
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn step<F: Fallback, const REFINED: bool>(
        &mut self,
        work: &mut Work<M, T, S, F>,
        coefficients: &Coefficients<T, S>,
        n: usize,
        count: usize,
        statistics: &mut Statistics,
        mut curved: Option<&mut [T]>,
    ) -> Result<(), Error> {
        let good = self.advance(work, coefficients, n, curved.as_deref_mut());
        if !good && work.linear.factors.is_planned() {
            work.factor_pivoted(coefficients, n, 0, statistics)?;
            self.sweep.repeat(work, coefficients, &Identity::<M>::ALL, n == 0, curved);
        }
        if const { REFINED } {
            self.sweep.refine(work, coefficients, &Identity::<M>::ALL, n == 0);
        }
        self.collect(coefficients, n, count);
        Ok(())
    }

    /// Derivatives at a point of the last step.
    pub(crate) fn interpolate(&mut self, weights: &[T; S], lagrange: &[T; S]) {
        let Self { dense, sweep, .. } = self;
        let to = &mut Split::<M, _>::new(&mut dense.dx_dx0, &mut dense.dx_du, &mut dense.dx_dp);
        to.fill_others();
        sweep.write_differential::<Identity<M>>(weights, to);
        let to = &mut Split::<M, _>::new(&mut dense.dz_dx0, &mut dense.dz_du, &mut dense.dz_dp);
        sweep.write_algebraic::<Identity<M>>(lagrange, to);
    }

    /// The derivatives of `Σ_i weight_i k_i` of the last step, a row for each direction.
    #[cfg(feature = "alloc")]
    pub(crate) fn slopes(&self, weights: &[T; S], to: &mut ArrayW<M, ArrayX<M, T>>) {
        for direction in to.as_mut() {
            direction.as_mut().fill(T::ZERO);
        }
        self.sweep.write_slopes::<Identity<M>>(weights, &mut Rows::<M, T> { rows: to });
    }

    /// Writes the result to that of this memory, or to one `elsewhere`.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(
        &mut self,
        nominal: &Nominal<M, T>,
        step: usize,
        mut elsewhere: Option<&mut Forward<M, T>>,
    ) -> Result<(), Error> {
        let finite = self.write(nominal, elsewhere.as_deref_mut());
        // Only where one is not finite it is looked for.
        if finite.is_finite() {
            return Ok(());
        }
        check_result(elsewhere.unwrap_or(&mut self.result.forward), step)
    }
}

/// # Errors
/// [`Error::Overflow`] of the first derivative that is not finite.
pub(crate) fn check_result<M: Dae, T: Real>(result: &Forward<M, T>, step: usize) -> Result<(), Error> {
    for values in [
        result.dx_dx0.as_slice(),
        result.dx_du.as_slice(),
        result.dx_dp.as_slice(),
        result.dz_dx0.as_slice(),
        result.dz_du.as_slice(),
        result.dz_dp.as_slice(),
        result.dz0_dx0.as_slice(),
        result.dz0_du.as_slice(),
        result.dz0_dp.as_slice(),
    ] {
        check(values, step)?;
    }
    Ok(())
}

impl<M: Dae, E: Lanes, const S: usize> ForwardMemory<M, E, S> {
    /// `∇(λᵀx)` from the derivatives of `x`.
    pub(crate) fn multiply(&mut self, lambda: &[E]) {
        let ForwardAdjoint { forward, grad_x0, grad_u, grad_p } = &mut self.result;
        for (matrix, gradient) in [
            (forward.dx_dx0.as_slice(), grad_x0.as_mut_slice()),
            (forward.dx_du.as_slice(), grad_u.as_mut_slice()),
            (forward.dx_dp.as_slice(), grad_p.as_mut_slice()),
        ] {
            dispatch(Product { lambda, matrix, gradient });
        }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardMemory<M, T, S> {
    /// `∇(λᵀx)` from the derivatives of `x`.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn gradient(&mut self, lambda: &[T]) -> Result<(), Error> {
        self.multiply(lambda);
        let ForwardAdjoint { grad_x0, grad_u, grad_p, .. } = &self.result;
        check(grad_x0.as_slice(), 0)?;
        check(grad_u.as_slice(), 0)?;
        check(grad_p.as_slice(), 0)
    }
}

/// `gradientᵀ = λᵀ S`, with `S` column after column.
struct Product<'a, E> {
    lambda: &'a [E],
    matrix: &'a [E],
    gradient: &'a mut [E],
}

impl<E: Lanes> Kernel for Product<'_, E> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { lambda, matrix, gradient } = self;
        gradient.fill(E::from_f64(0.0));
        // A model without states has no columns to go through.
        let columns = matrix.chunks_exact(lambda.len().max(1));
        for (gradient, column) in gradient.iter_mut().zip(columns) {
            for (&lambda, &s) in lambda.iter().zip(column) {
                *gradient = *gradient + lambda * s;
            }
        }
    }
}

/// Three matrices of derivatives with respect to `x₀`, `u` and `p`, column after column.
pub(crate) struct Split<'a, M, T> {
    matrices: [&'a mut [T]; 3],
    rows: usize,
    model: PhantomData<M>,
}

impl<'a, M: Dae, T: Lanes> Split<'a, M, T> {
    fn new<X: Matrix<T>>(x: &'a mut X, u: &'a mut impl Matrix<T>, p: &'a mut impl Matrix<T>) -> Self {
        let matrices = [x.as_mut_slice(), u.as_mut_slice(), p.as_mut_slice()];
        Self { matrices, rows: X::ROWS, model: PhantomData }
    }

    /// The column of `dw_index`.
    #[inline(always)]
    fn direction(&mut self, index: usize) -> &mut [T] {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        let [x, u, p] = &mut self.matrices;
        let (matrix, column) = if index < nx {
            (x, index)
        } else if index < nx + nu {
            (u, index - nx)
        } else {
            (p, index - nx - nu)
        };
        matrix.get_mut(column * self.rows..(column + 1) * self.rows).unwrap_or_default()
    }

    /// The columns of `dx₊` in directions that have no influence.
    fn fill_others(&mut self) {
        for (index, &column) in M::STRUCTURE.column_of_direction.iter().enumerate() {
            if column == NO_COLUMN {
                let column = self.direction(index);
                column.fill(T::from_f64(0.0));
                if let Some(element) = column.get_mut(index) {
                    *element = T::from_f64(1.0);
                }
            }
        }
    }
}

impl<M: Dae, T: Lanes> Target<T> for Split<'_, M, T> {
    #[inline(always)]
    fn column(&mut self, column: usize) -> &mut [T] {
        self.direction(M::STRUCTURE.directions.get(column).map_or(0, |&index| index as usize))
    }
}

/// A row for each direction.
#[cfg(feature = "alloc")]
struct Rows<'a, M: Dae, T: Plain> {
    rows: &'a mut ArrayW<M, ArrayX<M, T>>,
}

#[cfg(feature = "alloc")]
impl<M: Dae, T: Real> Target<T> for Rows<'_, M, T> {
    #[inline(always)]
    fn column(&mut self, column: usize) -> &mut [T] {
        let direction = M::STRUCTURE.directions.get(column).map_or(0, |&index| index as usize);
        self.rows.as_mut().get_mut(direction).map_or(&mut [], |row| row.as_mut())
    }
}

/// One matrix, column after column.
struct Single<'a, T> {
    matrix: &'a mut [T],
    rows: usize,
}

impl<T: Lanes> Target<T> for Single<'_, T> {
    #[inline(always)]
    fn column(&mut self, column: usize) -> &mut [T] {
        self.matrix.get_mut(column * self.rows..(column + 1) * self.rows).unwrap_or_default()
    }
}

/// Memory of sensitivities in `C` directions.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct DirectionalMemory<M: Dae, T: Plain, const S: usize, const C: usize> {
    pub(crate) result: Directional<M, T, C>,
    sweep: Sweep<M, T, [T; C], S>,
    /// The seeds, one row for each element of `w`.
    seeds: ArrayW<M, [T; C]>,
}
copy!([M: Dae, T: Plain, const S: usize, const C: usize] DirectionalMemory<M, T, S, C>);

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
        work: &mut Work<M, T, S, F>,
        coefficients: &Coefficients<T, S>,
        n: usize,
        count: usize,
        statistics: &mut Statistics,
    ) -> Result<(), Error> {
        let Self { result, sweep, seeds } = self;
        let directions = &Seeded(seeds.as_ref());
        if n == 0 {
            sweep.start(directions);
        }
        if !sweep.step(work, coefficients, directions, n == 0, None) && work.linear.factors.is_planned() {
            work.factor_pivoted(coefficients, n, 0, statistics)?;
            sweep.repeat(work, coefficients, directions, n == 0, None);
        }
        let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
        if n == 0 {
            let to = &mut Single { matrix: result.dz0.as_mut_slice(), rows: nz };
            sweep.write_algebraic::<Seeded<'_, T, C>>(&coefficients.start, to);
        }
        if n + 1 == count {
            let to = &mut Single { matrix: result.dz.as_mut_slice(), rows: nz };
            sweep.write_algebraic::<Seeded<'_, T, C>>(&coefficients.end, to);
            let to = &mut Single { matrix: result.dx.as_mut_slice(), rows: nx };
            sweep.write_end::<Seeded<'_, T, C>>(to);
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish<F: Fallback>(&mut self, work: &Work<M, T, S, F>, step: usize) -> Result<(), Error> {
        self.result.nominal = work.result;
        check(self.result.dx.as_slice(), step)?;
        check(self.result.dz.as_slice(), step)?;
        check(self.result.dz0.as_slice(), step)
    }
}
