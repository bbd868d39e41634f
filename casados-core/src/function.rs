//! Functions of the variables of a model: integrands, events, costs, constraints.
//!
//! A function `y(x, z, u, p, t)` with `y ∈ R^{ny}` takes the variables of a model, one flat array
//! `v = (ẋ, x, z, u, p, t)` as in [`Dae`](crate::Dae), and depends on all of them except `ẋ`. It
//! applies to every model of the same dimensions: `F: Function<Shape = M::Shape>`. The attribute
//! `#[function]` generates it, with its derivatives, from a Rust function with the arguments of the
//! model:
//!
//! ```text
//! #[function]
//! fn energy(x: [f64; 2], p: [f64; 1]) -> [f64; 2] {
//!     [0.5 * x[1] * x[1], 0.5 * p[0] * x[0] * x[0]]
//! }
//! ```

use crate::scalar::{Lanes, Scalar};
use crate::shape::{Array, Outputs, Plain, Shape};
use crate::structure::{Operations, Pattern, Units};
#[doc(no_inline)]
pub use crate::structure::{begins, by_row};

/// `[T; NY]` of a function: one element for each output.
pub type ArrayY<F, T> = <<F as Function>::Outputs as Outputs>::ArrayY<T>;
/// `[T; NV]` of a function: one element for each variable `(ẋ, x, z, u, p, t)` of its model.
pub type ArrayV<F, T> = <<F as Function>::Shape as Shape>::ArrayV<T>;
/// `SVector<T, NY>` of a function.
///
/// ```
/// # use casados::function::*;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// A mass on a spring: position m, velocity m/s; force N; stiffness N/m.
/// # #[ode]
/// # fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] { [x[1], u - p * x[0]] }
/// # /// Kinetic and potential energy, J.
/// # #[function]
/// # fn energy(x: [f64; 2], _u: f64, p: f64) -> [f64; 2] {
/// #     [0.5 * x[1] * x[1], 0.5 * p * x[0] * x[0]]
/// # }
/// let mut mean = Quadrature::<Energy>::new();
/// let mut irk = Irk::<Spring, Gauss<3>>::new(Options::default())?;
/// irk.set_parameters(&vector![4.0])?;
/// irk.with(&mut mean).forward(&vector![1.0, 0.0], &vector![0.0], 0.1)?;
/// // Two outputs: half of 4 J after a tenth of a second, nearly all of it potential.
/// let q: VectorY<Energy, f64> = mean.q;
/// assert!((q[0] + q[1] - 0.1 * 2.0).abs() < 1e-8 && q[0] < q[1]);
/// # Ok::<(), casados::Error>(())
/// ```
pub type VectorY<F, T> = <<F as Function>::Outputs as Outputs>::VectorY<T>;
/// `SMatrix<T, NY, NY>` of a function.
///
/// ```
/// # use casados::function::MatrixYY;
/// # use casados::prelude::*;
/// # /// A deviation of two outputs.
/// # #[function]
/// # fn deviation(x: [f64; 2], u: f64) -> [f64; 2] { [x[0], u] }
/// // The weights of least squares: SMatrix<f64, 2, 2>.
/// let weights: MatrixYY<Deviation, f64> = nalgebra::matrix![2.0, 0.5; 0.5, 1.0];
/// assert_eq!(weights, weights.transpose());
/// ```
pub type MatrixYY<F, T> = <<F as Function>::Outputs as Outputs>::MatrixYY<T>;
/// `SMatrix<T, NY, NX>` of a function.
///
/// ```
/// # use casados::function::*;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// A mass on a spring: position m, velocity m/s; force N; stiffness N/m.
/// # #[ode]
/// # fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] { [x[1], u - p * x[0]] }
/// # /// Kinetic and potential energy, J.
/// # #[function]
/// # fn energy(x: [f64; 2], _u: f64, p: f64) -> [f64; 2] {
/// #     [0.5 * x[1] * x[1], 0.5 * p * x[0] * x[0]]
/// # }
/// let mut mean = Quadrature::<Energy>::new();
/// let mut irk = Irk::<Spring, Gauss<3>>::new(Options::default())?;
/// irk.set_parameters(&vector![4.0])?;
/// irk.with(&mut mean).forward(&vector![1.0, 0.0], &vector![0.0], 0.1)?;
/// // Two outputs by two states; the energy 2 x₀² is conserved, and so is its derivative.
/// let by_start: MatrixYX<Energy, f64> = mean.dq_dx0;
/// assert_eq!(by_start.shape(), (2, 2));
/// assert!((by_start[(0, 0)] + by_start[(1, 0)] - 0.1 * 4.0).abs() < 1e-6);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixYX<F, T> = <<F as Function>::Outputs as Outputs>::MatrixYX<<F as Function>::Shape, T>;
/// `SMatrix<T, NY, NZ>` of a function.
///
/// ```
/// use casados::function::MatrixYZ;
/// use casados::prelude::*;
///
/// /// Two outputs of a function of two states and one algebraic state.
/// #[function]
/// fn loads(x: [f64; 2], z: f64) -> [f64; 2] { [z * x[0], z * x[1]] }
///
/// let by_algebraic_state = MatrixYZ::<Loads, f64>::new(1.0, 2.0);
/// assert_eq!(by_algebraic_state.shape(), (2, 1));
/// ```
pub type MatrixYZ<F, T> = <<F as Function>::Outputs as Outputs>::MatrixYZ<<F as Function>::Shape, T>;
/// `SMatrix<T, NY, NU>` of a function.
///
/// ```
/// # use casados::function::*;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// A mass on a spring: position m, velocity m/s; force N; stiffness N/m.
/// # #[ode]
/// # fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] { [x[1], u - p * x[0]] }
/// # /// Kinetic and potential energy, J.
/// # #[function]
/// # fn energy(x: [f64; 2], _u: f64, p: f64) -> [f64; 2] {
/// #     [0.5 * x[1] * x[1], 0.5 * p * x[0] * x[0]]
/// # }
/// let mut mean = Quadrature::<Energy>::new();
/// let mut irk = Irk::<Spring, Gauss<3>>::new(Options::default())?;
/// irk.set_parameters(&vector![4.0])?;
/// irk.with(&mut mean).forward(&vector![1.0, 0.0], &vector![0.0], 0.1)?;
/// // Two outputs by one control.
/// let by_control: MatrixYU<Energy, f64> = mean.dq_du;
/// assert_eq!(by_control.shape(), (2, 1));
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixYU<F, T> = <<F as Function>::Outputs as Outputs>::MatrixYU<<F as Function>::Shape, T>;
/// `SMatrix<T, NY, NP>` of a function.
///
/// ```
/// # use casados::function::*;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// A mass on a spring: position m, velocity m/s; force N; stiffness N/m.
/// # #[ode]
/// # fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] { [x[1], u - p * x[0]] }
/// # /// Kinetic and potential energy, J.
/// # #[function]
/// # fn energy(x: [f64; 2], _u: f64, p: f64) -> [f64; 2] {
/// #     [0.5 * x[1] * x[1], 0.5 * p * x[0] * x[0]]
/// # }
/// let mut mean = Quadrature::<Energy>::new();
/// let mut irk = Irk::<Spring, Gauss<3>>::new(Options::default())?;
/// irk.set_parameters(&vector![4.0])?;
/// irk.with(&mut mean).forward(&vector![1.0, 0.0], &vector![0.0], 0.1)?;
/// // Two outputs by one parameter: of the energy p x₀²/2.
/// let by_stiffness: MatrixYP<Energy, f64> = mean.dq_dp;
/// assert!((by_stiffness[0] + by_stiffness[1] - 0.1 * 0.5).abs() < 1e-7);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixYP<F, T> = <<F as Function>::Outputs as Outputs>::MatrixYP<<F as Function>::Shape, T>;

