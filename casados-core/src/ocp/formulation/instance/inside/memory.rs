//! Memory for intervals that are integrated in pieces.

use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::instance::data::{Layout, inputs};
use crate::ocp::formulation::instance::inside::InnerPoints;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::part;
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// What is known of the pieces of all intervals. Lists are empty where there are no points.
#[derive(Clone, Debug)]
pub(in crate::ocp) struct PieceMemory<T> {
    /// Of every interval, at its node, its points and its end: `x`, `z`, and the columns of
    /// `∂x/∂(x₀, u, p)` and of `∂z/∂(x₀, u, p)`.
    pub found: Vec<T>,
    /// Variables of stages, with the states where pieces begin.
    pub v: Vec<T>,
    /// Multipliers of ends of pieces, and of the pieces before.
    pub multipliers: [Vec<T>; 2],
    /// At every point of all intervals: weights of algebraic states.
    pub weights: Vec<T>,
    /// At every point of all intervals: the gradient of constraints by states.
    pub forces: Vec<T>,
    /// Of every interval `∇²` as six blocks, and integral costs: their value and their gradient.
    pub totals: Vec<T>,
    /// Derivatives over `(x, w, u, z)` at a point, and a product.
    pub extended: Vec<T>,
    pub product: Vec<T>,
}

impl<T> Default for PieceMemory<T> {
    fn default() -> Self {
        let none = Vec::new;
        Self {
            found: none(),
            v: none(),
            multipliers: [none(), none()],
            weights: none(),
            forces: none(),
            totals: none(),
            extended: none(),
            product: none(),
        }
    }
}

impl<T: Real> InnerPoints<T> {
    /// Memory for the pieces of a problem, whose iterate has so many variables and multipliers.
    pub(in crate::ocp) fn allocate<P: Formulation<T>>(
        &mut self,
        Layout { intervals, free, .. }: Layout,
        [variables, multipliers]: [usize; 2],
    ) -> Result<(), OcpError> {
        if self.count() == 0 {
            return Ok(());
        }
        let (sizes, zeros) = (Sizes::of::<P::Shape, T>(self), crate::qp::zeros::<T>);
        let [nx, nz] = [P::Shape::NX, P::Shape::NZ];
        let (n, count) = (inputs::<P::Shape>(free), intervals.saturating_mul(self.count()));
        self.pieces = PieceMemory {
            found: zeros(sizes.found(intervals))?,
            v: zeros(variables)?,
            multipliers: [zeros(multipliers)?, zeros(multipliers)?],
            weights: zeros(count * nz)?,
            forces: zeros(count * nx)?,
            totals: zeros(sizes.totals(intervals))?,
            extended: zeros((n + nz) * (1 + n + nz + P::Path::ROWS))?,
            product: zeros(sizes.product().max((n + nz) * n))?,
        };
        Ok(())
    }
}

/// The sizes of what is known of a piece.
#[derive(Clone, Copy, Debug)]
pub(in crate::ocp) struct Sizes {
    /// `NX`, `NU`, `NP`, `NZ`
    pub dims: [usize; 4],
    /// Points inside of an interval.
    pub points: usize,
}

/// A place in an interval: its node, a point of it, or its end.
pub(in crate::ocp) struct Place<'a, T> {
    pub x: &'a [T],
    pub z: &'a [T],
    /// `∂x/∂(x₀, u, p)` and `∂z/∂(x₀, u, p)`, column after column.
    pub dx: &'a [T],
    pub dz: &'a [T],
}

impl Sizes {
    pub fn of<S: Shape, T: Real>(inner: &InnerPoints<T>) -> Self {
        Self { dims: [S::NX, S::NU, S::NP, S::NZ], points: inner.count() }
    }
    /// `NX + NU + NP`
    pub fn inputs(self) -> usize {
        let [nx, nu, np, _] = self.dims;
        nx + nu + np
    }
    pub fn place(self) -> usize {
        let [nx, _, _, nz] = self.dims;
        (nx + nz) * (1 + self.inputs())
    }
    /// Places of an interval: its node, its points, its end.
    pub fn places(self) -> usize {
        self.points + 2
    }
    /// Of the blocks `xx`, `xu`, `uu`, `xp`, `up`, `pp`.
    pub fn blocks(self) -> [usize; 6] {
        let [nx, nu, np, _] = self.dims;
        [nx * nx, nx * nu, nu * nu, nx * np, nu * np, np * np]
    }
    pub fn total(self) -> usize {
        1 + self.inputs() + self.blocks().iter().sum::<usize>()
    }
    /// How many numbers all places of so many intervals are.
    fn found(self, intervals: usize) -> usize {
        intervals * self.places() * self.place()
    }
    /// How many numbers second derivatives and integral costs are.
    fn totals(self, intervals: usize) -> usize {
        intervals * self.total()
    }
    /// How many numbers a product of an interval is.
    fn product(self) -> usize {
        self.dims[0] * self.inputs()
    }
    /// A place of an interval.
    pub fn at<T>(self, found: &[T], interval: usize, place: usize) -> Place<'_, T> {
        let [nx, _, _, nz] = self.dims;
        let all = part(found, (interval * self.places() + place) * self.place(), self.place());
        let (x, rest) = all.split_at_checked(nx).unwrap_or_default();
        let (z, rest) = rest.split_at_checked(nz).unwrap_or_default();
        let (dx, dz) = rest.split_at_checked(nx * self.inputs()).unwrap_or_default();
        Place { x, z, dx, dz }
    }
}
