//! A mechanism with its constraint: a consistent start, and every call with a projection of every
//! step. That this links says that none of them panics.
#![cfg_attr(target_os = "none", no_std, no_main)]

use casados::prelude::*;
use casados::{Consistent, Divided, Integrator, Projected, mode};
use core::hint::black_box;
use firmware::board;
use nalgebra::{Vector1, Vector4, vector};

/// A load on a rope of length `p` below a trolley that `u` accelerates, seen from there.
#[dae(index_reduction(projection))]
fn load(xdot: [f64; 4], x: [f64; 4], u: f64, z: f64, p: f64) -> [f64; 5] {
    [
        xdot[0] - x[2],
        xdot[1] - x[3],
        xdot[2] + u + z * x[0],
        xdot[3] + 9.81 + z * x[1],
        x[0] * x[0] + x[1] * x[1] - p * p,
    ]
}

type Of<Mode> = Divided<Projected<Irk<Load, RadauIIA<2>, f64, Inline<Mode, 1>>>, 3>;

fn of<Mode>(p: &Vector1<f64>) -> Result<Of<Mode>, Error>
where
    Inline<Mode, 1>: casados::memory::Memory,
{
    let mut integrator = Divided::new(Projected::new(
        Irk::<Load, RadauIIA<2>, f64, Inline<Mode, 1>>::inline(black_box(Options::default()))?,
    ));
    integrator.set_parameters(p)?;
    Ok(integrator)
}

/// Whether the rope is as long as it should be.
#[inline(never)]
fn run() -> Result<bool, Error> {
    let (guess, u, h) = black_box((vector![0.3, -2.0, 0.1, 0.2], vector![0.4], 0.3));
    let p = black_box(vector![2.0]);
    let Ok(x0) = Consistent::<Load>::new().solve(&guess, &p, 0.0) else { return Ok(false) };
    let lambda: Vector4<f64> = black_box(vector![1.0, 0.5, -0.3, 0.2]);
    let x = of::<mode::Nominal>(&p)?.solve(&x0, &u, h)?.x;
    let mut second = of::<mode::Hessian>(&p)?;
    second.forward(&x0, &u, h)?;
    second.hessian(&x0, &u, h, &lambda)?;
    of::<mode::Adjoint<1>>(&p)?.adjoint(&x0, &u, h, &lambda)?;
    Ok((x[0] * x[0] + x[1] * x[1] - 4.0).abs() < 1e-14)
}

#[cfg_attr(target_os = "none", cortex_m_rt::entry)]
fn main() -> ! {
    board::exit(matches!(run(), Ok(true)))
}
