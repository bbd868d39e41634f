//! Least-squares costs at the nodes.

use crate::function::{ArrayV, ArrayY, Function, MatrixYY};
use crate::linalg::{Arithmetic, AtRow, Kernel, dispatch, each_row};
use crate::ocp::formulation::error::OcpError;
use crate::ocp::formulation::functions::cost::{At, Cost, Show};
use crate::ocp::formulation::functions::pattern::{self, Entries};
use crate::ocp::formulation::functions::point::{Cross, Terms, There, finite, is_algebraic};
use crate::ocp::formulation::functions::weights;
use crate::scalar::Real;
use crate::shape::{Array, Matrix, Outputs, Plain, Shape, plain};
use bytemuck::Zeroable;
use core::fmt;
use core::ops::Range;

/// `½ (y − r)ᵀ W (y − r)` of the outputs `y(x, z, u, p, t)` of a function and a reference `r`,
/// which every stage has for itself.
///
/// Its Hessian is `JᵀWJ`, that of Gauss and Newton; the exact one has the second derivatives of `y`
/// too.
///
/// ```
/// use casados::ocp::{HeapSqp, Horizon, LeastSquaresCost, Problem};
/// use casados::prelude::*;
///
/// #[ode]
/// fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// /// What follows a reference: the position, and the push with little weight.
/// #[function]
/// fn track(x: [f64; 2], u: f64) -> [f64; 2] { [x[0], u] }
///
/// let mut ocp = Problem::new(Irk::<Cart, Gauss<2>>::new(Options::default())?)
///     .stage_cost(LeastSquaresCost::<Track>::diagonal(&[1.0, 1e-6]))
///     .on(Horizon::uniform(20, 0.1))?;
/// ocp.fix_initial_state(&[0.0, 0.0])?.guess(&[0.0, 0.0], &[0.0])?;
/// ocp.set_reference(.., &[1.0, 0.0])?;
/// let mut sqp = HeapSqp::new(&ocp)?.gauss_newton();
/// assert!(sqp.solve(&mut ocp)?.is_converged());
/// assert!((ocp.solution()?.state("x[0]")?[15] - 1.0).abs() < 0.05);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct LeastSquaresCost<F: Function, T: Plain = f64> {
    weights: MatrixYY<F, T>,
    /// Zero if they are weights.
    invalid: usize,
    /// Zero if `W` is diagonal.
    coupled: usize,
    y: ArrayY<F, T>,
    mu: ArrayY<F, T>,
    jacobian: F::Jacobian<T>,
    hessian: F::Hessian<T>,
}

plain!([F: Function, T: Plain] LeastSquaresCost<F, T> { weights, invalid, coupled, y, mu, jacobian, hessian });

impl<F: Function, T: Real> LeastSquaresCost<F, T> {
    /// With the weights `W`, a symmetric, positive semidefinite matrix.
    ///
    /// Others are refused by `Problem::on` and by every linearisation: [`OcpError::InvalidWeight`].
    #[must_use]
    pub fn new(weights: &MatrixYY<F, T>) -> Self {
        let mut cost: Self = Zeroable::zeroed();
        cost.set_weights(weights);
        F::jacobian_constants::<T>(&mut cost.jacobian);
        cost
    }

    /// With a weight for each output, from zero on.
    #[must_use]
    pub fn diagonal(weights: &ArrayY<F, T>) -> Self {
        let mut matrix: MatrixYY<F, T> = Zeroable::zeroed();
        for (i, &weight) in weights.as_ref().iter().enumerate() {
            matrix[(i, i)] = weight;
        }
        Self::new(&matrix)
    }

