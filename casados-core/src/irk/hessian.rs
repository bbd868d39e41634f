//! Second-order sensitivities: symmetric, in one pass over the steps that the adjoint takes.
//!
//! ```text
//! d²(λᵀ x_N)/dw² = − Σ_n Σ_i D_iᵀ [∇²(μ_iᵀ f)_i] D_i
//! ```
//!
//! with `D_i = d(k_i, ξ_i, z_i, u, p)/dw` from the forward sweep. The product with the sparse matrix in
//! the middle comes first, `G = H D`, then the lower triangle of `Dᵀ G`.

use super::adjoint::Backward;
use super::forward::{ForwardMemory, Sweep};
use super::record::{Coefficients, Linearization, Step, Work, copy};
use super::step::check;
use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, Kernel, dispatch, slot};
use crate::model::{ArrayK, ArrayV, ArrayW, Dae, Pattern};
use crate::result::{ForwardAdjoint, Hessian};
use crate::scalar::Real;
use crate::shape::assign;
use crate::shape::{Array, Matrix, Plain, Shape};
use bytemuck::Zeroable;

/// Memory of second-order sensitivities.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianMemory<M: Dae, T: Plain, const S: usize> {
    pub(crate) result: Hessian<M, T>,
    pub(crate) backward: Backward<M, T, S, 1>,
    /// `D` at one stage.
    d: ArrayV<M, ArrayW<M, T>>,
    /// `G = H D` at one stage.
    g: ArrayV<M, ArrayW<M, T>>,
    /// The Hessian over `w`, its lower triangle.
    sum: ArrayW<M, ArrayW<M, T>>,
    /// `μ` at one stage.
    mu: ArrayK<M, T>,
    /// Entries of `∇²(μᵀ f)` at one stage.
    entries: M::Hessian<T>,
}
copy!([M: Dae, T: Plain, const S: usize] HessianMemory<M, T, S>);

/// What the way back needs of a step.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct HessianStep<M: Dae, T: Plain, const S: usize> {
    linear: Linearization<M, T, S>,
    sweep: Sweep<M, ArrayW<M, T>, S>,
}
copy!([M: Dae, T: Plain, const S: usize] HessianStep<M, T, S>);

impl<M: Dae, T: Real, const S: usize> HessianStep<M, T, S> {
    /// Remembers a step on the way forth.
    pub(crate) fn record(&mut self, work: &Work<M, T, S>, forward: &ForwardMemory<M, T, S>) {
        self.linear.copy_from(&work.linear);
        assign(&mut self.sweep, &forward.sweep);
    }
}

impl<M: Dae, T: Real, const S: usize> HessianMemory<M, T, S> {
    /// The way back.
    ///
    /// # Errors
    /// A second derivative of the model that is not finite.
    pub(crate) fn run(
        &mut self,
        work: &mut Work<M, T, S>,
        coefficients: &Coefficients<T, S>,
        steps: &[Step<M, T, S>],
        records: &[HessianStep<M, T, S>],
        seed: &[T],
    ) -> Result<(), Error> {
        self.backward.start(seed);
        for row in self.sum.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
        for (n, (step, record)) in steps.iter().zip(records).enumerate().rev() {
            self.backward.step(&record.linear, coefficients, work.inputs.time.step);
            work.place(coefficients, n, &step.x, &step.y);
            for stage in 0..S {
                for (equation, to) in self.mu.as_mut().iter_mut().enumerate() {
                    [*to] = self.backward.mu[slot::<M>(equation)][stage];
                }
                M::hessian::<T>(&work.points[stage], &self.mu, &mut self.entries);
                if let Some((entry, value)) = super::evaluate::not_finite(self.entries.as_ref()) {
                    return Err(Error::NonFiniteModel {
                        quantity: Quantity::Hessian,
                        equation: M::STRUCTURE.hessian.at(entry).0,
                        value,
                        at: Place { step: n, stage, iteration: 0 },
                    });
                }
                self.place_directions(&record.sweep, coefficients, work.inputs.time.step, stage);
                self.subtract();
            }
        }
        Ok(())
    }

    /// `D` at a stage.
    fn place_directions(
        &mut self,
        sweep: &Sweep<M, ArrayW<M, T>, S>,
        coefficients: &Coefficients<T, S>,
        h: T,
        stage: usize,
    ) {
        let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
        for state in 0..nx {
            self.d[state] = sweep.dy[state][stage];
            sweep.differential(state, h, &coefficients.a[stage], &mut self.d[nx + state]);
        }
        for state in 0..nz {
            self.d[2 * nx + state] = sweep.dy[nx + state][stage];
        }
        for w in nx..M::Shape::NW {
            let row = self.d[nx + nz + w].as_mut();
            row.fill(T::ZERO);
            row[w] = T::ONE;
        }
    }

