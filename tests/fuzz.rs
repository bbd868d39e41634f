//! Anything at all into every public entry of every integrator: an answer that is finite or an
//! error, never a panic, never an endless loop. What comes is drawn from a seed, so that a failure
//! repeats.

#[path = "stress/everything.rs"]
mod everything;

use casados::batch::BatchError;
use casados::error::Error;
use casados::options::{Jacobian, Newton, Start};
use casados::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal, Seeds};
use casados::{
    Adaptive, AdaptiveOptions, Batch, DormandPrince5, DormandPrince8, Erk, Gauss, Intervals, Irk, Options,
    Radau, RadauIIA, Real, Rk4, dae, ode,
};
use everything::Everything;
use nalgebra::SVector;

/// Poles, roots and powers of anything.
#[ode]
fn fragile(x: [f64; 2], u: f64, p: [f64; 2], t: f64) -> [f64; 2] {
    [x[1] / x[0] + u, (p[0] * x[0]).exp() - x[1].sqrt() + (p[1] * t).tan()]
}

/// Linear, and singular where an element of `p` is zero.
#[dae]
fn linear(xdot: [f64; 2], x: [f64; 2], z: f64, u: f64, p: [f64; 2]) -> [f64; 3] {
    [p[1] * xdot[0] - x[1] + z, xdot[1] + x[0] - u, p[0] * z - x[0]]
}

/// Numbers out of a seed (splitmix64).
struct Source {
    state: u64,
    /// One number in so many is a special one; none if it is zero.
    special: usize,
}

impl Source {
    fn new(seed: u64) -> Self {
        let mut source = Self { state: seed, special: 0 };
        source.special = [0, 2, 10, 40][source.below(4)];
        source
    }
    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn below(&mut self, bound: usize) -> usize {
        (self.bits() % bound as u64) as usize
    }
    /// Between −3 and 3, or anything.
    fn number(&mut self) -> f64 {
        if self.special > 0 && self.below(self.special) == 0 {
            let special = [
                0.0,
                -0.0,
                1.0,
                f64::NAN,
                f64::INFINITY,
                f64::NEG_INFINITY,
                f64::MAX,
                -f64::MAX,
                f64::MIN_POSITIVE,
                5e-324,
                1e-300,
                1e300,
                -1e30,
                1e-30,
                f64::EPSILON,
            ];
            return match self.below(special.len() + 3) {
                any if any < special.len() => special[any],
                _ => f64::from_bits(self.bits()),
            };
        }
        6.0 * ((self.bits() >> 11) as f64 / (1u64 << 53) as f64) - 3.0
    }
    fn vector<T: Real, const N: usize>(&mut self) -> SVector<T, N> {
        SVector::from_fn(|_, _| T::from_f64(self.number()))
    }
    /// The length of an interval: mostly one that can be integrated.
    fn length(&mut self) -> f64 {
        self.number() * [0.01, 0.1, 1.0, 0.0][self.below(4)]
    }
    fn options(&mut self) -> Options {
        Options {
            steps: [1, 1, 2, 3, 0][self.below(5)],
            newton: Newton {
                tolerance: [0.0, 0.0, 1e-6, self.number()][self.below(4)],
                max_iterations: [50, 50, 7, 1, 0][self.below(5)],
                jacobian: [Jacobian::Auto, Jacobian::Simplified, Jacobian::Full, Jacobian::Frozen]
                    [self.below(4)],
                fixed_iterations: [None, None, None, Some(2), Some(self.below(4))][self.below(5)],
            },
            start: [Start::Zero, Start::Given, Start::Warm][self.below(3)],
            compensated: self.below(2) == 0,
        }
    }
    fn adaptive_options(&mut self) -> AdaptiveOptions {
        AdaptiveOptions {
            rtol: [1e-3, 1e-6, 1e-9, self.number()][self.below(4)],
            atol: [1e-3, 1e-6, 1e-12, self.number()][self.below(4)],
            initial_step: [None, None, Some(self.number())][self.below(3)],
            max_step: [f64::INFINITY, self.number()][self.below(2)],
            min_step: [0.0, 0.0, self.number()][self.below(3)],
            max_steps: [60, 20, 1, 0][self.below(4)],
            keep_steps: self.below(3) > 0,
        }
    }
}

