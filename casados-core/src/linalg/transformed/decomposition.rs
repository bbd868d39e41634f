//! Eigenvalues and eigenvectors of the matrix of a tableau, on slices, so that they are compiled
//! once for all numbers of stages. Matrices are in row-major order.

use super::complex::Complex;
use crate::shape::InBounds;
use bytemuck::Zeroable;

/// One complex number.
type ComplexNumber = Complex<f64, 2>;

/// `A = V diag(μ) V⁻¹` of `s` stages in `n` parts, in the layout of
/// [`Eigenbasis`](super::basis::Eigenbasis).
pub(super) struct EigenbasisParts<'a> {
    /// `μ`
    pub eigenvalues: &'a mut [f64],
    /// `s` columns of `V⁻¹`.
    pub left_vectors: &'a mut [f64],
    /// `n` columns of `V`.
    pub right_vectors: &'a mut [f64],
}

/// Scratch memory of the decomposition, for `s` stages.
pub(super) struct DecompositionMemory<'a> {
    pub roots: &'a mut [ComplexNumber],
    /// A left and a right eigenvector.
    pub vectors: [&'a mut [ComplexNumber]; 2],
    pub matrix: &'a mut [ComplexNumber],
    /// Coefficients of the characteristic polynomial.
    pub coefficients: &'a mut [f64],
    pub powers: [&'a mut [f64]; 2],
}

/// Returns an element, or zero outside, so that nothing can panic; the optimiser cannot prove that
/// all indices are inside.
fn get_or_zero<T: Copy + Zeroable>(elements: &[T], index: usize) -> T {
    elements.get(index).in_bounds().copied().unwrap_or(T::zeroed())
}

/// Sets an element.
fn set_if_inside<T>(elements: &mut [T], index: usize, value: T) {
    if let Some(element) = elements.get_mut(index).in_bounds() {
        *element = value;
    }
}

/// Swaps two elements.
fn swap_if_inside<T>(elements: &mut [T], i: usize, j: usize) {
    if i.max(j) < elements.len() {
        elements.swap(i, j);
    }
}

/// Computes the basis; returns whether it exists and reproduces `A` to `1e-10`.
#[inline(never)]
pub(super) fn decompose(a: &[f64], parts: EigenbasisParts<'_>, memory: &mut DecompositionMemory<'_>) -> bool {
    let (s, n) = (memory.roots.len(), parts.eigenvalues.len());
    let half = n / 2;
    // Without a real number at the end, the real eigenvalue is the first complex number.
    let first = usize::from(s % 2 == 1 && n.is_multiple_of(2));
    let (mut reals, mut pairs) = (0, first);
    eigenvalues(a, memory);
    for index in 0..s {
        let root = get_or_zero(memory.roots, index);
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
            set_if_inside(parts.eigenvalues, n - 1, value.parts[0]);
            for stage in 0..s {
                set_if_inside(parts.left_vectors, stage * n + n - 1, get_or_zero(left, stage).parts[0]);
                set_if_inside(parts.right_vectors, (n - 1) * s + stage, get_or_zero(right, stage).parts[0]);
            }
            continue;
        }
        let lane = if is_real { 0 } else { pairs };
        let (counter, weight) = if is_real { (&mut reals, 1.0) } else { (&mut pairs, 2.0) };
        *counter += 1;
        for (part, sign, place) in [(0, 1.0, lane), (1, -1.0, half + lane)] {
            set_if_inside(parts.eigenvalues, place, value.parts[part]);
            for stage in 0..s {
                set_if_inside(parts.left_vectors, stage * n + place, get_or_zero(left, stage).parts[part]);
                // The real part of a product.
                let own = get_or_zero(right, stage).scaled(weight).parts[part];
                set_if_inside(parts.right_vectors, place * s + stage, sign * own);
            }
        }
    }
    // The last eigenvalue is repeated to fill the register.
    let last = pairs.saturating_sub(1);
    for lane in pairs..half {
        for begin in [0, half] {
            set_if_inside(parts.eigenvalues, begin + lane, get_or_zero(parts.eigenvalues, begin + last));
        }
    }
    reals == s % 2 && pairs == first + s / 2 && reproduces(a, &parts, s)
}

/// Whether `V diag(μ) V⁻¹` is `A`.
fn reproduces(a: &[f64], parts: &EigenbasisParts<'_>, s: usize) -> bool {
    let n = parts.eigenvalues.len();
    let half = n / 2;
    let largest = a.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
    let is_same = |i: usize, j: usize| {
        let value = |part: usize| get_or_zero(parts.eigenvalues, part);
        let left = |part: usize| get_or_zero(parts.left_vectors, j * n + part);
        let right = |part: usize| get_or_zero(parts.right_vectors, part * s + i);
        let mut sum = if n % 2 == 1 { right(n - 1) * value(n - 1) * left(n - 1) } else { 0.0 };
        for l in 0..half {
            let ([re, im], [other_re, other_im]) = ([value(l), value(half + l)], [left(l), left(half + l)]);
            sum += right(l) * (re * other_re - im * other_im);
            sum += right(half + l) * (re * other_im + im * other_re);
        }
        (sum - get_or_zero(a, i * s + j)).abs() <= 1e-10 * largest
    };
    (0..s).all(|i| (0..s).all(|j| is_same(i, j)))
}

