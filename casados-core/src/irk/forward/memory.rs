//! Forward sensitivities: implicit function theorem at the converged stages.
//!
//! ```text
//! J dK = −(f_x,i V_n + f_w,i)        V_{n+1} = V_n + h Σ_i b_i dk_i
//! ```
//!
//! `V_n = dx_n/dw`, one row per state, all directions `w` side by side.

use super::output::Target;
use super::sweep::{Linearized, Outputs, Sweep};
use crate::error::Error;
use crate::finite::check_output;
use crate::irk::coefficients::Coefficients;
use crate::irk::directions::{Identity, Seeded};
use crate::irk::driver::Parts;
use crate::irk::workspace::{Linearization, Work, copy};
use crate::linalg::{Arithmetic, Kernel, dispatch};
use crate::memory::{Fallback, Family};
#[cfg(feature = "alloc")]
use crate::model::ArrayX;
use crate::model::{ArrayW, Dae, NO_COLUMN};
use crate::result::{DenseForward, Directional, Forward, ForwardAdjoint, Nominal, Seeds};
use crate::scalar::{Lanes, Real};
use crate::shape::{Matrix, Plain, Shape};
use bytemuck::Zeroable;
use core::marker::PhantomData;
use core::mem::take;

/// Memory of forward sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: ForwardAdjoint<M, T>,
    pub(crate) dense: DenseForward<M, T>,
    pub(crate) pass: ForwardPass<M, T, S>,
}
copy!([M: Dae, T: Plain, const S: usize] ForwardMemory<M, T, S>);

/// A pass over the steps, which writes to results elsewhere.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct ForwardPass<M: Dae, T: Plain, const S: usize> {
    pub(crate) sweep: Sweep<M, T, ArrayW<M, T>, S>,
    /// Zero if all derivatives of `z` are finite, else NaN.
    finite: [T; 1],
}
copy!([M: Dae, T: Plain, const S: usize] ForwardPass<M, T, S>);

impl<M: Dae, E: Lanes, const S: usize> ForwardPass<M, E, S> {
    /// A step that is linearised, by the factors that were `kept` or are there, as
    /// [`ForwardPass::step`]; whether the derivatives satisfy their equations.
    pub(crate) fn advance<F: Fallback>(
        &mut self,
        work: &mut Work<M, E, S, F>,
        kept: Option<&Linearization<M, E, S, F>>,
        coefficients: &Coefficients<E, S>,
        at: StepOf,
        curved: Option<&mut [E]>,
        to: &mut Forward<M, E>,
    ) -> E::Mask {
        let of = at.linearized(kept, coefficients);
        if at.n == 0 {
            self.sweep.start(of.directions);
        }
        let good = self.sweep.step(work, of, &mut at.outputs(curved, to));
        self.collect(coefficients, at, to);
        good
    }

    /// What a step contributes to derivatives of `z`.
    fn collect(&mut self, coefficients: &Coefficients<E, S>, at: StepOf, to: &mut Forward<M, E>) {
        let Self { sweep, finite: [finite] } = self;
        if at.n == 0 {
            let to = &mut Split::<M, _>::new(&mut to.dz0_dx0, &mut to.dz0_du, &mut to.dz0_dp);
            *finite = sweep.write_algebraic::<Identity<M>>(&coefficients.start, to);
        }
        if at.is_last() {
            let to = &mut Split::<M, _>::new(&mut to.dz_dx0, &mut to.dz_du, &mut to.dz_dp);
            *finite = *finite + sweep.write_algebraic::<Identity<M>>(&coefficients.end, to);
        }
    }

    /// What is left to be written after the last step. Zero if all derivatives are finite, else
    /// NaN.
    pub(crate) fn end(&self, nominal: &Nominal<M, E>, to: &mut Forward<M, E>) -> E {
        to.nominal = *nominal;
        Split::<M, _>::new(&mut to.dx_dx0, &mut to.dx_du, &mut to.dx_dp).fill_others();
        let ([of_x], [of_z]) = (self.sweep.finite, self.finite);
        of_x + of_z
    }
}

/// Which step of how many.
#[derive(Clone, Copy)]
pub(crate) struct StepOf {
    pub n: usize,
    pub count: usize,
    /// Whether the result may be in no cache.
    pub distant: bool,
}

impl StepOf {
    pub(crate) fn is_last(self) -> bool {
        self.n + 1 == self.count
    }

