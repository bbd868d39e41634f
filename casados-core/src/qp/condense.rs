//! Partial condensing: the states inside of blocks of intervals are eliminated.
//!
//! A block of stages `k .. k + m` becomes one stage with the state `x_k` and the controls
//! `(u_{k+m−1}, …, u_k)`, latest first. Bounds of eliminated states become general constraints.
//! Backwards over the block, with `V` the Hessian of what comes later and `Z` the rows that depend
//! on `x_{j+1}` (mixed second derivatives, constraints, and `x_{k+m}` itself):
//!
//! ```text
//! V ← H_j + [A B]ᵀ V [A B]        Z ← Z [A B]
//! ```
//!
//! Short blocks pay where there are few controls: the Riccati recursion then goes over larger
//! matrices fewer times, and less memory passes by in each iteration.

use super::error::{Field, QpError};
use super::interior::{
    Columns, MORE, Part, Source, add_symmetric, add_transposed, product, subtract, symmetric,
};
use super::layout::{Place, Places, StageDims, assign, pad, part, part_mut};
use super::memory::reserve;
use super::problem::{HeapQp, QpView, Row};
use super::solution::{HeapSolution, SolutionView};
use super::solver::{QpSolver, Start};
use super::statistics::Statistics;
use crate::scalar::{Packed, Real, Registers};
use alloc::vec::Vec;

/// A solver that sees problems condensed in blocks of some intervals.
///
/// Memory is on the heap, and allocated by the first call and by those with larger problems.
#[derive(Clone, Debug)]
pub struct Condensing<T, S> {
    /// The solver of condensed problems.
    pub solver: S,
    /// Intervals of a block.
    block: usize,
    qp: Option<(HeapQp<T>, HeapSolution<T>)>,
    dims: Vec<StageDims>,
    /// The dimensions of the call before.
    old: Vec<StageDims>,
    /// Where general constraints come from.
    rows: Vec<Origin>,
    /// What the rows of `Z` are.
    origins: Vec<Origin>,
    work: Vec<T>,
}

/// What a row of `Z` is, or where a constraint of the condensed problem comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Origin {
    kind: Kind,
    /// The stage it comes from.
    stage: usize,
    /// A state or control of it, or its row in vectors over constraints.
    index: usize,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Kind {
    /// A state at the end of the block.
    #[default]
    State,
    /// A control.
    Control,
    /// A general constraint, or a bound of an eliminated state.
    Constraint,
}

impl<T: Real, S> Condensing<T, S> {
    /// A solver for blocks of `block` intervals. With one interval, or zero, nothing is condensed;
    /// with as many as there are, or more, one state is left.
    #[must_use]
    pub fn new(block: usize, solver: S) -> Self {
        let (dims, old, rows, origins, work) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { solver, block: block.max(1), qp: None, dims, old, rows, origins, work }
    }
}

/// Bounds and penalties of one row.
fn limits<T: Real>(data: &[T], place: &Place, row: usize) -> [T; 6] {
    let all = [
        Row::Lower,
        Row::Upper,
        Row::LowerLinear,
        Row::LowerQuadratic,
        Row::UpperLinear,
        Row::UpperQuadratic,
    ];
    all.map(|vector| part(data, place.row_data(vector) + row, 1).first().copied().unwrap_or(T::ZERO))
}

/// Whether a row has a bound.
fn is_bounded<T: Real>([lower, upper, ..]: [T; 6]) -> bool {
    lower.is_finite() || upper.is_finite()
}

/// The stages of the blocks: all but the last stage in blocks, and the last one by itself.
fn blocks(stages: usize, block: usize) -> impl Iterator<Item = core::ops::Range<usize>> {
    let last = stages.saturating_sub(1);
    (0..last).step_by(block).map(move |k| k..(k + block).min(last)).chain(core::iter::once(last..stages))
}