/// All elements of these fields are finite.
macro_rules! finite {
    ($seed:expr, $result:expr; $($field:ident)*) => {$(
        assert!($result.$field.iter().all(|value| value.is_finite()), "seed {}: {} is {}", $seed, stringify!($field), $result.$field);
    )*};
}
macro_rules! nominal {
    ($seed:expr, $result:expr) => { finite!($seed, $result; x z z0) };
}
macro_rules! forward {
    ($seed:expr, $result:expr) => {
        nominal!($seed, $result);
        finite!($seed, $result; dx_dx0 dx_du dx_dp dz_dx0 dz_du dz_dp dz0_dx0 dz0_du dz0_dp);
    };
}
macro_rules! gradient {
    ($seed:expr, $result:expr) => {
        nominal!($seed, $result);
        finite!($seed, $result; grad_x0 grad_u grad_p);
    };
}
macro_rules! hessian {
    ($seed:expr, $result:expr) => {
        forward!($seed, $result);
        gradient!($seed, $result);
        finite!($seed, $result; h_xx h_xu h_uu h_xp h_up h_pp);
    };
}

/// An error is as good as an answer.
fn ignore<T>(_: T) {}

/// How many integrators of each kind are made, and how many calls of each.
const INTEGRATORS: u64 = 120;
// Draws are the same in every run: of what they ask for, so much has an answer (the last number of
// each test, somewhat less than what is counted, since rounding differs between machines). Less
// means that something has begun to fail.
const CALLS: usize = 8;

/// Calls that all integrators with equal steps have; how many succeeded.
macro_rules! common {
    ($model:ty, $source:ident, $seed:ident, $integrator:ident, $t:ty, $call:expr, $done:ident) => {{
        let (x0, u, lambda) = ($source.vector::<$t, 2>(), $source.vector::<$t, 1>(), $source.vector::<$t, 2>());
        let h = <$t as casados::Field>::from_f64($source.length());
        match $call {
            0 => ignore($integrator.set_parameters(&$source.vector::<$t, 2>())),
            1 => ignore($integrator.set_time(<$t as casados::Field>::from_f64($source.number()))),
            2 => {
                if let Ok(result) = $integrator.solve(&x0, &u, h) {
                    nominal!($seed, result);
                    $done += 1;
                }
            }
            3 => {
                if let Ok(result) = $integrator.forward(&x0, &u, h) {
                    forward!($seed, result);
                    $done += 1;
                }
            }
            4 => {
                if let Ok(result) = $integrator.forward_adjoint(&x0, &u, h, &lambda) {
                    forward!($seed, result);
                    gradient!($seed, result);
                    $done += 1;
                }
            }
            5 => {
                if let Ok(result) = $integrator.adjoint(&x0, &u, h, &lambda) {
                    gradient!($seed, result);
                    $done += 1;
                }
            }
            6 => {
                let lambdas = nalgebra::SMatrix::<$t, 2, 2>::from_columns(&[lambda, x0]);
                if let Ok(result) = $integrator.adjoint_many::<2>(&x0, &u, h, &lambdas) {
                    gradient!($seed, result);
                    $done += 1;
                }
            }
            7 => {
                let mut seeds = Seeds::<$model, $t, 2>::default();
                seeds.x0[(0, 0)] = lambda[0];
                seeds.x0[(1, 1)] = lambda[1];
                seeds.u[(0, 1)] = u[0];
                seeds.p[(1, 0)] = <$t as casados::Field>::from_f64($source.number());
                if let Ok(result) = $integrator.directional::<2>(&x0, &u, h, &seeds) {
                    finite!($seed, result; x z z0 dx dz dz0);
                    $done += 1;
                }
            }
            _ => {
                if let Ok(result) = $integrator.hessian(&x0, &u, h, &lambda) {
                    hessian!($seed, result);
                    $done += 1;
                }
            }
        }
    }};
}

