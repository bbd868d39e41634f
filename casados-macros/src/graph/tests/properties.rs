//! Derivatives of random expressions against `num-dual` and the complex step, within bounds of the
//! rounding errors of both sides; a failing expression is shrunk to the smallest one.

use crate::graph::{Binary, Compare, Graph, Node, Op, Unary, gradient, hessian, jacobian};
use casados_core::Scalar;
use casados_core::testing::{Bounded, Forward};
use num_complex::Complex64;
use num_dual::{Dual64, HyperDual64};
use proptest::prelude::*;

const VARIABLES: usize = 3;
/// The complex step `2⁻⁶⁶⁴`, a power of two, so that multiplications by it are exact.
const COMPLEX_STEP: f64 = f64::from_bits((1023 - 664) << 52);
/// Maximum ratio of the operations of a reference and of `Forward`.
const REFERENCE_ERROR_FACTOR: f64 = 4.0;

/// An expression; arguments are mapped into the domain of each function when the graph is built.
#[derive(Clone, Debug)]
enum Tree {
    Variable(u32),
    Constant(f64),
    Unary(Unary, Box<Tree>),
    Binary(Binary, Box<Tree>, Box<Tree>),
    Powi(Box<Tree>, i32),
    Select(Compare, bool, Box<[Tree; 4]>),
}

fn functions() -> impl Strategy<Value = Unary> {
    use Unary::*;
    proptest::sample::select(vec![
        Neg, Sqrt, Cbrt, Exp, Exp2, ExpM1, Ln, Ln1p, Log2, Log10, Sin, Cos, Tan, Asin, Acos, Atan, Sinh,
        Cosh, Tanh, Asinh, Acosh, Atanh, Abs, Signum,
    ])
}

fn operators() -> impl Strategy<Value = Binary> {
    use Binary::*;
    proptest::sample::select(vec![Add, Sub, Mul, Mul, Div, Powf, Atan2, Hypot])
}

fn trees() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        4 => (0..VARIABLES as u32).prop_map(Tree::Variable),
        1 => (-16..=16i32).prop_map(|eighths| Tree::Constant(f64::from(eighths) / 8.0)),
    ];
    leaf.prop_recursive(6, 48, 4, |inner| {
        let boxed = || inner.clone().prop_map(Box::new);
        let comparison = proptest::sample::select(vec![Compare::Lt, Compare::Le, Compare::Eq]);
        let four = (inner.clone(), inner.clone(), inner.clone(), inner.clone());
        prop_oneof![
            4 => (functions(), boxed()).prop_map(|(f, a)| Tree::Unary(f, a)),
            4 => (operators(), boxed(), boxed()).prop_map(|(f, a, b)| Tree::Binary(f, a, b)),
            1 => (boxed(), -3..=5i32).prop_map(|(a, n)| Tree::Powi(a, n)),
            1 => (comparison, any::<bool>(), four)
                .prop_map(|(c, not, (a, b, x, y))| Tree::Select(c, not, Box::new([a, b, x, y]))),
        ]
    })
}

impl Tree {
    fn build(&self, graph: &mut Graph) -> Node {
        match self {
            Tree::Variable(index) => graph.variable(*index),
            Tree::Constant(value) => graph.constant(*value),
            Tree::Unary(function, a) => {
                let a = a.build(graph);
                let a = into_domain(graph, *function, a);
                graph.unary(*function, a)
            }
            Tree::Binary(function, a, b) => {
                let (a, b) = (a.build(graph), b.build(graph));
                let positive = |graph: &mut Graph, a| into_domain(graph, Unary::Ln, a);
                let (a, b) = match function {
                    Binary::Powf => (positive(graph, a), graph.unary(Unary::Sin, b)),
                    Binary::Div | Binary::Atan2 | Binary::Hypot => (a, positive(graph, b)),
                    _ => (a, b),
                };
                graph.binary(*function, a, b)
            }
            Tree::Powi(a, n) => {
                let a = a.build(graph);
                let a = into_domain(graph, Unary::Ln, a);
                graph.powi(a, *n)
            }
            Tree::Select(comparison, not, four) => {
                let [a, b, x, y] = four.as_ref().each_ref().map(|tree| tree.build(graph));
                let condition = graph.compare(*comparison, a, b);
                let condition = if *not { graph.not(condition) } else { condition };
                graph.select(condition, x, y)
            }
        }
    }
}

