//! Tables in models: bits of the function, derivatives three ways, integrators, batches, a problem
//! of optimal control.

use crate::{same_bits, subarray};
use casados::ocp::{Exact, GeneralCost, HeapSqp, Horizon, Problem};
use casados::prelude::*;
use casados::tables::{Spline, Spline2};
use casados::testing::{Points, check_derivatives};
use nalgebra::vector;

/// Beside the model: the macro does not see its numbers.
const LIFT: Spline<5> = Spline::natural([-1.5, -0.4, 0.3, 1.1, 1.7], [0.2, -0.7, 0.5, 1.9, 0.4]);
static MAPS: [Spline2<3, 4>; 2] = [
    Spline2::natural(
        [-1.0, 0.2, 1.3],
        [-2.0, -0.5, 0.4, 1.5],
        [[1.0, 0.3, 0.2, -0.8], [0.1, 0.9, 0.4, 0.5], [0.7, -0.2, 1.2, 0.6]],
    ),
    Spline2::natural([-1.0, 0.5, 1.0], [-1.0, 0.0, 1.0, 2.0], [[0.0; 4], [0.5, 0.1, 0.3, 0.7], [1.0; 4]]),
];

mod data {
    use casados::tables::Linear;

    pub const DRAG: Linear<3> = Linear::new([-1.0, 0.25, 1.0], [0.5, -0.1, 0.9]);
}

#[dae]
mod seen {
    use casados::tables::{Linear2, Spline, Spline2};

    const SPEEDS: [f64; 4] = [-1.25, -0.5, 0.5, 1.75];
    const TORQUE: Spline<4> = Spline::natural(SPEEDS, [1.0, 2.0, 1.5, -LOSS]);
    const LOSS: f64 = 0.25;
    const GAIN: Spline<3> = Spline::clamped([-1.0, 0.2, 1.0], [0.4, 1.1, -LOSS], [0.0, 2.0 * LOSS]);
    const FREE: Spline<4> = Spline::not_a_knot(SPEEDS, [0.3, -0.8, 0.6, 1.4]);
    static MAP: Spline2<4, 2> =
        Spline2::not_a_knot(SPEEDS, [-1.0, 1.0], [[0.2, 0.5], [0.7, -0.1], [0.4, 0.4], [-0.6, 0.9]]);
    static SURFACE: Spline2<2, 3> =
        Spline2::natural([-0.75, 0.8], [-1.0, 0.1, 1.0], [[0.1, 0.7, 0.2], [1.0, -0.3, 0.4]]);

    fn both(table: &Linear2<2, 2>, x: f64, y: f64) -> f64 {
        let [a, b] = table.gradient(x, y);
        table.value(x, y) + a * b
    }

    pub fn seen(xdot: [f64; 2], x: [f64; 2], u: f64) -> [f64; 2] {
        const FLAT: Linear2<2, 2> = Linear2::new([-1.0, 1.0], [0.0, 0.5], [[0.3, 0.2], [0.9, -0.4]]);
        let torque = TORQUE.value(x[0]) * u;
        [
            xdot[0] - torque - SURFACE.value(x[0], x[1] * u) - GAIN.value(x[1]) * FREE.value(u),
            xdot[1] - both(&FLAT, x[1], torque) + TORQUE.derivative(x[1]) * TORQUE.value(0.3)
                - MAP.value(u, x[0]),
        ]
    }
}

#[ode]
fn outside(x: [f64; 2], u: f64) -> [f64; 2] {
    let [gx, gy] = MAPS[1].gradient(x[0], u);
    [LIFT.value(x[1]) + data::DRAG.value(u), MAPS[0].value(x[0], x[1]) - gx * gy + LIFT.derivative(x[0])]
}

#[test]
fn emitted_values_of_tables() {
    same_bits::<Seen>(|v| seen::seen(subarray(v, 0), subarray(v, 2), v[4]).to_vec());
    same_bits::<Outside>(|v| {
        let rates = outside(subarray(v, 2), v[4]);
        vec![v[0] - rates[0], v[1] - rates[1]]
    });
}

