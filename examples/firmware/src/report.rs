//! Lines of words and numbers. Formatting by `core::fmt` would be larger than the integrator.

use crate::board::print;
use casados::Real;

/// A name and whole numbers.
pub fn numbers(name: &str, values: &[u32]) {
    print(name);
    for &value in values {
        print(" ");
        digits(value.into(), 10);
    }
    print("\n");
}

/// A name and real numbers, as the bits of doubles: nothing is rounded.
pub fn reals<T: Real>(name: &str, values: &[T]) {
    print(name);
    for value in values {
        print(" 0x");
        digits(value.to_f64().to_bits(), 16);
    }
    print("\n");
}

fn digits(value: u64, base: u64) {
    let (mut text, mut left) = ([b'0'; 20], value);
    let mut length = 0;
    for digit in text.iter_mut().rev() {
        let value = (left % base) as u8;
        *digit = if value < 10 { b'0' + value } else { b'a' - 10 + value };
        (left, length) = (left / base, length + 1);
        if left == 0 {
            break;
        }
    }
    let text = text.get(20 - length..).unwrap_or_default();
    print(core::str::from_utf8(text).unwrap_or_default());
}
