//! The cost of a step of an implicit method, counted from the structure.

use super::{Kinematic, Structure};

/// Floating-point operations of one step with `s` stages: additions, subtractions, multiplications,
/// divisions and elementary functions, one each.
///
/// Blocks are `s×s`. An inverse counts `2s³ − 2s² + s` (Gauss-Jordan elimination in place), a
/// product of blocks `2s³ − s²`, a product that is subtracted `2s³`, a block times one column
/// `2s² − s` and subtracted `2s²`. Machine-specific effects are not included (loads, selections in
/// pivoting, a fused multiply-add as one instruction): costs compare models and methods, but are no
/// times. Evaluations are zero if their operations are unknown (dual models).
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// // Two stages cost more than one; all of it is known before the program runs.
/// let (one, two) = (Cart::STRUCTURE.cost(1), Cart::STRUCTURE.cost(2));
/// assert_eq!(two.residual, 2 * one.residual);
/// assert!(two.iteration > one.iteration);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Factorisation of the Newton matrix: for each pivot that is not the identity an inverse, and
    /// a product for each block of its `L`; a subtracted product for each update. Without a plan LU
    /// factorisation of the whole matrix of `n = s nk` rows, `n (n − 1)(4n + 1)/6`.
    pub factorisation: u64,
    /// A solve with one right-hand side, transposed or not: a subtracted product for each
    /// off-diagonal block, and a product for each pivot that is not the identity. Without a plan
    /// `2n² − n`.
    pub solve: u64,
    /// `f` at all stages: `s` times [`Operations::residual`](super::Operations::residual).
    pub residual: u64,
    /// `f` and the non-constant entries of its Jacobian, at all stages.
    pub residual_jacobian: u64,
    /// An iteration of Newton's method with a new factorisation: the stage states `ξ`, `2s² nx`;
    /// `f` and its Jacobian; the Newton matrix, `s²` for each entry of `f_x` and `s` for each entry
    /// of `f_ẋ` that is added to one of `f_x`; the factorisation; a solve; and `s nk` for the new
    /// unknowns.
    pub iteration: u64,
    /// Forward sensitivities in the directions with influence, [`Structure::directions`]:
    /// right-hand sides `f_x V + f_w`, `2s` for each entry of `f_x` in each direction and `s` for
    /// each of `f_u`, `f_p`; for each direction a solve, `2s² + 3s` for each
    /// [`Kinematic`](super::Kinematic) state, and `2s nx` for the sum over the stages. The factors
    /// are those of Newton's method.
    pub forward: u64,
    /// An adjoint: the right-hand side, `s nx`; a solve; `4s²` for each kinematic state and `2s`
    /// for each entry by which other equations depend on it; and `2s` for each entry of `f_x`,
    /// `f_u`, `f_p`.
    pub adjoint: u64,
    /// Second derivatives, besides forward and adjoint: `∇²(μᵀ f)` at all stages; `D` of nonlinear
    /// states, `2s²` for each in each direction; and the lower triangle of `Dᵀ ∇²(μᵀ f) D`, `4s`
    /// for each off-diagonal nonzero (`2s` on the diagonal) in each direction and `2s` for each
    /// nonlinear variable in each pair of directions.
    pub hessian: u64,
}

impl Structure {
    /// Returns the cost of a step of an implicit method with `stages` stages; see [`Cost`] for the
    /// counting rules.
    ///
    /// ```
    /// # use casados_core::model::Structure;
    /// fn newton(model: &Structure) -> u64 {
    ///     3 * model.cost(4).iteration
    /// }
    /// ```
    #[must_use]
    pub fn cost(&self, stages: usize) -> Cost {
        let s = stages as u64;
        let (nx, nk) = (self.x.len() as u64, (self.x.len() + self.z.len()) as u64);
        let (factorisation, solve) = self.elimination_cost(s);
        let entries = |block: usize| {
            let [begin, end] = [self.blocks[block], self.blocks[block + 1]];
            end.saturating_sub(begin) as u64
        };
        let (of_x, of_w) = (entries(1), entries(3) + entries(4));
        let plan = &self.elimination;
        let kinematic = plan.kinematic.iter().filter(|of| of.equation != Kinematic::NONE).count() as u64;
        let dependents = plan.dependents.len() as u64;
        let (directions, curved) = (self.directions.len() as u64, self.curved.len() as u64);
        let (residual, residual_jacobian) =
            (s * u64::from(self.operations.residual), s * u64::from(self.operations.residual_jacobian));
        let shared = (0..self.blocks[1].min(self.jacobian.len())).filter(|&entry| {
            // An entry of f_ẋ in the same block as one of f_x.
            let (row, column) = self.jacobian.at(entry);
            (self.blocks[1]..self.blocks[2])
                .any(|other| self.jacobian.at(other) == (row, column + self.x.len()))
        });
        let assembly = s * s * of_x + s * shared.count() as u64;
        let curved_states =
            self.curved.iter().filter(|&&v| (nx..2 * nx).contains(&u64::from(v))).count() as u64;
        Cost {
            factorisation,
            solve,
            residual,
            residual_jacobian,
            iteration: 2 * s * s * nx + residual_jacobian + assembly + factorisation + solve + s * nk,
            forward: directions * (2 * s * of_x + solve + 2 * s * nx + kinematic * (2 * s * s + 3 * s))
                + s * of_w,
            adjoint: s * nx + solve + kinematic * 4 * s * s + 2 * s * (dependents + of_x + of_w),
            hessian: s * u64::from(self.operations.hessian)
                + directions * 2 * s * s * curved_states
                + directions * 2 * s * self.symmetric.len() as u64
                + directions * (directions + 1) / 2 * 2 * s * curved,
        }
    }

    /// Costs of a factorisation and of a solve.
    pub(crate) const fn elimination_cost(&self, s: u64) -> (u64, u64) {
        let mut pivots = self.elimination.pivots;
        if pivots.is_empty() {
            let n = s * (self.x.len() + self.z.len()) as u64;
            return (n * n.saturating_sub(1) * (4 * n + 1) / 6, (2 * n * n).saturating_sub(n));
        }
        let (square, cube) = (s * s, s * s * s);
        let (mut factorisation, mut solve) = (0, 0);
        while let [pivot, others @ ..] = pivots {
            pivots = others;
            let (lower, upper) = (pivot.lower(), pivot.upper());
            let (lower, upper) = ((lower.end - lower.start) as u64, (upper.end - upper.start) as u64);
            factorisation += 2 * cube * lower * upper;
            solve += 2 * square * (lower + upper);
            if !pivot.identity {
                factorisation += 2 * cube + s - 2 * square + lower * (2 * cube - square);
                solve += 2 * square - s;
            }
        }
        (factorisation, solve)
    }
}
