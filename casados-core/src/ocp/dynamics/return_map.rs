//! A map after the last interval, from the end of a period to the start of the next.

use crate::function::{ArrayV, ArrayY, Function};
use crate::linalg::dot;
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::cost::TermWriter;
use crate::ocp::formulation::functions::dynamics::{Dynamics, IntervalResult, Nodes, SecondOrder, Sink};
use crate::ocp::formulation::functions::node_evaluation::{check_finite_outputs, write_variables};
use crate::ocp::formulation::names::Names;
use crate::qp::element::set;
use crate::scalar::Real;
use crate::shape::{Outputs, Plain, Shape};
use alloc::{vec, vec::Vec};
use bytemuck::Zeroable;
use core::fmt;

/// Dynamics whose last interval ends with a map of the state: `x_N = g(φ(x_{N−1}, u_{N−1}))`, where
/// `φ` is the dynamics `D` and `g` is a [`Function`] of the states only, with an output for each.
///
/// With [`Ocp::periodic`](crate::ocp::Ocp::periodic) an orbit is periodic up to this map: a
/// rotation of the frame, a phase that grows by `2π` in a period, half a period of a symmetric
/// motion, an impact. States, bounds and costs at the last node are those after the map; dense
/// output inside the last interval is before the map.
///
/// First and second derivatives are exact: `g′ φ′`, and `φ′ᵀ ∇²(πᵀg) φ′` plus the second
/// derivatives of `φ` with the multipliers `g′ᵀπ`, where `π` are the multipliers of the last state.
/// Second derivatives require one more simulation.
///
/// # Example
/// An angle grows by `u` in each of four intervals, by a quarter turn in total.
/// ```
/// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Map, Problem, ReturnMap};
/// use casados::prelude::*;
/// use std::f64::consts::FRAC_PI_2;
///
/// #[function]
/// fn turn(x: f64, u: f64) -> f64 { x + u }
/// #[function]
/// fn back(x: f64, _u: f64) -> f64 { x - core::f64::consts::FRAC_PI_2 }
/// #[function]
/// fn both(x: f64, u: f64) -> [f64; 2] { [u, x - 1.0] }
///
/// let dynamics = ReturnMap::<Back, _>::new(Map::<Turn, f64>::new());
/// let mut ocp = Problem::new(dynamics)
///     .stage_cost(LeastSquaresCost::<Both>::diagonal(&[1.0, 1e-3]))
///     .on(Horizon::uniform(4, 1.0))?;
/// ocp.free_initial_state().periodic("x")?.guess(&[0.0], &[0.0])?;
/// assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
/// let turned: f64 = (0..4).map(|k| ocp.stage(k).unwrap().u[0]).sum();
/// assert!((turned - FRAC_PI_2).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ReturnMap<G: Function, D, T: Plain = f64> {
    dynamics: D,
    end_map: EndMap<G, T>,
}

impl<G: Function, D: fmt::Debug, T: Plain> fmt::Debug for ReturnMap<G, D, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let map = G::STRUCTURE.name;
        f.debug_struct("ReturnMap").field("dynamics", &self.dynamics).field("map", &map).finish()
    }
}

impl<G: Function, D, T: Real> ReturnMap<G, D, T> {
    /// Adds the map to the end of these dynamics. Memory is allocated here and by the first second
    /// derivatives.
    #[must_use]
    pub fn new(dynamics: D) -> Self {
        const {
            let blocks = G::STRUCTURE.blocks;
            assert!(G::Outputs::NY == G::Shape::NX, "a return map has one output for each state");
            assert!(blocks[2] == blocks[5], "a return map depends on the states alone");
        }
        Self { dynamics, end_map: EndMap::new() }
    }

    /// Returns the dynamics without the map.
    pub fn dynamics(&mut self) -> &mut D {
        &mut self.dynamics
    }

    /// Evaluates the dynamics, and applies the map to the end of the last interval, with
    /// derivatives of the map up to the order `derivatives`.
    fn evaluate_with_map(
        &mut self,
        nodes: &Nodes<'_, T>,
        evaluate_dynamics: impl FnOnce(&mut D, &Nodes<'_, T>, Sink<'_, T>) -> Result<(), OcpError>,
        derivatives: usize,
        sink: Sink<'_, T>,
    ) -> Result<(), OcpError> {
        let Self { dynamics, end_map: end } = self;
        let last = nodes.len().wrapping_sub(1);
        let pi = crate::qp::part(nodes.multipliers, last.wrapping_mul(nodes.ld[1]), G::Shape::NX);
        let t = nodes.times.last().copied().unwrap_or(T::ZERO);
        let is_end = nodes.piece.is_none_or(|[_, end]| end == T::ONE);
        let mut outcome = Ok(());
        // Second derivatives of the dynamics require the multipliers `g′ᵀπ` of the last interval.
        let pulled_back_multipliers = core::mem::take(&mut end.pulled_back_multipliers);
        let inner = Nodes {
            multipliers: if derivatives == 2 { &pulled_back_multipliers } else { nodes.multipliers },
            ..*nodes
        };
        let dynamics_result = evaluate_dynamics(dynamics, &inner, &mut |k, step| {
            if k != last || !is_end {
                return sink(k, step);
            }
            end.evaluate(step, t, derivatives, pi);
            match check_finite_outputs::<G, T>(&end.x, k) {
                Ok(()) => sink(k, &end.mapped_result(step, derivatives)),
                error => outcome = error,
            }
        });
        end.pulled_back_multipliers = pulled_back_multipliers;
        dynamics_result.and(outcome)
    }
}

