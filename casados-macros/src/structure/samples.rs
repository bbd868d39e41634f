//! The Newton matrix of a model at sample points, for the choice of the elimination order.
//!
//! Without a given nominal value or range of a variable, several kinds of points are used. A
//! nominal value is exact at the first point, and the others are within half of its magnitude; all
//! points are within a range.

use super::elimination::{Complex, Entry};
use crate::graph::{EvaluationPoint, Graph, Node};
use crate::language::Sampling;
use std::collections::BTreeMap;

/// The number of sample points, and the maximum number of draws: the model may have no finite value
/// at some points.
const SAMPLE_POINTS: usize = 12;
const MAX_DRAWS: usize = 200;

/// A structural non-zero of the Newton matrix: a sum of terms.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NewtonEntry {
    pub row: u32,
    pub column: u32,
    pub terms: Vec<Term>,
}

/// `diag(f) (hA)^order`, times `c`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Term {
    /// The entry of the Jacobian `f`.
    pub entry: u32,
    /// The entry of the Jacobian `−c`; `None` for `c = 1`.
    pub by: Option<u32>,
    /// Zero for entries of `f_ẋ` and `f_z`, one for those of `f_x`, and one more through a
    /// kinematic state.
    pub order: u32,
}

/// The pattern `f_ẋ ∪ f_x ∪ f_z`, by row, then by column.
pub fn pattern(jacobian: &[(u32, u32, Node)], blocks: [usize; 6], nx: u32) -> Vec<NewtonEntry> {
    let mut positions: BTreeMap<(u32, u32), NewtonEntry> = BTreeMap::new();
    for (entry, &(row, variable, _)) in jacobian.iter().enumerate().take(blocks[3]) {
        // Variables are (ẋ, x, z, ...), unknowns are (k, z).
        let column = if variable < nx { variable } else { variable - nx };
        let position = positions.entry((row, column)).or_default();
        (position.row, position.column) = (row, column);
        let order = u32::from(entry >= blocks[1] && entry < blocks[2]);
        position.terms.push(Term { entry: entry as u32, by: None, order });
    }
    positions.into_values().collect()
}

/// The values of nodes at sample points at which all of them are finite.
pub fn values(graph: &Graph, nodes: &[Node], samplings: &[Sampling], opaque: usize) -> Vec<Vec<f64>> {
    let mut random = Random::default();
    let points = Points { graph, nodes, samplings, constants: constants(&mut random, opaque) };
    let mut found = Vec::new();
    for draw in 0..MAX_DRAWS {
        if found.len() == SAMPLE_POINTS {
            break;
        }
        let values = points.point_values(&mut random, draw);
        if values.iter().all(|value| value.is_finite()) {
            found.push(values);
        }
    }
    found
}

/// The non-zeros with their values `Σ c f (hμ)^order` at sample points and sample values of `hμ`;
/// returns also the number of the last samples, at rest: there the first `states` variables are
/// zero, or at their nominal values, or as close to zero as their range allows.
pub fn sample(
    graph: &Graph,
    (jacobian, positions): (&[(u32, u32, Node)], &[NewtonEntry]),
    samplings: &[Sampling],
    states: usize,
    opaque: usize,
) -> (Vec<Entry>, usize) {
    let nodes: Vec<Node> = jacobian.iter().map(|entry| entry.2).collect();
    let mut random = Random::default();
    let points = Points { graph, nodes: &nodes, samplings, constants: constants(&mut random, opaque) };
    let mut entries: Vec<Entry> = positions
        .iter()
        .map(|position| Entry {
            row: position.row,
            column: position.column,
            values: Vec::new(),
            trivial: is_identity(graph, jacobian, position),
        })
        .collect();
    let is_finite = |values: &[f64]| {
        let mut used = positions.iter().flat_map(|position| &position.terms);
        used.all(|term| values[term.entry as usize].is_finite())
    };
    let mut found = 0;
    for draw in 0..MAX_DRAWS {
        if found == SAMPLE_POINTS {
            break;
        }
        let values = points.point_values(&mut random, draw);
        if is_finite(&values) {
            found += 1;
            append_sample(&mut entries, positions, &values, &mut random);
        }
    }
    let values = points.at_rest(&mut random, states);
    let at_rest =
        if is_finite(&values) { append_sample(&mut entries, positions, &values, &mut random) } else { 0 };
    (entries, at_rest)
}

