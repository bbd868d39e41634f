//! Controls that are polynomials in every interval, with jumps: the QP against that of a model with
//! coefficients by hand, closed forms, every kind of dynamics, results by name, mistakes.

use crate::Test;
use crate::phases::kkt;
use casados::ocp::{
    Collocation, Constraint, Convexification, Exact, ExactFormulation, Formulation, GeneralCost, HeapIpm,
    HeapOcp, HeapSqp, Horizon, Kind, OcpError, Problem, Shooting, WithIntegral,
};
use casados::prelude::*;

/// A control of degree two and a constant one, a linear one, an integral and a free end time.
///
/// - `t`: s
#[dae(duration = p.duration, degree(u.push = 2), linear = u.lift, integrals(work = u.push * x.speed * z + t))]
mod sledge {
    pub struct State {
        pub place: f64,
        pub speed: f64,
    }
    pub struct Control {
        pub brake: f64,
        /// Push, N.
        pub push: f64,
        pub lift: f64,
    }
    pub struct Data {
        pub mass: f64,
        pub duration: f64,
    }
    pub fn sledge(xdot: &State, x: &State, z: f64, u: &Control, p: &Data, t: f64) -> [f64; 3] {
        [
            xdot.place - x.speed,
            p.mass * xdot.speed - u.push * u.push - u.lift + z * u.brake * t,
            z - x.speed * x.speed - 0.1 * u.push * x.place,
        ]
    }
    #[function]
    fn price(x: &State, z: f64, u: &Control, p: &Data) -> f64 {
        x.place * x.place * p.mass + u.brake * u.brake * z + u.lift
    }
    #[function]
    fn limits(x: &State, z: f64, u: &Control, p: &Data, du: &Control) -> [f64; 2] {
        [u.push * x.speed * p.mass + z, du.push * x.place + du.lift * u.push]
    }
    #[function]
    fn end(x: &State, _z: f64, _u: &Control, _p: &Data, q: f64) -> f64 {
        x.place * q
    }
}

/// The same: states `(place, speed, lift, work)`, controls `(brake, c₀, c₁, c₂, rate of the lift)`,
/// parameters `(mass, duration, start, length)`.
#[dae(duration = p[1])]
mod by_hand {
    fn push(u: [f64; 5], p: [f64; 4], tau: f64) -> f64 {
        let theta = (tau - p[2]) / p[3];
        let rest = 1.0 - theta;
        u[1] * rest * rest + 2.0 * u[2] * theta * rest + u[3] * theta * theta
    }
    fn by_hand(xdot: [f64; 4], x: [f64; 4], z: f64, u: [f64; 5], p: [f64; 4], t: f64) -> [f64; 5] {
        let push = push(u, p, t / p[1]);
        [
            xdot[0] - x[1],
            p[0] * xdot[1] - push * push - x[2] + z * u[0] * t,
            z - x[1] * x[1] - 0.1 * push * x[0],
            xdot[2] - u[4],
            xdot[3] - push * x[1] * z - t,
        ]
    }
    #[function]
    fn price_by_hand(x: [f64; 4], z: f64, u: [f64; 5], p: [f64; 4]) -> f64 {
        x[0] * x[0] * p[0] + u[0] * u[0] * z + x[2]
    }
    /// In a function without a duration `t` is the time of the integrator.
    #[function]
    fn limits_by_hand(x: [f64; 4], z: f64, u: [f64; 5], p: [f64; 4], t: f64) -> [f64; 2] {
        let theta = (t - p[2]) / p[3];
        let rate = 2.0 * ((u[2] - u[1]) * (1.0 - theta) + (u[3] - u[2]) * theta) / (p[3] * p[1]);
        [push(u, p, t) * x[1] * p[0] + z, rate * x[0] + u[4] * push(u, p, t)]
    }
    #[function]
    fn end_by_hand(x: [f64; 4], _z: f64, _u: [f64; 5], _p: [f64; 4]) -> f64 {
        x[0] * x[3]
    }
}

