//! Controls that are polynomials in every interval, with jumps between intervals:
//! `degree(u.push = 2)`.
//!
//! ```text
//! u(t) = Σ_i c_i B_i(θ)        B_i = C(d, i) θⁱ (1 − θ)^(d − i)        θ = (t − t_k) / h
//! ```
//!
//! The Bernstein coefficients `c_0 … c_d` replace the control; `c_0` and `c_d` are its values at
//! the start and the end of an interval, and the polynomial lies between the smallest and the
//! largest coefficient. Start `t_k` and length `h` of the interval are two more parameters, the
//! last ones. A function with the arguments of the model has the same variables; there `du` is the
//! rate of `u`.

use super::Model;
use super::augmented_states::indices_of_name;
use super::duration::Duration;
use crate::graph::{Binary, Graph, Node};
use proc_macro2::{Span, TokenStream};
use std::collections::BTreeMap;
use syn::parse::{Parse, ParseStream};
use syn::{Error, Lit, Result, Token};

/// The index of the rate of the first control, before rates are replaced by coefficients.
pub const RATES: u32 = u32::MAX / 2;

/// Names of the parameters that follow those of the model: start and length of an interval.
const INTERVAL: [&str; 2] = ["interval.start", "interval.length"];

/// The largest degree; a larger one is considered a mistake.
const MAX_DEGREE: u32 = 9;

/// The polynomial controls of an attribute.
#[derive(Clone, Default)]
pub struct PolynomialControls {
    pub list: Vec<PolynomialControl>,
    /// The duration of the model, in a function of its module.
    pub duration: Option<Duration>,
}

/// A name of controls with their degree.
#[derive(Clone)]
pub struct PolynomialControl {
    name: String,
    span: Span,
    degree: u32,
}

impl Parse for PolynomialControl {
    fn parse(input: ParseStream) -> Result<Self> {
        let span = input.span();
        let mut name = TokenStream::new();
        while !input.peek(Token![=]) && !input.is_empty() {
            name.extend([input.parse::<proc_macro2::TokenTree>()?]);
        }
        let message = "a control and its degree: `degree(u = 1)`";
        input.parse::<Token![=]>().map_err(|_| Error::new(span, message))?;
        let place = input.span();
        let degree = match input.parse() {
            Ok(Lit::Int(literal)) => literal.base10_parse()?,
            _ => return Err(Error::new(place, message)),
        };
        if !(1..=MAX_DEGREE).contains(&degree) {
            let message =
                format!("the degree of a control is from 1 to {MAX_DEGREE}; without one it is constant");
            return Err(Error::new(span, message));
        }
        let name = name.to_string().chars().filter(|c| !c.is_whitespace()).collect();
        Ok(Self { name, span, degree })
    }
}

impl PolynomialControls {
    /// Whether all controls are constant or linear.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The degree of every control; empty without polynomial controls.
    pub fn degrees(&self, controls: &[String], linear: &[u32]) -> Result<Vec<u32>> {
        let mut degrees = if self.is_empty() { Vec::new() } else { vec![0; controls.len()] };
        for PolynomialControl { name, span, degree } in &self.list {
            for control in indices_of_name(name, *span, controls)? {
                if linear.contains(&control) {
                    let message = format!("`{name}` is linear and continuous already: it has no `degree`");
                    return Err(Error::new(*span, message));
                }
                match degrees.get_mut(control as usize) {
                    Some(place) if *place == 0 => *place = *degree,
                    _ => return Err(Error::new(*span, format!("`{name}` has a degree already"))),
                }
            }
        }
        Ok(degrees)
    }

