//! Elementary functions in pairs: two arguments at once take hardly longer than one in registers that have room for both.

use super::chunk::computed;
use super::schedule::{Step, Values};
use crate::graph::{Binary, Graph, Node, Op, Unary};
use std::collections::{BTreeSet, HashMap, VecDeque};

/// So many statements a function may come earlier than it would, to be one of a pair: what waits for its use in the
/// meantime takes registers.
const REACH: usize = 500;

/// An elementary function that is worth being one of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Function {
    /// Of one argument.
    Unary(Unary),
    /// Of two arguments.
    Binary(Binary),
    /// Sine and cosine.
    SinCos,
}

/// The function that a statement computes, and its values.
fn function(graph: &Graph, step: Step) -> Option<(Function, Values)> {
    match step {
        Step::SinCos(sin, cos) => Some((Function::SinCos, (sin, Some(cos)))),
        Step::Compute(node) => {
            let function = match graph.op(node) {
                Op::Unary(Unary::Neg | Unary::Sqrt | Unary::Abs | Unary::Signum, _) => return None,
                Op::Unary(function, _) => Function::Unary(function),
                Op::Binary(function @ (Binary::Powf | Binary::Atan2 | Binary::Hypot), ..) => {
                    Function::Binary(function)
                }
                _ => return None,
            };
            Some((function, (node, None)))
        }
        Step::Both(_) | Step::Store(_) => None,
    }
}

/// The function of a pair.
pub fn function_of(graph: &Graph, (node, other): Values) -> Option<Function> {
    let step = other.map_or(Step::Compute(node), |cos| Step::SinCos(node, cos));
    function(graph, step).map(|(function, _)| function)
}

/// The same statements, elementary functions with the next one of their kind and level: what that one waits for comes before
/// both. The level of a value is the most elementary functions that are one within the other in it, so that none of a level waits
/// for another.
pub fn in_pairs(graph: &Graph, steps: &[Step]) -> Vec<Step> {
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
        let others = function(graph, step).and_then(|(kind, _)| waiting.get_mut(&(kind, levels[index])));
        let partner = others.and_then(|others| {
            while others.front().is_some_and(|&other| done[other]) {
                others.pop_front();
            }
            let is_near = others.front().is_some_and(|&other| other - index < REACH);
            if is_near { others.pop_front() } else { None }
        });
        let (Some(other), Some((_, values))) = (partner, function(graph, step)) else {
            list.push(step);
            continue;
        };
        // What the other one waits for.
        let mut first = BTreeSet::new();
        let mut stack = vec![other];
        while let Some(at) = stack.pop() {
            let before = operands(graph, steps[at]).filter_map(|node| position.get(&node).copied());
            stack.extend(before.filter(|&at| !done[at] && first.insert(at)));
        }
        for at in first {
            done[at] = true;
            list.push(steps[at]);
        }
        done[other] = true;
        list.extend(function(graph, steps[other]).map(|(_, others)| Step::Both([values, others])));
    }
    list
}

/// What a statement that computes something reads.
fn operands(graph: &Graph, step: Step) -> impl Iterator<Item = Node> {
    computed(step).take(1).flat_map(|node| graph.op(node).operands())
}

#[cfg(test)]
mod tests {
    use super::super::schedule::{schedule, tests::assert_complete};
    use super::*;

    fn check(graph: &Graph, outputs: &[Node]) -> Vec<Step> {
        let steps = in_pairs(graph, &schedule(graph, outputs));
        assert_complete(graph, outputs, &steps);
        for step in &steps {
            if let Step::Both([a, b]) = *step {
                assert!(function_of(graph, a).is_some() && function_of(graph, a) == function_of(graph, b));
            }
        }
        steps
    }

    #[test]
    fn functions_go_in_pairs_where_they_do_not_wait_for_each_other() {
        let mut g = Graph::default();
        let x = [0, 1, 2].map(|index| g.variable(index));
        let scaled = x.map(|x| g.binary(Binary::Mul, x, x));
        let inner = scaled.map(|a| g.unary(Unary::Exp, a));
        let outer = inner.map(|a| g.unary(Unary::Exp, a));
        let steps = check(&g, &outer);
        let both = |a: Node, b: Node| Step::Both([(a, None), (b, None)]);
        // The third has no other one left.
        assert!(steps.contains(&both(inner[0], inner[1])), "{steps:?}");
        assert!(steps.contains(&both(outer[0], outer[1])), "{steps:?}");
        assert_eq!(steps.iter().filter(|step| matches!(step, Step::Both(_))).count(), 2, "{steps:?}");
        // A function of a function of the same kind waits for it.
        assert!(!check(&g, &[outer[0]]).iter().any(|step| matches!(step, Step::Both(_))));

        let (s, c) = (x.map(|x| g.unary(Unary::Sin, x)), x.map(|x| g.unary(Unary::Cos, x)));
        let sums = [0, 1].map(|k| g.binary(Binary::Add, s[k], c[k]));
        let pair = Step::Both([(s[0], Some(c[0])), (s[1], Some(c[1]))]);
        assert_eq!(check(&g, &sums)[0], pair);
    }

    #[test]
    fn long_chains_take_no_longer_than_short_ones() {
        let mut g = Graph::default();
        let mut nodes = [g.variable(0), g.variable(1)];
        for _ in 0..20_000 {
            nodes = nodes.map(|node| g.unary(Unary::Atan, node));
        }
        let sum = g.binary(Binary::Add, nodes[0], nodes[1]);
        // Depth first the second chain begins where the first one ends, out of reach.
        assert!(!check(&g, &[sum]).iter().any(|step| matches!(step, Step::Both(_))));
    }
}
