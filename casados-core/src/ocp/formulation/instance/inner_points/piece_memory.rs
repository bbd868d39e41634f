//! Memory of intervals that are integrated in pieces.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::instance::data::{Layout, stage_variable_count};
use crate::ocp::formulation::instance::inner_points::InnerPoints;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::part;
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// The memory of the pieces of all intervals; empty if there are no points.
#[derive(Clone, Debug)]
pub(in crate::ocp) struct PieceMemory<T> {
    /// For every interval, at its node, its points and its end: `x`, `z`, and the columns of
    /// `∂x/∂(x₀, u, p)` and of `∂z/∂(x₀, u, p)`.
    pub solutions: Vec<T>,
    /// Variables of stages, with the states at the starts of pieces.
    pub v: Vec<T>,
    /// Multipliers at the ends of the current pieces, and of the previous ones.
    pub multipliers: [Vec<T>; 2],
    /// Weights of algebraic states at every point of all intervals.
    pub weights: Vec<T>,
    /// Gradients of constraints by states at every point of all intervals.
    pub constraint_gradients: Vec<T>,
    /// For every interval: the value and the gradient of integral costs, and `∇²` as six blocks.
    pub cost_and_hessian_sums: Vec<T>,
    /// Derivatives over `(x, w, u, z)` at a point, and a product.
    pub extended_derivatives: Vec<T>,
    pub product: Vec<T>,
}

impl<T> Default for PieceMemory<T> {
    fn default() -> Self {
        let empty = Vec::new;
        Self {
            solutions: empty(),
            v: empty(),
            multipliers: [empty(), empty()],
            weights: empty(),
            constraint_gradients: empty(),
            cost_and_hessian_sums: empty(),
            extended_derivatives: empty(),
            product: empty(),
        }
    }
}

impl<T: Real> InnerPoints<T> {
    /// Allocates memory for the pieces of a problem whose iterate has these numbers of variables
    /// and multipliers.
    pub(in crate::ocp) fn allocate<P: Formulation<T>>(
        &mut self,
        Layout { intervals, free_count: free, .. }: Layout,
        [variables, multipliers]: [usize; 2],
    ) -> Result<(), OcpError> {
        if self.count() == 0 {
            return Ok(());
        }
        let (sizes, zeros) = (PieceSizes::for_points::<P::Shape, T>(self), crate::qp::zeros::<T>);
        let [nx, nz] = [P::Shape::NX, P::Shape::NZ];
        let (n, count) = (stage_variable_count::<P::Shape>(free), intervals.saturating_mul(self.count()));
        self.piece_memory = PieceMemory {
            solutions: zeros(sizes.solutions_len(intervals))?,
            v: zeros(variables)?,
            multipliers: [zeros(multipliers)?, zeros(multipliers)?],
            weights: zeros(count * nz)?,
            constraint_gradients: zeros(count * nx)?,
            cost_and_hessian_sums: zeros(sizes.all_sums_len(intervals))?,
            extended_derivatives: zeros((n + nz) * (1 + n + nz + P::Path::ROWS))?,
            product: zeros(sizes.product_len().max((n + nz) * n))?,
        };
        Ok(())
    }
}

/// Sizes of the memory of a piece.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct PieceSizes {
    /// `NX`, `NU`, `NP`, `NZ`
    pub dims: [usize; 4],
    /// The number of points inside an interval.
    pub points: usize,
}

/// The solution at a location of an interval: its node, a point, or its end.
pub(in crate::ocp) struct PointSolution<'a, T> {
    pub x: &'a [T],
    pub z: &'a [T],
    /// `∂x/∂(x₀, u, p)` and `∂z/∂(x₀, u, p)`, column after column.
    pub dx: &'a [T],
    pub dz: &'a [T],
}

impl PieceSizes {
    pub fn for_points<S: Shape, T: Real>(inner: &InnerPoints<T>) -> Self {
        Self { dims: [S::NX, S::NU, S::NP, S::NZ], points: inner.count() }
    }
    /// `NX + NU + NP`
    pub fn inputs(self) -> usize {
        let [nx, nu, np, _] = self.dims;
        nx + nu + np
    }
    pub fn point_len(self) -> usize {
        let [nx, _, _, nz] = self.dims;
        (nx + nz) * (1 + self.inputs())
    }
    /// Returns the number of locations of an interval: node, points, end.
    pub fn point_count_with_ends(self) -> usize {
        self.points + 2
    }
    /// Returns the lengths of the blocks `xx`, `xu`, `uu`, `xp`, `up`, `pp`.
    pub fn hessian_block_lens(self) -> [usize; 6] {
        let [nx, nu, np, _] = self.dims;
        [nx * nx, nx * nu, nu * nu, nx * np, nu * np, np * np]
    }
    pub fn sums_len(self) -> usize {
        1 + self.inputs() + self.hessian_block_lens().iter().sum::<usize>()
    }
    /// Returns the length of the solutions at all locations of the intervals.
    fn solutions_len(self, intervals: usize) -> usize {
        intervals * self.point_count_with_ends() * self.point_len()
    }
    /// Returns the length of second derivatives and integral costs of the intervals.
    fn all_sums_len(self, intervals: usize) -> usize {
        intervals * self.sums_len()
    }
    /// Returns the length of a product of an interval.
    fn product_len(self) -> usize {
        self.dims[0] * self.inputs()
    }
    /// Returns the solution at a location of an interval.
    pub fn point_solution<T>(self, solutions: &[T], interval: usize, point: usize) -> PointSolution<'_, T> {
        let [nx, _, _, nz] = self.dims;
        let all = part(
            solutions,
            (interval * self.point_count_with_ends() + point) * self.point_len(),
            self.point_len(),
        );
        let (x, rest) = all.split_at_checked(nx).unwrap_or_default();
        let (z, rest) = rest.split_at_checked(nz).unwrap_or_default();
        let (dx, dz) = rest.split_at_checked(nx * self.inputs()).unwrap_or_default();
        PointSolution { x, z, dx, dz }
    }
}