    /// Replaces polynomial controls by their coefficients, after time is scaled.
    pub fn expand(&self, model: &mut Model) -> Result<()> {
        let degrees = model.extra.degrees.clone();
        if degrees.is_empty() {
            return Ok(());
        }
        if model.reduction.is_some() {
            let message = "`degree` does not support `index_reduction`: differentiate constraints by hand";
            return Err(Error::new(model.name.span(), message));
        }
        let variables = &model.variables;
        let [nx, nz, np] = [&variables.x, &variables.z, &variables.p].map(Vec::len);
        let of_u = (2 * nx + nz) as u32;
        let duration = match &self.duration {
            Some(duration) => Some(duration.index(&variables.p)?),
            None => model.duration,
        };
        let graph = &mut model.graph;
        let (nu, np) = (degrees.len() as u32, np as u32);
        let coefficients: u32 = degrees.iter().map(|degree| degree + 1).sum();
        let (old_time, of_p) = (of_u + nu + np, of_u + coefficients);
        let of_time = graph.variable(old_time);
        model.extra.is_timed = graph.reachable(&model.residual).contains(&of_time);
        let [start, length, time] = [0, 1, 2].map(|i| graph.variable(of_p + np + i));
        let elapsed = graph.binary(Binary::Sub, time, start);
        let theta = graph.binary(Binary::Div, elapsed, length);
        let mut by = BTreeMap::from([(old_time, time)]);
        let mut next = of_u;
        for (control, &degree) in (0..).zip(&degrees) {
            let points: Vec<Node> = (next..=next + degree).map(|i| graph.variable(i)).collect();
            next += degree + 1;
            if degree > 0 {
                let rate = rate(graph, &points, theta, length);
                let rate = match duration {
                    Some(index) => {
                        let duration = graph.variable(of_p + index);
                        graph.binary(Binary::Div, rate, duration)
                    }
                    None => rate,
                };
                by.insert(RATES + control, rate);
            }
            by.insert(of_u + control, bernstein(graph, points, theta));
        }
        (0..np).for_each(|i| {
            by.insert(of_u + nu + i, graph.variable(of_p + i));
        });
        model.residual = graph.substitute(&model.residual, &by);
        name(model, &degrees);
        Ok(())
    }
}

/// A polynomial in Bernstein form at `theta`, by de Casteljau's algorithm.
fn bernstein(graph: &mut Graph, mut points: Vec<Node>, theta: Node) -> Node {
    while points.len() > 1 {
        let pairs: Vec<[Node; 2]> = points.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        points = pairs
            .into_iter()
            .map(|[from, to]| {
                let difference = graph.binary(Binary::Sub, to, from);
                let part = graph.binary(Binary::Mul, theta, difference);
                graph.binary(Binary::Add, from, part)
            })
            .collect();
    }
    points[0]
}

/// The derivative of a polynomial in Bernstein form over an interval of this length.
fn rate(graph: &mut Graph, points: &[Node], theta: Node, length: Node) -> Node {
    let degree = graph.constant((points.len() - 1) as f64);
    let differences = points.windows(2).map(|pair| graph.binary(Binary::Sub, pair[1], pair[0])).collect();
    let slope = bernstein(graph, differences, theta);
    let scaled = graph.binary(Binary::Mul, degree, slope);
    graph.binary(Binary::Div, scaled, length)
}

/// Sets names and units of coefficients and parameters, and the new indices of linear controls.
fn name(model: &mut Model, degrees: &[u32]) {
    let (variables, units) = (&mut model.variables, &mut model.units);
    let old = std::mem::take(&mut variables.u);
    let old_units = std::mem::take(&mut units.u);
    let mut indices = Vec::new();
    for (control, (name, &degree)) in old.into_iter().zip(degrees).enumerate() {
        indices.push(variables.u.len() as u32);
        for i in 0..=degree {
            variables.u.push(if degree > 0 { format!("{name}[{i}]") } else { name.clone() });
            units.u.extend(old_units.get(control).cloned());
        }
    }
    for control in &mut model.extra.linear {
        *control = indices[*control as usize];
    }
    if !units.p.is_empty() {
        units.p.resize(variables.p.len(), String::new());
        units.p.extend([units.t.clone(), units.t.clone()]);
    }
    variables.p.extend(INTERVAL.map(str::to_owned));
}
