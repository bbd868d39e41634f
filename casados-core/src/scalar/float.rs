//! Elementary functions as methods of `f64` without the standard library.

/// In scope in every model function, so that a model that calls `x.sin()` compiles for firmware
/// without changes. With the standard library `f64` has these methods, and the trait is empty.
///
/// ```
/// #[allow(unused_imports)] // with `std` they are methods of `f64`
/// use casados::scalar::Float as _;
///
/// fn chord(angle: f64) -> f64 { 2.0 * (0.5 * angle).sin() }
/// assert!((chord(core::f64::consts::PI) - 2.0).abs() < 1e-15);
/// ```
#[cfg(feature = "std")]
pub trait Float {}
#[cfg(feature = "std")]
impl Float for f64 {}

#[cfg(not(feature = "std"))]
macro_rules! float {
    ($($name:ident($($argument:ident)?) = $libm:ident),* $(,)?) => {
        /// In scope in every model function: the methods of `f64` that `core` lacks, so that a
        /// model that calls `x.sin()` compiles for firmware without changes.
        #[allow(missing_docs)]
        pub trait Float: Copy {
            $(fn $name(self $(, $argument: Self)?) -> Self;)*
            fn sin_cos(self) -> (Self, Self);
            fn powi(self, n: i32) -> Self;
            fn mul_add(self, a: Self, b: Self) -> Self;
            fn log(self, base: Self) -> Self;
            fn fract(self) -> Self;
            fn div_euclid(self, other: Self) -> Self;
            fn rem_euclid(self, other: Self) -> Self;
        }
        impl Float for f64 {
            $(fn $name(self $(, $argument: Self)?) -> Self {
                libm::$libm(self $(, $argument)?)
            })*
            fn sin_cos(self) -> (Self, Self) {
                libm::sincos(self)
            }
            fn powi(self, n: i32) -> Self {
                super::Scalar::powi(self, n)
            }
            fn mul_add(self, a: Self, b: Self) -> Self {
                libm::fma(self, a, b)
            }
            fn log(self, base: Self) -> Self {
                libm::log(self) / libm::log(base)
            }
            fn fract(self) -> Self {
                self - libm::trunc(self)
            }
            fn div_euclid(self, other: Self) -> Self {
                let quotient = libm::trunc(self / other);
                let below = if other > 0.0 { quotient - 1.0 } else { quotient + 1.0 };
                if self % other < 0.0 { below } else { quotient }
            }
            fn rem_euclid(self, other: Self) -> Self {
                let rest = self % other;
                if rest < 0.0 { rest + other.abs() } else { rest }
            }
        }
    };
}
#[cfg(not(feature = "std"))]
float!(
    sqrt() = sqrt,
    cbrt() = cbrt,
    exp() = exp,
    exp2() = exp2,
    exp_m1() = expm1,
    ln() = log,
    ln_1p() = log1p,
    log2() = log2,
    log10() = log10,
    sin() = sin,
    cos() = cos,
    tan() = tan,
    asin() = asin,
    acos() = acos,
    atan() = atan,
    sinh() = sinh,
    cosh() = cosh,
    tanh() = tanh,
    asinh() = asinh,
    acosh() = acosh,
    atanh() = atanh,
    floor() = floor,
    ceil() = ceil,
    round() = round,
    round_ties_even() = rint,
    trunc() = trunc,
    atan2(other) = atan2,
    hypot(other) = hypot,
    powf(other) = pow,
);
