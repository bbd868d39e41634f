//! Batches: an interval that fails takes nobody with it, and those that succeed are finite.

use super::*;
use casados::BatchError;
use casados::options::Start;
use casados::result::{Adjoint, Forward, ForwardAdjoint, Hessian, Nominal};
use casados::{Batch, Gauss, Intervals};
use everything::Everything;
use source::Source;

type Made = Batch<Everything, Gauss<2>>;

/// The data of some intervals, and of a call.
struct Inputs {
    count: usize,
    x0: Vec<SVector<f64, 2>>,
    u: Vec<SVector<f64, 1>>,
    p: Vec<SVector<f64, 2>>,
    h: Vec<f64>,
    t0: Vec<f64>,
    lambda: Vec<SVector<f64, 2>>,
    nu: Vec<SVector<f64, 1>>,
    call: usize,
}

impl Inputs {
    fn new(source: &mut Source) -> Self {
        let count = source.below(7);
        let many = |source: &mut Source| if source.below(8) == 0 { source.below(4) } else { count };
        fn vectors<const N: usize>(source: &mut Source, count: usize) -> Vec<SVector<f64, N>> {
            (0..count).map(|_| source.vector()).collect()
        }
        let lengths: [usize; 6] = core::array::from_fn(|_| many(source));
        Self {
            count,
            x0: vectors(source, count),
            u: vectors(source, lengths[0]),
            p: vectors(source, lengths[1]),
            h: (0..lengths[2]).map(|_| source.length()).collect(),
            t0: (0..lengths[3]).map(|_| source.number()).collect(),
            lambda: vectors(source, lengths[4]),
            nu: vectors(source, lengths[5]),
            call: source.below(6),
        }
    }
}

/// What is said of each interval, or of all of them.
fn assert_answers(batch: &mut Made, inputs: &Inputs) -> Result<Vec<Answer>, String> {
    let Inputs { count, x0, u, p, h, t0, lambda, nu, call } = inputs;
    let intervals = Intervals { x0, u, p, h, t0 };
    macro_rules! call {
        ($numbers:ident, $result:ident, |$results:ident| $call:expr) => {{
            let mut $results = vec![$result::<Everything>::default(); *count];
            match $call {
                Ok(()) => {}
                Err(BatchError::Intervals { failed, first, error }) => {
                    let said = format!("{:?}", batch.status(first));
                    assert!((1..=*count).contains(&failed));
                    assert_eq!(said, format!("{:?}", Err::<(), _>(error)));
                }
                Err(error) => return Err(format!("{error:?}")),
            }
            // What failed is no result.
            let all = $results.iter().enumerate();
            all.map(|(index, result)| batch.status(index).map(|()| $numbers!(result))).collect()
        }};
    }
    Ok(match call {
        0 => call!(nominal, Nominal, |results| batch.solve(&intervals, &mut results)),
        1 => call!(forward, Forward, |results| batch.forward(&intervals, &mut results)),
        2 => call!(gradient, Adjoint, |results| batch.adjoint(&intervals, lambda, &mut results)),
        3 => {
            call!(gradient, ForwardAdjoint, |results| batch.forward_adjoint(&intervals, lambda, &mut results))
        }
        4 => call!(hessian, Hessian, |results| batch.hessian_with_z0(&intervals, lambda, nu, &mut results)),
        _ => call!(hessian, Hessian, |results| batch.hessian(&intervals, lambda, &mut results)),
    })
}

#[test]
fn batches() {
    let mut counts = Counts::new("batches");
    for seed in seeds(INTEGRATORS) {
        let mut source = Source::new(seed);
        let options = source.options();
        let Ok(mut batch) = Made::new(options) else { continue };
        let mut start = None;
        for _ in 0..2 {
            let given = (source.vector(), source.vector());
            if batch.set_start(&given.0, &given.1).is_ok() {
                start = Some(given);
            }
            let inputs = Inputs::new(&mut source);
            let found = assert_answers(&mut batch, &inputs);
            let mut fresh = Made::new(options).expect("as before");
            if let Some((xdot, z)) = &start {
                fresh.set_start(xdot, z).expect("as before");
            }
            let again = assert_answers(&mut fresh, &inputs);
            match (found, again) {
                (Ok(found), Ok(again)) => {
                    for (found, again) in found.iter().zip(again) {
                        judge(&mut counts, seed, found, (options.start != Start::Warm).then_some(again));
                    }
                    assert_eq!(batch.status(inputs.count), Err(Error::NoResult));
                }
                (found, again) => assert_eq!(found.err(), again.err(), "seed {seed}"),
            }
        }
    }
    enough(&counts, 90);
}
