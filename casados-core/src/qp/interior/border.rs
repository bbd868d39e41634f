//! Newton's equations with parameters `q = (θ, w)`: multipliers of periodic states, and shared
//! controls.
//!
//! ```text
//! cost to go of stage k   ½ xᵀPx + xᵀΓq + ½ qᵀSq + pᵀx + sᵀq        Γ_N = (−E, 0)
//! at the first stage      [P₀  Γ₀ + E] [x₀]     [p₀   ]
//!                         [ ·    S   ] [q ] = − [s + c]            c = (x₀ − x_N, 0)
//! ```
//!
//! Each parameter is a further right-hand side on the way back, and the way forth is gone once. `E`
//! has a column for each periodic state; a shared control has its columns of `M` at every stage.
//! Inertia adds up (E. V. Haynsworth, Linear Algebra Appl. 1, 1968): the step is one of a minimum
//! where pivots of controls and of the border together have as many negative signs as there are
//! conditions.

use super::coupling::{Coupling, SIDE};
use super::kernels::{Columns, Part, Source, product};
use super::riccati::{Equations, Riccati};
use super::shared::Shared;
use super::symmetric::Symmetric;
use super::vector::add_scaled;
use crate::qp::element::{add, set};
use crate::qp::error::QpError;
use crate::qp::layout::{Place, Places, assign, pad, part, part_mut};
use crate::qp::{QpView, marked};
use crate::scalar::{Packed, Piece, Real};
use core::marker::PhantomData;
use core::ops::Range;

/// Solves Newton's equations with the parameters; see [`Riccati::solve`].
///
/// # Errors
/// [`QpError::NotConvex`] where the inertia is not that of a minimum.
pub fn solve<T: Real, E: Packed<T>>(
    coupling: &mut Coupling<'_, T>,
    riccati: &mut Riccati<'_, T>,
    equations: Equations<'_, T>,
    factor: bool,
    step: &mut [T],
) -> Result<(), QpError> {
    let mut result = Ok(());
    let register = PhantomData::<E>;
    E::vectorize(Solve { coupling, riccati, equations, factor, step, result: &mut result, register });
    result
}

/// The solve as a function of its own.
struct Solve<'s, 'a, 'c, T, E> {
    coupling: &'s mut Coupling<'c, T>,
    riccati: &'s mut Riccati<'a, T>,
    equations: Equations<'s, T>,
    factor: bool,
    step: &'s mut [T],
    result: &'s mut Result<(), QpError>,
    register: PhantomData<E>,
}

impl<T: Real, E: Packed<T>> Piece for Solve<'_, '_, '_, T, E> {
    #[inline(always)]
    fn run(self) {
        let Self { coupling, riccati, equations, factor, step, result, .. } = self;
        let (length, shared) = (riccati.end.v, coupling.shared);
        let mut apart = Shared::new(shared, coupling.columns, length);
        *result = riccati.backward::<E>(&equations, factor, step, &mut apart);
        if result.is_err() {
            return;
        }
        let Equations { qp, dynamics, .. } = equations;
        assign(coupling.first, riccati.g);
        if factor {
            coupling.schur.fill(T::ZERO);
            coupling.offset.fill(T::ZERO);
            for begin in (0..coupling.count).step_by(SIDE) {
                let end = (begin + SIDE).min(coupling.count);
                coupling.eliminate::<E>(qp, riccati, dynamics, begin..end);
            }
            coupling.complement(qp, riccati);
        }
        coupling.gather(qp, riccati);
        *result = coupling.solve_border(riccati, factor);
        if result.is_ok() {
            coupling.spread(qp, riccati);
            riccati.forward::<E>(&equations, step);
        }
    }
}

/// `aᵀ S b` with the signs `S` of pivots.
#[inline(always)]
fn signed<T: Real>(a: &[T], b: &[T], inverse: &[T]) -> T {
    let products = a.iter().zip(b).zip(inverse);
    products.fold(
        T::ZERO,
        |sum, ((&a, &b), &inverse)| {
            if inverse < T::ZERO { sum - a * b } else { sum + a * b }
        },
    )
}

