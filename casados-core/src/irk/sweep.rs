//! A step of the forward sweep, panel by panel: from `V_n` to the derivatives of the stages, to `V_{n+1}`, and to what second
//! derivatives need of both.

use super::directions::{Directions, Identity, panel, panel_mut, panels, weight};
use super::evaluate::entries;
use super::record::{Coefficients, Work, copy};
use crate::linalg::{Arithmetic, Kernel, Packet, Planned, dispatch, slot, solve_packets};
use crate::model::{ArrayK, ArrayW, ArrayX, Dae};
use crate::scalar::{Field, Lanes};
use crate::shape::{Array, Plain, Shape};
use bytemuck::Zeroable;
use core::marker::PhantomData;

/// So many strands a sum over all columns has.
pub(super) const STRANDS: usize = 4;

/// Derivatives of one step in directions, as many as there are elements in `R`, in panels.
#[derive(Zeroable)]
#[zeroable(bound = "")]
pub struct Sweep<M: Dae, T: Plain, R: Plain, const S: usize> {
    /// `dx_n/dw` at the start of the step, and at its end.
    v: [ArrayX<M, R>; 2],
    /// Which of them is at the end.
    end: bool,
    /// `d(k, z)/dw` at its stages.
    dy: ArrayK<M, [R; S]>,
    /// Weighted sums over all columns of `dy` and of `V_n`, in strands.
    pub(super) sums: ArrayK<M, [[T; STRANDS]; S]>,
    pub(super) start_sums: ArrayX<M, [T; STRANDS]>,
}
copy!([M: Dae, T: Plain, R: Plain, const S: usize] Sweep<M, T, R, S>);

/// What is done to a panel.
#[derive(Clone, Copy, PartialEq)]
enum Phase {
    /// All of it.
    Whole,
    /// The right-hand side.
    Before,
    /// What comes after the solution.
    After,
}

impl<M: Dae, E: Lanes, R: Array<E>, const S: usize> Sweep<M, E, R, S> {
    /// `V_0`
    pub(crate) fn start<D: Directions<E>>(&mut self, directions: &D) {
        self.end = false;
        let end = R::flat_mut(self.v[0].as_mut());
        dispatch(Start { v: end, rows: M::Shape::NX, directions });
    }

    /// The step that follows, which is linearised; the `first` of the interval or a later one. Whether the derivatives
    /// of the stages satisfy their equations. The rows of `D` for second derivatives go to `curved`.
    pub(crate) fn step<D: Directions<E>>(
        &mut self,
        work: &mut Work<M, E, S>,
        coefficients: &Coefficients<E, S>,
        directions: &D,
        first: bool,
        curved: Option<&mut [E]>,
    ) -> E::Mask {
        self.end = !self.end;
        self.repeat(work, coefficients, directions, first, curved)
    }

    /// The same step again.
    pub(crate) fn repeat<D: Directions<E>>(
        &mut self,
        work: &mut Work<M, E, S>,
        coefficients: &Coefficients<E, S>,
        directions: &D,
        first: bool,
        mut curved: Option<&mut [E]>,
    ) -> E::Mask {
        let mut run = |this: &mut Self, work: &Work<M, E, S>, phase, second| {
            let Self { v, end, dy, sums, start_sums } = this;
            let [start, other] = v;
            let (v, next) = if *end { (start, other) } else { (other, start) };
            dispatch(Step::<M, E, D, S> {
                phase,
                jacobian: work.linear.jacobian.as_ref(),
                factors: work.linear.factors.planned(),
                coefficients,
                h: work.inputs.time.step,
                directions,
                first,
                v: R::flat(v.as_ref()),
                next: R::flat_mut(next.as_mut()),
                dy: R::flat_mut(dy.as_mut().as_flattened_mut()),
                sums: sums.as_mut(),
                start_sums: start_sums.as_mut(),
                curved: curved.as_deref_mut(),
                second,
                model: PhantomData,
            });
        };
        if work.linear.factors.is_planned() {
            run(self, work, Phase::Whole, false);
        } else {
            run(self, work, Phase::Before, false);
            self.solve_columns::<D>(work);
            run(self, work, Phase::After, false);
        }
        let good = work.verify_forward(self, coefficients, directions, false);
        if E::all(good) {
            return good;
        }
        run(self, work, Phase::After, true);
        E::or(good, work.verify_forward(self, coefficients, directions, true))
    }

