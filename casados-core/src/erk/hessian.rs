//! Second-order sensitivities, `d²(λᵀx_N)/dw² = Σ_n Σ_i D_iᵀ ∇²(μ_iᵀ f)_i D_i` with
//! `D_i = d(ξ_i, u, p)/dw` from the forward sweep and `μ_i` from the adjoint.

use super::scheme::{Scheme, entry_directions, is_zero};
use super::step::{StagePoint, UnitStride, add};
use super::tiles::{self, ColumnKernel, for_each_tile};
use crate::error::{Error, Place, Quantity};
use crate::linalg::{Arithmetic, kernels, run_plain};
use crate::model::{ArrayK, ArrayW, ArrayX, Ode};
use crate::scalar::Lanes;
use crate::shape::{InBounds, Shape};
use bytemuck::Zeroable;
use core::ops::Range;

/// The sum of the Hessians of the stages.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub(super) struct HessianSum<M: Ode, E: Lanes> {
    /// `∇²(μᵀ f)`, lower triangle.
    entries: M::Hessian<[E; 1]>,
    /// Nonzero rows of `∇²(μᵀ f) D`.
    product: ArrayW<M, ArrayW<M, E>>,
    /// The sum over the stages, upper triangle.
    pub sum: ArrayW<M, ArrayW<M, E>>,
}

impl<M: Ode, E: Lanes> HessianSum<M, E> {
    /// Sets the sum to zero.
    pub fn reset(&mut self) {
        for row in self.sum.as_mut() {
            row.as_mut().fill(E::zeroed());
        }
    }

    /// Adds a symmetric matrix given by its lower triangle.
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

    /// Copies the upper triangle to the lower.
    pub fn mirror(&mut self) {
        for i in 0..M::Shape::NW {
            for j in 0..i {
                self.sum[i][j] = self.sum[j][i];
            }
        }
    }

    /// Adds `Dᵀ ∇²(μᵀ f) D` at one stage.
    pub fn add_stage<const S: usize>(
        &mut self,
        scheme: &Scheme<M, E, S>,
        point: &mut StagePoint<M, E>,
        mu: &ArrayK<M, [E; 1]>,
        dxi: &ArrayX<M, ArrayW<M, E>>,
        at: Place,
    ) -> Result<(), Error> {
        let Self { entries, product, sum } = self;
        M::hessian::<UnitStride<E>>(&point.v, mu, entries);
        point.check(entries.as_ref().as_flattened(), Quantity::Hessian, at, |entry| {
            M::STRUCTURE.hessian.at(entry).0
        })?;
        multiply::<M, E>(&*entries, &scheme.is_nonlinear, dxi, product);
        project::<M, E>(&*product, &scheme.is_nonlinear, dxi, sum);
        Ok(())
    }
}

