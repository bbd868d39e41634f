//! Eigenvalues and eigenvectors of the matrix of a tableau: on slices, so that they are compiled
//! once for all numbers of stages. Matrices have their rows one after the other.

use super::complex::Complex;
use bytemuck::Zeroable;

/// One complex number.
type Number = Complex<f64, 2>;

/// `A = V diag(μ) V⁻¹` of `s` stages in `n` parts, as [`Eigenbasis`](super::basis::Eigenbasis) has
/// it.
pub(super) struct Parts<'a> {
    /// `μ`
    pub values: &'a mut [f64],
    /// `s` columns of `V⁻¹`.
    pub left: &'a mut [f64],
    /// `n` columns of `V`.
    pub right: &'a mut [f64],
}

/// What is computed with, for `s` stages.
pub(super) struct Memory<'a> {
    pub roots: &'a mut [Number],
    /// A left and a right eigenvector.
    pub vectors: [&'a mut [Number]; 2],
    pub matrix: &'a mut [Number],
    /// Those of the characteristic polynomial.
    pub coefficients: &'a mut [f64],
    pub powers: [&'a mut [f64]; 2],
}

/// An element, or zero outside: nothing in here can panic, and the optimiser does not see that all
/// places are inside.
fn at<T: Copy + Zeroable>(elements: &[T], index: usize) -> T {
    elements.get(index).copied().unwrap_or(T::zeroed())
}

/// Overwrites an element.
fn put<T>(elements: &mut [T], index: usize, value: T) {
    if let Some(element) = elements.get_mut(index) {
        *element = value;
    }
}

/// Two elements in each other's place.
fn exchange<T>(elements: &mut [T], i: usize, j: usize) {
    if i.max(j) < elements.len() {
        elements.swap(i, j);
    }
}

/// Whether there is such a basis, and it reproduces `A` to `1e-10`.
#[inline(never)]
pub(super) fn decompose(a: &[f64], parts: Parts<'_>, memory: &mut Memory<'_>) -> bool {
    let (s, n) = (memory.roots.len(), parts.values.len());
    let half = n / 2;
    // Where the real one is no number of its own it is the first of the complex ones.
    let first = usize::from(s % 2 == 1 && n.is_multiple_of(2));
    let (mut reals, mut pairs) = (0, first);
    eigenvalues(a, memory);
    for index in 0..s {
        let root = at(memory.roots, index);
        let is_real = root.parts[1].abs() <= 1e-8 * root.parts[0].abs();
        if !is_real && root.parts[1] < 0.0 {
            continue;
        }
        let start = if is_real { Complex::real(root.parts[0]) } else { root };
        let Some(value) = eigenvectors(a, start, memory) else { return false };
        if is_real && (s.is_multiple_of(2) || reals == 1) || !is_real && pairs == first + s / 2 {
            return false;
        }
        let [left, right] = &memory.vectors;
        if is_real && first == 0 {
            reals += 1;
            put(parts.values, n - 1, value.parts[0]);
            for stage in 0..s {
                put(parts.left, stage * n + n - 1, at(left, stage).parts[0]);
                put(parts.right, (n - 1) * s + stage, at(right, stage).parts[0]);
            }
            continue;
        }
        let lane = if is_real { 0 } else { pairs };
        let (counter, weight) = if is_real { (&mut reals, 1.0) } else { (&mut pairs, 2.0) };
        *counter += 1;
        for (part, sign, place) in [(0, 1.0, lane), (1, -1.0, half + lane)] {
            put(parts.values, place, value.parts[part]);
            for stage in 0..s {
                put(parts.left, stage * n + place, at(left, stage).parts[part]);
                // The real part of a product.
                let own = at(right, stage).scaled(weight).parts[part];
                put(parts.right, place * s + stage, sign * own);
            }
        }
    }
    // What is left of a register repeats the last.
    let last = pairs.saturating_sub(1);
    for lane in pairs..half {
        for begin in [0, half] {
            put(parts.values, begin + lane, at(parts.values, begin + last));
        }
    }
    reals == s % 2 && pairs == first + s / 2 && reproduces(a, &parts, s)
}

/// Whether `V diag(μ) V⁻¹` is `A`.
fn reproduces(a: &[f64], parts: &Parts<'_>, s: usize) -> bool {
    let n = parts.values.len();
    let half = n / 2;
    let largest = a.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
    let is_same = |i: usize, j: usize| {
        let value = |part: usize| at(parts.values, part);
        let left = |part: usize| at(parts.left, j * n + part);
        let right = |part: usize| at(parts.right, part * s + i);
        let mut sum = if n % 2 == 1 { right(n - 1) * value(n - 1) * left(n - 1) } else { 0.0 };
        for l in 0..half {
            let ([re, im], [other_re, other_im]) = ([value(l), value(half + l)], [left(l), left(half + l)]);
            sum += right(l) * (re * other_re - im * other_im);
            sum += right(half + l) * (re * other_im + im * other_re);
        }
        (sum - at(a, i * s + j)).abs() <= 1e-10 * largest
    };
    (0..s).all(|i| (0..s).all(|j| is_same(i, j)))
}

/// All eigenvalues, to half the digits at least: the zeros of the characteristic polynomial (D. K.
/// Faddeev), all at once by the iteration of Durand and Kerner.
fn eigenvalues(a: &[f64], memory: &mut Memory<'_>) {
    let Memory { roots, coefficients, powers: [product, next], .. } = memory;
    let s = roots.len();
    // p(μ) = μˢ + c_{s−1} μ^{s−1} + … + c_0
    for k in 1..=s {
        let shift = if k == 1 { 1.0 } else { at(coefficients, s + 1 - k) };
        for i in 0..s {
            for j in 0..s {
                let sum: f64 = (0..s).map(|l| at(a, i * s + l) * at(product, l * s + j)).sum();
                put(next, i * s + j, at(a, i * s + j) * shift + sum);
            }
        }
        for (product, next) in product.iter_mut().zip(next.iter()) {
            *product = *next;
        }
        let trace: f64 = (0..s).map(|i| at(product, i * s + i)).sum();
        put(coefficients, s - k, -trace / k as f64);
    }
    // All zeros are of the size of the geometric mean of them; the start values lie around it, not
    // symmetric.
    let mut power = Complex::real(coefficients.first().map_or(1.0, |c| root_of(c.abs(), s)));
    for root in roots.iter_mut() {
        power = power * Complex { parts: [0.4, 0.9] };
        *root = power;
    }
    for _ in 0..200 {
        for i in 0..s {
            let root = at(roots, i);
            let mut value = Complex::real(1.0);
            for c in coefficients.iter().rev() {
                value = value * root + Complex::real(*c);
            }
            let mut others = Complex::real(1.0);
            for (j, other) in roots.iter().enumerate() {
                if j != i {
                    others = others * (root - *other);
                }
            }
            put(roots, i, root - value / others);
        }
    }
}

/// `a^(1/n)` by bisection: no elementary functions are needed for it.
fn root_of(a: f64, n: usize) -> f64 {
    let (mut low, mut high) = (0.0, 1.0f64.max(a));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let power = (0..n).fold(1.0, |power, _| power * middle);
        if power < a { low = middle } else { high = middle }
    }
    high
}

