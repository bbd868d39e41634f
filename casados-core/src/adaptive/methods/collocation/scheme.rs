//! The coefficients of a collocation method, independent of the model.

use super::*;

/// The coefficients of a method with `S` stages in `G` groups; compiled once for all models.
pub(super) struct Scheme<T: Real, const S: usize, const G: usize> {
    pub(super) tableau: Tableau<S>,
    pub(super) stiffly_accurate: bool,
    /// The columns of `A`, and those of `−h A` for the current step.
    a: [StageGroups<T, G>; S],
    pub(super) minus_ha: [StageGroups<T, G>; S],
    pub(super) c: StageGroups<T, G>,
    /// The right eigenvectors of `A`, one column for each real or imaginary part.
    pub(super) right_eigenvectors: [StageGroups<T, G>; COMPLEX_PARTS],
    /// The Lagrange polynomials at the start of the step.
    pub(super) lagrange_at_start: [T; S],
    /// The denominators of the Lagrange polynomials: `1 / Π_{j≠i} (c_i − c_j)`.
    lagrange_factors: [f64; S],
    pub(super) basis: Eigenbasis<T, S, COMPLEX_PARTS>,
    pub(super) defect_filter: DefectFilter,
}

impl<T: Real, const S: usize, const G: usize> Scheme<T, S, G> {
    /// Returns nothing if stages coincide, which Gauss and Radau IIA methods exclude. Not inlined:
    /// callers would repeat each coefficient.
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

    /// The Lagrange polynomials of the nodes at `theta`, without a division.
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

    /// The Lagrange polynomials at `theta` as numbers of the integrator.
    pub(super) fn lagrange_values(&self, theta: f64) -> [T; S] {
        self.lagrange_polynomials(theta).map(T::from_f64)
    }

    /// The integrals of the Lagrange polynomials from zero to `theta`.
    pub(super) fn lagrange_integrals(&self, theta: f64) -> [T; S] {
        self.tableau.weights(theta).map(T::from_f64)
    }

    /// The quadrature weights `b`.
    pub(super) fn quadrature_weights(&self) -> [T; S] {
        self.tableau.b().map(T::from_f64)
    }

    /// The midpoint between the nodes of a stage and of the one before it.
    pub(super) fn midpoint_node(&self, stage: usize) -> f64 {
        0.5 * (self.tableau.c()[stage - 1] + self.tableau.c()[stage])
    }

    /// The Lagrange polynomials at the nodes of the next step, `ratio` times as long: one column
    /// for each node of this step.
    pub(super) fn extrapolation_weights(&self, ratio: f64) -> [StageGroups<T, G>; S] {
        let weights: [[f64; S]; S] =
            from_fn(|i| self.lagrange_polynomials(1.0 + self.tableau.c()[i] * ratio));
        from_fn(|j| Self::stage_groups(|i| T::from_f64(weights[i][j])))
    }

    /// Sets `−h A` for a step of length `h`.
    pub(super) fn set_step_size(&mut self, h: T) {
        let a = self.a.as_flattened().as_flattened();
        scale_by_minus_h(h, a, self.minus_ha.as_flattened_mut().as_flattened_mut());
    }

    /// The times of the stages.
    pub(super) fn stage_times(&self, t: T, h: T) -> StageGroups<T, G> {
        let mut times = self.c;
        for time in times.as_flattened_mut() {
            *time = t + *time * h;
        }
        times
    }

    /// Groups of the values of the stages; the last value is repeated.
    fn stage_groups(value: impl Fn(usize) -> T) -> StageGroups<T, G> {
        from_fn(|group| from_fn(|lane| value((STAGES_PER_GROUP * group + lane).min(S.saturating_sub(1)))))
    }

    /// The sum over the stages, each counted once.
    pub(super) fn sum_over_stages(sum: &StageGroups<T, G>) -> f64 {
        sum.as_flattened()[..S].iter().fold(T::ZERO, |total, sum| total + *sum).to_f64()
    }
}

/// Copies the values of the stages into groups; the last value is repeated.
#[inline(never)]
fn pad_stages<T: Real>(from: &[T], to: &mut [[T; STAGES_PER_GROUP]]) {
    for (lane, to) in to.as_flattened_mut().iter_mut().enumerate() {
        *to = from.get(lane).or(from.last()).copied().unwrap_or(T::ZERO);
    }
}

/// Computes `−h A`.
#[inline(always)]
fn scale_by_minus_h<T: Real>(h: T, a: &[T], to: &mut [T]) {
    for (to, a) in to.iter_mut().zip(a) {
        *to = -(h * *a);
    }
}

/// Computes `1 / Π_{j≠i} (c_i − c_j)`.
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
