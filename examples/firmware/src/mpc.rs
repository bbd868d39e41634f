//! Model predictive control: a pendulum on a cart hangs down, is swung up and kept there in spite
//! of a kick, with force and rail bounded. One real-time iteration in each sample.

use crate::memory::Parts;
use crate::pendulum::Pendulum;
use crate::{board, report};
use casados::memory::Refusing;
use casados::ocp::{GaussNewton, Horizon, LeastSquaresCost, OcpError, Problem, RealTime};
use casados::qp::{InteriorPoint, StageDims};
use casados::{Gauss, Inline, Irk, Real, function, mode};
use nalgebra::{Vector1, Vector4};

pub const INTERVALS: usize = 20;
const SAMPLE: f64 = 0.08;
const SAMPLES: usize = 100;
/// When it is kicked, and how fast that makes the ball turn.
const DISTURBANCE: (usize, f64) = (50, 1.0);
pub const FORCE: f64 = 15.0;
pub const RAIL: f64 = 1.0;
/// Two sides of the force at every stage but the last, of the position at every one but the first.
pub const BOUNDS: usize = 4 * INTERVALS;

#[function]
pub fn deviation(x: [f64; 4], u: [f64; 1]) -> [f64; 5] {
    [x[0], x[1], x[2], x[3], u[0]]
}

#[function]
pub fn end(x: [f64; 4], _u: [f64; 1]) -> [f64; 4] {
    x
}

/// Nothing to fall back on: that would be an error, in which the plan is as it was.
type Dynamics<T> = Irk<Pendulum, Gauss<2>, T, Inline<mode::Forward, 1, Refusing>>;

/// The problem: an integrator that is its own memory, and squares of deviations.
pub type Controlled<T> = Problem<Dynamics<T>, LeastSquaresCost<Deviation, T>, LeastSquaresCost<End, T>>;

/// The controller, which points to its numbers and indices.
pub type Controller<T> = RealTime<
    Controlled<T>,
    InteriorPoint<T, &'static mut [T], &'static mut [u32]>,
    GaussNewton,
    T,
    &'static [StageDims],
    &'static mut [T],
>;

/// All memory of the controller in one static, whose size is a constant.
#[macro_export]
macro_rules! mpc {
    ($number:ty) => {
        const DIMS: [casados::qp::StageDims; $crate::mpc::INTERVALS + 1] =
            $crate::mpc::Controlled::<$number>::dims::<$number, { $crate::mpc::INTERVALS + 1 }>();
        const PROBLEM: usize = $crate::mpc::Controlled::<$number>::memory::<$number>(&DIMS);
        const PLAN: usize = casados::qp::Solution::<$number, (), ()>::memory(&DIMS);
        const SOLVER: (usize, usize) =
            casados::qp::InteriorPoint::<$number, (), ()>::memory(&DIMS, $crate::mpc::BOUNDS, 0, 0);
        type Whole = $crate::memory::Whole<
            $number,
            { PROBLEM + PLAN + SOLVER.0 },
            { SOLVER.1 },
            $crate::mpc::Controller<$number>,
        >;
        /// Bytes of the controller. There is nothing else: `cargo doc` prints the number.
        pub const SIZE: usize = size_of::<Whole>();
        static WHOLE: $crate::memory::Static<Whole> = $crate::memory::Static::new();

        #[cfg_attr(target_os = "none", cortex_m_rt::entry)]
        fn main() -> ! {
            let good = match WHOLE.parts(0.0) {
                Some(parts) => {
                    let result = $crate::mpc::run(&DIMS, parts, [PROBLEM, PLAN]);
                    result.map_err(|error| $crate::board::explain(&error)).is_ok()
                }
                None => false,
            };
            $crate::report::numbers("memory", &[SIZE as u32]);
            $crate::board::exit(good)
        }
    };
}

