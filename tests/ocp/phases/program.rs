//! The QP of the whole, of first and second order, against differences.

use super::kkt::{hessian, jacobian, variables};
use crate::Test;
use casados::ocp::{
    Constraint, Convexification, Exact, GaussNewton, GeneralCost, HeapOcp, Horizon, Jump, Phases, Problem,
};
use casados::prelude::*;

/// Two states, a control, and two parameters of which the duration is free.
#[ode(duration = p.duration)]
mod swing {
    pub struct Design {
        pub duration: f64,
        pub size: f64,
    }
    pub fn swing(x: [f64; 2], u: f64, p: &Design) -> [f64; 2] {
        [x[1], u * x[0] - p.size * x[0].sin()]
    }
    #[function]
    fn swing_price(x: [f64; 2], u: f64, p: &Design) -> f64 {
        x[0] * x[1] * u + u * u * p.size
    }
    #[function]
    fn swing_limit(x: [f64; 2], u: f64, p: &Design) -> f64 {
        x[0] * u + p.size * x[1]
    }
    #[function]
    fn swing_end(x: [f64; 2], _u: f64, p: &Design) -> f64 {
        x[0] * x[1] * p.size * p.duration
    }
    /// Three states of the next phase.
    #[function]
    fn cross(x: [f64; 2], _u: f64, p: &Design) -> [f64; 3] {
        [x[0] * x[0] * p.size, (x[0] * x[1]).sin(), p.size * p.duration + x[1]]
    }
}

/// Three states, two controls, one of them linear in time, an integral, and a free parameter.
#[ode(linear = u[1], integrals(work = u[0] * u[1] * x[2]))]
mod roll {
    pub fn roll(x: [f64; 3], u: [f64; 2], p: f64) -> [f64; 3] {
        [x[1] * p, u[0] + x[2] * u[1], -x[0] * x[1] + p * u[1]]
    }
    #[function]
    fn roll_price(x: [f64; 3], u: [f64; 2], p: f64, q: f64) -> f64 {
        x[0] * u[1] * p + u[0] * u[0] + q * x[2]
    }
    /// Back to two states.
    #[function]
    fn uncross(x: [f64; 3], _u: [f64; 2], p: f64, q: f64) -> [f64; 2] {
        [x[0] * x[1] + p * x[2] * x[2], q * x[1] + p * p]
    }
}

/// A point with multipliers where nothing is zero.
fn random_iterate(ocp: &mut HeapOcp<Phases<'_>>) -> Test {
    for k in 0..ocp.qp().dims().len() {
        let wave = |i: usize| 0.8 + 0.5 * ((3 * k + 5 * i + 1) as f64).sin();
        let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
        let all = [stage.x, stage.u, stage.dynamics, stage.g_upper];
        for (list, values) in all.into_iter().enumerate() {
            values.iter_mut().enumerate().for_each(|(i, value)| *value = wave(7 * list + i));
        }
    }
    Ok(())
}

/// The gradient of the Lagrangian by the variables of a stage, and values of dynamics and
/// constraints, from the first derivatives.
fn lagrangian_gradient_and_values(
    ocp: &mut HeapOcp<Phases<'_>>,
    k: usize,
) -> Result<(Vec<f64>, Vec<f64>), Box<dyn std::error::Error>> {
    ocp.linearise(GaussNewton { convexification: Convexification::None })?;
    let (stage, at) = (ocp.qp().stage(k).ok_or("no stage")?, ocp.iterate().stage(k).ok_or("no stage")?);
    let v = variables(&at);
    let next = stage.offset().len();
    let linear: Vec<f64> = stage.gradient_x().iter().chain(stage.gradient_u()).copied().collect();
    let gradient = (0..v.len())
        .map(|j| {
            let quadratic: f64 = (0..v.len()).map(|i| hessian(&stage, i, j) * v[i]).sum();
            let dynamics: f64 = (0..next).map(|i| jacobian(&stage, i, j) * at.dynamics[i]).sum();
            let rows = at.g_upper.iter().zip(at.g_lower).enumerate();
            let general: f64 = rows.map(|(i, (up, low))| jacobian(&stage, next + i, j) * (up - low)).sum();
            linear[j] + quadratic + dynamics + general
        })
        .collect();
    let row = |row: usize| -> f64 { (0..v.len()).map(|j| jacobian(&stage, row, j) * v[j]).sum() };
    // Upper bounds of constraints are constants less values.
    let dynamics = (0..next).map(|i| row(i) + stage.offset()[i]);
    let general = stage.g_bounds().upper.iter().enumerate().map(|(i, upper)| row(next + i) - upper);
    Ok((gradient, dynamics.chain(general).collect()))
}

