//! Hand-built models and the results of their analysis.

mod augmented_states;
mod branches;
mod duration;
mod index;
mod kinematic;
mod reduction;

use super::{Analysis, Facts, analyse};
use crate::graph::{Binary, Graph, Node, Op, Unary};
use crate::language::units::Units;
use crate::language::{Model, Sampling, Variables};
use proc_macro2::Span;

/// A model with the given dimensions `[nx, nz, nu, np]`.
fn model([nx, nz, nu, np]: [usize; 4], build: impl Fn(&mut Graph, &[Node]) -> Vec<Node>) -> Model {
    let names = |name: &str, count: usize| (0..count).map(|i| format!("{name}[{i}]")).collect();
    let mut graph = Graph::default();
    let v: Vec<Node> = (0..2 * nx + nz + nu + np + 1).map(|i| graph.variable(i as u32)).collect();
    let residual = build(&mut graph, &v);
    Model {
        name: syn::Ident::new("Test", Span::call_site()),
        visibility: syn::Visibility::Inherited,
        documentation: Vec::new(),
        instance: Vec::new(),
        variables: Variables { x: names("x", nx), z: names("z", nz), u: names("u", nu), p: names("p", np) },
        units: Units::default(),
        samplings: Vec::new(),
        reduction: None,
        duration: None,
        extra: crate::language::Extra::default(),
        is_model: false,
        spans: vec![Span::call_site(); residual.len()],
        graph,
        residual,
        opaque: Vec::new(),
        tables: Vec::new(),
        uses: Vec::new(),
        krate: syn::parse_quote!(::casados),
    }
}

fn refusal(model: Model) -> String {
    match analyse(model) {
        Ok(_) => panic!("the model was accepted"),
        Err(error) => error.to_string(),
    }
}

const END: &str = ": the model is not of index 1";

fn reason(model: Model) -> String {
    let message = refusal(model);
    message.split(END).next().unwrap_or_default().to_string()
}

fn accepted(model: Model) -> Analysis {
    analyse(model).unwrap_or_else(|error| panic!("{error}"))
}

fn sub(g: &mut Graph, a: Node, b: Node) -> Node {
    g.binary(Binary::Sub, a, b)
}

fn mul(g: &mut Graph, a: Node, b: Node) -> Node {
    g.binary(Binary::Mul, a, b)
}

/// `2 (ẋ₁ − u x₀) = 0`, `ẋ₀ − p x₁ = 0`
#[test]
fn explicit_model() {
    let analysis = accepted(model([2, 0, 1, 1], |g, v| {
        let two = g.constant(2.0);
        let (first, second) = (mul(g, v[4], v[2]), mul(g, v[5], v[3]));
        let (first, second) = (sub(g, v[1], first), sub(g, v[0], second));
        vec![mul(g, two, first), second]
    }));
    assert_eq!(analysis.explicit, Some(vec![(1, 1.0), (0, 2.0)]));
    let positions: Vec<_> = analysis.derivatives.jacobian.iter().map(|entry| (entry.0, entry.1)).collect();
    assert_eq!(positions, [(0, 1), (1, 0), (0, 2), (1, 3), (0, 4), (1, 5)]);
    assert_eq!(analysis.derivatives.blocks, [0, 2, 4, 4, 5, 6]);
    assert_eq!(analysis.derivatives.constant, [true, true, false, false, false, false]);
    assert_eq!(analysis.derivatives.linear, [false, false]);
    let hessian: Vec<_> = analysis.derivatives.hessian.iter().map(|entry| (entry.0, entry.1)).collect();
    assert_eq!(hessian, [(4, 2), (5, 3)]);
    assert_eq!(analysis.derivatives.gradient.len(), 6);
    // u x₀, ẋ₁ −, 2 ·, p x₁, ẋ₀ −
    assert_eq!(analysis.derivatives.operations.residual, 5);
}

