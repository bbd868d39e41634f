//! Factors of the Newton matrix `J_ij = δ_ij [f_ẋ,i | f_z,i] + h a_ij [f_x,i | 0]`.

use super::block::Block;
use super::dense::Dense;
use super::sparse;
use crate::model::{ArrayK, Assembly, Dae};
use crate::scalar::Real;
use crate::shape::{Array, Plain, assign};
use bytemuck::Zeroable;

/// Multipliers of a planned elimination that are larger than this have lost too many digits.
const GROWTH: f64 = 1e6;

/// The row of right-hand sides that belongs to an equation: that of the unknown whose pivot it is.
#[inline(always)]
pub fn slot<M: Dae>(equation: usize) -> usize {
    match M::STRUCTURE.elimination.slot_of_equation.get(equation) {
        Some(&slot) => slot as usize,
        None => equation,
    }
}

/// The factors, by the plan or dense.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Factors<M: Dae, T: Plain, const S: usize> {
    blocks: M::Factors<Block<T, S>>,
    /// Memory that is touched only where the plan is not good enough.
    dense: Dense<M, T, S>,
    /// Whether the dense factors are the ones that hold.
    is_dense: bool,
}

impl<M: Dae, T: Plain, const S: usize> Clone for Factors<M, T, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Dae, T: Plain, const S: usize> Copy for Factors<M, T, S> {}

impl<M: Dae, T: Real, const S: usize> Factors<M, T, S> {
    /// Factors of the matrix of these Jacobians, one per stage. Whether the plan was good enough.
    ///
    /// # Errors
    /// The unknown and the stage for which there is no pivot.
    pub fn factor(
        &mut self,
        jacobian: &[M::Jacobian<T>; S],
        a: &[[T; S]; S],
        h: T,
    ) -> Result<bool, (usize, usize)> {
        let plan = &M::STRUCTURE.elimination;
        self.is_dense = plan.pivots.is_empty() || !self.factor_by_plan(jacobian, a, h);
        if self.is_dense {
            self.factor_dense(jacobian, a, h)?;
        }
        Ok(!self.is_dense || plan.pivots.is_empty())
    }

    /// By the plan; whether that went well.
    fn factor_by_plan(&mut self, jacobian: &[M::Jacobian<T>; S], a: &[[T; S]; S], h: T) -> bool {
        let plan = &M::STRUCTURE.elimination;
        let blocks = self.blocks.as_mut();
        let ha = a.map(|row| row.map(|a| h * a));
        blocks.fill([[T::ZERO; S]; S]);
        for entry in plan.assembly {
            let Some(block) = blocks.get_mut(entry.block as usize) else { continue };
            if entry.state != Assembly::NONE {
                for ((row, ha), jacobian) in block.iter_mut().zip(&ha).zip(jacobian) {
                    let value = jacobian[entry.state as usize];
                    *row = ha.map(|ha| value * ha);
                }
            }
            if entry.direct != Assembly::NONE {
                for (stage, (row, jacobian)) in block.iter_mut().zip(jacobian).enumerate() {
                    row[stage] = row[stage] + jacobian[entry.direct as usize];
                }
            }
        }
        let growth = sparse::factor(plan, blocks);
        // A pivot that vanishes makes growth infinite or NaN.
        growth <= T::from_f64(GROWTH)
    }

    /// By pivoting the whole matrix, with the row of each equation in its slot.
    ///
    /// # Errors
    /// The unknown and the stage for which there is no pivot.
    pub fn factor_dense(
        &mut self,
        jacobian: &[M::Jacobian<T>; S],
        a: &[[T; S]; S],
        h: T,
    ) -> Result<(), (usize, usize)> {
        let (pattern, blocks, nx) = (M::STRUCTURE.jacobian, M::STRUCTURE.blocks, M::STRUCTURE.x.len());
        self.is_dense = true;
        self.dense.clear();
        for (stage, jacobian) in jacobian.iter().enumerate() {
            for e in 0..blocks[3] {
                let (r, c) = pattern.at(e);
                let (r, value) = (slot::<M>(r), jacobian[e]);
                if e < blocks[1] {
                    self.dense.add(r, c, stage, value);
                } else if e < blocks[2] {
                    self.dense.add_row(r, c - nx, stage, h * value, &a[stage]);
                } else {
                    self.dense.add(r, c - nx, stage, value);
                }
            }
        }
        self.dense.factor()
    }

    /// Solves `J X = B` in place, all columns of `B` at once; equations are in their slots.
    pub fn solve<R: Array<T>>(&self, b: &mut ArrayK<M, [R; S]>) {
        if self.is_dense {
            self.dense.solve(b);
        } else {
            sparse::solve(&M::STRUCTURE.elimination, self.blocks.as_ref(), b.as_mut());
        }
    }

    /// Solves `Jᵀ X = B` in place, all columns of `B` at once; the solution has equations in their slots.
    pub fn solve_transposed<R: Array<T>>(&self, b: &mut ArrayK<M, [R; S]>) {
        if self.is_dense {
            self.dense.solve_transposed(b);
        } else {
            sparse::solve_transposed(&M::STRUCTURE.elimination, self.blocks.as_ref(), b.as_mut());
        }
    }

    /// Copies what holds.
    pub fn copy_from(&mut self, other: &Self) {
        self.is_dense = other.is_dense;
        if other.is_dense {
            assign(&mut self.dense, &other.dense);
        } else {
            assign(&mut self.blocks, &other.blocks);
        }
    }
}
