//! How many instructions every kind of call takes, of implicit and explicit integrators, and how
//! much that depends on the numbers.

use crate::report;
use casados::{Error, Real};

/// So many calls with different inputs.
pub const CALLS: usize = 200;

/// Prints the least and the most instructions that a call takes.
///
/// # Errors
/// Those of the calls.
pub fn range(name: &str, mut call: impl FnMut() -> Result<u32, Error>) -> Result<(), Error> {
    let mut range = [u32::MAX, 0];
    for _ in 0..CALLS {
        let count = call()?;
        range = [range[0].min(count), range[1].max(count)];
    }
    report::numbers(name, &range);
    Ok(())
}

/// What derivatives are compared by: the first and the last of them, and their sum.
pub fn sample<T: Real>(name: &str, values: &[T]) {
    let sum = values.iter().fold(T::ZERO, |sum, &value| sum + value);
    let first = values.first().copied().unwrap_or(T::ZERO);
    let last = values.last().copied().unwrap_or(T::ZERO);
    report::reals(name, &[first, last, sum]);
}

/// The program for some integrators: a name, `Irk` or `Erk`, a model and a method each, and how far
/// states are from zero.
#[macro_export]
macro_rules! modes {
    ($number:ty; $($name:literal: $integrator:ident<$model:ty, $method:ty>, $far:literal;)*) => {
        #[cfg_attr(target_os = "none", cortex_m_rt::entry)]
        fn main() -> ! {
            let top = $crate::board::paint();
            let good = true $(&& $crate::modes!(@ $number, $name, $integrator, $model, $method, $far).is_ok())*;
            $crate::report::numbers("stack", &[$crate::board::used(top)]);
            $crate::board::exit(good)
        }
    };
    (@ $number:ty, $name:literal, $integrator:ident, $model:ty, $method:ty, $far:literal) => {{
        use casados::{Inline, memory::Refusing};
        use casados::model::{VectorU, VectorX};
        use $crate::{board, memory::Static, modes};
        type Of<Mode> = casados::$integrator<$model, $method, $number, Inline<Mode, 1, Refusing>>;
        static WHOLE: Static<Of<casados::mode::Hessian>> = Static::new();
        static ADJOINT: Static<Of<casados::mode::Adjoint>> = Static::new();

        #[inline(never)]
        fn run() -> Result<(), casados::Error> {
            let (Some(whole), Some(adjoint)) =
                (WHOLE.set(Of::inline($crate::options(3))?), ADJOINT.set(Of::inline($crate::options(3))?))
            else {
                return Err(casados::Error::NoResult);
            };
            let mut random = $crate::Random(1);
            let mut inputs = || {
                let mut vectors = (VectorX::<$model, $number>::zeros(), VectorU::<$model, $number>::zeros());
                let mut lambda = vectors.0;
                vectors.0.iter_mut().for_each(|x| *x = random.number::<$number>() * $far);
                vectors.1.iter_mut().for_each(|u| *u = random.number::<$number>() * 2.0 + 2.0);
                lambda.iter_mut().for_each(|l| *l = random.number::<$number>());
                core::hint::black_box((vectors.0, vectors.1, lambda, 0.02))
            };
            modes::range(concat!($name, "-solve"), || {
                let (x, u, _, h) = inputs();
                let (count, result) = board::count(|| whole.solve(&x, &u, h).map(|_| ()));
                result.map(|()| count)
            })?;
            modes::range(concat!($name, "-forward"), || {
                let (x, u, _, h) = inputs();
                let (count, result) = board::count(|| whole.forward(&x, &u, h).map(|_| ()));
                result.map(|()| count)
            })?;
            modes::range(concat!($name, "-adjoint"), || {
                let (x, u, lambda, h) = inputs();
                let (count, result) = board::count(|| adjoint.adjoint(&x, &u, h, &lambda).map(|_| ()));
                result.map(|()| count)
            })?;
            modes::range(concat!($name, "-hessian"), || {
                let (x, u, lambda, h) = inputs();
                let (count, result) = board::count(|| whole.hessian(&x, &u, h, &lambda).map(|_| ()));
                result.map(|()| count)
            })?;
            let (x, u, lambda, h) = inputs();
            let gradient = adjoint.adjoint(&x, &u, h, &lambda)?.grad_u;
            let step = whole.hessian(&x, &u, h, &lambda)?;
            for derivatives in [
                step.first.forward.nominal.x.as_slice(),
                step.first.forward.dx_dx0.as_slice(),
                step.first.forward.dx_du.as_slice(),
                gradient.as_slice(),
                step.h_xx.as_slice(),
                step.h_xu.as_slice(),
                step.h_uu.as_slice(),
            ] {
                modes::sample("state", derivatives);
            }
            Ok(())
        }
        run()
    }};
}
