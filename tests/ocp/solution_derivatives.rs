//! Derivatives of solutions with free parameters, free end times, linear controls and boundary
//! conditions, against differences of problems that are solved again.

use crate::Test;
use casados::ocp::{
    Boundary, Constraint, Convexification, Exact, ExactFormulation, GeneralCost, HeapIpm, HeapOcp, Horizon,
    OcpError, Problem, Sensitivities,
};
use casados::prelude::*;
use casados::qp::HeapSolution;

type Failure = Box<dyn std::error::Error>;

/// Steps of differences of order four: their error is `δ⁴` of a fifth derivative, and rounding
/// `1e-12 / δ` of solutions.
const STEP: f64 = 2e-3;
const TOLERANCE: f64 = 2e-7;

fn solve<P: ExactFormulation<f64>>(ocp: &mut HeapOcp<P>) -> Result<f64, Failure> {
    let mut ipm = HeapIpm::new(ocp)?;
    ipm.options.tolerance = 1e-12;
    ipm.options.final_mu = 1e-13;
    ipm.options.acceptable_tolerance = 1e-10;
    let outcome = ipm.solve(ocp)?;
    assert!(outcome.residuals.largest() < 1e-9, "{outcome}");
    Ok(outcome.objective)
}

/// Value, states, controls and free parameters of the solution, one after the other.
fn numbers<P: ExactFormulation<f64>>(ocp: &mut HeapOcp<P>) -> Result<Vec<f64>, Failure> {
    let value = solve(ocp)?;
    Ok([value]
        .into_iter()
        .chain(ocp.iterate().stages().flat_map(|stage| [stage.x, stage.u].concat()))
        .collect())
}

