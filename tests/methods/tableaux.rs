//! Butcher tableaux: bits of the constants, order conditions, interpolation, checks of a user's
//! own.

use casados::{
    Butcher6, DormandPrince5, DormandPrince8, Euler, Gauss, Heun, Method, Midpoint, RadauIIA, Rk4, Tableau,
    TableauError,
};
use serde_json::Value;

/// Runs a block for all Gauss and Radau IIA tableaux, with the name of the family in the reference
/// data.
macro_rules! for_collocation {
    (|$tableau:ident, $family:ident| $body:block) => {
        for_collocation!(@ $tableau $family $body Gauss "gauss" 1 2 3 4 5 6 7 8 9);
        for_collocation!(@ $tableau $family $body RadauIIA "radauIIA" 1 2 3 4 5 6 7 8 9);
    };
    (@ $tableau:ident $family:ident $body:block $method:ident $name:literal $($s:literal)*) => {
        $({
            let ($tableau, $family) = (<$method<$s> as Method<$s>>::TABLEAU, $name);
            $body
        })*
    };
}

macro_rules! for_explicit {
    (|$tableau:ident| $body:block) => {
        for_explicit!(@ $tableau $body Euler Midpoint Heun Rk4 DormandPrince5 Butcher6 DormandPrince8);
    };
    (@ $tableau:ident $body:block $($method:ident)*) => {
        $({
            let $tableau = <$method as Method<_>>::TABLEAU;
            $body
        })*
    };
}

fn reference() -> Value {
    serde_json::from_str(include_str!("../data/tableaux.json")).unwrap()
}

/// C99 hexadecimal floating point with 13 hexadecimal digits, normal numbers.
fn from_hex(value: &Value) -> f64 {
    let text = value.as_str().unwrap();
    let (negative, text) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text),
    };
    let (mantissa, exponent) = text.strip_prefix("0x1.").unwrap().split_once('p').unwrap();
    assert_eq!(mantissa.len(), 13);
    let mantissa = u64::from_str_radix(mantissa, 16).unwrap();
    let exponent = (exponent.parse::<i64>().unwrap() + 1023) as u64;
    f64::from_bits((u64::from(negative) << 63) | (exponent << 52) | mantissa)
}

#[test]
fn t01_constants() {
    let reference = reference();
    let mut compared = 0;
    for_collocation!(|tableau, family| {
        let s = tableau.c().len();
        let exact = &reference[family][s.to_string()];
        let mut same = |ours: f64, exact: &Value, what: &str| {
            assert_eq!(ours.to_bits(), from_hex(exact).to_bits(), "{} {what}", tableau.name());
            compared += 1;
        };
        for i in 0..s {
            same(tableau.b()[i], &exact["b"][i], "b");
            same(tableau.c()[i], &exact["c"][i], "c");
            for j in 0..s {
                same(tableau.a()[i][j], &exact["A"][i][j], "a");
            }
        }
        assert_eq!(tableau.order() as u64, exact["order"].as_u64().unwrap());
    });
    // Two families: Σ s² + 2s for s = 1..=9
    assert_eq!(compared, 2 * (285 + 90));
}

/// The largest residual of `B(p)`, `C(q)`, `D(r)`.
fn simplifying_assumptions<const S: usize>(t: &Tableau<S>, [p, q, r]: [usize; 3]) -> [f64; 3] {
    let (a, b, c) = (t.a(), t.b(), t.c());
    let mut worst = [0.0f64; 3];
    for k in 1..=p {
        let sum: f64 = (0..S).map(|i| b[i] * c[i].powi(k as i32 - 1)).sum();
        worst[0] = worst[0].max((sum - 1.0 / k as f64).abs());
    }
    for k in 1..=q {
        for i in 0..S {
            let sum: f64 = (0..S).map(|j| a[i][j] * c[j].powi(k as i32 - 1)).sum();
            worst[1] = worst[1].max((sum - c[i].powi(k as i32) / k as f64).abs());
        }
    }
    for k in 1..=r {
        for j in 0..S {
            let sum: f64 = (0..S).map(|i| b[i] * c[i].powi(k as i32 - 1) * a[i][j]).sum();
            let exact = b[j] * (1.0 - c[j].powi(k as i32)) / k as f64;
            worst[2] = worst[2].max((sum - exact).abs());
        }
    }
    worst
}

