//! Modes of the memory of [`Inline`](super::Inline) integrators. Every mode includes `solve`.

/// `solve`
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::mode;
/// let mut irk = Irk::<Cart, Gauss<2>, f64, Inline<mode::Nominal>>::inline(Options::default())?;
/// let (x0, u) = (vector![0.0, 0.0], vector![2.0]);
/// assert!((irk.solve(&x0, &u, 1.0)?.x[0] - 1.0).abs() < 1e-14); // nothing is allocated
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Nominal;
/// `forward`, `forward_adjoint` and `dense_forward`
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::mode;
/// let mut irk = Irk::<Cart, Gauss<2>, f64, Inline<mode::Forward>>::inline(Options::default())?;
/// let (x0, u) = (vector![0.0, 0.0], vector![2.0]);
/// assert!((irk.forward(&x0, &u, 1.0)?.x[0] - 1.0).abs() < 1e-14); // nothing is allocated
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Forward;
/// `directional` with `C` directions
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::mode;
/// let options = Options::default();
/// let mut irk = Irk::<Cart, Gauss<2>, f64, Inline<mode::Directional<1>>>::inline(options)?;
/// // The derivative by the control alone.
/// let seeds = Seeds { u: vector![1.0], ..Seeds::default() };
/// let end = irk.directional(&vector![0.0, 0.0], &vector![2.0], 1.0, &seeds)?; // nothing is allocated
/// assert!((end.dx[0] - 0.5).abs() < 1e-14 && (end.dx[1] - 1.0).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Directional<const C: usize>;
/// `adjoint`, with `C` seeds
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::mode;
/// let mut irk = Irk::<Cart, Gauss<2>, f64, Inline<mode::Adjoint>>::inline(Options::default())?;
/// let (x0, u) = (vector![0.0, 0.0], vector![2.0]);
/// // Nothing is allocated.
/// assert!((irk.adjoint(&x0, &u, 1.0, &vector![1.0, 0.0])?.x[0] - 1.0).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Adjoint<const C: usize = 1>;
/// `hessian` and everything in `Forward`
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A cart on a rail: position m, velocity m/s; acceleration m/s².
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// # use casados::mode;
/// let mut irk = Irk::<Cart, Gauss<2>, f64, Inline<mode::Hessian>>::inline(Options::default())?;
/// let (x0, u) = (vector![0.0, 0.0], vector![2.0]);
/// // Nothing is allocated.
/// assert!((irk.hessian(&x0, &u, 1.0, &vector![1.0, 0.0])?.x[0] - 1.0).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Hessian;