    /// Other weights, as those of [`LeastSquaresCost::new`].
    pub fn set_weights(&mut self, weights: &MatrixYY<F, T>) {
        let elements = || (0..F::Outputs::NY).flat_map(|i| (0..i).map(move |j| (i, j)));
        self.coupled =
            usize::from(elements().any(|(i, j)| weights[(i, j)] != T::ZERO || weights[(j, i)] != T::ZERO));
        self.weights = *weights;
        self.invalid = usize::from(weights::check::<F, T>(weights, self.coupled != 0).is_err());
    }

    /// `μ = W (y − r)`, and `½ (y − r)ᵀ μ`.
    #[inline(always)]
    fn square(&mut self, reference: &[T], stage: usize) -> Result<T, OcpError> {
        let Self { weights, coupled, y, mu, .. } = self;
        for (y, &r) in y.as_mut().iter_mut().zip(reference) {
            *y = *y - r;
        }
        weigh::<F, T>(weights, *coupled, y, mu);
        let products = y.as_ref().iter().zip(mu.as_ref()).map(|(y, mu)| *y * *mu);
        let square = products.fold(T::ZERO, |sum, product| sum + product);
        finite::<F, T>(y, T::from_f64(0.5) * square, stage)
    }
}

/// `μ = W y`
#[inline(always)]
fn weigh<F: Function, T: Real>(
    weights: &MatrixYY<F, T>,
    coupled: usize,
    y: &ArrayY<F, T>,
    mu: &mut ArrayY<F, T>,
) {
    for (k, mu) in mu.as_mut().iter_mut().enumerate() {
        *mu = if coupled == 0 {
            weights[(k, k)] * y[k]
        } else {
            let products = y.as_ref().iter().enumerate().map(|(l, y)| weights[(k, l)] * *y);
            products.fold(T::ZERO, |sum, product| sum + product)
        };
    }
}

/// Subtracts `φ′`, or of a direction `d` `φ″ J d`, times a factor: what the reference changes of
/// `φ(y − r)`.
pub(in crate::ocp) fn refer<F: Function, T: Real>(
    (second, first): (&MatrixYY<F, T>, &ArrayY<F, T>),
    (jacobian, direction): (&F::Jacobian<T>, Option<&ArrayV<F, T>>),
    factor: T,
    to: &mut [T],
) {
    let Some(direction) = direction else {
        to.iter_mut().zip(first.as_ref()).for_each(|(to, &mu)| *to = *to - factor * mu);
        return;
    };
    for ((output, variable), &slope) in F::STRUCTURE.jacobian.iter().zip(jacobian.as_ref()) {
        let along = factor * slope * direction.as_ref().get(variable).copied().unwrap_or(T::ZERO);
        for (k, to) in to.iter_mut().enumerate() {
            *to = *to - second[(k, output)] * along;
        }
    }
}

#[diagnostic::do_not_recommend]
impl<S: Shape, F: Function<Shape = S>, T: Real> Cost<S, T> for LeastSquaresCost<F, T> {
    const REFERENCES: usize = F::Outputs::NY;
    const CONVEX: bool = true;
    const CONVEX_IN_VARIABLES: bool = F::STRUCTURE.hessian.is_empty();
    const ALGEBRAIC: bool = is_algebraic::<F>();

    fn check(&self, there: There) -> Result<(), OcpError> {
        self.check_weights()?;
        there.check::<F>()
    }

    fn check_weights(&self) -> Result<(), OcpError> {
        match self.invalid {
            0 => Ok(()),
            _ => weights::check::<F, T>(&self.weights, self.coupled != 0),
        }
    }

    fn terms(&self, show: Show<'_>) -> fmt::Result {
        show(format_args!("½‖{} − r‖²_W", F::STRUCTURE.name))
    }

    fn pattern(&self, visit: Entries<'_>) -> bool {
        pattern::squares::<F>(self.coupled != 0, visit);
        pattern::curvature::<F>(visit);
        true
    }

    fn name(reference: usize) -> (&'static str, usize) {
        (F::STRUCTURE.name, reference)
    }