#[test]
fn t02_simplifying_assumptions() {
    for_collocation!(|t, family| {
        let s = t.c().len();
        let orders = if family == "gauss" { [2 * s, s, s] } else { [2 * s - 1, s, s - 1] };
        // All terms are below one, and sum to at most one: four roundings of it.
        for (name, residual) in ["B", "C", "D"].iter().zip(simplifying_assumptions(&t, orders)) {
            assert!(residual <= 4.0 * f64::EPSILON, "{}: {name} {residual:e}", t.name());
        }
        // One order more is violated by far more (s = 9: B by 1e-11 and less is not told from
        // rounding).
        if s <= 5 {
            let more = simplifying_assumptions(&t, orders.map(|o| o + 1));
            assert!(more.iter().all(|&residual| residual > 1e-9), "{}: {more:?}", t.name());
        }
    });
}

#[test]
fn published_orders() {
    for_collocation!(|t, _family| {
        let own = Tableau::new(*t.a(), *t.b(), *t.c()).unwrap();
        assert_eq!((own.order(), own.stage_order()), (t.order(), t.stage_order()), "{}", t.name());
    });
    for_explicit!(|t| {
        let own = Tableau::new(*t.a(), *t.b(), *t.c()).unwrap();
        assert_eq!((own.order(), own.stage_order()), (t.order(), t.stage_order()), "{}", t.name());
    });
}

#[test]
fn properties_of_tableaux() {
    for_collocation!(|t, family| {
        assert!(!t.is_explicit() && t.is_collocation());
        assert_eq!(t.is_symplectic(), family == "gauss", "{}", t.name());
        assert_eq!(t.is_stiffly_accurate(), family == "radauIIA", "{}", t.name());
    });
    for_explicit!(|t| {
        assert!(t.is_explicit() && !t.is_symplectic() && !t.is_stiffly_accurate(), "{}", t.name());
    });
    // The implicit midpoint rule written by hand, and the trapezoidal rule: stiffly accurate, not
    // symplectic.
    let midpoint = Tableau::new([[0.5]], [1.0], [0.5]).unwrap();
    assert!(midpoint.is_symplectic() && midpoint.is_collocation());
    let trapezoidal = Tableau::new([[0.0, 0.0], [0.5, 0.5]], [0.5, 0.5], [0.0, 1.0]).unwrap();
    assert!(trapezoidal.is_stiffly_accurate() && trapezoidal.is_collocation());
    assert!(!trapezoidal.is_symplectic() && !trapezoidal.is_explicit());
}

