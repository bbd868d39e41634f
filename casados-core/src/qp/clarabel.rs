//! The solver Clarabel as a [`QpSolver`] (feature `clarabel`).

use super::check::check;
use super::error::{QpError, QpField, Side};
use super::layout::StageOffsetsIter;
use super::problem::QpView;
use super::solution::SolutionView;
use super::solver::{QpSolver, QpStart};
pub use super::sparse::SecondOrderCone;
use super::sparse::{RowOrigin, Sparse, Triplets};
use super::statistics::{QpStatistics, Residuals};
use alloc::vec::Vec;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// Clarabel's interior point for sparse problems.
///
/// It is slower than [`InteriorPoint`](super::InteriorPoint), but supports second-order cones and
/// shares no code with it. Every start is cold. The symbolic factorisation is reused while the
/// sparsity pattern is the same.
///
/// Clarabel's tolerances are relative to the sizes of terms, and one of its two tolerances for the
/// duality gap suffices. Callers that measure absolute residuals, as SQP does, set the required
/// accuracy by [`QpSolver::require`]: Clarabel then iterates to a fraction of it, and solutions
/// that satisfy the settings are accepted.
///
/// For an infeasible problem the error names the constraint with the largest multiplier in the
/// certificate, and a lower bound of the largest violation.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// let mut solution = HeapSolution::new(&dims)?;
/// Clarabel::new().solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// let u0 = solution.stages().next().map_or(f64::NAN, |stage| stage.u[0]);
/// assert!((u0 + 0.4).abs() < 1e-6);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
pub struct Clarabel {
    /// Clarabel's own options, which may be changed between calls.
    pub settings: DefaultSettings<f64>,
    /// Constraints in addition to those of the QP. They are checked by each solve.
    pub cones: Vec<SecondOrderCone>,
    /// The residual that the caller requires; infinite by default.
    required_residual: f64,
    previous: Option<PreviousSolver>,
}

/// The fraction of the required residual that Clarabel iterates to, since its tolerances are
/// relative to terms of unknown size, and the smallest tolerance.
const TOLERANCE_FRACTION: f64 = 1e-3;
const MIN_TOLERANCE: f64 = 1e-13;

/// A solver and its sparsity pattern.
struct PreviousSolver {
    solver: DefaultSolver<f64>,
    p: CscMatrix<f64>,
    k: CscMatrix<f64>,
    cones: Vec<SupportedConeT<f64>>,
}

impl Default for Clarabel {
    fn default() -> Self {
        Self::new()
    }
}

impl Clarabel {
    /// A solver without output, with tolerances of 1e-9.
    #[must_use]
    pub fn new() -> Self {
        let settings = DefaultSettings {
            verbose: false,
            presolve_enable: false,
            tol_gap_abs: 1e-9,
            tol_gap_rel: 1e-9,
            tol_feas: 1e-9,
            ..DefaultSettings::default()
        };
        Self { settings, cones: Vec::new(), required_residual: f64::INFINITY, previous: None }
    }

    /// # Errors
    /// [`QpError::InvalidOption`]
    fn check_settings(&self) -> Result<(), QpError> {
        let s = &self.settings;
        let (none, some) = (|value: f64| value >= 0.0 && value.is_finite(), |value: f64| value > 0.0);
        let is_gap = s.tol_gap_abs > 0.0 || s.tol_gap_rel > 0.0;
        for (name, value, is_valid, allowed) in [
            (
                "tol_gap_abs",
                s.tol_gap_abs,
                none(s.tol_gap_abs) && is_gap,
                "at least 0 and finite, and above 0 if `tol_gap_rel` is 0",
            ),
            ("tol_gap_rel", s.tol_gap_rel, none(s.tol_gap_rel), "at least 0 and finite"),
            ("tol_feas", s.tol_feas, none(s.tol_feas) && some(s.tol_feas), "above 0 and finite"),
            ("tol_infeas_abs", s.tol_infeas_abs, none(s.tol_infeas_abs), "at least 0 and finite"),
            ("tol_infeas_rel", s.tol_infeas_rel, none(s.tol_infeas_rel), "at least 0 and finite"),
            ("tol_ktratio", s.tol_ktratio, none(s.tol_ktratio) && some(s.tol_ktratio), "above 0 and finite"),
            ("time_limit", s.time_limit, some(s.time_limit), "above 0"),
            (
                "max_step_fraction",
                s.max_step_fraction,
                some(s.max_step_fraction) && s.max_step_fraction < 1.0,
                "between 0 and 1",
            ),
        ] {
            if !is_valid {
                return Err(QpError::InvalidOption { name, value, allowed });
            }
        }
        Ok(())
    }

