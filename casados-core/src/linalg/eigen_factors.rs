//! Factors in the eigenbasis of the tableau that say whether they hold, with whole matrices pivoted where they do not: what
//! steps of variable size iterate with.

use super::block::Block;
use super::complex::Complex;
use super::dense::Dense;
use super::factors::slot;
use super::fused::{Arithmetic, Kernel, dispatch};
use super::left_out::ALL;
use super::sparse::{self, Planned};
use super::substitution;
use crate::model::{ArrayK, Dae};
use crate::scalar::Real;
use crate::shape::{Aligned, Plain};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// So many eigenvalues there may be, of complex conjugate ones one.
const LANES: usize = 4;

/// The parts of a number for each of them.
pub const PARTS: usize = 2 * LANES;

/// A right-hand side or a solution of the systems of all eigenvalues, one row for each slot.
pub type Rows<M, T> = ArrayK<M, [[Complex<T, PARTS>; 1]; 1]>;

/// Factors of `[f_ẋ + hμ_l f_x | f_z]` for all eigenvalues.
#[derive(Zeroable)]
#[zeroable(bound = "T: Zeroable")]
pub struct EigenFactors<M: Dae, T: Plain> {
    blocks: Aligned<M::Factors<[[Complex<T, PARTS>; 1]; 1]>>,
    /// Memory that is touched only where the plan is not good enough: real and imaginary part as two stages.
    dense: [Dense<M, T, 2>; LANES],
    is_dense: bool,
    pivoted: bool,
}

impl<M: Dae, T: Real> EigenFactors<M, T> {
    /// Whether the plan is in use, so that pivoting may give better factors.
    pub fn is_planned(&self) -> bool {
        !self.pivoted && !M::STRUCTURE.elimination.pivots.is_empty()
    }

    /// From now on, whether every matrix is to be pivoted.
    pub fn set_pivoted(&mut self, pivoted: bool) {
        self.pivoted = pivoted;
    }

    /// Factors of the matrices of a Jacobian. Whether those of the plan hold, if there is one.
    ///
    /// # Errors
    /// The unknown for which there is no pivot.
    pub fn factor(
        &mut self,
        jacobian: &M::Jacobian<T>,
        values: &Complex<T, PARTS>,
        h: T,
    ) -> Result<bool, usize> {
        let scale = values.scaled(h);
        self.is_dense = !(self.is_planned() && self.factor_by_plan(jacobian, &scale));
        if self.is_dense {
            self.factor_dense(jacobian, &scale)?;
        }
        Ok(!self.is_dense || M::STRUCTURE.elimination.pivots.is_empty())
    }

    /// By the plan; whether that went well.
    fn factor_by_plan(&mut self, jacobian: &M::Jacobian<T>, scale: &Complex<T, PARTS>) -> bool {
        let blocks = self.blocks.as_mut();
        dispatch(Assemble::<M, T> { jacobian: jacobian.as_ref(), scale, blocks, model: PhantomData })
    }

    /// By pivoting whole matrices.
    fn factor_dense(&mut self, jacobian: &M::Jacobian<T>, scale: &Complex<T, PARTS>) -> Result<(), usize> {
        let (pattern, blocks, nx) = (M::STRUCTURE.jacobian, M::STRUCTURE.blocks, M::STRUCTURE.x.len());
        for (l, dense) in self.dense.iter_mut().enumerate() {
            dense.clear();
            let (re, im) = scale.get(l);
            for e in 0..blocks[3] {
                let (r, c) = pattern.at(e);
                let (r, value) = (slot::<M>(r), jacobian[e]);
                if e >= blocks[1] && e < blocks[2] {
                    dense.add_row(r, c - nx, 0, value, &[re, -im]);
                    dense.add_row(r, c - nx, 1, value, &[im, re]);
                } else {
                    let c = if e < blocks[1] { c } else { c - nx };
                    dense.add(r, c, 0, value);
                    dense.add(r, c, 1, value);
                }
            }
            dense.factor().map_err(|(unknown, _)| unknown)?;
        }
        Ok(())
    }

    /// Solves all systems in place; equations are in their slots.
    pub fn solve(&self, rows: &mut Rows<M, T>) {
        if self.is_dense {
            self.solve_dense(rows);
        } else {
            let blocks = self.blocks.as_ref();
            let factors = Planned::<M, _, 1> { model: PhantomData, blocks, coupling: &[[Complex::zero()]] };
            substitution::solve(factors, rows.as_mut());
        }
    }

    fn solve_dense(&self, rows: &mut Rows<M, T>) {
        let mut parts: ArrayK<M, [[T; 1]; 2]> = Zeroable::zeroed();
        for (l, dense) in self.dense.iter().enumerate() {
            for (part, [[row]]) in parts.as_mut().iter_mut().zip(rows.as_ref()) {
                let (re, im) = row.get(l);
                *part = [[re], [im]];
            }
            dense.solve(&mut parts);
            for ([[re], [im]], [[row]]) in parts.as_ref().iter().zip(rows.as_mut()) {
                row.set(l, (*re, *im));
            }
        }
    }
}

/// The matrices and their factors; whether these are finite.
struct Assemble<'a, M, T> {
    jacobian: &'a [T],
    scale: &'a Complex<T, PARTS>,
    blocks: &'a mut [Block<Complex<T, PARTS>, 1>],
    model: PhantomData<M>,
}

impl<M: Dae, T: Real> Kernel for Assemble<'_, M, T> {
    type Number = T;
    type Output = bool;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> bool {
        let Self { jacobian, scale, blocks, .. } = self;
        let plan = &M::STRUCTURE.elimination;
        for entry in plan.assembly {
            let Some([[to]]) = blocks.get_mut(entry.block as usize) else { continue };
            // An index that marks what is not there lies outside of the Jacobian.
            let state = jacobian.get(entry.state as usize);
            let mut element = state.map_or_else(Complex::zero, |state| scale.scaled(*state));
            if let Some(direct) = jacobian.get(entry.direct as usize) {
                element = element.plus(*direct);
            }
            *to = element;
        }
        sparse::Factor::<M, _, 1, ALL> { coupling: &[[Complex::zero()]], blocks, model: PhantomData }
            .run::<A>();
        // A pivot that vanishes leaves infinite elements or NaN.
        let pivots = plan.pivots.iter().filter_map(|pivot| blocks.get(pivot.block as usize));
        pivots.fold(true, |finite, [[element]]| finite & element.is_finite())
    }
}
