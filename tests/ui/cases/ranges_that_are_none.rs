use casados::ode;

#[ode(range(x = [0.0..=1.0, 2.0..=1.0], velocity = 0.0..=1.0, p = MASS, t = (0.0, 1.0), u = -1.0..=LIMIT))]
fn model(x: [f64; 2], u: f64, p: f64) -> [f64; 2] {
    [-x[0], -p * x[1] + u]
}

#[ode(nominal(x = 1.0, x = 2.0))]
fn twice(x: f64) -> f64 {
    -x
}

fn main() {}