macro_rules! implicit {
    ($($name:ident: $model:ty, $method:ty, $nz:literal, $t:ty, $answers:literal;)*) => {$(
        #[test]
        fn $name() {
            let mut done = 0;
            for seed in 0..INTEGRATORS {
                let mut source = Source::new(seed);
                let Ok(mut irk) = Irk::<$model, $method, $t>::new(source.options()) else { continue };
                if source.below(8) > 0 {
                    ignore(irk.set_parameters(&source.vector()));
                }
                for _ in 0..CALLS {
                    match source.below(14) {
                        call @ 0..=8 => common!($model, source, seed, irk, $t, call, done),
                        9 | 10 => ignore(irk.set_start(&source.vector::<$t, 2>(), &source.vector::<$t, $nz>())),
                        11 => irk.reset(),
                        12 => {
                            if let Ok(result) = irk.dense(<$t as casados::Field>::from_f64(source.length())) {
                                finite!(seed, result; x z);
                            }
                        }
                        _ => {
                            if let Ok(result) = irk.dense_forward(<$t as casados::Field>::from_f64(source.length())) {
                                finite!(seed, result; x z dx_dx0 dx_du dx_dp dz_dx0 dz_du dz_dp);
                            }
                        }
                    }
                }
            }
            println!("{done} answers");
            assert!(done >= $answers, "{done}");
        }
    )*};
}
implicit! {
    everything_gauss: Everything, Gauss<3>, 1, f64, 60;
    everything_radau: Everything, RadauIIA<2>, 1, f64, 60;
    everything_single: Everything, Gauss<2>, 1, f32, 60;
    linear_radau: Linear, RadauIIA<3>, 1, f64, 90;
    fragile_radau: Fragile, RadauIIA<4>, 0, f64, 30;
}

macro_rules! explicit {
    ($($name:ident: $method:ty, $t:ty, $answers:literal;)*) => {$(
        #[test]
        fn $name() {
            let mut done = 0;
            for seed in 0..INTEGRATORS {
                let mut source = Source::new(seed);
                let Ok(mut erk) = Erk::<Fragile, $method, $t>::new(source.options()) else { continue };
                if source.below(8) > 0 {
                    ignore(erk.set_parameters(&source.vector()));
                }
                for _ in 0..2 * CALLS {
                    let call = source.below(9);
                    common!(Fragile, source, seed, erk, $t, call, done);
                }
            }
            println!("{done} answers");
            assert!(done >= $answers, "{done}");
        }
    )*};
}
explicit! {
    fragile_explicit: Rk4, f64, 180;
    fragile_explicit_single: DormandPrince8, f32, 150;
}

macro_rules! adaptive {
    ($($name:ident: $model:ty, $method:ty, $nz:literal, $t:ty, $answers:literal;)*) => {$(
        #[test]
        fn $name() {
            let mut done = 0;
            for seed in 0..INTEGRATORS {
                let mut source = Source::new(seed);
                let Ok(mut adaptive) = Adaptive::<$model, $method, $t>::new(source.adaptive_options()) else { continue };
                if source.below(8) > 0 {
                    ignore(adaptive.set_parameters(&source.vector()));
                }
                for _ in 0..CALLS {
                    let (x0, u, lambda) = (source.vector::<$t, 2>(), source.vector::<$t, 1>(), source.vector::<$t, 2>());
                    let end = <$t as casados::Field>::from_f64(source.length());
                    match source.below(13) {
                        0 => ignore(adaptive.set_parameters(&source.vector())),
                        1 => ignore(adaptive.set_time(end)),
                        2 => ignore(adaptive.set_start(&source.vector::<$t, 2>(), &source.vector::<$t, $nz>())),
                        3 => ignore(adaptive.set_relative_tolerances(&source.vector::<$t, 2>(), &source.vector::<$t, $nz>())),
                        4 => ignore(adaptive.set_absolute_tolerances(&source.vector::<$t, 2>(), &source.vector::<$t, $nz>())),
                        5 | 6 => {
                            if let Ok(result) = adaptive.solve(&x0, &u, end) {
                                nominal!(seed, result);
                                done += 1;
                            }
                        }
                        7 => {
                            let times = [<$t as casados::Field>::from_f64(source.length()), end];
                            let result = adaptive.solve_at(&x0, &u, end, &times, |_, dense| {
                                finite!(seed, dense; x z);
                            });
                            if let Ok(result) = result {
                                nominal!(seed, result);
                            }
                        }
                        8 => {
                            if let Ok(result) = adaptive.dense(end) {
                                finite!(seed, result; x z);
                            }
                        }
                        9 => {
                            if let Ok(result) = adaptive.forward(&x0, &u, end) {
                                forward!(seed, result);
                                done += 1;
                            }
                        }
                        10 => {
                            if let Ok(result) = adaptive.adjoint(&x0, &u, end, &lambda) {
                                gradient!(seed, result);
                                done += 1;
                            }
                        }
                        11 => {
                            if let Ok(result) = adaptive.hessian(&x0, &u, end, &lambda) {
                                hessian!(seed, result);
                                done += 1;
                            }
                        }
                        _ => {
                            // And the same interval again, with other numbers.
                            if adaptive.freeze().is_ok() {
                                if let Ok(result) = adaptive.forward(&x0, &u, end) {
                                    forward!(seed, result);
                                }
                                adaptive.thaw();
                            }
                        }
                    }
                }
            }
            println!("{done} answers");
            assert!(done >= $answers, "{done}");
        }
    )*};
}
adaptive! {
    everything_adaptive: Everything, Radau, 1, f64, 30;
    everything_adaptive_single: Everything, RadauIIA<3>, 1, f32, 8;
    linear_adaptive: Linear, RadauIIA<5>, 1, f64, 36;
    fragile_adaptive: Fragile, DormandPrince5, 0, f64, 25;
    fragile_adaptive_single: Fragile, DormandPrince8, 0, f32, 7;
}

