//! What is known about a model before it runs: facts that the macro found in its graph, as
//! constants.

mod cost;
mod curvature;
mod describe;
mod elimination;
mod explicit;
mod reduction;
mod units;

pub use cost::Cost;
pub use curvature::{
    DiagonalControl, MOST_ROWS, NO_COLUMN, Term, begins, by_column, by_row, columns, symmetric,
};
pub use elimination::{Assembly, Dependent, Elimination, Kinematic, Left, Pivot, Supernode, Update};
pub use reduction::Reduction;
pub use units::Units;

/// Whether a name means a variable: `u` means `u[0]`, `u[1]`, and `cart` means `cart.position`.
pub(crate) fn name_matches(name: &str, variable: &str) -> bool {
    variable.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with(['[', '.']))
}

/// What is known about a model before it runs.
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
    /// Non-zeros of the Jacobian: equation, variable. In order of the blocks
    /// `f_ẋ, f_x, f_z, f_u, f_p`, within each by row, then by column.
    /// Read by everything that meets entries of the Jacobian.
    pub jacobian: Pattern,
    /// Where each of the five blocks begins in `jacobian`, and its end.
    /// Read with `jacobian`.
    pub blocks: [usize; 6],
    /// The entries of `f_x, f_z, f_u, f_p`, column by column: what [`by_column`] makes of them.
    /// Read by right-hand sides of derivatives.
    pub by_column: &'static [u32],
    /// Entries of the Jacobian that are constant.
    /// Read by [`is_explicit`](Self::is_explicit), [`Dae::describe`](crate::Dae::describe) and
    /// pictures.
    pub constant: &'static [bool],
    /// Non-zeros of the lower triangle of `∇²(μᵀ f)`: variable ≥ variable.
    /// Read by second derivatives of one stage.
    pub hessian: Pattern,
    /// Equations that are linear in `(ẋ, x, z, u, p)` jointly: they have no second derivatives.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub linear: &'static [bool],
    /// The entries of `f_ẋ`, `f_x` and `f_z` do not depend on `(ẋ, x, z)`; on `u`, `p` and `t` they
    /// may. The residual is then affine in the stages' unknowns: one iteration of Newton's method
    /// is exact.
    /// Read by Newton's method.
    pub linear_in_state: bool,
    /// Those entries do not depend on `t` either: nothing in the Newton matrix changes within an
    /// interval but with the size of the steps. One factorisation then serves all steps of an
    /// interval, and all intervals of the same `u` and `p`.
    /// Read by the Jacobian update policy.
    pub constant_matrix: bool,
    /// Nothing depends on `t`: stages at the same point have the same values.
    /// Read by initial guesses.
    pub autonomous: bool,
    /// Equations whose entries in `f_ẋ`, `f_x` and `f_z` are constant. Their rows of the Newton
    /// matrix depend on the step size and the tableau only, and one exact iteration of Newton's
    /// method satisfies these equations to rounding.
    /// Read by [`Dae::describe`](crate::Dae::describe) and by checks of a model.
    pub constant_rows: &'static [bool],
    /// Equations `c ẋ_j + c′ v + c″(t) = 0` with constant `c` and `c′`, where `v` is any variable
    /// but a derivative, or none: `q̇ = v`. They can be solved for `k_j` by hand, whatever the
    /// point. Ascending.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub trivial: &'static [u32],
    /// States that influence nobody: no equation depends on `x_j`, only on `ẋ_j`. Their columns of
    /// the Newton matrix are `f_ẋ` alone, their columns of `dk/dx₀` are zero, and their multipliers
    /// pass through an interval unchanged. Ascending.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub quadratures: &'static [u32],
    /// Directions `w = (x₀, u, p)` that an equation depends on, as indices into `w`, ascending. For
    /// the others the stages have no derivative: the column of `dx₊/dw` is `e_j` for the state `j`
    /// and zero for a control or a parameter, and rows and columns of second derivatives are zero.
    /// Read by the forward sweep and by second derivatives: their columns.
    pub directions: &'static [u32],
    /// For each direction its position in `directions`, or [`NO_COLUMN`]: what [`columns`] makes of
    /// them.
    /// Read where results are written.
    pub column_of_direction: &'static [u32],
    /// Variables that occur in the pattern of the Hessian, ascending, less those of
    /// `diagonal_controls`: only their rows of `D_i` enter second derivatives. Read by second
    /// derivatives: their stage sensitivities.
    pub curved: &'static [u32],
    /// The whole of the symmetric matrix whose lower triangle is `hessian`: what [`symmetric`]
    /// makes of it.
    /// Read by the product of the Hessian with stage sensitivities.
    pub symmetric: &'static [Term],
    /// Controls and parameters that occur in the Hessian's diagonal only.
    /// Read by second derivatives: sums on the diagonal.
    pub diagonal_controls: &'static [DiagonalControl],
    /// Numbers of arithmetic operations.
    /// Read by [`Structure::cost`] and the Jacobian update policy.
    pub operations: Operations,
    /// How the Newton matrix is eliminated.
    /// Read by `linalg`.
    pub elimination: Elimination,
    /// What was differentiated, where the macro reduced the index.
    /// Read by [`Dae::describe`](crate::Dae::describe).
    pub reduction: Option<&'static Reduction>,
}

/// Positions of structural non-zeros, in the order of their values.
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

    /// `(row, column)` of an entry, if there is one: without a panic where the compiler does not
    /// know that.
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

/// Numbers of arithmetic operations of one evaluation; an elementary function counts as one.
/// Zero where it is not known (dual models).
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
    /// `f` and the entries of its Jacobian that are not constant
    pub residual_jacobian: u32,
    /// `∇(μᵀ f)`
    pub adjoint: u32,
    /// `∇²(μᵀ f)`
    pub hessian: u32,
}

/// `0, 1, ..., N − 1`: the directions or variables of a model of which nothing better is known.
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
