//! A pendulum on a cart is held upright. What a controller needs of the model it asks the
//! integrator for: where the state will be after a sample, and the derivatives of that.

use crate::pendulum::Pendulum;
use crate::{board, memory::Static, options, report};
use casados::memory::Refusing;
use casados::{Error, Gauss, Inline, Irk, Real, mode};
use nalgebra::{Vector1, Vector4};

/// Two stages: fourth order. Where the planned elimination is not good enough, it is an error:
/// nothing takes longer than usual.
pub type Predictor<T> = Irk<Pendulum, Gauss<2>, T, Inline<mode::Forward, 1, Refusing>>;

/// The time between two samples.
const SAMPLE: f64 = 0.02;
const SAMPLES: usize = 250;

/// The gain of a linear quadratic regulator: weights 1, 10, 0.1, 0.1 of the state, 0.01 of the
/// force.
const GAIN: [f64; 4] = [-8.65, 73.7, -10.88, 19.44];

/// Bytes of the predictor in `f32`: `cargo doc` prints the number.
pub const SIZE_F32: usize = Predictor::<f32>::SIZE;
/// Bytes of the predictor in `f64`.
pub const SIZE_F64: usize = Predictor::<f64>::SIZE;

/// Makes the predictor and runs the loop. Prints what both take of the stack.
pub fn run<T: Real>(name: &str, memory: &'static Static<Predictor<T>>) -> Result<(), Error> {
    let top = board::paint();
    let Some(predictor) = start(memory)? else {
        return Err(Error::NoResult);
    };
    report::numbers("start-stack", &[board::used(top)]);
    let top = board::paint();
    drive(name, predictor)?;
    report::numbers("stack", &[board::used(top)]);
    report::numbers("size", &[Predictor::<T>::SIZE as u32]);
    Ok(())
}

#[inline(never)]
fn start<T: Real>(memory: &'static Static<Predictor<T>>) -> Result<Option<&'static mut Predictor<T>>, Error> {
    Ok(memory.set(Predictor::<T>::inline(options(3))?))
}

/// Runs the loop, and prints every fiftieth state and how many instructions a sample takes.
#[inline(never)]
fn drive<T: Real>(name: &str, predictor: &mut Predictor<T>) -> Result<(), Error> {
    let number = T::from_f64;
    let mut x = Vector4::new(number(0.1), number(0.25), number(0.0), number(-0.2));
    let (mut least, mut most) = (u32::MAX, 0);
    for sample in 0..SAMPLES {
        let (instructions, next) = board::count(|| control(predictor, &x));
        x = next?;
        (least, most) = (least.min(instructions), most.max(instructions));
        if sample % 50 == 49 {
            report::reals(name, x.as_slice());
        }
    }
    report::numbers("instructions", &[least, most]);
    Ok(())
}

/// What happens in one sample: the force from the state, bounded, and the state that follows.
#[inline(never)]
fn control<T: Real>(predictor: &mut Predictor<T>, x: &Vector4<T>) -> Result<Vector4<T>, Error> {
    let limit = T::from_f64(20.0);
    let mut force = T::ZERO;
    for (&gain, &x) in GAIN.iter().zip(x.iter()) {
        force = force - T::from_f64(gain) * x;
    }
    let force = if force > limit {
        limit
    } else if force < -limit {
        -limit
    } else {
        force
    };
    Ok(predictor.forward(x, &Vector1::new(force), T::from_f64(SAMPLE))?.nominal.x)
}
