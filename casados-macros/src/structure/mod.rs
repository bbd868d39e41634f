//! Compile-time analysis of a model: structural index, explicit form, linear rows, and the
//! derivatives for the engine, as graphs.

mod branches;
mod elimination;
mod facts;
mod index;
mod kinematic;
mod reduction;
mod samples;
mod supernodes;
pub mod tables;
#[cfg(test)]
mod tests;

use crate::graph::{self, Degree, Entry, Node};
use crate::language::{Model, Sampling, Variables};
use branches::BranchIndicators;
pub use elimination::Plan;
pub use facts::Facts;
use kinematic::Kinematic;
pub use reduction::times;
use samples::NewtonEntry;
use std::collections::{BTreeSet, HashSet};
use tables::Tables;

/// The derivatives of a model or of a function of its variables.
pub struct Derivatives {
    /// Non-zeros of the Jacobian `(equation, variable, value)`, by block (ẋ, x, z, u, p), row,
    /// column.
    pub jacobian: Vec<Entry>,
    /// The offset of each block in `jacobian`, and its length.
    pub blocks: [usize; 6],
    /// Whether each entry of `jacobian` is independent of the variables (not of constants from
    /// outside).
    pub constant: Vec<bool>,
    /// `∇(μᵀ f)` with respect to `(ẋ, x, z, u, p)`.
    pub gradient: Vec<Node>,
    /// Non-zeros of the lower triangle of `∇²(μᵀ f)`, `(variable, variable, value)`.
    pub hessian: Vec<Entry>,
    /// Whether each equation is linear in `(ẋ, x, z, u, p)` jointly.
    pub linear: Vec<bool>,
    /// Numbers of operations.
    pub operations: Operations,
}

/// A function with its derivatives.
pub struct FunctionAnalysis {
    /// The function; its graph also contains the derivatives.
    pub model: Model,
    /// Its derivatives.
    pub derivatives: Derivatives,
    /// `∂y/∂t` of the outputs that depend on time.
    pub time: Vec<(u32, Node)>,
    /// The variables on which an output depends, ascending.
    pub used: Vec<u32>,
}

/// A model with its derivatives and its structure.
pub struct Analysis {
    /// The model; its graph also contains the derivatives.
    pub model: Model,
    /// Its derivatives.
    pub derivatives: Derivatives,
    /// Facts that let the engine skip work.
    pub facts: Facts,
    /// Whether an equation may be nonlinear in each unknown `(ẋ, z)`.
    pub nonlinear: Vec<bool>,
    /// The number of entries of the full Hessian in rows of nonlinear variables.
    pub symmetric: usize,
    /// For an explicit model the row and coefficient of each state.
    pub explicit: Option<Vec<(u32, f64)>>,
    /// The elimination of the Newton matrix.
    pub elimination: Elimination,
    /// The conditions that may change within an interval, if any.
    pub branches: Option<BranchIndicators>,
    /// The index reduction, if requested.
    pub reduction: Option<Reduction>,
}

/// The index reduction of a model.
pub struct Reduction {
    /// The differentiated equations, with the number of differentiations.
    pub differentiated: Vec<(u32, u32)>,
    /// The rates of Baumgarte's stabilisation.
    pub rates: Vec<f64>,
    /// The number of sample points with a singular matrix `∂f/∂(ẋ, z)`, and the number of all.
    pub singular: [u32; 2],
    /// The function of the invariants.
    pub invariants: FunctionAnalysis,
    /// The equations of the projection onto them.
    pub projection: Option<FunctionAnalysis>,
}

/// The elimination of the Newton matrix.
pub struct Elimination {
    /// The pivots in order, with the positions of all blocks.
    pub plan: Plan,
    /// The tables for the engine.
    pub tables: Tables,
}

/// Numbers of operations of one evaluation; an elementary function counts as one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// `f`
    pub residual: u32,
    /// `f` and the non-constant entries of its Jacobian.
    pub residual_jacobian: u32,
    /// `∇(μᵀ f)`
    pub adjoint: u32,
    /// `∇²(μᵀ f)`
    pub hessian: u32,
}

/// Reduces the index if requested, and derives everything.
pub fn analyse(mut model: Model) -> syn::Result<Analysis> {
    check_length(&model)?;
    let asked = model.reduction.is_some();
    let reduced = reduction::reduce(&mut model)?;
    let mut analysis = analyse_index_one(model)?;
    let singular = if asked { reduction::rank::check(&analysis, reduced.is_some())? } else { [0; 2] };
    if let Some(reduction::ReducedModel { differentiated, rates, invariants, projection }) = reduced {
        let invariants = analyse_function(invariants);
        let projection = projection.map(analyse_function);
        analysis.reduction = Some(Reduction { differentiated, rates, singular, invariants, projection });
    }
    Ok(analysis)
}