    /// Returns the settings with the required tolerances. The tolerances of the settings become the
    /// reduced ones, which are accepted if the required ones are not reached.
    fn settings_with_required_tolerance(&self) -> DefaultSettings<f64> {
        let mut settings = self.settings.clone();
        let required = (TOLERANCE_FRACTION * self.required_residual).max(MIN_TOLERANCE);
        if required < f64::INFINITY {
            let s = &mut settings;
            for (tolerance, reduced) in [
                (&mut s.tol_gap_abs, &mut s.reduced_tol_gap_abs),
                (&mut s.tol_gap_rel, &mut s.reduced_tol_gap_rel),
                (&mut s.tol_feas, &mut s.reduced_tol_feas),
            ] {
                (*reduced, *tolerance) = (*tolerance, tolerance.min(required));
            }
        }
        settings
    }

    fn check_cones(&self, qp: QpView<'_, f64>) -> Result<(), QpError> {
        for cone in &self.cones {
            let Some(stage) = qp.stage(cone.stage) else {
                let (expected, found) = (cone.stage + 1, qp.dims().len());
                return Err(QpError::Dimension {
                    field: QpField::Stages,
                    stage: cone.stage,
                    expected,
                    found,
                });
            };
            let (expected, found) = (cone.first.saturating_add(cone.count), stage.dims().ng);
            let lower = stage.g_bounds().lower;
            if expected > found || cone.count == 0 {
                return Err(QpError::Dimension {
                    field: QpField::GeneralBounds,
                    stage: cone.stage,
                    expected,
                    found,
                });
            }
            for index in cone.first..expected {
                let value = lower.get(index).copied().unwrap_or(0.0);
                if !value.is_finite() {
                    return Err(QpError::InvalidValue {
                        field: QpField::GeneralBounds,
                        stage: cone.stage,
                        index,
                        value,
                    });
                }
            }
        }
        Ok(())
    }

    /// Returns the solver with new data.
    fn prepare(&mut self, sparse: Sparse) -> Result<(&mut DefaultSolver<f64>, Sparse), QpError> {
        let p = matrix(&sparse.p, sparse.q.len(), sparse.q.len());
        let k = matrix(&sparse.k, sparse.b.len(), sparse.q.len());
        let mut cones = alloc::vec![
            SupportedConeT::ZeroConeT(sparse.equations),
            SupportedConeT::NonnegativeConeT(
                sparse.b.len() - sparse.equations - sparse.cones.iter().sum::<usize>()
            ),
        ];
        cones.extend(sparse.cones.iter().map(|&count| SupportedConeT::SecondOrderConeT(count)));
        let same = |previous: &PreviousSolver| {
            let equal = |a: &CscMatrix<f64>, b: &CscMatrix<f64>| a.colptr == b.colptr && a.rowval == b.rowval;
            equal(&previous.p, &p)
                && equal(&previous.k, &k)
                && (previous.k.m, &previous.cones) == (k.m, &cones)
        };
        let settings = self.settings_with_required_tolerance();
        // Clarabel rejects updates of some settings; then a new solver is created.
        let updated = self.previous.as_mut().filter(|previous| same(previous)).is_some_and(|previous| {
            previous.solver.update_settings(settings.clone()).is_ok()
                && previous.solver.update_data(&p.nzval, &sparse.q, &k.nzval, &sparse.b).is_ok()
        });
        if !updated {
            // Clarabel checks the dimensions, which are correct by construction, and the user's
            // settings.
            let solver = DefaultSolver::new(&p, &sparse.q, &k, &sparse.b, &cones, settings);
            let invalid =
                QpError::InvalidValue { field: QpField::Settings, stage: 0, index: 0, value: f64::NAN };
            self.previous = Some(PreviousSolver { solver: solver.map_err(|_| invalid)?, p, k, cones });
        }
        match &mut self.previous {
            Some(previous) => Ok((&mut previous.solver, sparse)),
            None => Err(QpError::OutOfMemory { bytes: 0 }),
        }
    }
}

/// Returns a matrix sorted by columns and rows.
fn matrix(triplets: &Triplets, rows: usize, columns: usize) -> CscMatrix<f64> {
    let mut elements: Vec<_> = triplets.elements.clone();
    elements.sort_unstable_by_key(|&(column, row, _)| (column, row));
    let mut starts = alloc::vec![0; columns + 1];
    for &(column, ..) in &elements {
        if let Some(count) = starts.get_mut(column + 1) {
            *count += 1;
        }
    }
    let mut sum = 0;
    for start in &mut starts {
        sum += *start;
        *start = sum;
    }
    let indices = elements.iter().map(|e| e.1).collect();
    let values = elements.iter().map(|e| e.2).collect();
    CscMatrix { m: rows, n: columns, colptr: starts, rowval: indices, nzval: values }
}

