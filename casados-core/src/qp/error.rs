//! Errors of QP solvers.

use super::statistics::Residuals;
use core::fmt;

/// A part of a QP or of its solution.
///
/// ```
/// use casados::qp::{HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpField, QpSolver, QpStart, StageDims};
///
/// let mut dims = [StageDims::new(1, 1, 0); 2];
/// dims[1].nu = 0;
/// let mut qp = HeapQp::<f64>::new(&dims)?;
/// qp.stages_mut().next().unwrap().a_mut().set(0, 0, f64::NAN);
/// qp.fix_initial_state(&[0.0])?;
/// let mut solution = HeapSolution::new(&dims)?;
/// let error = HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut()).unwrap_err();
/// assert!(matches!(error, QpError::InvalidValue { field: QpField::A, stage: 0, .. }));
/// # Ok::<(), QpError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum QpField {
    /// `A`
    A,
    /// `B`
    B,
    /// `b`, the constant part of the dynamics.
    Offset,
    /// `Q`
    Q,
    /// `R`
    R,
    /// `S`
    S,
    /// `q`
    GradientX,
    /// `r`
    GradientU,
    /// `C`
    C,
    /// `D`
    D,
    /// Bounds of the states.
    StateBounds,
    /// Bounds of the controls.
    ControlBounds,
    /// Bounds of the general constraints.
    GeneralBounds,
    /// Penalties of a soft constraint.
    Penalty,
    /// States of a solution.
    X,
    /// Controls of a solution.
    U,
    /// Multipliers of a solution.
    Multipliers,
    /// The number of stages.
    Stages,
    /// Memory for the data of a QP.
    Data,
    /// Memory for a solution.
    Solution,
    /// Numbers in the memory of a solver.
    Numbers,
    /// Indices in the memory of a solver.
    Indices,
    /// Options of a solver.
    Settings,
}

/// The side of a constraint.
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
/// // Bounds that no number satisfies are refused, with their side if a penalty is meant.
/// let mut stage = qp.stages_mut().next().unwrap();
/// stage.u_bounds_mut().soften_side(0, Side::Lower, 1.0, 1.0);
/// let stage = qp.view().stages().next().unwrap();
/// let bounds = stage.u_bounds();
/// assert_eq!((bounds.lower_linear[0], bounds.upper_linear[0]), (1.0, f64::INFINITY));
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The lower bound.
    Lower,
    /// The upper bound.
    Upper,
}

