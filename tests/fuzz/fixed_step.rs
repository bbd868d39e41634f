//! Steps of equal size.

use super::*;
use casados::options::Start;
use casados::result::Seeds;
use casados::{__private::Field, DormandPrince8, Erk, Gauss, Irk, RadauIIA, Rk4};
use everything::Everything;
use source::Source;

/// The inputs of a call.
struct Inputs<T: Real> {
    x0: SVector<T, 2>,
    u: SVector<T, 1>,
    lambda: SVector<T, 2>,
    h: T,
    number: T,
}

impl<T: Real> Inputs<T> {
    fn new(source: &mut Source) -> Self {
        Self {
            x0: source.vector(),
            u: source.vector(),
            lambda: source.vector(),
            h: T::from_f64(source.length()),
            number: T::from_f64(source.number()),
        }
    }
}

/// One of the calls that all integrators with equal steps have.
macro_rules! answer {
    ($model:ty, $t:ty, $integrator:expr, $call:expr, $inputs:expr) => {{
        let Inputs { x0, u, lambda, h, number } = $inputs;
        match $call {
            0 => $integrator.solve(x0, u, *h).map(|result| nominal!(result)),
            1 => $integrator.forward(x0, u, *h).map(|result| forward!(result)),
            2 => $integrator.forward_adjoint(x0, u, *h, lambda).map(|result| {
                let mut all = forward!(result);
                all.extend(gradient!(result));
                all
            }),
            3 => $integrator.adjoint(x0, u, *h, lambda).map(|result| gradient!(result)),
            4 => {
                let lambdas = nalgebra::SMatrix::<$t, 2, 2>::from_columns(&[*lambda, *x0]);
                $integrator.adjoint_many::<2>(x0, u, *h, &lambdas).map(|result| gradient!(result))
            }
            5 => {
                let mut seeds = Seeds::<$model, $t, 2>::default();
                seeds.x0[(0, 0)] = lambda[0];
                seeds.x0[(1, 1)] = lambda[1];
                seeds.u[(0, 1)] = u[0];
                seeds.p[(1, 0)] = *number;
                let result = $integrator.directional::<2>(x0, u, *h, &seeds);
                result.map(|result| numbers!(result; x z z0 dx dz dz0))
            }
            _ => $integrator.hessian(x0, u, *h, lambda).map(|result| hessian!(result)),
        }
    }};
}

/// What all integrators remember.
macro_rules! give {
    ($integrator:expr, $given:expr) => {
        if let Some(p) = &$given.p {
            $integrator.set_parameters(p).expect("as before");
        }
        if let Some(t) = $given.t {
            $integrator.set_time(t).expect("as before");
        }
    };
}

macro_rules! implicit {
    ($($name:ident: $model:ty, $method:ty, $nz:literal, $t:ty, $answers:literal;)*) => {$(
        #[test]
        fn $name() {
            let mut counts = Counts::new(stringify!($name));
            for seed in seeds(INTEGRATORS) {
                let mut source = Source::new(seed);
                let options = source.options();
                let Ok(mut irk) = Irk::<$model, $method, $t>::new(options) else { continue };
                let mut given = Given::<$t, $nz>::default();
                for call in 0..=CALLS {
                    // Parameters come first, mostly.
                    match if call > 0 { source.below(14) } else { 7 + source.below(8) / 7 } {
                        call @ 0..=6 => {
                            let inputs = Inputs::<$t>::new(&mut source);
                            let found = answer!($model, $t, irk, call, &inputs);
                            // A warm start is that of an earlier call.
                            let again = (options.start != Start::Warm).then(|| {
                                let mut irk = Irk::<$model, $method, $t>::new(options).expect("as before");
                                give!(irk, given);
                                if let Some((xdot, z)) = &given.start {
                                    irk.set_start(xdot, z).expect("as before");
                                }
                                answer!($model, $t, irk, call, &inputs)
                            });
                            judge(&mut counts, seed, &found, again);
                        }
                        7 => {
                            let p = source.vector();
                            if irk.set_parameters(&p).is_ok() {
                                given.p = Some(p);
                            }
                        }
                        8 => {
                            let t = <$t>::from_f64(source.number());
                            if irk.set_time(t).is_ok() {
                                given.t = Some(t);
                            }
                        }
                        9 | 10 => {
                            let start = (source.vector(), source.vector());
                            if irk.set_start(&start.0, &start.1).is_ok() {
                                given.start = Some(start);
                            }
                        }
                        11 => irk.reset(),
                        12 => {
                            if let Ok(result) = irk.dense(<$t>::from_f64(source.length())) {
                                assert!(numbers!(result; x z).iter().all(|x| x.is_finite()), "seed {seed}");
                            }
                        }
                        _ => {
                            if let Ok(result) = irk.dense_forward(<$t>::from_f64(source.length())) {
                                let all = numbers!(result; x z dx_dx0 dx_du dx_dp dz_dx0 dz_du dz_dp);
                                assert!(all.iter().all(|x| x.is_finite()), "seed {seed}");
                            }
                        }
                    }
                }
            }
            enough(&counts, $answers);
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
            let mut counts = Counts::new(stringify!($name));
            for seed in seeds(INTEGRATORS) {
                let mut source = Source::new(seed);
                let options = source.options();
                let Ok(mut erk) = Erk::<Fragile, $method, $t>::new(options) else { continue };
                let mut given = Given::<$t, 0>::default();
                for call in 0..=2 * CALLS {
                    match if call > 0 { source.below(9) } else { 7 + source.below(8) / 7 } {
                        call @ 0..=6 => {
                            let inputs = Inputs::<$t>::new(&mut source);
                            let found = answer!(Fragile, $t, erk, call, &inputs);
                            let mut fresh = Erk::<Fragile, $method, $t>::new(options).expect("as before");
                            give!(fresh, given);
                            let again = answer!(Fragile, $t, fresh, call, &inputs);
                            judge(&mut counts, seed, &found, Some(again));
                        }
                        7 => {
                            let p = source.vector();
                            if erk.set_parameters(&p).is_ok() {
                                given.p = Some(p);
                            }
                        }
                        _ => {
                            let t = <$t>::from_f64(source.number());
                            if erk.set_time(t).is_ok() {
                                given.t = Some(t);
                            }
                        }
                    }
                }
            }
            enough(&counts, $answers);
        }
    )*};
}
explicit! {
    fragile_explicit: Rk4, f64, 180;
    fragile_explicit_single: DormandPrince8, f32, 150;
}
