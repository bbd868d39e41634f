//! `f32` and `f64`.

use super::lanes::{blocks, packed_registers, side_by_side, widest_register};
use super::{Compiled, Field, Lanes, Packed, Real, Rows, Scalar, Sealed, mask_logic, one_mask, own_cell};
#[cfg(not(feature = "std"))]
use super::{double, field::power, single};

/// The methods of one real type, from `std` if available, otherwise from `libm`, `single` and
/// `double`.
macro_rules! real {
    ($t:ident, $compiled:ident, $stagnation:literal, [$($registers:tt)*], $($name:ident = $from:ident::$function:ident),*; $powf:path, $atan2:path, $hypot:path, $sincos:path) => {
        impl Field for $t {
            one_mask!();

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $t
            }
            #[inline(always)]
            fn from_whole(value: usize) -> Self {
                value as $t
            }
            #[cfg(feature = "std")]
            #[inline(always)]
            fn subtract_product(self, a: Self, b: Self) -> Self {
                (-a).mul_add(b, self)
            }
            blocks!($($registers)*);
            #[inline(always)]
            fn is_smaller(self, other: Self) -> bool {
                <$t>::abs(self) < <$t>::abs(other)
            }
        }

        impl Scalar for $t {
            own_cell!();

            $(
                #[inline(always)]
                fn $name(self) -> Self {
                    #[cfg(feature = "std")]
                    return <$t>::$name(self);
                    #[cfg(not(feature = "std"))]
                    return $from::$function(self);
                }
            )*
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                #[cfg(feature = "std")]
                return <$t>::sin_cos(self);
                #[cfg(not(feature = "std"))]
                return $sincos(self);
            }
            #[inline(always)]
            fn atan2(self, other: Self) -> Self {
                #[cfg(feature = "std")]
                return <$t>::atan2(self, other);
                #[cfg(not(feature = "std"))]
                return $atan2(self, other);
            }
            #[inline(always)]
            fn hypot(self, other: Self) -> Self {
                #[cfg(feature = "std")]
                return <$t>::hypot(self, other);
                #[cfg(not(feature = "std"))]
                return $hypot(self, other);
            }
            #[inline(always)]
            fn powf(self, other: Self) -> Self {
                #[cfg(feature = "std")]
                return <$t>::powf(self, other);
                #[cfg(not(feature = "std"))]
                return $powf(self, other);
            }
            #[inline(always)]
            fn powi(self, n: i32) -> Self {
                #[cfg(feature = "std")]
                return <$t>::powi(self, n);
                #[cfg(not(feature = "std"))]
                return power(self, n);
            }
            #[inline(always)]
            fn look_up<R: Rows<K, C>, const K: usize, const C: usize>(a: [Self; K], rows: R) -> [Self; C] {
                rows.row(a)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$t>::abs(self)
            }
            #[inline(always)]
            fn signum(self) -> Self {
                <$t>::signum(self)
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn le(self, other: Self) -> bool {
                self <= other
            }
            #[inline(always)]
            fn eq(self, other: Self) -> bool {
                self == other
            }
            mask_logic!();
        }

        impl Sealed for $t {}

        impl Lanes for $t {
            side_by_side!($($registers)*);
            const LANES: usize = 1;
            const EPSILON: f64 = <$t>::EPSILON as f64;
            const STAGNATION: f64 = $stagnation;
            const SMALLEST: f64 = <$t>::MIN_POSITIVE as f64;
            crate::scalar::as_it_is!();
            #[inline(always)]
            fn lane(cell: &Self, _: usize) -> f64 {
                *cell as f64
            }
            #[inline(always)]
            fn set_lane(cell: &mut Self, _: usize, value: f64) {
                *cell = value as $t;
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                <$t>::is_finite(self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self > other { self } else { other }
            }
            #[inline(always)]
            fn all(mask: bool) -> bool {
                mask
            }
        }

        impl Packed<$t> for $t {
            #[inline(always)]
            fn cells(numbers: &[$t]) -> &[$t] {
                numbers
            }
            #[inline(always)]
            fn cells_mut(numbers: &mut [$t]) -> &mut [$t] {
                numbers
            }
            #[inline(always)]
            fn minus_product(self, a: $t, b: $t) -> $t {
                self - a * b
            }
            #[inline(always)]
            fn total(self) -> $t {
                self
            }
            #[inline(always)]
            fn largest(self) -> $t {
                self
            }
        }

        impl Real for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline(always)]
            fn run_precompiled<'r, 'a: 'r, 's: 'r, C: Compiled>(computation: C::Of<'r, 'a, 's, Self>) {
                C::$compiled(computation);
            }
            widest_register!($($registers)*);
            packed_registers!($($registers)*);
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self as f64
            }
        }
    };
}

real!(f64, double, 3.666e-11, [F64x2 of 2, F64x4 of 4, F64x8 of 8], sqrt = libm::sqrt, cbrt = libm::cbrt, exp = double::exp,
    exp2 = libm::exp2, exp_m1 = libm::expm1, ln = libm::log, ln_1p = libm::log1p, log2 = libm::log2, log10 = libm::log10,
    sin = double::sin, cos = double::cos, tan = double::tan, asin = libm::asin, acos = libm::acos, atan = libm::atan,
    sinh = libm::sinh, cosh = libm::cosh, tanh = libm::tanh, asinh = libm::asinh, acosh = libm::acosh,
    atanh = libm::atanh; libm::pow, libm::atan2, libm::hypot, double::sin_cos);
real!(f32, single, 2.422e-5, [F32x4 of 4, F32x8 of 8, F32x16 of 16], sqrt = single::sqrt, cbrt = single::cbrt, exp = single::exp,
    exp2 = single::exp2, exp_m1 = libm::expm1f, ln = libm::logf, ln_1p = libm::log1pf, log2 = libm::log2f,
    log10 = libm::log10f, sin = single::sin, cos = single::cos, tan = single::tan, asin = single::asin,
    acos = libm::acosf, atan = libm::atanf, sinh = libm::sinhf, cosh = libm::coshf, tanh = libm::tanhf,
    asinh = libm::asinhf, acosh = single::acosh, atanh = libm::atanhf;
    libm::powf, libm::atan2f, single::hypot, single::sin_cos);