#[test]
fn derivatives_by_differences() -> Test {
    let mut first = Problem::new(Irk::<Swing, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<SwingPrice>::new())
        .path_constraints(Constraint::<SwingLimit>::new([-1.0], [1.0]))
        .terminal_cost(GeneralCost::<SwingEnd>::new())
        .on(Horizon::free(2, 0.2..=2.0, 0.7))?;
    first.free_initial_state().set_parameters(.., &[0.0, 1.3])?.guess(&[0.0; 2], &[0.0])?;
    let mut second = Problem::new(Erk::<Roll, Rk4>::new(Options::default())?)
        .running_cost(GeneralCost::<RollPrice>::new())
        .on(Horizon::uniform(2, 0.2))?;
    second.guess(&[0.0; 3], &[0.0; 2])?.free("p", 0.1..=3.0, 0.9)?;
    let mut third = Problem::new(Irk::<Swing, RadauIIA<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<SwingPrice>::new())
        .terminal_constraints(Constraint::<SwingEnd>::new([-1.0], [1.0]))
        .on(Horizon::free(2, 0.2..=2.0, 0.4))?;
    third.guess(&[0.0; 2], &[0.0])?.free("p.size", 0.1..=4.0, 1.1)?;
    let mut ocp = Phases::new(&mut first)
        .then(Jump::<Cross>::new(), &mut second)
        .then(Jump::<Uncross>::new(), &mut third)
        .join()?;
    random_iterate(&mut ocp)?;
    let dims = ocp.qp().dims().to_vec();
    assert_eq!(dims.iter().map(|stage| stage.nx).collect::<Vec<_>>(), [0, 3, 3, 3, 6, 6, 6, 4, 4, 4]);
    assert_eq!(dims.iter().map(|stage| stage.nu).collect::<Vec<_>>(), [3, 1, 1, 2, 2, 2, 2, 1, 1, 0]);

    // What links make of the ends, in this program once more.
    let values = |ocp: &mut HeapOcp<Phases<'_>>, k: usize| {
        Ok::<_, Box<dyn std::error::Error>>(lagrangian_gradient_and_values(ocp, k)?.1)
    };
    let at = variables(&ocp.iterate().stage(3).ok_or("no stage")?);
    let [x0, x1, duration, linear, p] = at[..] else { return Err("five".into()) };
    let expected = [x0 * x0 * 1.3, (x0 * x1).sin(), 1.3 * duration + x1, linear, 0.0, p];
    let found = values(&mut ocp, 3)?;
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13), "{found:?} {expected:?}");
    let at = variables(&ocp.iterate().stage(6).ok_or("no stage")?);
    let [x0, x1, x2, _, q, p, duration, size] = at[..] else { return Err("eight".into()) };
    let expected = [x0 * x1 + p * x2 * x2, q * x1 + p * p, duration, size];
    let found = values(&mut ocp, 6)?;
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13), "{found:?} {expected:?}");

    // Central differences of order eight, as in the tests of one horizon, whose bound this is.
    let (step, weights) = (5e-3, [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0]);
    for (k, dims) in dims.iter().enumerate() {
        ocp.linearise(Exact { convexification: Convexification::None })?;
        let stage = ocp.qp().stage(k).ok_or("no stage")?;
        let size = dims.nx + dims.nu;
        let exact: Vec<f64> = (0..size * size).map(|i| hessian(&stage, i / size, i % size)).collect();
        let rows = stage.offset().len() + dims.ng;
        let slopes: Vec<f64> = (0..rows * size).map(|i| jacobian(&stage, i / size, i % size)).collect();
        for j in 0..size {
            let here = variables(&ocp.iterate().stage(k).ok_or("no stage")?)[j];
            let mut at = |change: f64| {
                let stage = ocp.iterate_mut().stage_mut(k).ok_or("no stage")?;
                *(if j < dims.nx { &mut stage.x[j] } else { &mut stage.u[j - dims.nx] }) = here + change;
                lagrangian_gradient_and_values(&mut ocp, k)
            };
            let (mut second, mut first) = (vec![0.0; size], vec![0.0; rows]);
            for (i, weight) in weights.into_iter().enumerate() {
                let change = (i + 1) as f64 * step;
                let (plus, minus) = (at(change)?, at(-change)?);
                for (sums, (plus, minus)) in
                    [(&mut second, (plus.0, minus.0)), (&mut first, (plus.1, minus.1))]
                {
                    for (sum, (plus, minus)) in sums.iter_mut().zip(plus.into_iter().zip(minus)) {
                        *sum += weight / step * (plus - minus);
                    }
                }
            }
            at(0.0)?;
            for i in 0..size {
                let (difference, exact) = (second[i], exact[i * size + j]);
                assert!((difference - exact).abs() < 1e-10, "{k} {i} {j}: {difference} {exact}");
            }
            for i in 0..rows {
                let (difference, exact) = (first[i], slopes[i * size + j]);
                assert!((difference - exact).abs() < 1e-10, "{k} {i} {j}: {difference} {exact}");
            }
        }
    }
    Ok(())
}
