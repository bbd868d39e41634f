//! A QP as one sparse problem, `min ½ zᵀ P z + qᵀ z`, `K z + s = b`, with rows of equations, then
//! inequalities, then cones.

use super::bounds::Bounds;
use super::coupling::marked_indices;
use super::layout::StageOffsetsIter;
use super::problem::QpView;
use super::stage::Stage;
use alloc::vec::Vec;

/// The origin of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RowOrigin {
    /// A row of the dynamics, by its index in the multipliers of the dynamics.
    Dynamics(usize),
    /// Two equal bounds, by their index in vectors over constraints.
    Equation(usize),
    /// A lower bound.
    Lower(usize),
    /// An upper bound.
    Upper(usize),
    /// The sign of a violation variable.
    Sign,
    /// A periodic state or a shared control; its multiplier is not used.
    Coupling,
    /// An element of a cone.
    Cone(usize),
}

/// A second-order cone: rows `first .. first + count` of the general constraints of a stage, less
/// their lower bounds; the first row is at least the norm of the others. Upper bounds of these rows
/// are ignored.
///
/// ```
/// use casados::qp::*;
///
/// // The point of the disc ‖u‖ ≤ 1 that is nearest to (3, 4): rows 0 + 1, u₀, u₁ in the cone.
/// let dims = [StageDims::new(0, 2, 3), StageDims::new(0, 0, 0)];
/// let mut qp = HeapQp::<f64>::new(&dims)?;
/// let mut stage = qp.stage_mut(0).ok_or(QpError::OutOfMemory { bytes: 0 })?;
/// for i in 0..2 {
///     stage.r_mut().set(i, i, 1.0);
///     stage.d_mut().set(1 + i, i, 1.0);
/// }
/// stage.gradient_u_mut().copy_from_slice(&[-3.0, -4.0]);
/// // Row less lower bound: the first one is 0 − (−1) = 1.
/// for (row, lower) in [-1.0, 0.0, 0.0].into_iter().enumerate() {
///     stage.g_bounds_mut().set(row, lower, f64::INFINITY);
/// }
/// let mut clarabel = Clarabel::new();
/// clarabel.cones.push(SecondOrderCone { stage: 0, first: 0, count: 3 });
/// let mut solution = HeapSolution::new(&dims)?;
/// clarabel.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// let u = solution.stages().next().map_or(vec![], |stage| stage.u.to_vec());
/// assert!((u[0] - 0.6).abs() < 1e-6 && (u[1] - 0.8).abs() < 1e-6);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SecondOrderCone {
    /// The stage.
    pub stage: usize,
    /// The first row.
    pub first: usize,
    /// The number of rows.
    pub count: usize,
}

/// Nonzero elements of a matrix, `(column, row, value)`, in any order without duplicates.
#[derive(Debug, Default)]
pub struct Triplets {
    pub elements: Vec<(usize, usize, f64)>,
}

impl Triplets {
    fn add(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.elements.push((column, row, value));
        }
    }
}

/// The sparse problem.
#[derive(Debug, Default)]
pub struct Sparse {
    /// The upper triangle of `P`.
    pub p: Triplets,
    pub q: Vec<f64>,
    pub k: Triplets,
    pub b: Vec<f64>,
    /// The origins of the rows.
    pub origins: Vec<RowOrigin>,
    /// The first column of the variables `v` of each stage.
    pub columns: Vec<usize>,
    /// The number of equations.
    pub equations: usize,
    /// The sizes of the cones.
    pub cones: Vec<usize>,
}

/// A row of a stage over its variables, without sign and right-hand side.
struct ConstraintRow<'a> {
    stage: &'a Stage<'a, f64>,
    column: usize,
    /// The index of a variable, or `n` plus that of a general constraint.
    index: usize,
}

impl ConstraintRow<'_> {
    fn add(&self, k: &mut Triplets, row: usize, sign: f64) {
        let dims = self.stage.dims();
        let n = dims.nx + dims.nu;
        let Some(general) = self.index.checked_sub(n) else {
            return k.add(row, self.column + self.index, sign);
        };
        for j in 0..dims.nx {
            k.add(row, self.column + j, sign * self.stage.c().get(general, j).unwrap_or(0.0));
        }
        for j in 0..dims.nu {
            k.add(row, self.column + dims.nx + j, sign * self.stage.d().get(general, j).unwrap_or(0.0));
        }
    }
}

/// The bounds of one row.
struct RowBounds {
    lower: (f64, f64, f64),
    upper: (f64, f64, f64),
}

fn row_bounds(bounds: &Bounds<'_, f64>, i: usize) -> Option<RowBounds> {
    let at = |slice: &[f64]| slice.get(i).copied();
    Some(RowBounds {
        lower: (at(bounds.lower)?, at(bounds.lower_linear)?, at(bounds.lower_quadratic)?),
        upper: (at(bounds.upper)?, at(bounds.upper_linear)?, at(bounds.upper_quadratic)?),
    })
}

