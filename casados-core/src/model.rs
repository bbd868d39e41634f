//! The one contract between a model and the engine.
//!
//! A model is a differential-algebraic equation `f(ẋ, x, u, z, p, t) = 0` with
//! `f ∈ R^{nx+nz}`, index 1: `∂f/∂(ẋ, z)` is invertible. Its variables are one flat array
//! `v = (ẋ, x, z, u, p, t)`; derivatives are taken with respect to all of them but `t`.

mod vectors;

use crate::scalar::{Lanes, Scalar, Tangent};
use crate::shape::{Array, Plain, Shape};
#[doc(no_inline)]
pub use crate::structure::{
    Assembly, Cost, Dependent, DiagonalControl, Elimination, Kinematic, Left, NO_COLUMN, Operations, Pattern,
    Pivot, Reduction, Structure, Supernode, Term, Units, Update, all, by_column, columns, symmetric,
};
use bytemuck::Zeroable;
pub use vectors::{
    ArrayK, ArrayV, ArrayW, ArrayX, MatrixPC, MatrixPP, MatrixUC, MatrixUP, MatrixUU, MatrixXC, MatrixXP,
    MatrixXU, MatrixXX, MatrixZC, MatrixZP, MatrixZU, MatrixZX, VectorP, VectorU, VectorX, VectorZ,
};

/// A differential-algebraic equation with its derivatives: written by `#[dae]` and `#[ode]`.
///
/// Entries of the Jacobian and the Hessian are arrays of values in the order of the patterns in
/// [`Dae::STRUCTURE`].
///
/// Users write it in bounds, `M: Dae`, print what is known ([`Dae::describe`]), and leave the rest
/// to integrators.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// /// A tank that drains through a valve: level m, outflow m/s, inflow m/s.
/// #[dae(nominal(z = 1.0))]
/// fn tank(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], u: [f64; 1]) -> [f64; 2] {
///     [xdot[0] - u[0] + z[0], z[0] * z[0] - x[0]]
/// }
///
/// println!("{}", Tank::describe());
/// assert_eq!(Tank::describe().z, ["z[0]"]);
/// let mut irk = Irk::<Tank, RadauIIA<3>>::new(Options::default())?;
/// let end = irk.solve(&vector![4.0], &vector![2.0], 0.1)?;
/// assert!((end.x[0] - 4.0).abs() < 1e-12 && (end.z[0] - 2.0).abs() < 1e-12); // at rest
/// # Ok::<(), casados::Error>(())
/// ```
pub trait Dae: 'static {
    /// Dimensions.
    type Shape: Shape;
    /// Values of the structural non-zeros of `∂f/∂(ẋ, x, z, u, p)`.
    type Jacobian<T: Plain>: Array<T>;
    /// Values of the structural non-zeros of the lower triangle of `∇²(μᵀ f)` over
    /// `(ẋ, x, z, u, p)`.
    type Hessian<T: Plain>: Array<T>;
    /// One element for each block of the factors of the Newton matrix, fill included: see
    /// [`Elimination`].
    type Factors<B: Plain>: Array<B>;
    /// What is known about the model before it runs.
    const STRUCTURE: Structure;
    /// Where Newton's method starts if a call gives no start values: one for each unknown `(ẋ, z)`,
    /// or none at all for zeros. `#[dae]` takes them from `nominal(..)` and `range(..)` of its
    /// attribute. Where equations have several roots these decide for one; see
    /// [`Start`](crate::options::Start).
    const START: &'static [f64] = &[];
    /// From where to where the variables `(ẋ, x, z, u, p, t)` may be, as far as the user has said
    /// so: one for each, or none at all. Integrators do not read it; the checks of `testing` do.
    const RANGES: &'static [Range] = &[];
    /// The units of the variables, which pictures show. The attributes take them from doc comments.
    const UNITS: Units = Units::NONE;
    /// Which parameter the time of the model is a multiple of, if one is: `#[ode(duration = p)]`. A
    /// unit of time of an integrator takes that many units of time of the model.
    const DURATION: Option<usize> = None;
    /// Which controls are rates of controls that are linear in time: `#[ode(linear = u)]`. The
    /// linear controls themselves are states behind those of the model, in this order.
    const LINEAR: &'static [u32] = &[];
    /// How many integrals are the last states: `#[ode(integrals(energy = u * u))]`.
    const INTEGRALS: usize = 0;
    /// How many conditions (of `if`, `max`, `abs`, ..) and tables the residual has, if known.
    const BRANCHES: usize = 0;

    /// The residual `f(v)`.
    fn residual<S: Lanes>(v: &ArrayV<Self, S::Cell>, f: &mut ArrayK<Self, S::Cell>);

    /// The constant entries of the Jacobian; the others are left as they are. Called once for
    /// every array that [`Dae::residual_jacobian`] will fill.
    fn jacobian_constants<S: Lanes>(jacobian: &mut Self::Jacobian<S::Cell>);

    /// The residual and the entries of the Jacobian that are not constant.
    fn residual_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        f: &mut ArrayK<Self, S::Cell>,
        jacobian: &mut Self::Jacobian<S::Cell>,
    );

    /// The residual and its derivative in one direction, `∂f/∂v v'`, where every variable comes
    /// with its `v'`; that of `t` is zero. Written models compute it term by term (see
    /// [`Tangent`]); without that it is the product with the Jacobian.
    fn tangent<S: Lanes>(v: &ArrayV<Self, Tangent<S>>, f: &mut ArrayK<Self, Tangent<S>>) {
        let mut point = ArrayV::<Self, S::Cell>::zeroed();
        for (cell, variable) in point.as_mut().iter_mut().zip(v.as_ref()) {
            variable.value.store(cell);
        }
        let (mut values, mut jacobian) =
            (ArrayK::<Self, S::Cell>::zeroed(), Self::Jacobian::<S::Cell>::zeroed());
        Self::jacobian_constants::<S>(&mut jacobian);
        Self::residual_jacobian::<S>(&point, &mut values, &mut jacobian);
        for (f, value) in f.as_mut().iter_mut().zip(values.as_ref()) {
            *f = Tangent { value: S::load(value), derivative: S::from_f64(0.0) };
        }
        for (entry, value) in jacobian.as_ref().iter().enumerate() {
            let (row, column) = Self::STRUCTURE.jacobian.at(entry);
            if let (Some(f), Some(variable)) = (f.as_mut().get_mut(row), v.as_ref().get(column)) {
                f.derivative = f.derivative + S::load(value) * variable.derivative;
            }
        }
    }

    /// The gradient `∇ᵥ(μᵀ f)` over `(ẋ, x, z, u, p)`. The last element, that of `t`, is set to
    /// zero.
    fn adjoint<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayK<Self, S::Cell>,
        gradient: &mut ArrayV<Self, S::Cell>,
    );

    /// All entries of the lower triangle of `∇²(μᵀ f)`.
    fn hessian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayK<Self, S::Cell>,
        hessian: &mut Self::Hessian<S::Cell>,
    );

    /// A number that changes with the conditions and pieces of linear tables, and one of splines.
    fn branches<S: Lanes>(_v: &ArrayV<Self, S::Cell>, _branches: &mut [S::Cell; 2]) {}

    /// What is known about the model, to be printed: `println!("{}", Pendulum::describe())`.
    #[must_use]
    fn describe() -> &'static Structure {
        const { &Self::STRUCTURE }
    }
}

