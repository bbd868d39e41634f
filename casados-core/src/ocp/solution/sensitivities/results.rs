//! Results of [`SolutionFactors`](super::SolutionFactors).

/// `λᵀ dw/dx₀` and `λᵀ dw/dp`; see [`SolutionFactors`](super::SolutionFactors) for an example.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// let mut factors = SolutionFactors::new(&ocp)?;
/// ocp.factorise(Exact::default(), &mut factors)?;
/// // λ is one for the first control: how it follows from the state, which is the gain.
/// let mut seed = ocp.iterate().clone();
/// for stage in 0..=20 {
///     let stage_of = seed.stage_mut(stage).unwrap();
///     stage_of.x.fill(0.0);
///     stage_of.u.fill(if stage == 0 { 1.0 } else { 0.0 });
/// }
/// let gain = factors.adjoint(&seed)?.x0[0];
/// assert!((gain - ocp.stage(0)?.u[0]).abs() < 1e-6); // the law is linear, and the state is one
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SolutionAdjoint<'a, T> {
    /// With respect to the initial state, `NX`; empty if it is free.
    pub x0: &'a [T],
    /// With respect to the parameters, `NP`.
    pub p: &'a [T],
}

/// The Hessian of the optimal value; matrices by columns. With a free initial state only `∂²V/∂p²`
/// is not empty; with linear controls, which are free at the start, `x₀` are the states of the
/// model.
///
/// ```
/// # use casados::ocp::*;
/// # use casados::prelude::*;
/// # #[function]
/// # fn push(x: f64, u: f64) -> f64 { x + u }
/// # #[function]
/// # fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
/// # let mut ocp = Problem::new(Map::<Push, f64>::new())
/// #     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
/// #     .on(Horizon::uniform(20, 0.1))?;
/// # ocp.fix_initial_state(&[1.0])?.guess(&[1.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// let mut factors = SolutionFactors::new(&ocp)?;
/// ocp.factorise(Exact::default(), &mut factors)?;
/// // The solution of Riccati's equation P² = P + 1, to which the horizon comes close.
/// assert!((factors.value_hessian().xx[0] - 1.618).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ValueHessian<'a, T> {
    /// `∂²V/∂x₀²`, `NX × NX`.
    pub xx: &'a [T],
    /// `∂²V/∂x₀∂p`, `NX × NP`.
    pub xp: &'a [T],
    /// `∂²V/∂p²`, `NP × NP`.
    pub pp: &'a [T],
}
