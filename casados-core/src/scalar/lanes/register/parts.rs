//! Macros that implement parts of the register types.

macro_rules! operators {
    ($name:ident, $ops:ident: $($trait:ident $method:ident $function:ident),*) => { $(
        impl<const N: usize> $trait for $name<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($ops::$function(self.0, other.0))
            }
        }
    )* };
}

/// The whole register, for functions that are independent of the used lanes.
macro_rules! whole {
    ($name:ident, $ops:ident, $a:expr) => {
        $name::<{ $ops::WIDTH }>($a.0)
    };
}

/// The elementary functions of doubles.
macro_rules! of_doubles {
    ($name:ident, $ops:ident: $($unary:ident)*; $($binary:ident)*) => {
        $(
            #[inline(always)]
            fn $unary(self) -> Self {
                Self($ops::enter::<functions::$unary, _>(whole!($name, $ops, self)).0)
            }
        )*
        $(
            #[inline(always)]
            fn $binary(self, other: Self) -> Self {
                let arguments = (whole!($name, $ops, self), whole!($name, $ops, other));
                Self($ops::enter::<functions::$binary, _>(arguments).0)
            }
        )*
        #[inline(always)]
        fn over(self, c: f64, [high, low]: [f64; 2]) -> Self {
            if const { !$ops::FUSED } {
                return self / Self::splat(c);
            }
            let low = $ops::mul(self.0, $ops::splat(low));
            Self($ops::mul_add(self.0, $ops::splat(high), low))
        }
        #[inline(always)]
        fn sin_cos(self) -> (Self, Self) {
            let (sin, cos) = $ops::enter::<functions::sin_cos, _>(whole!($name, $ops, self));
            (Self(sin.0), Self(cos.0))
        }
    };
}

/// The elementary functions of `f32`: those of doubles, rounded.
macro_rules! of_singles {
    ($name:ident, $ops:ident: $($unary:ident)*; $($binary:ident)*) => {
        $(
            #[inline(always)]
            fn $unary(self) -> Self {
                let [low, high] = whole!($name, $ops, self).widen();
                Self($name::narrow(Scalar::$unary(low), Scalar::$unary(high)).0)
            }
        )*
        $(
            #[inline(always)]
            fn $binary(self, other: Self) -> Self {
                let [low, high] = whole!($name, $ops, self).widen();
                let [other_low, other_high] = whole!($name, $ops, other).widen();
                let low = Scalar::$binary(low, other_low);
                Self($name::narrow(low, Scalar::$binary(high, other_high)).0)
            }
        )*
        #[inline(always)]
        fn sin_cos(self) -> (Self, Self) {
            let [low, high] = whole!($name, $ops, self).widen();
            let ((sin_low, cos_low), (sin_high, cos_high)) = (low.sin_cos(), high.sin_cos());
            (Self($name::narrow(sin_low, sin_high).0), Self($name::narrow(cos_low, cos_high).0))
        }
    };
}

/// Eight `f64`, whose demoted numbers take half a register.
#[cfg(target_arch = "x86_64")]
macro_rules! in_half_a_register {
    () => {
        type Demoted = F32x8<N>;
        #[inline(always)]
        fn demote(self) -> F32x8<N> {
            F32x8(avx512_f64::demote(self.0))
        }
        #[inline(always)]
        fn promote(demote: F32x8<N>) -> Self {
            Self(avx512_f64::promote(demote.0))
        }
    };
}

macro_rules! double {
    ($name:ident, $ops:ident) => {
        impl DoubleRegister for $name<{ $ops::WIDTH }> {
            const FUSED: bool = $ops::FUSED;

            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self($ops::mul_add(self.0, b.0, c.0))
            }
            #[inline(always)]
            fn and_bits(self, other: Self) -> Self {
                Self($ops::and(self.0, other.0))
            }
            #[inline(always)]
            fn or_bits(self, other: Self) -> Self {
                Self($ops::or(self.0, other.0))
            }
            #[inline(always)]
            fn xor_bits(self, other: Self) -> Self {
                Self($ops::xor(self.0, other.0))
            }
            #[inline(always)]
            fn add_bits(self, other: Self) -> Self {
                Self($ops::add_bits(self.0, other.0))
            }
            #[inline(always)]
            fn shift_left<const BITS: i32>(self) -> Self {
                Self($ops::shift_left::<BITS>(self.0))
            }
            #[inline(always)]
            fn shift_right<const BITS: i32>(self) -> Self {
                Self($ops::shift_right::<BITS>(self.0))
            }
            #[inline(always)]
            fn bits_of(mask: Self::Mask) -> u32 {
                $ops::bits(mask)
            }
        }
    };
}