    /// Solves by the factors of the whole matrix, column by column.
    fn solve_columns<D: Directions<E>>(&mut self, work: &mut Work<M, E, S>) {
        let Work { increment, linear, .. } = work;
        let rows = M::Shape::NK;
        let dy = R::flat_mut(self.dy.as_mut().as_flattened_mut());
        panels!(D::COUNT, E, column, W => {
            let (packets, _) = panel_mut::<E, W>(dy, column, rows * S).as_chunks_mut::<S>();
            for c in 0..W {
                for (to, from) in increment.as_mut().iter_mut().zip(packets.iter()) {
                    *to = from.map(|row| [row[c]]);
                }
                linear.factors.solve(increment);
                for (to, from) in packets.iter_mut().zip(increment.as_ref()) {
                    for (to, [from]) in to.iter_mut().zip(from) {
                        to[c] = *from;
                    }
                }
            }
        });
    }

    /// Writes `V_{n+1}`.
    pub(crate) fn write_end<D: Directions<E>>(&self, to: &mut impl Target<E>) {
        let (v, rows) = (self.v.get(usize::from(self.end)).map(|v| R::flat(v.as_ref())), M::Shape::NX);
        dispatch(Write::<E, D, _, S> {
            v,
            dy: &[],
            height: 0,
            first: 0,
            rows,
            weights: None,
            to,
            directions: PhantomData,
        });
    }

    /// Writes the derivatives of `x` at the point of the step where the weights, `h` included, are `weights`.
    pub(crate) fn write_differential<D: Directions<E>>(&self, weights: &[E; S], to: &mut impl Target<E>) {
        let (v, rows) = (self.v.get(usize::from(!self.end)).map(|v| R::flat(v.as_ref())), M::Shape::NX);
        let (dy, weights) = (R::flat(self.dy.as_ref().as_flattened()), Some(weights));
        dispatch(Write::<E, D, _, S> {
            v,
            dy,
            height: M::Shape::NK * S,
            first: 0,
            rows,
            weights,
            to,
            directions: PhantomData,
        });
    }

    /// Writes the derivatives of `z` at the point of the step where the Lagrange polynomials are `lagrange`.
    pub(crate) fn write_algebraic<D: Directions<E>>(&self, lagrange: &[E; S], to: &mut impl Target<E>) {
        let (first, rows) = (M::Shape::NX, M::Shape::NZ);
        let (dy, weights) = (R::flat(self.dy.as_ref().as_flattened()), Some(lagrange));
        dispatch(Write::<E, D, _, S> {
            v: None,
            dy,
            height: M::Shape::NK * S,
            first,
            rows,
            weights,
            to,
            directions: PhantomData,
        });
    }
}

impl<M: Dae, E: Lanes, const S: usize> Sweep<M, E, ArrayW<M, E>, S> {
    /// Rows of `D` at a stage for some variables, over all directions.
    pub(crate) fn write_rows(
        &self,
        coefficients: &Coefficients<E, S>,
        h: E,
        stage: usize,
        variables: &[u32],
        d: &mut [ArrayW<M, E>],
    ) {
        let v = self.v.get(usize::from(!self.end)).map(|v| Array::flat(v.as_ref()));
        let (v, dy) = (v.unwrap_or_default(), Array::flat(self.dy.as_ref().as_flattened()));
        dispatch(WriteRows::<M, E, S> { v, dy, coefficients, h, stage, variables, d });
    }
}

/// See [`Sweep::write_rows`].
struct WriteRows<'a, M: Dae, E: Lanes, const S: usize> {
    v: &'a [E],
    dy: &'a [E],
    coefficients: &'a Coefficients<E, S>,
    h: E,
    stage: usize,
    variables: &'a [u32],
    d: &'a mut [ArrayW<M, E>],
}