/// All derivatives of the QP, and the constants of its rows.
fn numbers<P: Formulation<f64>>(ocp: &HeapOcp<P>) -> Vec<Vec<f64>> {
    let of = |stage: casados::qp::Stage<'_, f64>| {
        let n = stage.dims().nx + stage.dims().nu;
        let rows = stage.offset().len() + stage.dims().ng;
        let hessian = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let mut list: Vec<f64> = hessian.map(|(i, j)| kkt::hessian(&stage, i, j)).collect();
        list.extend(
            (0..rows).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| kkt::jacobian(&stage, i, j)),
        );
        list.extend(stage.gradient_x().iter().chain(stage.gradient_u()).chain(stage.offset()));
        list.extend(stage.g_bounds().lower.iter().chain(stage.g_bounds().upper));
        list
    };
    ocp.qp().stages().map(of).collect()
}

/// At any point with any multipliers, with constraints at points inside. The end time is fixed: a
/// function by hand that depends on the time has no derivative by it.
#[test]
fn quadratic_programs_by_coefficients() -> Test {
    const NODES: [f64; 4] = [0.0, 0.2, 0.7, 1.0];
    let irk = Options { steps: 2, ..Options::default() };
    let mut ocp = Problem::new(Irk::<Sledge, Gauss<2>>::new(irk)?)
        .stage_cost(GeneralCost::<Price>::new())
        .path_constraints(Constraint::<Limits>::new([-1.0; 2], [2.0; 2]))
        .terminal_cost(GeneralCost::<End>::new())
        .on(Horizon::nodes(&NODES))?;
    let mut other = Problem::new(Irk::<ByHand, Gauss<2>>::new(irk)?)
        .stage_cost(GeneralCost::<PriceByHand>::new())
        .path_constraints(Constraint::<LimitsByHand>::new([-1.0; 2], [2.0; 2]))
        .terminal_cost(GeneralCost::<EndByHand>::new())
        .on(Horizon::nodes(&NODES))?;
    ocp.inside(&[0.4])?.free_initial_state().set_parameters(.., &[1.2, 1.5])?;
    ocp.free("p.mass", 0.1..=9.0, 1.2)?.guess(&[0.5, 0.7], &[0.3, -0.4, 0.1])?;
    assert_eq!(ocp.stage(1)?.u, [0.3, -0.4, -0.4, -0.4, 0.0]);
    other.inside(&[0.4])?.free_initial_state();
    for k in 0..3 {
        other.set_parameters(k..=k, &[1.2, 1.5, NODES[k], NODES[k + 1] - NODES[k]])?;
    }
    other.set_parameters(3.., &[1.2, 1.5, NODES[2], NODES[3] - NODES[2]])?.free("p[0]", 0.1..=9.0, 1.2)?;
    let number = |k: usize, i: usize| (1.7 * k as f64 + 0.9 * i as f64 + 0.2).sin();
    for k in 0..=3 {
        for iterate in [ocp.iterate_mut(), other.iterate_mut()] {
            let stage = iterate.stage_mut(k).ok_or("no stage")?;
            stage.x.iter_mut().enumerate().for_each(|(i, x)| *x = number(k, i));
            stage.u.iter_mut().enumerate().skip(1).for_each(|(i, u)| *u = number(k + 7, i));
            stage.dynamics.iter_mut().enumerate().for_each(|(i, pi)| *pi = number(k + 9, i));
            stage.g_upper.iter_mut().enumerate().for_each(|(i, mu)| *mu = number(k + 5, i).abs());
        }
    }
    let none = Exact { convexification: Convexification::None };
    ocp.linearise(none)?;
    other.linearise(none)?;
    for (k, (one, two)) in numbers(&ocp).iter().zip(&numbers(&other)).enumerate() {
        assert_eq!(one.len(), two.len());
        for (i, (a, b)) in one.iter().zip(two).enumerate() {
            // Polynomials in another form: Newton's method stops at 1e-12 of the stages.
            assert!(a == b || (a - b).abs() < 1e-10 * (1.0 + b.abs()), "stage {k}, {i}: {a} {b}");
        }
    }
    Ok(())
}

