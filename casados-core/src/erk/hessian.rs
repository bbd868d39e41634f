//! Second order: `d²(λᵀx_N)/dw² = Σ_n Σ_i D_iᵀ ∇²(μ_iᵀ f)_i D_i` with `D_i = d(ξ_i, u, p)/dw` from
//! the forward sweep and `μ_i` from the adjoint.

use super::step::{Point, Scheme, add, check, directions};
use crate::error::{Error, Place, Quantity};
use crate::model::{ArrayK, ArrayW, ArrayX, Ode};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

/// The Hessian that the stages are added to.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct Curvature<M: Ode, T: Real> {
    /// `∇²(μᵀ f)`, lower triangle.
    entries: M::Hessian<T>,
    /// `∇²(μᵀ f) D`, of the rows that are not zero.
    product: ArrayW<M, ArrayW<M, T>>,
    /// The sum over the stages, upper triangle.
    pub sum: ArrayW<M, ArrayW<M, T>>,
}

impl<M: Ode, T: Real> Curvature<M, T> {
    /// No stages yet.
    pub fn start(&mut self) {
        for row in self.sum.as_mut() {
            row.as_mut().fill(T::ZERO);
        }
    }

    /// Adds a matrix of which the lower triangle is there.
    pub fn add_lower(&mut self, lower: &[ArrayW<M, T>]) {
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
        scheme: &Scheme<M, T, S>,
        point: &Point<M, T>,
        mu: &ArrayK<M, T>,
        dxi: &ArrayX<M, ArrayW<M, T>>,
        at: Place,
    ) -> Result<(), Error> {
        M::hessian::<T>(&point.v, mu, &mut self.entries);
        check(self.entries.as_ref(), Quantity::Hessian, at, |entry| M::STRUCTURE.hessian.at(entry).0)?;
        self.multiply(&scheme.curved, dxi);
        self.project(&scheme.curved, dxi);
        Ok(())
    }

    /// `product = ∇²(μᵀ f) D`
    fn multiply(&mut self, curved: &ArrayW<M, bool>, dxi: &ArrayX<M, ArrayW<M, T>>) {
        let nx = M::Shape::NX;
        for (row, _) in self.product.as_mut().iter_mut().zip(curved.as_ref()).filter(|(_, curved)| **curved) {
            row.as_mut().fill(T::ZERO);
        }
        // Variables u and p move only in their own directions.
        let mut add_row = |row: usize, value: T, column: usize| {
            let Some(sum) = self.product.as_mut().get_mut(row) else { return };
            if let (true, Some(dxi)) = (column < nx, dxi.as_ref().get(column)) {
                add(value, dxi.as_ref(), sum.as_mut());
            } else if let Some(sum) = sum.as_mut().get_mut(column) {
                *sum = *sum + value;
            }
        };
        for (entry, &value) in self.entries.as_ref().iter().enumerate() {
            if let Some((row, column)) = directions::<M>(entry) {
                add_row(row, value, column);
                if row != column {
                    add_row(column, value, row);
                }
            }
        }
    }

    /// `sum += Dᵀ product`, upper triangle.
    fn project(&mut self, curved: &ArrayW<M, bool>, dxi: &ArrayX<M, ArrayW<M, T>>) {
        let (nx, nw) = (M::Shape::NX, M::Shape::NW);
        for variable in 0..nw {
            if !curved[variable] {
                continue;
            }
            let product = self.product[variable].as_ref();
            if variable < nx {
                for (i, &d) in dxi[variable].as_ref().iter().enumerate() {
                    if d != T::ZERO {
                        add(d, &product[i..], &mut self.sum[i].as_mut()[i..]);
                    }
                }
            } else {
                add(T::ONE, &product[variable..], &mut self.sum[variable].as_mut()[variable..]);
            }
        }
    }
}