/// A function `y(x, z, u, p, t)` of the variables of a model, with its derivatives, generated by
/// `#[function]`.
///
/// Entries of the Jacobian and the Hessian are arrays of values in the order of the patterns in
/// [`Function::STRUCTURE`]. Derivatives are taken with respect to all variables; those by `t` are
/// of first order only ([`Function::time_derivative`]).
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// /// An oscillator, and its energy.
/// #[ode]
/// fn oscillator(x: [f64; 2], p: [f64; 1]) -> [f64; 2] {
///     [x[1], -p[0] * x[0]]
/// }
/// #[function]
/// fn energy(x: [f64; 2], p: [f64; 1]) -> [f64; 1] {
///     [0.5 * x[1] * x[1] + 0.5 * p[0] * x[0] * x[0]]
/// }
///
/// assert_eq!(energy([1.0, 0.0], [4.0]), [2.0]); // still an ordinary function
/// let mut irk = Irk::<Oscillator, Gauss<3>>::new(Options { steps: 10, ..Default::default() })?;
/// irk.set_parameters(&vector![4.0])?;
/// let mut mean = Quadrature::<Energy>::new();
/// irk.with(&mut mean).solve(&vector![1.0, 0.0], &Default::default(), 0.5)?;
/// // It is conserved along the solution; at stages up to their error, of order three.
/// assert!((mean.q[0] - 2.0 * 0.5).abs() < 1e-6);
/// # Ok::<(), casados::Error>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a function of a model's variables",
    note = "write it as `#[function] fn name(x: [f64; NX], ...) -> [f64; NY]` and use its type, `Name`"
)]
pub trait Function: 'static {
    /// Dimensions of the model.
    type Shape: Shape;
    /// The number of outputs.
    type Outputs: Outputs;
    /// Values of the structural nonzeros of `∂y/∂(ẋ, x, z, u, p)`; `ẋ` has none.
    type Jacobian<T: Plain>: Array<T>;
    /// Values of the structural nonzeros of the lower triangle of `∇²(μᵀ y)` over
    /// `(ẋ, x, z, u, p)`.
    type Hessian<T: Plain>: Array<T>;
    /// Structural facts, known at compile time.
    const STRUCTURE: FunctionStructure;
    /// The units of the variables, as [`Dae::UNITS`](crate::Dae::UNITS).
    const UNITS: Units = Units::NONE;
    /// The unit of all outputs, after the comma in the first paragraph of the doc comment:
    /// `/// Tension of the tether, N.`
    const UNIT: &'static str = "";
    /// Whether it depends on the time of the integrator.
    const IS_TIMED: bool = false;

    /// Computes the value `y(v)`.
    fn value<S: Lanes>(v: &ArrayV<Self, S::Cell>, y: &mut ArrayY<Self, S::Cell>);

    /// Writes the constant entries of the Jacobian; the others are left unchanged. Called once for
    /// every array that [`Function::value_jacobian`] fills.
    fn jacobian_constants<S: Lanes>(jacobian: &mut Self::Jacobian<S::Cell>);

    /// Computes the value and the non-constant entries of the Jacobian.
    fn value_jacobian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        y: &mut ArrayY<Self, S::Cell>,
        jacobian: &mut Self::Jacobian<S::Cell>,
    );

    /// Computes the gradient `∇ᵥ(μᵀ y)` over `(ẋ, x, z, u, p)`. The elements of `ẋ` and of `t`, the
    /// last, are set to zero.
    fn adjoint<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayY<Self, S::Cell>,
        gradient: &mut ArrayV<Self, S::Cell>,
    );

    /// Computes `∂y/∂t`.
    fn time_derivative<S: Lanes>(v: &ArrayV<Self, S::Cell>, rate: &mut ArrayY<Self, S::Cell>);

    /// Computes all entries of the lower triangle of `∇²(μᵀ y)`.
    fn hessian<S: Lanes>(
        v: &ArrayV<Self, S::Cell>,
        mu: &ArrayY<Self, S::Cell>,
        hessian: &mut Self::Hessian<S::Cell>,
    );
}

