//! Two panels of right-hand sides at a time, for plans that are no straight lines: most instructions of their loops find blocks
//! and rows, for one panel as for two.

use super::block::{Packet, negate, subtract, subtract_scaled};
use super::fused::Arithmetic;
use super::sparse::{Planned, beside, has_all, is_scaled};
use crate::model::{Dae, Pivot};
use crate::scalar::Field;
use crate::shape::{Plain, Shape};

/// Solves `M X = R` in place for both panels, inside of a kernel.
#[inline(always)]
pub fn solve_two<A: Arithmetic, M: Dae, E: Field + Plain, const S: usize, const W: usize>(
    factors: Planned<'_, M, E, S>,
    mut panels: [&mut [Packet<E, S, W>]; 2],
) {
    if !has_all::<M, _>(factors.blocks) || panels.iter().any(|panel| panel.len() != M::Shape::NK) {
        return;
    }
    for pivot in M::STRUCTURE.elimination.pivots {
        down::<A, M, E, S, W>(factors, &mut panels, pivot);
    }
    for pivot in M::STRUCTURE.elimination.pivots.iter().rev() {
        up::<A, M, E, S, W>(factors, &mut panels, pivot);
    }
}

#[inline(always)]
fn down<A: Arithmetic, M: Dae, E: Field + Plain, const S: usize, const W: usize>(
    factors: Planned<'_, M, E, S>,
    panels: &mut [&mut [Packet<E, S, W>]; 2],
    pivot: &Pivot,
) {
    let mut packets = load(panels, pivot.slot as usize);
    // Directions that have not reached this unknown, as at the start of an interval.
    let zero = E::from_f64(0.0);
    if packets.as_flattened().as_flattened().iter().all(|element| *element == zero) {
        return;
    }
    let scaled = is_scaled::<S>(pivot);
    if scaled {
        for packet in &mut packets {
            let mut product = [[zero; W]; S];
            subtract::<A, E, S, W>(&mut product, factors.coupling, packet);
            *packet = product;
        }
    }
    for (block, other) in beside(factors, pivot.lower()) {
        for (packet, panel) in packets.iter().zip(&mut *panels) {
            let Some(target) = panel.get_mut(other) else { continue };
            if scaled {
                subtract_scaled::<A, E, S, W>(target, block, packet);
            } else {
                subtract::<A, E, S, W>(target, block, packet);
            }
        }
    }
}

#[inline(always)]
fn up<A: Arithmetic, M: Dae, E: Field + Plain, const S: usize, const W: usize>(
    factors: Planned<'_, M, E, S>,
    panels: &mut [&mut [Packet<E, S, W>]; 2],
    pivot: &Pivot,
) {
    let mut packets = load(panels, pivot.slot as usize);
    for (block, other) in beside(factors, pivot.upper()) {
        for (packet, panel) in packets.iter_mut().zip(&*panels) {
            let Some(other) = panel.get(other) else { continue };
            subtract::<A, E, S, W>(packet, block, other);
        }
    }
    if let (false, Some(inverse)) = (pivot.identity, factors.blocks.get(pivot.block as usize)) {
        for packet in &mut packets {
            let mut solution = [[E::from_f64(0.0); W]; S];
            negate(packet);
            subtract::<A, E, S, W>(&mut solution, inverse, packet);
            *packet = solution;
        }
    }
    for (packet, panel) in packets.iter().zip(panels) {
        if let Some(to) = panel.get_mut(pivot.slot as usize) {
            *to = *packet;
        }
    }
}

/// The rows of a slot.
#[inline(always)]
fn load<E: Field + Plain, const S: usize, const W: usize>(
    panels: &[&mut [Packet<E, S, W>]; 2],
    slot: usize,
) -> [Packet<E, S, W>; 2] {
    let mut packets = [[[E::from_f64(0.0); W]; S]; 2];
    for (packet, panel) in packets.iter_mut().zip(panels) {
        if let Some(row) = panel.get(slot) {
            *packet = *row;
        }
    }
    packets
}
