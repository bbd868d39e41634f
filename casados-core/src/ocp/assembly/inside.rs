//! Constraints at points inside of intervals, in the QP.
//!
//! What is there depends on `(x_j, w, u, z_j)`, and through the pieces before on `(x, w, u)`, with
//! `M = ∂(x_j, w, u, z_j)/∂(x, w, u)`:
//!
//! ```text
//! ∇g = Mᵀ ∇g_j        ∇² = Mᵀ ∇²(μᵀg_j) M, and what pieces add
//! ```

use crate::ocp::assembly::algebraic::{self, Extended};
use crate::ocp::assembly::pieces::Pieces;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::free::Free;
use crate::ocp::formulation::functions::constraint::{Constraints, Spot};
use crate::ocp::formulation::functions::cost::{At, Cost};
use crate::ocp::formulation::functions::dynamics::{Dynamics, IntervalResult};
use crate::ocp::formulation::functions::point::Terms;
use crate::ocp::formulation::instance::data::{Layout, Node, inputs, node_rows, split};
use crate::ocp::formulation::instance::inside::memory::{PieceMemory, Place, Sizes};
use crate::ocp::formulation::instance::inside::{InnerPoints, check_pieces};
use crate::ocp::formulation::instance::{Ocp, nodes};
use crate::ocp::formulation::problem::{Formulation, Problem};
use crate::ocp::formulation::program::curvature::Curvature;
use crate::qp::element::get;
use crate::qp::{Arrays, Solution, SolutionStage, StageDims, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use bytemuck::Zeroable;

impl<T: Real> InnerPoints<T> {
    fn pieces<S: Shape>(&mut self) -> Pieces<'_, T> {
        let sizes = Sizes::of::<S, T>(self);
        let (parts, memory) = self.parts_and_memory();
        Pieces { sizes, parts, memory }
    }

    /// The states of a stage at a point.
    pub(in crate::ocp) fn at<S: Shape>(&self, stage: usize, point: usize) -> Place<'_, T> {
        Sizes::of::<S, T>(self).at(&self.pieces.found, stage, point)
    }
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// As `linearise_intervals`, piece by piece.
    pub(super) fn linearise_pieces<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        mut to: impl FnMut(usize, &IntervalResult<'_, T>, (Arrays<'_, T>, Free<'_>), &[T]),
    ) -> Result<(T, [T; 2]), OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let Self { problem, iterate, data, free, inner, .. } = self;
        let (free, Problem { dynamics, .. }) = (free.view(), problem.parts());
        check_pieces::<P::Dynamics, T>(dynamics)?;
        let parts = split::<P, T>(data.as_mut(), layout);
        let (v, multipliers) = iterate.variables_and_costates();
        let there = nodes::<P::Shape, T>(v, multipliers, &[], (parts.p, free), parts.times);
        let mut pieces = inner.pieces::<P::Shape>();
        pieces.forward(&there, true, &mut |nodes, sink| dynamics.linearise(nodes, sink))?;
        pieces.emit(intervals, true, false, |k, step| {
            algebraic::keep::<P::Shape, T>(parts.algebraic, free, k, step);
        });
        if C::EXACT {
            self.weigh()?;
            self.weigh_inside()?;
            let Self { problem, iterate, data, free, inner, .. } = self;
            let Problem { dynamics, .. } = problem.parts();
            let parts = split::<P, T>(data.as_mut(), layout);
            let (v, multipliers) = iterate.variables_and_costates();
            let there =
                nodes::<P::Shape, T>(v, multipliers, parts.weights, (parts.p, free.view()), parts.times);
            inner
                .pieces::<P::Shape>()
                .backward(&there, &mut |nodes, sink| curvature.run(dynamics, nodes, sink))?;
        }
        let Self { qp, iterate, inner, free, .. } = self;
        let ((v, _), ld, mut objective) =
            (iterate.variables_and_costates(), inputs_apart::<P::Shape, T>(layout), T::ZERO);
        let mut stages = qp.stages_mut();
        inner.pieces::<P::Shape>().emit(intervals, true, C::EXACT, |k, step| {
            let Some(mut stage) = stages.next() else { return };
            objective = objective + step.cost.value;
            to(k, step, (stage.arrays(), free.view()), part(v, k * ld, ld));
        });
        Ok((objective, [T::ZERO; 2]))
    }

    /// Simulates all pieces at some point, and shows the intervals.
    ///
    /// # Errors
    /// [`OcpError::Integration`], [`OcpError::Unsupported`]
    pub(in crate::ocp) fn simulate_pieces(
        &mut self,
        at: Option<&Solution<T, D, M>>,
        mut to: impl FnMut(usize, &IntervalResult<'_, T>),
    ) -> Result<(), OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let Self { problem, iterate, data, free, inner, .. } = self;
        let (free, Problem { dynamics, .. }) = (free.view(), problem.parts());
        check_pieces::<P::Dynamics, T>(dynamics)?;
        let data = split::<P, T>(data.as_mut(), layout);
        let (v, multipliers) = at.unwrap_or(iterate).variables_and_costates();
        let there = nodes::<P::Shape, T>(v, multipliers, &[], (data.p, free), data.times);
        let mut pieces = inner.pieces::<P::Shape>();
        pieces.forward(&there, false, &mut |nodes, sink| dynamics.simulate(nodes, sink))?;
        pieces.emit(intervals, false, false, |k, step| {
            algebraic::keep::<P::Shape, T>(data.algebraic, free, k, step);
            to(k, step);
        });
        Ok(())
    }

    /// What constraints at points add to multipliers and weights there.
    fn weigh_inside(&mut self) -> Result<(), OcpError> {
        let layout @ Layout { intervals, .. } = self.layout();
        let free = self.free.view();
        let Self { problem, iterate, data, inner, .. } = self;
        let data = split::<P, T>(data.as_mut(), layout);
        let Problem { stage_cost, path, running, .. } = problem.parts();
        let [nx, nz, n] = [P::Shape::NX, P::Shape::NZ, inputs::<P::Shape>(free.count())];
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        for (k, stage) in iterate.stages().enumerate().take(intervals) {
            for j in 1..=inner.count() {
                let node = inner.node::<P>(k, j, (data.times, data.p));
                let mut extended = core::mem::take(&mut inner.pieces.extended);
                let here = inner.at::<P::Shape>(k, j);
                node.read::<P::Shape>(&mut point, &SolutionStage { x: here.x, ..stage }, here.z, free);
                let Extended { mut terms, columns } = Extended::new::<P::Shape>(&mut extended, free);
                let mut linearised =
                    path.linearise(&point, &mut [], columns, terms.ld, Spot::new(k, free, &[]));
                if inner.has_costs_at_points() {
                    let own = Node::new::<P>(k, intervals, *running, [data.times, data.p, data.references]);
                    let factor = own.factor * if *running { inner.length(j) } else { T::ONE };
                    let factor = factor * if *running { free.duration(stage.u) } else { T::ONE };
                    let place = At { stage: k, factor, exact: false, from: &[] };
                    let added = stage_cost.add(&point, own.reference, place, &mut terms);
                    linearised = linearised.and(added.map(|_| ()));
                }
                let place = (j - 1) * intervals + k;
                let PieceMemory { weights, forces, .. } = &mut inner.pieces;
                let (forces, weights) = (part_mut(forces, place * nx, nx), part_mut(weights, place * nz, nz));
                crate::qp::copy_common(forces, terms.gradient);
                crate::qp::copy_common(weights, part(terms.gradient, n, nz));
                for (row, column) in columns.chunks_exact(terms.ld.max(1)).take(P::Path::ROWS).enumerate() {
                    let mu = multiplier(&stage, node_rows::<P, T>() + (j - 1) * P::Path::ROWS + row);
                    forces.iter_mut().zip(column).for_each(|(force, &slope)| *force = *force + mu * slope);
                    let of_z = part(column, n, nz);
                    weights.iter_mut().zip(of_z).for_each(|(weight, &slope)| *weight = *weight + mu * slope);
                }
                inner.pieces.extended = extended;
                linearised?;
                let first = node_rows::<P, T>() + inner.count() * P::Path::ROWS;
                for i in 0..inner.variables().len() {
                    let Some(&(variable, at)) = inner.variables().get(i) else { continue };
                    let PieceMemory { weights, forces, .. } = &mut inner.pieces;
                    let (to, index) = match variable.checked_sub(nx) {
                        None => (part_mut(forces, place * nx, nx), variable),
                        Some(z) => (part_mut(weights, place * nz, nz), z),
                    };
                    if let Some(to) = to.get_mut(index).filter(|_| at == j) {
                        *to = *to + multiplier(&stage, first + i);
                    }
                }
            }
        }
        Ok(())
    }
}