impl<M: Dae, E: Lanes, const S: usize> Kernel for WriteRows<'_, M, E, S> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { v, dy, coefficients, h, stage, variables, d } = self;
        let (nx, nz, nk) = (M::Shape::NX, M::Shape::NZ, M::Shape::NK);
        let (zero, one) = (E::from_f64(0.0), E::from_f64(1.0));
        for &variable in variables {
            let variable = variable as usize;
            let Some(row) = d.get_mut(variable) else { continue };
            row.as_mut().fill(zero);
            // A state or an input that the model does not feel moves with itself.
            let own = if variable < nx {
                None
            } else if variable < 2 * nx {
                Some(variable - nx)
            } else {
                variable.checked_sub(nx + nz).filter(|_| variable >= 2 * nx + nz)
            };
            let own = own.filter(|&own| own >= nx || Identity::<M>::column(own).is_none());
            if let Some(element) = own.and_then(|own| row.as_mut().get_mut(own)) {
                *element = one;
            }
            if variable >= 2 * nx + nz {
                continue;
            }
            let unknown = if variable < nx { variable } else { variable - nx };
            panels!(M::STRUCTURE.directions.len(), E, column, W => {
                let (dy, _) = panel::<E, W>(dy, column, nk * S).as_chunks::<S>();
                let v = panel::<E, W>(v, column, nx);
                let mut values = [zero; W];
                if let Some(packet) = dy.get(unknown) {
                    match (v.get(unknown), coefficients.a.get(stage)) {
                        (Some(v), Some(a)) if (nx..2 * nx).contains(&variable) => {
                            values = *v;
                            for (&a, dk) in a.iter().zip(packet) {
                                A::subtract_row(&mut values, -(h * a), dk);
                            }
                        }
                        _ => values = packet.get(stage).copied().unwrap_or(values),
                    }
                }
                for (c, &value) in values.iter().enumerate() {
                    let direction = M::STRUCTURE.directions.get(column + c);
                    if let Some(element) =
                        direction.and_then(|&direction| row.as_mut().get_mut(direction as usize))
                    {
                        *element = value;
                    }
                }
            });
        }
    }
}

/// See [`Sweep::start`].
struct Start<'a, E, D> {
    v: &'a mut [E],
    rows: usize,
    directions: &'a D,
}

impl<E: Lanes, D: Directions<E>> Kernel for Start<'_, E, D> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { v, rows, directions } = self;
        v.fill(E::from_f64(0.0));
        panels!(D::COUNT, E, column, W => {
            for (index, row) in panel_mut::<E, W>(v, column, rows).iter_mut().enumerate() {
                directions.add(index, E::from_f64(1.0), column, row);
            }
        });
    }
}

