//! The one contract between a model and the engine.
//!
//! A model is a differential-algebraic equation `f(ẋ, x, u, z, p, t) = 0` with
//! `f ∈ R^{nx+nz}`, index 1: `∂f/∂(ẋ, z)` is invertible. Its variables are one flat array
//! `v = (ẋ, x, z, u, p, t)`; derivatives are taken with respect to all of them but `t`.

use crate::scalar::{Lanes, Scalar};
use crate::shape::{Array, Plain, Shape};

/// `[T; NX]` of a model.
pub type ArrayX<M, T> = <<M as Dae>::Shape as Shape>::ArrayX<T>;
/// `[T; NK]` of a model: one element per unknown `(k, z)`, or per equation.
pub type ArrayK<M, T> = <<M as Dae>::Shape as Shape>::ArrayK<T>;
/// `[T; NV]` of a model: one element per variable `(ẋ, x, z, u, p, t)`.
pub type ArrayV<M, T> = <<M as Dae>::Shape as Shape>::ArrayV<T>;
/// `[T; NW]` of a model: one element per direction `(x₀, u, p)`.
pub type ArrayW<M, T> = <<M as Dae>::Shape as Shape>::ArrayW<T>;
/// `SVector<T, NX>` of a model.
pub type VectorX<M, T> = <<M as Dae>::Shape as Shape>::VectorX<T>;
/// `SVector<T, NZ>` of a model.
pub type VectorZ<M, T> = <<M as Dae>::Shape as Shape>::VectorZ<T>;
/// `SVector<T, NU>` of a model.
pub type VectorU<M, T> = <<M as Dae>::Shape as Shape>::VectorU<T>;
/// `SVector<T, NP>` of a model.
pub type VectorP<M, T> = <<M as Dae>::Shape as Shape>::VectorP<T>;
/// `SMatrix<T, NX, NX>` of a model.
pub type MatrixXX<M, T> = <<M as Dae>::Shape as Shape>::MatrixXX<T>;
/// `SMatrix<T, NX, NU>` of a model.
pub type MatrixXU<M, T> = <<M as Dae>::Shape as Shape>::MatrixXU<T>;
/// `SMatrix<T, NX, NP>` of a model.
pub type MatrixXP<M, T> = <<M as Dae>::Shape as Shape>::MatrixXP<T>;
/// `SMatrix<T, NZ, NX>` of a model.
pub type MatrixZX<M, T> = <<M as Dae>::Shape as Shape>::MatrixZX<T>;
/// `SMatrix<T, NZ, NU>` of a model.
pub type MatrixZU<M, T> = <<M as Dae>::Shape as Shape>::MatrixZU<T>;
/// `SMatrix<T, NZ, NP>` of a model.
pub type MatrixZP<M, T> = <<M as Dae>::Shape as Shape>::MatrixZP<T>;
/// `SMatrix<T, NU, NU>` of a model.
pub type MatrixUU<M, T> = <<M as Dae>::Shape as Shape>::MatrixUU<T>;
/// `SMatrix<T, NU, NP>` of a model.
pub type MatrixUP<M, T> = <<M as Dae>::Shape as Shape>::MatrixUP<T>;
/// `SMatrix<T, NP, NP>` of a model.
pub type MatrixPP<M, T> = <<M as Dae>::Shape as Shape>::MatrixPP<T>;
/// `SMatrix<T, NX, C>` of a model.
pub type MatrixXC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixXC<T, C>;
/// `SMatrix<T, NZ, C>` of a model.
pub type MatrixZC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixZC<T, C>;
/// `SMatrix<T, NU, C>` of a model.
pub type MatrixUC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixUC<T, C>;
/// `SMatrix<T, NP, C>` of a model.
pub type MatrixPC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixPC<T, C>;

/// A differential-algebraic equation with its derivatives: written by `#[dae]` and `#[ode]`.
///
/// Entries of the Jacobian and the Hessian are arrays of values in the order of the patterns in
/// [`Dae::STRUCTURE`].
pub trait Dae: 'static {
    /// Dimensions.
    type Shape: Shape;
    /// Values of the structural non-zeros of `∂f/∂(ẋ, x, z, u, p)`.
    type Jacobian<T: Plain>: Array<T>;
    /// Values of the structural non-zeros of the lower triangle of `∇²(μᵀ f)` over `(ẋ, x, z, u, p)`.
    type Hessian<T: Plain>: Array<T>;
    /// One element for each block of the factors of the Newton matrix, fill included: see [`Elimination`].
    type Factors<B: Plain>: Array<B>;
    /// What is known about the model before it runs.
    const STRUCTURE: Structure;

    /// The residual `f(v)`.
    fn residual<S: Lanes>(v: &ArrayV<Self, S>, f: &mut ArrayK<Self, S>);

    /// The constant entries of the Jacobian; the others are left as they are. Called once for
    /// every array that [`Dae::residual_jacobian`] will fill.
    fn jacobian_constants<S: Lanes>(jacobian: &mut Self::Jacobian<S>);

    /// The residual and the entries of the Jacobian that are not constant.
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S>,
        f: &mut ArrayK<Self, S>,
        jacobian: &mut Self::Jacobian<S>,
    );

    /// The gradient `∇ᵥ(μᵀ f)` over `(ẋ, x, z, u, p)`. The last element, that of `t`, is set to zero.
    fn adjoint<S: Lanes>(v: &ArrayV<Self, S>, mu: &ArrayK<Self, S>, gradient: &mut ArrayV<Self, S>);

    /// All entries of the lower triangle of `∇²(μᵀ f)`.
    fn hessian<S: Lanes>(v: &ArrayV<Self, S>, mu: &ArrayK<Self, S>, hessian: &mut Self::Hessian<S>);
}

