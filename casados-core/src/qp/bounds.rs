//! Bounds of some components of a stage, and their penalties.

use super::error::Side;
use crate::scalar::Real;

/// Bounds of some components, and what it costs to leave them.
///
/// A violation `e` of a soft bound costs `linear · e + ½ quadratic · e²`. A bound whose linear
/// penalty is infinite, as that of every new QP, is hard.
#[derive(Clone, Copy, Debug)]
pub struct Bounds<'a, T> {
    /// −∞ where there is none.
    pub lower: &'a [T],
    /// +∞ where there is none.
    pub upper: &'a [T],
    /// Linear penalties of the lower bounds.
    pub lower_linear: &'a [T],
    /// Quadratic penalties of the lower bounds.
    pub lower_quadratic: &'a [T],
    /// Linear penalties of the upper bounds.
    pub upper_linear: &'a [T],
    /// Quadratic penalties of the upper bounds.
    pub upper_quadratic: &'a [T],
}

/// As [`Bounds`], to be written.
#[derive(Debug)]
pub struct BoundsMut<'a, T> {
    /// −∞ where there is none.
    pub lower: &'a mut [T],
    /// +∞ where there is none.
    pub upper: &'a mut [T],
    /// Linear penalties of the lower bounds.
    pub lower_linear: &'a mut [T],
    /// Quadratic penalties of the lower bounds.
    pub lower_quadratic: &'a mut [T],
    /// Linear penalties of the upper bounds.
    pub upper_linear: &'a mut [T],
    /// Quadratic penalties of the upper bounds.
    pub upper_quadratic: &'a mut [T],
}

impl<T: Real> BoundsMut<'_, T> {
    /// One component.
    pub fn set(&mut self, index: usize, lower: T, upper: T) {
        for (bounds, value) in [(&mut *self.lower, lower), (&mut *self.upper, upper)] {
            if let Some(bound) = bounds.get_mut(index) {
                *bound = value;
            }
        }
    }
    /// Makes both bounds of a component soft.
    pub fn soften(&mut self, index: usize, linear: T, quadratic: T) {
        self.soften_side(index, Side::Lower, linear, quadratic);
        self.soften_side(index, Side::Upper, linear, quadratic);
    }
    /// Makes one bound of a component soft.
    pub fn soften_side(&mut self, index: usize, side: Side, linear: T, quadratic: T) {
        let [of_linear, of_quadratic] = match side {
            Side::Lower => [&mut *self.lower_linear, &mut *self.lower_quadratic],
            Side::Upper => [&mut *self.upper_linear, &mut *self.upper_quadratic],
        };
        for (penalties, value) in [(of_linear, linear), (of_quadratic, quadratic)] {
            if let Some(penalty) = penalties.get_mut(index) {
                *penalty = value;
            }
        }
    }
}