/// Computes all eigenvalues, to half the digits at least: the zeros of the characteristic
/// polynomial (D. K. Faddeev), by the simultaneous iteration of Durand and Kerner.
fn eigenvalues(a: &[f64], memory: &mut DecompositionMemory<'_>) {
    let DecompositionMemory { roots, coefficients, powers: [product, next], .. } = memory;
    let s = roots.len();
    // p(μ) = μˢ + c_{s−1} μ^{s−1} + … + c_0
    for k in 1..=s {
        let shift = if k == 1 { 1.0 } else { get_or_zero(coefficients, s + 1 - k) };
        for i in 0..s {
            for j in 0..s {
                let sum: f64 =
                    (0..s).map(|l| get_or_zero(a, i * s + l) * get_or_zero(product, l * s + j)).sum();
                set_if_inside(next, i * s + j, get_or_zero(a, i * s + j) * shift + sum);
            }
        }
        for (product, next) in product.iter_mut().zip(next.iter()) {
            *product = *next;
        }
        let trace: f64 = (0..s).map(|i| get_or_zero(product, i * s + i)).sum();
        set_if_inside(coefficients, s - k, -trace / k as f64);
    }
    // The start values lie around the geometric mean of the zeros, asymmetrically.
    let mut power = Complex::real(coefficients.first().map_or(1.0, |c| nth_root(c.abs(), s)));
    for root in roots.iter_mut() {
        power = power * Complex { parts: [0.4, 0.9] };
        *root = power;
    }
    for _ in 0..200 {
        for i in 0..s {
            let root = get_or_zero(roots, i);
            let mut value = Complex::real(1.0);
            for c in coefficients.iter().rev() {
                value = value * root + Complex::real(*c);
            }
            let mut product_of_differences = Complex::real(1.0);
            for (j, other) in roots.iter().enumerate() {
                if j != i {
                    product_of_differences = product_of_differences * (root - *other);
                }
            }
            set_if_inside(roots, i, root - value / product_of_differences);
        }
    }
}

/// `a^(1/n)` by bisection, without elementary functions.
fn nth_root(a: f64, n: usize) -> f64 {
    let (mut low, mut high) = (0.0, 1.0f64.max(a));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let power = (0..n).fold(1.0, |power, _| power * middle);
        if power < a { low = middle } else { high = middle }
    }
    high
}

/// Improves an approximate eigenvalue, and computes its left and right eigenvectors, with product
/// one. Two-sided inverse iteration with the Rayleigh quotient (A. M. Ostrowski 1959).
fn eigenvectors(
    a: &[f64],
    start: ComplexNumber,
    memory: &mut DecompositionMemory<'_>,
) -> Option<ComplexNumber> {
    let DecompositionMemory { vectors: [left, right], matrix, .. } = memory;
    let (s, mut value) = (left.len(), start);
    left.fill(Complex::real(1.0));
    right.fill(Complex::real(1.0));
    for _ in 0..6 {
        // Shifted off the eigenvalue, so that the matrix is regular.
        let shift = value.scaled(1.0 + 1e-10);
        for (vector, transposed) in [(&mut *right, false), (&mut *left, true)] {
            for i in 0..s {
                for j in 0..s {
                    let from = if transposed { j * s + i } else { i * s + j };
                    let element = Complex::real(get_or_zero(a, from));
                    set_if_inside(matrix, i * s + j, if i == j { element - shift } else { element });
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
                product = product + get_or_zero(right, j).scaled(get_or_zero(a, i * s + j));
            }
            overlap = overlap + get_or_zero(left, i) * get_or_zero(right, i);
            quotient = quotient + get_or_zero(left, i) * product;
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

/// `a / b` with divisions; `Div`, which has to be fast, multiplies by reciprocals.
fn divide(a: ComplexNumber, b: ComplexNumber) -> ComplexNumber {
    let ([a_re, a_im], [b_re, b_im]) = (a.parts, b.parts);
    let size = b_re.abs().max(b_im.abs());
    let (re, im) = (b_re / size, b_im / size);
    let square = b_re * re + b_im * im;
    ComplexNumber { parts: [(a_re * re + a_im * im) / square, (a_im * re - a_re * im) / square] }
}

/// Replaces `b` by `M⁻¹ b`, divided by its largest element; returns whether that is finite.
/// Gaussian elimination with partial pivoting.
fn solve_scaled(matrix: &mut [ComplexNumber], b: &mut [ComplexNumber]) -> bool {
    let s = b.len();
    let size = |z: ComplexNumber| z.parts[0].abs() + z.parts[1].abs();
    for k in 0..s {
        let larger = |best: usize, i: usize| {
            if size(get_or_zero(matrix, i * s + k)) > size(get_or_zero(matrix, best * s + k)) {
                i
            } else {
                best
            }
        };
        let best = (k..s).fold(k, larger);
        swap_if_inside(b, k, best);
        for j in 0..s {
            swap_if_inside(matrix, k * s + j, best * s + j);
        }
        for i in k + 1..s {
            let factor = divide(get_or_zero(matrix, i * s + k), get_or_zero(matrix, k * s + k));
            for j in 0..s {
                set_if_inside(
                    matrix,
                    i * s + j,
                    get_or_zero(matrix, i * s + j) - factor * get_or_zero(matrix, k * s + j),
                );
            }
            set_if_inside(b, i, get_or_zero(b, i) - factor * get_or_zero(b, k));
        }
    }
    for k in (0..s).rev() {
        let mut remainder = get_or_zero(b, k);
        for j in k + 1..s {
            remainder = remainder - get_or_zero(matrix, k * s + j) * get_or_zero(b, j);
        }
        set_if_inside(b, k, divide(remainder, get_or_zero(matrix, k * s + k)));
    }
    let largest = b.iter().fold(0.0, |m: f64, z| m.max(size(*z)));
    for z in b.iter_mut() {
        *z = z.scaled(1.0 / largest);
    }
    b.iter().all(Complex::is_finite)
}
