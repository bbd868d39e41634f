//! Mechanisms as their constraints are written, with equations of index 3 or 2.

use casados::{Constrained, Dae, Function, dae};

/// A pendulum in Cartesian coordinates: `m q̈ = −λ q − m g e_y`, `|q| = l`.
#[dae(index_reduction)]
pub fn pendulum(xdot: [f64; 4], x: [f64; 4], z: [f64; 1], p: [f64; 2]) -> [f64; 5] {
    let [gravity, length] = p;
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z[0] * x[0],
        xdot[3] + z[0] * x[1] + gravity,
        x[0] * x[0] + x[1] * x[1] - length * length,
    ]
}

/// The same with errors of the constraint that decay.
#[dae(index_reduction(baumgarte = [3.0, 2.0]))]
pub fn damped(xdot: [f64; 4], x: [f64; 4], z: [f64; 1], p: [f64; 2]) -> [f64; 5] {
    let [gravity, length] = p;
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z[0] * x[0],
        xdot[3] + z[0] * x[1] + gravity,
        x[0] * x[0] + x[1] * x[1] - length * length,
    ]
}

/// The same, reduced by hand.
#[dae]
pub fn by_hand(xdot: [f64; 4], x: [f64; 4], z: [f64; 1], p: [f64; 2]) -> [f64; 5] {
    let [gravity, length] = p;
    let error = x[0] * x[0] + x[1] * x[1] - length * length;
    let rate = 2.0 * (x[0] * x[2] + x[1] * x[3]);
    let second = 2.0 * (x[2] * x[2] + x[0] * xdot[2] + x[3] * x[3] + x[1] * xdot[3]);
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + z[0] * x[0],
        xdot[3] + z[0] * x[1] + gravity,
        second + 5.0 * rate + 6.0 * error,
    ]
}

/// The car axis of the Test Set for IVP Solvers, of index 3: states `(q, v)`, multipliers `λ`.
#[dae(index_reduction)]
pub fn car_axis(xdot: [f64; 8], x: [f64; 8], z: [f64; 2], t: f64) -> [f64; 10] {
    let (mass, eps, length, rest) = (10.0, 1e-2, 1.0, 0.5);
    let (amplitude, omega) = (0.1, 10.0);
    let k = mass * eps * eps / 2.0;
    let yb = amplitude * (omega * t).sin();
    let xb = (length * length - yb * yb).sqrt();
    let [xl, yl, xr, yr] = [x[0], x[1], x[2], x[3]];
    let ll = (xl * xl + yl * yl).sqrt();
    let lr = ((xr - xb) * (xr - xb) + (yr - yb) * (yr - yb)).sqrt();
    let [l1, l2] = z;
    [
        xdot[0] - x[4],
        xdot[1] - x[5],
        xdot[2] - x[6],
        xdot[3] - x[7],
        k * xdot[4] - ((rest - ll) * xl / ll + l1 * xb + 2.0 * l2 * (xl - xr)),
        k * xdot[5] - ((rest - ll) * yl / ll + l1 * yb + 2.0 * l2 * (yl - yr) - k),
        k * xdot[6] - ((rest - lr) * (xr - xb) / lr - 2.0 * l2 * (xl - xr)),
        k * xdot[7] - ((rest - lr) * (yr - yb) / lr - 2.0 * l2 * (yl - yr) - k),
        xb * xl + yb * yl,
        (xl - xr) * (xl - xr) + (yl - yr) * (yl - yr) - length * length,
    ]
}

/// A source of voltage on a loop of two capacitors, of index 2: the voltages of the capacitors are
/// states, the current of the source is algebraic.
#[dae(index_reduction)]
pub fn loop_of_capacitors(xdot: [f64; 2], x: [f64; 2], z: [f64; 1], p: [f64; 3], t: f64) -> [f64; 3] {
    let [c1, c2, r] = p;
    // The current of the source through the first one; a resistor beside the second.
    [c1 * xdot[0] - z[0], c2 * xdot[1] + x[1] / r - z[0], x[0] + x[1] - t.sin()]
}

#[test]
fn descriptions_of_reductions() {
    fn description<M: Constrained>(differentiated: &[(u32, u32)]) {
        let reduction = M::STRUCTURE.reduction.expect("the index was reduced");
        assert_eq!(reduction.differentiated, differentiated);
        assert_eq!(
            reduction.invariants(),
            <<M::Invariants as Function>::Outputs as casados::__private::Outputs>::NY
        );
    }
    description::<Pendulum>(&[(4, 2)]);
    description::<Damped>(&[(4, 2)]);
    description::<CarAxis>(&[(8, 2), (9, 2)]);
    description::<LoopOfCapacitors>(&[(2, 1)]);
    assert_eq!(Damped::STRUCTURE.reduction.map(|reduction| reduction.rates), Some(&[3.0, 2.0][..]));
    assert!(ByHand::STRUCTURE.reduction.is_none());
    let text = Damped::describe().to_string();
    assert!(
        text.contains("equation 4 differentiated twice") && text.contains("with the rates 3 2"),
        "{text}"
    );
    let text = Pendulum::describe().to_string();
    assert!(text.contains("no: errors of a constraint grow with time"), "{text}");
}