    /// The step, which goes through in all directions.
    fn linearized<'a, M: Dae, E: Lanes, const S: usize, F: Fallback>(
        self,
        kept: Option<&'a Linearization<M, E, S, F>>,
        coefficients: &'a Coefficients<E, S>,
    ) -> Linearized<'a, M, E, Identity<M>, S, F> {
        Linearized { kept, coefficients, directions: &Identity::ALL, first: self.n == 0 }
    }

    /// What the step writes.
    fn outputs<'a, M: Dae, E: Lanes>(
        self,
        curved: Option<&'a mut [E]>,
        to: &'a mut Forward<M, E>,
    ) -> Outputs<'a, E, Split<'a, M, E>> {
        let end = self.is_last().then(|| Split::new(&mut to.dx_dx0, &mut to.dx_du, &mut to.dx_dp));
        Outputs { curved, end, distant: self.distant }
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardPass<M, T, S> {
    /// After a step that is linearised; refined where digits were lost, if that is asked for. The
    /// last one writes derivatives of `x` to the result, the first and the last those of `z`.
    ///
    /// # Errors
    /// [`Error::Singular`]
    pub(crate) fn step<F: Fallback, const REFINED: bool>(
        &mut self,
        parts: &mut Parts<'_, M, T, S, F>,
        at: StepOf,
        mut curved: Option<&mut [T]>,
        to: &mut Forward<M, T>,
    ) -> Result<(), Error> {
        let Parts { work, coefficients, statistics, .. } = parts;
        let good = self.advance(work, None, coefficients, at, curved.as_deref_mut(), to);
        if good && !REFINED {
            return Ok(());
        }
        let of = at.linearized(None, coefficients);
        if !good && work.linear.factors.is_planned() {
            work.factor_pivoted(coefficients, at.n, 0, statistics)?;
            self.sweep.repeat(work, of, &mut at.outputs(curved, to));
        }
        if const { REFINED } {
            self.sweep.refine(work, of, &mut at.outputs(None, to));
        }
        self.collect(coefficients, at, to);
        Ok(())
    }

    /// What is left to be written after the last step.
    ///
    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(
        &self,
        nominal: &Nominal<M, T>,
        step: usize,
        to: &mut Forward<M, T>,
    ) -> Result<(), Error> {
        // Only where one is not finite it is looked for.
        if self.end(nominal, to).is_finite() { Ok(()) } else { check_result(to, step) }
    }

    /// The derivatives of `Σ_i weight_i k_i` of the last step, a row for each direction.
    #[cfg(feature = "alloc")]
    pub(crate) fn slopes(&self, weights: &[T; S], to: &mut ArrayW<M, ArrayX<M, T>>) {
        for direction in to.as_mut() {
            direction.as_mut().fill(T::ZERO);
        }
        self.sweep.write_slopes::<Identity<M>>(weights, &mut Rows::<M, T> { rows: to });
    }
}

impl<M: Dae, T: Real, const S: usize> ForwardMemory<M, T, S> {
    /// Derivatives at a point of the last step.
    pub(crate) fn interpolate(&mut self, weights: &[T; S], lagrange: &[T; S]) {
        let Self { dense, pass: ForwardPass { sweep, .. }, .. } = self;
        let to = &mut Split::<M, _>::new(&mut dense.dx_dx0, &mut dense.dx_du, &mut dense.dx_dp);
        to.fill_others();
        sweep.write_differential::<Identity<M>>(weights, to);
        let to = &mut Split::<M, _>::new(&mut dense.dz_dx0, &mut dense.dz_du, &mut dense.dz_dp);
        sweep.write_algebraic::<Identity<M>>(lagrange, to);
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
        check_output(values, step)?;
    }
    Ok(())
}

/// `∇(λᵀx)` from the derivatives of `x`.
pub(crate) fn multiply<M: Dae, E: Lanes>(result: &mut ForwardAdjoint<M, E>, lambda: &[E]) {
    let ForwardAdjoint { forward, grad_x0, grad_u, grad_p } = result;
    for (matrix, gradient) in [
        (forward.dx_dx0.as_slice(), grad_x0.as_mut_slice()),
        (forward.dx_du.as_slice(), grad_u.as_mut_slice()),
        (forward.dx_dp.as_slice(), grad_p.as_mut_slice()),
    ] {
        dispatch(Product { lambda, matrix, gradient });
    }
}

/// `∇(λᵀx)` from the derivatives of `x`.
///
/// # Errors
/// [`Error::Overflow`]
pub(crate) fn gradient<M: Dae, T: Real>(
    result: &mut ForwardAdjoint<M, T>,
    lambda: &[T],
) -> Result<(), Error> {
    multiply(result, lambda);
    check_output(result.grad_x0.as_slice(), 0)?;
    check_output(result.grad_u.as_slice(), 0)?;
    check_output(result.grad_p.as_slice(), 0)
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

    /// To which matrix `dw_index` belongs, and its column there.
    #[inline(always)]
    fn place(index: usize) -> (usize, usize) {
        let (nx, nu) = (M::Shape::NX, M::Shape::NU);
        if index < nx {
            (0, index)
        } else if index < nx + nu {
            (1, index - nx)
        } else {
            (2, index - nx - nu)
        }
    }

    /// The columns of `dx₊` in directions that have no influence.
    fn fill_others(&mut self) {
        for (index, &column) in M::STRUCTURE.column_of_direction.iter().enumerate() {
            if column == NO_COLUMN {
                let ((part, column), rows) = (Self::place(index), self.rows);
                let matrix = self.matrices.get_mut(part);
                let column = matrix.and_then(|matrix| matrix.get_mut(column * rows..(column + 1) * rows));
                let column = column.unwrap_or_default();
                column.fill(T::from_f64(0.0));
                if let Some(element) = column.get_mut(index) {
                    *element = T::from_f64(1.0);
                }
            }
        }
    }
}

impl<M: Dae, T: Lanes> Target<T> for Split<'_, M, T> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn columns<const W: usize>(&mut self, column: usize) -> [&mut [T]; W] {
        let mut columns: [&mut [T]; W] = core::array::from_fn(|_| Default::default());
        // What is behind the last column of each: directions ascend.
        let [x, u, p] = &mut self.matrices;
        let mut rest = [(0, &mut **x), (0, &mut **u), (0, &mut **p)];
        let directions = M::STRUCTURE.directions.get(column..).unwrap_or_default();
        for (to, &direction) in columns.iter_mut().zip(directions) {
            let (part, own) = Self::place(direction as usize);
            let Some((next, rest)) = rest.get_mut(part) else { continue };
            let from = take(rest).get_mut((own - *next) * self.rows..).unwrap_or_default();
            (*to, *rest) = from.split_at_mut_checked(self.rows).unwrap_or_default();
            *next = own + 1;
        }
        columns
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn following<const W: usize>(&self, column: usize) -> &[T] {
        let Some(&first) = M::STRUCTURE.directions.get(column + W) else { return &[] };
        let (part, own) = Self::place(first as usize);
        let from = self.matrices.get(part).and_then(|matrix| matrix.get(own * self.rows..));
        let from = from.unwrap_or_default();
        from.get(..W * self.rows).unwrap_or(from)
    }
}

