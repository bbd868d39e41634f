//! The definition of an event: its function, its direction, and its effect.

use crate::function::{ArrayY, Function};
use crate::model::{ArrayV, ArrayX, Dae};
use crate::scalar::Real;
use crate::shape::{Outputs, Shape, copy};
use bytemuck::Zeroable;

/// The direction in which an event function crosses zero.
///
/// ```
/// # use casados::prelude::*;
/// # use nalgebra::vector;
/// # /// A ball that falls: height m, velocity m/s.
/// # #[ode]
/// # fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// # #[function]
/// # fn height(x: [f64; 2]) -> f64 { x[0] }
/// // Thrown up, it passes two metres on its way up, and again on its way down.
/// # #[function]
/// # fn two_metres(x: [f64; 2]) -> f64 { x[0] - 2.0 }
/// let time = |crossing| {
///     let event = Event::terminal::<TwoMetres>(crossing);
///     let adaptive = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
///     let mut ball = Hybrid::new(adaptive, &[event])?;
///     Ok::<f64, Error>(ball.solve(&vector![0.0, 7.0], &vector![], 2.0)?.t)
/// };
/// assert!((time(Crossing::Rising)? - 0.4).abs() < 1e-9);
/// assert!((time(Crossing::Falling)? - 1.0).abs() < 1e-9);
/// assert_eq!(time(Crossing::Any)?, time(Crossing::Rising)?);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crossing {
    /// From negative to positive.
    Rising,
    /// From positive to negative.
    Falling,
    /// Both directions.
    Any,
}

impl Crossing {
    /// Whether the signs change in this direction.
    pub(super) fn matches(self, before: f64, after: f64) -> bool {
        let rising = before < 0.0 && after >= 0.0;
        let falling = before > 0.0 && after <= 0.0;
        match self {
            Self::Rising => rising,
            Self::Falling => falling,
            Self::Any => rising || falling,
        }
    }
}

/// A zero crossing of an event function `g(x, z, u, p, t)`, at which the integration ends or the
/// state jumps to `j(x, u, p, t)`.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::{SVector, vector};
///
/// #[ode]
/// fn ball(x: [f64; 2]) -> [f64; 2] { [x[1], -10.0] }
/// #[function]
/// fn height(x: [f64; 2]) -> f64 { x[0] }
///
/// // The integration ends on the ground.
/// let ground = Event::terminal::<Height>(Crossing::Falling);
/// let radau = Adaptive::<Ball, Radau>::new(AdaptiveOptions::default())?;
/// let mut ball = Hybrid::new(radau, &[ground])?;
/// let end = ball.solve(&vector![5.0, 0.0], &SVector::<f64, 0>::zeros(), 9.0)?;
/// assert!((end.t - 1.0).abs() < 1e-12);
/// # Ok::<(), casados::Error>(())
/// ```
pub struct Event<M: Dae, T: Real = f64> {
    pub(super) crossing: Crossing,
    pub(super) guard: EventFunction<M, T>,
    pub(super) jump: Option<EventFunction<M, T>>,
}

impl<M: Dae, T: Real> Event<M, T> {
    /// An event that ends the integration where the only output of `G` crosses zero.
    ///
    /// The compiler checks that `G` has one output.
    #[must_use]
    pub fn terminal<G: Function<Shape = M::Shape>>(crossing: Crossing) -> Self {
        const { assert!(G::Outputs::NY == 1, "the function of an event has one output") };
        Self { crossing, guard: EventFunction::of::<G>(), jump: None }
    }

    /// An event at which the state jumps: where the only output of `G` crosses zero, the output of
    /// `J` replaces the state.
    ///
    /// The compiler checks that `G` has one output, that `J` has one output for each state, and
    /// that `J` does not depend on `z`.
    #[must_use]
    pub fn jump<G: Function<Shape = M::Shape>, J: Function<Shape = M::Shape>>(crossing: Crossing) -> Self {
        const { assert!(J::Outputs::NY == <M::Shape as Shape>::NX, "a jump has one output for each state") };
        Self { jump: Some(EventFunction::of_states_only::<J>()), ..Self::terminal::<G>(crossing) }
    }
}

copy!([M: Dae, T: Real] Event<M, T>);

impl<M: Dae, T: Real> core::fmt::Debug for Event<M, T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mut event = f.debug_struct("Event");
        event.field("crossing", &self.crossing).field("guard", &self.guard.name);
        event.field("jump", &self.jump.map(|jump| jump.name)).finish()
    }
}

