//! How large the integrator of one model is, how many instructions its calls take, and how much that depends on the
//! numbers. The environment variable `CASE` says which one when this is built: model, stages, number type.
#![cfg_attr(target_os = "none", no_std, no_main)]

use casados::model::{VectorU, VectorX};
use casados::{Error, Gauss, Inline, Irk, mode};
use core::hint::black_box;
use firmware::{Random, board, memory::Static, options, report};

include!(concat!(env!("OUT_DIR"), "/case.rs"));

type Integrator = Irk<Model, Gauss<STAGES>, Number, Inline<mode::Forward>>;
static INTEGRATOR: Static<Integrator> = Static::new();

/// So many calls with different inputs.
const CALLS: usize = 200;

#[cfg_attr(target_os = "none", cortex_m_rt::entry)]
fn main() -> ! {
    board::exit(run().is_ok())
}

fn run() -> Result<(), Error> {
    let Some(integrator) = INTEGRATOR.set(Integrator::inline(options(3))?) else {
        return Err(Error::NoResult);
    };
    let mut random = Random(1);
    let mut ranges = [[u32::MAX, 0]; 2];
    let top = board::paint();
    for call in 0..CALLS {
        let (mut x, mut u) = (VectorX::<Model, Number>::zeros(), VectorU::<Model, Number>::zeros());
        x.iter_mut().for_each(|x| *x = random.number::<Number>() * 0.5);
        u.iter_mut().for_each(|u| *u = random.number::<Number>() * 2.0 + 2.0);
        let (x, u, h) = (black_box(x), black_box(u), black_box(0.02));
        let (solve, result) = board::count(|| integrator.solve(&x, &u, h).map(|_| ()));
        result?;
        let (forward, result) = board::count(|| integrator.forward(&x, &u, h));
        let step = result?;
        if call + 1 == CALLS {
            report::reals("state", step.nominal.x.as_slice());
        }
        for (range, count) in ranges.iter_mut().zip([solve, forward]) {
            *range = [range[0].min(count), range[1].max(count)];
        }
    }
    report::numbers("stack", &[board::used(top)]);
    report::numbers("size", &[Integrator::SIZE as u32]);
    report::numbers("solve", &ranges[0]);
    report::numbers("forward", &ranges[1]);
    Ok(())
}
