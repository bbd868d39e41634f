//! The iterations.

use super::newton::{Iterate, Largest, Terms};
use super::options::InteriorPointOptions;
use super::riccati::First;
use super::vector::largest_size;
use crate::qp::error::{QpError, Side};
use crate::qp::layout::{Places, assign, part, part_mut};
use crate::qp::problem::{QpView, Row};
use crate::qp::solution::SolutionView;
use crate::qp::solver::Start;
use crate::qp::statistics::Statistics;
use crate::scalar::{Packed, Real, Registers};

/// One run of the method.
pub struct Run<'r, 'a, 's, T> {
    pub iterate: &'r mut Iterate<'a, T>,
    pub options: &'r InteriorPointOptions,
    pub limits: Limits<T>,
    pub start: Start,
    /// The size of penalties.
    pub scale: T,
    pub solution: &'r mut SolutionView<'s, T>,
    pub result: &'r mut Result<Statistics, QpError>,
}

impl<T: Real> Registers<T> for Run<'_, '_, '_, T> {
    #[inline(always)]
    fn run<E: Packed<T>>(self) {
        let Self { iterate, options, limits, start, scale, solution, result } = self;
        let tries = if start == Start::Warm { options.active_sets.min(options.max_iterations) } else { 0 };
        // No closure: it would be compiled for another machine.
        *result = match iterate.by_active_sets::<E>(tries, &limits, solution) {
            Ok(statistics) => Ok(statistics),
            Err(statistics) => {
                iterate.begin::<E>(options, start, scale, solution);
                iterate.iterations::<E>(statistics, options, &limits, solution)
            }
        };
        iterate.store(solution);
    }
}

/// A step of the corrector below this is not taken.
const SHORT: f64 = 0.3;

/// The terms of the residuals are computed again where `μ` is this part of what it was.
const OLD: f64 = 0.01;

/// What residuals are to be below.
pub struct Limits<T> {
    absolute: Terms<T>,
    relative: T,
}

impl<T: Real> Limits<T> {
    /// At least a tolerance that is asked for; with large penalties, forces are measured in their units.
    pub fn new(options: &InteriorPointOptions, relaxed: T, scale: T) -> Self {
        let values = T::from_f64(options.tolerance).max(relaxed);
        let absolute = Terms { forces: values * scale, values };
        Self { absolute, relative: T::from_f64(options.relative_tolerance) }
    }

    /// Of residuals with such terms.
    pub fn of(&self, terms: Terms<T>) -> Terms<T> {
        Terms {
            forces: (self.relative * terms.forces).max(self.absolute.forces),
            values: (self.relative * terms.values).max(self.absolute.values),
        }
    }

    /// Whether residuals with such terms are small.
    pub fn hold(&self, residuals: Largest<T>, terms: Terms<T>) -> bool {
        let Largest { stationarity, dynamics, inequalities, complementarity } = residuals;
        let Terms { forces, values } = self.of(terms);
        stationarity <= forces && complementarity <= forces && dynamics <= values && inequalities <= values
    }
}

/// Slacks and multipliers keep at least this part of what they have, or, near the solution, `μ`.
const BOUNDARY: f64 = 0.005;

