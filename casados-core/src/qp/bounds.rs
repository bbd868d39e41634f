//! Bounds of the components of a stage, and their penalties.

use super::error::Side;
use crate::scalar::Real;

/// Bounds of components, and penalties of their violations.
///
/// A violation `e` of a soft bound costs `linear · e + ½ quadratic · e²`. A bound is hard if its
/// linear penalty is infinite, as in a new QP.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// let stage = qp.view().stages().next().unwrap();
/// assert_eq!((stage.u_bounds().lower, stage.u_bounds().upper), (&[-0.4][..], &[0.4][..]));
/// assert!(stage.u_bounds().lower_linear[0].is_infinite()); // hard
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Bounds<'a, T> {
    /// Lower bounds; −∞ for none.
    pub lower: &'a [T],
    /// Upper bounds; +∞ for none.
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

/// A mutable view of [`Bounds`].
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// // Of the last state: not above 0.1, or a penalty of 5 s + ½ 2 s² for the excess s.
/// let mut last = qp.stages_mut().last().unwrap();
/// last.x_bounds_mut().set(0, f64::NEG_INFINITY, 0.1);
/// last.x_bounds_mut().soften_side(0, Side::Upper, 5.0, 2.0);
/// let (mut solver, mut solution) = (HeapInteriorPoint::new(), HeapSolution::new(&dims)?);
/// solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// assert!(solution.stage(3).unwrap().x[0] < 0.1 + 1e-6);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Debug)]
pub struct BoundsMut<'a, T> {
    /// Lower bounds; −∞ for none.
    pub lower: &'a mut [T],
    /// Upper bounds; +∞ for none.
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
    /// Sets the bounds of a component; does nothing if it does not exist.
    pub fn set(&mut self, index: usize, lower: T, upper: T) {
        for (bounds, value) in [(&mut *self.lower, lower), (&mut *self.upper, upper)] {
            if let Some(bound) = bounds.get_mut(index) {
                *bound = value;
            }
        }
    }
    /// Makes both bounds of a component soft; does nothing if it does not exist.
    pub fn soften(&mut self, index: usize, linear: T, quadratic: T) {
        self.soften_side(index, Side::Lower, linear, quadratic);
        self.soften_side(index, Side::Upper, linear, quadratic);
    }
    /// Makes one bound of a component soft; does nothing if it does not exist.
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