    fn value(&mut self, v: &ArrayV<F, T>, reference: &[T], stage: usize) -> Result<T, OcpError> {
        F::value::<T>(v, &mut self.y);
        self.square(reference, stage)
    }

    fn add(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        at: At<'_, T>,
        terms: &mut Terms<'_, T>,
    ) -> Result<T, OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        let value = self.square(reference, at.stage)?;
        let Self { weights, coupled, y, mu, jacobian, hessian, .. } = self;
        let mut square = Square::<F, T> { weights, y, jacobian, at, terms: &mut *terms };
        if *coupled == 0 && !square.has_free() {
            dispatch(square);
        } else {
            square.coupled(&Zeroable::zeroed());
        }
        if at.exact {
            terms.curvature::<F>(v, mu, at.factor, hessian);
        }
        Ok(at.factor * value)
    }

    fn cross(
        &mut self,
        v: &ArrayV<F, T>,
        reference: &[T],
        at: At<'_, T>,
        cross: &mut Cross<'_, T>,
    ) -> Result<(), OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        self.square(reference, at.stage)?;
        let Self { weights, mu, jacobian, hessian, .. } = self;
        cross.gauss_newton::<F>(jacobian, mu, weights, at.factor);
        if at.exact {
            cross.curvature::<F>(v, mu, at.factor, hessian);
        }
        Ok(())
    }

    fn refer(
        &mut self,
        (v, direction): (&ArrayV<F, T>, Option<&ArrayV<F, T>>),
        reference: &[T],
        at: At<'_, T>,
        to: &mut [T],
    ) -> Result<(), OcpError> {
        F::value_jacobian::<T>(v, &mut self.y, &mut self.jacobian);
        self.square(reference, at.stage)?;
        refer::<F, T>((&self.weights, &self.mu), (&self.jacobian, direction), at.factor, to);
        Ok(())
    }
}

/// Adds gradient and Hessian, `JᵀW (y − r)` and `JᵀWJ`; or
/// `Jᵀ W (y − r) − JᵀWJ v = JᵀW (y − r − J v)` from a point `v` on.
pub(in crate::ocp) struct Square<'a, 'b, F: Function, T: Plain> {
    pub weights: &'a MatrixYY<F, T>,
    /// `y − r`
    pub y: &'a ArrayY<F, T>,
    pub jacobian: &'a F::Jacobian<T>,
    pub at: At<'a, T>,
    pub terms: &'a mut Terms<'b, T>,
}

impl<F: Function, T: Real> Square<'_, '_, F, T> {
    /// Where the entries of an output begin and end.
    #[inline(always)]
    fn range(output: usize) -> Range<usize> {
        let begin = |output: usize| F::STRUCTURE.begins.get(output).map_or(0, |&begin| begin as usize);
        begin(output)..begin(output + 1)
    }

    /// One of them, as a position in `(x, w, u, z)` and a value.
    #[inline(always)]
    fn entry(&self, place: usize) -> Option<(usize, T)> {
        let entry = *F::STRUCTURE.by_row.get(place)? as usize;
        let (_, variable) = F::STRUCTURE.jacobian.get(entry)?;
        Some((self.terms.free.position::<F::Shape>(variable)?, *self.jacobian.as_ref().get(entry)?))
    }

    /// The weight of two outputs, without a place for a panic.
    #[inline(always)]
    fn weight(&self, k: usize, l: usize) -> T {
        let weight = self.weights.as_slice().get(l * F::Outputs::NY + k);
        self.at.factor * weight.copied().unwrap_or(T::ZERO)
    }

    /// `y − r`, or `y − r − J v`, of an output.
    #[inline(always)]
    fn moved(&self, output: usize) -> T {
        let mut y = self.y.as_ref().get(output).copied().unwrap_or(T::ZERO);
        for place in Self::range(output) {
            if let Some((i, value)) = self.entry(place)
                && let Some(&v) = self.at.from.get(i)
            {
                y = y - value * v;
            }
        }
        y
    }

