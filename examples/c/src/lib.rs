//! The integrator of a pendulum for firmware in C: plain pointers, status codes, memory that the
//! caller gives.
#![no_std]
#![deny(unsafe_op_in_unsafe_fn)]

use casados::model::{VectorU, VectorX};
use casados::{Error, Gauss, Inline, Irk, mode};
use casados::{Options, options::Newton};
use core::mem::MaybeUninit;
use core::ptr::{self, NonNull};

#[path = "../../models/pendulum.rs"]
mod pendulum;
use pendulum::Pendulum;

type Integrator = Irk<Pendulum, Gauss<2>, f64, Inline<mode::Forward>>;

/// Numbers of a state: position, angle, velocity, angular velocity.
pub const CASADOS_STATES: usize = 4;
/// Numbers of a control: the force.
pub const CASADOS_CONTROLS: usize = 1;
/// Bytes of memory that an integrator takes at most.
pub const CASADOS_SIZE: usize = 5120;
/// What the address of this memory is a multiple of.
pub const CASADOS_ALIGNMENT: usize = 8;
const _: () = assert!(Integrator::SIZE <= CASADOS_SIZE && align_of::<Integrator>() <= CASADOS_ALIGNMENT);

/// How a call ended.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum CasadosStatus {
    /// All results are there and finite.
    CasadosOk = 0,
    /// A pointer that may not be null is.
    CasadosNull = 1,
    /// An address is not a multiple of what it has to be.
    CasadosMisaligned = 2,
    /// There is less memory than the integrator takes.
    CasadosTooSmall = 3,
    /// There is no integrator with such options.
    CasadosInvalidOption = 4,
    /// A state, a control or the length of the step is not finite.
    CasadosNonFinite = 5,
    /// The equations could not be solved, or results would not be finite.
    CasadosFailed = 6,
}
use CasadosStatus::{
    CasadosFailed, CasadosInvalidOption, CasadosMisaligned, CasadosNonFinite, CasadosNull, CasadosOk,
    CasadosTooSmall,
};

/// An integrator: two Gauss stages, and as many Newton iterations in every step as it was made
/// with.
pub struct CasadosPendulum(Integrator);

/// Makes an integrator in `size` bytes of memory, which is to live as long as it, with so many
/// iterations, at least one. After an error `*integrator` is null.
///
/// # Safety
/// `memory` is null, or points to `size` bytes that nothing else uses; `integrator` is null, or
/// points to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn casados_new(
    memory: *mut u8,
    size: usize,
    iterations: usize,
    integrator: *mut *mut CasadosPendulum,
) -> CasadosStatus {
    let place = memory.cast::<MaybeUninit<CasadosPendulum>>();
    if let Err(status) = check(integrator.cast_const()) {
        return status;
    }
    // SAFETY: not null, aligned, and what the caller promises.
    let result = unsafe { &mut *integrator };
    *result = ptr::null_mut();
    if let Err(status) = check(place.cast_const()) {
        return status;
    }
    if size < size_of::<CasadosPendulum>() {
        return CasadosTooSmall;
    }
    let newton = Newton { fixed_iterations: Some(iterations), ..Default::default() };
    let Ok(integrator) = Integrator::inline(Options { newton, ..Default::default() }) else {
        return CasadosInvalidOption;
    };
    // SAFETY: aligned, large enough, and nobody else's.
    *result = ptr::from_mut(unsafe { &mut *place }.write(CasadosPendulum(integrator)));
    CasadosOk
}

/// One step of length `h`: from the state `x` and the control `u` to the state at its end, and its
/// derivatives, column after column. `dx_dx` and `dx_du` may be null: then they are not computed.
/// After an error nothing is written.
///
/// # Safety
/// `integrator` is from `casados_new`, and in no other call; the others are null or point to as
/// many numbers as they have: `x` and `x_next` to `CASADOS_STATES`, `u` to `CASADOS_CONTROLS`, the
/// derivatives to their products.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn casados_step(
    integrator: *mut CasadosPendulum,
    x: *const f64,
    u: *const f64,
    h: f64,
    x_next: *mut f64,
    dx_dx: *mut f64,
    dx_du: *mut f64,
) -> CasadosStatus {
    let required = [check(integrator.cast_const()), check(x), check(u), check(x_next.cast_const())];
    let derivatives =
        [dx_dx, dx_du].map(|place| if place.is_null() { Ok(()) } else { check(place.cast_const()) });
    if let Some(status) = required.into_iter().chain(derivatives).find_map(Result::err) {
        return status;
    }
    // SAFETY: not null, aligned, and what the caller promises.
    let (integrator, x, u) = unsafe {
        (&mut (*integrator).0, *x.cast::<[f64; CASADOS_STATES]>(), *u.cast::<[f64; CASADOS_CONTROLS]>())
    };
    let (x, u) = (VectorX::<Pendulum, f64>::from(x), VectorU::<Pendulum, f64>::from(u));
    let result = if dx_dx.is_null() && dx_du.is_null() {
        // SAFETY: as above.
        integrator.solve(&x, &u, h).map(|step| unsafe { write(x_next, step.x.as_slice()) })
    } else {
        // SAFETY: as above.
        integrator.forward(&x, &u, h).map(|step| unsafe {
            write(x_next, step.nominal.x.as_slice());
            write(dx_dx, step.dx_dx0.as_slice());
            write(dx_du, step.dx_du.as_slice());
        })
    };
    match result {
        Ok(()) => CasadosOk,
        Err(Error::NonFiniteInput { .. }) => CasadosNonFinite,
        Err(_) => CasadosFailed,
    }
}

/// Whether a pointer may be used.
fn check<T>(pointer: *const T) -> Result<(), CasadosStatus> {
    match pointer {
        pointer if pointer.is_null() => Err(CasadosNull),
        pointer if !pointer.is_aligned() => Err(CasadosMisaligned),
        _ => Ok(()),
    }
}

/// # Safety
/// `to` is null or points to as many numbers as there are.
unsafe fn write(to: *mut f64, from: &[f64]) {
    if let Some(to) = NonNull::new(to) {
        // SAFETY: what the caller promises.
        unsafe { ptr::copy_nonoverlapping(from.as_ptr(), to.as_ptr(), from.len()) };
    }
}

/// What calls this does not link: the optimiser has proved that nothing panics.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn a_panic_is_reachable() -> !;
    }
    // SAFETY: no program that links has this call.
    unsafe { a_panic_is_reachable() }
}