/// `λ_upper − λ_lower`
fn multiplier<T: Real>(stage: &SolutionStage<'_, T>, row: usize) -> T {
    get(stage.g_upper, row) - get(stage.g_lower, row)
}

/// The distance of stages in vectors `v`.
fn inputs_apart<S: Shape, T>(layout: Layout) -> usize {
    crate::qp::padded_len::<T>(inputs::<S>(layout.free))
}

/// Where rows of a stage are written.
pub(super) struct Rows<'a, 'b, 'c, T> {
    pub values: &'a mut [T],
    /// Columns of their derivatives, and the distance of these; none where values are enough.
    pub columns: &'a mut [T],
    pub ld: usize,
    /// Gradient and Hessian, where they are asked for.
    pub terms: Option<&'a mut Terms<'c, T>>,
    /// `μ` of all rows, if the Hessian is exact.
    pub mu: &'a [T],
    pub stage: SolutionStage<'b, T>,
    /// The number of the stage.
    pub k: usize,
}

impl<'a, 'b, T: Real> Rows<'a, 'b, '_, T> {
    /// Values alone.
    pub fn values(values: &'a mut [T], stage: SolutionStage<'b, T>, k: usize) -> Self {
        Self { values, columns: &mut [], ld: 0, terms: None, mu: &[], stage, k }
    }
}

