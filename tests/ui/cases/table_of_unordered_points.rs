use casados::ode;
use casados::tables::Spline;

#[ode]
fn model(x: f64) -> f64 {
    let lift = Spline::natural([0.0, 2.0, 1.0], [1.0, 2.0, 3.0]);
    -lift.value(x)
}

/// Of which the macro does not see anything.
const DRAG: Spline<3> = Spline::natural([0.0, 1.0, 1.0], [1.0, 2.0, 3.0]);

#[ode]
fn other(x: f64) -> f64 {
    -DRAG.value(x)
}

fn main() {}
