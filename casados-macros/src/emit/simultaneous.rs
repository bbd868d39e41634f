//! Groups elementary functions: two arguments in a wider register take hardly longer than one, and
//! of four interleaved ones the processor works on some while others wait for their own results.

use super::chunk::computed;
use super::schedule::{Statement, Values};
use crate::graph::{Binary, Graph, Node, Op, Unary};
use std::collections::{BTreeSet, HashMap, VecDeque};

/// Maximum number of statements by which a function is moved forward to a group: its result
/// occupies a register until its use.
const MAX_LOOKAHEAD: usize = 500;

/// An elementary function that is worth grouping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Function {
    /// A function of one argument.
    Unary(Unary),
    /// A function of two arguments.
    Binary(Binary),
    /// Sine and cosine.
    SinCos,
}

/// The function that a statement computes, and its values.
fn function(graph: &Graph, step: Statement) -> Option<(Function, Values)> {
    match step {
        Statement::SinCos(sin, cos) => Some((Function::SinCos, (sin, Some(cos)))),
        Statement::Compute(node) => {
            let function = match graph.op(node) {
                Op::Unary(Unary::Neg | Unary::Sqrt | Unary::Abs | Unary::Signum | Unary::Table(_), _) => {
                    return None;
                }
                Op::Unary(function, _) => Function::Unary(function),
                Op::Binary(function @ (Binary::Powf | Binary::Atan2 | Binary::Hypot), ..) => {
                    Function::Binary(function)
                }
                _ => return None,
            };
            Some((function, (node, None)))
        }
        Statement::Together(_) | Statement::Store(_) => None,
    }
}

/// The function with these values.
pub fn function_of(graph: &Graph, (node, other): Values) -> Option<Function> {
    let step = other.map_or(Statement::Compute(node), |cos| Statement::SinCos(node, cos));
    function(graph, step).map(|(function, _)| function)
}

/// Groups each elementary function with the next one or three of its kind and level, preceded by
/// the statements that these depend on. The level of a value is its maximum nesting depth of
/// elementary functions, so that functions of one level are independent.
pub fn group_simultaneous_calls(graph: &Graph, steps: &[Statement]) -> Vec<Statement> {
    let mut position = HashMap::new();
    let mut levels = vec![0u32; steps.len()];
    let mut waiting: HashMap<(Function, u32), VecDeque<usize>> = HashMap::new();
    for (index, &step) in steps.iter().enumerate() {
        let operands = operands(graph, step).filter_map(|node| position.get(&node).copied());
        levels[index] = operands.map(|at: usize| levels[at]).max().unwrap_or(0);
        if let Some((kind, _)) = function(graph, step) {
            levels[index] += 1;
            waiting.entry((kind, levels[index])).or_default().push_back(index);
        }
        position.extend(computed(step).map(|node| (node, index)));
    }
    let mut list = Vec::with_capacity(steps.len());
    let mut done = vec![false; steps.len()];
    for (index, &step) in steps.iter().enumerate() {
        if done[index] {
            continue;
        }
        done[index] = true;
        let Some((kind, values)) = function(graph, step) else {
            list.push(step);
            continue;
        };
        let others = waiting.entry((kind, levels[index])).or_default();
        while others.front().is_some_and(|&other| done[other]) {
            others.pop_front();
        }
        let near = others.iter().take(3).take_while(|&&other| other - index < MAX_LOOKAHEAD).count();
        let partners: Vec<usize> = others.drain(..if near == 3 { 3 } else { near.min(1) }).collect();
        if partners.is_empty() {
            list.push(step);
            continue;
        }
        // The statements that the others depend on.
        let mut first = BTreeSet::new();
        let mut stack = partners.clone();
        while let Some(at) = stack.pop() {
            let before = operands(graph, steps[at]).filter_map(|node| position.get(&node).copied());
            stack.extend(before.filter(|&at| !done[at] && first.insert(at)));
        }
        for at in first {
            done[at] = true;
            list.push(steps[at]);
        }
        let mut all = [Some(values), None, None, None];
        for (to, &other) in all[1..].iter_mut().zip(&partners) {
            done[other] = true;
            *to = function(graph, steps[other]).map(|(_, values)| values);
        }
        list.push(Statement::Together(all));
    }
    list
}

