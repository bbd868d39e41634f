//! A power-optimal periodic orbit of an aircraft on a tether, by multiple shooting.
#[path = "../models/awe.rs"]
mod awe;
#[path = "../../tests/data/mod.rs"]
mod data;

use awe::Awe;
use casados::ocp::*;
use casados::prelude::*;
use data::Record;

const DEGREE: f64 = core::f64::consts::PI / 180.0;

#[function]
fn limits(x: [f64; 23], z: [f64; 1], _u: [f64; 4]) -> [f64; 9] {
    const SCALE: f64 = 12.499305032751677;
    const LENGTH: f64 = 434.287;
    const SPEED: f64 = 41.23105625617661;
    const D: f64 = 3.14159265358979323846 / 180.0;
    let tension = SCALE * z[0] * LENGTH;
    let wind = 10.0 * ((x[2] * x[2] + 1.0).sqrt() / 100.0).powf(0.15);
    let a = [wind - x[3], -x[4], -x[5]];
    let v = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
    let chord = a[0] * x[9] + a[1] * x[10] + a[2] * x[11];
    let span = a[0] * x[12] + a[1] * x[13] + a[2] * x[14];
    let up = a[0] * x[15] + a[1] * x[16] + a[2] * x[17];
    let distance = (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]).sqrt();
    [
        (1800.0 - tension) / 1800.0,
        (tension - 50.0) / 50.0,
        1.0 - v / 32.0,
        v / 10.0 - 1.0,
        (9.0 * D * chord - up) / SPEED / (9.0 * D),
        (up + 6.0 * D * chord) / SPEED / (6.0 * D),
        (20.0 * D * chord - span) / SPEED / (20.0 * D),
        (span + 20.0 * D * chord) / SPEED / (20.0 * D),
        (x[0] * x[15] + x[1] * x[16] + x[2] * x[17] - (40.0 * D).cos() * distance) / 500.0,
    ]
}

#[function]
fn accumulated(x: [f64; 23], _z: [f64; 1], _u: [f64; 4]) -> f64 {
    x[22]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let guess = std::env::args().nth(1).unwrap_or_else(|| "guess_dc".into());
    let record = Record::load("awe/orbit.json")?;
    let (n, h) = (40, record.number("T")?);
    let options = Options { start: Start::Zero, ..Default::default() };
    let batch = Batch::<Awe, RadauIIA<4>>::new(options)?;
    let problem = Problem::new(Shooting::new(batch))
        .terminal_cost(GeneralCost::<Accumulated>::new())
        .path_constraints(Constraint::<Limits>::new([0.0; 9], [f64::INFINITY; 9]));
    let mut ocp = problem.on(Horizon::uniform(n, h))?;
    ocp.free_initial_state();
    for name in ["x.q", "x.dq", "x.omega", "x.r", "x.delta", "x.kappa"] {
        ocp.periodic(name)?;
    }
    let names = ocp.names();
    println!("{:?}", names.x);
    ocp.bound("x.cost", 0..1, 0.0, 0.0)?;
    ocp.bound(names.x[2], .., 100.0, f64::INFINITY)?;
    ocp.bound("x.omega", .., -50.0 * DEGREE, 50.0 * DEGREE)?;
    for (i, limit) in [20.0, 30.0, 30.0].into_iter().enumerate() {
        ocp.bound(names.x[18 + i], .., -limit * DEGREE, limit * DEGREE)?;
        ocp.bound(names.u[i], .., -2.0, 2.0)?;
    }
    ocp.bound(names.u[3], .., -100.0, 100.0)?;
    ocp.bound(names.x[4], 0..1, 0.0, 0.0)?;
    // The last state is the first one: no bounds there.
    for i in 0..22 { ocp.bound(names.x[i], n..n + 1, f64::NEG_INFINITY, f64::INFINITY)?; }

    let start = record.record(&guess)?;
    let (xs, us) = (start.vectors("x")?, start.vectors("u")?);
    for k in 0..=n {
        let mut x = xs[k % n].clone();
        x.push(0.0);
        ocp.guess_stage(k, &x[..23], if k < n { &us[k] } else { &[] })?;
    }
    let mut ipm = HeapIpm::new(&ocp)?;
    if let Some(mu) = std::env::args().nth(2) { ipm.options.start_mu = mu.parse()?; }
    let t = std::time::Instant::now();
    let o = ipm.solve(&mut ocp)?;
    let t = t.elapsed();
    for r in ipm.log().0 {
        println!("{:3} f {:15.8e} st {:8.1e} dyn {:8.1e} ineq {:8.1e} comp {:8.1e} mu {:7.1e} dw {:7.1e} a {:7.1e} {}{}  {:.2} {:.2} {:.2} ms", r.iteration, r.objective, r.residuals.stationarity, r.residuals.dynamics, r.residuals.inequalities, r.residuals.complementarity, r.barrier, r.regularisation, r.step, if r.corrected {"s"} else {""}, if r.elastic {"e"} else {""}, 1e3*r.times.linearise, 1e3*r.times.qp, 1e3*r.times.search);
    }
    println!("{o}\n{:?} {t:?}; reference {}", o.times, record.number("objective")?);
    Ok(())
}