/// Derives everything, or returns an error if the index is not 1.
fn analyse_index_one(mut model: Model) -> syn::Result<Analysis> {
    let ends = ends(&model.variables);
    let derivatives = differentiate(&mut model, ends);
    let Derivatives { jacobian, blocks, constant, hessian, linear, .. } = &derivatives;
    index::check(&model, jacobian, ends)?;
    let facts =
        facts::find(&model.graph, &model.residual, (jacobian, *blocks, constant), hessian, linear, ends);
    let explicit = explicit(&model, jacobian, ends);
    let nonlinear = has_nonlinear_pair(hessian, ends);
    let curved = hessian.iter().filter(|entry| facts.curved.contains(&entry.0));
    let symmetric = curved.map(|entry| if entry.0 == entry.1 { 1 } else { 2 }).sum();
    let elimination = elimination(&model, jacobian, *blocks, &facts.trivial);
    let is_constant = |variable: u32| (ends[2]..ends[4]).contains(&variable);
    let branches = branches::find(&mut model.graph, &model.residual, is_constant);
    Ok(Analysis {
        model,
        derivatives,
        facts,
        nonlinear,
        symmetric,
        explicit,
        elimination,
        branches,
        reduction: None,
    })
}

/// Derives everything about a function.
pub fn analyse_function(mut model: Model) -> FunctionAnalysis {
    let ends = ends(&model.variables);
    let derivatives = differentiate(&mut model, ends);
    let time = ends[4];
    let rows = graph::jacobian(&mut model.graph, &model.residual, time + 1);
    let time = rows.into_iter().filter(|entry| entry.1 == time).map(|entry| (entry.0, entry.2)).collect();
    let used: BTreeSet<u32> = derivatives.jacobian.iter().map(|entry| entry.1).collect();
    FunctionAnalysis { model, derivatives, time, used: used.into_iter().collect() }
}

/// The ends of the blocks `(ẋ, x, z, u, p)` among the variables.
fn ends(names: &Variables) -> [u32; 5] {
    let mut end = 0;
    [names.x.len(), names.x.len(), names.z.len(), names.u.len(), names.p.len()].map(|length| {
        end += length as u32;
        end
    })
}

/// Adds the derivatives to the graph.
fn differentiate(model: &mut Model, ends: [u32; 5]) -> Derivatives {
    let variables = ends[4];
    let graph = &mut model.graph;
    let mut jacobian = graph::jacobian(graph, &model.residual, variables);
    let block = |variable: u32| ends.partition_point(|&end| end <= variable);
    jacobian.sort_by_key(|&(row, variable, _)| (block(variable), row, variable));
    let mut blocks = [0; 6];
    for (begin, index) in blocks.iter_mut().zip(0..) {
        *begin = jacobian.partition_point(|&(_, variable, _)| block(variable) < index);
    }
    let values: Vec<Node> = jacobian.iter().map(|entry| entry.2).collect();
    let constant: Vec<bool> =
        graph.degrees(&values, |_| true).iter().map(|&degree| degree == Degree::Constant).collect();
    let linear: Vec<bool> = graph
        .degrees(&model.residual, |variable| variable < variables)
        .iter()
        .map(|&degree| degree <= Degree::Linear)
        .collect();
    let seeded: Vec<(Node, Node)> =
        (0..).zip(&model.residual).map(|(row, &f)| (f, graph.seed(row))).collect();
    let gradient = graph::gradient(graph, &seeded, variables);
    let hessian = graph::hessian(graph, &seeded, variables);

    let varying = values.iter().zip(&constant).filter(|(_, constant)| !**constant).map(|(value, _)| *value);
    let residual_jacobian: Vec<Node> = model.residual.iter().copied().chain(varying).collect();
    let operations = Operations {
        residual: graph.operation_count(&model.residual),
        residual_jacobian: graph.operation_count(&residual_jacobian),
        adjoint: graph.operation_count(&gradient),
        hessian: graph.operation_count(&hessian.iter().map(|entry| entry.2).collect::<Vec<_>>()),
    };
    Derivatives { jacobian, blocks, constant, gradient, hessian, linear, operations }
}