/// From where to where a variable may be.
///
/// ```
/// use casados::model::Range;
/// use casados::prelude::*;
///
/// #[dae(range(x = 0.0..=2.0), nominal(z = 1.0))]
/// fn tank(xdot: [f64; 1], x: [f64; 1], z: [f64; 1], u: [f64; 1]) -> [f64; 2] {
///     [xdot[0] - u[0] + z[0], z[0] * z[0] - x[0]]
/// }
///
/// assert_eq!(Tank::RANGES[1], Range { low: 0.0, high: 2.0 });
/// assert!(Tank::RANGES[1].contains(1.0) && !Range::ANY.contains(f64::NAN));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The smallest value.
    pub low: f64,
    /// The largest value.
    pub high: f64,
}

impl Range {
    /// Anywhere.
    pub const ANY: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// Whether a value lies inside; NaN does not.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// A model whose code is generic over every scalar: duals and complex numbers included, which is
/// what independent checks of its derivatives need. Graph models are; dual models are not.
///
/// ```
/// use casados::prelude::*;
/// use casados::GraphDae;
///
/// #[ode]
/// fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u - x[0].sin()] }
///
/// // v = (ẋ, x, u, t): six numbers; f = ẋ − (x₁, u − sin x₀).
/// let v = [0.0, 0.0, 0.3, 2.0, 1.0, 0.0];
/// let mut f = [0.0; 2];
/// Pendulum::residual_of::<f64>(&v, &mut f);
/// assert_eq!(f, [-2.0, 0.3_f64.sin() - 1.0]);
///
/// // The gradient of f₁.
/// let mut gradient = [0.0; 6];
/// Pendulum::adjoint_of::<f64>(&v, &[0.0, 1.0], &mut gradient);
/// assert_eq!(gradient, [0.0, 1.0, 0.3_f64.cos(), 0.0, -1.0, 0.0]);
/// ```
pub trait GraphDae: Dae {
    /// The residual `f(v)`; `v` has `NV` elements and `f` has `NK`.
    fn residual_of<S: Scalar<Cell = S>>(v: &[S], f: &mut [S]);
    /// The gradient `∇ᵥ(μᵀ f)`, as [`Dae::adjoint`].
    fn adjoint_of<S: Scalar<Cell = S>>(v: &[S], mu: &[S], gradient: &mut [S]);
}

/// A model in explicit form: row `r` of the residual is `c (ẋ_j − g_j(x, u, p, t))` with a constant
/// `c` and every `j` occurs once; there are no algebraic states.
///
/// Then `g_j = −f_r / c` at `ẋ = 0`, and every derivative of `g` is one of `f`.
///
/// ```
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// /// The same, recognised.
/// #[dae]
/// fn same(xdot: [f64; 2], x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [xdot[0] - x[1], 2.0 * (xdot[1] - u[0])]
/// }
///
/// fn explicit<M: Ode>() -> usize {
///     M::ROWS.len()
/// }
/// assert_eq!((explicit::<Cart>(), explicit::<Same>()), (2, 2));
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not an explicit model",
    label = "explicit Runge-Kutta methods need `ẋ = g(x, u, p, t)`",
    note = "write the model with `#[ode]`, or as a `#[dae]` whose residual is `ẋ − g(...)`; or integrate it with `Irk`"
)]
pub trait Ode: Dae {
    /// For each state `j`: the row `r` and the coefficient `c`.
    const ROWS: &'static [(u32, f64)];
}
