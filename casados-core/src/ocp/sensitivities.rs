//! How a solution changes with its initial state.

use super::error::{OcpError, Part};
use super::instance::{Initial, Ocp};
use super::linearise::{Curvature, dot};
use super::problem::Formulation;
use crate::linalg::axpy;
use crate::qp::{Bounds, StageDims, part, part_mut};
use crate::scalar::Real;
use crate::shape::Shape;
use alloc::vec::Vec;

/// `dx_k/dx₀` and `du_k/dx₀` of a solution, and the gains of the feedback `u_k + K_k (x − x_k)`.
///
/// Derivatives with respect to parameters are those of states that do not change (`ṗ = 0`): as exact, and nothing else is needed.
#[derive(Clone, Debug)]
pub struct Sensitivities<T> {
    nx: usize,
    nu: usize,
    /// `K`, `dx`, `du`: matrices column after column, one stage after the other.
    gains: Vec<T>,
    x: Vec<T>,
    u: Vec<T>,
    /// `P` of the next stage, `P [A B]`, and `M`.
    work: Vec<T>,
}

/// Active bounds weigh this much, relative to the largest element of the Hessians: what they miss is its inverse.
fn weight<T: Real>() -> T {
    T::ONE / T::from_f64(T::EPSILON).sqrt()
}

impl<T: Real> Sensitivities<T> {
    /// Memory for a problem.
    ///
    /// # Errors
    /// [`OcpError::OutOfMemory`]
    pub fn new<P: Formulation<T>>(ocp: &super::HeapOcp<P, T>) -> Result<Self, OcpError> {
        let (nx, nu, n) = (P::Shape::NX, P::Shape::NU, ocp.intervals());
        let size = nx + nu;
        Ok(Self {
            nx,
            nu,
            gains: zeros(n * nu * nx)?,
            x: zeros((n + 1) * nx * nx)?,
            u: zeros(n * nu * nx)?,
            work: zeros(nx * nx + nx * size + 2 * size * size)?,
        })
    }

    /// `K_k`, `NU × NX`, column after column; empty where there is none.
    #[must_use]
    pub fn gain(&self, stage: usize) -> &[T] {
        part(&self.gains, stage * self.nu * self.nx, self.nu * self.nx)
    }
    /// `dx_k/dx₀`, `NX × NX`, column after column.
    #[must_use]
    pub fn dx(&self, stage: usize) -> &[T] {
        part(&self.x, stage * self.nx * self.nx, self.nx * self.nx)
    }
    /// `du_k/dx₀`, `NU × NX`, column after column.
    #[must_use]
    pub fn du(&self, stage: usize) -> &[T] {
        part(&self.u, stage * self.nu * self.nx, self.nu * self.nx)
    }
}

fn zeros<T: Real>(length: usize) -> Result<Vec<T>, OcpError> {
    let mut memory = Vec::new();
    let bytes = length.saturating_mul(size_of::<T>());
    memory.try_reserve_exact(length).map_err(|_| OcpError::OutOfMemory { bytes })?;
    memory.resize(length, T::ZERO);
    Ok(memory)
}

/// What a bound adds to the Hessian, from its slack, multiplier and penalties: much where it is active, its quadratic penalty where
/// it is violated softly.
fn stiffness<T: Real>(slack: T, multiplier: T, linear: T, quadratic: T, active: T) -> T {
    if !slack.is_finite() {
        T::ZERO
    } else if slack < T::ZERO && linear.is_finite() && -slack > linear - quadratic * slack - multiplier {
        // Of a violation and the force that its multiplier lacks one is zero.
        quadratic
    } else if multiplier > slack {
        active
    } else {
        T::ZERO
    }
}

fn both<T: Real>(bounds: &Bounds<'_, T>, i: usize, value: T, lower: T, upper: T, active: T) -> T {
    let at = |values: &[T]| values.get(i).copied().unwrap_or(T::ZERO);
    if at(bounds.lower) == at(bounds.upper) {
        return active;
    }
    let (below, above) = (value - at(bounds.lower), at(bounds.upper) - value);
    stiffness(below, lower, at(bounds.lower_linear), at(bounds.lower_quadratic), active)
        + stiffness(above, upper, at(bounds.upper_linear), at(bounds.upper_quadratic), active)
}