/// A row for each direction.
#[cfg(feature = "alloc")]
struct Rows<'a, M: Dae, T: Plain> {
    rows: &'a mut ArrayW<M, ArrayX<M, T>>,
}

#[cfg(feature = "alloc")]
impl<M: Dae, T: Real> Target<T> for Rows<'_, M, T> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn columns<const W: usize>(&mut self, column: usize) -> [&mut [T]; W] {
        let mut columns: [&mut [T]; W] = core::array::from_fn(|_| Default::default());
        let (mut next, mut rest) = (0, self.rows.as_mut());
        let directions = M::STRUCTURE.directions.get(column..).unwrap_or_default();
        for (to, &direction) in columns.iter_mut().zip(directions) {
            let from = take(&mut rest).get_mut(direction as usize - next..).unwrap_or_default();
            if let Some((own, behind)) = from.split_first_mut() {
                (*to, rest, next) = (own.as_mut(), behind, direction as usize + 1);
            }
        }
        columns
    }
}

/// One matrix, column after column.
struct Single<'a, T> {
    matrix: &'a mut [T],
    rows: usize,
}

impl<T: Lanes> Target<T> for Single<'_, T> {
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn columns<const W: usize>(&mut self, column: usize) -> [&mut [T]; W] {
        let mut columns: [&mut [T]; W] = core::array::from_fn(|_| Default::default());
        let matrix = self.matrix.get_mut(column * self.rows..).unwrap_or_default();
        // A model without states has no columns to go through.
        for (to, own) in columns.iter_mut().zip(matrix.chunks_exact_mut(self.rows.max(1))) {
            *to = own;
        }
        columns
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
        let of = Linearized { kept: None, coefficients, directions: &Seeded(seeds.as_ref()), first: n == 0 };
        if n == 0 {
            sweep.start(of.directions);
        }
        let nx = M::Shape::NX;
        let end = (n + 1 == count).then(|| Single { matrix: result.dx.as_mut_slice(), rows: nx });
        let outputs = &mut Outputs { curved: None, end, distant: false };
        if !sweep.step(work, of, outputs) && work.linear.factors.is_planned() {
            work.factor_pivoted(coefficients, n, 0, statistics)?;
            sweep.repeat(work, of, outputs);
        }
        let nz = M::Shape::NZ;
        if n == 0 {
            let to = &mut Single { matrix: result.dz0.as_mut_slice(), rows: nz };
            sweep.write_algebraic::<Seeded<'_, T, C>>(&coefficients.start, to);
        }
        if n + 1 == count {
            let to = &mut Single { matrix: result.dz.as_mut_slice(), rows: nz };
            sweep.write_algebraic::<Seeded<'_, T, C>>(&coefficients.end, to);
        }
        Ok(())
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