/// From an approximate eigenvalue: the eigenvalue, and in the memory the left and the right
/// eigenvector with product one. Two-sided inverse iteration with the quotient of Rayleigh (A. M.
/// Ostrowski 1959).
fn eigenvectors(a: &[f64], start: Number, memory: &mut Memory<'_>) -> Option<Number> {
    let Memory { vectors: [left, right], matrix, .. } = memory;
    let (s, mut value) = (left.len(), start);
    left.fill(Complex::real(1.0));
    right.fill(Complex::real(1.0));
    for _ in 0..6 {
        // Beside the eigenvalue, so that the matrix is regular.
        let shift = value.scaled(1.0 + 1e-10);
        for (vector, transposed) in [(&mut *right, false), (&mut *left, true)] {
            for i in 0..s {
                for j in 0..s {
                    let from = if transposed { j * s + i } else { i * s + j };
                    let element = Complex::real(at(a, from));
                    put(matrix, i * s + j, if i == j { element - shift } else { element });
                }
            }
            if !solve_scaled(matrix, vector) {
                return None;
            }
        }
        let (mut overlap, mut quotient) = (Complex::zero(), Complex::zero());
        for i in 0..s {
            let mut product = Complex::zero();
            for j in 0..s {
                product = product + at(right, j).scaled(at(a, i * s + j));
            }
            overlap = overlap + at(left, i) * at(right, i);
            quotient = quotient + at(left, i) * product;
        }
        for element in left.iter_mut() {
            *element = divide(*element, overlap);
        }
        value = divide(quotient, overlap);
        if start.parts[1] == 0.0 {
            value.parts[1] = 0.0;
        }
    }
    value.is_finite().then_some(value)
}

/// `a / b` with divisions where `Div`, which has to be fast, multiplies by reciprocals.
fn divide(a: Number, b: Number) -> Number {
    let ([a_re, a_im], [b_re, b_im]) = (a.parts, b.parts);
    let size = b_re.abs().max(b_im.abs());
    let (re, im) = (b_re / size, b_im / size);
    let square = b_re * re + b_im * im;
    Number { parts: [(a_re * re + a_im * im) / square, (a_im * re - a_re * im) / square] }
}

/// `b` becomes `M⁻¹ b`, divided by its largest element; whether that is finite. Gauss elimination
/// with partial pivoting.
fn solve_scaled(matrix: &mut [Number], b: &mut [Number]) -> bool {
    let s = b.len();
    let size = |z: Number| z.parts[0].abs() + z.parts[1].abs();
    for k in 0..s {
        let larger = |best: usize, i: usize| {
            if size(at(matrix, i * s + k)) > size(at(matrix, best * s + k)) { i } else { best }
        };
        let best = (k..s).fold(k, larger);
        exchange(b, k, best);
        for j in 0..s {
            exchange(matrix, k * s + j, best * s + j);
        }
        for i in k + 1..s {
            let factor = divide(at(matrix, i * s + k), at(matrix, k * s + k));
            for j in 0..s {
                put(matrix, i * s + j, at(matrix, i * s + j) - factor * at(matrix, k * s + j));
            }
            put(b, i, at(b, i) - factor * at(b, k));
        }
    }
    for k in (0..s).rev() {
        let mut rest = at(b, k);
        for j in k + 1..s {
            rest = rest - at(matrix, k * s + j) * at(b, j);
        }
        put(b, k, divide(rest, at(matrix, k * s + k)));
    }
    let largest = b.iter().fold(0.0, |m: f64, z| m.max(size(*z)));
    for z in b.iter_mut() {
        *z = z.scaled(1.0 / largest);
    }
    b.iter().all(Complex::is_finite)
}
