//! The results of integrators: nalgebra vectors and matrices of the model's dimensions.
//!
//! Every result contains the smaller ones and dereferences to them: `forward.x` is the final state
//! and `hessian.dx_du` the Jacobian of the same call.

use crate::model::{
    Dae, MatrixPC, MatrixPP, MatrixUC, MatrixUP, MatrixUU, MatrixXC, MatrixXP, MatrixXU, MatrixXX, MatrixZC,
    MatrixZP, MatrixZU, MatrixZX, VectorP, VectorU, VectorX, VectorZ,
};
use crate::shape::{Array, Matrix, Plain, plain, update_entry};
use bytemuck::Zeroable;
use core::ops::Deref;

/// The solution.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let end = irk.solve(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// assert!((end.x - vector![0.75, 2.0]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct Nominal<M: Dae, T: Plain = f64> {
    /// Differential states at the end of the interval.
    pub x: VectorX<M, T>,
    /// Algebraic states at the end of the interval.
    pub z: VectorZ<M, T>,
    /// Algebraic states at the start of the interval.
    pub z0: VectorZ<M, T>,
}

/// The solution and its derivatives with respect to `x₀`, `u` and `p`.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let end = irk.forward(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// assert!((end.dx_dx0[(0, 1)] - 0.5).abs() < 1e-14); // ∂position/∂velocity = h
/// assert!((end.x[1] - 2.0).abs() < 1e-14); // what a smaller call returns is there too
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct Forward<M: Dae, T: Plain = f64> {
    /// `x`, `z` and `z0`.
    pub nominal: Nominal<M, T>,
    /// `∂x/∂x₀`
    pub dx_dx0: MatrixXX<M, T>,
    /// `∂x/∂u`
    pub dx_du: MatrixXU<M, T>,
    /// `∂x/∂p`
    pub dx_dp: MatrixXP<M, T>,
    /// `∂z/∂x₀` at the end of the interval.
    pub dz_dx0: MatrixZX<M, T>,
    /// `∂z/∂u` at the end of the interval.
    pub dz_du: MatrixZU<M, T>,
    /// `∂z/∂p` at the end of the interval.
    pub dz_dp: MatrixZP<M, T>,
    /// `∂z/∂x₀` at the start of the interval.
    pub dz0_dx0: MatrixZX<M, T>,
    /// `∂z/∂u` at the start of the interval.
    pub dz0_du: MatrixZU<M, T>,
    /// `∂z/∂p` at the start of the interval.
    pub dz0_dp: MatrixZP<M, T>,
}

/// The solution and its derivatives in `C` directions.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut seeds = Seeds::<Cart, f64, 1>::default();
/// seeds.u[(0, 0)] = 1.0;
/// let end = irk.directional(&vector![0.0, 1.0], &vector![2.0], 0.5, &seeds)?;
/// assert!((end.dx - vector![0.125, 0.5]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct Directional<M: Dae, T: Plain, const C: usize> {
    /// `x`, `z` and `z0`.
    pub nominal: Nominal<M, T>,
    /// `∂x/∂(x₀, u, p) · seeds`
    pub dx: MatrixXC<M, T, C>,
    /// `∂z/∂(x₀, u, p) · seeds` at the end of the interval.
    pub dz: MatrixZC<M, T, C>,
    /// `∂z/∂(x₀, u, p) · seeds` at the start of the interval.
    pub dz0: MatrixZC<M, T, C>,
}

/// `C` directions `(δx₀, δu, δp)`, one per column: the argument of `directional`. Zero by default.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let mut seeds = Seeds::<Cart, f64, 2>::default();
/// seeds.x0[(1, 0)] = 1.0; // the velocity in the first direction
/// seeds.u[(0, 1)] = 1.0; // the push in the second
/// let end = irk.directional(&vector![0.0, 1.0], &vector![2.0], 0.5, &seeds)?;
/// assert!((end.dx.column(0) - vector![0.5, 1.0]).norm() < 1e-14);
/// assert!((end.dx.column(1) - vector![0.125, 0.5]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Seeds<M: Dae, T: Plain, const C: usize> {
    /// `δx₀`
    pub x0: MatrixXC<M, T, C>,
    /// `δu`
    pub u: MatrixUC<M, T, C>,
    /// `δp`
    pub p: MatrixPC<M, T, C>,
}