/// Implicit models: a derivative twice, one with a varying or an unknown coefficient, an algebraic
/// state.
#[test]
fn implicit_models() {
    let coefficient = |coefficient: fn(&mut Graph, &[Node]) -> Node| {
        accepted(model([1, 0, 1, 0], move |g, v| {
            let factor = coefficient(g, v);
            let product = mul(g, factor, v[0]);
            vec![sub(g, product, v[1])]
        }))
    };
    assert!(coefficient(|g, _| g.constant(-3.0)).explicit.is_some());
    assert!(coefficient(|_, v| v[2]).explicit.is_none());
    assert!(coefficient(|_, v| v[3]).explicit.is_none());
    let outside = coefficient(|g, _| g.opaque(0));
    assert!(outside.explicit.is_none());
    assert_eq!(outside.derivatives.constant, [true, true]);
    assert_eq!(outside.derivatives.linear, [true]);
    assert!(coefficient(|_, v| v[0]).explicit.is_none());

    let coupled = accepted(model([2, 0, 0, 0], |g, v| vec![sub(g, v[0], v[1]), sub(g, v[1], v[2])]));
    assert!(coupled.explicit.is_none());
    let algebraic = accepted(model([1, 1, 0, 0], |g, v| vec![sub(g, v[0], v[1]), sub(g, v[2], v[1])]));
    assert!(algebraic.explicit.is_none());
    assert_eq!(algebraic.derivatives.blocks, [0, 1, 3, 4, 4, 4]);
}

#[test]
fn linear_equations() {
    let analysis = accepted(model([2, 0, 1, 0], |g, v| {
        let sine = g.unary(Unary::Sin, v[5]);
        let (with_time, product) = (mul(g, sine, v[2]), mul(g, v[2], v[4]));
        vec![sub(g, v[0], with_time), sub(g, v[1], product)]
    }));
    assert_eq!(analysis.derivatives.linear, [true, false]);
    // Time is no direction of derivatives, but the entry depends on it.
    assert_eq!(analysis.derivatives.constant, [true, true, false, false, false]);
    assert!(analysis.derivatives.jacobian.iter().all(|entry| entry.1 < 5));
}

/// `ẋ₀ − 2 x₁`, `c ẋ₁ − sin(t) x₁ − u`, `ẋ₂ − p x₀²`, `z − x₀ − 1`: entries that vary with the
/// state, with time, or not at all.
#[test]
fn facts() {
    let build = |square: bool, time: bool| {
        accepted(model([3, 1, 2, 1], move |g, v| {
            let (x, z, u, p) = (&v[3..6], v[6], v[7], v[9]);
            let (one, two) = (g.constant(1.0), g.constant(2.0));
            let twice = mul(g, two, x[1]);
            let first = sub(g, v[0], twice);
            let factor = if time { g.unary(Unary::Sin, v[10]) } else { p };
            let (outside, swinging) = (g.opaque(0), mul(g, factor, x[1]));
            let scaled = mul(g, outside, v[1]);
            let second = sub(g, scaled, swinging);
            let second = sub(g, second, u);
            let power = if square { mul(g, x[0], x[0]) } else { x[0] };
            let power = mul(g, p, power);
            let (third, fourth) = (sub(g, v[2], power), sub(g, z, x[0]));
            vec![first, second, third, sub(g, fourth, one)]
        }))
        .facts
    };
    let expected = Facts {
        linear_in_state: false,
        constant_matrix: false,
        autonomous: false,
        constant_rows: vec![true, false, false, true],
        trivial: vec![0],
        quadratures: vec![2],
        // x₀, x₁, u₀ and p₀; neither x₂ nor u₁.
        directions: vec![0, 1, 3, 5],
        curved: vec![3, 9],
        diagonal_controls: vec![],
    };
    assert_eq!(build(true, true), expected);
    let straight = Facts { linear_in_state: true, ..expected.clone() };
    assert_eq!(build(false, true), straight);
    // The bilinear terms p x₀ and p x₁ are nonlinear, but not within an interval.
    let constant = Facts { constant_matrix: true, autonomous: true, curved: vec![3, 4, 9], ..straight };
    assert_eq!(build(false, false), constant);
}

