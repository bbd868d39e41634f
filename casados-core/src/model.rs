//! The one contract between a model and the engine.
//!
//! A model is a differential-algebraic equation `f(ẋ, x, u, z, p, t) = 0` with
//! `f ∈ R^{nx+nz}`, index 1: `∂f/∂(ẋ, z)` is invertible. Its variables are one flat array
//! `v = (ẋ, x, z, u, p, t)`; derivatives are taken with respect to all of them but `t`.

use crate::scalar::{Lanes, Scalar, Tangent};
use crate::shape::{Array, Plain, Shape};
#[doc(no_inline)]
pub use crate::structure::{
    Assembly, Cost, Dependent, DiagonalControl, Elimination, Kinematic, Left, NO_COLUMN, Operations, Pattern,
    Pivot, Reduction, Structure, Supernode, Term, Units, Update, all, by_column, columns, symmetric,
};
use bytemuck::Zeroable;

/// `[T; NX]` of a model.
pub type ArrayX<M, T> = <<M as Dae>::Shape as Shape>::ArrayX<T>;
/// `[T; NK]` of a model: one element per unknown `(k, z)`, or per equation.
pub type ArrayK<M, T> = <<M as Dae>::Shape as Shape>::ArrayK<T>;
/// `[T; NV]` of a model: one element per variable `(ẋ, x, z, u, p, t)`.
pub type ArrayV<M, T> = <<M as Dae>::Shape as Shape>::ArrayV<T>;
/// `[T; NW]` of a model: one element per direction `(x₀, u, p)`.
pub type ArrayW<M, T> = <<M as Dae>::Shape as Shape>::ArrayW<T>;
/// `SVector<T, NX>` of a model.
///
/// ```
/// # use casados::model::VectorX;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let x: VectorX<Spring, f64> = irk.solve(&x0, &u, h)?.x; // SVector<f64, 2>
/// assert_eq!(x.len(), Spring::STRUCTURE.x.len());
/// # Ok::<(), casados::Error>(())
/// ```
pub type VectorX<M, T> = <<M as Dae>::Shape as Shape>::VectorX<T>;
/// `SVector<T, NZ>` of a model.
///
/// ```
/// # use casados::model::VectorZ;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let z: VectorZ<Spring, f64> = irk.solve(&x0, &u, h)?.z0; // SVector<f64, 1>, at the start
/// assert!((z[0] - 4.0).abs() < 0.05); // continued from the stages
/// # Ok::<(), casados::Error>(())
/// ```
pub type VectorZ<M, T> = <<M as Dae>::Shape as Shape>::VectorZ<T>;
/// `SVector<T, NU>` of a model.
///
/// ```
/// # use casados::model::VectorU;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let lambda = vector![1.0, 0.0];
/// // SVector<f64, 1>
/// let by_force: VectorU<Spring, f64> = irk.adjoint(&x0, &u, h, &lambda)?.grad_u;
/// assert!((by_force[0] - 0.5 * h * h).abs() < 1e-4);
/// # Ok::<(), casados::Error>(())
/// ```
pub type VectorU<M, T> = <<M as Dae>::Shape as Shape>::VectorU<T>;
/// `SVector<T, NP>` of a model.
///
/// ```
/// # use casados::model::VectorP;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let p: VectorP<Spring, f64> = vector![4.0, 0.1]; // SVector<f64, 2>: stiffness, damping
/// irk.set_parameters(&p)?;
/// # Ok::<(), casados::Error>(())
/// ```
pub type VectorP<M, T> = <<M as Dae>::Shape as Shape>::VectorP<T>;
/// `SMatrix<T, NX, NX>` of a model.
///
/// ```
/// # use casados::model::MatrixXX;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let by_start: MatrixXX<Spring, f64> = irk.forward(&x0, &u, h)?.dx_dx0; // SMatrix<f64, 2, 2>
/// assert!((by_start - SMatrix::<f64, 2, 2>::new(1.0, h, -4.0 * h, 1.0)).amax() < 0.03);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixXX<M, T> = <<M as Dae>::Shape as Shape>::MatrixXX<T>;
/// `SMatrix<T, NX, NU>` of a model.
///
/// ```
/// # use casados::model::MatrixXU;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let by_force: MatrixXU<Spring, f64> = irk.forward(&x0, &u, h)?.dx_du; // SMatrix<f64, 2, 1>
/// assert!((by_force - vector![0.5 * h * h, h]).amax() < 2e-3);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixXU<M, T> = <<M as Dae>::Shape as Shape>::MatrixXU<T>;
/// `SMatrix<T, NX, NP>` of a model.
///
/// ```
/// # use casados::model::MatrixXP;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let by_p: MatrixXP<Spring, f64> = irk.forward(&x0, &u, h)?.dx_dp; // SMatrix<f64, 2, 2>
/// // A stiffer spring pulls back by −x₀ more: −h²/2 of the position, −h of the velocity.
/// assert!((by_p.column(0) - vector![-0.5 * h * h, -h]).amax() < 5e-3);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixXP<M, T> = <<M as Dae>::Shape as Shape>::MatrixXP<T>;
/// `SMatrix<T, NZ, NX>` of a model.
///
/// ```
/// # use casados::model::MatrixZX;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let z_by_start: MatrixZX<Spring, f64> = irk.forward(&x0, &u, h)?.dz0_dx0; // SMatrix<f64, 1, 2>
/// assert!((z_by_start - SMatrix::<f64, 1, 2>::new(4.0, 0.1)).amax() < 0.05); // as z0
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixZX<M, T> = <<M as Dae>::Shape as Shape>::MatrixZX<T>;
/// `SMatrix<T, NZ, NU>` of a model.
///
/// ```
/// # use casados::model::MatrixZU;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let by_force: MatrixZU<Spring, f64> = irk.forward(&x0, &u, h)?.dz0_du; // SMatrix<f64, 1, 1>
/// // The force is that of the state at the start; stages are continued to there, to h²/3 here.
/// assert!(by_force.amax() < 5e-3);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixZU<M, T> = <<M as Dae>::Shape as Shape>::MatrixZU<T>;
/// `SMatrix<T, NZ, NP>` of a model.
///
/// ```
/// # use casados::model::MatrixZP;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let by_p: MatrixZP<Spring, f64> = irk.forward(&x0, &u, h)?.dz0_dp; // SMatrix<f64, 1, 2>
/// assert!((by_p - SMatrix::<f64, 1, 2>::new(1.0, 0.0)).amax() < 0.01); // z₀ = p[0] x[0] + p[1] x[1]
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixZP<M, T> = <<M as Dae>::Shape as Shape>::MatrixZP<T>;
/// `SMatrix<T, NU, NU>` of a model.
///
/// ```
/// # use casados::model::MatrixUU;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let lambda = vector![1.0, 0.0];
/// let h_uu: MatrixUU<Spring, f64> = irk.hessian(&x0, &u, h, &lambda)?.h_uu; // SMatrix<f64, 1, 1>
/// assert!(h_uu[0].abs() < 1e-15); // it is linear in the force
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixUU<M, T> = <<M as Dae>::Shape as Shape>::MatrixUU<T>;
/// `SMatrix<T, NU, NP>` of a model.
///
/// ```
/// # use casados::model::MatrixUP;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let lambda = vector![1.0, 0.0];
/// let h_up: MatrixUP<Spring, f64> = irk.hessian(&x0, &u, h, &lambda)?.h_up; // SMatrix<f64, 1, 2>
/// assert!(h_up.amax() < h.powi(3)); // a stiffer spring takes little from what the force does
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixUP<M, T> = <<M as Dae>::Shape as Shape>::MatrixUP<T>;
/// `SMatrix<T, NP, NP>` of a model.
///
/// ```
/// # use casados::model::MatrixPP;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let lambda = vector![1.0, 0.0];
/// let h_pp: MatrixPP<Spring, f64> = irk.hessian(&x0, &u, h, &lambda)?.h_pp; // SMatrix<f64, 2, 2>
/// assert!((h_pp - h_pp.transpose()).amax() < 1e-15);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixPP<M, T> = <<M as Dae>::Shape as Shape>::MatrixPP<T>;
/// `SMatrix<T, NX, C>` of a model.
///
/// ```
/// # use casados::model::MatrixXC;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let seeds = Seeds { x0: SMatrix::<f64, 2, 1>::new(0.0, 1.0), ..Default::default() };
/// let dx: MatrixXC<Spring, f64, 1> = irk.directional(&x0, &u, h, &seeds)?.dx; // SMatrix<f64, 2, 1>
/// assert!((dx[0] - h).abs() < 2e-3); // a velocity moves it for a tenth of a second
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixXC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixXC<T, C>;
/// `SMatrix<T, NZ, C>` of a model.
///
/// ```
/// # use casados::model::MatrixZC;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let seeds = Seeds { x0: SMatrix::<f64, 2, 1>::new(1.0, 0.0), ..Default::default() };
/// let dz: MatrixZC<Spring, f64, 1> = irk.directional(&x0, &u, h, &seeds)?.dz0; // SMatrix<f64, 1, 1>
/// assert!((dz[0] - 4.0).abs() < 0.05); // the stiffness
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixZC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixZC<T, C>;
/// `SMatrix<T, NU, C>` of a model.
///
/// ```
/// # use casados::model::MatrixUC;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let force: MatrixUC<Spring, f64, 1> = vector![1.0]; // SMatrix<f64, 1, 1>
/// let seeds = Seeds { u: force, ..Default::default() };
/// let dx = irk.directional(&x0, &u, h, &seeds)?.dx;
/// assert!((dx - vector![0.5 * h * h, h]).amax() < 2e-3);
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixUC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixUC<T, C>;
/// `SMatrix<T, NP, C>` of a model.
///
/// ```
/// # use casados::model::MatrixPC;
/// # use casados::prelude::*;
/// # use nalgebra::{SMatrix, vector};
/// # /// An oscillator with a force z: two states, one control, two parameters.
/// # #[dae]
/// # fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
/// #     [xdot[0] - x[1], xdot[1] + z - u, z - p[0] * x[0] - p[1] * x[1]]
/// # }
/// # let mut irk = Irk::<Spring, Gauss<2>>::new(Options::default())?;
/// # irk.set_parameters(&vector![4.0, 0.1])?;
/// # let (x0, u, h) = (vector![1.0, 0.0], vector![0.5], 0.1);
/// let stiffer: MatrixPC<Spring, f64, 1> = vector![1.0, 0.0]; // SMatrix<f64, 2, 1>
/// let seeds = Seeds { p: stiffer, ..Default::default() };
/// let dx = irk.directional(&x0, &u, h, &seeds)?.dx;
/// assert!((dx - vector![-0.5 * h * h, -h]).amax() < 5e-3); // as by `dx_dp`
/// # Ok::<(), casados::Error>(())
/// ```
pub type MatrixPC<M, T, const C: usize> = <<M as Dae>::Shape as Shape>::MatrixPC<T, C>;

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