/// A smooth map of any argument into the domain of a function, where its value is moderate.
fn into_domain(graph: &mut Graph, function: Unary, a: Node) -> Node {
    use Unary::*;
    let affine = |graph: &mut Graph, shift: f64, scale: f64, of: Node| {
        let (shift, scale) = (graph.constant(shift), graph.constant(scale));
        let product = graph.binary(Binary::Mul, scale, of);
        graph.binary(Binary::Add, shift, product)
    };
    match function {
        Sqrt | Cbrt | Ln | Log2 | Log10 => {
            let sine = graph.unary(Sin, a);
            affine(graph, 1.5, 1.0, sine)
        }
        Acosh => {
            let sine = graph.unary(Sin, a);
            affine(graph, 2.5, 1.0, sine)
        }
        Ln1p | Asin | Acos | Atanh | Tan => {
            let sine = graph.unary(Sin, a);
            affine(graph, 0.0, 0.875, sine)
        }
        Exp | Exp2 | ExpM1 | Sinh | Cosh => graph.unary(Atan, a),
        _ => a,
    }
}

/// The values of nodes in any arithmetic.
fn evaluate<S: Scalar>(graph: &Graph, nodes: &[Node], variables: &[S], seed: S) -> Vec<S> {
    evaluate_with(unary, graph, nodes, variables, seed)
}

/// As [`evaluate`], with other functions of one argument.
fn evaluate_with<S: Scalar>(
    unary: fn(Unary, S) -> S,
    graph: &Graph,
    nodes: &[Node],
    variables: &[S],
    seed: S,
) -> Vec<S> {
    let mut values = vec![S::from_f64(f64::NAN); graph.len()];
    let mut masks: Vec<Option<S::Mask>> = vec![None; graph.len()];
    for node in graph.reachable(nodes) {
        let at = |node: Node| values[node.at()];
        let mask = |node: Node| masks[node.at()].expect("operands come first");
        match graph.op(node) {
            Op::Compare(Compare::Lt, a, b) => masks[node.at()] = Some(S::lt(at(a), at(b))),
            Op::Compare(Compare::Le, a, b) => masks[node.at()] = Some(S::le(at(a), at(b))),
            Op::Compare(Compare::Eq, a, b) => masks[node.at()] = Some(S::eq(at(a), at(b))),
            Op::And(a, b) => masks[node.at()] = Some(S::and(mask(a), mask(b))),
            Op::Or(a, b) => masks[node.at()] = Some(S::or(mask(a), mask(b))),
            Op::Not(a) => masks[node.at()] = Some(S::not(mask(a))),
            Op::Constant(bits) => values[node.at()] = S::from_f64(f64::from_bits(bits)),
            Op::Variable(index) => values[node.at()] = variables[index as usize],
            Op::Opaque(_) => unreachable!("these graphs have no constants from outside"),
            Op::Seed(_) => values[node.at()] = seed,
            Op::Unary(function, a) => values[node.at()] = unary(function, at(a)),
            Op::Binary(function, a, b) => values[node.at()] = binary(function, at(a), at(b)),
            Op::Powi(a, n) => values[node.at()] = at(a).powi(n),
            Op::Select(condition, a, b) => values[node.at()] = S::select(mask(condition), at(a), at(b)),
        }
    }
    nodes.iter().map(|node| values[node.at()]).collect()
}

fn unary<S: Scalar>(function: Unary, a: S) -> S {
    match function {
        Unary::Neg => -a,
        Unary::Sqrt => a.sqrt(),
        Unary::Cbrt => a.cbrt(),
        Unary::Exp => a.exp(),
        Unary::Exp2 => a.exp2(),
        Unary::ExpM1 => a.exp_m1(),
        Unary::Ln => a.ln(),
        Unary::Ln1p => a.ln_1p(),
        Unary::Log2 => a.log2(),
        Unary::Log10 => a.log10(),
        Unary::Sin => a.sin(),
        Unary::Cos => a.cos(),
        Unary::Tan => a.tan(),
        Unary::Asin => a.asin(),
        Unary::Acos => a.acos(),
        Unary::Atan => a.atan(),
        Unary::Sinh => a.sinh(),
        Unary::Cosh => a.cosh(),
        Unary::Tanh => a.tanh(),
        Unary::Asinh => a.asinh(),
        Unary::Acosh => a.acosh(),
        Unary::Atanh => a.atanh(),
        Unary::Abs => a.abs(),
        Unary::Signum => a.signum(),
        Unary::Table(_) => unreachable!("no table is drawn"),
    }
}

