//! Dispatch of computations to registers, on machines with SIMD.

pub use super::register::*;
use crate::scalar::{Packed, Piece, Registers};
use core::marker::PhantomData;

/// Whether there are registers of several numbers.
pub const REGISTERS: bool = true;

/// Transposes registers through memory, without special instructions.
#[inline(always)]
pub(super) fn transpose_in_memory<T: Copy + Default, R: Copy, const W: usize>(
    mut rows: [R; W],
    store: fn(R, &mut [T; W]),
    load: fn(&[T; W]) -> R,
) -> [R; W] {
    let mut cells = [[T::default(); W]; W];
    for (row, cell) in rows.iter().zip(&mut cells) {
        store(*row, cell);
    }
    for (lane, row) in rows.iter_mut().enumerate() {
        let mut column = [T::default(); W];
        for (to, cell) in column.iter_mut().zip(&cells) {
            *to = cell[lane];
        }
        *row = load(&column);
    }
    rows
}

/// Runs a computation on `S` numbers in the narrowest register that holds them.
macro_rules! side_by_side {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        #[inline(always)]
        fn side_by_side<const S: usize, C: crate::scalar::SideBySide<Self, S>>(
            computation: C,
        ) -> Result<(), C> {
            use crate::scalar::lanes;
            // Two numbers use a register of four if available: with fused products its elementary
            // functions take half the time of those in a register of two.
            #[cfg(target_arch = "x86_64")]
            if const { S > 1 && S <= $more && lanes::AVX2 } && lanes::level() >= lanes::Level::Avx2 {
                computation.call::<lanes::$avx2<S>>();
                return Ok(());
            }
            #[cfg(target_arch = "x86_64")]
            if const { S > $more && S <= $most && lanes::may_be_available(lanes::Level::Avx512) }
                && lanes::level() == lanes::Level::Avx512
            {
                computation.call::<lanes::$avx512<S>>();
                return Ok(());
            }
            #[cfg(not(target_arch = "x86_64"))]
            if const { S > 1 && S <= $few } {
                computation.call::<lanes::$base<S>>();
                return Ok(());
            }
            Err(computation)
        }
    };
}
pub(crate) use side_by_side;

/// Runs a computation with whole registers.
#[cfg(target_arch = "x86_64")]
macro_rules! widest_register {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        fn run_in_widest_register<C: crate::scalar::Widest<Self>>(
            lanes: usize,
            computation: C,
        ) -> Result<C::Output, C> {
            use crate::scalar::lanes::{self, Level, level, may_be_available};
            if const { may_be_available(Level::Avx512) } && level() == Level::Avx512 && lanes >= $most {
                return Ok(computation.call::<lanes::$avx512<$most>>());
            }
            if const { lanes::AVX2 } && level() >= Level::Avx2 && lanes >= $more {
                return Ok(computation.call::<lanes::$avx2<$more>>());
            }
            Err(computation)
        }
    };
}
#[cfg(not(target_arch = "x86_64"))]
macro_rules! widest_register {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        fn run_in_widest_register<C: crate::scalar::Widest<Self>>(
            lanes: usize,
            computation: C,
        ) -> Result<C::Output, C> {
            use crate::scalar::lanes::{Level, level};
            if level() < Level::Base || lanes < $few {
                return Err(computation);
            }
            Ok(computation.call::<crate::scalar::lanes::$base<$few>>())
        }
    };
}
pub(crate) use widest_register;

/// Runs a computation on slices in a function that is compiled for the registers. These functions
/// are long: each number type has them only for registers that pay off.
macro_rules! packed_registers {
    ($base:ident of $few:literal, $avx2:ident of $more:literal, $avx512:ident of $most:literal) => {
        #[inline]
        fn registers<C: crate::scalar::Registers<Self>>(computation: C) {
            use crate::scalar::Scalar;
            use crate::scalar::lanes::{self, Inside};
            // Registers of sixteen numbers are no faster than those of eight.
            #[cfg(target_arch = "x86_64")]
            if const { $most <= 8 && lanes::may_be_available(lanes::Level::Avx512) }
                && lanes::level() == lanes::Level::Avx512
            {
                type Register = lanes::$avx512<$most>;
                return Register::vectorize(Inside::<Register, _, Self>::new(computation));
            }
            #[cfg(target_arch = "x86_64")]
            if const {
                lanes::may_be_available(lanes::Level::Avx2)
                    || $most > 8 && lanes::may_be_available(lanes::Level::Avx512)
            } && lanes::level() >= lanes::Level::Avx2
            {
                type Register = lanes::$avx2<$more>;
                return Register::vectorize(Inside::<Register, _, Self>::new(computation));
            }
            if const { lanes::may_be_available(lanes::Level::Base) } {
                type Register = lanes::$base<$few>;
                Register::vectorize(Inside::<Register, _, Self>::new(computation));
            }
        }
    };
}
pub(crate) use packed_registers;

/// A computation as the function that a register enters.
pub struct Inside<E, C, T>(C, PhantomData<(E, T)>);

impl<E, C, T> Inside<E, C, T> {
    /// Uses registers of type `E`.
    pub fn new(computation: C) -> Self {
        Self(computation, PhantomData)
    }
}

impl<T, E: Packed<T>, C: Registers<T>> Piece for Inside<E, C, T> {
    #[inline(always)]
    fn run(self) {
        self.0.run::<E>();
    }
}
