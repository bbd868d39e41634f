//! Second order: `d²(λᵀx_N)/dw² = Σ_n Σ_i D_iᵀ ∇²(μ_iᵀ f)_i D_i` with `D_i = d(ξ_i, u, p)/dw` from
//! the forward sweep and `μ_i` from the adjoint.

use super::scheme::{Scheme, directions, is_zero};
use super::step::{Own, Point, add};
use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, beside, kernels};
use crate::model::{ArrayK, ArrayW, ArrayX, Ode};
use crate::scalar::Lanes;
use crate::shape::Shape;
use bytemuck::Zeroable;

/// The Hessian that the stages are added to.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct Curvature<M: Ode, E: Lanes> {
    /// `∇²(μᵀ f)`, lower triangle.
    entries: M::Hessian<[E; 1]>,
    /// `∇²(μᵀ f) D`, of the rows that are not zero.
    product: ArrayW<M, ArrayW<M, E>>,
    /// The sum over the stages, upper triangle.
    pub sum: ArrayW<M, ArrayW<M, E>>,
}

impl<M: Ode, E: Lanes> Curvature<M, E> {
    /// No stages yet.
    pub fn start(&mut self) {
        for row in self.sum.as_mut() {
            row.as_mut().fill(E::zeroed());
        }
    }

    /// Adds a matrix of which the lower triangle is there.
    pub fn add_lower(&mut self, lower: &[ArrayW<M, E>]) {
        for (i, row) in lower.iter().enumerate() {
            for (j, value) in row.as_ref().iter().enumerate().take(i + 1) {
                let sum = self.sum.as_mut().get_mut(j).and_then(|row| row.as_mut().get_mut(i));
                if let Some(sum) = sum {
                    *sum = *sum + *value;
                }
            }
        }
    }

    /// Completes the lower triangle.
    pub fn mirror(&mut self) {
        for i in 0..M::Shape::NW {
            for j in 0..i {
                self.sum[i][j] = self.sum[j][i];
            }
        }
    }

    /// Adds `Dᵀ ∇²(μᵀ f) D` at one stage.
    pub fn add<const S: usize>(
        &mut self,
        scheme: &Scheme<M, E, S>,
        point: &mut Point<M, E>,
        mu: &ArrayK<M, [E; 1]>,
        dxi: &ArrayX<M, ArrayW<M, E>>,
        at: Place,
    ) -> Result<(), Error> {
        let Self { entries, product, sum } = self;
        M::hessian::<Own<E>>(&point.v, mu, entries);
        point.check(entries.as_ref().as_flattened(), Quantity::Hessian, at, |entry| {
            M::STRUCTURE.hessian.at(entry).0
        })?;
        multiply::<M, E>(&*entries, &scheme.curved, dxi, product);
        project::<M, E>(&*product, &scheme.curved, dxi, sum);
        Ok(())
    }
}

kernels! { by beside;
    /// `product = ∇²(μᵀ f) D`
    fn multiply [M: Ode, E: Lanes] [M, E] <A>(
        entries: &'k M::Hessian<[E; 1]>,
        curved: &'k ArrayW<M, bool>,
        dxi: &'k ArrayX<M, ArrayW<M, E>>,
        product: &'k mut ArrayW<M, ArrayW<M, E>>,
    ) {
        for (row, _) in product.as_mut().iter_mut().zip(curved.as_ref()).filter(|(_, curved)| **curved) {
            row.as_mut().fill(E::zeroed());
        }
        for (entry, &[value]) in entries.as_ref().iter().enumerate() {
            if let Some((row, column)) = directions::<M>(entry) {
                add_row::<A, M, E>(product, row, value, column, dxi);
                if row != column {
                    add_row::<A, M, E>(product, column, value, row, dxi);
                }
            }
        }
    }

    /// `sum += Dᵀ product`, upper triangle.
    fn project [M: Ode, E: Lanes] [M, E] <A>(
        product: &'k ArrayW<M, ArrayW<M, E>>,
        curved: &'k ArrayW<M, bool>,
        dxi: &'k ArrayX<M, ArrayW<M, E>>,
        sum: &'k mut ArrayW<M, ArrayW<M, E>>,
    ) {
        let (nx, nw) = (M::Shape::NX, M::Shape::NW);
        for variable in 0..nw {
            if !curved[variable] {
                continue;
            }
            let product = product[variable].as_ref();
            if variable < nx {
                for (i, &d) in dxi[variable].as_ref().iter().enumerate() {
                    if !is_zero(d) {
                        add::<A, E>(d, &product[i..], &mut sum[i].as_mut()[i..]);
                    }
                }
            } else {
                let one = E::from_f64(1.0);
                add::<A, E>(one, &product[variable..], &mut sum[variable].as_mut()[variable..]);
            }
        }
    }
}

/// Adds a row of `D` to one of the product: variables `u` and `p` move only in their own directions.
#[inline(always)]
fn add_row<A: Arithmetic, M: Ode, E: Lanes>(
    product: &mut ArrayW<M, ArrayW<M, E>>,
    row: usize,
    value: E,
    column: usize,
    dxi: &ArrayX<M, ArrayW<M, E>>,
) {
    let Some(sum) = product.as_mut().get_mut(row) else { return };
    if let (true, Some(dxi)) = (column < M::Shape::NX, dxi.as_ref().get(column)) {
        add::<A, E>(value, dxi.as_ref(), sum.as_mut());
    } else if let Some(sum) = sum.as_mut().get_mut(column) {
        *sum = *sum + value;
    }
}