/// See [`Sweep::step`].
struct Step<'a, M, E, D, const S: usize> {
    phase: Phase,
    jacobian: &'a [[E; S]],
    factors: Planned<'a, E, S>,
    coefficients: &'a Coefficients<E, S>,
    h: E,
    directions: &'a D,
    first: bool,
    v: &'a [E],
    next: &'a mut [E],
    dy: &'a mut [E],
    sums: &'a mut [[[E; STRANDS]; S]],
    start_sums: &'a mut [[E; STRANDS]],
    curved: Option<&'a mut [E]>,
    second: bool,
    model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> Kernel for Step<'_, M, E, D, S> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(mut self) {
        if self.phase != Phase::Before {
            self.sums.fill([[E::from_f64(0.0); STRANDS]; S]);
            self.start_sums.fill([E::from_f64(0.0); STRANDS]);
        }
        panels!(D::COUNT, E, column, W => self.panel::<A, W>(column));
    }
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> Step<'_, M, E, D, S> {
    #[inline(always)]
    fn panel<A: Arithmetic, const W: usize>(&mut self, column: usize) {
        let (nx, nk) = (M::Shape::NX, M::Shape::NK);
        let v = panel::<E, W>(self.v, column, nx);
        let (dy, _) = panel_mut::<E, W>(self.dy, column, nk * S).as_chunks_mut::<S>();
        if self.phase != Phase::After {
            let right = RightHandSide::<M, E, D, S> {
                jacobian: self.jacobian,
                directions: self.directions,
                first: self.first,
                model: PhantomData,
            };
            right.panel::<A, W>(v, dy, column);
        }
        if self.phase == Phase::Whole {
            if const { size_of::<E>() > 8 && S > 2 && W == 4 } {
                // Four columns of all stages would not fit the registers.
                solve_packets::<A, E, [E; W], S, 2>(self.factors, dy, 0);
                solve_packets::<A, E, [E; W], S, 2>(self.factors, dy, 2);
            } else {
                solve_packets::<A, E, [E; W], S, W>(self.factors, dy, 0);
            }
        }
        if self.phase == Phase::Before {
            return;
        }
        let mut weights = [E::from_f64(0.0); W];
        for (w, to) in weights.iter_mut().enumerate() {
            *to = -weight::<E>(column + w, self.second);
        }
        for (sums, rows) in self.sums.iter_mut().zip(dy.iter()) {
            for (strands, row) in sums.iter_mut().zip(rows) {
                accumulate::<A, E, W>(strands, &weights, row);
            }
        }
        for (strands, row) in self.start_sums.iter_mut().zip(v) {
            accumulate::<A, E, W>(strands, &weights, row);
        }
        let mut b = self.coefficients.b;
        for b in &mut b {
            *b = -(self.h * *b);
        }
        for ((to, from), dk) in panel_mut::<E, W>(self.next, column, nx).iter_mut().zip(v).zip(dy.iter()) {
            let mut row = *from;
            for (&b, dk) in b.iter().zip(dk) {
                A::subtract_row(&mut row, b, dk);
            }
            *to = row;
        }
        if let Some(curved) = &mut self.curved {
            let count = M::STRUCTURE.curved.len();
            let (d, _) = panel_mut::<E, W>(curved, column, count * S).as_chunks_mut::<S>();
            let (a, h) = (&self.coefficients.a, self.h);
            Curved::<M, E, D, S> { a, h, directions: self.directions, model: PhantomData }
                .panel::<A, W>(v, dy, d, column);
        }
    }
}

/// `strands −= weights · row`, as far apart as the strands are.
#[inline(always)]
fn accumulate<A: Arithmetic, E: Field, const W: usize>(
    strands: &mut [E; STRANDS],
    weights: &[E; W],
    row: &[E; W],
) {
    if const { W == 8 } {
        let (Some(weights), Some(row)) = (weights.first_chunk::<8>(), row.first_chunk::<8>()) else { return };
        let [w0, w1, w2, w3, w4, w5, w6, w7] = *weights;
        let [r0, r1, r2, r3, r4, r5, r6, r7] = *row;
        A::subtract_products(strands, &[w0, w1, w2, w3], &[r0, r1, r2, r3]);
        A::subtract_products(strands, &[w4, w5, w6, w7], &[r4, r5, r6, r7]);
    } else {
        for ((strand, &weight), &element) in strands.iter_mut().zip(weights).zip(row) {
            *strand = A::subtract(*strand, weight, element);
        }
    }
}

/// `−(f_x,i V_n + f_w,i)`, equations in their slots.
struct RightHandSide<'a, M, E, D, const S: usize> {
    jacobian: &'a [[E; S]],
    directions: &'a D,
    first: bool,
    model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> RightHandSide<'_, M, E, D, S> {
    #[inline(always)]
    fn panel<A: Arithmetic, const W: usize>(&self, v: &[[E; W]], dy: &mut [Packet<E, S, W>], column: usize) {
        let Self { jacobian, directions, first, .. } = *self;
        let (structure, nx, zero) = (&M::STRUCTURE, M::Shape::NX, E::from_f64(0.0));
        let blocks = structure.blocks;
        dy.fill([[zero; W]; S]);
        if first {
            // The rows of V_0 are the directions.
            for (r, c, values) in entries(structure, jacobian, blocks[1], blocks[2]) {
                let Some(packet) = dy.get_mut(slot::<M>(r)) else { continue };
                for (row, &value) in packet.iter_mut().zip(values) {
                    directions.add(c - nx, -value, column, row);
                }
            }
        } else {
            // Row by row, each in registers.
            let mut packet = [[zero; W]; S];
            let mut entries = entries(structure, jacobian, blocks[1], blocks[2]).peekable();
            while let Some((r, c, values)) = entries.next() {
                if let Some(v) = v.get(c - nx) {
                    for (row, &value) in packet.iter_mut().zip(values) {
                        A::subtract_row(row, value, v);
                    }
                }
                if entries.peek().is_none_or(|next| next.0 != r) {
                    if let Some(to) = dy.get_mut(slot::<M>(r)) {
                        *to = packet;
                    }
                    packet = [[zero; W]; S];
                }
            }
        }
        // Of the first variable that is a direction, `u_0`: columns of the Jacobian minus this are `w`.
        let shift = nx + M::Shape::NZ;
        for (r, c, values) in entries(structure, jacobian, blocks[3], blocks[5]) {
            let Some(packet) = dy.get_mut(slot::<M>(r)) else { continue };
            for (row, &value) in packet.iter_mut().zip(values) {
                directions.add(c - shift, -value, column, row);
            }
        }
    }
}