impl Sparse {
    /// The sparse problem of a QP.
    pub fn new(qp: QpView<'_, f64>, cones: &[SecondOrderCone]) -> Self {
        let mut sparse = Self::default();
        for dims in qp.dims() {
            sparse.columns.push(sparse.q.len());
            sparse.q.resize(sparse.q.len() + dims.nx + dims.nu, 0.0);
        }
        for (stage, &column) in qp.stages().zip(&sparse.columns) {
            cost(&mut sparse.p, &mut sparse.q, &stage, column);
        }
        for (k, (stage, place)) in qp.stages().zip(StageOffsetsIter::<f64>::new(qp.dims())).enumerate() {
            let (Some(&here), next) = (sparse.columns.get(k), sparse.columns.get(k + 1).copied()) else {
                break;
            };
            for i in 0..place.next {
                let row = sparse.row(
                    RowOrigin::Dynamics(place.dynamics + i),
                    -stage.offset().get(i).copied().unwrap_or(0.0),
                );
                for j in 0..place.nx {
                    sparse.k.add(row, here + j, stage.a().get(i, j).unwrap_or(0.0));
                }
                for j in 0..place.nu {
                    sparse.k.add(row, here + place.nx + j, stage.b().get(i, j).unwrap_or(0.0));
                }
                sparse.k.add(row, next.map_or(0, |next| next + i), -1.0);
            }
        }
        sparse.add_coupling_rows(qp);
        // Equations precede inequalities, and inequalities cones.
        for pass in 0..2 {
            for (k, (stage, place)) in qp.stages().zip(StageOffsetsIter::<f64>::new(qp.dims())).enumerate() {
                let Some(&column) = sparse.columns.get(k) else { break };
                let kinds = [stage.x_bounds(), stage.u_bounds(), stage.g_bounds()];
                for (index, (bounds, i)) in
                    kinds.iter().flat_map(|b| (0..b.lower.len()).map(move |i| (b, i))).enumerate()
                {
                    let general = index.checked_sub(place.n);
                    let in_cone = |cone: &SecondOrderCone| {
                        cone.stage == k
                            && general.is_some_and(|g| (cone.first..cone.first + cone.count).contains(&g))
                    };
                    if cones.iter().any(in_cone) {
                        continue;
                    }
                    let row = place.row + general.map_or(index, |general| place.ld + general);
                    let Some(limits) = row_bounds(bounds, i) else { continue };
                    sparse.constraint(
                        &ConstraintRow { stage: &stage, column, index },
                        row,
                        &limits,
                        pass == 0,
                    );
                }
            }
            if pass == 0 {
                sparse.equations = sparse.b.len();
            }
        }
        for cone in cones {
            let (Some(stage), Some(&column)) = (qp.stage(cone.stage), sparse.columns.get(cone.stage)) else {
                continue;
            };
            let Some(place) = StageOffsetsIter::<f64>::new(qp.dims()).nth(cone.stage) else { continue };
            for general in cone.first..cone.first + cone.count {
                let lower = stage.g_bounds().lower.get(general).copied().unwrap_or(0.0);
                let row = sparse.row(RowOrigin::Cone(place.row + place.ld + general), -lower);
                ConstraintRow { stage: &stage, column, index: place.n + general }.add(
                    &mut sparse.k,
                    row,
                    -1.0,
                );
            }
            sparse.cones.push(cone.count);
        }
        sparse
    }

    /// Adds the differences of coupled variables.
    fn add_coupling_rows(&mut self, qp: QpView<'_, f64>) {
        let columns = self.columns.clone();
        let mut equal = |first: usize, other: usize| {
            let row = self.row(RowOrigin::Coupling, 0.0);
            self.k.add(row, first, 1.0);
            self.k.add(row, other, -1.0);
        };
        let ends = (columns.first().copied(), columns.last().copied());
        let (Some(first), Some(last), Some(dims)) = (ends.0, ends.1, qp.dims().first()) else { return };
        marked_indices(qp.periodic()).for_each(|i| equal(first + i, last + i));
        for j in marked_indices(qp.shared()) {
            for (dims_k, column) in qp.dims().iter().zip(&columns).skip(1).filter(|(dims, _)| j < dims.nu) {
                equal(first + dims.nx + j, column + dims_k.nx + j);
            }
        }
    }

    fn row(&mut self, origin: RowOrigin, b: f64) -> usize {
        self.origins.push(origin);
        self.b.push(b);
        self.b.len() - 1
    }

    /// Adds one equation, or the inequalities of a row.
    fn constraint(&mut self, line: &ConstraintRow<'_>, row: usize, limits: &RowBounds, equations: bool) {
        let RowBounds { lower, upper } = limits;
        let hard = lower.1.is_infinite() && upper.1.is_infinite();
        if hard && lower.0 == upper.0 {
            if equations {
                let k = self.row(RowOrigin::Equation(row), lower.0);
                line.add(&mut self.k, k, 1.0);
            }
            return;
        }
        if equations {
            return;
        }
        for (sign, &(bound, linear, quadratic), origin) in
            [(-1.0, lower, RowOrigin::Lower(row)), (1.0, upper, RowOrigin::Upper(row))]
        {
            if bound.is_infinite() || (linear == 0.0 && quadratic == 0.0) {
                continue;
            }
            let k = self.row(origin, sign * bound);
            line.add(&mut self.k, k, sign);
            if linear.is_finite() {
                // A violation variable.
                let violation = self.q.len();
                self.q.push(linear);
                self.p.add(violation, violation, quadratic);
                self.k.add(k, violation, -1.0);
                let k = self.row(RowOrigin::Sign, 0.0);
                self.k.add(k, violation, -1.0);
            }
        }
    }
}

fn cost(p: &mut Triplets, q: &mut [f64], stage: &Stage<'_, f64>, column: usize) {
    let dims = stage.dims();
    for i in 0..dims.nx {
        for j in 0..=i {
            p.add(column + j, column + i, stage.q().get(i, j).unwrap_or(0.0));
        }
    }
    for i in 0..dims.nu {
        for j in 0..dims.nx {
            p.add(column + j, column + dims.nx + i, stage.s().get(i, j).unwrap_or(0.0));
        }
        for j in 0..=i {
            p.add(column + dims.nx + j, column + dims.nx + i, stage.r().get(i, j).unwrap_or(0.0));
        }
    }
    let linear = stage.gradient_x().iter().chain(stage.gradient_u());
    for (q, &linear) in q.get_mut(column..).unwrap_or_default().iter_mut().zip(linear) {
        *q = linear;
    }
}
