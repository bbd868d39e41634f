//! Vectors and matrices of a model's dimensions.

use super::Dae;
use crate::shape::Shape;

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