/// Away from the points, where third derivatives jump: differences know nothing of them.
#[test]
fn derivatives_of_tables_by_three_methods() {
    let list = |points: &[[f64; 3]]| -> Vec<_> {
        points.iter().map(|&[x, y, u]| [0.1, -0.2, x, y, u, 0.0]).collect()
    };
    let points =
        list(&[[0.1, 0.6, 0.4], [-0.9, -0.2, -0.7], [1.2, 0.8, 0.9], [-1.9, 1.9, 1.4], [0.7, -1.8, -1.6]]);
    check_derivatives::<Seen>(&Points::given(points.clone())).assert();
    check_derivatives::<Outside>(&Points::given(points)).assert();
}

/// What is known to be linear has no second derivatives.
#[test]
fn hessian_of_linear_tables() {
    #[ode]
    fn line(x: f64) -> f64 {
        const LINE: casados::tables::Linear<2> = casados::tables::Linear::new([0.0, 1.0], [1.0, 3.0]);
        -LINE.value(x)
    }
    assert_eq!(Line::STRUCTURE.hessian.len(), 0);
    assert_eq!(Outside::STRUCTURE.hessian.len(), 5);
}

/// A tank that leaves through a hole, with the flow between two points of its table: a line.
#[dae]
mod tank {
    use casados::tables::Linear;

    const FLOW: Linear<3> = Linear::new([0.0, 1.0, 4.0], [0.0, 0.5, 2.0]);

    pub fn tank(xdot: f64, x: f64, z: f64) -> [f64; 2] {
        [xdot + z, z - FLOW.value(x)]
    }
}

#[test]
fn integrators_of_models_with_tables() -> Result<(), casados::Error> {
    // The slope is one half everywhere.
    let mut irk = Irk::<Tank, Gauss<4>>::new(Options { steps: 4, ..Default::default() })?;
    let end = irk.forward(&vector![3.0], &vector![], 1.0)?;
    let exact = 3.0 * (-0.5_f64).exp();
    assert!((end.x[0] - exact).abs() < 1e-12 && (end.dx_dx0[0] - exact / 3.0).abs() < 1e-12);

    // The second derivatives of these equations jump, as `Seen` has a derivative of a spline.
    let tight = AdaptiveOptions { rtol: 1e-10, atol: 1e-10, ..Default::default() };
    let mut adaptive = Adaptive::<Seen, DormandPrince8>::new(tight)?;
    adaptive.control_sensitivities(true)?;
    let fine = Options { steps: 2000, ..Default::default() };
    let mut fixed = Irk::<Seen, RadauIIA<3>>::new(fine)?;
    let (x0, u) = (vector![-1.0, 0.4], vector![0.3]);
    let (a, b) = (adaptive.forward(&x0, &u, 1.0)?, fixed.forward(&x0, &u, 1.0)?);
    assert!((a.x - b.x).amax() < 1e-8, "{} {}", a.x, b.x);
    assert!((a.dx_dx0 - b.dx_dx0).amax() < 1e-6);
    Ok(())
}

/// A bead on a wire: index reduction differentiates the table twice in time.
#[dae(index_reduction)]
mod bead {
    use casados::tables::Spline;

    pub const WIRE: Spline<4> = Spline::natural([-3.0, -1.0, 1.0, 3.0], [2.0, 0.2, 0.2, 2.0]);

    pub fn bead(xdot: [f64; 4], x: [f64; 4], z: f64) -> [f64; 5] {
        let [position, height, v, w] = x;
        [
            xdot[0] - v,
            xdot[1] - w,
            xdot[2] + z * WIRE.derivative(position),
            xdot[3] + 9.81 - z,
            height - WIRE.value(position),
        ]
    }
}

