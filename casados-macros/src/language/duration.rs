//! A parameter that scales time, for free end times: `duration = p.duration`.
//!
//! With the time `t = T τ` of the model and the time `τ` of the integrator, equations become
//!
//! ```text
//! M ẋ + f(x, z, u, p, t) = 0   →   M x′ + T f(x, z, u, p, T τ) = 0        x′ = dx/dτ = T ẋ
//! f(ẋ, x, z, u, p, t) = 0      →   T f(x′/T, x, z, u, p, T τ) = 0         where ẋ is not linear
//! f(x, z, u, p, t) = 0         →   f(x, z, u, p, T τ) = 0
//! ```

use super::Model;
use crate::graph::{Binary, Degree, Graph, Node, jacobian};
use proc_macro2::{Span, TokenStream};
use std::collections::BTreeMap;
use syn::{Error, Result};

/// The parameter.
#[derive(Clone, Debug)]
pub struct Duration {
    /// Its name among the parameters.
    pub name: String,
    /// Its place in the source.
    pub span: Span,
}

impl Duration {
    /// Parses `p`, `p[1]`, `p.duration`.
    pub fn read(span: Span, value: &syn::Expr) -> Self {
        let tokens = quote::quote!(#value) as TokenStream;
        Self { name: tokens.to_string().chars().filter(|c| !c.is_whitespace()).collect(), span }
    }

    /// The index among these parameters.
    pub fn index(&self, parameters: &[String]) -> Result<u32> {
        let position = parameters.iter().position(|name| *name == self.name);
        position.map(|index| index as u32).ok_or_else(|| {
            let known = match parameters {
                [] => "it has none".to_owned(),
                names => format!("these are `{}`", names.join("`, `")),
            };
            Error::new(self.span, format!("`{}` is no parameter of the model: {known}", self.name))
        })
    }

    /// Replaces the time of a model by that of its integrator.
    pub fn scale(&self, model: &mut Model, is_function: bool) -> Result<()> {
        let variables = &model.variables;
        let index = self.index(&variables.p)?;
        if model.reduction.is_some() {
            let message = "`duration` does not support `index_reduction`: differentiate constraints by hand";
            return Err(Error::new(self.span, message));
        }
        let (nx, nz, nu) = (variables.x.len(), variables.z.len(), variables.u.len());
        let first = (2 * nx + nz + nu) as u32;
        let time = first + variables.p.len() as u32;
        let graph = &mut model.graph;
        let (duration, tau) = (graph.variable(first + index), graph.variable(time));
        let seconds = graph.binary(Binary::Mul, duration, tau);
        model.residual = graph.substitute(&model.residual, &BTreeMap::from([(time, seconds)]));
        if !is_function {
            model.residual = scaled_residual(graph, &model.residual, nx as u32, duration);
        }
        model.duration = Some(index);
        Ok(())
    }
}

/// The equations with `x′` instead of `ẋ`.
fn scaled_residual(graph: &mut Graph, residual: &[Node], nx: u32, duration: Node) -> Vec<Node> {
    let zero = graph.constant(0.0);
    let at_rest: BTreeMap<u32, Node> = (0..nx).map(|state| (state, zero)).collect();
    let degrees = graph.degrees(residual, |variable| variable < nx);
    let mut new = Vec::new();
    for (&equation, degree) in residual.iter().zip(degrees) {
        new.push(match degree {
            Degree::Constant => equation,
            Degree::Linear => {
                let rest = graph.substitute(&[equation], &at_rest)[0];
                let mut sum = graph.binary(Binary::Mul, duration, rest);
                for (_, state, slope) in jacobian(graph, &[equation], nx) {
                    let rate = graph.variable(state);
                    let term = graph.binary(Binary::Mul, slope, rate);
                    sum = graph.binary(Binary::Add, sum, term);
                }
                sum
            }
            Degree::Nonlinear => {
                let rates = (0..nx).map(|state| {
                    let rate = graph.variable(state);
                    (state, graph.binary(Binary::Div, rate, duration))
                });
                let rates: BTreeMap<u32, Node> = rates.collect();
                let slower = graph.substitute(&[equation], &rates)[0];
                graph.binary(Binary::Mul, duration, slower)
            }
        });
    }
    new
}
