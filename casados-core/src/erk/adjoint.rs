//! The discrete adjoint: backwards over the steps and over the stages of each.
//!
//! ```text
//! k̄_i = h (b_i λ_{n+1} + Σ_{j>i} a_ji ξ̄_j)      ξ̄_i = g_xᵀ k̄_i
//! λ_n = λ_{n+1} + Σ_i ξ̄_i                       λ_w += Σ_i g_wᵀ k̄_i
//! ```

use super::forward::Variation;
use super::step::{Grid, Point, Record, Scheme, add, check};
use crate::error::{Error, Place, Quantity};
use crate::model::{ArrayK, ArrayV, ArrayW, Ode};
use crate::quadrature::Along;
use crate::scalar::Real;
use crate::shape::{Array, Shape};
use bytemuck::Zeroable;

/// The adjoint variables of a step, one column per seed: `R` is the longest row, of which the first
/// `columns` elements are used.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct Sweep<M: Ode, T: Real, R: Array<T>, const S: usize> {
    /// The memory of the forward sweep, which is never needed at the same time: `k̄_i` of the
    /// current stage is in `dxi`, `ξ̄_i` in `dk`.
    pub forward: Variation<M, T, R, S>,
    gradient: ArrayV<M, T>,
    /// `(λ_n, λ_u, λ_p)`
    pub lambda: ArrayW<M, R>,
}

/// The way back over the steps.
pub(super) struct Way<'a, M: Ode, T: Real, const S: usize> {
    pub scheme: &'a Scheme<M, T, S>,
    pub grid: Grid<T>,
    /// How many seeds there are.
    pub columns: usize,
}

impl<M: Ode, T: Real, R: Array<T>, const S: usize> Sweep<M, T, R, S> {
    /// Seeds: of each state the columns.
    pub fn seed(&mut self, columns: usize, seed: impl Fn(usize, usize) -> T) {
        for (x, lambda) in self.lambda.as_mut()[..M::Shape::NX].iter_mut().enumerate() {
            for (column, value) in lambda.as_mut()[..columns].iter_mut().enumerate() {
                *value = seed(x, column);
            }
        }
    }

    /// Back over all recorded steps, from `lambda` to `lambda`. `multipliers` keeps the `μ_i` of
    /// every stage for the Hessian. An integrand takes part if there is one seed.
    pub fn run(
        &mut self,
        way: Way<'_, M, T, S>,
        point: &mut Point<M, T>,
        records: &[Record<M, T, S>],
        mut multipliers: Option<&mut [[ArrayK<M, T>; S]]>,
        along: &mut Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        let columns = way.columns.min(R::LEN);
        M::jacobian_constants::<T>(&mut self.forward.jacobian);
        for lambda in &mut self.lambda.as_mut()[M::Shape::NX..] {
            lambda.as_mut()[..columns].fill(T::ZERO);
        }
        for (step, record) in records.iter().enumerate().rev() {
            let multipliers = multipliers.as_deref_mut().and_then(|of_steps| of_steps.get_mut(step));
            self.step(&way, point, (step, record), multipliers, along)?;
        }
        Ok(())
    }

    fn step(
        &mut self,
        &Way { scheme, grid, columns }: &Way<'_, M, T, S>,
        point: &mut Point<M, T>,
        (step, record): (usize, &Record<M, T, S>),
        mut multipliers: Option<&mut [ArrayK<M, T>; S]>,
        along: &mut Along<'_, '_, M, T>,
    ) -> Result<(), Error> {
        let columns = columns.min(R::LEN);
        for stage in (0..S).rev() {
            let at = Place { step, stage, iteration: 0 };
            self.stage_seed(scheme, grid.h, stage, columns);
            point.go(scheme, grid, record, at)?;
            if columns == 1 {
                let mu = ArrayK::<M, T>::from_fn(|equation| {
                    let row = scheme.rows[equation];
                    let kbar =
                        self.forward.dxi.as_ref().get(row.state).map_or(T::ZERO, |kbar| kbar.as_ref()[0]);
                    row.factor * kbar
                });
                self.pull_one(point, &mu, at)?;
                if let Some(integrand) = along {
                    // ξ̄_i += h b_i φ_x, λ_w += h b_i φ_w
                    point.show(&mut **integrand);
                    let gradient = integrand.adjoint(grid.h * scheme.b[stage], at)?;
                    add(T::ONE, gradient, self.gradient.as_mut());
                }
                self.keep(stage);
                if let Some(multipliers) = &mut multipliers {
                    multipliers[stage] = mu;
                }
            } else {
                point.jacobian(&mut self.forward.jacobian, at)?;
                self.pull_many(scheme, stage, columns);
            }
        }
        let (lambda, xibars) = (&mut self.lambda.as_mut()[..M::Shape::NX], &self.forward.dk);
        for xibar in xibars {
            add_rows(T::ONE, xibar.as_ref(), lambda, columns);
        }
        Ok(())
    }