/// From rest to rest over a metre in a second: `u = 6 − 12 t`, `∫ u² = 12`.
#[ode(degree(u = 1), integrals(effort = u * u))]
mod cart {
    pub fn cart(x: [f64; 2], u: f64) -> [f64; 2] {
        [x[1], u]
    }
    #[function]
    fn all_effort(_x: [f64; 2], _u: f64, q: f64) -> f64 {
        q
    }
    #[function]
    fn effort_now(_x: [f64; 2], u: f64) -> f64 {
        u * u
    }
}

fn travel<P: ExactFormulation<f64>>(
    mut ocp: HeapOcp<P>,
    by_sqp: bool,
) -> Result<(), Box<dyn std::error::Error>> {
    let n = ocp.intervals();
    ocp.fix_initial_state(&[0.0; 2])?.guess(&[0.5, 0.0], &[0.0])?;
    ocp.bound("x[0]", n.., 1.0, 1.0)?.bound("x[1]", n.., 0.0, 0.0)?;
    let outcome =
        if by_sqp { HeapSqp::new(&ocp)?.solve(&mut ocp)? } else { HeapIpm::new(&ocp)?.solve(&mut ocp)? };
    assert!(outcome.is_converged(), "{outcome}");
    assert!((outcome.objective - 12.0).abs() < 1e-6, "{outcome}");
    let solution = ocp.solution()?;
    for k in 0..n {
        let [start, end] = [k, k + 1].map(|k| 6.0 - 12.0 * k as f64 / n as f64);
        assert!((solution.coefficient("u[0]")?[k] - start).abs() < 1e-5);
        assert!((solution.coefficient("u[1]")?[k] - end).abs() < 1e-5);
    }
    Ok(())
}

#[test]
fn every_kind_of_dynamics() -> Test {
    let (options, horizon) = (Options::default(), Horizon::uniform(4, 0.25));
    let cost = GeneralCost::<AllEffort>::new;
    for by_sqp in [false, true] {
        travel(
            Problem::new(Irk::<Cart, Gauss<3>>::new(options)?).terminal_cost(cost()).on(horizon)?,
            by_sqp,
        )?;
        travel(Problem::new(Erk::<Cart, Rk4>::new(options)?).terminal_cost(cost()).on(horizon)?, by_sqp)?;
        let collocation = Collocation::new(Irk::<Cart, Gauss<3>>::new(options)?)?;
        travel(Problem::new(collocation).terminal_cost(cost()).on(horizon)?, by_sqp)?;
        let batch = Shooting::new(Batch::<Cart, Gauss<3>>::new(options)?);
        travel(Problem::new(batch).terminal_cost(cost()).on(horizon)?, by_sqp)?;
        let integral = Quadrature::<EffortNow>::new();
        let irk = Irk::<Cart, Gauss<3>>::new(options)?;
        travel(Problem::new(WithIntegral::new(irk, integral)).on(horizon)?, by_sqp)?;
    }
    Ok(())
}

/// A control that follows `f` jumps where `f` does: `∫ (u − f)² = 0` with a parabola in each
/// interval, of which the bounds of the second one cut a part.
#[ode(degree(u = 2), integrals(error = (u - saw(t)) * (u - saw(t))))]
mod follower {
    /// `t²` in the first second, then `(t − 1)²`.
    fn saw(t: f64) -> f64 {
        if t < 1.0 { t * t } else { (t - 1.0) * (t - 1.0) }
    }
    pub fn follower(_x: f64, u: f64, t: f64) -> f64 {
        u + 0.0 * t
    }
    #[function]
    fn all_error(_x: f64, _u: f64, q: f64) -> f64 {
        q
    }
}

