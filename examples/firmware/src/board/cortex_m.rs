//! The emulated board: what it prints, how many instructions a call takes, and how much stack.

use core::arch::asm;

/// A request to the debugger, which is the emulator.
fn semihost(operation: u32, argument: u32) -> u32 {
    let result;
    // SAFETY: the instruction stops the machine; the emulator reads memory and answers in `r0`.
    unsafe { asm!("bkpt 0xab", inout("r0") operation => result, in("r1") argument, options(nostack)) };
    result
}

pub fn print(text: &str) {
    for byte in text.as_bytes() {
        semihost(0x03, byte as *const u8 as u32);
    }
}

/// Words for errors are more than there is room for.
pub fn explain(_: &dyn core::error::Error) {}

pub fn exit(success: bool) -> ! {
    loop {
        semihost(0x18, if success { 0x20026 } else { 0x20023 });
    }
}

/// A panic that the optimiser cannot rule out leaves this name undefined: then the program does not
/// link.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn a_panic_is_reachable() -> !;
    }
    // SAFETY: no program that links has this call.
    unsafe { a_panic_is_reachable() }
}

const PAINT: u32 = 0xC0DE_F00D;

unsafe extern "C" {
    /// Where statics end.
    static __sheap: u8;
}

/// Paints the free stack; where it begins.
#[inline(never)]
pub fn paint() -> u32 {
    let here = 0_u32;
    let top = (&raw const here as u32) - 64;
    let mut address = &raw const __sheap as u32;
    while address < top {
        // SAFETY: nothing lives between the end of statics and the stack pointer.
        unsafe { (address as *mut u32).write_volatile(PAINT) };
        address += 4;
    }
    top
}

/// Bytes of stack that were used since.
#[inline(never)]
pub fn used(top: u32) -> u32 {
    let mut address = &raw const __sheap as u32;
    // SAFETY: as above.
    while address < top && unsafe { (address as *const u32).read_volatile() } == PAINT {
        address += 4;
    }
    top + 64 - address
}

/// A function of its own: its name tells `run.py` where a count begins and ends.
#[inline(never)]
fn ticks() -> u32 {
    // SAFETY: the counter of the system timer.
    unsafe { (0xE000_E018 as *const u32).read_volatile() }
}

/// The instructions that a call takes. Ticks are 40 ns, and the emulator is told that an
/// instruction takes 128 ns.
pub fn count<R>(f: impl FnOnce() -> R) -> (u32, R) {
    // SAFETY: the registers of the system timer: reload, counter, start.
    unsafe {
        (0xE000_E014 as *mut u32).write_volatile(0x00FF_FFFF);
        (0xE000_E018 as *mut u32).write_volatile(0);
        (0xE000_E010 as *mut u32).write_volatile(5);
    }
    let start = ticks();
    let result = f();
    let elapsed = start.wrapping_sub(ticks()) & 0x00FF_FFFF;
    ((u64::from(elapsed) * 40 / 128) as u32, result)
}