/// A row with one variable or a function of time at the right is trivial; with two variables or a
/// varying coefficient it is not.
#[test]
fn trivial_rows() {
    let trivial = |row: fn(&mut Graph, &[Node]) -> Node| {
        accepted(model([1, 0, 2, 0], move |g, v| {
            let right = row(g, v);
            vec![sub(g, v[0], right)]
        }))
        .facts
        .trivial
    };
    assert_eq!(trivial(|_, v| v[1]), [0]);
    assert_eq!(trivial(|_, v| v[2]), [0]);
    assert_eq!(trivial(|g, _| g.constant(3.0)), [0]);
    assert_eq!(trivial(|g, v| g.unary(Unary::Sin, v[4])), [0]);
    assert!(trivial(|g, v| sub(g, v[2], v[3])).is_empty());
    assert!(trivial(|g, v| mul(g, v[2], v[3])).is_empty());
    assert!(trivial(|g, v| mul(g, v[4], v[1])).is_empty());
}

/// `ẋ₀ = 2 x₁`, `ẋ₁ = u`, and squares of all of them in `z`: that of `u` does not need its row of
/// `D`.
#[test]
fn squares_of_multiples() {
    let facts = |product: bool| {
        accepted(model([2, 1, 1, 0], move |g, v| {
            let two = g.constant(2.0);
            let twice = mul(g, two, v[3]);
            let mut third = v[4];
            for square in [0, 1, 3, 5] {
                let square = mul(g, v[square], v[square]);
                third = sub(g, third, square);
            }
            if product {
                let product = mul(g, v[5], v[2]);
                third = sub(g, third, product);
            }
            vec![sub(g, v[0], twice), sub(g, v[1], v[5]), third]
        }))
        .facts
    };
    let alone = facts(false);
    assert_eq!((alone.curved, alone.diagonal_controls), (vec![0, 1, 3], vec![(3, 2)]));
    // u x₀ needs both.
    let together = facts(true);
    assert_eq!((together.curved, together.diagonal_controls), (vec![0, 1, 2, 3, 5], Vec::new()));
}

/// `ẋ − x z₀ − z₁ = 0`, `(u − 30) z₀ + 2 z₁ = 1`, `2 z₀ + 3 z₁ = u`: at `u = 30` the coefficient of
/// `z₀` vanishes, which only a nominal value or a range of `u` can show.
#[test]
fn nominal_values_and_ranges_decide_about_pivots() {
    let pivots = |sampling: Sampling| {
        let mut model = model([1, 2, 1, 0], |g, v| {
            let [one, two, three, thirty] = [1.0, 2.0, 3.0, 30.0].map(|value| g.constant(value));
            let (x, [z0, z1, u]) = (v[1], [v[2], v[3], v[4]]);
            let (product, coefficient) = (mul(g, x, z0), sub(g, u, thirty));
            let first = sub(g, v[0], product);
            let (left, right) = (mul(g, coefficient, z0), mul(g, two, z1));
            let second = g.binary(Binary::Add, left, right);
            let (left, right) = (mul(g, two, z0), mul(g, three, z1));
            let third = g.binary(Binary::Add, left, right);
            vec![sub(g, first, z1), sub(g, second, one), sub(g, third, u)]
        });
        model.samplings = vec![Sampling::default(); 6];
        model.samplings[4] = sampling;
        accepted(model).elimination.plan.pivots
    };
    let at = |row, column, pivots: &[(u32, u32)]| pivots.contains(&(row, column));
    let known = |nominal, range| pivots(Sampling { nominal, range });
    // Determined by the second equation: the coefficient must not vanish.
    assert!(at(1, 1, &known(None, None)));
    assert!(!at(1, 1, &known(Some(30.0), None)));
    assert!(!at(1, 1, &known(Some(30.0), Some((0.0, 60.0)))));
    assert!(!at(1, 1, &known(None, Some((29.9, 30.1)))));
    assert!(at(1, 1, &known(Some(-5.0), Some((-6.0, 6.0)))));
}

#[test]
fn residual_may_be_a_variable_or_a_constant() {
    let analysis = accepted(model([1, 0, 0, 0], |_, v| vec![v[0]]));
    assert_eq!(analysis.explicit, Some(vec![(0, 1.0)]));
    assert_eq!(analysis.model.graph.op(analysis.derivatives.gradient[0]), Op::Seed(0));
    assert!(
        reason(model([1, 0, 0, 0], |g, _| vec![g.constant(1.0)])).contains("equation 0 contains neither")
    );
}
