//! Splits long functions into pieces: compilers take more than linear time for a function of many
//! thousands of statements, and a debug build exhausts the stack. Values that cross a cut are
//! stored in an array, whose slots are reused after the last read.

use super::schedule::{Statement, is_leaf};
use crate::graph::{Graph, Node, Op};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

/// A function in pieces.
pub struct Plan {
    /// The pieces, in order.
    pub chunks: Vec<Chunk>,
    /// Length of the array for values that cross a cut.
    pub slots: usize,
}

/// A piece.
pub struct Chunk {
    /// Its statements.
    pub steps: Range<usize>,
    /// Values of earlier pieces and their slots, read at the start.
    pub loads: Vec<(Node, usize)>,
    /// Values for later pieces and their slots, written as soon as they are computed.
    pub spills: HashMap<Node, usize>,
}

/// The nodes that a statement computes.
pub fn computed(step: Statement) -> impl Iterator<Item = Node> {
    let list = match step {
        Statement::Compute(node) => [Some((node, None)), None, None, None],
        Statement::SinCos(sin, cos) => [Some((sin, Some(cos))), None, None, None],
        Statement::Together(values) => values,
        Statement::Store(_) => [None; 4],
    };
    list.into_iter().flatten().flat_map(|(node, other)| [node].into_iter().chain(other))
}

/// The nodes that a statement reads, leaves included.
pub fn read(graph: &Graph, outputs: &[Node], step: Statement) -> impl Iterator<Item = Node> {
    let (stored, ops) = match step {
        Statement::Compute(node) | Statement::SinCos(node, _) => {
            (None, [Some(graph.op(node)), None, None, None])
        }
        Statement::Together(values) => (None, values.map(|values| values.map(|(node, _)| graph.op(node)))),
        Statement::Store(output) => (Some(outputs[output]), [None; 4]),
    };
    stored.into_iter().chain(ops.into_iter().flatten().flat_map(Op::operands))
}

/// Cuts a function into pieces of at most `limit` statements.
pub fn plan(graph: &Graph, outputs: &[Node], steps: &[Statement], limit: usize) -> Plan {
    // The first and last statement in which a value occurs.
    let mut life: HashMap<Node, (usize, usize)> = HashMap::new();
    for (position, &step) in steps.iter().enumerate() {
        for node in read(graph, outputs, step).filter(|&node| !is_leaf(graph.op(node))) {
            if let Some(life) = life.get_mut(&node) {
                life.1 = position;
            }
        }
        for node in computed(step) {
            life.insert(node, (position, position));
        }
    }

    let cuts = cuts(&life, steps.len(), limit.max(1));
    let piece = |position: usize| cuts.partition_point(|&cut| cut <= position);
    let mut chunks = Vec::new();
    let (mut slots, mut free) = (0, BTreeSet::new());
    let mut place: HashMap<Node, usize> = HashMap::new();
    let mut start = 0;
    for (number, end) in cuts.iter().copied().chain([steps.len()]).enumerate() {
        let mut loads = Vec::new();
        let mut loaded = BTreeSet::new();
        for &step in &steps[start..end] {
            for node in read(graph, outputs, step) {
                if let Some(&slot) = place.get(&node)
                    && loaded.insert(node)
                {
                    loads.push((node, slot));
                }
            }
        }
        for (node, slot) in &loads {
            if life.get(node).is_some_and(|life| piece(life.1) == number) {
                place.remove(node);
                free.insert(*slot);
            }
        }
        let mut spills = HashMap::new();
        for node in steps[start..end].iter().copied().flat_map(computed) {
            if life.get(&node).is_some_and(|life| piece(life.1) > number) {
                let slot = free.pop_first().unwrap_or_else(|| {
                    slots += 1;
                    slots - 1
                });
                spills.insert(node, slot);
            }
        }
        place.extend(&spills);
        chunks.push(Chunk { steps: start..end, loads, spills });
        start = end;
    }
    Plan { chunks, slots }
}

