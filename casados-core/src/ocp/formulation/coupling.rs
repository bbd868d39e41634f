//! Variables of several stages that are one: periodic orbits, parameters that are found, free end
//! times.
//!
//! ```text
//! x₀[i] = x_N[i]        u_k[j] = u₀[j]
//! ```

use crate::ocp::formulation::error::{OcpError, Text};
use crate::ocp::formulation::functions::dynamics::Dynamics;
use crate::ocp::formulation::instance::Ocp;
use crate::ocp::formulation::problem::Formulation;
use crate::qp::StageDims;
use crate::scalar::Real;
use crate::structure::name_matches;

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// Makes states periodic, `x₀ = x_N`: one, or all that a name means (`x` means `x[0]`, `x[1]`,
    /// …). The initial state is to be free. None is periodic by default. Up to a given map,
    /// `x₀ = g(x_N)`, they are with dynamics that end with it: `ReturnMap`.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    ///
    /// # Example
    /// The state that a constant control holds: `x = ½ x + 1`.
    /// ```
    /// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
    /// use casados::prelude::*;
    ///
    /// #[function]
    /// fn relax(x: f64, u: f64) -> f64 { 0.5 * x + u }
    /// #[function]
    /// fn control(_x: f64, u: f64) -> f64 { u - 1.0 }
    ///
    /// let mut ocp = Problem::new(Map::<Relax, f64>::new())
    ///     .stage_cost(LeastSquaresCost::<Control>::diagonal(&[1.0]))
    ///     .on(Horizon::uniform(5, 1.0))?;
    /// ocp.free_initial_state().periodic("x")?.guess(&[0.0], &[0.0])?;
    /// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// assert!((ocp.stage(0)?.x[0] - 2.0).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn periodic(&mut self, name: &str) -> Result<&mut Self, OcpError> {
        let known = const { &<P::Dynamics as Dynamics<T>>::NAMES };
        let mut found = false;
        for (i, _) in known.x.iter().enumerate().filter(|(_, state)| name_matches(name, state)) {
            found |= self.qp.make_periodic(i);
        }
        if found { Ok(self) } else { Err(OcpError::UnknownName { name: Text::new(name), known }) }
    }

    /// Makes controls the same at all stages, `u_k = u₀`: one, or all that a name means. Parameters
    /// of the model are found by `HeapOcp::free`, end times with
    /// [`Horizon::free`](crate::ocp::Horizon::free).
    ///
    /// Their guess is that of stage 0. A bound at one stage is a bound of all: one at stage 0 is
    /// enough. What is a rate adds up to the value itself over a horizon of length one:
    /// `running_cost` of `T` is the duration.
    ///
    /// A shared control is no state with `Ṫ = 0`, which every stage would carry along, but one
    /// right-hand side more of the recursion.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    ///
    /// # Example
    /// A line through data: where it begins is the first state, its slope a shared control.
    /// ```
    /// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem};
    /// use casados::prelude::*;
    ///
    /// #[function]
    /// fn climb(x: f64, u: f64) -> f64 { x + u }
    /// #[function]
    /// fn height(x: f64, _u: f64) -> f64 { x }
    ///
    /// let mut ocp = Problem::new(Map::<Climb, f64>::new())
    ///     .stage_cost(LeastSquaresCost::<Height>::diagonal(&[1.0]))
    ///     .on(Horizon::uniform(4, 1.0))?;
    /// ocp.free_initial_state().shared("u")?.guess(&[0.0], &[0.0])?;
    /// for (k, data) in [1.0, 3.0, 5.0, 7.0].into_iter().enumerate() {
    ///     ocp.set_reference(k..=k, &[data])?;
    /// }
    /// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    /// let first = ocp.stage(0)?;
    /// assert!((first.x[0] - 1.0).abs() < 1e-6 && (first.u[0] - 2.0).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn shared(&mut self, name: &str) -> Result<&mut Self, OcpError> {
        let known = const { &<P::Dynamics as Dynamics<T>>::NAMES };
        let (mut found, free) = (false, self.free.count());
        for (j, _) in known.u.iter().enumerate().filter(|(_, control)| name_matches(name, control)) {
            found |= self.qp.share(free + j);
        }
        if found { Ok(self) } else { Err(OcpError::UnknownName { name: Text::new(name), known }) }
    }

    /// Refuses periodic states and shared controls where nobody can solve that.
    ///
    /// # Errors
    /// [`OcpError::Coupled`]
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn check_uncoupled(&self) -> Result<(), OcpError> {
        if self.qp().is_coupled() { Err(OcpError::Coupled) } else { Ok(()) }
    }
}