impl<T: Real, S> Condensing<T, S> {
    /// Dimensions of the condensed problem, and where its general constraints come from, stage by
    /// stage.
    fn plan(&mut self, qp: QpView<'_, T>) -> Result<(), QpError> {
        core::mem::swap(&mut self.dims, &mut self.old);
        self.dims.clear();
        self.rows.clear();
        // As much as there can be, so that no later call needs more.
        let stages = self.dims.try_reserve(qp.dims.len());
        let most = qp.dims.iter().map(|d| d.nx + d.ng).sum();
        stages.and(self.rows.try_reserve(most)).map_err(|_| QpError::OutOfMemory { bytes: most })?;
        let mut places = Places::<T>::new(qp.dims);
        for block in blocks(qp.dims.len(), self.block) {
            let mut condensed = StageDims::default();
            for stage in block.clone() {
                let Some(place) = places.next() else { break };
                let data = part(qp.data, place.data, place.data_len());
                condensed.nu += place.nu;
                if stage == block.start {
                    condensed.nx = place.nx;
                }
                let inner = if stage > block.start { 0..place.nx } else { 0..0 };
                for index in inner.chain(place.ld..place.ld + place.ng) {
                    if index >= place.ld || is_bounded(limits(data, &place, index)) {
                        condensed.ng += 1;
                        self.rows.push(Origin { kind: Kind::Constraint, stage, index });
                    }
                }
            }
            self.dims.push(condensed);
        }
        if self.dims != self.old || self.qp.is_none() {
            self.qp = Some((HeapQp::new(&self.dims)?, HeapSolution::new(&self.dims)?));
        }
        Ok(())
    }
}

/// The matrices of the recursion, in one memory.
struct Work<'a, T> {
    /// `Z`, of the next state, then of `(x, u)`
    z: &'a mut [T],
    z_next: &'a mut [T],
    /// `V`, and its next value
    v: &'a mut [T],
    m: &'a mut [T],
    /// `−[A B]ᵀ`
    minus: &'a mut [T],
    /// `−[A B]ᵀ V`
    w: &'a mut [T],
    /// What is constant in rows of `Z`, or their gradient.
    constant: &'a mut [T],
    /// Gradient with respect to the next state, and to `(x, u)`
    g: &'a mut [T],
    g_next: &'a mut [T],
    offset: &'a mut [T],
    ld_z: usize,
}

/// The largest dimensions.
struct Largest {
    n: usize,
    nx: usize,
    rows: usize,
}

impl<'a, T: Real> Work<'a, T> {
    fn lengths(largest: &Largest) -> [usize; 10] {
        let (ld, ld_x, ld_z) = (pad::<T>(largest.n), pad::<T>(largest.nx), pad::<T>(largest.rows));
        let n = largest.n + MORE;
        [ld_z * n, ld_z * n, ld_x * n, ld * n, ld * n, ld * n, ld_z, ld, ld, ld_x]
    }
    fn new(largest: &Largest, mut memory: &'a mut [T]) -> Self {
        let mut parts =
            Self::lengths(largest).into_iter().map(|length| super::layout::take_mut(&mut memory, length));
        let mut next = || parts.next().unwrap_or_default();
        Self {
            z: next(),
            z_next: next(),
            v: next(),
            m: next(),
            minus: next(),
            w: next(),
            constant: next(),
            g: next(),
            g_next: next(),
            offset: next(),
            ld_z: pad::<T>(largest.rows),
        }
    }
}

/// Writes the condensed problem.
struct Condense<'a, T> {
    qp: QpView<'a, T>,
    block: usize,
    rows: &'a [Origin],
    work: Work<'a, T>,
    dims: &'a [StageDims],
    target: &'a mut [T],
    /// Room for what the rows of `Z` are.
    origins: &'a mut Vec<Origin>,
}

impl<T: Real> Registers<T> for Condense<'_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(mut self) {
        let mut rows = self.rows;
        let targets = Places::<T>::new(self.dims);
        for (block, to) in blocks(self.qp.dims.len(), self.block).zip(targets) {
            let (here, others) = rows.split_at_checked(to.ng).unwrap_or_default();
            rows = others;
            self.block::<E>(block, &to, here);
        }
    }
}

