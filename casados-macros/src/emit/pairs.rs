//! Elementary functions in pairs: two arguments at once take hardly longer than one in registers that have room for both.

use super::chunk::{computed, read};
use super::schedule::{Step, Values};
use crate::graph::{Binary, Graph, Node, Op, Unary};
use std::collections::{BTreeSet, HashMap};

/// So many statements a function may come earlier than it would, to be one of a pair: what waits for its use in the
/// meantime takes registers.
const REACH: usize = 500;

/// An elementary function that is worth being one of a pair.
#[derive(Clone, Copy, PartialEq, Eq)]
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

/// The same statements, elementary functions with the next one of their kind that does not wait for them: what that one
/// waits for comes before both.
pub fn in_pairs(graph: &Graph, steps: &[Step]) -> Vec<Step> {
    let mut position = HashMap::new();
    for (index, &step) in steps.iter().enumerate() {
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
        let partner =
            (index + 1..steps.len().min(index + REACH)).filter(|&other| !done[other]).find_map(|other| {
                let (_, others) = function(graph, steps[other]).filter(|(other, _)| *other == kind)?;
                let first = first_of(graph, steps, &position, &done, index, other)?;
                Some((other, others, first))
            });
        let Some((other, others, first)) = partner else {
            list.push(step);
            continue;
        };
        for index in first {
            done[index] = true;
            list.push(steps[index]);
        }
        done[other] = true;
        list.push(Step::Both([values, others]));
    }
    list
}

/// The statements that another one waits for; none if that is the one at `index`.
fn first_of(
    graph: &Graph,
    steps: &[Step],
    position: &HashMap<Node, usize>,
    done: &[bool],
    index: usize,
    other: usize,
) -> Option<BTreeSet<usize>> {
    let mut first = BTreeSet::new();
    let mut stack = vec![other];
    while let Some(step) = stack.pop() {
        for node in read(graph, &[], steps[step]) {
            let Some(&at) = position.get(&node) else { continue };
            if at == index {
                return None;
            }
            if !done[at] && first.insert(at) {
                stack.push(at);
            }
        }
    }
    Some(first)
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
}
