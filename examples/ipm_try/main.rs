use casados::ocp::*;
use casados::prelude::*;

#[ode]
fn cartpole(x: [f64; 4], u: [f64; 1]) -> [f64; 4] {
    const M: f64 = 1.0; const B: f64 = 0.1; const L: f64 = 0.8; const G: f64 = 9.81;
    let [_, theta, v, w] = x;
    let (s, c) = theta.sin_cos();
    let d = M + B - B * c * c;
    [v, w,
     (-B * L * s * w * w + B * G * c * s + u[0]) / d,
     (-B * L * c * s * w * w + u[0] * c + (M + B) * G * s) / (L * d)]
}
#[function]
fn effort(x: [f64; 4], u: [f64; 1]) -> f64 { 1e-2 * u[0] * u[0] + 1e-3 * (x[0]*x[0] + x[2]*x[2] + x[3]*x[3]) + 1e-2*x[1]*x[1] }
#[function]
fn zero(x: [f64; 4], _u: [f64; 1]) -> f64 { 0.0 * x[0] }

#[ode]
fn car(x: [f64; 5], u: [f64; 2]) -> [f64; 5] {
    let [_, _, psi, v, t] = x;
    [t * v * psi.cos(), t * v * psi.sin(), t * v * u[1], t * u[0], 0.0]
}
#[function]
fn time(x: [f64; 5], _u: [f64; 2]) -> f64 { x[4] }
#[function]
fn disc(x: [f64; 5], _u: [f64; 2]) -> f64 { (x[0]-5.0)*(x[0]-5.0) + (x[1]-0.2)*(x[1]-0.2) }

fn report<P: Formulation<f64>>(ocp: &mut HeapOcp<P>) where P::Dynamics: SecondOrder<f64> {
    let mut ipm = HeapIpm::new(ocp).unwrap();
    match ipm.solve(ocp) {
        Ok(o) => { for r in &ipm.log().0[..] { println!("{:3} f {:13.6e} st {:8.1e} dyn {:8.1e} ineq {:8.1e} comp {:8.1e} mu {:7.1e} dw {:7.1e} a {:7.1e} {}{}", r.iteration, r.objective, r.residuals.stationarity, r.residuals.dynamics, r.residuals.inequalities, r.residuals.complementarity, r.barrier, r.regularisation, r.step, if r.corrected {"s"} else {""}, if r.elastic {"e"} else {""}); } println!("{o}\n{:?}", o.times) }
        Err(e) => println!("error {e}"),
    }
}

fn main() {
    let which = std::env::args().nth(1).unwrap_or_default();
    if which == "car" {
        let erk = Erk::<Car, Rk4>::new(Options { steps: 1, ..Default::default() }).unwrap();
        let problem = Problem::new(erk).terminal_cost(GeneralCost::<Time>::new()).path_constraints(Constraint::<Disc>::new([1.0], [f64::INFINITY]));
        let n = 40;
        let mut ocp = problem.on(Horizon::uniform(n, 1.0 / n as f64)).unwrap();
        ocp.free_initial_state();
        for (i, v) in [0.0, 0.0, 0.0, 1.0].iter().enumerate() { ocp.bound(["x[0]","x[1]","x[2]","x[3]"][i], 0..1, *v, *v).unwrap(); }
        for (i, v) in [10.0, 0.0].iter().enumerate() { ocp.bound(["x[0]","x[1]"][i], n..n+1, *v, *v).unwrap(); }
        ocp.bound("x[4]", .., 0.5, 50.0).unwrap();
        ocp.bound("x[3]", .., 0.0, 5.0).unwrap();
        ocp.bound("x[3]", 0..1, 1.0, 1.0).unwrap();
        ocp.bound("u[0]", .., -2.0, 2.0).unwrap();
        ocp.bound("u[1]", .., -0.5, 0.5).unwrap();
        for k in 0..=n { let s = k as f64 / n as f64; ocp.guess_stage(k, &[10.0*s, 0.0, 0.0, 1.0, 10.0], if k<n {&[0.0,0.0]} else {&[]}).unwrap(); }
        report(&mut ocp);
        return;
    }
    let erk = Erk::<Cartpole, Rk4>::new(Options { steps: 2, ..Default::default() }).unwrap();
    let problem = Problem::new(erk).stage_cost(GeneralCost::<Effort>::new()).terminal_cost(GeneralCost::<Zero>::new());
    let mut ocp = problem.on(Horizon::uniform(40, 0.05)).unwrap();
    ocp.fix_initial_state(&[0.0, std::f64::consts::PI, 0.0, 0.0]).unwrap();
    for i in 0..4 { ocp.bound(["x[0]","x[1]","x[2]","x[3]"][i], 40..41, 0.0, 0.0).unwrap(); }
    ocp.bound("u", .., -20.0, 20.0).unwrap();
    ocp.bound("x[0]", 1..40, -1.5, 1.5).unwrap();
    for k in 0..=40 { let s = 1.0 - k as f64/40.0; ocp.guess_stage(k, &[0.0, s*std::f64::consts::PI, 0.0, 0.0], if k<40 {&[0.0]} else {&[]}).unwrap(); }
    report(&mut ocp);
}