/// A function that is generic over every scalar, including dual and complex numbers, for
/// independent checks of its derivatives.
///
/// ```
/// use casados::prelude::*;
/// use casados::GraphFunction;
///
/// /// A distance from the origin.
/// #[function]
/// fn distance(x: [f64; 2]) -> f64 { x[0].hypot(x[1]) }
///
/// // v = (ẋ, x, t): five numbers.
/// let (v, mut y, mut gradient) = ([0.0, 0.0, 3.0, 4.0, 0.0], [0.0], [0.0; 5]);
/// Distance::value_of::<f64>(&v, &mut y);
/// Distance::adjoint_of::<f64>(&v, &[1.0], &mut gradient);
/// assert_eq!(y, [5.0]);
/// assert!((gradient[2] - 0.6).abs() < 1e-15 && (gradient[3] - 0.8).abs() < 1e-15);
/// ```
pub trait GraphFunction: Function {
    /// Computes the value `y(v)`; `v` has `NV` elements and `y` has `NY`.
    fn value_of<S: Scalar<Cell = S>>(v: &[S], y: &mut [S]);
    /// Computes the gradient `∇ᵥ(μᵀ y)`, as [`Function::adjoint`].
    fn adjoint_of<S: Scalar<Cell = S>>(v: &[S], mu: &[S], gradient: &mut [S]);
}

