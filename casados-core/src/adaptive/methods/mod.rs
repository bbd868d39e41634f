//! The adaptive methods: families of collocation methods, and explicit pairs.

mod collocation;
pub(super) mod explicit;
mod implicit;
mod kernels;

use crate::adaptive::order::MethodFamily;
use crate::adaptive::replay::{OneMethod, ThreeMethods};
use crate::adaptive::stages::StageSolver;
use crate::error::Error;
use crate::model::Dae;
use crate::scalar::Real;
use crate::tableau::{Gauss, Method, RadauIIA};
use alloc::boxed::Box;

/// Radau IIA methods of 3, 5 and 7 stages: order selection increases the number of stages if
/// Newton's method converges fast and reduces it if it converges slowly.
///
/// ```
/// use casados::prelude::*;
/// use nalgebra::vector;
///
/// /// Van der Pol's oscillator, which is stiff.
/// #[ode]
/// fn oscillator(x: [f64; 2], u: [f64; 1]) -> [f64; 2] {
///     [x[1], 1e3 * (1.0 - x[0] * x[0]) * x[1] - x[0] + u[0]]
/// }
///
/// let mut adaptive = Adaptive::<Oscillator, Radau>::new(AdaptiveOptions::default())?;
/// adaptive.solve(&vector![2.0, 0.0], &vector![0.0], 500.0)?;
/// // An explicit method of fixed steps needs more than 1e6 for the same.
/// assert!(adaptive.statistics().steps < 1000);
/// # Ok::<(), casados::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Radau;

impl MethodFamily for Radau {
    const ORDER_COUNT: usize = 3;
    const ENDS_ON_STAGE: bool = true;
    type Differentiator<M: Dae, T: Real> = ThreeMethods<
        OneMethod<M, RadauIIA<3>, T, 3>,
        OneMethod<M, RadauIIA<5>, T, 5>,
        OneMethod<M, RadauIIA<7>, T, 7>,
    >;
    fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn StageSolver<M, T> + Send + Sync>, Error> {
        match level {
            0 => RadauIIA::<3>::open(0),
            1 => RadauIIA::<5>::open(0),
            _ => RadauIIA::<7>::open(0),
        }
    }
}

macro_rules! single {
    ($($method:ident: $stages:literal, $groups:literal, $ends_on_stage:literal);*) => {
        $(impl MethodFamily for $method<$stages> {
            const ORDER_COUNT: usize = 1;
            const ENDS_ON_STAGE: bool = $ends_on_stage;
            type Differentiator<M: Dae, T: Real> = OneMethod<M, Self, T, $stages>;
            fn open<M: Dae, T: Real>(_: usize) -> Result<Box<dyn StageSolver<M, T> + Send + Sync>, Error> {
                // The lanes of all eigenvalues, padded to registers; stages in groups of four.
                let tableau = <Self as Method<$stages>>::TABLEAU;
                Ok(Box::new(collocation::Collocation::<M, T, $stages, $groups>::new(tableau)?))
            }
        })*
    };
}
single!(RadauIIA: 3, 1, true; RadauIIA: 5, 2, true; RadauIIA: 7, 2, true);
single!(Gauss: 2, 1, false; Gauss: 3, 1, false; Gauss: 4, 1, false; Gauss: 5, 2, false; Gauss: 6, 2, false);
