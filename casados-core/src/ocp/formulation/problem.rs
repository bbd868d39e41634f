//! The functions of a problem.

use crate::ocp::formulation::functions::argument_checks::{HasArgumentsOf, IsConstraint, IsCost};
use crate::ocp::formulation::functions::constraint::Constraints;
use crate::ocp::formulation::functions::cost::Cost;
use crate::ocp::formulation::functions::dynamics::{Dynamics, SecondOrder};
use crate::scalar::Real;
use crate::shape::Shape;

/// Dynamics, costs and constraints. Each call of the builder sets one function; parts that are not
/// set are absent.
///
/// A problem on a horizon is an [`Ocp`](crate::ocp::Ocp).
///
/// ```text
/// min  Σ_k l(x_k, z_k, u_k, p_k, t_k) + e(x_N)        x_{k+1} = φ(x_k, u_k, p_k)        lg ≤ g(x_k, z_k, u_k, p_k, t_k) ≤ ug
/// ```
///
/// ```
/// use casados::ocp::{Constraint, GeneralCost, Horizon, Problem};
/// use casados::prelude::*;
///
/// /// A cart on a rail that is pushed: position m, velocity m/s; acceleration m/s².
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
/// #[function]
/// fn speed(x: [f64; 2], _u: f64) -> f64 { x[1] }
///
/// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?) // φ
///     .running_cost(GeneralCost::<Effort>::new()) // l, times the lengths of intervals
///     .path_constraints(Constraint::<Speed>::new([-1.0], [1.0])) // g
///     .on(Horizon::uniform(20, 0.1))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.bound("x[0]", 20.., 1.0, 1.0)?;
/// println!("{ocp}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Problem<D, L = (), E = (), G = (), H = ()> {
    /// The dynamics of an interval.
    pub dynamics: D,
    /// The cost of every stage but the last.
    pub stage_cost: L,
    /// The cost of the last stage.
    pub terminal_cost: E,
    /// The constraints of every stage but the last.
    pub path: G,
    /// The constraints of the last stage.
    pub terminal: H,
    /// Whether stage costs are multiplied by the lengths of the intervals.
    pub(in crate::ocp) running: bool,
}

impl<D> Problem<D> {
    /// A problem with dynamics, without costs and constraints.
    pub fn new(dynamics: D) -> Self {
        Self { dynamics, stage_cost: (), terminal_cost: (), path: (), terminal: (), running: false }
    }
}

impl<D, L, E, G, H> Problem<D, L, E, G, H> {
    /// Sets the cost of every stage but the last, without a factor.
    pub fn stage_cost<T: Real, C>(self, stage_cost: C) -> Problem<D, C, E, G, H>
    where
        D: Dynamics<T>,
        C: IsCost<Functions: HasArgumentsOf<D, T>>,
    {
        let Self { dynamics, terminal_cost, path, terminal, .. } = self;
        Problem { dynamics, stage_cost, terminal_cost, path, terminal, running: false }
    }
    /// Sets the cost of every stage but the last, times the length of its interval.
    pub fn running_cost<T: Real, C>(self, cost: C) -> Problem<D, C, E, G, H>
    where
        D: Dynamics<T>,
        C: IsCost<Functions: HasArgumentsOf<D, T>>,
    {
        Problem { running: true, ..self.stage_cost(cost) }
    }
    /// Sets the cost of the last stage.
    pub fn terminal_cost<T: Real, C>(self, terminal_cost: C) -> Problem<D, L, C, G, H>
    where
        D: Dynamics<T>,
        C: IsCost<Functions: HasArgumentsOf<D, T>>,
    {
        let Self { dynamics, stage_cost, path, terminal, running, .. } = self;
        Problem { dynamics, stage_cost, terminal_cost, path, terminal, running }
    }
    /// Sets the constraints of every stage but the last.
    pub fn path_constraints<T: Real, C>(self, path: C) -> Problem<D, L, E, C, H>
    where
        D: Dynamics<T>,
        C: IsConstraint<Functions: HasArgumentsOf<D, T>>,
    {
        let Self { dynamics, stage_cost, terminal_cost, terminal, running, .. } = self;
        Problem { dynamics, stage_cost, terminal_cost, path, terminal, running }
    }
    /// Sets the constraints of the last stage.
    pub fn terminal_constraints<T: Real, C>(self, terminal: C) -> Problem<D, L, E, G, C>
    where
        D: Dynamics<T>,
        C: IsConstraint<Functions: HasArgumentsOf<D, T>>,
    {
        let Self { dynamics, stage_cost, terminal_cost, path, running, .. } = self;
        Problem { dynamics, stage_cost, terminal_cost, path, terminal, running }
    }
}