/// Costs of a stage, which are at points too where controls are held.
pub(super) struct Costs<'a, C, T> {
    pub cost: &'a mut C,
    pub reference: &'a [T],
    pub running: bool,
    pub exact: bool,
}

impl<T: Real> InnerPoints<T> {
    /// The part of the interval from a point to the next one.
    fn length(&self, point: usize) -> T {
        self.part(point + 1) - self.part(point)
    }

    /// What is given at a point.
    fn node<'a, P: Formulation<T>>(
        &self,
        k: usize,
        point: usize,
        (times, p): (&'a [T], &'a [T]),
    ) -> Node<'a, T> {
        let [start, end] = [k, k + 1].map(|node| get(times, node));
        let (time, np) = (start + self.part(point) * (end - start), P::Shape::NP);
        Node { time, p: part(p, k * np, np), reference: &[], factor: T::ONE }
    }

    /// Writes the rows of a stage, with `z` and `∂z/∂(x, w, u)` at its node; costs at points.
    ///
    /// # Errors
    /// [`OcpError::NonFiniteFunction`]
    pub(super) fn write_rows<P: Formulation<T>>(
        &mut self,
        (path, mut costs): (&mut P::Path, Costs<'_, P::StageCost, T>),
        (z, dz): (&[T], &[T]),
        given: (&[T], &[T]),
        free: Free<'_>,
        rows: &mut Rows<'_, '_, '_, T>,
    ) -> Result<T, OcpError> {
        let mut sum = T::ZERO;
        let mut point = <P::Shape as Shape>::ArrayV::<T>::zeroed();
        let first = node_rows::<P, T>();
        for j in 1..=self.count() {
            let node = self.node::<P>(rows.k, j, given);
            let begin = first + (j - 1) * P::Path::ROWS;
            let mut extended = core::mem::take(&mut self.pieces.extended);
            let mut product = core::mem::take(&mut self.pieces.product);
            let here = self.at::<P::Shape>(rows.k, j);
            node.read::<P::Shape>(&mut point, &SolutionStage { x: here.x, ..rows.stage }, here.z, free);
            let interval = get(given.0, rows.k + 1) - get(given.0, rows.k);
            let factor = if costs.running { interval * self.length(j) } else { T::ONE };
            let costs = self.has_costs_at_points().then_some((&mut costs, factor));
            let memory = [&mut extended[..], &mut product[..]];
            let written = rows.write_point::<P>((&mut *path, costs), &point, (&here, free), begin, memory);
            (self.pieces.extended, self.pieces.product) = (extended, product);
            sum = sum + written?;
        }
        for i in 0..self.variables().len() {
            let row = first + self.count() * P::Path::ROWS + i;
            let Some(&(variable, at)) = self.variables().get(i) else { continue };
            let n = inputs::<P::Shape>(free.count());
            let column = part_mut(rows.columns, row * rows.ld, n);
            let value = match at {
                0 => {
                    let z_index = variable.saturating_sub(P::Shape::NX);
                    column.iter_mut().zip(part(dz, z_index * n, n)).for_each(|(to, &slope)| *to = slope);
                    get(z, z_index)
                }
                point => {
                    let here = self.at::<P::Shape>(rows.k, point);
                    for (a, to) in column.iter_mut().enumerate() {
                        *to = here.slope::<P::Shape>(variable, a, free);
                    }
                    match variable.checked_sub(P::Shape::NX) {
                        None => get(here.x, variable),
                        Some(z) => get(here.z, z),
                    }
                }
            };
            crate::qp::element::set(rows.values, row, value);
        }
        Ok(sum)
    }
}

impl<T: Real> Place<'_, T> {
    /// The derivative of a state, or behind these of an algebraic one, by one of `(x, w, u)`.
    fn slope<S: Shape>(&self, variable: usize, by: usize, free: Free<'_>) -> T {
        let Some(column) = column::<S>(by, free) else { return T::ZERO };
        match variable.checked_sub(S::NX) {
            None => get(self.dx, column * S::NX + variable),
            Some(z) => get(self.dz, column * S::NZ + z),
        }
    }
}

