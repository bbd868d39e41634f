//! Structural facts about a model, which the macro derives from its expression graph, as constants.

mod cost;
mod curvature;
mod describe;
mod elimination;
mod explicit;
mod reduction;
mod units;

pub use cost::Cost;
pub use curvature::{
    DiagonalControl, MAX_INTERLEAVED_ROWS, NO_COLUMN, Term, begins, by_column, by_row, columns, symmetric,
};
pub use elimination::{Assembly, Dependent, Elimination, Kinematic, Left, Pivot, Supernode, Update};
pub use reduction::Reduction;
pub use units::Units;

/// Whether a name denotes a variable: `u` denotes `u[0]`, `u[1]`, and `cart` denotes
/// `cart.position`.
pub(crate) fn name_matches(name: &str, variable: &str) -> bool {
    variable.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with(['[', '.']))
}

/// Structural facts about a model, known at compile time.
///
/// ```
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
///
/// let structure = Cart::describe();
/// println!("{structure}");
/// assert!(structure.autonomous && structure.hessian.is_empty());
/// // Of two rows, each has its own derivative and one other variable.
/// assert_eq!(structure.jacobian.len(), 4);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Structure {
    /// Name of the model.
    pub name: &'static str,
    /// Names of the differential states, such as `x[3]` or `cart.position`.
    pub x: &'static [&'static str],
    /// Names of the algebraic states.
    pub z: &'static [&'static str],
    /// Names of the controls.
    pub u: &'static [&'static str],
    /// Names of the parameters.
    pub p: &'static [&'static str],
    /// Structural nonzeros of the Jacobian: equation, variable. In order of the blocks
    /// `f_ẋ, f_x, f_z, f_u, f_p`, within each by row, then by column.
    /// Read wherever entries of the Jacobian are used.
    pub jacobian: Pattern,
    /// The first entry of each of the five blocks in `jacobian`, and the end of the last.
    /// Read with `jacobian`.
    pub blocks: [usize; 6],
    /// The entries of `f_x, f_z, f_u, f_p`, column by column, by [`by_column`].
    /// Read by right-hand sides of derivatives.
    pub by_column: &'static [u32],
    /// Whether each entry of the Jacobian is constant.
    /// Read by [`is_explicit`](Self::is_explicit), [`Dae::describe`](crate::Dae::describe) and
    /// plots.
    pub constant: &'static [bool],
    /// Structural nonzeros of the lower triangle of `∇²(μᵀ f)`: variable ≥ variable.
    /// Read by second derivatives at a stage.
    pub hessian: Pattern,
    /// Whether each equation is jointly linear in `(ẋ, x, z, u, p)`, without second derivatives.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub linear: &'static [bool],
    /// Whether the entries of `f_ẋ`, `f_x` and `f_z` are independent of `(ẋ, x, z)`; they may
    /// depend on `u`, `p` and `t`. The residual is then affine in the unknowns of the stages, and
    /// one iteration of Newton's method is exact.
    /// Read by Newton's method.
    pub linear_in_state: bool,
    /// Whether they are independent of `t` too: the Newton matrix then depends on the step size,
    /// `u` and `p` only. One factorisation serves all steps of an interval, and all intervals with
    /// the same `u` and `p`.
    /// Read by the Jacobian update policy.
    pub constant_matrix: bool,
    /// Whether the model is independent of `t`: stages at the same point have the same values.
    /// Read by initial guesses.
    pub autonomous: bool,
    /// Whether the entries of each equation in `f_ẋ`, `f_x` and `f_z` are constant. Such rows of
    /// the Newton matrix depend on the step size and the tableau only, and one exact iteration of
    /// Newton's method satisfies these equations to rounding.
    /// Read by [`Dae::describe`](crate::Dae::describe) and by checks of a model.
    pub constant_rows: &'static [bool],
    /// Equations `c ẋ_j + c′ v + c″(t) = 0` with constant `c` and `c′`, where `v` is any variable
    /// except a derivative, or absent: `q̇ = v`. They can be solved for `k_j` explicitly at any
    /// point. Ascending.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub trivial: &'static [u32],
    /// Quadrature states: no equation depends on `x_j`, only on `ẋ_j`. Their columns of the Newton
    /// matrix are those of `f_ẋ`, their columns of `dk/dx₀` are zero, and their adjoints are
    /// constant in an interval. Ascending.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub quadratures: &'static [u32],
    /// Directions with influence: elements of `w = (x₀, u, p)` on which an equation depends, as
    /// ascending indices. Stages do not depend on the others: their column of `dx₊/dw` is `e_j` for
    /// the state `j` and zero for a control or a parameter, and rows and columns of second
    /// derivatives are zero.
    /// Read by the forward sweep and by second derivatives: their columns.
    pub directions: &'static [u32],
    /// For each direction its position in `directions`, or [`NO_COLUMN`]; by [`columns`].
    /// Read where results are written.
    pub column_of_direction: &'static [u32],
    /// Nonlinear variables: those in the pattern of the Hessian, except `diagonal_controls`,
    /// ascending. Only their rows of `D_i` enter second derivatives.
    /// Read by second derivatives: their stage sensitivities.
    pub curved: &'static [u32],
    /// The terms of the symmetric matrix whose lower triangle is `hessian`, by [`symmetric`].
    /// Read by the product of the Hessian with stage sensitivities.
    pub symmetric: &'static [Term],
    /// Controls and parameters that occur only on the diagonal of the Hessian.
    /// Read by second derivatives: sums on the diagonal.
    pub diagonal_controls: &'static [DiagonalControl],
    /// Numbers of arithmetic operations.
    /// Read by [`Structure::cost`] and the Jacobian update policy.
    pub operations: Operations,
    /// The plan of the elimination of the Newton matrix.
    /// Read by `linalg`.
    pub elimination: Elimination,
    /// The index reduction of the macro, if there was one.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub reduction: Option<&'static Reduction>,
}