    /// `k̄_i = h (b_i λ_{n+1} + Σ_{j>i} a_ji ξ̄_j)`
    fn stage_seed(&mut self, scheme: &Scheme<M, T, S>, h: T, stage: usize, columns: usize) {
        let Variation { dk, dxi, .. } = &mut self.forward;
        let kbar = dxi.as_mut();
        for row in &mut *kbar {
            row.as_mut()[..columns].fill(T::ZERO);
        }
        add_rows(h * scheme.b[stage], self.lambda.as_ref(), kbar, columns);
        for (a, xibar) in scheme.a.iter().zip(&*dk).skip(stage + 1) {
            if a[stage] != T::ZERO {
                add_rows(h * a[stage], xibar.as_ref(), kbar, columns);
            }
        }
    }

    /// `∇(μᵀ f)` by reverse mode.
    fn pull_one(&mut self, point: &Point<M, T>, mu: &ArrayK<M, T>, at: Place) -> Result<(), Error> {
        M::adjoint::<T>(&point.v, mu, &mut self.gradient);
        check(self.gradient.as_ref(), Quantity::Adjoint, at, |variable| variable)
    }

    /// The gradient to where it belongs: `ξ̄_i` and `λ_w`.
    fn keep(&mut self, stage: usize) {
        let nx = M::Shape::NX;
        for (x, xibar) in self.forward.dk[stage].as_mut().iter_mut().enumerate() {
            xibar.as_mut()[0] = self.gradient[nx + x];
        }
        for w in nx..M::Shape::NW {
            let lambda = self.lambda[w].as_mut();
            lambda[0] = lambda[0] + self.gradient[nx + w];
        }
    }

    /// Products with the Jacobian, one evaluation for all seeds.
    fn pull_many(&mut self, scheme: &Scheme<M, T, S>, stage: usize, columns: usize) {
        let nx = M::Shape::NX;
        let Variation { dk, dxi, jacobian, .. } = &mut self.forward;
        let Some(xibar) = dk.get_mut(stage) else { return };
        for row in xibar.as_mut() {
            row.as_mut()[..columns].fill(T::ZERO);
        }
        for entry in M::STRUCTURE.blocks[1]..M::STRUCTURE.blocks[5] {
            let (equation, variable) = M::STRUCTURE.jacobian.at(entry);
            let w = variable - nx;
            let sum = if w < nx { xibar.as_mut().get_mut(w) } else { self.lambda.as_mut().get_mut(w) };
            let (Some(sum), Some(&value), Some(row)) =
                (sum, jacobian.as_ref().get(entry), scheme.rows.as_ref().get(equation))
            else {
                continue;
            };
            if let Some(kbar) = dxi.as_ref().get(row.state) {
                add(row.factor * value, &kbar.as_ref()[..columns], sum.as_mut());
            }
        }
    }
}

/// `sums += a rows`, the first columns of them.
#[inline(always)]
fn add_rows<T: Real, R: Array<T>>(a: T, rows: &[R], sums: &mut [R], columns: usize) {
    if R::LEN == 1 {
        // Numbers next to each other: no loop over columns.
        return add(a, R::flat(rows), R::flat_mut(sums));
    }
    for (sum, row) in sums.iter_mut().zip(rows) {
        add(a, &row.as_ref()[..columns], &mut sum.as_mut()[..columns]);
    }
}