/// A model whose code is generic over every scalar: duals and complex numbers included, which is
/// what independent checks of its derivatives need. Graph models are; dual models are not.
pub trait GraphDae: Dae {
    /// The residual `f(v)`; `v` has `NV` elements and `f` has `NK`.
    fn residual_of<S: Scalar>(v: &[S], f: &mut [S]);
    /// The gradient `∇ᵥ(μᵀ f)`, as [`Dae::adjoint`].
    fn adjoint_of<S: Scalar>(v: &[S], mu: &[S], gradient: &mut [S]);
}

/// A model in explicit form: row `r` of the residual is `c (ẋ_j − g_j(x, u, p, t))` with a constant `c`
/// and every `j` occurs once; there are no algebraic states.
///
/// Then `g_j = −f_r / c` at `ẋ = 0`, and every derivative of `g` is one of `f`.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an explicit model",
    label = "explicit Runge-Kutta methods need `ẋ = g(x, u, p, t)`",
    note = "write the model with `#[ode]`, or as a `#[dae]` whose residual is `ẋ − g(...)`; or integrate it with `Irk`"
)]
pub trait Ode: Dae {
    /// For each state `j`: the row `r` and the coefficient `c`.
    const ROWS: &'static [(u32, f64)];
}

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

/// The order in which the Newton matrix is eliminated, with everything that follows from it and the pattern.
///
/// Made by the macro from the pattern of `f_ẋ ∪ f_x ∪ f_z` and from the values of the model at sample points; the entries
/// are s×s blocks, so that it serves every tableau. A *slot* is an unknown `(k, z)` and the equation that is its pivot.
#[derive(Clone, Copy, Debug)]
pub struct Elimination {
    /// The pivots in order.
    pub pivots: &'static [Pivot],
    /// For each block the slot at its other end: of `L` that of its equation, of `U` that of its unknown.
    pub slots: &'static [u32],
    /// For each pivot, for each block of its `L`, for each block of its `U`: the block that is updated.
    pub updates: &'static [u32],
    /// For each structural non-zero of the Newton matrix: where it goes and what it is made of.
    pub assembly: &'static [Assembly],
    /// For each equation its slot.
    pub slot_of_equation: &'static [u32],
}

impl Elimination {
    /// No plan: the matrix is eliminated as a dense one.
    pub const NONE: Self =
        Self { pivots: &[], slots: &[], updates: &[], assembly: &[], slot_of_equation: &[] };
}

/// A pivot: the blocks that it owns lie one after the other, itself, its column `L`, its row `U`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pivot {
    /// The unknown that it determines.
    pub slot: u32,
    /// Its own block.
    pub block: u32,
    /// Where the blocks of its row begin.
    pub upper: u32,
    /// Where the blocks of its row end.
    pub end: u32,
    /// The pivot is the identity, whatever the step size and the point.
    pub identity: bool,
}

impl Pivot {
    /// The blocks of its column, below it.
    #[must_use]
    #[inline(always)]
    pub const fn lower(&self) -> core::ops::Range<usize> {
        self.block as usize + 1..self.upper as usize
    }
    /// The blocks of its row, to the right of it.
    #[must_use]
    #[inline(always)]
    pub const fn upper(&self) -> core::ops::Range<usize> {
        self.upper as usize..self.end as usize
    }
}

/// A block of the Newton matrix before elimination: `diag(direct) + h diag(state) A`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Assembly {
    /// The block.
    pub block: u32,
    /// The entry of the Jacobian that multiplies the unknown itself (`f_ẋ` or `f_z`), or [`Assembly::NONE`].
    pub direct: u32,
    /// The entry of `f_x`, or [`Assembly::NONE`].
    pub state: u32,
}

impl Assembly {
    /// No entry.
    pub const NONE: u32 = u32::MAX;
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