kernels! { by run_plain;
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
        if const { E::LANES > 1 } {
            // Entries are in row order.
            let (mut begin, end) = (0, entries.as_ref().len());
            while begin < end {
                let row = M::STRUCTURE.hessian.at(begin).0;
                let last = (begin..end).find(|&entry| M::STRUCTURE.hessian.at(entry).0 != row);
                let of_row = begin..last.unwrap_or(end);
                begin = of_row.end;
                for_each_tile::<A, _, 8>(0, M::Shape::NW, &mut SparseRowProduct::<M, E> { row_entries: of_row, entries, dxi, product });
            }
            return;
        }
        for (entry, &[value]) in entries.as_ref().iter().enumerate() {
            if let Some((row, column)) = entry_directions::<M>(entry) {
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
        let mut begin = 0;
        if const { E::LANES > 1 } {
            for (row, sum) in sum.as_mut().iter_mut().enumerate() {
                let sum = sum.as_mut();
                for_each_tile::<A, _, 8>(row, nw, &mut CongruenceRow::<M, E> { row, product, curved, dxi, sum });
            }
            begin = nx;
        }
        for variable in begin..nw {
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

/// A row of the product in [`multiply`], including the transposed entries.
struct SparseRowProduct<'a, M: Ode, E: Lanes> {
    row_entries: Range<usize>,
    entries: &'a M::Hessian<[E; 1]>,
    dxi: &'a ArrayX<M, ArrayW<M, E>>,
    product: &'a mut ArrayW<M, ArrayW<M, E>>,
}

impl<M: Ode, E: Lanes> ColumnKernel for SparseRowProduct<'_, M, E> {
    #[inline(always)]
    fn process_columns<A: Arithmetic, const W: usize>(&mut self, first: usize) {
        let Self { row_entries: of_row, entries, dxi, product } = self;
        let rows = dxi.as_ref();
        let direction_row = |variable: usize| rows.get(variable).map(|row| row.as_ref());
        let (row, _) = M::STRUCTURE.hessian.at(of_row.start);
        let Some(row) = row.checked_sub(M::Shape::NX) else { return };
        let Some(previous_row) = product.as_ref().get(row).in_bounds() else { return };
        let mut sum = tiles::load::<E, W>(previous_row.as_ref(), first);
        for entry in of_row.clone() {
            let (Some((_, column)), Some(&[value])) =
                (entry_directions::<M>(entry), entries.as_ref().get(entry).in_bounds())
            else {
                continue;
            };
            // The rows of `u` and `p` in `D` are unit vectors.
            match direction_row(column) {
                Some(d) => tiles::add::<A, E, W>(&mut sum, value, d, first),
                None => tiles::add_to_column(&mut sum, value, first, column),
            }
            if row == column {
                continue;
            }
            let Some(mirrored_row) = product.as_mut().get_mut(column).in_bounds() else { continue };
            let mut mirrored_sum = tiles::load::<E, W>(mirrored_row.as_ref(), first);
            match direction_row(row) {
                Some(d) => tiles::add::<A, E, W>(&mut mirrored_sum, value, d, first),
                None => tiles::add_to_column(&mut mirrored_sum, value, first, row),
            }
            tiles::store(&mirrored_sum, mirrored_row.as_mut(), first);
        }
        if let Some(product) = product.as_mut().get_mut(row).in_bounds() {
            tiles::store(&sum, product.as_mut(), first);
        }
    }
}

/// The contribution of states to a row of the sum in [`project`].
struct CongruenceRow<'a, M: Ode, E: Lanes> {
    row: usize,
    product: &'a ArrayW<M, ArrayW<M, E>>,
    curved: &'a ArrayW<M, bool>,
    dxi: &'a ArrayX<M, ArrayW<M, E>>,
    sum: &'a mut [E],
}

impl<M: Ode, E: Lanes> ColumnKernel for CongruenceRow<'_, M, E> {
    #[inline(always)]
    fn process_columns<A: Arithmetic, const W: usize>(&mut self, first: usize) {
        let mut sum = tiles::load::<E, W>(self.sum, first);
        let curved = self.product.as_ref().iter().zip(self.curved.as_ref());
        for ((product, &curved), dxi) in curved.zip(self.dxi.as_ref()) {
            let d = dxi[self.row];
            if curved && !is_zero(d) {
                tiles::add::<A, E, W>(&mut sum, d, product.as_ref(), first);
            }
        }
        tiles::store(&sum, self.sum, first);
    }
}

/// Adds a row of `D` to a row of the product; the rows of `u` and `p` are unit vectors.
#[inline(always)]
fn add_row<A: Arithmetic, M: Ode, E: Lanes>(
    product: &mut ArrayW<M, ArrayW<M, E>>,
    row: usize,
    value: E,
    column: usize,
    dxi: &ArrayX<M, ArrayW<M, E>>,
) {
    let Some(sum) = product.as_mut().get_mut(row).in_bounds() else { return };
    if let (true, Some(dxi)) = (column < M::Shape::NX, dxi.as_ref().get(column)) {
        add::<A, E>(value, dxi.as_ref(), sum.as_mut());
    } else if let Some(sum) = sum.as_mut().get_mut(column) {
        *sum = *sum + value;
    }
}