/// `num-dual` differentiates these functions as quotients, with larger rounding errors.
fn unary_of_reference<S: Scalar>(function: Unary, a: S) -> S {
    match function {
        Unary::Tan => a.sin() / a.cos(),
        Unary::Tanh => a.sinh() / a.cosh(),
        _ => unary(function, a),
    }
}

fn binary<S: Scalar>(function: Binary, a: S, b: S) -> S {
    match function {
        Binary::Add => a + b,
        Binary::Sub => a - b,
        Binary::Mul => a * b,
        Binary::Div => a / b,
        Binary::Powf => a.powf(b),
        Binary::Atan2 => a.atan2(b),
        Binary::Hypot => a.hypot(b),
        Binary::Table(_) => unreachable!("no table is drawn"),
    }
}

/// Tests equality within both errors; passes if there is no bound.
fn close(what: &str, found: Bounded, expected: f64, error: f64) -> Result<(), TestCaseError> {
    let tolerance = found.error + REFERENCE_ERROR_FACTOR * error;
    let difference = (found.value - expected).abs();
    prop_assert!(
        difference <= tolerance || !tolerance.is_finite(),
        "{what}: {:e}, expected {expected:e}, off by {difference:e}, allowed {tolerance:e}",
        found.value
    );
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..Default::default() })]

    #[test]
    fn derivatives_of_random_expressions(
        tree in trees(),
        point in proptest::array::uniform3(-2.0..2.0f64),
        mu in -1.5..1.5f64,
    ) {
        let mut graph = Graph::default();
        let f = tree.build(&mut graph);
        let exact = Bounded::exact;
        let is = |a: usize, b: usize| f64::from(u8::from(a == b));

        // The derivatives of the graph, with bounds.
        let seed = graph.seed(0);
        let rows = jacobian(&mut graph, &[f], VARIABLES as u32);
        let adjoint = gradient(&mut graph, &[(f, seed)], VARIABLES as u32);
        let second = hessian(&mut graph, &[(f, seed)], VARIABLES as u32);
        let own = |nodes: &[Node]| evaluate(&graph, nodes, &point.map(exact), exact(mu));
        let mut first = [exact(0.0); VARIABLES];
        for &(_, j, node) in &rows {
            first[j as usize] = own(&[node])[0];
        }
        let adjoint = own(&adjoint);
        let mut curvature = [[exact(0.0); VARIABLES]; VARIABLES];
        for &(i, j, node) in &second {
            curvature[i as usize][j as usize] = own(&[node])[0];
        }

        for i in 0..VARIABLES {
            let seeded = |k: usize| Forward { re: exact(point[k]), d: exact(is(k, i)) };
            let bound = evaluate_with(unary_of_reference, &graph, &[f], &[0, 1, 2].map(seeded), seeded(0))[0].d;
            let dual = [0, 1, 2].map(|k| Dual64::new(point[k], is(k, i)));
            let dual = evaluate(&graph, &[f], &dual, Dual64::from(mu))[0].eps;
            let complex = [0, 1, 2].map(|k| Complex64::new(point[k], COMPLEX_STEP * is(k, i)));
            let complex = evaluate(&graph, &[f], &complex, Complex64::from(mu))[0].im / COMPLEX_STEP;
            close("num-dual", first[i], dual, bound.error)?;
            close("complex step", first[i], complex, bound.error)?;
            let product = exact(mu) * Bounded { value: dual, error: REFERENCE_ERROR_FACTOR * bound.error };
            close("adjoint", adjoint[i], product.value, product.error)?;

            for (j, entry) in curvature[i].iter().enumerate().take(i + 1) {
                let nested = |k: usize| Forward {
                    re: Forward { re: exact(point[k]), d: exact(is(k, i)) },
                    d: Forward { re: exact(is(k, j)), d: exact(0.0) },
                };
                let bound = evaluate_with(unary_of_reference, &graph, &[f], &[0, 1, 2].map(nested), nested(0))[0].d.d;
                let hyper = [0, 1, 2].map(|k| HyperDual64::new(point[k], is(k, i), is(k, j), 0.0));
                let hyper = evaluate(&graph, &[f], &hyper, HyperDual64::from(mu))[0].eps1eps2;
                let product = exact(mu) * Bounded { value: hyper, error: REFERENCE_ERROR_FACTOR * bound.error };
                close("Hessian", *entry, product.value, product.error)?;
            }
        }
    }
}
