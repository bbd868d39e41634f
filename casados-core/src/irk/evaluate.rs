//! The model at the stages of a step.
//!
//! Every variable, equation and entry of the Jacobian has its values at all stages side by side: where the machine
//! has registers of that many numbers, one call of the model computes them all.

use super::record::{Coefficients, Stage, Times, Work};
use crate::linalg::{Arithmetic, Kernel, are_finite, coupling, dispatch};
use crate::memory::Fallback;
use crate::model::{ArrayK, ArrayV, ArrayX, Dae, Pattern, Structure};
use crate::scalar::{Field, Lanes, Real, SideBySide};
use crate::shape::{Matrix, Plain, Shape};

impl<M: Dae, E: Lanes, const S: usize, F: Fallback> Work<M, E, S, F> {
    /// Writes `u` and `p`, which are the same at all points of an interval.
    pub(crate) fn place_inputs(&mut self) {
        let u = 2 * M::Shape::NX + M::Shape::NZ;
        let inputs = self.inputs.u.as_slice().iter().chain(self.inputs.p.as_slice());
        for (point, input) in self.points.as_mut()[u..].iter_mut().zip(inputs) {
            *point = [*input; S];
        }
    }

    /// Writes `(k_i, ξ_i, z_i, t_i)` with `ξ_i = x + h Σ_j a_ij k_j`.
    #[inline]
    pub(crate) fn place(
        &mut self,
        coefficients: &Coefficients<E, S>,
        step: usize,
        x: &ArrayX<M, E>,
        y: &ArrayK<M, [E; S]>,
    ) {
        let Coefficients { a, c, .. } = coefficients;
        dispatch(Place::<M, E, S> { points: &mut self.points, x, y, a, c, time: self.inputs.time, step });
    }

    /// The residual at all stages.
    pub(crate) fn evaluate_residual(&mut self) {
        self.evaluate::<false>();
    }

    /// The residual and the Jacobian at all stages.
    pub(crate) fn evaluate_jacobian(&mut self) {
        self.evaluate::<true>();
    }

    #[inline(always)]
    fn evaluate<const JACOBIAN: bool>(&mut self) {
        // Of stages that are all alike one is evaluated.
        let all = core::mem::take(&mut self.alike);
        let Self { points, f, stage, linear, .. } = self;
        let call = Evaluate::<M, E, S, JACOBIAN> { points, f, jacobian: &mut linear.jacobian, stage };
        if let Err(call) = E::side_by_side(call) {
            let Evaluate { points, f, jacobian, stage } = call;
            for i in 0..if all { 1 } else { S } {
                dispatch(Take { cells: stage.v.as_mut(), from: points.as_ref(), i });
                if JACOBIAN {
                    M::residual_jacobian::<E>(&stage.v, &mut stage.f, &mut stage.jacobian);
                    dispatch(Give { cells: stage.jacobian.as_ref(), to: jacobian.as_mut(), i, all });
                } else {
                    M::residual::<E>(&stage.v, &mut stage.f);
                }
                dispatch(Give { cells: stage.f.as_ref(), to: f.as_mut(), i, all });
            }
        }
    }
}

/// The value of every variable at stage `i`.
pub(crate) struct Take<'a, E: Lanes, const S: usize> {
    pub cells: &'a mut [E::Cell],
    pub from: &'a [[E; S]],
    pub i: usize,
}

impl<E: Lanes, const S: usize> Kernel for Take<'_, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        for (cell, from) in self.cells.iter_mut().zip(self.from) {
            if let Some(from) = from.get(self.i) {
                from.store(cell);
            }
        }
    }
}

/// What was computed at stage `i`, for this one or for all.
pub(crate) struct Give<'a, E: Lanes, const S: usize> {
    pub cells: &'a [E::Cell],
    pub to: &'a mut [[E; S]],
    pub i: usize,
    pub all: bool,
}

impl<E: Lanes, const S: usize> Kernel for Give<'_, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { cells, to, i, all } = self;
        if all {
            for (cell, to) in cells.iter().zip(to) {
                *to = [E::load(cell); S];
            }
            return;
        }
        for (cell, to) in cells.iter().zip(to) {
            if let Some(to) = to.get_mut(i) {
                *to = E::load(cell);
            }
        }
    }
}

/// `f`, and its Jacobian if it is asked for, at all stages in one call.
struct Evaluate<'a, M: Dae, E: Lanes, const S: usize, const JACOBIAN: bool> {
    points: &'a ArrayV<M, [E; S]>,
    f: &'a mut ArrayK<M, [E; S]>,
    jacobian: &'a mut M::Jacobian<[E; S]>,
    stage: &'a mut Stage<M, E::Cell>,
}

