//! What is known about a model before it runs: facts that the macro found in its graph, as constants.

mod elimination;

pub use elimination::{Assembly, Elimination, Pivot};

/// What is known about a model before it runs.
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
    pub jacobian: Pattern,
    /// Where each of the five blocks begins in `jacobian`, and its end.
    pub blocks: [usize; 6],
    /// Entries of the Jacobian that are constant.
    pub constant: &'static [bool],
    /// Non-zeros of the lower triangle of `∇²(μᵀ f)`: variable ≥ variable.
    pub hessian: Pattern,
    /// Equations that are linear in `(ẋ, x, z, u, p)` jointly: they have no second derivatives.
    pub linear: &'static [bool],
    /// Numbers of arithmetic operations.
    pub operations: Operations,
    /// How the Newton matrix is eliminated.
    pub elimination: Elimination,
}

/// Positions of structural non-zeros, in the order of their values.
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
}

/// Numbers of arithmetic operations of one evaluation; an elementary function counts as one.
/// Zero where it is not known (dual models).
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