impl<P: Formulation<T>, T: Real, D: AsRef<[StageDims]>, M: AsRef<[T]> + AsMut<[T]>> Ocp<P, T, D, M> {
    /// How the solution changes with its initial state, where the bounds that are active stay so: the iterate must be a solution, with a
    /// fixed initial state.
    ///
    /// With [`Exact`](super::Exact) Hessians that are not made convex these are derivatives of the solution; with those of Gauss and
    /// Newton they are approximations of the same quality. One Riccati recursion: [`OcpError::Qp`] if the reduced
    /// Hessian is not positive definite.
    ///
    /// # Errors
    /// Those of [`Ocp::linearise`]; [`OcpError::Missing`] if the initial state is not fixed; [`OcpError::Length`] if the memory is of
    /// another problem.
    pub fn differentiate<C: Curvature<P::Dynamics, T>>(
        &mut self,
        curvature: C,
        result: &mut Sensitivities<T>,
    ) -> Result<(), OcpError> {
        if self.initial != Initial::Fixed {
            return Err(OcpError::Missing { part: Part::InitialState, stage: 0 });
        }
        let (nx, nu, n) = (P::Shape::NX, P::Shape::NU, self.intervals());
        let (expected, found) = ((n + 1) * nx * nx, result.x.len());
        if expected != found || result.nu != nu {
            return Err(OcpError::Length { part: Part::Memory, stage: 0, expected, found });
        }
        self.linearise(curvature)?;
        let size = nx + nu;
        let Sensitivities { gains, x, u, work, .. } = result;
        let (p, rest) = work.split_at_mut_checked(nx * nx).unwrap_or_default();
        let (product, rest) = rest.split_at_mut_checked(nx * size).unwrap_or_default();
        let (m, column) = rest.split_at_mut_checked(size * size).unwrap_or_default();
        let mut largest = T::ZERO;
        for stage in self.qp.view().stages() {
            for &value in stage.arrays().hessian {
                largest = value.abs().max(largest);
            }
        }
        let active = weight::<T>() * if largest > T::ZERO { largest } else { T::ONE };
        let (vectors, _) = self.iterate.vectors();
        let ld_stage = crate::qp::pad::<T>(size);
        for (k, (stage, point)) in self.qp.view().stages().zip(self.iterate.stages()).enumerate().rev() {
            let view = stage.arrays();
            let (here, ld) = (view.n, view.ld);
            // M = H + active bounds + [A B]ᵀ P [A B], its lower triangle, column after column.
            for j in 0..here {
                for i in j..here {
                    let value = view.hessian.get(j * ld + i).copied().unwrap_or(T::ZERO);
                    set(m, j * size + i, value);
                }
            }
            let v = part(vectors, k * ld_stage, here);
            for (i, &value) in v.iter().enumerate() {
                let stiff = match i.checked_sub(nx) {
                    // The state that is given does not move in this way.
                    None if k == 0 => T::ZERO,
                    None => both(
                        &stage.x_bounds(),
                        i,
                        value,
                        get(point.x_lower, i),
                        get(point.x_upper, i),
                        active,
                    ),
                    Some(i) => both(
                        &stage.u_bounds(),
                        i,
                        value,
                        get(point.u_lower, i),
                        get(point.u_upper, i),
                        active,
                    ),
                };
                add(m, i * size + i, stiff);
            }
            for (row, (&lower, &upper)) in point.g_lower.iter().zip(point.g_upper).enumerate() {
                let c = part(view.matrix, (view.next + row) * ld, here);
                let stiff = both(&stage.g_bounds(), row, dot(c, v), lower, upper, active);
                if stiff == T::ZERO {
                    continue;
                }
                for j in 0..here {
                    for i in j..here {
                        add(m, j * size + i, stiff * get(c, i) * get(c, j));
                    }
                }
            }
            if k < n {
                // P [A B], a row for each next state: P is symmetric, and rows of [A B] lie side by side.
                product.fill(T::ZERO);
                for (i, row) in product.chunks_exact_mut(size).enumerate() {
                    for l in 0..nx {
                        axpy(get(p, l * nx + i), part(view.matrix, l * ld, here), row);
                    }
                }
                for l in 0..nx {
                    let (ab, row) = (part(view.matrix, l * ld, here), part(product, l * size, here));
                    for j in 0..here {
                        let factor = get(row, j);
                        for i in j..here {
                            add(m, j * size + i, get(ab, i) * factor);
                        }
                    }
                }
                let gain = part_mut(gains, k * nu * nx, nu * nx);
                feedback(m, size, [nx, nu], gain, column).map_err(|(index, pivot)| {
                    OcpError::Qp(crate::qp::QpError::NotConvex { stage: k, index, pivot })
                })?;
            }
            // P = M_xx + M_xu K
            for j in 0..nx {
                for i in j..nx {
                    let mut value = get(m, j * size + i);
                    if k < n {
                        let gain = part(gains, k * nu * nx + j * nu, nu);
                        for (l, &gain) in gain.iter().enumerate() {
                            value = value + get(m, i * size + nx + l) * gain;
                        }
                    }
                    set(p, j * nx + i, value);
                    set(p, i * nx + j, value);
                }
            }
        }
        x.fill(T::ZERO);
        (0..nx).for_each(|i| set(x, i * nx + i, T::ONE));
        for (k, stage) in self.qp.view().stages().enumerate().take(n) {
            let view = stage.arrays();
            let gain = part(gains, k * nu * nx, nu * nx);
            for direction in 0..nx {
                let du = part_mut(u, (k * nx + direction) * nu, nu);
                du.fill(T::ZERO);
                let (before, after) = x.split_at_mut_checked((k + 1) * nx * nx).unwrap_or_default();
                let dx = part(before, (k * nx + direction) * nx, nx);
                for (gain, &dx) in gain.chunks_exact(nu.max(1)).zip(dx) {
                    axpy(dx, gain, du);
                }
                let next = part_mut(after, direction * nx, nx);
                for (next, row) in next.iter_mut().zip(view.matrix.chunks_exact(view.ld.max(1))) {
                    *next = dot(part(row, 0, nx), dx) + dot(part(row, nx, nu), du);
                }
            }
        }
        Ok(())
    }
}