impl<M: Dae, E: Lanes, const S: usize, const JACOBIAN: bool> SideBySide<E, S>
    for Evaluate<'_, M, E, S, JACOBIAN>
{
    #[inline(always)]
    fn call<R: Lanes<Cell = [E; S]>>(self) {
        if JACOBIAN {
            M::residual_jacobian::<R>(self.points, self.f, self.jacobian);
        } else {
            M::residual::<R>(self.points, self.f);
        }
    }
}

/// See [`Work::place`].
struct Place<'a, M: Dae, E: Plain, const S: usize> {
    points: &'a mut ArrayV<M, [E; S]>,
    x: &'a ArrayX<M, E>,
    y: &'a ArrayK<M, [E; S]>,
    a: &'a [[E; S]; S],
    c: &'a [E; S],
    time: Times<E>,
    step: usize,
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for Place<'_, M, E, S> {
    type Number = E;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { points, x, y, a, c, time, step } = self;
        let (points, x, y) = (points.as_mut(), x.as_ref(), y.as_ref());
        let (h, nx) = (time.step, x.len());
        if let Some(t) = points.last_mut() {
            let start = E::from_whole(step);
            for (t, &c) in t.iter_mut().zip(c) {
                *t = time.start + h * (start + c);
            }
        }
        if y.len() < nx || points.len() < nx + y.len() {
            return;
        }
        let ((k, z), (xdot, points)) = (y.split_at(nx), points.split_at_mut(nx));
        xdot.copy_from_slice(k);
        let (xi, points) = points.split_at_mut(nx);
        points[..z.len()].copy_from_slice(z);
        let minus_ha = coupling(a, h);
        for ((xi, &x), k) in xi.iter_mut().zip(x).zip(k) {
            let mut sum = [x; S];
            for (column, &k) in minus_ha.iter().zip(k) {
                for (sum, &element) in sum.iter_mut().zip(column) {
                    *sum = A::subtract(*sum, element, k);
                }
            }
            *xi = sum;
        }
    }
}

/// The entries from `begin` to `end` of a Jacobian: row, column, value.
#[inline(always)]
pub(crate) fn entries<'a, V>(
    structure: &Structure,
    jacobian: &'a [V],
    begin: usize,
    end: usize,
) -> impl Iterator<Item = (usize, usize, &'a V)> + use<'a, V> {
    let Pattern { rows, columns } = structure.jacobian;
    let places =
        rows.get(begin..end).unwrap_or_default().iter().zip(columns.get(begin..end).unwrap_or_default());
    let values = jacobian.get(begin..end).unwrap_or_default();
    places.zip(values).map(|((row, column), value)| (*row as usize, *column as usize, value))
}

/// An entry of a Jacobian: row, column, value.
#[inline(always)]
pub(crate) fn entry<M: Dae, V: Plain>(jacobian: &M::Jacobian<V>, index: usize) -> Option<(usize, usize, &V)> {
    let Pattern { rows, columns } = M::STRUCTURE.jacobian;
    match (rows.get(index), columns.get(index), jacobian.as_ref().get(index)) {
        (Some(&row), Some(&column), Some(value)) => Some((row as usize, column as usize, value)),
        _ => None,
    }
}

/// `Σ_j a_j b_j`
#[inline(always)]
pub(crate) fn dot<E: Field, const S: usize>(a: &[E; S], b: &[E; S]) -> E {
    let mut sum = E::from_f64(0.0);
    for (a, b) in a.iter().zip(b) {
        sum = sum + *a * *b;
    }
    sum
}

/// The first element that is infinite or NaN.
#[inline]
pub(crate) fn not_finite<T: Real>(values: &[T]) -> Option<(usize, f64)> {
    // A few are looked at before the function for many is entered.
    let finite = if values.len() < 16 { are_finite(values) } else { dispatch(Finite { values }) };
    if finite {
        return None;
    }
    values.iter().position(|value| !value.is_finite()).map(|index| (index, values[index].to_f64()))
}

/// See [`are_finite`].
struct Finite<'a, T> {
    values: &'a [T],
}

impl<T: Real> Kernel for Finite<'_, T> {
    type Number = T;
    type Output = bool;
    #[inline(always)]
    fn run<A: Arithmetic>(self) -> bool {
        are_finite(self.values)
    }
}