/// Batches: an interval that fails takes nobody with it, and those that succeed are finite.
#[test]
fn batches() {
    let mut done = 0;
    for seed in 0..INTEGRATORS {
        let mut source = Source::new(seed);
        let Ok(mut batch) = Batch::<Everything, Gauss<2>>::new(source.options()) else { continue };
        for _ in 0..2 {
            let count = source.below(7);
            let x0: Vec<_> = (0..count).map(|_| source.vector::<f64, 2>()).collect();
            let many = |source: &mut Source| if source.below(8) == 0 { source.below(4) } else { count };
            let u: Vec<_> = (0..many(&mut source)).map(|_| source.vector::<f64, 1>()).collect();
            let p: Vec<_> = (0..many(&mut source)).map(|_| source.vector::<f64, 2>()).collect();
            let h: Vec<_> = (0..many(&mut source)).map(|_| source.length()).collect();
            let t0: Vec<_> = (0..many(&mut source)).map(|_| source.number()).collect();
            let lambda: Vec<_> = (0..many(&mut source)).map(|_| source.vector::<f64, 2>()).collect();
            ignore(batch.set_start(&source.vector::<f64, 2>(), &source.vector::<f64, 1>()));
            let intervals = Intervals { x0: &x0, u: &u, p: &p, h: &h, t0: &t0 };
            macro_rules! call {
                ($check:ident, $result:ident, |$results:ident| $call:expr) => {{
                    let mut $results = vec![$result::<Everything>::default(); count];
                    match $call {
                        Ok(()) => {}
                        Err(BatchError::Intervals { failed, first, error }) => {
                            assert!(
                                (1..=count).contains(&failed)
                                    && format!("{:?}", batch.status(first))
                                        == format!("{:?}", Err::<(), _>(error)),
                                "seed {seed}"
                            );
                        }
                        Err(_) => continue,
                    }
                    for (index, result) in $results.iter().enumerate() {
                        // What failed is no result.
                        if batch.status(index).is_ok() {
                            $check!(seed, result);
                            done += 1;
                        }
                    }
                }};
            }
            match source.below(5) {
                0 => call!(nominal, Nominal, |results| batch.solve(&intervals, &mut results)),
                1 => call!(forward, Forward, |results| batch.forward(&intervals, &mut results)),
                2 => call!(gradient, Adjoint, |results| batch.adjoint(&intervals, &lambda, &mut results)),
                3 => call!(gradient, ForwardAdjoint, |results| batch.forward_adjoint(
                    &intervals,
                    &lambda,
                    &mut results
                )),
                _ if seed % 2 == 0 => {
                    let nu: Vec<_> = (0..many(&mut source)).map(|_| source.vector::<f64, 1>()).collect();
                    call!(hessian, Hessian, |results| batch.hessian_with_z0(
                        &intervals,
                        &lambda,
                        &nu,
                        &mut results
                    ))
                }
                _ => call!(hessian, Hessian, |results| batch.hessian(&intervals, &lambda, &mut results)),
            }
            assert_eq!(batch.status(count), Err(Error::NoResult));
        }
    }
    println!("{done} answers");
    assert!(done >= 90, "{done}");
}