/// `problem(x₀, p)` at a point, for the elements of `x₀` and the parameters that are given. Free
/// parameters are those of the first elements of a stage's controls.
fn check<P: ExactFormulation<f64>>(
    problem: impl Fn(&[f64], &[f64]) -> Result<HeapOcp<P>, OcpError>,
    (x0, p): (&[f64], &[f64]),
    parameters: &[usize],
) -> Test {
    let mut ocp = problem(x0, p)?;
    numbers(&mut ocp)?;
    let mut result = Sensitivities::new(&ocp)?;
    ocp.differentiate(Exact { convexification: Convexification::None }, &mut result)?;
    let points: Vec<(usize, usize)> =
        ocp.iterate().stages().map(|stage| (stage.x.len(), stage.u.len())).collect();
    let (nx, n) = (points[0].0, points.len() - 1);
    let free = points[n].1;
    let nu = points[0].1 - free;
    let step = |i: usize, times: f64| {
        let (mut x0, mut p) = (x0.to_vec(), p.to_vec());
        match i.checked_sub(x0.len()) {
            None => x0[i] += times * STEP,
            Some(parameter) => p[parameters[parameter]] += times * STEP,
        }
        numbers(&mut problem(&x0, &p)?)
    };
    let mut largest: f64 = 0.0;
    for i in 0..x0.len() + parameters.len() {
        let [far_below, below, above, far_above] =
            [step(i, -2.0)?, step(i, -1.0)?, step(i, 1.0)?, step(i, 2.0)?];
        let slope = |j: usize| (8.0 * (above[j] - below[j]) - (far_above[j] - far_below[j])) / (12.0 * STEP);
        let parameter = i.checked_sub(x0.len()).map(|parameter| parameters[parameter]);
        let found_value = match parameter {
            None => result.factors().value_gradient_x0()[i],
            Some(p) => result.factors().value_gradient_p()[p],
        };
        assert!(
            (found_value - slope(0)).abs() < TOLERANCE * (1.0 + slope(0).abs()),
            "{i}: {found_value} {}",
            slope(0)
        );
        let mut found = vec![found_value];
        for (k, &(states, controls)) in points.iter().enumerate() {
            let (x, u, w) = match parameter {
                None => (
                    &result.dx(k)[i * nx..],
                    result.du(k).get(i * nu..).unwrap_or(&[]),
                    &result.dw()[i * free..],
                ),
                Some(p) => (
                    &result.dx_dp(k)[p * nx..],
                    result.du_dp(k).get(p * nu..).unwrap_or(&[]),
                    &result.dw_dp()[p * free..],
                ),
            };
            found.extend(x.iter().take(states));
            found.extend(w.iter().take(free));
            found.extend(u.iter().take(controls - free));
        }
        for (j, found) in found.iter().enumerate() {
            assert!(
                (found - slope(j)).abs() < TOLERANCE * (1.0 + slope(j).abs()),
                "{i} {j}: {found} {}",
                slope(j)
            );
            largest = largest.max(found.abs());
        }
        // Adjoints of a seed over everything, free parameters included.
        let mut seed = HeapSolution::new(ocp.qp().dims())?;
        let mut expected = 0.0;
        let mut position = 1;
        for k in 0..=n {
            let stage = seed.stage_mut(k).ok_or("a stage")?;
            for seed in stage.x.iter_mut().chain(stage.u) {
                *seed = (1.3 * position as f64).sin();
                expected += *seed * found[position];
                position += 1;
            }
        }
        let adjoint = result.factors().adjoint(&seed)?;
        let product = parameter.map_or_else(|| adjoint.x0[i], |p| adjoint.p[p]);
        assert!((product - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{i}: {product} {expected}");
        // The Hessian of the value has the differences of its gradient as columns.
        let gradient = |times: f64| -> Result<Vec<f64>, Failure> {
            let (mut x0, mut p) = (x0.to_vec(), p.to_vec());
            match i.checked_sub(x0.len()) {
                None => x0[i] += times * STEP,
                Some(parameter) => p[parameters[parameter]] += times * STEP,
            }
            let mut ocp = problem(&x0, &p)?;
            solve(&mut ocp)?;
            let mut result = Sensitivities::new(&ocp)?;
            ocp.differentiate(Exact { convexification: Convexification::None }, &mut result)?;
            let by_p = result.factors().value_gradient_p().to_vec();
            Ok([result.factors().value_gradient_x0(), &by_p].concat())
        };
        let [far_below, below, above, far_above] =
            [gradient(-2.0)?, gradient(-1.0)?, gradient(1.0)?, gradient(2.0)?];
        let np = p.len();
        let given = above.len() - np;
        let hessian = result.factors().value_hessian();
        for j in 0..above.len() {
            let slope = (8.0 * (above[j] - below[j]) - (far_above[j] - far_below[j])) / (12.0 * STEP);
            let found = match (parameter, j.checked_sub(given)) {
                (None, None) => hessian.xx[i * given + j],
                (None, Some(p)) => hessian.xp[p * given + i],
                (Some(p), None) => hessian.xp[p * given + j],
                (Some(p), Some(q)) => hessian.pp[p * np + q],
            };
            assert!(
                (found - slope).abs() < TOLERANCE * (1.0 + slope.abs()),
                "Hessian {i} {j}: {found} {slope}"
            );
        }
    }
    assert!(largest > 0.1, "derivatives of size {largest:e}");
    Ok(())
}

/// A tank with a valve of a size that is found, an algebraic flow, and a price of everything.
#[dae(duration = p.duration)]
mod tank {
    pub struct Design {
        pub size: f64,
        pub density: f64,
        pub duration: f64,
        pub price: f64,
    }
    pub fn tank(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: &Design) -> [f64; 3] {
        [
            xdot[0] - x[1] + 0.1 * z,
            p.density * xdot[1] - u * p.size + 0.2 * x[1] * x[1],
            z * (1.0 + 0.1 * z * z) - x[0] * p.density - 0.3 * p.size * u,
        ]
    }
    #[function]
    fn price(x: [f64; 2], z: f64, u: f64, p: &Design) -> f64 {
        1.0 + p.price * u * u
            + 0.1 * p.size * p.size * p.price
            + 0.05 * z * z * p.density
            + 0.01 * x[1] * x[1]
    }
    #[function]
    fn load(x: [f64; 2], z: f64, u: f64, p: &Design) -> f64 {
        u * p.size + 0.1 * z - 0.2 * x[0] * p.density
    }
    #[function]
    fn end(x: [f64; 2], _z: f64, _u: f64, p: &Design) -> f64 {
        x[0] * p.density - 0.1 * p.size
    }
}

/// A free parameter and a free end time, costs and constraints of algebraic states, with and
/// without an active path constraint.
#[test]
fn free_parameters_and_end_times() -> Test {
    for largest_load in [10.0, 1.2] {
        let problem = |x0: &[f64], p: &[f64]| {
            let mut ocp = Problem::new(Irk::<Tank, Gauss<2>>::new(Options::default())?)
                .running_cost(GeneralCost::<Price>::new())
                .path_constraints(Constraint::<Load>::new([-10.0], [largest_load]))
                .terminal_constraints(Constraint::<End>::new([1.5], [1.5]))
                .on(Horizon::free(6, 0.2..=9.0, 1.5))?;
            ocp.set_parameters(.., p)?.free("p.size", 0.1..=9.0, 1.0)?;
            ocp.fix_initial_state(x0)?.guess(&[0.5, 0.5], &[0.5])?.bound("x[1]", 6.., 0.1, 0.1)?;
            Ok(ocp)
        };
        check(problem, (&[0.3, 0.1], &[1.0, 1.1, 1.0, 0.7]), &[1, 3])?;
    }
    Ok(())
}

/// A cart whose push is linear and whose way back is coupled to its start, with a free friction.
#[ode(linear = u)]
mod cart {
    pub fn cart(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
        [x[1], u - p[0] * x[1] - p[1] * x[0] * x[0]]
    }
    #[function]
    fn effort(x: [f64; 2], u: f64, p: [f64; 2], du: f64) -> f64 {
        u * u + 0.1 * du * du + p[1] * x[1] * x[1] + (p[0] - 1.0) * (p[0] - 1.0)
    }
}

/// The same with a constant push.
#[ode]
fn coast(x: [f64; 2], u: f64, p: [f64; 2]) -> [f64; 2] {
    [x[1], u - p[0] * x[1] - p[1] * x[0] * x[0]]
}
#[function]
fn way(x: [f64; 2], u: f64, p: [f64; 2]) -> f64 {
    u * u + p[1] * x[1] * x[1] + (p[0] - 1.0) * (p[0] - 1.0) + x[0]
}

#[function]
fn there_and_back(x0: [f64; 2], x: [f64; 2], p: [f64; 2]) -> [f64; 2] {
    [x[0] - p[1] * x0[0] - x0[1] * x0[1], x[1] + x0[1] * p[0]]
}

#[test]
fn linear_controls() -> Test {
    let problem = |x0: &[f64], p: &[f64]| {
        let mut ocp = Problem::new(Erk::<Cart, Rk4>::new(Options::default())?)
            .running_cost(GeneralCost::<Effort>::new())
            .on(Horizon::uniform(5, 0.3))?;
        ocp.set_parameters(.., p)?.fix_initial_state(x0)?.guess(&[0.5, 0.0], &[0.0])?;
        ocp.free("p[0]", 0.0..=5.0, 0.5)?.bound("x[0]", 5.., 1.0, 1.0)?.bound("u", .., -9.0, 9.0)?;
        Ok(ocp)
    };
    check(problem, (&[0.2, 0.4], &[0.5, 0.8]), &[1])
}

#[test]
fn boundary_conditions() -> Test {
    let problem = |x0: &[f64], p: &[f64]| {
        let mut ocp = Problem::new(Erk::<Coast, Rk4>::new(Options::default())?)
            .running_cost(GeneralCost::<Way>::new())
            .terminal_constraints(Boundary::<ThereAndBack>::new([0.0; 2], [0.0; 2]))
            .on(Horizon::uniform(5, 0.3))?;
        ocp.set_parameters(.., p)?.fix_initial_state(x0)?.guess(&[0.5, 0.0], &[0.0])?;
        ocp.free("p[0]", 0.0..=5.0, 0.5)?;
        Ok(ocp)
    };
    check(problem, (&[0.2, 0.4], &[0.5, 0.8]), &[1])
}