macro_rules! single {
    ($name:ident, $ops:ident, $double:ident) => {
        impl Single for $name<{ $ops::WIDTH }> {
            type Double = $double<{ $ops::doubles::WIDTH }>;

            #[inline(always)]
            fn widen(self) -> [Self::Double; 2] {
                $ops::widen(self.0).map($double)
            }
            #[inline(always)]
            fn narrow(low: Self::Double, high: Self::Double) -> Self {
                Self($ops::narrow([low.0, high.0]))
            }
        }
    };
}

/// Complex numbers: real parts in the lower half of a register, imaginary ones in the upper half.
#[cfg(target_arch = "x86_64")]
macro_rules! complex {
    ($name:ident, $element:ident, $ops:ident) => {
        impl $name<{ $ops::WIDTH }> {
            /// `target − a b` of the numbers at the start of the arrays, half as many as the
            /// register has elements.
            #[inline(always)]
            pub fn subtract_complex<const N: usize>(
                target: &mut [$element; N],
                a: &[$element; N],
                b: &[$element; N],
            ) {
                let (Some(target), Some(a), Some(b)) =
                    (target.first_chunk_mut(), a.first_chunk(), b.first_chunk())
                else {
                    return;
                };
                let numbers = Self::load(b);
                // `i b`, shared by several products.
                let turned = Self($ops::xor($ops::swap_halves(numbers.0), $ops::signs_below()));
                let difference = Self::load(target).subtract_product(Self::twice(a, 0), numbers);
                difference.subtract_product(Self::twice(a, $ops::WIDTH / 2), turned).store(target);
            }
            /// A copy of half of the elements in both halves.
            #[inline(always)]
            fn twice(elements: &[$element; $ops::WIDTH], begin: usize) -> Self {
                let mut all = [0.0; $ops::WIDTH];
                let half = &elements[begin..begin + $ops::WIDTH / 2];
                let (low, high) = all.split_at_mut($ops::WIDTH / 2);
                low.copy_from_slice(half);
                high.copy_from_slice(half);
                Self::load(&all)
            }
        }
    };
}

/// Products of slices of any length.
#[cfg(target_arch = "x86_64")]
macro_rules! slices {
    ($name:ident, $element:ident, $ops:ident) => {
        impl $name<{ $ops::WIDTH }> {
            /// `target − a b`, element by element, for the shortest of the lengths.
            #[inline(always)]
            pub fn subtract_each(target: &mut [$element], a: &[$element], b: &[$element]) {
                let length = target.len().min(a.len()).min(b.len());
                let (target, target_rest) = target[..length].as_chunks_mut();
                let ((a, a_rest), (b, b_rest)) = (a[..length].as_chunks(), b[..length].as_chunks());
                for ((target, a), b) in target.iter_mut().zip(a).zip(b) {
                    Self::load(target).subtract_product(Self::load(a), Self::load(b)).store(target);
                }
                for ((target, &a), &b) in target_rest.iter_mut().zip(a_rest).zip(b_rest) {
                    *target = target.subtract_product(a, b);
                }
            }
        }
    };
}

/// Factors of blocks of four stages.
#[cfg(target_arch = "x86_64")]
macro_rules! fours {
    ($name:ident, $element:ident, $ops:ident) => {
        impl $name<{ $ops::WIDTH }> {
            /// The same four numbers, repeated.
            #[inline(always)]
            pub fn repeat_four(numbers: &[$element; 4]) -> Self {
                Self($ops::repeat_four(numbers))
            }
            /// For each group of four numbers the first one in all four places, the second, the
            /// third, and the fourth.
            #[inline(always)]
            pub fn each_of_four(self) -> [Self; 4] {
                let [a, b, c, d] = $ops::each_of_four(self.0);
                [Self(a), Self(b), Self(c), Self(d)]
            }
        }
    };
}