    /// Adds what two outputs do to the Hessian.
    #[inline(always)]
    fn curve(&mut self, weight: T, [k, l]: [usize; 2]) {
        for a in Self::range(k) {
            for b in Self::range(l) {
                if let (Some((i, a)), Some((j, b))) = (self.entry(a), self.entry(b))
                    && i >= j
                {
                    self.terms.curve(i, j, weight * a * b);
                }
            }
        }
    }

    /// Adds what an output does to the gradient.
    #[inline(always)]
    fn slope(&mut self, slope: T, output: usize) {
        for place in Self::range(output) {
            if let Some((i, value)) = self.entry(place) {
                self.terms.slope(i, slope * value);
            }
        }
    }

    /// Whether the outputs depend on free parameters.
    #[inline(always)]
    fn has_free(&self) -> bool {
        F::STRUCTURE.blocks[4] < F::STRUCTURE.blocks[5] && self.terms.free.count() > 0
    }

    /// As [`Square::coupled`], over free parameters too.
    fn coupled_with_free(&mut self, mu: &ArrayY<F, T>) {
        let (free, jacobian, from) = (self.terms.free, self.jacobian.as_ref(), self.at.from);
        let entries = || {
            let entries = F::STRUCTURE.jacobian.iter().zip(jacobian);
            entries.filter_map(move |((k, variable), &a)| Some((k, free.position::<F::Shape>(variable)?, a)))
        };
        let mut moved = *self.y;
        for (k, i, a) in entries() {
            if let (Some(y), Some(&v)) = (moved.as_mut().get_mut(k), from.get(i)) {
                *y = *y - a * v;
            }
        }
        let slopes: ArrayY<F, T> = Array::from_fn(|k| {
            let own = self.at.factor * mu.as_ref().get(k).copied().unwrap_or(T::ZERO);
            moved.as_ref().iter().enumerate().fold(own, |sum, (l, &y)| sum + self.weight(k, l) * y)
        });
        for (k, i, a) in entries() {
            self.terms.slope(i, slopes[k] * a);
            for (l, j, b) in entries().filter(|&(_, j, _)| j <= i) {
                self.terms.curve(i, j, self.weight(k, l) * a * b);
            }
        }
    }

    /// With weights between outputs, and `Jᵀ μ` too.
    pub fn coupled(&mut self, mu: &ArrayY<F, T>) {
        if self.has_free() {
            return self.coupled_with_free(mu);
        }
        let moved: ArrayY<F, T> = Array::from_fn(|output| self.moved(output));
        for k in 0..F::Outputs::NY {
            let mut slope = self.at.factor * mu.as_ref().get(k).copied().unwrap_or(T::ZERO);
            for (l, &moved) in moved.as_ref().iter().enumerate() {
                let weight = self.weight(k, l);
                if weight != T::ZERO {
                    slope = slope + weight * moved;
                    self.curve(weight, [k, l]);
                }
            }
            self.slope(slope, k);
        }
    }
}

/// With a weight for each output.
impl<F: Function, T: Real> Kernel for Square<'_, '_, F, T> {
    type Number = T;
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        each_row::<A, _>(&mut self);
    }
}

impl<F: Function, T: Real> AtRow for Square<'_, '_, F, T> {
    const ROWS: Option<usize> = Some(F::Outputs::NY);
    const INSTRUCTIONS: usize = {
        let outputs = if F::Outputs::NY > 0 { F::Outputs::NY } else { 1 };
        let entries = F::STRUCTURE.by_row.len() / outputs + 1;
        4 * entries + 3 * entries * entries
    };
    #[inline(always)]
    fn at<A: Arithmetic>(&mut self, output: usize) {
        let weight = self.weight(output, output);
        if weight != T::ZERO {
            self.slope(weight * self.moved(output), output);
            self.curve(weight, [output, output]);
        }
    }
}