    /// `sum −= Dᵀ H D`, the lower triangle.
    fn subtract(&mut self) {
        let Self { d, g, sum, entries, .. } = self;
        let (d, g, sum) = (d.as_ref(), g.as_mut(), sum.as_mut());
        dispatch(Subtract { pattern: M::STRUCTURE.hessian, entries: entries.as_ref(), d, g, sum });
    }

    /// # Errors
    /// [`Error::Overflow`]
    pub(crate) fn finish(&mut self, forward: &ForwardMemory<M, T, S>) -> Result<(), Error> {
        let (nx, nu, np) = (M::Shape::NX, M::Shape::NU, M::Shape::NP);
        let Self { result, backward, sum, .. } = self;
        assign(&mut result.first.forward, &forward.result.forward);
        for (to, [from]) in result.first.grad_x0.as_mut_slice().iter_mut().zip(backward.lambda.as_ref()) {
            *to = *from;
        }
        let mut gradient = backward.gradient.as_ref()[nx..].iter();
        for (to, [from]) in result.first.grad_u.as_mut_slice().iter_mut().zip(&mut gradient) {
            *to = *from;
        }
        for (to, [from]) in result.first.grad_p.as_mut_slice().iter_mut().zip(gradient) {
            *to = *from;
        }
        symmetric(&mut result.h_xx, sum.as_ref(), 0);
        symmetric(&mut result.h_uu, sum.as_ref(), nx);
        symmetric(&mut result.h_pp, sum.as_ref(), nx + nu);
        for x in 0..nx {
            for u in 0..nu {
                result.h_xu[(x, u)] = sum[nx + u][x];
            }
            for p in 0..np {
                result.h_xp[(x, p)] = sum[nx + nu + p][x];
            }
        }
        for u in 0..nu {
            for p in 0..np {
                result.h_up[(u, p)] = sum[nx + nu + p][nx + u];
            }
        }
        let ForwardAdjoint { grad_x0, grad_u, grad_p, .. } = &result.first;
        for values in [
            grad_x0.as_slice(),
            grad_u.as_slice(),
            grad_p.as_slice(),
            result.h_xx.as_slice(),
            result.h_xu.as_slice(),
            result.h_uu.as_slice(),
            result.h_xp.as_slice(),
            result.h_up.as_slice(),
            result.h_pp.as_slice(),
        ] {
            check(values, 0)?;
        }
        Ok(())
    }
}

/// `sum −= Dᵀ H D`, the lower triangle, with `H` given by its own.
struct Subtract<'a, T, R> {
    pattern: Pattern,
    entries: &'a [T],
    d: &'a [R],
    g: &'a mut [R],
    sum: &'a mut [R],
}

impl<T: Real, R: Array<T>> Kernel for Subtract<'_, T, R> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { pattern, entries, d, g, sum } = self;
        for row in g.iter_mut() {
            row.as_mut().fill(T::ZERO);
        }
        // G = −H D
        let mut add = |value: T, from: usize, to: usize| {
            if let (Some(from), Some(to)) = (d.get(from), g.get_mut(to)) {
                for (to, from) in to.as_mut().iter_mut().zip(from.as_ref()) {
                    *to = A::subtract(*to, value, *from);
                }
            }
        };
        let places = pattern.rows.iter().zip(pattern.columns);
        for ((&row, &column), &value) in places.zip(entries) {
            add(value, column as usize, row as usize);
            if row != column {
                add(value, row as usize, column as usize);
            }
        }
        // Rows of variables that no equation is curved in are zero: only the others count, four at a time.
        let mut rows = d.iter().zip(g.iter()).filter(|(_, g)| g.as_ref().iter().any(|g| *g != T::ZERO));
        let zero = R::from_fn(|_| T::ZERO);
        while let Some(first) = rows.next() {
            let mut next = || rows.next().unwrap_or((&zero, &zero));
            let four = [first, next(), next(), next()];
            let [(d0, g0), (d1, g1), (d2, g2), (d3, g3)] = four.map(|(d, g)| (d.as_ref(), g.as_ref()));
            let g = g0.iter().zip(g1).zip(g2).zip(g3);
            let d = d0.iter().zip(d1).zip(d2).zip(d3);
            for (w, (sum, (((&d0, &d1), &d2), &d3))) in sum.iter_mut().zip(d).enumerate() {
                for (sum, (((&g0, &g1), &g2), &g3)) in sum.as_mut().iter_mut().zip(g.clone()).take(w + 1) {
                    // G has the other sign, so that this adds −D G.
                    let sums = A::subtract(A::subtract(*sum, -d0, g0), -d1, g1);
                    *sum = A::subtract(A::subtract(sums, -d2, g2), -d3, g3);
                }
            }
        }
    }
}

/// A block on the diagonal, from its lower triangle.
fn symmetric<T: Real, R: Array<T>, A: Matrix<T>>(block: &mut A, lower: &[R], offset: usize) {
    for r in 0..A::ROWS {
        for c in 0..=r {
            let value = lower[offset + r][offset + c];
            block[(r, c)] = value;
            block[(c, r)] = value;
        }
    }
}