/// The cuts: in the last third of a full piece, where the fewest values cross.
fn cuts(life: &HashMap<Node, (usize, usize)>, length: usize, limit: usize) -> Vec<usize> {
    if length <= limit {
        return Vec::new();
    }
    let mut crossing = vec![0i64; length + 2];
    for &(first, last) in life.values() {
        crossing[first + 1] += 1;
        crossing[last + 1] -= 1;
    }
    let mut sum = 0;
    for count in &mut crossing {
        sum += *count;
        *count = sum;
    }
    let mut cuts = Vec::new();
    let mut start = 0;
    while length - start > limit {
        let candidates = start + (limit * 2 / 3).max(1)..=start + limit;
        let cut = candidates.rev().min_by_key(|&cut| crossing[cut]).unwrap_or(start + limit);
        cuts.push(cut);
        start = cut;
    }
    cuts
}

#[cfg(test)]
mod tests {
    use super::super::schedule::schedule;
    use super::*;
    use crate::graph::{Binary, Unary};

    /// Runs the pieces on symbolic memory, and checks that every value read is the intended one.
    fn check(graph: &Graph, outputs: &[Node], limit: usize) -> Plan {
        let steps = schedule(graph, outputs);
        let plan = plan(graph, outputs, &steps, limit);
        let mut memory = vec![None; plan.slots];
        let mut position = 0;
        for chunk in &plan.chunks {
            assert_eq!(chunk.steps.start, position);
            assert!(chunk.steps.len() <= limit);
            position = chunk.steps.end;
            let mut local = BTreeSet::new();
            for &(node, slot) in &chunk.loads {
                assert_eq!(memory[slot], Some(node));
                local.insert(node);
            }
            for &step in &steps[chunk.steps.clone()] {
                for node in read(graph, outputs, step) {
                    assert!(is_leaf(graph.op(node)) || local.contains(&node));
                }
                for node in computed(step) {
                    local.insert(node);
                    if let Some(&slot) = chunk.spills.get(&node) {
                        memory[slot] = Some(node);
                    }
                }
            }
        }
        assert_eq!(position, steps.len());
        plan
    }

    /// A graph with values of short and of long lifetimes.
    fn graph(length: u32) -> (Graph, Vec<Node>) {
        let mut g = Graph::default();
        let mut recent: Vec<Node> = (0..4).map(|index| g.variable(index)).collect();
        let mut outputs = Vec::new();
        let mut state = 1u32;
        for index in 0..length {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let reach = if state >> 28 == 0 { recent.len() } else { recent.len().min(12) };
            let pick = |shift: u32| recent[recent.len() - 1 - (state >> shift) as usize % reach];
            let (a, b) = (pick(8), pick(16));
            let node = match state >> 30 {
                0 => g.unary(Unary::Sin, a),
                1 => g.unary(Unary::Cos, a),
                2 => g.binary(Binary::Mul, a, b),
                _ => g.binary(Binary::Sub, a, b),
            };
            recent.push(node);
            if index % 37 == 36 {
                outputs.push(node);
            }
        }
        (g, outputs)
    }

    #[test]
    fn values_survive_every_cut() {
        let (g, outputs) = graph(3000);
        for limit in [1, 2, 3, 10, 100, 500, 10_000] {
            let plan = check(&g, &outputs, limit);
            assert_eq!(plan.chunks.len() == 1, limit == 10_000);
            assert_eq!(plan.slots == 0, limit == 10_000);
        }
    }

    #[test]
    fn slots_are_reused() {
        // At most one value crosses any cut, so that one slot suffices for any number of pieces.
        let mut g = Graph::default();
        let mut node = g.variable(0);
        for _ in 0..1000 {
            node = g.unary(Unary::Atan, node);
        }
        let plan = check(&g, &[node], 10);
        assert!(plan.chunks.len() >= 100);
        assert_eq!(plan.slots, 1);
    }
}
