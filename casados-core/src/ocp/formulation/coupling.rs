//! Couplings of variables of several stages: periodic states, shared controls.
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
    /// Makes a state periodic, `x₀ = x_N`, or all states with this name (`x` denotes `x[0]`,
    /// `x[1]`, …). The initial state must be free. No state is periodic by default. For periodicity
    /// up to a map, `x₀ = g(x_N)`, use the dynamics `ReturnMap`.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    ///
    /// # Example
    /// The steady state of a constant control: `x = ½ x + 1`.
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

    /// Makes a control the same at all stages, `u_k = u₀`, or all controls with this name. For free
    /// parameters of the model use `HeapOcp::free`, for free end times
    /// [`Horizon::free`](crate::ocp::Horizon::free).
    ///
    /// The guess of stage 0 is used. A bound at one stage holds at all stages. Over a horizon of
    /// length one the integral of a shared control is its value: the `running_cost` of `T` is the
    /// duration.
    ///
    /// A shared control is one more right-hand side of the Riccati recursion. This is cheaper than
    /// a state with `Ṫ = 0` at every stage.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    ///
    /// # Example
    /// A line through data: the offset is the first state, the slope a shared control.
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

    /// Rejects periodic states and shared controls for algorithms that do not support them.
    ///
    /// # Errors
    /// [`OcpError::Coupled`]
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn check_uncoupled(&self) -> Result<(), OcpError> {
        if self.qp().is_coupled() { Err(OcpError::Coupled) } else { Ok(()) }
    }
}