/// Writes the gradient, given the variables and multipliers.
type GradientFn<M, T> = fn(&ArrayV<M, T>, &[T], &mut ArrayV<M, T>);

/// Visits the entries of the lower triangle of the Hessian, given the variables and multipliers.
type HessianFn<M, T> = fn(&ArrayV<M, T>, &[T], &mut dyn FnMut(usize, usize, T));

/// A function with at most as many outputs as states.
pub(super) struct EventFunction<M: Dae, T: Real> {
    pub name: &'static str,
    /// Whether it depends on algebraic states.
    pub reads_algebraic_states: bool,
    value: fn(&ArrayV<M, T>, &mut [T]),
    gradient_fn: GradientFn<M, T>,
    time_derivative: fn(&ArrayV<M, T>, &mut [T]),
    hessian: HessianFn<M, T>,
}

copy!([M: Dae, T: Real] EventFunction<M, T>);

/// The outputs of a function as an array.
fn write_outputs<F: Function, T: Real>(to: &mut [T], write: impl FnOnce(&mut ArrayY<F, T>)) {
    let mut y = ArrayY::<F, T>::zeroed();
    write(&mut y);
    for (to, from) in to.iter_mut().zip(y.as_ref()) {
        *to = *from;
    }
}

/// The multipliers, one for each output.
fn multiplier_array<F: Function, T: Real>(mu: &[T]) -> ArrayY<F, T> {
    let mut all = ArrayY::<F, T>::zeroed();
    for (to, from) in all.as_mut().iter_mut().zip(mu) {
        *to = *from;
    }
    all
}

impl<M: Dae, T: Real> EventFunction<M, T> {
    /// Checks that the function does not depend on algebraic states.
    fn of_states_only<F: Function<Shape = M::Shape>>() -> Self {
        const {
            assert!(
                F::STRUCTURE.blocks[2] == F::STRUCTURE.blocks[3],
                "jumps do not depend on algebraic states: write them in terms of x, u, p and t"
            );
        }
        Self::of::<F>()
    }

    fn of<F: Function<Shape = M::Shape>>() -> Self {
        Self {
            name: F::STRUCTURE.name,
            reads_algebraic_states: F::STRUCTURE.blocks[2] != F::STRUCTURE.blocks[3],
            value: |v, y| write_outputs::<F, T>(y, |y| F::value::<T>(v, y)),
            gradient_fn: |v, mu, gradient| F::adjoint::<T>(v, &multiplier_array::<F, T>(mu), gradient),
            time_derivative: |v, y| write_outputs::<F, T>(y, |y| F::time_derivative::<T>(v, y)),
            hessian: |v, mu, each| {
                let mut entries = F::Hessian::<T>::zeroed();
                F::hessian::<T>(v, &multiplier_array::<F, T>(mu), &mut entries);
                for (entry, value) in entries.as_ref().iter().enumerate() {
                    let (row, column) = F::STRUCTURE.hessian.at(entry);
                    each(row, column, *value);
                }
            },
        }
    }

    /// The first output.
    pub fn first_output(&self, v: &ArrayV<M, T>) -> T {
        let mut y = [T::ZERO];
        (self.value)(v, &mut y);
        y[0]
    }

    /// All outputs.
    pub fn all_outputs(&self, v: &ArrayV<M, T>) -> ArrayX<M, T> {
        let mut y = ArrayX::<M, T>::zeroed();
        (self.value)(v, y.as_mut());
        y
    }

    /// Visits the entries of the lower triangle of `∇²(μᵀy)`; row and column are indices of
    /// variables.
    pub fn hessian(&self, v: &ArrayV<M, T>, mu: &[T], each: &mut dyn FnMut(usize, usize, T)) {
        (self.hessian)(v, mu, each);
    }

    /// `∇(μᵀy)` and `μᵀ ∂y/∂t`.
    pub fn gradient(&self, v: &ArrayV<M, T>, mu: &[T]) -> (ArrayV<M, T>, T) {
        let mut gradient = ArrayV::<M, T>::zeroed();
        (self.gradient_fn)(v, mu, &mut gradient);
        let mut rate = ArrayX::<M, T>::zeroed();
        let rate = rate.as_mut();
        // A model without states has no event that depends on time alone.
        (self.time_derivative)(v, rate);
        (gradient, mu.iter().zip(rate).fold(T::ZERO, |sum, (mu, rate)| sum + *mu * *rate))
    }
}