/// Positions of structural nonzeros, in the order of their values.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// // f = (ẋ₀ − x₁, ẋ₁ − u): columns count (ẋ, x, z, u, p).
/// let jacobian = Cart::STRUCTURE.jacobian;
/// assert_eq!(jacobian.len(), 4);
/// let mut entries: Vec<_> = jacobian.iter().collect();
/// entries.sort();
/// assert_eq!(entries, [(0, 0), (0, 3), (1, 1), (1, 4)]);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Pattern {
    /// Row of each entry.
    pub rows: &'static [u32],
    /// Column of each entry.
    pub columns: &'static [u32],
}

impl Pattern {
    /// The number of entries.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rows.len()
    }
    /// Whether there are no entries.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
    /// `(row, column)` of an entry.
    #[must_use]
    #[inline(always)]
    pub const fn at(&self, entry: usize) -> (usize, usize) {
        (self.rows[entry] as usize, self.columns[entry] as usize)
    }

    /// `(row, column)` of an entry, if it exists; without a panic for indices that the compiler
    /// does not know.
    #[must_use]
    #[inline(always)]
    pub fn get(&self, entry: usize) -> Option<(usize, usize)> {
        Some((*self.rows.get(entry)? as usize, *self.columns.get(entry)? as usize))
    }

    /// `(row, column)` of all entries.
    pub fn iter(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        self.rows.iter().zip(self.columns).map(|(&row, &column)| (row as usize, column as usize))
    }
}

/// Numbers of arithmetic operations of one evaluation; an elementary function counts as one. Zero
/// if unknown (dual models).
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// let operations = Cart::STRUCTURE.operations;
/// // Two subtractions; all derivatives are constant.
/// assert_eq!((operations.residual, operations.residual_jacobian, operations.hessian), (2, 2, 0));
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// `f`
    pub residual: u32,
    /// `f` and the non-constant entries of its Jacobian
    pub residual_jacobian: u32,
    /// `∇(μᵀ f)`
    pub adjoint: u32,
    /// `∇²(μᵀ f)`
    pub hessian: u32,
}

/// `0, 1, ..., N − 1`: all directions or variables, for models of unknown structure.
#[must_use]
pub const fn all<const N: usize>() -> [u32; N] {
    let mut numbers = [0; N];
    let mut index = 0;
    while index < N {
        numbers[index] = index as u32;
        index += 1;
    }
    numbers
}