/// The types of a [`Problem`] in one trait.
///
/// Solvers are generic over it, and so are functions that take a problem:
///
/// ```
/// use casados::ocp::{Formulation, HeapOcp, HeapSqp, Horizon, LeastSquaresCost, Map, OcpError, Problem};
/// use casados::prelude::*;
///
/// /// The first control from several states.
/// fn law<P: Formulation<f64>>(ocp: &mut HeapOcp<P>, states: &[f64]) -> Result<Vec<f64>, OcpError> {
///     let mut sqp = HeapSqp::new(ocp)?.gauss_newton();
///     let mut first = |&x: &f64| {
///         sqp.solve(ocp.fix_initial_state(&[x])?)?;
///         Ok(ocp.stage(0)?.u[0])
///     };
///     states.iter().map(&mut first).collect()
/// }
///
/// #[function]
/// fn push(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [x, u] }
///
/// let mut ocp = Problem::new(Map::<Push, f64>::new())
///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0; 2]))
///     .on(Horizon::uniform(10, 0.1))?;
/// ocp.guess(&[0.0], &[0.0])?;
/// let u = law(&mut ocp, &[1.0, 2.0])?;
/// assert!((u[1] - 2.0 * u[0]).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a problem of optimal control with numbers `{T}`",
    note = "costs and constraints are functions with the arguments of the model (unused ones with an underscore), and have its dimensions"
)]
pub trait Formulation<T: Real> {
    /// Dimensions.
    type Shape: Shape;
    /// The dynamics of an interval.
    type Dynamics: Dynamics<T, Shape = Self::Shape>;
    /// The cost of every stage but the last.
    type StageCost: Cost<Self::Shape, T>;
    /// The cost of the last stage.
    type TerminalCost: Cost<Self::Shape, T>;
    /// The constraints of every stage but the last.
    type Path: Constraints<Self::Shape, T>;
    /// The constraints of the last stage.
    type Terminal: Constraints<Self::Shape, T>;

    /// Returns all functions, mutably.
    #[allow(clippy::type_complexity)]
    fn parts(
        &mut self,
    ) -> &mut Problem<Self::Dynamics, Self::StageCost, Self::TerminalCost, Self::Path, Self::Terminal>;

    /// Returns all functions.
    #[allow(clippy::type_complexity)]
    fn parts_ref(
        &self,
    ) -> &Problem<Self::Dynamics, Self::StageCost, Self::TerminalCost, Self::Path, Self::Terminal>;
}

/// A [`Formulation`] whose dynamics have second derivatives, as every solver with exact Hessians
/// requires.
///
/// It abbreviates `Formulation<T, Dynamics: SecondOrder<T>> + Clone`, and is implemented for all
/// types with these bounds.
///
/// ```
/// use casados::ocp::{ExactFormulation, GeneralCost, HeapIpm, HeapOcp, Horizon, OcpError, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// #[function]
/// fn effort(_x: [f64; 2], u: f64) -> f64 { 0.5 * u * u }
///
/// /// From rest to a place in a second.
/// fn travel(place: f64) -> Result<HeapOcp<impl ExactFormulation<f64>>, OcpError> {
///     let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?)
///         .running_cost(GeneralCost::<Effort>::new())
///         .on(Horizon::uniform(10, 0.1))?;
///     ocp.fix_initial_state(&[0.0; 2])?.bound("x[0]", 10.., place, place)?.guess(&[0.0; 2], &[0.0])?;
///     Ok(ocp)
/// }
///
/// let mut ocp = travel(1.0)?;
/// assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// # Ok::<(), OcpError>(())
/// ```
pub trait ExactFormulation<T: Real>: Formulation<T, Dynamics: SecondOrder<T>> + Clone {}

#[diagnostic::do_not_recommend]
impl<T: Real, P: Formulation<T, Dynamics: SecondOrder<T>> + Clone> ExactFormulation<T> for P {}

impl<T: Real, D, L, E, G, H> Formulation<T> for Problem<D, L, E, G, H>
where
    D: Dynamics<T>,
    L: Cost<D::Shape, T>,
    E: Cost<D::Shape, T>,
    G: Constraints<D::Shape, T>,
    H: Constraints<D::Shape, T>,
{
    type Shape = D::Shape;
    type Dynamics = D;
    type StageCost = L;
    type TerminalCost = E;
    type Path = G;
    type Terminal = H;
    fn parts(&mut self) -> &mut Self {
        self
    }
    fn parts_ref(&self) -> &Self {
        self
    }
}