/// `K = −M_uu⁻¹ M_ux` by Cholesky's factorisation without roots; the pivot that is not positive, if there is one.
fn feedback<T: Real>(
    m: &[T],
    size: usize,
    [nx, nu]: [usize; 2],
    gain: &mut [T],
    factors: &mut [T],
) -> Result<(), (usize, f64)> {
    let at = |i: usize, j: usize| j * nu + i;
    for j in 0..nu {
        for i in j..nu {
            set(factors, at(i, j), get(m, (nx + j) * size + nx + i));
        }
    }
    for j in 0..nu {
        let pivot = get(factors, at(j, j));
        let is_positive = pivot > T::ZERO;
        if !is_positive {
            return Err((j, pivot.to_f64()));
        }
        for i in j + 1..nu {
            let factor = get(factors, at(i, j)) / pivot;
            for l in i..nu {
                add(factors, at(l, i), -(factor * get(factors, at(l, j))));
            }
        }
        for i in j + 1..nu {
            set(factors, at(i, j), get(factors, at(i, j)) / pivot);
        }
    }
    for (state, gain) in gain.chunks_exact_mut(nu.max(1)).enumerate() {
        for (i, gain) in gain.iter_mut().enumerate() {
            *gain = -get(m, state * size + nx + i);
        }
        for j in 0..nu {
            for i in j + 1..nu {
                let product = get(factors, at(i, j)) * get(gain, j);
                add(gain, i, -product);
            }
        }
        for j in (0..nu).rev() {
            let mut value = get(gain, j) / get(factors, at(j, j));
            for i in j + 1..nu {
                value = value - get(factors, at(i, j)) * get(gain, i);
            }
            set(gain, j, value);
        }
    }
    Ok(())
}

#[inline(always)]
fn get<T: Real>(values: &[T], index: usize) -> T {
    values.get(index).copied().unwrap_or(T::ZERO)
}
#[inline(always)]
fn set<T: Real>(values: &mut [T], index: usize, value: T) {
    if let Some(element) = values.get_mut(index) {
        *element = value;
    }
}
#[inline(always)]
fn add<T: Real>(values: &mut [T], index: usize, value: T) {
    if let Some(element) = values.get_mut(index) {
        *element = *element + value;
    }
}