impl<G: Function<Shape = D::Shape>, D: Dynamics<T>, T: Real> Dynamics<T> for ReturnMap<G, D, T> {
    type Shape = D::Shape;
    const NAMES: Names = D::NAMES;
    const INTEGRAL: bool = D::INTEGRAL;
    const IS_FLOW: bool = false;
    const ALGEBRAIC: bool = {
        assert!(!D::LIFTED, "a return map needs shooting: ends of collocated intervals are variables");
        D::ALGEBRAIC
    };

    fn check(&self) -> Result<(), OcpError> {
        self.dynamics.check()
    }
    fn terms(&self, show: TermWriter<'_>) -> fmt::Result {
        self.dynamics.terms(show)
    }
    fn has_pieces(&self) -> bool {
        self.dynamics.has_pieces()
    }
    fn simulate(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.evaluate_with_map(nodes, D::simulate, 0, sink)
    }
    fn linearise(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        self.evaluate_with_map(nodes, D::linearise, 1, sink)
    }
    fn inside(&mut self, nodes: &Nodes<'_, T>, parts: &[T], sink: Sink<'_, T>) -> Result<bool, OcpError> {
        self.dynamics.inside(nodes, parts, sink)
    }
}

impl<G: Function<Shape = D::Shape>, D: SecondOrder<T>, T: Real> SecondOrder<T> for ReturnMap<G, D, T> {
    fn second_order(&mut self, nodes: &Nodes<'_, T>, sink: Sink<'_, T>) -> Result<(), OcpError> {
        if nodes.piece.is_some_and(|[_, end]| end != T::ONE) {
            return self.dynamics.second_order(nodes, sink);
        }
        // The multipliers `g′ᵀπ` depend on the state at the end of the last interval.
        self.evaluate_with_map(nodes, D::simulate, 1, &mut |_, _| {})?;
        self.end_map.pull_back_multipliers(nodes);
        self.evaluate_with_map(nodes, D::second_order, 2, sink)
    }
}

/// The map at the end of the last interval, and the derivatives of the mapped interval.
struct EndMap<G: Function, T: Plain> {
    v: ArrayV<G, T>,
    end_multipliers: ArrayY<G, T>,
    jacobian: G::Jacobian<T>,
    hessian: G::Hessian<T>,
    /// `x_N`
    x: ArrayY<G, T>,
    /// `g′` and `∇²(πᵀg)`, column after column.
    dense_jacobian: Vec<T>,
    dense_hessian: Vec<T>,
    /// The multipliers of all intervals, with `g′ᵀπ` for the last one.
    pulled_back_multipliers: Vec<T>,
    /// The derivatives of `x_N` by `x`, `u`, `p`, and the second derivatives, as in
    /// [`IntervalResult`].
    end_jacobians: [Vec<T>; 3],
    end_hessians: [Vec<T>; 6],
}

impl<G: Function, T: Real> EndMap<G, T> {
    fn new() -> Self {
        let (nx, nu, np) = (G::Shape::NX, G::Shape::NU, G::Shape::NP);
        let zeros = |length: usize| vec![T::ZERO; length];
        let mut jacobian = G::Jacobian::<T>::zeroed();
        G::jacobian_constants::<T>(&mut jacobian);
        Self {
            v: Zeroable::zeroed(),
            end_multipliers: Zeroable::zeroed(),
            jacobian,
            hessian: Zeroable::zeroed(),
            x: Zeroable::zeroed(),
            dense_jacobian: zeros(nx * nx),
            dense_hessian: zeros(nx * nx),
            pulled_back_multipliers: Vec::new(),
            end_jacobians: [nx, nu, np].map(|columns| zeros(nx * columns)),
            end_hessians: [nx * nx, nx * nu, nu * nu, nx * np, nu * np, np * np].map(zeros),
        }
    }