impl<T: Real> Condense<'_, T> {
    /// One block.
    #[inline(always)]
    fn block<E: Packed<T>>(&mut self, block: core::ops::Range<usize>, to: &Place, rows: &[Origin]) {
        let Work { z, z_next, v, m, minus, w, constant, g, g_next, offset, ld_z } = &mut self.work;
        let (ld_z, origins) = (*ld_z, &mut *self.origins);
        let target = part_mut(self.target, to.data, to.data_len());
        part_mut(target, 0, to.matrix()).fill(T::ZERO);
        origins.clear();
        let mut controls = 0;
        let mut first = true;
        let stages = Places::<T>::new(self.qp.dims).skip(block.start).take(block.len());
        for place in stages.rev() {
            let Place { nx, nu, n, ld, next, ld_next, stage, .. } = place;
            let data = part(self.qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let negative = part_mut(minus, 0, ld * next);
            for (negative, &element) in negative.iter_mut().zip(matrix.data) {
                *negative = -element;
            }
            let negative = Columns { data: &*negative, ld };
            let linear = part(data, place.gradient(), ld);
            let b = part(data, place.offset(), next);
            g_next.iter_mut().zip(linear).for_each(|(g, &linear)| *g = linear);
            let old = origins.len();
            if first {
                // x at the end of the block is A x + B u + b, and costs nothing here.
                for i in 0..next {
                    origins.push(Origin { kind: Kind::State, stage: stage + 1, index: i });
                    for (j, &element) in part(matrix.data, i * ld, n).iter().enumerate() {
                        set(z_next, j * ld_z + i, element);
                    }
                    set(constant, i, b.get(i).copied().unwrap_or(T::ZERO));
                }
                let hessian = part(data, place.matrix(), place.hessian());
                assign(part_mut(m, 0, hessian.len()), hessian);
            } else {
                // g + V b, and constants + Z b
                for (offset, &b) in offset.iter_mut().zip(b) {
                    *offset = -b;
                }
                subtract::<T, E>(g, Columns { data: v, ld: ld_next }, offset, next, next);
                subtract::<T, E>(constant, Columns { data: z, ld: ld_z }, offset, old, next);
                subtract::<T, E>(g_next, negative, g, n, next);
                let y = Columns { data: v, ld: ld_next };
                product::<T, E>(w, ld, Source::Zero, matrix, y, (n, 0..next, next), Part::Full);
                let hessian =
                    Source::Matrix(Columns { data: part(data, place.matrix(), place.hessian()), ld });
                let y = Columns { data: w, ld };
                product::<T, E>(m, ld, hessian, matrix, y, (n, 0..n, next), Part::Lower);
                let x = Columns { data: z, ld: ld_z };
                product::<T, E>(z_next, ld_z, Source::Zero, x, negative, (old, 0..n, next), Part::Full);
            }
            first = false;
            // What belongs to the controls of this stage is done.
            for i in 0..nu {
                let column = part(z_next, (nx + i) * ld_z, origins.len());
                for (origin, &element) in origins.iter().zip(column) {
                    set(target, at(to, origin, to.nx + controls + i), element);
                }
                for j in i..nu {
                    let element = get(m, (nx + i) * ld + nx + j);
                    let (row, column) = (to.nx + controls + j, to.nx + controls + i);
                    set(target, to.matrix() + column * to.ld + row, element);
                }
                for (vector, value) in limits(data, &place, nx + i).into_iter().enumerate() {
                    set(target, to.row_data(Row::Lower) + vector * to.rows + to.nx + controls + i, value);
                }
            }
            // Its rows of Z: mixed derivatives with respect to its controls, and its constraints.
            for i in 0..nu {
                let row = origins.len();
                origins.push(Origin { kind: Kind::Control, stage, index: controls + i });
                for j in 0..nx {
                    set(z_next, j * ld_z + row, get(m, j * ld + nx + i));
                }
                set(constant, row, get(g_next, nx + i));
            }
            controls += nu;
            for (index, origin) in rows.iter().enumerate().filter(|(_, origin)| origin.stage == stage) {
                let row = origins.len();
                origins.push(Origin { index, ..*origin });
                let general = origin.index.checked_sub(ld);
                for j in 0..n {
                    let element = match general {
                        Some(general) => get(matrix.data, (next + general) * ld + j),
                        None if origin.index == j => T::ONE,
                        None => T::ZERO,
                    };
                    if j < nx {
                        set(z_next, j * ld_z + row, element);
                    } else {
                        let column = to.nx + controls - nu + j - nx;
                        set(target, (to.next + index) * to.ld + column, element);
                    }
                }
                set(constant, row, T::ZERO);
                for (vector, value) in limits(data, &place, origin.index).into_iter().enumerate() {
                    set(target, to.row_data(Row::Lower) + vector * to.rows + to.ld + index, value);
                }
            }
            // What is left is a function of this stage's state.
            core::mem::swap(z, z_next);
            let ld_x = pad::<T>(nx);
            for j in 0..nx {
                for i in j..nx {
                    let element = get(m, j * ld + i);
                    set(v, j * ld_x + i, element);
                    set(v, i * ld_x + j, element);
                }
            }
            assign(part_mut(g, 0, nx), part(g_next, 0, nx));
            part_mut(g, nx, g.len() - nx.min(g.len())).fill(T::ZERO);
            if stage == block.start {
                for j in 0..nx {
                    for i in j..nx {
                        set(target, to.matrix() + j * to.ld + i, get(m, j * ld + i));
                    }
                    for (row, origin) in origins.iter().enumerate() {
                        set(target, at(to, origin, j), get(z, j * ld_z + row));
                    }
                    set(target, to.gradient() + j, get(g, j));
                    for (vector, value) in limits(data, &place, j).into_iter().enumerate() {
                        set(target, to.row_data(Row::Lower) + vector * to.rows + j, value);
                    }
                }
            }
        }
        for (row, origin) in origins.iter().enumerate() {
            let constant = get(constant, row);
            match origin.kind {
                Kind::State => set(target, to.offset() + origin.index, constant),
                Kind::Control => set(target, to.gradient() + to.nx + origin.index, constant),
                Kind::Constraint => {
                    for vector in [Row::Lower, Row::Upper] {
                        let at = to.row_data(vector) + to.ld + origin.index;
                        let bound = get(target, at);
                        set(target, at, bound - constant);
                    }
                }
            }
        }
    }
}

