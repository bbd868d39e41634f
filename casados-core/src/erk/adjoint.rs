//! The discrete adjoint, computed backwards over the steps and their stages.
//!
//! ```text
//! k̄_i = h (b_i λ_{n+1} + Σ_{j>i} a_ji ξ̄_j)      ξ̄_i = g_xᵀ k̄_i
//! λ_n = λ_{n+1} + Σ_i ξ̄_i                       λ_w += Σ_i g_wᵀ k̄_i
//! ```

use super::forward::Variation;
use super::scheme::{Grid, Scheme, is_zero};
use super::stage_integrand::StageIntegrand;
use super::step::{StagePoint, StepRecord, UnitStride, add};
use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, kernels, run_plain};
use crate::model::{ArrayK, ArrayV, ArrayW, ArrayX, Ode};
use crate::scalar::Lanes;
use crate::shape::{Array, InBounds, Shape};
use bytemuck::Zeroable;

/// The adjoint variables of a step, one column per seed. `R` is a row of maximal length, of which
/// the first `columns` elements are used.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct AdjointSweep<M: Ode, E: Lanes, R: Array<E>, const S: usize> {
    /// The memory of the forward sweep, which is never used at the same time: `dxi` holds `k̄_i` of
    /// the current stage, `dk` the `ξ̄_i`.
    pub forward: Variation<M, E, R, S>,
    gradient: ArrayV<M, [E; 1]>,
    /// `(λ_n, λ_u, λ_p)`
    pub lambda: ArrayW<M, R>,
}

/// The multipliers `μ_i` of the stages of a step.
pub(super) type Multipliers<M, E, const S: usize> = [ArrayK<M, [E; 1]>; S];

/// The backward sweep over the steps.
pub(super) struct AdjointProblem<'a, M: Ode, E: Lanes, const S: usize> {
    pub scheme: &'a Scheme<M, E, S>,
    pub grid: &'a Grid<E>,
    /// Number of seeds.
    pub columns: usize,
}

impl<M: Ode, E: Lanes, R: Array<E>, const S: usize> AdjointSweep<M, E, R, S> {
    /// Sets the seeds; `seed` is called with a state and a column.
    pub fn set_seeds(&mut self, columns: usize, seed: impl Fn(usize, usize) -> E) {
        for (x, lambda) in self.lambda.as_mut()[..M::Shape::NX].iter_mut().enumerate() {
            for (column, value) in lambda.as_mut()[..columns].iter_mut().enumerate() {
                *value = seed(x, column);
            }
        }
    }