/// The error of a solve, with the part, the stage and the values.
///
/// After `Infeasible`, `MaxIterations`, `OutOfTime`, `Stalled` and `NotConvex` the solution holds
/// the best iterate.
///
/// ```
/// use casados::qp::{HeapInteriorPoint, HeapQp, HeapSolution, QpError, QpSolver, QpStart, StageDims};
///
/// // x₊ = u, |u| ≤ 1, but x₁ = 2.
/// let mut dims = [StageDims::new(1, 1, 0); 2];
/// dims[1].nu = 0;
/// let mut qp = HeapQp::<f64>::new(&dims)?;
/// for mut stage in qp.stages_mut() {
///     stage.b_mut().set(0, 0, 1.0);
///     stage.q_mut().set(0, 0, 1.0);
///     stage.r_mut().set(0, 0, 1.0);
///     stage.u_bounds_mut().set(0, -1.0, 1.0);
/// }
/// qp.fix_initial_state(&[0.0])?;
/// if let Some(mut last) = qp.stage_mut(1) {
///     last.x_bounds_mut().set(0, 2.0, 2.0);
/// }
/// let mut solution = HeapSolution::new(&dims)?;
/// let outcome = HeapInteriorPoint::new().solve(qp.view(), QpStart::Cold, solution.view_mut());
/// assert!(matches!(outcome, Err(QpError::Infeasible { .. })));
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum QpError {
    /// A length differs from that of the dimensions.
    Dimension {
        /// The part with this length.
        field: QpField,
        /// The stage; 0 for the whole horizon.
        stage: usize,
        /// The required length.
        expected: usize,
        /// The given length.
        found: usize,
    },
    /// A lower bound is above the upper one.
    CrossedBounds {
        /// The kind of bounds.
        field: QpField,
        /// The stage.
        stage: usize,
        /// The element.
        index: usize,
        /// The lower bound.
        lower: f64,
        /// The upper bound.
        upper: f64,
    },
    /// A number is infinite or NaN where it must be finite (a bound may be infinite on its own
    /// side), or a penalty is negative.
    InvalidValue {
        /// The part.
        field: QpField,
        /// The stage.
        stage: usize,
        /// The element; for matrices in column-major order.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// No point satisfies all constraints. The error has the largest violation at the point with
    /// the smallest sum of violations.
    Infeasible {
        /// The kind of bounds.
        field: QpField,
        /// The stage.
        stage: usize,
        /// The element.
        index: usize,
        /// The violated side.
        side: Side,
        /// The violation.
        violation: f64,
    },
    /// The reduced Hessian is indefinite: there is no minimum.
    NotConvex {
        /// The stage.
        stage: usize,
        /// The variable: a control, or, at stage 0, `nu` plus the index of a state.
        index: usize,
        /// The pivot, which must be positive.
        pivot: f64,
    },
    /// States are periodic or controls shared, which this solver does not support;
    /// [`InteriorPoint`](super::InteriorPoint) does, with the feature `alloc`.
    Coupled,
    /// The maximum number of iterations was reached.
    MaxIterations {
        /// The number of iterations.
        iterations: usize,
        /// The residuals at the end.
        residuals: Residuals,
    },
    /// The time limit was reached.
    OutOfTime {
        /// The number of iterations.
        iterations: usize,
        /// The residuals at the end.
        residuals: Residuals,
    },
    /// Steps became too short, or residuals stagnate: rounding errors, or an unbounded problem.
    Stalled {
        /// The number of iterations.
        iterations: usize,
        /// The residuals at the end.
        residuals: Residuals,
    },
    /// An option of a solver is out of range.
    InvalidOption {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed values.
        allowed: &'static str,
    },
    /// Memory could not be allocated.
    OutOfMemory {
        /// The size of the allocation.
        bytes: usize,
    },
}

impl fmt::Display for QpField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::A => "A",
            Self::B => "B",
            Self::Offset => "the offset of the dynamics",
            Self::Q => "Q",
            Self::R => "R",
            Self::S => "S",
            Self::GradientX => "the gradient of x",
            Self::GradientU => "the gradient of u",
            Self::C => "C",
            Self::D => "D",
            Self::StateBounds => "the bounds of x",
            Self::ControlBounds => "the bounds of u",
            Self::GeneralBounds => "the bounds of the general constraints",
            Self::Penalty => "a penalty",
            Self::X => "x",
            Self::U => "u",
            Self::Multipliers => "the multipliers",
            Self::Stages => "the number of stages",
            Self::Data => "the memory of the QP",
            Self::Solution => "the memory of the solution",
            Self::Numbers => "the memory of the solver",
            Self::Indices => "the indices of the solver",
            Self::Settings => "the settings of the solver",
        })
    }
}

impl fmt::Display for QpError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Dimension { field, stage, expected, found } => {
                write!(f, "stage {stage}: {field} has {found} elements instead of {expected}")
            }
            Self::CrossedBounds { field, stage, index, lower, upper } => {
                write!(
                    f,
                    "stage {stage}: lower bound {lower} exceeds upper bound {upper} at element {index} of {field}"
                )
            }
            Self::InvalidValue { field, stage, index, value } => {
                let allowed = match field {
                    QpField::StateBounds | QpField::ControlBounds | QpField::GeneralBounds => {
                        "a number, -inf for no lower bound, or inf for no upper bound"
                    }
                    QpField::Penalty => "at least 0, and finite if quadratic",
                    _ => "finite",
                };
                write!(f, "stage {stage}: element {index} of {field} is {value}: it must be {allowed}")
            }
            Self::Infeasible { field, stage, index, side, violation } => {
                let side = match side {
                    Side::Lower => "lower",
                    Side::Upper => "upper",
                };
                let variables = match field {
                    QpField::StateBounds => "x",
                    QpField::ControlBounds => "u",
                    _ => "the general constraints",
                };
                write!(
                    f,
                    "infeasible: the {side} bound of element {index} of {variables} at stage {stage} is violated by at \
                     least {violation:.2e}"
                )
            }
            Self::NotConvex { stage, index, pivot } => write!(
                f,
                "the Hessian is not positive semidefinite: at stage {stage} the pivot of variable {index} is \
                 {pivot:.2e}; regularise it"
            ),
            Self::Coupled => f.write_str(
                "this solver does not support periodic states or shared controls: take `InteriorPoint` with the feature \
                 `alloc`",
            ),
            Self::MaxIterations { iterations, residuals } => {
                write!(f, "not solved after {iterations} iterations: {residuals}")
            }
            Self::OutOfTime { iterations, residuals } => {
                write!(f, "the time limit was reached after {iterations} iterations: {residuals}")
            }
            Self::Stalled { iterations, residuals } => {
                write!(f, "no progress after {iterations} iterations: {residuals}")
            }
            Self::InvalidOption { name, value, allowed } => {
                write!(f, "the option `{name}` is {value:e}: it must be {allowed}")
            }
            Self::OutOfMemory { bytes } => write!(f, "{bytes} bytes of memory could not be allocated"),
        }
    }
}

debug_is_display!(QpError);

impl core::error::Error for QpError {}
