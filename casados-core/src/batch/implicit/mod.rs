//! Implicit methods in batches.

mod group;

use self::group::Group;
use super::intervals::{Interval, vector};
use super::single::{NoGroup, Single, Standard};
use crate::error::Error;
use crate::irk::{Arguments, Integrator};
use crate::memory::{Heap, Shared};
use crate::model::{ArrayK, Dae};
use crate::options::{Newton, Options};
use crate::result::{Forward, ForwardAdjoint, Hessian};
use crate::scalar::{Lanes, Real};
use crate::tableau::{Method, Tableau};

/// Implements `Single` for the integrators of a memory type, with its groups.
macro_rules! single {
    ([$M:ident, $S:ident] $memory:ty { type Group<$E:ident> = $group:ty; const SUPPORTS_GROUPS = $together:expr; }) => {
        impl<$M: Dae, B, const $S: usize, T: Real> Single for Integrator<M, B, S, T, $memory> {
            type Method = B;
            type Tableau = Tableau<S>;
            type Stages = ArrayK<M, [T; S]>;
            type Group<$E: Lanes<Cell: AsRef<[T]> + AsMut<[T]>>> = $group;

            const IS_ITERATIVE: bool = true;
            const SUPPORTS_GROUPS: bool = $together;

            fn of(options: &Options, tableau: &Tableau<S>) -> Result<Self, Error> {
                Self::build(*options, *tableau)
            }

            /// The factors of Newton's method, shared or stage-wise, and the right-hand sides.
            fn working_set<E: Lanes>(options: &Options, columns: usize) -> usize {
                let Newton { fixed_iterations, jacobian, .. } = &options.newton;
                let shared = S > 2
                    && fixed_iterations.is_none()
                    && jacobian.is_adaptive()
                    && !M::STRUCTURE.linear_in_state;
                // Derivatives always use one Jacobian per stage.
                let factors = if shared && columns == 0 {
                    size_of::<M::Factors<[E::Demoted; S]>>()
                } else {
                    size_of::<M::Factors<[[E; S]; S]>>()
                };
                factors + size_of::<ArrayK<M, [E; S]>>() * columns.max(1)
            }

            fn give(&mut self, [xdot, z]: [&[T]; 2]) -> Result<(), Error> {
                self.set_start(&vector(xdot), &vector(z))
            }

            fn start(&mut self, stages: Option<&[ArrayK<M, [T; S]>]>, solved: bool) -> Result<(), Error> {
                match stages {
                    Some(stages) if solved => self.set_solution(stages),
                    Some(stages) => self.run.set_stages_of_steps(stages),
                    None => {
                        self.reset();
                        Ok(())
                    }
                }
            }

            fn stages(&mut self, to: &mut [ArrayK<M, [T; S]>]) -> Result<(), Error> {
                self.copy_stages(to)
            }

            fn forward_to(&mut self, at: &Interval<'_, M, T>, to: &mut Forward<M, T>) -> Result<(), Error> {
                Self::forward_to(self, &Arguments { x0: at.x0, u: &vector(at.u), h: at.h }, to)
            }

            fn forward_adjoint_to(
                &mut self,
                at: &Interval<'_, M, T>,
                to: &mut ForwardAdjoint<M, T>,
            ) -> Result<(), Error> {
                let of = Arguments { x0: at.x0, u: &vector(at.u), h: at.h };
                Self::forward_adjoint_to(self, &of, at.lambda, to)
            }

            fn hessian_to(&mut self, at: &Interval<'_, M, T>, to: &mut Hessian<M, T>) -> Result<(), Error> {
                let of = Arguments { x0: at.x0, u: &vector(at.u), h: at.h };
                Self::hessian_to(self, &of, at.lambda, at.nu, None, Some(to))
            }
        }

        impl<$M: Dae, B: Method<$S>, const $S: usize, T: Real> Standard for Integrator<M, B, S, T, $memory> {
            const TABLEAU: Tableau<S> = B::TABLEAU;
        }
    };
}

// Without a plan the whole matrix is pivoted, in a different order in each lane.
single!([M, S] Heap {
    type Group<E> = Group<M, E, S>;
    const SUPPORTS_GROUPS = M::STRUCTURE.elimination.has_plan();
});
// A group would require further kernels per model.
single!([M, S] Shared {
    type Group<E> = NoGroup;
    const SUPPORTS_GROUPS = false;
});