/// The solution and the gradients of `λᵀx` for `C` seeds `λ`, one per column.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let end = irk.adjoint(&vector![0.0, 1.0], &vector![2.0], 0.5, &vector![1.0, 0.0])?;
/// assert!((end.grad_x0 - vector![1.0, 0.5]).norm() < 1e-14);
/// assert!((end.grad_u[0] - 0.125).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct Adjoint<M: Dae, T: Plain = f64, const C: usize = 1> {
    /// `x`, `z` and `z0`.
    pub nominal: Nominal<M, T>,
    /// `∇(λᵀx)` with respect to `x₀`
    pub grad_x0: MatrixXC<M, T, C>,
    /// `∇(λᵀx)` with respect to `u`
    pub grad_u: MatrixUC<M, T, C>,
    /// `∇(λᵀx)` with respect to `p`
    pub grad_p: MatrixPC<M, T, C>,
}

/// The solution, its derivatives, and the gradient of `λᵀx`.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let end = irk.forward_adjoint(&vector![0.0, 1.0], &vector![2.0], 0.5, &vector![1.0, 0.0])?;
/// assert!((end.dx_du - vector![0.125, 0.5]).norm() < 1e-14);
/// assert!((end.grad_u[0] - 0.125).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct ForwardAdjoint<M: Dae, T: Plain = f64> {
    /// The solution and its derivatives.
    pub forward: Forward<M, T>,
    /// `∇(λᵀx)` with respect to `x₀`
    pub grad_x0: VectorX<M, T>,
    /// `∇(λᵀx)` with respect to `u`
    pub grad_u: VectorU<M, T>,
    /// `∇(λᵀx)` with respect to `p`
    pub grad_p: VectorP<M, T>,
}

/// The solution, its derivatives, and the gradient and Hessian of `λᵀx`, or of `λᵀx + νᵀz0` with
/// weights `ν`.
///
/// The Hessian over `(x₀, u, p)` is bitwise symmetric; of its off-diagonal blocks the upper ones
/// are stored.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// let end = irk.hessian(&vector![0.0, 1.0], &vector![2.0], 0.5, &vector![1.0, 0.0])?;
/// assert!((end.grad_x0 - vector![1.0, 0.5]).norm() < 1e-14);
/// assert!(end.h_xx.norm() < 1e-14 && end.h_uu.norm() < 1e-14); // the model is linear
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct Hessian<M: Dae, T: Plain = f64> {
    /// The solution, its derivatives, and the gradient.
    pub first: ForwardAdjoint<M, T>,
    /// `∂²(λᵀx)/∂x₀²`
    pub h_xx: MatrixXX<M, T>,
    /// `∂²(λᵀx)/∂x₀∂u`
    pub h_xu: MatrixXU<M, T>,
    /// `∂²(λᵀx)/∂u²`
    pub h_uu: MatrixUU<M, T>,
    /// `∂²(λᵀx)/∂x₀∂p`
    pub h_xp: MatrixXP<M, T>,
    /// `∂²(λᵀx)/∂u∂p`
    pub h_up: MatrixUP<M, T>,
    /// `∂²(λᵀx)/∂p²`
    pub h_pp: MatrixPP<M, T>,
}

/// The solution at a time inside the interval.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// irk.solve(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// let middle = irk.dense(0.25)?;
/// assert!((middle.x - vector![0.3125, 1.5]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct Dense<M: Dae, T: Plain = f64> {
    /// Differential states.
    pub x: VectorX<M, T>,
    /// Algebraic states.
    pub z: VectorZ<M, T>,
}

/// The solution at a time inside the interval, and its derivatives.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
/// #[ode]
/// fn cart(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], u[0]]
/// }
/// let mut irk = Irk::<Cart, Gauss<2>>::new(Options::default())?;
/// irk.forward(&vector![0.0, 1.0], &vector![2.0], 0.5)?;
/// let middle = irk.dense_forward(0.25)?;
/// assert!((middle.dx_du - vector![0.03125, 0.25]).norm() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
#[non_exhaustive]
pub struct DenseForward<M: Dae, T: Plain = f64> {
    /// `x` and `z`.
    pub dense: Dense<M, T>,
    /// `∂x/∂x₀`
    pub dx_dx0: MatrixXX<M, T>,
    /// `∂x/∂u`
    pub dx_du: MatrixXU<M, T>,
    /// `∂x/∂p`
    pub dx_dp: MatrixXP<M, T>,
    /// `∂z/∂x₀`
    pub dz_dx0: MatrixZX<M, T>,
    /// `∂z/∂u`
    pub dz_du: MatrixZU<M, T>,
    /// `∂z/∂p`
    pub dz_dp: MatrixZP<M, T>,
}