/// The kinematic states, and the structural non-zeros of the Newton matrix without them.
fn newton_matrix(
    model: &Model,
    jacobian: &[Entry],
    blocks: [usize; 6],
    trivial: &[u32],
) -> (Vec<Kinematic>, Vec<NewtonEntry>) {
    let nx = model.variables.x.len() as u32;
    let kinematic = kinematic::find(model, (jacobian, blocks), trivial);
    let positions = kinematic::condense(nx, &kinematic, samples::pattern(jacobian, blocks, nx));
    (kinematic, positions)
}

/// Plans the elimination of the Newton matrix.
fn elimination(model: &Model, jacobian: &[Entry], blocks: [usize; 6], trivial: &[u32]) -> Elimination {
    let nx = model.variables.x.len();
    let (kinematic, positions) = newton_matrix(model, jacobian, blocks, trivial);
    let samplings = samplings(model);
    let states = 2 * nx + model.variables.z.len();
    let (entries, at_rest) =
        samples::sample(&model.graph, (jacobian, &positions), &samplings, states, model.opaque.len());
    let plan = elimination::plan(model.residual.len(), &entries, at_rest);
    let updated: HashSet<u32> = plan.updates.iter().copied().collect();
    let original = |block: u32| {
        let (row, column) = plan.blocks[block as usize];
        let position = positions.iter().find(|p| (p.row, p.column) == (row, column));
        position.filter(|_| !updated.contains(&block))
    };
    let is_identity = |&[block, ..]: &[u32; 3]| {
        original(block).is_some_and(|position| samples::is_identity(&model.graph, jacobian, position))
    };
    let identity: Vec<bool> = plan.ranges.iter().map(is_identity).collect();
    let tables = tables::of(&plan, &positions, &identity, &kinematic, [model.residual.len(), nx]);
    Elimination { plan, tables }
}

/// The nominal values and ranges of the variables `(ẋ, x, z, u, p, t)`.
fn samplings(model: &Model) -> Vec<Sampling> {
    let Variables { x, z, u, p } = &model.variables;
    let mut samplings = model.samplings.clone();
    samplings.resize(2 * x.len() + z.len() + u.len() + p.len() + 1, Sampling::default());
    samplings
}

/// Checks that there are as many equations as unknowns.
fn check_length(model: &Model) -> syn::Result<()> {
    let (equations, nx, nz) = (model.residual.len(), model.variables.x.len(), model.variables.z.len());
    if equations == nx + nz {
        return Ok(());
    }
    let span = match (model.spans.first(), model.spans.last()) {
        (Some(&first), Some(&last)) => first.join(last).unwrap_or(first),
        _ => model.name.span(),
    };
    let plural = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let unknowns = match nz {
        0 => format!("{nx} (one per state)"),
        _ => format!("{} ({} and {})", nx + nz, plural(nx, "state"), plural(nz, "algebraic state")),
    };
    let message =
        format!("the residual has {} where the model needs {unknowns}", plural(equations, "equation"));
    Err(syn::Error::new(span, message))
}

/// For each unknown, whether the Hessian has an entry for it and an unknown: the equations are
/// nonlinear in it for given states.
fn has_nonlinear_pair(hessian: &[Entry], [nx, end_x, end_z, ..]: [u32; 5]) -> Vec<bool> {
    let unknown = |variable: u32| match variable {
        derivative if derivative < nx => Some(derivative as usize),
        algebraic => (end_x..end_z).contains(&algebraic).then(|| (algebraic - nx) as usize),
    };
    let mut nonlinear = vec![false; (nx + end_z - end_x) as usize];
    for &(row, column, _) in hessian {
        if let (Some(row), Some(column)) = (unknown(row), unknown(column)) {
            (nonlinear[row], nonlinear[column]) = (true, true);
        }
    }
    nonlinear
}

/// For each state its row and the constant coefficient of its derivative, if every row has exactly
/// one derivative and there are no algebraic states.
fn explicit(model: &Model, jacobian: &[Entry], ends: [u32; 5]) -> Option<Vec<(u32, f64)>> {
    let nx = ends[0];
    if ends[2] != ends[1] {
        return None;
    }
    let derivatives = jacobian.iter().take_while(|entry| entry.1 < nx);
    let mut rows = vec![None; nx as usize];
    let mut count = 0;
    for (expected, &(row, variable, value)) in (0..).zip(derivatives) {
        let coefficient = model.graph.value(value)?;
        if row != expected || !coefficient.is_normal() || rows[variable as usize].is_some() {
            return None;
        }
        rows[variable as usize] = Some((row, coefficient));
        count += 1;
    }
    if count == nx { rows.into_iter().collect() } else { None }
}