impl<T: Real> Coupling<'_, T> {
    /// The right-hand sides of some parameters on their way back, side by side: their columns of
    /// `Γ`, and what residuals of the dynamics add to `s`.
    #[inline(always)]
    fn eliminate<E: Packed<T>>(
        &mut self,
        qp: QpView<'_, T>,
        riccati: &mut Riccati<'_, T>,
        dynamics: &[T],
        parameters: Range<usize>,
    ) {
        let nx0 = self.first.len();
        let last = qp.dims.len().saturating_sub(1);
        self.minus.fill(T::ZERO);
        for place in Places::<T>::ending(qp.dims, riccati.end).rev() {
            let Place { nx, n, ld, next, .. } = place;
            for (g, c) in self.group.chunks_exact_mut(ld.max(1)).zip(parameters.clone()) {
                g.fill(T::ZERO);
                match c.checked_sub(self.conditions) {
                    Some(control) => assign(g, part(self.columns, control * riccati.end.v + place.v, ld)),
                    None if place.stage == last => {
                        marked(self.periodic).nth(c).into_iter().for_each(|state| set(g, state, -T::ONE));
                    }
                    None => {}
                }
            }
            let matrix = Columns { data: part(qp.data, place.data, place.matrix()), ld };
            let minus = Columns { data: &*self.minus, ld: SIDE };
            let size = (n, 0..parameters.len(), next);
            product::<T, E>(self.group, ld, Source::Target, matrix, minus, size, Part::Full);
            // `γ₊ᵀ r`
            let r = part(dynamics, place.dynamics, next);
            for (minus, &r) in self.minus.as_chunks::<SIDE>().0.iter().zip(r) {
                let offsets = self.offset.get_mut(parameters.clone()).unwrap_or_default();
                offsets.iter_mut().zip(minus).for_each(|(offset, &minus)| *offset = *offset - minus * r);
            }
            for (index, c) in parameters.clone().enumerate() {
                self.eliminate_controls(&place, riccati, c, index);
            }
            let panel = Columns { data: part(riccati.panels, place.factor, ld * place.nu), ld };
            let signed = Columns { data: &*self.minus, ld: SIDE };
            let size = (nx, 0..parameters.len(), place.nu);
            product::<T, E>(self.group, ld, Source::Target, panel, signed, size, Part::Full);
            for (index, g) in self.group.chunks_exact(ld.max(1)).take(parameters.len()).enumerate() {
                for (minus, &g) in self.minus.as_chunks_mut::<SIDE>().0.iter_mut().zip(part(g, 0, nx)) {
                    set(minus, index, -g);
                }
            }
            if place.stage == 0 {
                for (index, c) in parameters.clone().enumerate() {
                    assign(part_mut(self.gamma, c * nx0, nx0), part(self.group, index * ld, nx0));
                }
            }
        }
    }

    /// `y = L⁻¹ g_u` of a parameter and a stage, which is left with the signs of pivots where `−γ₊`
    /// was, and adds what belongs to shared controls to `S`.
    #[inline(always)]
    fn eliminate_controls(&mut self, place: &Place, riccati: &Riccati<'_, T>, c: usize, index: usize) {
        let (Place { nx, nu, ld, .. }, length, count) = (*place, riccati.end.v, self.count);
        let begin = place.v + nx;
        let panel = part(riccati.panels, place.factor, ld * nu);
        let g = part(self.group, index * ld + nx, nu);
        let y = part_mut(self.eliminated, c * length + begin, nu);
        assign(y, g);
        for (i, &inverse) in part(riccati.inverse, begin, nu).iter().enumerate() {
            let (own, below) = y.split_at_mut_checked(i + 1).unwrap_or_default();
            let Some(own) = own.last_mut() else { break };
            let signed = *own * inverse;
            *own = if inverse < T::ZERO { -signed } else { signed };
            add_scaled(below, -signed, part(panel, i * ld + nx + i + 1, below.len()));
            set(self.minus, i * SIDE + index, signed);
        }
        // Rows of shared controls were passed by: they belong to `S`, whose other half comes with
        // the other column. What `M` has of both counts once.
        let columns = match c.checked_sub(self.conditions) {
            Some(control) => part(self.columns, control * length + begin, nu),
            None => &[],
        };
        for (w, j) in marked(self.shared).enumerate().take_while(|(_, j)| *j < nu) {
            let (other, value) = (self.conditions + w, y.get(j).copied().unwrap_or(T::ZERO));
            let of_both = columns.get(j).copied().unwrap_or(T::ZERO);
            let value = if c < other { value - of_both } else { value };
            let value = if c == other { value + value - of_both } else { value };
            add(self.schur, c.min(other) * count + c.max(other), value);
            set(y, j, T::ZERO);
        }
    }

    /// Subtracts from `S` what the elimination of all controls leaves.
    #[inline(always)]
    fn complement(&mut self, qp: QpView<'_, T>, riccati: &Riccati<'_, T>) {
        let (length, count) = (riccati.end.v, self.count);
        for place in Places::<T>::new(qp.dims) {
            let begin = place.v + place.nx;
            for (i, &inverse) in part(riccati.inverse, begin, place.nu).iter().enumerate() {
                let own = part_mut(self.right, 0, count);
                let elements = self.eliminated.chunks_exact(length.max(1));
                for (own, y) in own.iter_mut().zip(elements) {
                    *own = y.get(begin + i).copied().unwrap_or(T::ZERO);
                }
                for (b, column) in self.schur.chunks_exact_mut(count.max(1)).enumerate() {
                    let Some((&factor, _)) = own.get(b..).and_then(<[T]>::split_first) else { break };
                    let factor = if inverse < T::ZERO { factor } else { -factor };
                    let (own, column) = (part(own, b, count - b), part_mut(column, b, count - b));
                    add_scaled(column, factor, own);
                }
            }
        }
    }

    /// `s`, from what the way back has left.
    fn gather(&mut self, qp: QpView<'_, T>, riccati: &mut Riccati<'_, T>) {
        assign(self.linear, self.offset);
        let length = riccati.end.v;
        for place in Places::<T>::new(qp.dims) {
            let (begin, nu) = (place.v + place.nx, place.nu);
            let y = part_mut(riccati.y, begin, nu);
            for (w, j) in marked(self.shared).enumerate().take_while(|(_, j)| *j < nu) {
                add(self.linear, self.conditions + w, y.get(j).copied().unwrap_or(T::ZERO));
                set(y, j, T::ZERO);
            }
            let inverse = part(riccati.inverse, begin, nu);
            for (c, linear) in self.linear.iter_mut().enumerate() {
                *linear = *linear - signed(part(self.eliminated, c * length + begin, nu), y, inverse);
            }
        }
    }

    /// The first state and the changes of the parameters.
    fn solve_border(&mut self, riccati: &Riccati<'_, T>, factor: bool) -> Result<(), QpError> {
        let (nx, n) = (self.free, self.free + self.count);
        if factor {
            self.write_border(riccati);
        }
        for (right, &p) in self.right.iter_mut().zip(&*self.first).take(nx) {
            *right = -p;
        }
        for (c, &linear) in self.linear.iter().enumerate() {
            let gap = self.residual.get(c).copied().unwrap_or(T::ZERO);
            set(self.right, nx + c, -(linear + gap));
        }
        let noise = T::from_f64(T::EPSILON);
        if factor {
            let inertia = Symmetric::factor(self.matrix, n, self.exchanged, noise);
            let negative = inertia.negative + riccati.negative;
            if negative > self.conditions || negative + inertia.vanished < self.conditions {
                return Err(QpError::NotConvex { stage: 0, index: 0, pivot: -1.0 });
            }
        }
        Symmetric::new(self.matrix, n, self.exchanged).solve(part_mut(self.right, 0, n));
        assign(self.step, self.right.get(nx..).unwrap_or_default());
        Ok(())
    }

    /// `[P₀  Γ₀ + E; · S]`, the lower triangle.
    fn write_border(&mut self, riccati: &Riccati<'_, T>) {
        let (nx, nx0, count) = (self.free, self.first.len(), self.count);
        let (n, ld) = (nx + count, pad::<T>(nx0));
        self.matrix.fill(T::ZERO);
        for j in 0..nx {
            let p = riccati.p.get(j * ld..).unwrap_or_default();
            for (i, &p) in p.iter().enumerate().take(nx).skip(j) {
                set(self.matrix, j * n + i, p);
            }
            for c in 0..count {
                let gamma = self.gamma.get(c * nx0 + j).copied().unwrap_or(T::ZERO);
                set(self.matrix, j * n + nx + c, gamma);
            }
        }
        for (c, i) in marked(self.periodic).enumerate().filter(|_| nx > 0) {
            add(self.matrix, i * n + nx + c, T::ONE);
        }
        for b in 0..count {
            for c in b..count {
                let s = self.schur.get(b * count + c).copied().unwrap_or(T::ZERO);
                set(self.matrix, (nx + b) * n + nx + c, s);
            }
        }
    }

    /// What the way forth needs of the first state and the parameters.
    fn spread(&self, qp: QpView<'_, T>, riccati: &mut Riccati<'_, T>) {
        let length = riccati.end.v;
        for (c, &step) in self.step.iter().enumerate() {
            for (y, &own) in riccati.y.iter_mut().zip(part(self.eliminated, c * length, length)) {
                *y = *y + step * own;
            }
        }
        let controls = self.step.get(self.conditions..).unwrap_or_default();
        for place in Places::<T>::new(qp.dims) {
            let y = part_mut(riccati.y, place.v + place.nx, place.nu);
            for (j, &step) in marked(self.shared).zip(controls) {
                set(y, j, -step);
            }
        }
        assign(part_mut(riccati.y, 0, self.free), self.right);
    }
}