plain!([M: Dae, T: Plain] Nominal<M, T> { x, z, z0 });
plain!([M: Dae, T: Plain] Forward<M, T> { nominal, dx_dx0, dx_du, dx_dp, dz_dx0, dz_du, dz_dp, dz0_dx0, dz0_du, dz0_dp });
plain!([M: Dae, T: Plain, const C: usize] Directional<M, T, C> { nominal, dx, dz, dz0 });
plain!([M: Dae, T: Plain, const C: usize] Seeds<M, T, C> { x0, u, p });
plain!([M: Dae, T: Plain, const C: usize] Adjoint<M, T, C> { nominal, grad_x0, grad_u, grad_p });
plain!([M: Dae, T: Plain] ForwardAdjoint<M, T> { forward, grad_x0, grad_u, grad_p });
plain!([M: Dae, T: Plain] Hessian<M, T> { first, h_xx, h_xu, h_uu, h_xp, h_up, h_pp });
plain!([M: Dae, T: Plain] Dense<M, T> { x, z });
plain!([M: Dae, T: Plain] DenseForward<M, T> { dense, dx_dx0, dx_du, dx_dp, dz_dx0, dz_du, dz_dp });

/// A result of zeros.
macro_rules! zeros {
    ($($type:ident)*) => { $(
        impl<M: Dae, T: Plain> Default for $type<M, T> {
            fn default() -> Self {
                Self::zeroed()
            }
        }
    )* };
}
zeros!(Nominal Forward ForwardAdjoint Hessian Dense DenseForward);

impl<M: Dae, T: Plain, const C: usize> Default for Adjoint<M, T, C> {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// Zero directions; set the seeds that are needed.
impl<M: Dae, T: Plain, const C: usize> Default for Seeds<M, T, C> {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// Dereferences a result to a smaller one that it contains.
macro_rules! contains {
    ($outer:ident.$field:ident: $inner:ident, $($generics:tt)*) => {
        contains!(@ [$($generics)*] $outer $field $inner);
    };
    (@ [] $outer:ident $field:ident $inner:ident) => {
        impl<M: Dae, T: Plain> Deref for $outer<M, T> {
            type Target = $inner<M, T>;
            fn deref(&self) -> &Self::Target {
                &self.$field
            }
        }
    };
    (@ [C] $outer:ident $field:ident $inner:ident) => {
        impl<M: Dae, T: Plain, const C: usize> Deref for $outer<M, T, C> {
            type Target = $inner<M, T>;
            fn deref(&self) -> &Self::Target {
                &self.$field
            }
        }
    };
}
contains!(Forward.nominal: Nominal,);
contains!(Adjoint.nominal: Nominal, C);
contains!(Directional.nominal: Nominal, C);
contains!(ForwardAdjoint.forward: Forward,);
contains!(Hessian.first: ForwardAdjoint,);
contains!(DenseForward.dense: Dense,);

/// Writes a row over the directions `(x₀, u, p)` to row `r` of three matrices.
pub(crate) fn write_row<T: Plain>(
    row: &[T],
    r: usize,
    x: &mut impl Matrix<T>,
    u: &mut impl Matrix<T>,
    p: &mut impl Matrix<T>,
) {
    let mut values = row.iter();
    write_matrix_row(&mut values, r, x);
    write_matrix_row(&mut values, r, u);
    write_matrix_row(&mut values, r, p);
}

fn write_matrix_row<'a, T: Plain, A: Matrix<T>>(
    values: &mut impl Iterator<Item = &'a T>,
    r: usize,
    to: &mut A,
) {
    for column in 0..A::COLUMNS {
        if let Some(value) = values.next() {
            update_entry(to, r, column, |_| *value);
        }
    }
}

/// Writes a diagonal block from its lower triangle.
pub(crate) fn write_symmetric<T: Plain, R: Array<T>, A: Matrix<T>>(
    block: &mut A,
    lower: &[R],
    offset: usize,
) {
    for r in 0..A::ROWS {
        for c in 0..=r {
            let value = lower[offset + r][offset + c];
            block[(r, c)] = value;
            block[(c, r)] = value;
        }
    }
}
