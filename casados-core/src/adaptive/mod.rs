//! Integration with steps of variable size, chosen so that the estimated error of each stays below a tolerance.
//!
//! Radau IIA methods for stiff and differential-algebraic equations, with one Jacobian for all stages and, for
//! [`Radau`], a number of stages (3, 5 or 7: orders 5, 9 and 13) that follows from how Newton's method converges. The
//! algorithm is that of the codes RADAU5 and RADAU (E. Hairer, G. Wanner, Solving Ordinary Differential Equations II,
//! section IV.8; Stiff differential equations solved by Radau methods, J. Comput. Appl. Math. 111 (1999)), for fully
//! implicit equations.
//!
//! One file for each thing: `stages` one step, `control` the step size, `run` the steps of an interval, `tape` what is
//! remembered of them, `consistent` the start, `replay` and `sensitivities` their derivatives, `integrator` what users see.

mod consistent;
mod control;
mod integrator;
mod norm;
mod options;
mod replay;
mod run;
mod sensitivities;
mod stages;
mod statistics;
mod tape;

pub use integrator::Integrator;
pub use options::AdaptiveOptions;
pub use statistics::AdaptiveStatistics;

use crate::error::Error;
use crate::model::Dae;
use crate::scalar::Real;
use crate::tableau::RadauIIA;
use alloc::boxed::Box;
use stages::Stages;

/// The adaptive integrator of the method `B` for the model `M`, with numbers `T`: `Adaptive<Model, Radau>`.
pub type Adaptive<M, B, T = f64> = <B as AdaptiveMethod>::Integrator<M, T>;

/// A method that an adaptive integrator takes.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a method with an estimate of its error",
    note = "`Radau` and `RadauIIA<3>`, `RadauIIA<5>`, `RadauIIA<7>` are"
)]
pub trait AdaptiveMethod {
    /// Its integrator.
    type Integrator<M: Dae, T: Real>;
}

/// Radau IIA methods of 3, 5 and 7 stages: more of them where Newton's method converges fast, fewer where it is slow.
#[derive(Clone, Copy, Debug)]
pub struct Radau;

mod sealed {
    use super::*;

    /// The methods that an integrator may change between.
    pub trait Family: 'static {
        /// How many.
        const LEVELS: usize;
        /// The number of stages of the first, and by how many each has more than the one before.
        const STAGES: (usize, usize);
        /// One of them.
        ///
        /// # Errors
        /// [`Error::OutOfMemory`]
        #[allow(private_interfaces)] // Nobody outside can name the trait.
        fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn Stages<M, T> + Send + Sync>, Error>;
    }
}
use sealed::Family;

impl Family for Radau {
    const LEVELS: usize = 3;
    const STAGES: (usize, usize) = (3, 2);
    #[allow(private_interfaces)]
    fn open<M: Dae, T: Real>(level: usize) -> Result<Box<dyn Stages<M, T> + Send + Sync>, Error> {
        match level {
            0 => RadauIIA::<3>::open(0),
            1 => RadauIIA::<5>::open(0),
            _ => RadauIIA::<7>::open(0),
        }
    }
}

impl AdaptiveMethod for Radau {
    type Integrator<M: Dae, T: Real> = Integrator<M, Self, T>;
}

macro_rules! single {
    ($($stages:literal: $lanes:literal),*) => {
        $(
            impl Family for RadauIIA<$stages> {
                const LEVELS: usize = 1;
                const STAGES: (usize, usize) = ($stages, 0);
                #[allow(private_interfaces)]
                fn open<M: Dae, T: Real>(_: usize) -> Result<Box<dyn Stages<M, T> + Send + Sync>, Error> {
                    Ok(Box::new(stages::Radau::<M, T, $stages, $lanes>::new()?))
                }
            }
            impl AdaptiveMethod for RadauIIA<$stages> {
                type Integrator<M: Dae, T: Real> = Integrator<M, Self, T>;
            }
        )*
    };
}
single!(3: 2, 5: 4, 7: 4);
