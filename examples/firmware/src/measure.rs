//! How large the integrator of one model is, how many instructions its calls take, and how much
//! that depends on the numbers.

/// The program for a model, a number of stages, a type of numbers and a memory.
#[macro_export]
macro_rules! measure {
    ($model:ty, $stages:expr, $number:ty, $memory:ty) => {
        type Integrator = casados::Irk<$model, casados::Gauss<{ $stages }>, $number, $memory>;
        static INTEGRATOR: $crate::memory::Static<Integrator> = $crate::memory::Static::new();

        #[cfg_attr(target_os = "none", cortex_m_rt::entry)]
        fn main() -> ! {
            $crate::board::exit(run().is_ok())
        }

        fn run() -> Result<(), casados::Error> {
            use $crate::{board, report};
            let Some(integrator) = INTEGRATOR.set(Integrator::inline($crate::options(3))?) else {
                return Err(casados::Error::NoResult);
            };
            let top = board::paint();
            calls(integrator)?;
            report::numbers("stack", &[board::used(top)]);
            report::numbers("size", &[Integrator::SIZE as u32]);
            // So often the whole matrix was pivoted in the last call.
            report::numbers("dense", &[integrator.statistics().dense as u32]);
            Ok(())
        }

        /// A function of its own: what is inlined into it counts as its stack.
        #[inline(never)]
        fn calls(integrator: &mut Integrator) -> Result<(), casados::Error> {
            use casados::model::{VectorU, VectorX};
            use core::hint::black_box;
            use $crate::{board, report};
            // So many calls with different inputs.
            const CALLS: usize = 200;

            let mut random = $crate::Random(1);
            let mut ranges = [[u32::MAX, 0]; 2];
            for call in 0..CALLS {
                let mut x = VectorX::<$model, $number>::zeros();
                let mut u = VectorU::<$model, $number>::zeros();
                x.iter_mut().for_each(|x| *x = random.number::<$number>() * 3.0);
                u.iter_mut().for_each(|u| *u = random.number::<$number>() * 2.0 + 2.0);
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
            report::numbers("solve", &ranges[0]);
            report::numbers("forward", &ranges[1]);
            Ok(())
        }
    };
}
