//! What a collocation method is without a model.

use super::*;

/// The coefficients of a method with `S` stages in `G` groups: compiled once for all models.
pub(super) struct Scheme<T: Real, const S: usize, const G: usize> {
    pub(super) tableau: Tableau<S>,
    pub(super) stiffly_accurate: bool,
    /// Columns of `A`, and of `−h A` of this step.
    a: [Groups<T, G>; S],
    pub(super) minus_ha: [Groups<T, G>; S],
    pub(super) c: Groups<T, G>,
    /// Columns of the basis, one for each part.
    pub(super) right: [Groups<T, G>; PARTS],
    /// Lagrange polynomials at the start of the step.
    pub(super) lagrange: [T; S],
    /// What they are multiples of: `1 / Π_{j≠i} (c_i − c_j)`.
    factors: [f64; S],
    pub(super) basis: Eigenbasis<T, S, PARTS>,
    pub(super) defect_filter: DefectFilter,
}

impl<T: Real, const S: usize, const G: usize> Scheme<T, S, G> {
    /// Nothing for a method whose stages cannot be told apart: Gauss and Radau IIA methods are
    /// none. Not inlined: callers would have each of its numbers by itself.
    #[inline(never)]
    pub(super) fn new(tableau: Tableau<S>) -> Option<Self> {
        const { assert!(G == S.div_ceil(GROUP), "as many groups as hold the stages") };
        let basis: Eigenbasis<T, S, PARTS> = Eigenbasis::new(&tableau)?;
        let nothing = [[T::ZERO; GROUP]; G];
        let mut scheme = Self {
            a: [nothing; S],
            minus_ha: [nothing; S],
            c: nothing,
            right: [nothing; PARTS],
            lagrange: [T::ZERO; S],
            factors: [1.0; S],
            defect_filter: DefectFilter::new(Complex { parts: basis.values().parts.map(T::to_f64) }, S),
            basis,
            stiffly_accurate: tableau.is_stiffly_accurate(),
            tableau,
        };
        for (j, to) in scheme.a.iter_mut().enumerate() {
            spread(&tableau.a().map(|row| T::from_f64(row[j])), to);
        }
        spread(&tableau.c().map(T::from_f64), &mut scheme.c);
        for (from, to) in scheme.basis.right().iter().zip(&mut scheme.right) {
            spread(from, to);
        }
        for (to, from) in scheme.lagrange.iter_mut().zip(tableau.lagrange(0.0)) {
            *to = T::from_f64(from);
        }
        denominators(tableau.c(), &mut scheme.factors);
        Some(scheme)
    }

    /// The Lagrange polynomials of the nodes, without a division.
    pub(super) fn polynomials(&self, theta: f64) -> [f64; S] {
        let c = self.tableau.c();
        let (mut before, mut after) = (1.0, 1.0);
        let mut values = self.factors;
        for (value, c) in values.iter_mut().zip(c) {
            *value *= before;
            before *= theta - c;
        }
        for (value, c) in values.iter_mut().zip(c).rev() {
            *value *= after;
            after *= theta - c;
        }
        values
    }

    /// The same as numbers.
    pub(super) fn values(&self, theta: f64) -> [T; S] {
        self.polynomials(theta).map(T::from_f64)
    }

    /// Their integrals from zero on.
    pub(super) fn integrals(&self, theta: f64) -> [T; S] {
        self.tableau.weights(theta).map(T::from_f64)
    }

    /// `b`
    pub(super) fn weights(&self) -> [T; S] {
        self.tableau.b().map(T::from_f64)
    }

    /// The point in the middle between a stage and the one before.
    pub(super) fn middle(&self, stage: usize) -> f64 {
        0.5 * (self.tableau.c()[stage - 1] + self.tableau.c()[stage])
    }

    /// The Lagrange polynomials at the nodes of a step that follows on this one, `ratio` times as
    /// long: a column for each node of this one.
    pub(super) fn continued(&self, ratio: f64) -> [Groups<T, G>; S] {
        let weights: [[f64; S]; S] = from_fn(|i| self.polynomials(1.0 + self.tableau.c()[i] * ratio));
        from_fn(|j| Self::groups(|i| T::from_f64(weights[i][j])))
    }

    /// `−h A` of a step of length `h`.
    pub(super) fn set_step(&mut self, h: T) {
        let a = self.a.as_flattened().as_flattened();
        multiply(h, a, self.minus_ha.as_flattened_mut().as_flattened_mut());
    }

    /// Times of the stages.
    pub(super) fn times(&self, t: T, h: T) -> Groups<T, G> {
        let mut times = self.c;
        for time in times.as_flattened_mut() {
            *time = t + *time * h;
        }
        times
    }

    /// A value of each stage, of which the last is repeated.
    fn groups(value: impl Fn(usize) -> T) -> Groups<T, G> {
        from_fn(|group| from_fn(|lane| value((GROUP * group + lane).min(S.saturating_sub(1)))))
    }

    /// The sum over the stages, each once.
    pub(super) fn total(sum: &Groups<T, G>) -> f64 {
        sum.as_flattened()[..S].iter().fold(T::ZERO, |total, sum| total + *sum).to_f64()
    }
}

/// A value of each stage, of which the last is repeated.
#[inline(never)]
fn spread<T: Real>(from: &[T], to: &mut [[T; GROUP]]) {
    for (lane, to) in to.as_flattened_mut().iter_mut().enumerate() {
        *to = from.get(lane).or(from.last()).copied().unwrap_or(T::ZERO);
    }
}

/// `−h A`
#[inline(always)]
fn multiply<T: Real>(h: T, a: &[T], to: &mut [T]) {
    for (to, a) in to.iter_mut().zip(a) {
        *to = -(h * *a);
    }
}

/// `1 / Π_{j≠i} (c_i − c_j)`
#[inline(never)]
fn denominators(nodes: &[f64], to: &mut [f64]) {
    for (i, (own, to)) in nodes.iter().zip(to).enumerate() {
        *to = 1.0;
        for (j, other) in nodes.iter().enumerate() {
            if j != i {
                *to /= own - other;
            }
        }
    }
}