/// Where the element of a row of `Z` with a variable of the condensed stage lies.
fn at(to: &Place, origin: &Origin, variable: usize) -> usize {
    match origin.kind {
        Kind::State => origin.index * to.ld + variable,
        Kind::Constraint => (to.next + origin.index) * to.ld + variable,
        // Below the diagonal: a later control comes first, so this is its row with states, and its
        // column with controls.
        Kind::Control if variable < to.nx => to.matrix() + variable * to.ld + to.nx + origin.index,
        Kind::Control => to.matrix() + (to.nx + origin.index) * to.ld + variable,
    }
}

fn get<T: Real>(slice: &[T], index: usize) -> T {
    slice.get(index).copied().unwrap_or(T::ZERO)
}

fn set<T>(slice: &mut [T], index: usize, value: T) {
    if let Some(element) = slice.get_mut(index) {
        *element = value;
    }
}

/// Copies variables and multipliers between a solution and that of the condensed problem.
fn copy<T: Real>(
    (qp, block, rows): (QpView<'_, T>, usize, &[Origin]),
    full: SolutionView<'_, T>,
    condensed: SolutionView<'_, T>,
    expand: bool,
) {
    let mut rows = rows;
    for (block, to) in blocks(qp.dims.len(), block).zip(Places::<T>::new(condensed.dims)) {
        let (here, others) = rows.split_at_checked(to.ng).unwrap_or_default();
        rows = others;
        let mut controls = to.nx + to.nu;
        for place in Places::<T>::new(qp.dims).skip(block.start).take(block.len()) {
            controls -= place.nu.min(controls);
            let states = if place.stage == block.start { place.nx } else { 0 };
            let pairs =
                (0..states).map(|i| (i, i)).chain((0..place.nu).map(|i| (place.nx + i, controls + i)));
            for (a, b) in pairs {
                exchange(full.v, place.v + a, condensed.v, to.v + b, expand);
                exchange(full.lower, place.row + a, condensed.lower, to.row + b, expand);
                exchange(full.upper, place.row + a, condensed.upper, to.row + b, expand);
            }
            for (index, origin) in here.iter().enumerate().filter(|(_, origin)| origin.stage == place.stage) {
                let (a, b) = (place.row + origin.index, to.row + to.ld + index);
                exchange(full.lower, a, condensed.lower, b, expand);
                exchange(full.upper, a, condensed.upper, b, expand);
            }
            if place.stage + 1 == block.end {
                for i in 0..place.next {
                    exchange(full.dynamics, place.dynamics + i, condensed.dynamics, to.dynamics + i, expand);
                }
            }
        }
    }
}

fn exchange<T: Real>(full: &mut [T], a: usize, condensed: &mut [T], b: usize, expand: bool) {
    if expand {
        set(full, a, get(condensed, b));
    } else {
        set(condensed, b, get(full, a));
    }
}

/// The states and multipliers that were eliminated.
struct Expand<'a, 's, T> {
    qp: QpView<'a, T>,
    block: usize,
    solution: SolutionView<'s, T>,
    /// Room for a vector over next states and general constraints, and for a gradient.
    minus: &'a mut [T],
    g: &'a mut [T],
}

impl<T: Real> Registers<T> for Expand<'_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { qp, block, solution: SolutionView { v, dynamics, lower, upper, .. }, minus, g } = self;
        let inside = |stage: usize| !stage.is_multiple_of(block) && stage + 1 < qp.dims.len();
        for place in Places::<T>::new(qp.dims).filter(|place| inside(place.stage + 1)) {
            let Place { n, ld, next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let (here, coming) = v.split_at_mut_checked(place.v + ld).unwrap_or_default();
            let coming = part_mut(coming, 0, next);
            assign(coming, part(data, place.offset(), next));
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            add_transposed::<T, E>(coming, matrix, part(here, place.v, ld), n, next);
        }
        for place in Places::<T>::new(qp.dims).rev().filter(|place| inside(place.stage)) {
            let Place { nx, n, ng, ld, next, .. } = place;
            let data = part(qp.data, place.data, place.data_len());
            let matrix = Columns { data: part(data, 0, place.matrix()), ld };
            let (lower, upper) = (part(lower, place.row, place.rows), part(upper, place.row, place.rows));
            let g = part_mut(g, 0, ld);
            for ((g, &linear), (&lower, &upper)) in
                g.iter_mut().zip(part(data, place.gradient(), ld)).zip(lower.iter().zip(upper))
            {
                *g = linear + upper - lower;
            }
            let hessian = part(data, place.matrix(), place.hessian());
            symmetric::<T, E>(g, hessian, ld, part(v, place.v, ld), n);
            for (minus, &pi) in minus.iter_mut().zip(part(dynamics, place.dynamics, next)) {
                *minus = -pi;
            }
            let forces = part(lower, ld, ng).iter().zip(part(upper, ld, ng));
            for (minus, (&lower, &upper)) in part_mut(minus, next, ng).iter_mut().zip(forces) {
                *minus = lower - upper;
            }
            subtract::<T, E>(g, matrix, minus, n, next + ng);
            let before = place.dynamics.saturating_sub(pad::<T>(nx));
            assign(part_mut(dynamics, before, nx), part(g, 0, nx));
        }
    }
}

