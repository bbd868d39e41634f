//! What parameters change of the conditions of optimality.

use crate::linalg::{axpy, dot};
use crate::ocp::assembly::algebraic::{self, Extended};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free::Free;
use crate::ocp::formulation::functions::constraint::{Constraints, Spot};
use crate::ocp::formulation::functions::cost::{At, Cost};
use crate::ocp::formulation::functions::dynamics::IntervalResult;
use crate::ocp::formulation::functions::point::Cross;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::instance::data::{Node, inputs, split};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::qp::{SolutionStage, StageDims, copy_common, part, part_mut, zeros};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;
use bytemuck::Zeroable;

/// Derivatives with respect to `p`, one stage after the other.
#[derive(Clone, Debug)]
pub(super) struct Parameters<T> {
    /// `NX`, `NU`, `NP`
    dims: [usize; 3],
    /// Rows of the constraints of a stage but the last.
    rows: usize,
    /// `∂φ/∂p`, column after column.
    ends: Vec<T>,
    /// `∂²L/∂(x, u)∂p`, column after column.
    gradients: Vec<T>,
    /// `∂g/∂p`, row after row.
    slopes: Vec<T>,
    /// `∂L/∂p`, which is that of the optimal value, and `∂²L/∂p²`: sums over all stages.
    pub(super) slopes_of_value: Vec<T>,
    pub(super) square: Vec<T>,
    /// `∂z/∂p`, column after column.
    algebraic: Vec<T>,
    /// `∂²L/∂(x, u, z)∂p` of a stage, where `z` stays.
    extended: Vec<T>,
    /// `μ` of the constraints of a stage, and their values.
    mu: Vec<T>,
    values: Vec<T>,
}

impl<T: Real> Parameters<T> {
    pub(super) fn new<P: Formulation<T>>(n: usize) -> Result<Self, OcpError> {
        let dims @ [nx, nu, np] = [P::Shape::NX, P::Shape::NU, P::Shape::NP];
        Ok(Self {
            dims,
            rows: P::Path::ROWS,
            ends: zeros(n * nx * np)?,
            gradients: zeros((n + 1) * (nx + nu) * np)?,
            slopes: zeros((n * P::Path::ROWS + P::Terminal::ROWS) * np)?,
            slopes_of_value: zeros(np)?,
            square: zeros(np * np)?,
            algebraic: zeros(n * P::Shape::NZ * np)?,
            extended: zeros((nx + nu + P::Shape::NZ) * np)?,
            mu: zeros(P::Path::ROWS.max(P::Terminal::ROWS))?,
            values: zeros(P::Path::ROWS)?,
        })
    }

    /// `∂φ/∂p` of an interval.
    pub(super) fn end(&self, k: usize) -> &[T] {
        let [nx, _, np] = self.dims;
        part(&self.ends, k * nx * np, nx * np)
    }
    /// `∂²L/∂(x, u)∂p` of a stage.
    pub(super) fn gradient(&self, k: usize) -> &[T] {
        let [nx, nu, np] = self.dims;
        part(&self.gradients, k * (nx + nu) * np, (nx + nu) * np)
    }
    /// Adds what a constraint with the gradient `c` over `(x, u)` does as a spring.
    pub(super) fn constrain(&mut self, [k, row]: [usize; 2], stiff: T, c: &[T]) {
        let [nx, nu, np] = self.dims;
        let size = nx + nu;
        let slopes = part(&self.slopes, (k * self.rows + row) * np, np);
        for (p, &slope) in slopes.iter().enumerate() {
            axpy(stiff * slope, c, part_mut(&mut self.gradients, (k * np + p) * size, c.len()));
            axpy(stiff * slope, slopes, part_mut(&mut self.square, p * np, np));
        }
    }

    /// Before the first interval.
    pub(super) fn begin(&mut self) {
        self.slopes_of_value.fill(T::ZERO);
        self.square.fill(T::ZERO);
        self.slopes.fill(T::ZERO);
    }