#[test]
fn index_reduction_of_tables() -> Result<(), casados::Error> {
    let x0 = vector![0.6, bead::WIRE.value(0.6), 0.0, 0.0];
    let mut irk = Irk::<Bead, Gauss<3>>::new(Options { steps: 100, ..Default::default() })?;
    let x = irk.solve(&x0, &vector![], 1.0)?.x;
    assert!(x[0] < 0.0, "it has passed the middle");
    assert!((x[1] - bead::WIRE.value(x[0])).abs() < 1e-10);
    let energy = 0.5 * (x[2] * x[2] + x[3] * x[3]) + 9.81 * (x[1] - x0[1]);
    assert!(energy.abs() < 1e-9, "{energy:e}");
    check_derivatives::<Bead>(&Points::given([[0.1, 0.2, -0.3, 0.4, 0.5, 0.7, 0.3, -0.6, 2.0, 0.0]]))
        .assert();
    Ok(())
}

/// Registers look up lane by lane, inside of the points and outside.
#[test]
fn batches_of_models_with_tables() -> Result<(), Box<dyn std::error::Error>> {
    let options = Options { steps: 2, ..Default::default() };
    let mut batch = Batch::<Seen, Gauss<2>>::new(options)?;
    let mut irk = Irk::<Seen, Gauss<2>>::new(options)?;
    let x0: Vec<_> = (0..21).map(|k| vector![-2.0 + 0.2 * f64::from(k), 1.9 - 0.17 * f64::from(k)]).collect();
    let u: Vec<_> = (0..21).map(|k| vector![0.6 - 0.05 * f64::from(k)]).collect();
    let lambda = vec![vector![1.0, -0.5]; 21];
    let mut results = vec![casados::result::Hessian::default(); 21];
    let intervals = Intervals { x0: &x0, u: &u, h: &[0.1], ..Default::default() };
    batch.hessian(&intervals, &lambda, &mut results)?;
    for (k, found) in results.iter().enumerate() {
        let single = irk.hessian(&x0[k], &u[k], 0.1, &lambda[k])?;
        // Equations with a Newton matrix near the identity.
        assert!((found.x - single.x).amax() < 1e-13, "{k}");
        assert!((found.grad_x0 - single.grad_x0).amax() < 1e-13, "{k}");
        assert!((found.h_xx - single.h_xx).amax() < 1e-12, "{k}");
    }
    Ok(())
}

/// Between its first two points the natural spline through 0, 1, 0 is `(3x − x³)/2`.
#[dae]
mod hat {
    use casados::tables::Spline;

    const HAT: Spline<3> = Spline::natural([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]);

    pub fn hat(xdot: f64, x: f64, u: f64) -> f64 {
        xdot - u + HAT.value(x)
    }
}

#[ode]
fn polynomial(x: f64, u: f64) -> f64 {
    u - (1.5 * x - 0.5 * x * x * x)
}

#[function]
fn effort(x: f64, u: f64) -> f64 {
    const WEIGHT: Spline<3> = Spline::natural([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]);
    (x - 0.7) * (x - 0.7) + 0.1 * u * u - 0.05 * WEIGHT.value(x)
}

#[test]
fn problems_with_tables() -> Result<(), Box<dyn std::error::Error>> {
    fn controls<M: casados::Dae<Shape = casados::Dims<1, 0, 1, 0, 1, 4, 2, 8>>>()
    -> Result<Vec<f64>, Box<dyn std::error::Error>> {
        let mut ocp = Problem::new(Irk::<M, Gauss<2>>::new(Options::default())?)
            .running_cost(GeneralCost::<Effort>::new())
            .on(Horizon::uniform(12, 0.1))?;
        ocp.fix_initial_state(&[0.2])?.bound("u", .., -1.0, 1.0)?.guess(&[0.2], &[0.0])?;
        ocp.linearise(Exact::default())?;
        let outcome = HeapSqp::new(&ocp)?.solve(&mut ocp)?;
        assert!(outcome.is_converged());
        assert!(ocp.iterate().stages().all(|stage| (0.0..1.0).contains(&stage.x[0])));
        Ok(ocp.iterate().stages().flat_map(|stage| stage.u.to_vec()).collect())
    }
    let (by_table, by_formula) = (controls::<Hat>()?, controls::<Polynomial>()?);
    assert!(by_table.iter().any(|&u| u > 0.99) && by_table.iter().any(|&u| u < 0.9));
    for (a, b) in by_table.iter().zip(&by_formula) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
    Ok(())
}
