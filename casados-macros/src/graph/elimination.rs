//! Symbolic elimination of the intermediate vertices of a linearised graph.
//!
//! Edges `p → s` carry `∂s/∂p`. Eliminating a vertex `v` replaces every path `p → v → s` by an
//! edge: `∂s/∂p += ∂s/∂v · ∂v/∂p`. The remaining edges between variables and outputs are the
//! Jacobian (Griewank and Walther, "Evaluating Derivatives", chapter 10).
//!
//! For second derivatives there are also arcs `{v, n}`, the entries of a symmetric matrix `W` of
//! second derivatives with respect to vertices; eliminating `v` pushes them to the operands of `v`:
//! `W ← Eᵀ W E`. In reverse order this is edge pushing (Gower and Mello, "A new framework for the
//! computation of Hessians", 2012); other orders can be cheaper.

use super::{Graph, Node};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

/// The order in which vertices are eliminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// From the outputs to the variables.
    Reverse,
    /// From the variables to the outputs.
    Forward,
    /// The fewest products first; among equals, the one nearest to the outputs.
    Markowitz,
}

/// A linearised graph. Vertices are in topological order: variables, intermediates, outputs.
#[derive(Clone, Debug, Default)]
pub struct LinearisedGraph {
    /// The edges into each vertex: source and derivative.
    pub into: Vec<BTreeMap<u32, Node>>,
    /// The edges out of each vertex: target.
    pub out: Vec<BTreeSet<u32>>,
    /// Second derivatives; each is stored at both ends.
    pub arcs: Vec<BTreeMap<u32, Node>>,
}

impl LinearisedGraph {
    /// A graph without edges.
    pub fn new(vertices: usize) -> Self {
        Self {
            into: vec![BTreeMap::new(); vertices],
            out: vec![BTreeSet::new(); vertices],
            arcs: vec![BTreeMap::new(); vertices],
        }
    }

    /// `∂s/∂p += value`
    pub fn add_edge(&mut self, graph: &mut Graph, p: u32, s: u32, value: Node) {
        if add(graph, &mut self.into[s as usize], p, value) {
            self.out[p as usize].insert(s);
        } else {
            self.out[p as usize].remove(&s);
        }
    }

    /// Adds to `W_jk` and `W_kj`.
    pub fn add_arc(&mut self, graph: &mut Graph, j: u32, k: u32, value: Node) {
        add(graph, &mut self.arcs[j as usize], k, value);
        if j != k {
            match self.arcs[j as usize].get(&k).copied() {
                Some(sum) => self.arcs[k as usize].insert(j, sum),
                None => self.arcs[k as usize].remove(&j),
            };
        }
    }

    /// Eliminates the intermediate vertices; returns the number of products, or `None` if it
    /// exceeds `budget`.
    pub fn eliminate(
        &mut self,
        graph: &mut Graph,
        intermediates: std::ops::Range<u32>,
        order: Order,
        budget: usize,
    ) -> Option<usize> {
        let mut products = 0;
        let mut each = |this: &mut Self, v: u32| {
            products += this.product_count(v);
            (products <= budget).then(|| this.eliminate_vertex(graph, v))
        };
        match order {
            Order::Reverse => intermediates.rev().try_for_each(|v| each(self, v).map(drop))?,
            Order::Forward => intermediates.into_iter().try_for_each(|v| each(self, v).map(drop))?,
            Order::Markowitz => {
                let key = |this: &Self, v: u32| Reverse((this.product_count(v), Reverse(v)));
                let mut heap: BinaryHeap<_> = intermediates.clone().map(|v| key(self, v)).collect();
                let mut left = vec![true; self.into.len()];
                while let Some(entry) = heap.pop() {
                    let Reverse((_, Reverse(v))) = entry;
                    if !left[v as usize] {
                        continue;
                    }
                    // The cost may have changed.
                    let now = key(self, v);
                    if entry != now {
                        heap.push(now);
                        continue;
                    }
                    left[v as usize] = false;
                    let neighbours = each(self, v)?;
                    for n in neighbours.into_iter().filter(|n| intermediates.contains(n)) {
                        heap.push(key(self, n));
                    }
                }
            }
        }
        Some(products)
    }

    /// The number of products for the elimination of a vertex.
    fn product_count(&self, v: u32) -> usize {
        let v = v as usize;
        let (into, out, arcs) = (self.into[v].len(), self.out[v].len(), self.arcs[v].len());
        if self.arcs[v].contains_key(&(v as u32)) {
            into * (out + arcs - 1) + into * (into + 3) / 2
        } else {
            into * (out + arcs)
        }
    }

    /// Eliminates one vertex; returns the vertices whose edges or arcs have changed.
    fn eliminate_vertex(&mut self, graph: &mut Graph, v: u32) -> BTreeSet<u32> {
        let into = std::mem::take(&mut self.into[v as usize]);
        let out = std::mem::take(&mut self.out[v as usize]);
        let mut arcs = std::mem::take(&mut self.arcs[v as usize]);
        let own = arcs.remove(&v);
        for p in into.keys() {
            self.out[*p as usize].remove(&v);
        }
        for &s in &out {
            let Some(after) = self.into[s as usize].remove(&v) else { continue };
            for (&p, &before) in &into {
                let product = graph.simplified_mul(before, after);
                self.add_edge(graph, p, s, product);
            }
        }
        for (&n, &weight) in &arcs {
            self.arcs[n as usize].remove(&v);
            for (&p, &before) in &into {
                let mut product = graph.simplified_mul(before, weight);
                if p == n {
                    product = graph.simplified_add(product, product);
                }
                self.add_arc(graph, p, n, product);
            }
        }
        if let Some(weight) = own {
            for (&p, &before) in &into {
                let left = graph.simplified_mul(before, weight);
                for (&q, &other) in into.range(..=p) {
                    let product = graph.simplified_mul(left, other);
                    self.add_arc(graph, p, q, product);
                }
            }
        }
        into.into_keys().chain(out).chain(arcs.into_keys()).collect()
    }
}

/// Adds to an entry; returns whether it is non-zero. Zeros are removed.
fn add(graph: &mut Graph, entries: &mut BTreeMap<u32, Node>, key: u32, value: Node) -> bool {
    let sum = match entries.get(&key) {
        Some(&old) => graph.simplified_add(old, value),
        None => value,
    };
    if graph.is_zero(sum) {
        entries.remove(&key);
        false
    } else {
        entries.insert(key, sum);
        true
    }
}