/// The rows of `D` at all stages that enter second derivatives.
struct Curved<'a, M, E, D, const S: usize> {
    a: &'a [[E; S]; S],
    h: E,
    directions: &'a D,
    model: PhantomData<M>,
}

impl<M: Dae, E: Lanes, D: Directions<E>, const S: usize> Curved<'_, M, E, D, S> {
    #[inline(always)]
    fn panel<A: Arithmetic, const W: usize>(
        &self,
        v: &[[E; W]],
        dy: &[Packet<E, S, W>],
        d: &mut [Packet<E, S, W>],
        column: usize,
    ) {
        let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
        for (&variable, d) in M::STRUCTURE.curved.iter().zip(d) {
            let variable = variable as usize;
            if variable < nx {
                if let Some(dk) = dy.get(variable) {
                    *d = *dk;
                }
            } else if variable < 2 * nx {
                let (Some(dk), Some(v)) = (dy.get(variable - nx), v.get(variable - nx)) else { continue };
                for (d, a) in d.iter_mut().zip(self.a) {
                    let mut row = *v;
                    for (&a, dk) in a.iter().zip(dk) {
                        A::subtract_row(&mut row, -(self.h * a), dk);
                    }
                    *d = row;
                }
            } else if variable < 2 * nx + nz {
                if let Some(dz) = dy.get(variable - nx) {
                    *d = *dz;
                }
            } else {
                for d in d {
                    *d = [E::from_f64(0.0); W];
                    self.directions.add(variable - nx - nz, E::from_f64(1.0), column, d);
                }
            }
        }
    }
}

/// Where derivatives are written.
pub(crate) trait Target<E> {
    /// The column of a matrix that belongs to a column of the panels.
    fn column(&mut self, column: usize) -> &mut [E];
}

/// `V + Σ_i weight_i dy_i`, panels to matrices.
struct Write<'a, E, D, G, const S: usize> {
    v: Option<&'a [E]>,
    dy: &'a [E],
    /// The elements of a column of `dy`, and the first of its unknowns that is written.
    height: usize,
    first: usize,
    rows: usize,
    weights: Option<&'a [E; S]>,
    to: &'a mut G,
    directions: PhantomData<D>,
}

impl<E: Lanes, D: Directions<E>, G: Target<E>, const S: usize> Kernel for Write<'_, E, D, G, S> {
    type Output = ();
    #[inline(always)]
    fn run<A: Arithmetic>(self) {
        let Self { v, dy, height, first, rows, weights, to, .. } = self;
        panels!(D::COUNT, E, column, W => {
            let v = v.map(|v| panel::<E, W>(v, column, rows));
            let (packets, _) = panel::<E, W>(dy, column, height).as_chunks::<S>();
            for c in 0..W {
                for (row, to) in to.column(column + c).iter_mut().enumerate() {
                    let mut value = E::from_f64(0.0);
                    if let Some(v) = v.and_then(|v| v.get(row)) {
                        value = v[c];
                    }
                    if let (Some(weights), Some(packet)) = (weights, packets.get(first + row)) {
                        for (&weight, dy) in weights.iter().zip(packet) {
                            value = A::subtract(value, -weight, dy[c]);
                        }
                    }
                    *to = value;
                }
            }
        });
    }
}