impl QpSolver<f64> for Clarabel {
    fn require(&mut self, tolerance: f64) {
        self.required_residual = if tolerance > 0.0 { tolerance } else { f64::INFINITY };
    }

    fn solve_until(
        &mut self,
        qp: QpView<'_, f64>,
        _: QpStart,
        solution: SolutionView<'_, f64>,
        _: &mut dyn FnMut() -> bool,
    ) -> Result<QpStatistics, QpError> {
        check(qp)?;
        solution.check_dimensions(qp)?;
        self.check_settings()?;
        self.check_cones(qp)?;
        let is_refined = self.required_residual.is_finite();
        let (solver, sparse) = self.prepare(Sparse::new(qp, &self.cones))?;
        solver.solve();
        let found = &solver.solution;
        let SolutionView { v, dynamics, lower, upper, .. } = solution;
        for (place, &column) in StageOffsetsIter::<f64>::new(qp.dims()).zip(&sparse.columns) {
            let from = found.x.get(column..column + place.n).unwrap_or_default();
            for (v, &x) in v.get_mut(place.v..).unwrap_or_default().iter_mut().zip(from) {
                *v = x;
            }
        }
        lower.fill(0.0);
        upper.fill(0.0);
        for (origin, &z) in sparse.origins.iter().zip(&found.z) {
            let (to, index, z) = match *origin {
                RowOrigin::Dynamics(i) => (&mut *dynamics, i, z),
                RowOrigin::Equation(i) if z >= 0.0 => (&mut *upper, i, z),
                RowOrigin::Equation(i) => (&mut *lower, i, -z),
                RowOrigin::Lower(i) | RowOrigin::Cone(i) => (&mut *lower, i, z),
                RowOrigin::Upper(i) => (&mut *upper, i, z),
                RowOrigin::Sign | RowOrigin::Coupling => continue,
            };
            if let Some(to) = to.get_mut(index) {
                *to = z;
            }
        }
        let iterations = found.iterations as usize;
        let residuals = Residuals {
            stationarity: found.r_dual,
            dynamics: found.r_prim,
            inequalities: found.r_prim,
            complementarity: (found.obj_val - found.obj_val_dual).abs(),
        };
        let objective = found.obj_val;
        match found.status {
            SolverStatus::AlmostSolved if !is_refined => Err(QpError::Stalled { iterations, residuals }),
            SolverStatus::Solved | SolverStatus::AlmostSolved => Ok(QpStatistics {
                iterations,
                factorisations: iterations,
                residuals,
                objective,
                ..QpStatistics::default()
            }),
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                Err(infeasibility_error(qp, &sparse, &found.z))
            }
            SolverStatus::MaxIterations | SolverStatus::MaxTime => {
                Err(QpError::MaxIterations { iterations, residuals })
            }
            _ => Err(QpError::Stalled { iterations, residuals }),
        }
    }
}

/// Returns the error of a certificate: `Kᵀ z = 0` and `bᵀ z < 0` imply that the largest violation
/// is at least `−bᵀ z / Σ |z|`.
fn infeasibility_error(qp: QpView<'_, f64>, sparse: &Sparse, z: &[f64]) -> QpError {
    let product: f64 = sparse.b.iter().zip(z).map(|(b, z)| b * z).sum();
    let violation = -product / z.iter().map(|z| z.abs()).sum::<f64>();
    let mut largest = (0.0, 0, Side::Lower);
    for (origin, z) in sparse.origins.iter().zip(z) {
        let (row, side) = match *origin {
            RowOrigin::Equation(row) if *z > 0.0 => (row, Side::Upper),
            RowOrigin::Equation(row) | RowOrigin::Lower(row) | RowOrigin::Cone(row) => (row, Side::Lower),
            RowOrigin::Upper(row) => (row, Side::Upper),
            RowOrigin::Dynamics(_) | RowOrigin::Sign | RowOrigin::Coupling => continue,
        };
        if z.abs() > largest.0 {
            largest = (z.abs(), row, side);
        }
    }
    let (_, row, side) = largest;
    let place = StageOffsetsIter::<f64>::new(qp.dims())
        .find(|p| (p.row..p.row + p.rows).contains(&row))
        .unwrap_or_default();
    let (field, index) = place.field_of_row(row - place.row);
    QpError::Infeasible { field, stage: place.stage, index, side, violation }
}
