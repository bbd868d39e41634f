//! Several models and functions in one module, with its structs, constants and helpers.

use casados::ocp::{GaussNewton, HeapSqp, Horizon, LeastSquaresCost, Problem};
use casados::prelude::*;
use nalgebra::{Matrix2, vector};

/// A crane with a load on a rope.
#[dae]
mod crane {
    pub struct State {
        pub cart: f64,
        pub swing: f64,
        pub rates: [f64; 2],
    }

    pub struct Parameters {
        pub rope: f64,
    }

    const GRAVITY: f64 = 9.81;

    fn acceleration(x: &State, u: f64, p: &Parameters) -> [f64; 2] {
        [u, -(GRAVITY * x.swing.sin() + u * x.swing.cos()) / p.rope]
    }

    pub fn crane(xdot: &State, x: &State, u: f64, p: &Parameters) -> [f64; 4] {
        let [a, b] = acceleration(x, u, p);
        [xdot.cart - x.rates[0], xdot.swing - x.rates[1], xdot.rates[0] - a, xdot.rates[1] - b]
    }

    /// Where the load is.
    #[function]
    pub fn load(x: &State, _u: f64, p: &Parameters) -> [f64; 2] {
        [x.cart + p.rope * x.swing.sin(), -p.rope * x.swing.cos()]
    }

    /// Another name, and an attribute by its path.
    #[casados::function(name = Energy)]
    fn energy_of_the_load(x: &State, _u: f64, p: &Parameters) -> f64 {
        let [v, w] = x.rates;
        0.5 * (v * v + p.rope * p.rope * w * w) + p.rope * v * w * x.swing.cos()
            - GRAVITY * p.rope * x.swing.cos()
    }

    /// The same crane, slowed down by a factor that is a state.
    #[casados::ode(name = SlowCrane)]
    fn slow_crane(x: &(State, f64), u: f64, p: &Parameters) -> ([f64; 4], f64) {
        let (state, pace) = x;
        let [a, b] = acceleration(state, u, p);
        ([pace * state.rates[0], pace * state.rates[1], pace * a, pace * b], 0.0)
    }
}

#[test]
fn names_in_a_module() {
    assert_eq!(Crane::STRUCTURE.x, ["x.cart", "x.swing", "x.rates[0]", "x.rates[1]"]);
    assert_eq!(Load::STRUCTURE.x, Crane::STRUCTURE.x);
    assert_eq!(Energy::STRUCTURE.p, ["p.rope"]);
    assert_eq!(SlowCrane::STRUCTURE.x[4], "x.1");
    // v = (ẋ, x, u, p, t)
    let v = [0.0, 0.0, 0.0, 0.0, 0.3, 0.5, -0.2, 0.7, 1.1, 2.0, 0.0];
    let mut y = [0.0; 2];
    Load::value::<f64>(&v, &mut y);
    let state = crane::State { cart: 0.3, swing: 0.5, rates: [-0.2, 0.7] };
    assert_eq!(y, crane::load(&state, 1.1, &crane::Parameters { rope: 2.0 }));
}

/// Half the pace for twice the time.
#[test]
fn several_models_in_one_module() -> Result<(), casados::Error> {
    let options = Options { steps: 40, ..Default::default() };
    let mut irk = Irk::<Crane, Gauss<3>>::new(options)?;
    let mut slow = Erk::<SlowCrane, Rk4>::new(Options { steps: 4000, ..options })?;
    irk.set_parameters(&vector![2.0])?;
    slow.set_parameters(&vector![2.0])?;
    let a = irk.solve(&vector![0.0, 0.4, 0.1, 0.0], &vector![0.5], 1.0)?.x;
    let b = slow.solve(&vector![0.0, 0.4, 0.1, 0.0, 0.5], &vector![0.5], 2.0)?.x;
    assert!((a - b.fixed_rows::<4>(0)).amax() < 1e-10, "{a} {b}");
    Ok(())
}

/// A cost of the module's own fits to its model.
#[test]
fn costs_in_a_module() -> Result<(), Box<dyn std::error::Error>> {
    let mut ocp = Problem::new(Irk::<Crane, Gauss<2>>::new(Options::default())?)
        .running_cost(LeastSquaresCost::<Load>::new(&Matrix2::identity()))
        .on(Horizon::uniform(10, 0.1))?;
    ocp.fix_initial_state(&[0.1, 0.0, 0.0, 0.0])?.bound("u", .., -2.0, 2.0)?;
    ocp.guess(&[0.1, 0.0, 0.0, 0.0], &[0.0])?;
    ocp.set_parameters(.., &[2.0])?;
    ocp.linearise(GaussNewton::default())?;
    assert!(HeapSqp::new(&ocp)?.solve(&mut ocp)?.is_converged());
    Ok(())
}

/// Every model with an attribute of its own.
#[function]
mod outputs {
    const GAIN: f64 = 3.0;

    #[function]
    fn doubled(x: f64, u: f64) -> f64 {
        GAIN * x * u
    }

    #[function(N = [1, 2])]
    fn power<const N: usize>(x: f64, _u: f64) -> f64 {
        (GAIN * x).powi(N as i32)
    }
}

#[test]
fn modules_without_a_main_model() {
    let v = [0.0, 0.5, 2.0, 0.0];
    let mut y = [0.0];
    Doubled::value::<f64>(&v, &mut y);
    assert_eq!(y, [3.0]);
    Power::<2>::value::<f64>(&v, &mut y);
    assert_eq!(y, [2.25]);
}