impl<T: Real> Iterate<'_, T> {
    /// States and controls of a solution.
    pub fn take_point(&mut self, solution: &SolutionView<'_, T>) {
        for place in Places::<T>::new(self.qp.dims) {
            assign(part_mut(self.v, place.row, place.n), part(solution.v, place.v, place.n));
        }
    }

    /// The state at the start, if it is given.
    pub fn give_initial_state(&mut self) {
        if let (First::Fixed, Some(stage)) = (self.first, self.qp.stage(0)) {
            let x0 = stage.x_bounds().lower;
            assign(part_mut(self.v, 0, x0.len()), x0);
        }
    }

    #[inline(always)]
    fn begin<E: Packed<T>>(
        &mut self,
        options: &InteriorPointOptions,
        start: Start,
        scale: T,
        solution: &mut SolutionView<'_, T>,
    ) {
        if start == Start::Warm {
            self.take_point(solution);
        }
        self.give_initial_state();
        self.evaluate_values::<E>();
        let cold = (T::from_f64(options.start_mu) * scale).sqrt();
        let distance = match start {
            // The farther it is from being feasible, the less its slacks and multipliers mean.
            Start::Warm => {
                let gap = largest_size::<T, E>(self.dynamics).max(self.sides.violation());
                let distance = T::from_f64(options.warm_distance).max(gap);
                if distance < cold { distance } else { cold }
            }
            Start::Cold => cold,
        };
        self.sides.begin(start, distance, solution);
        // Only now are slacks what they are.
        let _ = self.evaluate::<E>(solution.dynamics);
        self.set_compliance();
    }

    #[inline(always)]
    fn iterations<E: Packed<T>>(
        &mut self,
        mut statistics: Statistics,
        options: &InteriorPointOptions,
        limits: &Limits<T>,
        solution: &mut SolutionView<'_, T>,
    ) -> Result<Statistics, QpError> {
        let (mut short, mut refine, mut share) = (0, false, T::from_f64(0.01));
        let mut known = self.mu;
        let failure = loop {
            let mut residuals = self.residuals::<E>();
            let small = limits.hold(residuals, self.terms);
            // Terms change on the way.
            let old = limits.relative > T::ZERO && self.mu < T::from_f64(OLD) * known;
            if small || old {
                // What is known of the residuals is what steps should have left of them: now they are computed.
                let objective = self.evaluate::<E>(solution.dynamics);
                (residuals, known) = (self.residuals::<E>(), self.mu);
                (residuals.inequalities, residuals.complementarity) = self.sides.judge();
                if limits.hold(residuals, self.terms) {
                    (statistics.objective, statistics.residuals) = (objective.to_f64(), residuals.into());
                    return Ok(statistics);
                }
                let Terms { forces, values } = limits.of(self.terms);
                let apart = residuals.inequalities > values || residuals.complementarity > forces;
                if small && apart {
                    // Between two pieces of a penalty multipliers are off by the root of their products.
                    share = share * T::from_f64(0.01);
                } else if small && statistics.refinements > 3 {
                    let iterations = statistics.iterations;
                    break QpError::Stalled { iterations, residuals: residuals.into() };
                } else {
                    // Multipliers and slacks are good: the next step is to correct the others only.
                    refine = small;
                    statistics.refinements += usize::from(small);
                }
            }
            // Products far below the tolerance gain nothing, and make weights that swallow the digits of everything else.
            let floor = share * limits.of(self.terms).forces;
            let iterations = statistics.iterations;
            if iterations >= options.max_iterations {
                break QpError::MaxIterations { iterations, residuals: residuals.into() };
            }
            self.sides.aim(if refine { self.mu.max(floor) } else { T::ZERO });
            self.newton::<E>(true)?;
            statistics.factorisations += 1;
            statistics.regularised += self.riccati.regularised;
            let (least, most) = (T::from_f64(T::EPSILON).sqrt(), T::from_f64(BOUNDARY));
            let distance = self.mu.max(least);
            let keep = if distance < most { distance } else { most };
            let mut alpha = self.sides.longest::<E>(keep);
            if !refine && self.mu > T::ZERO {
                let after = self.sides.mu_after::<E>(alpha, self.mu);
                let ratio = after / self.mu;
                self.sides.correct((self.mu * ratio * ratio * ratio).max(floor));
                self.newton::<E>(false)?;
                alpha = self.sides.longest::<E>(keep);
                if alpha < T::from_f64(SHORT) {
                    // Products are too different for the corrector to be right: first they are made equal.
                    self.sides.aim(self.mu * T::from_f64(SHORT));
                    self.newton::<E>(false)?;
                    alpha = self.sides.longest::<E>(keep);
                }
            }
            statistics.iterations += 1;
            #[cfg(feature = "std")]
            if std::env::var("DBG").is_ok() {
                let r: crate::qp::Residuals = residuals.into();
                std::eprintln!("{} mu {:e} alpha {:e} reg {} {r} step {:e}", statistics.iterations, self.mu.to_f64(), alpha.to_f64(), self.riccati.regularised, largest_size::<T, E>(self.step).to_f64());
            }
            if !(alpha > T::ZERO && largest_size::<T, E>(self.step).is_finite()) {
                break QpError::Stalled { iterations, residuals: residuals.into() };
            }
            short = if alpha < T::from_f64(1e-3) { short + 1 } else { 0 };
            if short > 4 {
                break QpError::Stalled { iterations, residuals: residuals.into() };
            }
            self.advance::<E>(alpha);
            refine = false;
        };
        // The multipliers of the dynamics belong to the point that is left.
        let _ = self.evaluate::<E>(solution.dynamics);
        Err(failure)
    }

    /// The point and its multipliers.
    fn store(&mut self, solution: &mut SolutionView<'_, T>) {
        for place in Places::<T>::new(self.qp.dims) {
            assign(part_mut(solution.v, place.v, place.n), part(self.v, place.row, place.n));
        }
        solution.lower.fill(T::ZERO);
        solution.upper.fill(T::ZERO);
        let sides = &self.sides;
        for (i, (&row, &multiplier)) in sides.rows.iter().zip(&*sides.multiplier).enumerate() {
            let side = if i < sides.counts.lower { &mut *solution.lower } else { &mut *solution.upper };
            super::sides::set(side, row as usize, multiplier);
        }
        let mut equation = |row: usize, force: T| {
            super::sides::set(solution.lower, row, force.max(T::ZERO));
            super::sides::set(solution.upper, row, (-force).max(T::ZERO));
        };
        for (&row, &free) in sides.equations.iter().zip(&*sides.free) {
            equation(row as usize, free);
        }
        if self.first == First::Fixed {
            for (row, &force) in self.initial.iter().enumerate() {
                equation(row, force);
            }
        }
    }
}

/// The largest violation of a hard bound, if it is larger than a tolerance relative to the bound.
pub fn worst<T: Real>(qp: QpView<'_, T>, solution: &SolutionView<'_, T>, tolerance: f64) -> Option<QpError> {
    let mut worst = (0.0, None);
    for place in Places::<T>::new(qp.dims) {
        let data = part(qp.data, place.data, place.data_len());
        let v = part(solution.v, place.v, place.ld);
        let vector = |row| part(data, place.row_data(row), place.rows);
        for index in (0..place.n).chain(place.ld..place.ld + place.ng) {
            let value = if index < place.n {
                v.get(index).map_or(0.0, |v| v.to_f64())
            } else {
                let column = part(data, (place.next + index - place.ld) * place.ld, place.n);
                column.iter().zip(v).map(|(c, v)| c.to_f64() * v.to_f64()).sum()
            };
            let at = |row| vector(row).get(index).map_or(0.0, |b| b.to_f64());
            let sides = [
                (Side::Lower, at(Row::Lower), at(Row::LowerLinear), 1.0),
                (Side::Upper, at(Row::Upper), at(Row::UpperLinear), -1.0),
            ];
            for (side, bound, penalty, sign) in sides {
                let violation = sign * (bound - value);
                if penalty.is_infinite() && violation > tolerance * (1.0 + bound.abs()) && violation > worst.0
                {
                    let (field, index) = place.name(index);
                    let stage = place.stage;
                    worst = (violation, Some(QpError::Infeasible { field, stage, index, side, violation }));
                }
            }
        }
    }
    worst.1
}