#[test]
fn jumps_and_bounds() -> Test {
    let mut ocp = Problem::new(Irk::<Follower, Gauss<4>>::new(Options::default())?)
        .terminal_cost(GeneralCost::<AllError>::new())
        .on(Horizon::uniform(2, 1.0))?;
    ocp.fix_initial_state(&[0.0])?.guess(&[0.0], &[0.3])?;
    assert!(HeapIpm::new(&ocp)?.solve(&mut ocp)?.is_converged());
    let expected = [("u[0]", 0.0), ("u[1]", 0.0), ("u[2]", 1.0)];
    for (name, expected) in expected {
        assert!(
            ocp.solution()?.coefficient(name)?.iter().all(|found| (found - expected).abs() < 1e-5),
            "{name}"
        );
    }
    // At every point it is the parabola; at a node it is the value after the jump.
    let dense = ocp.dense_solution(3)?;
    for (time, found) in dense.times().iter().zip(dense.control("u")?) {
        let expected = if *time < 1.0 { time * time } else { (time - 1.0).powi(2) };
        assert!((found - expected).abs() < 1e-5, "{time}: {found}");
    }
    // Bounds of coefficients bound the control everywhere.
    ocp.bound("u", 1.., 0.1, 0.6)?.bound("u[2]", 1.., 0.1, 0.5)?;
    let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    let solution = ocp.solution()?;
    let coefficients = ["u[0]", "u[1]", "u[2]"]
        .map(|name| solution.coefficient(name).map(|values| values[1]).unwrap_or(f64::NAN));
    // The projection of `θ²` on Bernstein polynomials within bounds, by its KKT conditions. With
    // c₂ = ½ and c₀ = 0.1 both active, ∂/∂c₁ = 0: c₁ = (∫ θ² B₁ − c₀ ∫ B₀ B₁ − c₂ ∫ B₁ B₂) / ∫ B₁².
    let c1 = (2.0 * (1.0 / 4.0 - 1.0 / 5.0) - 0.1 / 10.0 - 0.5 / 10.0) / (2.0 / 15.0);
    for (found, expected) in coefficients.into_iter().zip([0.1, c1, 0.5]) {
        assert!((found - expected).abs() < 1e-6, "{coefficients:?} {c1}");
    }
    Ok(())
}

/// The least time over four metres with a jerk of at most 16 m/s³ of a control of degree two, whose
/// rate is a function: quarters of `+ − − +`, `T³ = 32 s / j`.
#[ode(duration = p, degree(u = 2))]
mod train {
    fn train(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
        [x[1], u]
    }
    #[function]
    fn time(_x: [f64; 2], _u: f64, p: f64) -> f64 {
        p
    }
    #[function]
    fn jerk(_x: [f64; 2], _u: f64, _p: f64, du: f64) -> f64 {
        du
    }
}

#[test]
fn rates_with_a_free_end() -> Test {
    let mut ocp = Problem::new(Erk::<Train, Rk4>::new(Options::default())?)
        .terminal_cost(GeneralCost::<Time>::new())
        .path_constraints(Constraint::<Jerk>::new([-16.0], [16.0]))
        .on(Horizon::free(1, 0.1..=20.0, 3.0))?;
    // One parabola: `u = a (T − 2 t)` has the jerk −2 a and covers a T³/6, and c₁ = (c₀ + c₂)/2.
    ocp.inside(&[0.5, 0.999_999])?.fix_initial_state(&[0.0; 2])?.guess(&[2.0, 1.0], &[0.0])?;
    ocp.bound("x[0]", 1.., 4.0, 4.0)?.bound("x[1]", 1.., 0.0, 0.0)?;
    let outcome = HeapIpm::new(&ocp)?.solve(&mut ocp)?;
    assert!(outcome.is_converged(), "{outcome}");
    let solution = ocp.solution()?;
    // A parabola adds `b (6 τ² − 6 τ + 1)` without an effect on the end: at both ends the rates
    // −2 a ∓ 6 b / T are at least −16, so b = 0 and a = 8.
    let end = 3.0_f64.cbrt();
    assert!((solution.end_time() - end).abs() < 1e-5, "{}", solution.end_time());
    assert!((solution.coefficient("u[0]")?[0] - 8.0 * end).abs() < 1e-3);
    assert!(
        (solution.coefficient("u[1]")?[0]).abs() < 1e-3
            && (solution.constraint("Jerk")?[0] + 16.0).abs() < 1e-5
    );
    Ok(())
}

