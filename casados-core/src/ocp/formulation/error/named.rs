//! Names in errors: parts of a problem, variables, constraints.

use crate::qp::Side;
use core::fmt;

/// A part of a problem.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # #[function]
/// # fn effort(_x: [f64; 2], u: f64) -> f64 { u }
/// # let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
/// #     .running_cost(LeastSquaresCost::<Effort>::diagonal(&[1.0]))
/// #     .on(Horizon::uniform(10, 0.1))?;
/// # ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 10.., 1.0, 1.0)?;
/// # ocp.guess(&[0.0, 0.0], &[0.0])?;
/// // Two states, but one number.
/// let error = ocp.fix_initial_state(&[0.0]).unwrap_err();
/// let part = Part::InitialState;
/// assert!(matches!(error, OcpError::Length { part: p, expected: 2, found: 1, .. } if p == part));
/// println!("{error}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// The nodes in time.
    Times,
    /// States.
    States,
    /// Controls.
    Controls,
    /// Multipliers.
    Multipliers,
    /// Parameters.
    Parameters,
    /// Ranges of free parameters.
    ParameterBounds,
    /// The initial state.
    InitialState,
    /// Weights of an arrival cost.
    Arrival,
    /// Reference of the stage cost.
    Reference,
    /// Reference of the terminal cost.
    TerminalReference,
    /// Bounds of states.
    StateBounds,
    /// Bounds of controls.
    ControlBounds,
    /// Bounds of algebraic states.
    AlgebraicBounds,
    /// Bounds of path constraints.
    PathBounds,
    /// Bounds of terminal constraints.
    TerminalBounds,
    /// Penalties of soft bounds.
    Penalty,
    /// Dimensions of the stages.
    Dimensions,
    /// Memory for numbers.
    Memory,
}

/// A name in an error, truncated to its first bytes.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// let error = ocp.bound("v", .., -1.0, 1.0).err().ok_or("there is one")?;
/// assert!(matches!(error, OcpError::UnknownName { name, .. } if name.as_str() == "v"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; 32],
    length: usize,
}

impl Text {
    pub(in crate::ocp) fn new(text: &str) -> Self {
        let mut length = text.len().min(32);
        while !text.is_char_boundary(length) {
            length -= 1;
        }
        let mut bytes = [0; 32];
        for (to, from) in bytes.iter_mut().zip(text.bytes().take(length)) {
            *to = from;
        }
        Self { bytes, length }
    }
    /// Returns the text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.bytes.get(..self.length).and_then(|bytes| core::str::from_utf8(bytes).ok()).unwrap_or_default()
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

/// The name of a constraint.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// ocp.bound("u", .., -0.01, 0.01)?.bound("x", 20.., 0.0, 0.0)?;
/// let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
/// let Status::Infeasible { constraint, violation } = outcome.status else { return Err("there is a way".into()) };
/// println!("{constraint}: {violation:.1}"); // "the upper bound of `x` at stage 20: 0.8"
/// assert!((constraint.name, constraint.stage) == ("x", 20) && (violation - 0.8).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConstraintName {
    /// The kind of bounds.
    pub part: Part,
    /// The stage.
    pub stage: usize,
    /// The state or control, or the function.
    pub name: &'static str,
    /// The output of the function, otherwise zero.
    pub output: usize,
    /// The point inside the interval ([`Ocp::inside`](crate::ocp::Ocp::inside)), counted from 1; 0
    /// is the node.
    pub point: usize,
    /// The side.
    pub side: Side,
    /// The [phase](crate::ocp::Phases), counted from 0, if there are several.
    pub phase: Option<usize>,
}
