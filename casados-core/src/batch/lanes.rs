//! Packs numbers of several intervals into SIMD lanes, and unpacks them.

pub(super) use crate::erk::MaskedResult;
use crate::linalg::{Arithmetic, Kernel, kernels};
use crate::scalar::Lanes;
use crate::shape::{InBounds, Plain};
use bytemuck::Zeroable;

/// Upper bound of the lanes of a register.
pub const MAX_LANES: usize = 16;

/// Returns a mask that is true in every lane.
#[inline(always)]
pub fn all_lanes_true<E: Lanes>() -> E::Mask {
    E::le(E::from_f64(0.0), E::from_f64(0.0))
}

kernels! {
    /// Packs elements of several slices into the lanes of registers.
    pub fn pack [T: Plain, E: Lanes<Cell: AsMut<[T]>>] [T, E] <A>(
        from: &'k [&'k [T]; MAX_LANES],
        to: &'k mut [E],
    ) {
        let mut cell: E::Cell = Zeroable::zeroed();
        for (i, to) in to.iter_mut().enumerate() {
            for (cell, from) in cell.as_mut().iter_mut().zip(from) {
                if let Some(&from) = from.get(i) {
                    *cell = from;
                }
            }
            *to = E::load(&cell);
        }
    }
}

/// Unpacks registers: each lane goes to its own slice, which may be empty. One function for all
/// fields of all models.
pub struct Unpack<'a, 'b, T, E> {
    pub from: &'a [E],
    pub to: &'a mut [&'b mut [T]; MAX_LANES],
}

impl<T: Plain, E: Lanes<Cell: AsRef<[T]>>> Kernel for Unpack<'_, '_, T, E> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { from, to } = self;
        let mut begin = 0;
        let mut whole = from.chunks_exact(E::LANES);
        for from in &mut whole {
            let mut tile: [E::Cell; MAX_LANES] = Zeroable::zeroed();
            let Some(tile) = tile.get_mut(..E::LANES).in_bounds() else { return };
            E::transpose(from, tile);
            for (to, cell) in to.iter_mut().zip(&*tile) {
                // The constant length removes bounds checks.
                if let Some(to) = to.get_mut(begin..begin + E::LANES) {
                    to.copy_from_slice(cell.as_ref());
                }
            }
            begin += E::LANES;
        }
        for (index, from) in whole.remainder().iter().enumerate() {
            let mut cell: E::Cell = Zeroable::zeroed();
            from.store(&mut cell);
            for (to, &element) in to.iter_mut().zip(cell.as_ref()) {
                if let Some(to) = to.get_mut(begin + index) {
                    *to = element;
                }
            }
        }
    }
}
