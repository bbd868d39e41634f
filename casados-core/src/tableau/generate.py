"""Writes gauss.rs and radau.rs: collocation tableaux in 80 digits, rounded once to f64.

Run in this folder: `python3 generate.py && rustfmt --config-path ../../.. gauss.rs radau.rs`. Needs mpmath.
"""

import mpmath as mp

mp.mp.dps = 80

FAMILIES = {
    "gauss.rs": (
        "Gauss",
        "Gauss-Legendre",
        "Gauss-Legendre methods with `S` stages, order `2S`: symmetric, symplectic, A-stable, `|R(∞)| = 1`.",
        lambda s: 2 * s,
        # Legendre polynomial on [0, 1]
        lambda s, x: mp.legendre(s, 2 * x - 1),
    ),
    "radau.rs": (
        "RadauIIA",
        "Radau IIA",
        "Radau IIA methods with `S` stages, order `2S − 1`: stiffly accurate, L-stable, `R(∞) = 0`.",
        lambda s: 2 * s - 1,
        lambda s, x: mp.legendre(s, 2 * x - 1) - mp.legendre(s - 1, 2 * x - 1),
    ),
}


def nodes(s, polynomial):
    """All roots lie in (0, 1] and are simple: the monomial coefficients are recovered by interpolation."""
    points = [mp.mpf(k) / s for k in range(s + 1)]
    vandermonde = mp.matrix(s + 1, s + 1)
    for r, x in enumerate(points):
        for k in range(s + 1):
            vandermonde[r, k] = x ** (s - k)
    coefficients = mp.lu_solve(vandermonde, mp.matrix([polynomial(s, x) for x in points]))
    return sorted(mp.re(x) for x in mp.polyroots(list(coefficients), maxsteps=1000, extraprec=400))


def integral(c, j, end):
    """The integral of the Lagrange polynomial of node j over [0, end]."""
    polynomial = [mp.mpf(1)]  # lowest power first
    for m, node in enumerate(c):
        if m != j:
            scale = 1 / (c[j] - node)
            shifted = [mp.mpf(0)] + polynomial
            polynomial = [scale * (a - node * b) for a, b in zip(shifted, polynomial + [mp.mpf(0)])]
    return sum(a * end ** (k + 1) / (k + 1) for k, a in enumerate(polynomial))


def literal(x):
    return repr(float(mp.nstr(x, 40)))


def array(values):
    return "[" + ", ".join(map(literal, values)) + "]"


for path, (name, long_name, summary, order, polynomial) in FAMILIES.items():
    with open(path, "w") as out:
        print(f"//! {long_name} tableaux: written by `generate.py`, each number rounded once to `f64`.\n", file=out)
        print("use super::{Method, Tableau};\n", file=out)
        print(f"/// {summary}\n///\n/// `S = 1..=9`.", file=out)
        print(f"#[derive(Clone, Copy, Debug)]\npub struct {name}<const S: usize>;", file=out)
        for s in range(1, 10):
            c = nodes(s, polynomial)
            a = [[integral(c, j, end) for j in range(s)] for end in c]
            b = [integral(c, j, mp.mpf(1)) for j in range(s)]
            print(f"\nimpl Method<{s}> for {name}<{s}> {{", file=out)
            print(f'const TABLEAU: Tableau<{s}> = Tableau::known("{long_name}, s = {s}", {order(s)}, {s},', file=out)
            print("[" + ", ".join(map(array, a)) + "],", file=out)
            print(f"{array(b)}, {array(c)});\n}}", file=out)