impl<T: Real, S: QpSolver<T>> QpSolver<T> for Condensing<T, S> {
    fn relax(&mut self, tolerance: f64) {
        self.solver.relax(tolerance);
    }
    fn refine(&mut self, tolerance: f64) {
        self.solver.refine(tolerance);
    }

    fn solve(
        &mut self,
        qp: QpView<'_, T>,
        start: Start,
        mut solution: SolutionView<'_, T>,
    ) -> Result<Statistics, QpError> {
        super::check::check_all_bounds(qp)?;
        solution.fits(qp)?;
        if qp.is_coupled() {
            return Err(QpError::Coupled);
        }
        self.plan(qp)?;
        let Self {
            solver, block, qp: Some((condensed, start_and_solution)), dims, rows, origins, work, ..
        } = self
        else {
            return Err(QpError::OutOfMemory { bytes: 0 });
        };
        let places = Places::<T>::new(qp.dims);
        let largest = Largest {
            n: places.clone().map(|p| p.n).max().unwrap_or(0),
            nx: places.clone().map(|p| p.nx).max().unwrap_or(0),
            rows: Places::<T>::new(dims).map(|p| p.next + p.nu + p.ng).max().unwrap_or(0),
        };
        let most = places.map(|p| pad::<T>(p.next + p.ng)).max().unwrap_or(0);
        let condensed_n = dims.iter().map(|d| d.nx + d.nu).max().unwrap_or(0);
        let room = most + pad::<T>(largest.n) + pad::<T>(condensed_n);
        let length = Work::<T>::lengths(&largest).iter().sum::<usize>() + room;
        reserve(work, length)?;
        origins.clear();
        origins.try_reserve(largest.rows).map_err(|_| QpError::OutOfMemory { bytes: largest.rows })?;
        let target = condensed.data_mut();
        let matrices = Work::new(&largest, work);
        T::registers(Condense { qp, block: *block, rows, work: matrices, dims, target, origins });
        if start == Start::Warm {
            copy((qp, *block, rows), solution.reborrow(), start_and_solution.view_mut(), false);
        }
        let result = solver.solve(condensed.view(), start, start_and_solution.view_mut());
        copy((qp, *block, rows), solution.reborrow(), start_and_solution.view_mut(), true);
        let (minus, g) = work.split_at_mut_checked(most).unwrap_or_default();
        T::registers(Expand { qp, block: *block, solution: solution.reborrow(), minus, g });
        result.map_err(|error| translate(error, qp, *block, dims, rows)).map(|statistics| {
            // Penalties are the same; what is constant in eliminated states is in none of the
            // condensed costs.
            let g = work.get_mut(..pad::<T>(largest.n.max(condensed_n))).unwrap_or_default();
            let difference = quadratic(qp, solution.v, g)
                - quadratic(condensed.view(), start_and_solution.view_mut().v, g);
            Statistics { objective: statistics.objective + difference, ..statistics }
        })
    }
}