    /// Evaluates the map at the end of an interval, with derivatives up to the order `derivatives`.
    fn evaluate(&mut self, step: &IntervalResult<'_, T>, t: T, derivatives: usize, pi: &[T]) {
        write_variables::<G::Shape, T>(&mut self.v, [step.x, &[], &[], &[]], t);
        if derivatives == 0 {
            return G::value::<T>(&self.v, &mut self.x);
        }
        let nx = G::Shape::NX;
        G::value_jacobian::<T>(&self.v, &mut self.x, &mut self.jacobian);
        for ((row, variable), &value) in G::STRUCTURE.jacobian.iter().zip(self.jacobian.as_ref()) {
            set(&mut self.dense_jacobian, (variable - nx) * nx + row, value);
        }
        self.chain_jacobians(step);
        if derivatives == 1 {
            return;
        }
        crate::qp::copy_common(self.end_multipliers.as_mut(), pi);
        G::hessian::<T>(&self.v, &self.end_multipliers, &mut self.hessian);
        for ((row, column), &value) in G::STRUCTURE.hessian.iter().zip(self.hessian.as_ref()) {
            let (row, column) = (row - nx, column - nx);
            set(&mut self.dense_hessian, column * nx + row, value);
            set(&mut self.dense_hessian, row * nx + column, value);
        }
        self.chain_hessians(step);
    }

    /// Computes `g′ φ′`.
    fn chain_jacobians(&mut self, step: &IntervalResult<'_, T>) {
        let nx = G::Shape::NX.max(1);
        for (slopes, of_step) in self.end_jacobians.iter_mut().zip([step.dx, step.du, step.dp]) {
            for (to, column) in slopes.chunks_exact_mut(nx).zip(of_step.chunks_exact(nx)) {
                to.fill(T::ZERO);
                for (of_state, &by) in self.dense_jacobian.chunks_exact(nx).zip(column) {
                    to.iter_mut().zip(of_state).for_each(|(to, &slope)| *to = *to + slope * by);
                }
            }
        }
    }

    /// Computes the second derivatives of `φ` with the multipliers `g′ᵀπ` plus `φ′ᵀ ∇²(πᵀg) φ′`.
    fn chain_hessians(&mut self, step: &IntervalResult<'_, T>) {
        let nx = G::Shape::NX.max(1);
        let [dx, du, dp] = [step.dx, step.du, step.dp];
        let pairs = [(dx, dx), (dx, du), (du, du), (dx, dp), (du, dp), (dp, dp)];
        let of_step = step.hessian.iter().chain(&step.hessian_p);
        for ((block, (rows, columns)), of_step) in self.end_hessians.iter_mut().zip(pairs).zip(of_step) {
            let height = rows.len() / nx;
            for (j, column) in columns.chunks_exact(nx).enumerate() {
                for (i, row) in rows.chunks_exact(nx).enumerate() {
                    let mut sum = of_step.get(j * height + i).copied().unwrap_or(T::ZERO);
                    for (&factor, of_state) in row.iter().zip(self.dense_hessian.chunks_exact(nx)) {
                        sum = sum + factor * dot(of_state, column);
                    }
                    set(block, j * height + i, sum);
                }
            }
        }
    }

    /// Copies the multipliers of all intervals, with `g′ᵀπ` for the last one.
    fn pull_back_multipliers(&mut self, nodes: &Nodes<'_, T>) {
        let nx = G::Shape::NX.max(1);
        self.pulled_back_multipliers.clear();
        self.pulled_back_multipliers.extend_from_slice(nodes.multipliers);
        let begin = nodes.len().saturating_sub(1) * nodes.ld[1];
        let pi = crate::qp::part(nodes.multipliers, begin, nx);
        for (j, column) in self.dense_jacobian.chunks_exact(nx).enumerate() {
            set(&mut self.pulled_back_multipliers, begin + j, dot(column, pi));
        }
    }

    /// Returns the result of the interval after the map, with derivatives up to the order
    /// `derivatives`.
    fn mapped_result<'a>(
        &'a self,
        step: &IntervalResult<'a, T>,
        derivatives: usize,
    ) -> IntervalResult<'a, T> {
        let slice_if = |there: bool, numbers: &'a Vec<T>| if there { numbers.as_slice() } else { &[] };
        let [dx, du, dp] = self.end_jacobians.each_ref().map(|slopes| slice_if(derivatives > 0, slopes));
        let [xx, xu, uu, xp, up, pp] =
            self.end_hessians.each_ref().map(|block| slice_if(derivatives > 1, block));
        IntervalResult {
            x: self.x.as_ref(),
            dx,
            du,
            dp,
            hessian: [xx, xu, uu],
            hessian_p: [xp, up, pp],
            ..*step
        }
    }
}