#[test]
fn orders_of_other_published_methods() {
    // Lobatto IIIC with three stages: order 4, C(2); it is stiffly accurate but no collocation
    // method.
    let lobatto = Tableau::new(
        [
            [1.0 / 6.0, -1.0 / 3.0, 1.0 / 6.0],
            [1.0 / 6.0, 5.0 / 12.0, -1.0 / 12.0],
            [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
        ],
        [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
        [0.0, 0.5, 1.0],
    )
    .unwrap();
    assert_eq!((lobatto.order(), lobatto.stage_order()), (4, 2));
    assert!(lobatto.is_stiffly_accurate() && !lobatto.is_collocation());
    // The 3/8 rule of Kutta: order 4. Kutta's method with three stages: order 3.
    let three_eighths = Tableau::new(
        [[0.0; 4], [1.0 / 3.0, 0.0, 0.0, 0.0], [-1.0 / 3.0, 1.0, 0.0, 0.0], [1.0, -1.0, 1.0, 0.0]],
        [0.125, 0.375, 0.375, 0.125],
        [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0],
    );
    assert_eq!(three_eighths.unwrap().order(), 4);
    let kutta = Tableau::new(
        [[0.0; 3], [0.5, 0.0, 0.0], [-1.0, 2.0, 0.0]],
        [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
        [0.0, 0.5, 1.0],
    );
    assert_eq!(kutta.unwrap().order(), 3);
    // Weights that satisfy all conditions of quadrature but not Σ b_i a_ij c_j = 1/6: order 2.
    let quadrature_only = Tableau::new(
        [[0.0; 3], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]],
        [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
        [0.0, 0.5, 1.0],
    );
    assert_eq!(quadrature_only.unwrap().order(), 2);
}

#[test]
fn invalid_tableaux() {
    let kutta = [[0.0, 0.0], [0.5, 0.0]];
    assert_eq!(
        Tableau::new([[f64::NAN, 0.0], [0.5, 0.0]], [0.0, 1.0], [0.0, 0.5]),
        Err(TableauError::NotFinite)
    );
    assert_eq!(Tableau::new(kutta, [0.0, f64::INFINITY], [0.0, 0.5]), Err(TableauError::NotFinite));
    assert_eq!(
        Tableau::new(kutta, [0.0, 1.0], [0.0, 0.6]),
        Err(TableauError::RowSum { stage: 1, sum: 0.5, node: 0.6 })
    );
    assert_eq!(Tableau::new(kutta, [0.5, 1.0], [0.0, 0.5]), Err(TableauError::WeightSum { sum: 1.5 }));
    assert_eq!(Tableau::<0>::new([], [], []), Err(TableauError::Empty));
    // 10 digits are not enough.
    let third = 0.333_333_333_3;
    let error = Tableau::new([[third]], [1.0], [1.0 / 3.0]).unwrap_err();
    assert!(error.to_string().starts_with("row 0 of A sums to 3.3333333"), "{error}");
}

#[test]
fn weights_at_the_nodes() {
    for_collocation!(|t, _family| {
        let s = t.c().len();
        // The condition of interpolation is the Lebesgue constant Σ|ℓ_i|, below 4 in [0, 1] for s ≤
        // 9 (Gauss nodes: 3.3 at the ends); each of the 2s factors of ℓ_i has three roundings.
        let tolerance = 4.0 * 6.0 * s as f64 * f64::EPSILON;
        for i in 0..s {
            let (weights, lagrange) = (t.weights(t.c()[i]), t.lagrange(t.c()[i]));
            for j in 0..s {
                let error = (weights[j] - t.a()[i][j]).abs();
                assert!(error <= tolerance, "{}: b_{j}(c_{i}) is off by {error:e}", t.name());
                assert_eq!(lagrange[j], f64::from(i == j), "{}", t.name());
            }
        }
        for (j, (end, b)) in t.weights(1.0).iter().zip(t.b()).enumerate() {
            assert!((end - b).abs() <= tolerance, "{}: b_{j}(1)", t.name());
        }
        assert_eq!(t.weights(0.0), [0.0; _], "{}", t.name());
    });
}

#[test]
fn interpolation_of_polynomials() {
    for_collocation!(|t, _family| {
        let s = t.c().len();
        for theta in [-0.5, 0.0, 1e-9, 0.3, 0.77, 1.0, 1.25] {
            let (weights, lagrange) = (t.weights(theta), t.lagrange(theta));
            // Values at the nodes are at most one: the error is the sum of |ℓ_i| in roundings,
            // outside [0, 1] too.
            let lebesgue: f64 = lagrange.iter().map(|l| l.abs()).sum::<f64>().max(1.0);
            let integrals: f64 = weights.iter().map(|w| w.abs()).sum();
            for k in 0..s as i32 {
                let value: f64 = (0..s).map(|i| lagrange[i] * t.c()[i].powi(k)).sum();
                let integral: f64 = (0..s).map(|i| weights[i] * t.c()[i].powi(k)).sum();
                let tolerance = 8.0 * s as f64 * f64::EPSILON;
                assert!(
                    (value - theta.powi(k)).abs() <= tolerance * lebesgue,
                    "{} θ^{k} at {theta}",
                    t.name()
                );
                let exact = theta.powi(k + 1) / f64::from(k + 1);
                let error = (integral - exact).abs();
                assert!(
                    error <= tolerance * lebesgue.max(integrals),
                    "{} ∫θ^{k} at {theta}: {error:e}",
                    t.name()
                );
            }
        }
    });
}

/// `c_i = Σ_j a_ij` makes `t` an ordinary state: the end of a step of a quadrature of degree
/// `p − 1` is exact.
#[test]
fn interpolation_of_explicit_methods() {
    for_explicit!(|t| {
        let s = t.c().len();
        for k in 1..=t.order() {
            let terms: Vec<f64> = (0..s).map(|i| t.b()[i] * t.c()[i].powi(k as i32 - 1)).collect();
            let scale: f64 = terms.iter().map(|x| x.abs()).sum();
            let error = (terms.iter().sum::<f64>() - 1.0 / k as f64).abs();
            assert!(error <= 2.0 * s as f64 * f64::EPSILON * scale, "{}: B({k}) {error:e}", t.name());
        }
    });
}