    /// Integrates backwards over all recorded steps; updates `lambda`. Stores the `μ_i` of every
    /// stage in `multipliers` for the Hessian. With one seed it includes an integrand.
    pub fn integrate_backwards(
        &mut self,
        problem: AdjointProblem<'_, M, E, S>,
        point: &mut StagePoint<M, E>,
        records: &[StepRecord<M, E, S>],
        mut multipliers: Option<&mut [Multipliers<M, E, S>]>,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> Result<(), Error> {
        let columns = problem.columns.min(R::LEN);
        M::jacobian_constants::<UnitStride<E>>(&mut self.forward.jacobian);
        for lambda in &mut self.lambda.as_mut()[M::Shape::NX..] {
            lambda.as_mut()[..columns].fill(E::zeroed());
        }
        for (step, record) in records.iter().enumerate().rev() {
            let multipliers = multipliers.as_deref_mut().and_then(|of_steps| of_steps.get_mut(step));
            self.step_backwards(&problem, point, (step, record), multipliers, integrand)?;
        }
        Ok(())
    }

    fn step_backwards(
        &mut self,
        &AdjointProblem { scheme, grid, columns }: &AdjointProblem<'_, M, E, S>,
        point: &mut StagePoint<M, E>,
        (step, record): (usize, &StepRecord<M, E, S>),
        mut multipliers: Option<&mut Multipliers<M, E, S>>,
        integrand: &mut impl StageIntegrand<M, E>,
    ) -> Result<(), Error> {
        let columns = columns.min(R::LEN);
        for stage in (0..S).rev() {
            let at = Place { step, stage, iteration: 0 };
            let Self { forward: Variation { dk, dxi, jacobian, .. }, gradient, lambda } = self;
            stage_seed::<M, E, R, S>(scheme, (&grid.h, stage, columns), &*lambda, &*dk, dxi);
            point.move_to_stage(scheme, grid, record, at)?;
            if columns == 1 {
                let mut mu = ArrayK::<M, [E; 1]>::zeroed();
                multiplier::<M, E, R, S>(scheme, &*dxi, &mut mu);
                // Computes `∇(μᵀ f)` by reverse mode.
                M::adjoint::<UnitStride<E>>(&point.v, &mu, gradient);
                // The derivative with respect to `ẋ` is a multiple of `μ_i`, which is not used.
                let nx = M::Shape::NX;
                let used = gradient.as_ref().as_flattened().get(nx..).in_bounds().unwrap_or_default();
                point.check(used, Quantity::Adjoint, at, |variable| nx + variable)?;
                integrand.add_gradient(point.variables(), [grid.h, scheme.b[stage]], gradient, at)?;
                if let Some(xibar) = dk.get_mut(stage).in_bounds() {
                    keep::<M, E, R>(&*gradient, xibar, lambda);
                }
                if let Some(multipliers) = &mut multipliers {
                    multipliers[stage] = mu;
                }
            } else {
                point.jacobian(jacobian, at)?;
                if let Some(xibar) = dk.get_mut(stage).in_bounds() {
                    pull::<M, E, R, S>(scheme, &*jacobian, &*dxi, columns, (xibar, lambda));
                }
            }
        }
        advance::<M, E, R>(E::from_f64(1.0), &self.forward.dk, columns, &mut self.lambda);
        Ok(())
    }
}

kernels! { by run_plain;
    /// `k̄_i = h (b_i λ_{n+1} + Σ_{j>i} a_ji ξ̄_j)`
    fn stage_seed [M: Ode, E: Lanes, R: Array<E>, const S: usize] [M, E, R, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        of: (&'k E, usize, usize),
        lambda: &'k ArrayW<M, R>,
        xibars: &'k [ArrayX<M, R>; S],
        kbar: &'k mut ArrayX<M, R>,
    ) {
        let ((&h, stage, columns), kbar) = (of, kbar.as_mut());
        for row in &mut *kbar {
            row.as_mut()[..columns].fill(E::zeroed());
        }
        add_rows::<A, E, R>(h * scheme.b[stage], lambda.as_ref(), kbar, columns);
        for (a, xibar) in scheme.a.iter().zip(xibars).skip(stage + 1) {
            if !is_zero(a[stage]) {
                add_rows::<A, E, R>(h * a[stage], xibar.as_ref(), kbar, columns);
            }
        }
    }

    /// Computes `μ_i`, in the order of the equations.
    fn multiplier [M: Ode, E: Lanes, R: Array<E>, const S: usize] [M, E, R, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        kbar: &'k ArrayX<M, R>,
        mu: &'k mut ArrayK<M, [E; 1]>,
    ) {
        for (mu, row) in mu.as_mut().iter_mut().zip(scheme.equations.as_ref()) {
            let kbar = kbar.as_ref().get(row.state).in_bounds().map_or(E::zeroed(), |kbar| kbar.as_ref()[0]);
            *mu = [row.factor * kbar];
        }
    }

    /// Adds the parts of the gradient to `ξ̄_i` and `λ_w`.
    fn keep [M: Ode, E: Lanes, R: Array<E>] [M, E, R] <A>(
        gradient: &'k ArrayV<M, [E; 1]>,
        xibar: &'k mut ArrayX<M, R>,
        lambda: &'k mut ArrayW<M, R>,
    ) {
        let nx = M::Shape::NX;
        for (x, xibar) in xibar.as_mut().iter_mut().enumerate() {
            [xibar.as_mut()[0]] = gradient[nx + x];
        }
        for w in nx..M::Shape::NW {
            let (lambda, [own]) = (lambda[w].as_mut(), gradient[nx + w]);
            lambda[0] = lambda[0] + own;
        }
    }

    /// Computes `ξ̄_i` and `λ_w` by products with the Jacobian, evaluated once for all seeds.
    fn pull [M: Ode, E: Lanes, R: Array<E>, const S: usize] [M, E, R, S] <A>(
        scheme: &'k Scheme<M, E, S>,
        jacobian: &'k M::Jacobian<[E; 1]>,
        kbar: &'k ArrayX<M, R>,
        columns: usize,
        to: (&'k mut ArrayX<M, R>, &'k mut ArrayW<M, R>),
    ) {
        let (nx, (xibar, lambda)) = (M::Shape::NX, to);
        for row in xibar.as_mut() {
            row.as_mut()[..columns].fill(E::zeroed());
        }
        for entry in M::STRUCTURE.blocks[1]..M::STRUCTURE.blocks[5] {
            let (equation, variable) = M::STRUCTURE.jacobian.at(entry);
            let w = variable - nx;
            let sum = if w < nx { xibar.as_mut().get_mut(w) } else { lambda.as_mut().get_mut(w) };
            let (Some(sum), Some(&[value]), Some(row)) =
                (sum, jacobian.as_ref().get(entry).in_bounds(), scheme.equations.as_ref().get(equation).in_bounds())
            else {
                continue;
            };
            if let Some(kbar) = kbar.as_ref().get(row.state).in_bounds() {
                add::<A, E>(row.factor * value, &kbar.as_ref()[..columns], sum.as_mut());
            }
        }
    }

    /// `λ_n = λ_{n+1} + Σ_i ξ̄_i`
    fn advance [M: Ode, E: Lanes, R: Array<E>] [M, E, R] <A>(
        one: E,
        xibars: &'k [ArrayX<M, R>],
        columns: usize,
        lambda: &'k mut ArrayW<M, R>,
    ) {
        let lambda = &mut lambda.as_mut()[..M::Shape::NX];
        for xibar in xibars {
            add_rows::<A, E, R>(one, xibar.as_ref(), lambda, columns);
        }
    }
}

/// `sums += a rows`, in the first `columns` columns.
#[inline(always)]
fn add_rows<A: Arithmetic, E: Lanes, R: Array<E>>(a: E, rows: &[R], sums: &mut [R], columns: usize) {
    if R::LEN == 1 {
        // Adjacent numbers: one loop over all elements.
        return add::<A, E>(a, R::flat(rows), R::flat_mut(sums));
    }
    for (sum, row) in sums.iter_mut().zip(rows) {
        add::<A, E>(a, &row.as_ref()[..columns], &mut sum.as_mut()[..columns]);
    }
}
