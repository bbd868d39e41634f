//! Results of integrations with events.

use super::*;
use crate::finite::check_gradient;

/// An event that happened.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A ball that falls: height m, velocity m/s.
/// # #[ode]
/// # fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// # #[function]
/// # fn height(x: [f64; 2]) -> f64 { x[0] }
/// # #[function]
/// # fn bounce(x: [f64; 2]) -> [f64; 2] { [x[0], -0.8 * x[1]] }
/// # let bounces = Event::jump::<Height, Bounce>(Crossing::Falling);
/// # let adaptive = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// # let mut ball = Hybrid::new(adaptive, &[bounces])?;
/// let end = ball.solve(&vector![5.0, 0.0], &vector![], 1.5)?;
/// // It hits the ground after a second, and goes up again with four fifths of its velocity.
/// let hit = &end.occurrences[0];
/// assert!((hit.t - 1.0).abs() < 1e-11 && (hit.before[1] + 10.0).abs() < 1e-10);
/// assert!((hit.after[1] - 8.0).abs() < 1e-10);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct Occurrence<M: Dae, T: Real = f64> {
    /// The index of the event in the list.
    pub event: usize,
    /// The time of the event: the time `t` of the model, not the time since the start of the
    /// interval.
    pub t: T,
    /// The state before the event.
    pub before: VectorX<M, T>,
    /// The state after the event.
    pub after: VectorX<M, T>,
}

/// The solution at the end, and the events.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A ball that falls: height m, velocity m/s.
/// # #[ode]
/// # fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// # #[function]
/// # fn height(x: [f64; 2]) -> f64 { x[0] }
/// # #[function]
/// # fn bounce(x: [f64; 2]) -> [f64; 2] { [x[0], -0.8 * x[1]] }
/// # let bounces = Event::jump::<Height, Bounce>(Crossing::Falling);
/// # let adaptive = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// # let mut ball = Hybrid::new(adaptive, &[bounces])?;
/// let end = ball.solve(&vector![5.0, 0.0], &vector![], 1.5)?;
/// assert!(end.occurrences.len() == 1 && !end.terminal && (end.t - 1.5).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct Solution<M: Dae, T: Real = f64> {
    /// `x` and `z` at the end, `z0` at the start.
    pub nominal: Nominal<M, T>,
    /// The time at the end: the end of the interval, or the time of the event that ended the
    /// integration.
    pub t: T,
    /// Whether an event ended the integration: the last of the occurrences.
    pub terminal: bool,
    /// The events, in order of time.
    pub occurrences: Vec<Occurrence<M, T>>,
}

/// The solution at the end and its derivatives; if an event ended the integration, they include the
/// derivative of its time.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A ball that falls: height m, velocity m/s.
/// # #[ode]
/// # fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// # #[function]
/// # fn height(x: [f64; 2]) -> f64 { x[0] }
/// # #[function]
/// # fn bounce(x: [f64; 2]) -> [f64; 2] { [x[0], -0.8 * x[1]] }
/// # let bounces = Event::jump::<Height, Bounce>(Crossing::Falling);
/// # let adaptive = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// # let mut ball = Hybrid::new(adaptive, &[bounces])?;
/// let end = ball.forward(&vector![5.0, 0.0], &vector![], 1.5)?;
/// // The velocity after it is 0.8 · 10 t − 10 (1.5 − t), where t grows by 0.1 s for each metre.
/// assert!((end.dx_dx0[(1, 0)] - 1.8).abs() < 1e-9);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct HybridForward<M: Dae, T: Real = f64> {
    /// The solution.
    pub solution: Solution<M, T>,
    /// `∂x/∂x₀`
    pub dx_dx0: MatrixXX<M, T>,
    /// `∂x/∂u`
    pub dx_du: MatrixXU<M, T>,
    /// `∂x/∂p`
    pub dx_dp: MatrixXP<M, T>,
    /// The derivatives of the time of each event with respect to `x₀`, `u` and `p`.
    pub times: Vec<TimeGradient<M, T>>,
}

/// The derivatives of the time of an event.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A ball that falls: height m, velocity m/s.
/// # #[ode]
/// # fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// # #[function]
/// # fn height(x: [f64; 2]) -> f64 { x[0] }
/// # #[function]
/// # fn bounce(x: [f64; 2]) -> [f64; 2] { [x[0], -0.8 * x[1]] }
/// # let bounces = Event::jump::<Height, Bounce>(Crossing::Falling);
/// # let adaptive = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// # let mut ball = Hybrid::new(adaptive, &[bounces])?;
/// let end = ball.forward(&vector![5.0, 0.0], &vector![], 1.5)?;
/// // It hits the ground at t = √(2 x₀ / 10).
/// assert!((end.times[0].x0 - vector![0.1, 0.1]).norm() < 1e-10);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct TimeGradient<M: Dae, T: Real = f64> {
    /// `∂t/∂x₀`
    pub x0: VectorX<M, T>,
    /// `∂t/∂u`
    pub u: VectorU<M, T>,
    /// `∂t/∂p`
    pub p: VectorP<M, T>,
}

/// The solution at the end and the gradient of `λᵀx`.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A ball that falls: height m, velocity m/s.
/// # #[ode]
/// # fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// # #[function]
/// # fn height(x: [f64; 2]) -> f64 { x[0] }
/// # #[function]
/// # fn bounce(x: [f64; 2]) -> [f64; 2] { [x[0], -0.8 * x[1]] }
/// # let bounces = Event::jump::<Height, Bounce>(Crossing::Falling);
/// # let adaptive = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// # let mut ball = Hybrid::new(adaptive, &[bounces])?;
/// // The gradient of the velocity at the end, by the state at the start.
/// let end = ball.adjoint(&vector![5.0, 0.0], &vector![], 1.5, &vector![0.0, 1.0])?;
/// assert!((end.grad_x0[0] - 1.8).abs() < 1e-9);
/// # Ok::<(), casados::Error>(())
/// ```
#[non_exhaustive]
pub struct HybridAdjoint<M: Dae, T: Real = f64> {
    /// The solution.
    pub solution: Solution<M, T>,
    /// `∇(λᵀx)` with respect to `x₀`
    pub grad_x0: VectorX<M, T>,
    /// `∇(λᵀx)` with respect to `u`
    pub grad_u: VectorU<M, T>,
    /// `∇(λᵀx)` with respect to `p`
    pub grad_p: VectorP<M, T>,
}

impl<M: Dae, T: Real> HybridAdjoint<M, T> {
    /// # Errors
    /// [`Error::Overflow`] of the first derivative that is not finite.
    pub(super) fn check(&self) -> Result<(), Error> {
        check_gradient(self.grad_x0.as_slice(), self.grad_u.as_slice(), self.grad_p.as_slice())
    }
}

plain!([M: Dae, T: Real] Occurrence<M, T> { event, t, before, after });
plain!([M: Dae, T: Real] TimeGradient<M, T> { x0, u, p });
listed!([M: Dae, T: Real] Solution<M, T> { nominal, t, terminal, occurrences });
listed!([M: Dae, T: Real] HybridForward<M, T> { solution, dx_dx0, dx_du, dx_dp, times });
listed!([M: Dae, T: Real] HybridAdjoint<M, T> { solution, grad_x0, grad_u, grad_p });
