//! What a collocation method is without a model.

use super::*;

/// The coefficients of a method with `S` stages in `G` groups: compiled once for all models.
pub(super) struct Scheme<T: Real, const S: usize, const G: usize> {
    pub(super) tableau: Tableau<S>,
    pub(super) stiffly_accurate: bool,
    /// Columns of `A`, and of `−h A` of this step.
    a: [StageGroups<T, G>; S],
    pub(super) minus_ha: [StageGroups<T, G>; S],
    pub(super) c: StageGroups<T, G>,
    /// Columns of the basis, one for each part.
    pub(super) right_eigenvectors: [StageGroups<T, G>; COMPLEX_PARTS],
    /// Lagrange polynomials at the start of the step.
    pub(super) lagrange_at_start: [T; S],
    /// What they are multiples of: `1 / Π_{j≠i} (c_i − c_j)`.
    lagrange_factors: [f64; S],
    pub(super) basis: Eigenbasis<T, S, COMPLEX_PARTS>,
    pub(super) defect_filter: DefectFilter,
}

impl<T: Real, const S: usize, const G: usize> Scheme<T, S, G> {
    /// Nothing for a method whose stages cannot be told apart: Gauss and Radau IIA methods are
    /// none. Not inlined: callers would have each of its numbers by itself.
    #[inline(never)]
    pub(super) fn new(tableau: Tableau<S>) -> Option<Self> {
        const { assert!(G == S.div_ceil(STAGES_PER_GROUP), "as many groups as hold the stages") };
        let basis: Eigenbasis<T, S, COMPLEX_PARTS> = Eigenbasis::new(&tableau)?;
        let nothing = [[T::ZERO; STAGES_PER_GROUP]; G];
        let mut scheme = Self {
            a: [nothing; S],
            minus_ha: [nothing; S],
            c: nothing,
            right_eigenvectors: [nothing; COMPLEX_PARTS],
            lagrange_at_start: [T::ZERO; S],
            lagrange_factors: [1.0; S],
            defect_filter: DefectFilter::new(Complex { parts: basis.eigenvalues().parts.map(T::to_f64) }, S),
            basis,
            stiffly_accurate: tableau.is_stiffly_accurate(),
            tableau,
        };
        for (j, to) in scheme.a.iter_mut().enumerate() {
            pad_stages(&tableau.a().map(|row| T::from_f64(row[j])), to);
        }
        pad_stages(&tableau.c().map(T::from_f64), &mut scheme.c);
        for (from, to) in scheme.basis.right_vectors().iter().zip(&mut scheme.right_eigenvectors) {
            pad_stages(from, to);
        }
        for (to, from) in scheme.lagrange_at_start.iter_mut().zip(tableau.lagrange(0.0)) {
            *to = T::from_f64(from);
        }
        set_lagrange_factors(tableau.c(), &mut scheme.lagrange_factors);
        Some(scheme)
    }

    /// The Lagrange polynomials of the nodes, without a division.
    pub(super) fn lagrange_polynomials(&self, theta: f64) -> [f64; S] {
        let c = self.tableau.c();
        let (mut before, mut after) = (1.0, 1.0);
        let mut values = self.lagrange_factors;
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
    pub(super) fn lagrange_values(&self, theta: f64) -> [T; S] {
        self.lagrange_polynomials(theta).map(T::from_f64)
    }

    /// Their integrals from zero on.
    pub(super) fn lagrange_integrals(&self, theta: f64) -> [T; S] {
        self.tableau.weights(theta).map(T::from_f64)
    }

    /// `b`
    pub(super) fn quadrature_weights(&self) -> [T; S] {
        self.tableau.b().map(T::from_f64)
    }

    /// The point in the middle between a stage and the one before.
    pub(super) fn midpoint_node(&self, stage: usize) -> f64 {
        0.5 * (self.tableau.c()[stage - 1] + self.tableau.c()[stage])
    }

    /// The Lagrange polynomials at the nodes of a step that follows on this one, `ratio` times as
    /// long: a column for each node of this one.
    pub(super) fn extrapolation_weights(&self, ratio: f64) -> [StageGroups<T, G>; S] {
        let weights: [[f64; S]; S] =
            from_fn(|i| self.lagrange_polynomials(1.0 + self.tableau.c()[i] * ratio));
        from_fn(|j| Self::stage_groups(|i| T::from_f64(weights[i][j])))
    }

    /// `−h A` of a step of length `h`.
    pub(super) fn set_step_size(&mut self, h: T) {
        let a = self.a.as_flattened().as_flattened();
        scale_by_minus_h(h, a, self.minus_ha.as_flattened_mut().as_flattened_mut());
    }

    /// Times of the stages.
    pub(super) fn stage_times(&self, t: T, h: T) -> StageGroups<T, G> {
        let mut times = self.c;
        for time in times.as_flattened_mut() {
            *time = t + *time * h;
        }
        times
    }

    /// A value of each stage, of which the last is repeated.
    fn stage_groups(value: impl Fn(usize) -> T) -> StageGroups<T, G> {
        from_fn(|group| from_fn(|lane| value((STAGES_PER_GROUP * group + lane).min(S.saturating_sub(1)))))
    }

    /// The sum over the stages, each once.
    pub(super) fn sum_over_stages(sum: &StageGroups<T, G>) -> f64 {
        sum.as_flattened()[..S].iter().fold(T::ZERO, |total, sum| total + *sum).to_f64()
    }
}

/// A value of each stage, of which the last is repeated.
#[inline(never)]
fn pad_stages<T: Real>(from: &[T], to: &mut [[T; STAGES_PER_GROUP]]) {
    for (lane, to) in to.as_flattened_mut().iter_mut().enumerate() {
        *to = from.get(lane).or(from.last()).copied().unwrap_or(T::ZERO);
    }
}

/// `−h A`
#[inline(always)]
fn scale_by_minus_h<T: Real>(h: T, a: &[T], to: &mut [T]) {
    for (to, a) in to.iter_mut().zip(a) {
        *to = -(h * *a);
    }
}

/// `1 / Π_{j≠i} (c_i − c_j)`
#[inline(never)]
fn set_lagrange_factors(nodes: &[f64], to: &mut [f64]) {
    for (i, (own, to)) in nodes.iter().zip(to).enumerate() {
        *to = 1.0;
        for (j, other) in nodes.iter().enumerate() {
            if j != i {
                *to /= own - other;
            }
        }
    }
}