/// `Σ ½ vᵀ H v + hᵀ v`, with room for a vector over the variables of a stage.
fn quadratic<T: Real>(qp: QpView<'_, T>, v: &[T], product: &mut [T]) -> f64 {
    let mut sum = 0.0;
    for place in Places::<T>::new(qp.dims) {
        let data = part(qp.data, place.data, place.data_len());
        let (v, product) = (part(v, place.v, place.ld), part_mut(product, 0, place.ld));
        product.fill(T::ZERO);
        add_symmetric(product, part(data, place.matrix(), place.hessian()), place.ld, v, place.n);
        for ((&v, &product), &linear) in v.iter().zip(&*product).zip(part(data, place.gradient(), place.n)) {
            sum += v.to_f64() * (0.5 * product.to_f64() + linear.to_f64());
        }
    }
    sum
}

/// An error in terms of the problem that was not condensed.
fn translate<T: Real>(
    error: QpError,
    qp: QpView<'_, T>,
    size: usize,
    dims: &[StageDims],
    rows: &[Origin],
) -> QpError {
    let find = |stage: usize, field: Field, index: usize| {
        let range = blocks(qp.dims.len(), size).nth(stage)?;
        match field {
            Field::GeneralBounds => {
                let before = dims.get(..stage)?.iter().map(|d| d.ng).sum::<usize>();
                let origin = rows.get(before + index)?;
                let place = Places::<T>::new(qp.dims).nth(origin.stage)?;
                let (field, index) = place.name(origin.index);
                Some((origin.stage, field, index))
            }
            Field::ControlBounds => {
                let mut left = index;
                for stage in range.rev() {
                    let nu = qp.dims.get(stage)?.nu;
                    if left < nu {
                        return Some((stage, field, left));
                    }
                    left -= nu;
                }
                None
            }
            _ => Some((range.start, field, index)),
        }
    };
    match error {
        QpError::Infeasible { field, stage, index, side, violation } => {
            let (stage, field, index) = find(stage, field, index).unwrap_or((stage, field, index));
            QpError::Infeasible { field, stage, index, side, violation }
        }
        QpError::NotConvex { stage, index, pivot } => {
            let found = find(stage, Field::ControlBounds, index);
            let (stage, _, index) = found.unwrap_or((stage, Field::ControlBounds, index));
            QpError::NotConvex { stage, index, pivot }
        }
        QpError::InvalidValue { .. } | QpError::CrossedBounds { .. } => match super::check::check(qp) {
            Err(found) => found,
            Ok(()) => error,
        },
        others => others,
    }
}