#[test]
fn names_of_polynomial_controls() -> Test {
    let problem = |intervals: usize| {
        let irk = Irk::<Sledge, Gauss<2>>::new(Options::default())?;
        let mut ocp = Problem::new(irk).on(Horizon::free(intervals, 0.5..=2.0, 1.0))?;
        ocp.set_parameters(.., &[1.0, 0.0])?.fix_initial_state(&[0.0, 1.0])?;
        ocp.guess(&[0.5, 0.7], &[0.3, -0.4, 0.2])?;
        Ok::<_, OcpError>(ocp)
    };
    let mut ocp = problem(2)?;
    ocp.bound("u.push", .., -1.0, 2.0)?.bound("u.push[1]", .., -1.0, 1.5)?;
    let stage = ocp.iterate_mut().stage_mut(0).ok_or("no stage")?;
    stage.u[2..5].copy_from_slice(&[0.0, 1.0, 0.0]);
    let solution = ocp.solution()?;
    let header = "t,x.place,x.speed,z,u.brake,u.push,u.push[0],u.push[1],u.push[2],u.lift,du.lift,work,p.mass,p.duration\n";
    assert!(solution.csv().to_string().starts_with(header), "{}", solution.csv());
    let push = solution.get("u.push[1]")?;
    assert_eq!((push.kind, push.values.len(), push.unit.as_str()), (Kind::Coefficient, 2, "N"));
    assert_eq!((push.lower[1], push.upper[0]), (Some(-1.0), Some(1.5)));
    assert_eq!(solution.control("u.push")?, [0.0, -0.4]);
    let text = ocp.to_string();
    assert!(text.contains("-1 ≤ u.push[1] ≤ 1.5 at stages 0..=1"), "{text}");
    assert!(text.contains("1 linear control u.lift"), "{text}");
    // It becomes the iterate again; on a finer horizon the parts of `2 θ (1 − θ)`.
    let mut other = ocp.clone();
    other.guess(&[0.0; 2], &[0.0; 3])?;
    assert_eq!(other.restore(&solution)?.solution()?, solution);
    let mut fine = problem(4)?;
    fine.guess_from(&solution)?;
    assert_eq!(fine.stage(0)?.u[1..4], [0.0, 0.5, 0.5]);
    assert_eq!(fine.stage(1)?.u[1..4], [0.5, 0.5, 0.0]);
    // Lengths are those of the model as it was written.
    let error = ocp.set_parameters(.., &[1.0; 4]).err().ok_or("four are too many")?;
    assert!(matches!(error, OcpError::Length { expected: 2, found: 4, .. }), "{error}");
    let error = ocp.guess(&[0.0; 2], &[0.0; 5]).err().ok_or("five are too many")?;
    assert!(matches!(error, OcpError::Length { expected: 3, found: 5, .. }), "{error}");
    let error = ocp.free("interval.start", 0.0..=1.0, 0.5).err().ok_or("it is no parameter")?;
    assert!(matches!(error, OcpError::UnknownParameter { .. }), "{error}");
    // A cost at nodes does not depend on the control between them.
    let error = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
        .running_cost(GeneralCost::<EffortNow>::new())
        .on(Horizon::uniform(2, 0.5))
        .err()
        .ok_or("it depends on a polynomial")?;
    let names = ("EffortNow", "u[0]");
    assert!(
        matches!(error, OcpError::CostAtNodes { function, coefficient } if (function, coefficient) == names),
        "{error}"
    );
    Ok(())
}