/// The operands of a computing statement.
fn operands(graph: &Graph, step: Statement) -> impl Iterator<Item = Node> {
    computed(step).take(1).flat_map(|node| graph.op(node).operands())
}

#[cfg(test)]
mod tests {
    use super::super::schedule::{schedule, tests::assert_complete};
    use super::*;

    fn check(graph: &Graph, outputs: &[Node]) -> Vec<Statement> {
        let steps = group_simultaneous_calls(graph, &schedule(graph, outputs));
        assert_complete(graph, outputs, &steps);
        for step in &steps {
            if let Statement::Together(values) = *step {
                let functions: Vec<_> =
                    values.into_iter().flatten().map(|values| function_of(graph, values)).collect();
                assert!(matches!(functions.len(), 2 | 4) && functions[0].is_some(), "{functions:?}");
                assert!(functions.iter().all(|function| *function == functions[0]), "{functions:?}");
            }
        }
        steps
    }

    fn paired_step(a: Values, b: Values) -> Statement {
        Statement::Together([Some(a), Some(b), None, None])
    }

    #[test]
    fn independent_calls_are_grouped() {
        let mut g = Graph::default();
        let x = [0, 1, 2].map(|index| g.variable(index));
        let scaled = x.map(|x| g.binary(Binary::Mul, x, x));
        let inner = scaled.map(|a| g.unary(Unary::Exp, a));
        let outer = inner.map(|a| g.unary(Unary::Exp, a));
        let steps = check(&g, &outer);
        // The third is left over.
        assert!(steps.contains(&paired_step((inner[0], None), (inner[1], None))), "{steps:?}");
        assert!(steps.contains(&paired_step((outer[0], None), (outer[1], None))), "{steps:?}");
        assert_eq!(
            steps.iter().filter(|step| matches!(step, Statement::Together(_))).count(),
            2,
            "{steps:?}"
        );
        // A function of a function of the same kind depends on it.
        assert!(!check(&g, &[outer[0]]).iter().any(|step| matches!(step, Statement::Together(_))));

        let (s, c) = (x.map(|x| g.unary(Unary::Sin, x)), x.map(|x| g.unary(Unary::Cos, x)));
        let sums = [0, 1].map(|k| g.binary(Binary::Add, s[k], c[k]));
        assert_eq!(check(&g, &sums)[0], paired_step((s[0], Some(c[0])), (s[1], Some(c[1]))));
    }

    #[test]
    fn groups_of_four_then_pairs() {
        let mut g = Graph::default();
        let x: [Node; 7] = std::array::from_fn(|index| g.variable(index as u32));
        let f = x.map(|x| g.unary(Unary::Ln, x));
        let found: Vec<Statement> =
            check(&g, &f).into_iter().filter(|step| !matches!(step, Statement::Store(_))).collect();
        let values = [0, 1, 2, 3].map(|k| Some((f[k], None)));
        assert_eq!(
            found,
            [Statement::Together(values), paired_step((f[4], None), (f[5], None)), Statement::Compute(f[6])]
        );
    }

    #[test]
    fn long_chains_take_no_longer_than_short_ones() {
        let mut g = Graph::default();
        let mut nodes = [g.variable(0), g.variable(1)];
        for _ in 0..20_000 {
            nodes = nodes.map(|node| g.unary(Unary::Atan, node));
        }
        let sum = g.binary(Binary::Add, nodes[0], nodes[1]);
        // In depth-first order the second chain starts at the end of the first one, out of reach.
        assert!(!check(&g, &[sum]).iter().any(|step| matches!(step, Statement::Together(_))));
    }
}