/// Which of `(x, u, p)` a variable in `(x, w, u)` is; copies of the first state are none of these.
fn column<S: Shape>(variable: usize, free: Free<'_>) -> Option<usize> {
    let Some(behind) = variable.checked_sub(S::NX) else { return Some(variable) };
    match behind.checked_sub(free.count()) {
        Some(u) => Some(S::NX + u),
        None => free.parameter(behind).map(|p| S::NX + S::NU + p),
    }
}

/// Costs at a point, and the factor that they have there.
type PointCosts<'a, 'c, C, T> = Option<(&'a mut Costs<'c, C, T>, T)>;

impl<T: Real> Rows<'_, '_, '_, T> {
    /// The path constraints at a point, from a row on, and costs there.
    #[allow(clippy::type_complexity)]
    fn write_point<P: Formulation<T>>(
        &mut self,
        (path, costs): (&mut P::Path, PointCosts<'_, '_, P::StageCost, T>),
        point: &<P::Shape as Shape>::ArrayV<T>,
        (here, free): (&Place<'_, T>, Free<'_>),
        begin: usize,
        [extended, product]: [&mut [T]; 2],
    ) -> Result<T, OcpError> {
        let count = P::Path::ROWS;
        let (values, spot) = (part_mut(self.values, begin, count), Spot::new(self.k, free, &[]));
        let (k, duration) = (self.k, free.duration(self.stage.u));
        let Some(terms) = &mut self.terms else {
            path.value(point, values, spot)?;
            let Some((costs, factor)) = costs else { return Ok(T::ZERO) };
            let factor = if costs.running { duration * factor } else { factor };
            return Ok(factor * costs.cost.value(point, costs.reference, k)?);
        };
        let (n, nx) = (inputs::<P::Shape>(free.count()), P::Shape::NX);
        let (ld, dependent) = (n + P::Shape::NZ, nx + P::Shape::NZ);
        // Where the states and the algebraic states of the point are in `(x, w, u, z)`.
        let place = |variable: usize| if variable < nx { variable } else { n + variable - nx };
        let slope = |variable: usize, a: usize| here.slope::<P::Shape>(variable, a, free);
        let mut own = Extended::new::<P::Shape>(extended, free);
        path.linearise(point, values, own.columns, ld, spot)?;
        let to = part_mut(self.columns, begin * self.ld, count * self.ld);
        for (to, mine) in to.chunks_exact_mut(self.ld).zip(own.columns.chunks_exact(ld)) {
            for (a, to) in to.iter_mut().enumerate().take(n) {
                let direct = if a < nx { T::ZERO } else { get(mine, a) };
                *to = (0..dependent).fold(direct, |sum, i| sum + get(mine, place(i)) * slope(i, a));
            }
        }
        let (mu, mut cost) = (part(self.mu, begin, count), T::ZERO);
        if mu.is_empty() && costs.is_none() {
            return Ok(cost);
        }
        if !mu.is_empty() {
            path.curve(point, mu, spot, &mut own.terms);
        }
        if let Some((costs, factor)) = costs {
            let end = free.end().filter(|_| costs.running);
            let factor = if end.is_some() { duration * factor } else { factor };
            let place = At { stage: k, factor, exact: costs.exact, from: &[] };
            cost = costs.cost.add(point, costs.reference, place, &mut own.terms)?;
            if let Some(w) = end {
                // Nothing else has a gradient here.
                let zeros = part_mut(product, 0, ld);
                zeros.fill(T::ZERO);
                own.terms.add_duration(w + nx, [cost, duration], zeros, costs.exact);
            }
        }
        for a in 0..n {
            let direct = if a < nx { T::ZERO } else { get(own.terms.gradient, a) };
            let force =
                (0..dependent).fold(direct, |sum, i| sum + get(own.terms.gradient, place(i)) * slope(i, a));
            terms.slope(a, force);
        }
        // Columns of `H M`, and then rows of `Mᵀ` times these.
        for (a, product) in product.chunks_exact_mut(ld).enumerate().take(n) {
            for (i, to) in product.iter_mut().enumerate() {
                let direct = if a < nx { T::ZERO } else { own.hessian(i, a) };
                *to = (0..dependent).fold(direct, |sum, l| sum + own.hessian(i, place(l)) * slope(l, a));
            }
            for b in a..n {
                let direct = if b < nx { T::ZERO } else { get(product, b) };
                let value = (0..dependent).fold(direct, |sum, l| sum + get(product, place(l)) * slope(l, b));
                terms.curve(b, a, value);
            }
        }
        Ok(cost)
    }
}