/// Structural facts about a function, known at compile time.
///
/// ```
/// # use casados::function::*;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// A mass on a spring: position m, velocity m/s; force N; stiffness N/m.
/// # #[ode]
/// # fn spring(x: [f64; 2], u: f64, p: f64) -> [f64; 2] { [x[1], u - p * x[0]] }
/// # /// Kinetic and potential energy, J.
/// # #[function]
/// # fn energy(x: [f64; 2], _u: f64, p: f64) -> [f64; 2] {
/// #     [0.5 * x[1] * x[1], 0.5 * p * x[0] * x[0]]
/// # }
/// let structure = &Energy::STRUCTURE;
/// assert_eq!(structure.name, "Energy");
/// assert_eq!((structure.x, structure.p), (&["x[0]", "x[1]"][..], &["p"][..]));
/// // The first output by x[1]; the second by x[0] and p. Columns count (ẋ, x, z, u, p).
/// let entries: Vec<_> = structure.jacobian.iter().collect();
/// assert_eq!(entries, [(0, 3), (1, 2), (1, 5)]);
/// assert!(structure.linear.iter().all(|linear| !linear));
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FunctionStructure {
    /// Name of the function.
    pub name: &'static str,
    /// Names of the differential states, such as `x[3]` or `cart.position`.
    pub x: &'static [&'static str],
    /// Names of the algebraic states.
    pub z: &'static [&'static str],
    /// Names of the controls.
    pub u: &'static [&'static str],
    /// Names of the parameters.
    pub p: &'static [&'static str],
    /// Structural nonzeros of the Jacobian: output, variable. In order of the blocks `y_ẋ` (empty),
    /// `y_x, y_z, y_u, y_p`, within each by row, then by column.
    pub jacobian: Pattern,
    /// The first entry of each of the five blocks in `jacobian`, and the end of the last.
    pub blocks: [usize; 6],
    /// The entries of `y_x, y_z, y_u`, output by output, by [`by_row`].
    pub by_row: &'static [u32],
    /// The first entry of each output in `by_row`, and the end of the last, by [`begins`].
    pub begins: &'static [u32],
    /// Whether each entry of the Jacobian is constant.
    pub constant: &'static [bool],
    /// Structural nonzeros of the lower triangle of `∇²(μᵀ y)`: variable ≥ variable.
    pub hessian: Pattern,
    /// Whether each output is jointly linear in `(x, z, u, p)`, without second derivatives.
    pub linear: &'static [bool],
    /// Variables on which the function depends, ascending: columns of `jacobian`.
    pub variables: &'static [u32],
    /// Numbers of arithmetic operations, with `y` in place of `f`.
    pub operations: Operations,
}
