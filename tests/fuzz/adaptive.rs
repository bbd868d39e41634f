//! Steps of variable size.

use super::*;
use casados::{__private::Field, Adaptive, DormandPrince5, DormandPrince8, Radau, RadauIIA};
use everything::Everything;
use source::Source;

/// Tolerances that were set, relative or absolute.
type Tolerances<T, const NZ: usize> = Option<(SVector<T, 2>, SVector<T, NZ>)>;

macro_rules! answer {
    ($t:ty, $adaptive:expr, $call:expr, $inputs:expr) => {{
        let (x0, u, lambda, h, middle): &(SVector<$t, 2>, SVector<$t, 1>, SVector<$t, 2>, $t, $t) = $inputs;
        match $call {
            0..3 => $adaptive.solve(x0, u, *h).map(|result| nominal!(result)),
            3 => {
                let mut outputs = Vec::new();
                let result = $adaptive.solve_at(x0, u, *h, &[*middle, *h], |_, dense| {
                    outputs.extend(numbers!(dense; x z));
                });
                result.map(|result| nominal!(result)).map(|all| [all, outputs].concat())
            }
            4 => $adaptive.forward(x0, u, *h).map(|result| forward!(result)),
            5 => $adaptive.adjoint(x0, u, *h, lambda).map(|result| gradient!(result)),
            _ => $adaptive.hessian(x0, u, *h, lambda).map(|result| hessian!(result)),
        }
    }};
}

macro_rules! adaptive {
    ($($name:ident: $model:ty, $method:ty, $nz:literal, $t:ty, $answers:literal;)*) => {$(
        #[test]
        fn $name() {
            let mut counts = Counts::new(stringify!($name));
            for seed in seeds(INTEGRATORS) {
                let mut source = Source::new(seed);
                let options = source.adaptive_options();
                let Ok(mut adaptive) = Adaptive::<$model, $method, $t>::new(options) else { continue };
                let mut given = Given::<$t, $nz>::default();
                let (mut relative, mut absolute): (Tolerances<$t, $nz>, Tolerances<$t, $nz>) = (None, None);
                for call in 0..=CALLS {
                    match if call > 0 { source.below(14) } else { 7 + source.below(8) / 7 } {
                        call @ 0..=6 => {
                            let (h, middle) = (source.length(), source.length());
                            let (h, middle) = (<$t>::from_f64(h), <$t>::from_f64(middle));
                            let inputs = (source.vector(), source.vector(), source.vector(), h, middle);
                            let found = answer!($t, adaptive, call, &inputs);
                            let mut fresh = Adaptive::<$model, $method, $t>::new(options).expect("as before");
                            if let Some(p) = &given.p {
                                fresh.set_parameters(p).expect("as before");
                            }
                            if let Some(t) = given.t {
                                fresh.set_time(t).expect("as before");
                            }
                            if let Some((xdot, z)) = &given.start {
                                fresh.set_start(xdot, z).expect("as before");
                            }
                            if let Some((x, z)) = &relative {
                                fresh.set_relative_tolerances(x, z).expect("as before");
                            }
                            if let Some((x, z)) = &absolute {
                                fresh.set_absolute_tolerances(x, z).expect("as before");
                            }
                            let again = answer!($t, fresh, call, &inputs);
                            judge(&mut counts, seed, &found, Some(again));
                        }
                        7 => {
                            let p = source.vector();
                            if adaptive.set_parameters(&p).is_ok() {
                                given.p = Some(p);
                            }
                        }
                        8 => {
                            let t = <$t>::from_f64(source.length());
                            if adaptive.set_time(t).is_ok() {
                                given.t = Some(t);
                            }
                        }
                        9 => {
                            let start = (source.vector(), source.vector());
                            if adaptive.set_start(&start.0, &start.1).is_ok() {
                                given.start = Some(start);
                            }
                        }
                        10 => {
                            let (x, z) = (source.vector(), source.vector());
                            if adaptive.set_relative_tolerances(&x, &z).is_ok() {
                                relative = Some((x, z));
                            }
                        }
                        11 => {
                            let (x, z) = (source.vector(), source.vector());
                            if adaptive.set_absolute_tolerances(&x, &z).is_ok() {
                                absolute = Some((x, z));
                            }
                        }
                        12 => {
                            if let Ok(result) = adaptive.dense(<$t>::from_f64(source.length())) {
                                assert!(numbers!(result; x z).iter().all(|x| x.is_finite()), "seed {seed}");
                            }
                        }
                        _ => {
                            // And the same interval again, with other numbers.
                            let (x0, u) = (source.vector(), source.vector());
                            let h = <$t>::from_f64(source.length());
                            if adaptive.freeze().is_ok() {
                                let found = adaptive.forward(&x0, &u, h).map(|result| forward!(result));
                                judge(&mut counts, seed, &found, None);
                                adaptive.thaw();
                            }
                        }
                    }
                }
            }
            enough(&counts, $answers);
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