/// Appends the values of the non-zeros at a point with several values of `hμ`; returns their
/// number.
fn append_sample(
    entries: &mut [Entry],
    positions: &[NewtonEntry],
    values: &[f64],
    random: &mut Random,
) -> usize {
    const STEP_SIZE_SAMPLES: usize = 2;
    for _ in 0..STEP_SIZE_SAMPLES {
        // The eigenvalues of A are in the right half-plane; the step size is arbitrary.
        let size = 10f64.powf(random.between(-4.0, 0.0));
        let angle = random.between(-1.4, 1.4);
        let hmu = Complex { re: size * angle.cos(), im: size * angle.sin() };
        for (entry, position) in entries.iter_mut().zip(positions) {
            let mut value = Complex::default();
            for term in &position.terms {
                let c = term.by.map_or(1.0, |by| -values[by as usize]);
                let mut product = Complex { re: c * values[term.entry as usize], im: 0.0 };
                (0..term.order).for_each(|_| product = product.times(hmu));
                value = Complex { re: value.re + product.re, im: value.im + product.im };
            }
            entry.values.push(value);
        }
    }
    STEP_SIZE_SAMPLES
}

/// Random values for constants from outside.
fn constants(random: &mut Random, opaque: usize) -> Vec<f64> {
    (0..opaque).map(|_| random.between(0.5, 2.0)).collect()
}

/// The data of random sample points.
struct Points<'a> {
    graph: &'a Graph,
    nodes: &'a [Node],
    samplings: &'a [Sampling],
    constants: Vec<f64>,
}

impl Points<'_> {
    /// The values at a point.
    fn point_values(&self, random: &mut Random, draw: usize) -> Vec<f64> {
        let point: Vec<f64> =
            self.samplings.iter().map(|sampling| coordinate(random, draw, *sampling)).collect();
        self.evaluate(&point)
    }

    /// The values with the first variables at rest, and the others positive.
    fn at_rest(&self, random: &mut Random, states: usize) -> Vec<f64> {
        let rest = |sampling: &Sampling| match (sampling.nominal, sampling.range) {
            (Some(nominal), _) => nominal,
            (None, Some((low, high))) => 0f64.max(low).min(high),
            (None, None) => 0.0,
        };
        let point: Vec<f64> = (self.samplings.iter().enumerate())
            .map(
                |(index, sampling)| {
                    if index < states { rest(sampling) } else { coordinate(random, 1, *sampling) }
                },
            )
            .collect();
        self.evaluate(&point)
    }

    fn evaluate(&self, point: &[f64]) -> Vec<f64> {
        self.graph
            .evaluate(self.nodes, EvaluationPoint { variables: point, opaque: &self.constants, seeds: &[] })
    }
}

/// Whether the block is the identity for every step size and point.
pub fn is_identity(graph: &Graph, jacobian: &[(u32, u32, Node)], position: &NewtonEntry) -> bool {
    match position.terms[..] {
        [Term { entry, order: 0, .. }] => graph.value(jacobian[entry as usize].2) == Some(1.0),
        _ => false,
    }
}

/// A coordinate of the sample point with this index.
fn coordinate(random: &mut Random, draw: usize, sampling: Sampling) -> f64 {
    let anywhere = unbounded_coordinate(random, draw);
    match (sampling.nominal, sampling.range) {
        (None, None) => anywhere,
        (Some(nominal), _) if draw == 0 => nominal,
        (Some(nominal), None) if nominal != 0.0 => nominal * random.between(0.5, 1.5),
        (Some(_), None) => anywhere,
        (_, Some((low, high))) => random.between(low, high),
    }
}

/// Coordinates of several kinds in turn: anywhere, positive, on coordinate planes and axes, of any
/// magnitude.
fn unbounded_coordinate(random: &mut Random, draw: usize) -> f64 {
    let value = random.between(-1.0, 1.0);
    match draw % 4 {
        0 => value,
        1 => value.abs() + 0.1,
        2 => value * f64::from(u8::from(random.between(0.0, 1.0) < 0.5)),
        _ => value * 10f64.powf(random.between(-1.0, 2.0)),
    }
}

/// A linear congruential generator: the same points in every build.
struct Random(u64);

impl Default for Random {
    fn default() -> Self {
        Self(0x9e37_79b9_7f4a_7c15)
    }
}

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}
