//! Integrators with events, of any options, starts and lengths.

use super::source::Source;
use super::*;
use casados::{Adaptive, Crossing, DormandPrince5, Event, Hybrid, Radau, function};

/// A ball that falls and is slowed down; what it is pushed by.
#[ode]
fn ball(x: [f64; 2], u: f64, p: f64) -> [f64; 2] {
    [x[1], u - 9.81 - p * x[1] * x[1].abs()]
}
#[function]
fn height(x: [f64; 2], _u: f64, p: f64) -> f64 {
    x[0] - 0.1 * p
}
#[function]
fn bounce(x: [f64; 2], _u: f64, p: f64) -> [f64; 2] {
    [x[0], -(0.9 - 0.1 * p) * x[1]]
}
#[function]
fn apex(x: [f64; 2], _u: f64, _p: f64) -> f64 {
    x[1]
}
/// Nothing happens, or it is thrown by what has a pole.
#[function]
fn thrown(x: [f64; 2], u: f64, _p: f64) -> [f64; 2] {
    [x[0], x[1] + 0.1 / u]
}

macro_rules! hybrid {
    ($($name:ident: $method:ty, $answers:literal;)*) => {$(
        #[test]
        fn $name() {
            let mut counts = Counts::new(stringify!($name));
            for seed in seeds(INTEGRATORS) {
                let mut source = Source::new(seed);
                let crossing = [Crossing::Falling, Crossing::Rising, Crossing::Any];
                let mut events = vec![Event::jump::<Height, Bounce>(crossing[source.below(3)])];
                if source.below(2) == 0 {
                    events.push(Event::jump::<Apex, Thrown>(crossing[source.below(3)]));
                }
                if source.below(3) == 0 {
                    events.insert(source.below(2), Event::terminal::<Apex>(crossing[source.below(3)]));
                }
                let options = source.adaptive_options();
                let (most, p) = ([20, 3, 0, 1][source.below(4)], source.vector());
                let make = || -> Result<_, Error> {
                    let mut adaptive = Adaptive::<Ball, $method>::new(options)?;
                    adaptive.set_parameters(&p)?;
                    let mut hybrid = Hybrid::new(adaptive, &events)?;
                    hybrid.set_most_events(most);
                    Ok(hybrid)
                };
                let Ok(mut hybrid) = make() else { continue };
                for _ in 0..CALLS {
                    let (x0, u, lambda, h) = (source.vector(), source.vector(), source.vector(), source.length());
                    let call = source.below(5);
                    let answer = |hybrid: &mut Hybrid<Ball, _, f64>| match call {
                        0 | 1 => hybrid.solve(&x0, &u, h).map(|found| nominal!(found.nominal)),
                        2 => hybrid.forward(&x0, &u, h).map(|found| numbers!(found; dx_dx0 dx_du dx_dp)),
                        3 => hybrid.adjoint(&x0, &u, h, &lambda).map(|found| numbers!(found; grad_x0 grad_u grad_p)),
                        _ => hybrid.hessian(&x0, &u, h, &lambda).map(|found| numbers!(found; h_xx h_xu h_uu h_xp h_up h_pp)),
                    };
                    let found = answer(&mut hybrid);
                    let again = make().and_then(|mut fresh| answer(&mut fresh));
                    judge(&mut counts, seed, &found, Some(again));
                }
            }
            enough(&counts, $answers);
        }
    )*};
}
hybrid! {
    events_explicit: DormandPrince5, 60;
    events_radau: Radau, 60;
}
