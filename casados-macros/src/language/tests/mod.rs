//! The evaluator against rustc: each function is compiled, and executed symbolically from its own
//! tokens; both must return bitwise equal numbers.

mod control;
mod errors;
mod functions;
mod models;
mod order;
mod patterns;
mod selection;
mod values;

use super::evaluator::Evaluator;
use super::value::{Function, Value};
use crate::graph::EvaluationPoint;
use crate::graph::Node;
use std::rc::Rc;

/// Points for the comparison of snippets: signs differ, some numbers are equal, some are 0.
pub const POINTS: [[f64; 6]; 5] = [
    [0.3, -1.7, 2.9, 0.11, -0.6, 5.3],
    [-0.3, 1.7, -2.9, -0.11, 0.6, -5.3],
    [1.0, 1.0, 2.0, 2.0, -3.0, -3.0],
    [0.0, 0.5, 0.0, -0.5, 1.0, 1e-9],
    [1e3, -1e-3, 7.25, -7.5, 0.125, 40.0],
];

/// Collects the numbers of a result, in order.
pub trait CollectNumbers {
    fn numbers(&self, list: &mut Vec<f64>);
}

impl CollectNumbers for f64 {
    fn numbers(&self, list: &mut Vec<f64>) {
        list.push(*self);
    }
}

impl<T: CollectNumbers, const N: usize> CollectNumbers for [T; N] {
    fn numbers(&self, list: &mut Vec<f64>) {
        self.iter().for_each(|element| element.numbers(list));
    }
}

impl<A: CollectNumbers, B: CollectNumbers> CollectNumbers for (A, B) {
    fn numbers(&self, list: &mut Vec<f64>) {
        self.0.numbers(list);
        self.1.numbers(list);
    }
}

/// The nodes of a result, in order.
fn nodes(evaluator: &mut Evaluator, value: &Value, list: &mut Vec<Node>) {
    match value {
        Value::Tuple(parts) | Value::Array(parts) => {
            parts.iter().for_each(|part| nodes(evaluator, part, list));
        }
        Value::Matrix(matrix) => matrix.elements.iter().for_each(|part| nodes(evaluator, part, list)),
        Value::Struct(structure) => structure.fields.iter().for_each(|part| nodes(evaluator, part, list)),
        other => list.push(evaluator.real(other, &"").unwrap()),
    }
}

/// Runs a test with the stack size of macros in compilers, 8 MiB.
pub fn on_compiler_stack(test: fn()) {
    let thread = std::thread::Builder::new().stack_size(8 << 20).spawn(test).unwrap();
    thread.join().unwrap();
}

/// Executes `fn f(x: [f64; 6])` symbolically.
pub fn evaluate(source: &str) -> syn::Result<(Evaluator, Vec<Node>)> {
    let tokens = syn::parse_str(source)?;
    super::tokens::check(&tokens)?;
    let item = Rc::new(syn::parse2::<syn::ItemFn>(tokens)?);
    let mut evaluator = Evaluator::default();
    let x = (0..6).map(|index| Value::Real(evaluator.graph.variable(index))).collect();
    let function = Function { item, scope: Rc::default(), turbofish: Vec::new(), owner: None };
    let value = evaluator.call(&Value::Function(Rc::new(function)), vec![Value::array(x)], &"")?;
    let mut list = Vec::new();
    nodes(&mut evaluator, &value, &mut list);
    Ok((evaluator, list))
}

/// Compares the compiled function with its symbolic execution.
pub fn compare<R: CollectNumbers>(name: &str, source: &str, compiled: impl Fn([f64; 6]) -> R) {
    let (evaluator, list) = match evaluate(source) {
        Ok(result) => result,
        Err(error) => panic!("{name}: {error}"),
    };
    for point in POINTS {
        let mut expected = Vec::new();
        compiled(point).numbers(&mut expected);
        let found =
            evaluator.graph.evaluate(&list, EvaluationPoint { variables: &point, ..Default::default() });
        assert_eq!(expected.len(), found.len(), "{name}: number of results");
        for (expected, found) in expected.iter().zip(&found) {
            // Structural zeros have no sign.
            let same = expected.to_bits() == found.to_bits()
                || *expected == 0.0 && *found == 0.0
                || expected.is_nan() && found.is_nan();
            assert!(same, "{name} at {point:?}: {expected:e} compiled, {found:e} symbolically");
        }
    }
}

/// Functions that are compiled, and executed symbolically from their tokens.
macro_rules! same {
    ($($name:ident: $function:item)*) => {$(
        #[test]
        #[allow(warnings, clippy::all)]
        fn $name() {
            $function
            $crate::language::tests::compare(stringify!($name), stringify!($function), f);
        }
    )*};
}
pub(crate) use same;