    /// `πᵀ ∂φ/∂p + μᵀ ∂g/∂p` of all stages.
    fn weigh<'a>(&mut self, stages: impl Iterator<Item = SolutionStage<'a, T>>)
    where
        T: 'a,
    {
        let [nx, _, np] = self.dims;
        for (k, at) in stages.enumerate() {
            let columns = part(&self.ends, k * nx * np, nx * np).chunks_exact(nx.max(1));
            for (column, of_value) in columns.zip(&mut self.slopes_of_value) {
                *of_value = *of_value + dot(column, at.dynamics);
            }
            for (row, (&upper, &lower)) in at.g_upper.iter().zip(at.g_lower).enumerate() {
                let slopes = part(&self.slopes, (k * self.rows + row) * np, np);
                axpy(upper - lower, slopes, &mut self.slopes_of_value);
            }
        }
    }

    /// What an interval adds.
    pub(super) fn take(&mut self, k: usize, step: &IntervalResult<'_, T>) {
        let [nx, nu, np] = self.dims;
        let (size, nz) = (nx + nu, step.z.len());
        copy_common(part_mut(&mut self.algebraic, k * nz * np, nz * np), step.dz[2]);
        copy_common(part_mut(&mut self.ends, k * nx * np, nx * np), step.dp);
        let columns = part_mut(&mut self.gradients, k * size * np, size * np);
        columns.fill(T::ZERO);
        let (slopes, square) = (&mut *self.slopes_of_value, &mut *self.square);
        let free = Free::default();
        let mut cross = Cross { free, columns, ld: size, slopes, square };
        cross.add_blocks([nx, nu], step.hessian_p);
        cross.add_blocks([nx, nu], step.cost.hessian_p);
        step.cost.p.iter().enumerate().for_each(|(p, &slope)| cross.slope(p, slope));
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Adds costs and constraints to what the intervals have added.
    pub(super) fn differentiate_functions(
        &mut self,
        exact: bool,
        result: &mut Parameters<T>,
    ) -> Result<(), OcpError> {
        let intervals = self.intervals();
        let (layout, free) = (self.layout(), self.free.view());
        let (np, size) = (P::Shape::NP, inputs::<P::Shape>(layout.free));
        if np == 0 {
            return Ok(());
        }
        let data = split::<P, T>(self.data.as_mut(), layout);
        let Problem { stage_cost, terminal_cost, path, terminal, running, .. } = self.problem.parts();
        let Parameters {
            gradients,
            slopes,
            algebraic: dz_dp,
            extended,
            mu,
            values,
            rows,
            slopes_of_value: of_value,
            square,
            ..
        } = &mut *result;
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, at) in self.iterate.stages().enumerate() {
            let node = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
            let (z, dz) = algebraic::at::<P::Shape, T>(data.algebraic, layout, k);
            node.read::<P::Shape>(&mut point, &at, z, free);
            let columns = part_mut(gradients, k * size * np, size * np);
            if k == intervals {
                columns.fill(T::ZERO);
            }
            let mut cross = Cross { free, columns, ld: size, slopes: of_value, square };
            for ((mu, &upper), &lower) in mu.iter_mut().zip(at.g_upper).zip(at.g_lower) {
                *mu = upper - lower;
            }
            let mu = exact.then_some(&**mu);
            let slopes = slopes.get_mut(k * *rows * np..).unwrap_or_default();
            let place = At { stage: k, factor: node.factor, exact, from: &[] };
            if k == intervals {
                terminal_cost.cross(&point, node.reference, place, &mut cross)?;
                terminal.cross(&point, mu, slopes, &mut cross);
                continue;
            }
            if z.is_empty() {
                stage_cost.cross(&point, node.reference, place, &mut cross)?;
                path.cross(&point, mu, slopes, &mut cross);
                continue;
            }
            extended.fill(T::ZERO);
            let Cross { slopes: of_value, square, .. } = &mut cross;
            let mut direct = Cross { free, columns: extended, ld: size + z.len(), slopes: of_value, square };
            stage_cost.cross(&point, node.reference, place, &mut direct)?;
            path.cross(&point, mu, slopes, &mut direct);
            let spot = Spot::new(k, free, &[]);
            let Extended { mut terms, columns } = Extended::new::<P::Shape>(data.extended, free);
            stage_cost.add(&point, node.reference, place, &mut terms)?;
            path.linearise(&point, values, columns, terms.ld, spot)?;
            if let Some(mu) = mu {
                path.curve(&point, mu, spot, &mut terms);
            }
            let dp = part(dz_dp, k * z.len() * np, z.len() * np);
            Extended { terms, columns }.fold_parameters::<P::Shape>([dz, dp], extended, &mut cross, slopes);
        }
        result.weigh(self.iterate.stages());
        Ok(())
    }
}