/// Makes the controller and runs the loop. Prints what both take of the stack.
///
/// # Errors
/// Those of the controller.
#[inline(never)]
pub fn run<T: Real>(
    dims: &'static [StageDims],
    parts: Parts<T, Controller<T>>,
    lengths: [usize; 2],
) -> Result<(), OcpError> {
    let top = board::paint();
    let controller = start(dims, parts, lengths)?;
    report::numbers("start-stack", &[board::used(top)]);
    let top = board::paint();
    drive(controller)?;
    report::numbers("stack", &[board::used(top)]);
    Ok(())
}

/// Where the pendulum hangs, or nearly so: on its way up it has to choose a side.
#[allow(clippy::approx_constant, reason = "nearly is meant")]
const HANGING: [f64; 4] = [0.0, 3.14, 0.0, 0.0];

#[inline(never)]
fn start<T: Real>(
    dims: &'static [StageDims],
    (numbers, indices, place): Parts<T, Controller<T>>,
    [problem, plan]: [usize; 2],
) -> Result<&'static mut Controller<T>, OcpError> {
    let number = T::from_f64;
    let (problem, rest) = numbers.split_at_mut_checked(problem).unwrap_or_default();
    let (plan, solver) = rest.split_at_mut_checked(plan).unwrap_or_default();

    let integrator = Dynamics::<T>::inline(crate::options(3))?;
    let mut ocp = Problem::new(integrator)
        .stage_cost(LeastSquaresCost::<Deviation, T>::diagonal(&[1.0, 10.0, 0.1, 0.1, 0.01].map(number)))
        .terminal_cost(LeastSquaresCost::<End, T>::diagonal(&[20.0, 100.0, 5.0, 5.0].map(number)))
        .on_horizon(Horizon::uniform(INTERVALS, number(SAMPLE)), dims, problem)?;
    let x = HANGING.map(number);
    ocp.bound("u", .., number(-FORCE), number(FORCE))?.bound("x[0]", .., number(-RAIL), number(RAIL))?;
    ocp.fix_initial_state(&x)?.guess(&x, &[T::ZERO])?;
    let mut qp_solver = InteriorPoint::in_memory(solver, indices);
    // A sample takes so long at most.
    (qp_solver.options.max_iterations, qp_solver.options.locate) = (20, false);
    Ok(place.write(RealTime::in_memory(ocp, qp_solver, dims, plan)?))
}

/// Runs the loop, and prints every tenth state and how many instructions a sample takes.
#[inline(never)]
fn drive<T: Real>(controller: &mut Controller<T>) -> Result<(), OcpError> {
    let number = T::from_f64;
    let mut x = HANGING.map(number);
    let (mut preparation, mut feedback, mut iterations) = ([u32::MAX, 0], [u32::MAX, 0], [u32::MAX, 0]);
    for sample in 0..SAMPLES {
        if sample == DISTURBANCE.0 {
            x[3] = x[3] + number(DISTURBANCE.1);
        }
        let (count, prepared) = board::count(|| controller.prepare());
        update_range(&mut preparation, count);
        let prepared = prepared?;
        let (count, result) = board::count(|| prepared.feedback(&x));
        update_range(&mut feedback, count);
        let result = result?;
        update_range(&mut iterations, result.statistics.iterations as u32);
        let force = result.u.first().copied().unwrap_or(T::ZERO);
        let integrator = &mut controller.ocp_mut().problem().dynamics;
        let step = integrator.solve(&Vector4::from(x), &Vector1::new(force), number(SAMPLE))?;
        x = step.x.into();
        controller.shift();
        if sample % 10 == 9 {
            report::reals("state", &x);
        }
    }
    report::numbers("prepare", &preparation);
    report::numbers("feedback", &feedback);
    report::numbers("iterations", &iterations);
    Ok(())
}

/// The least and the most.
fn update_range([least, most]: &mut [u32; 2], count: u32) {
    (*least, *most) = ((*least).min(count), (*most).max(count));
}
