//! Models with linear controls and integrals: their equations, names and units, and errors.

use super::super::{Analysis, analyse, analyse_function};
use crate::graph::EvaluationPoint;
use crate::language::{self, Extra, Form, Model};

fn model(form: Form, attribute: &str, item: &str) -> Result<Model, String> {
    let tokens = |text: &str| text.parse::<proc_macro2::TokenStream>().expect("these are tokens");
    let source = language::read(form, tokens(attribute), tokens(item)).map_err(|error| error.to_string())?;
    let part = source.parts.into_iter().next();
    Ok(part.and_then(|part| part.models.into_iter().next()).expect("there is a model"))
}

fn values(model: &Model, v: &[f64]) -> Vec<f64> {
    model.graph.evaluate(&model.residual, EvaluationPoint { variables: v, opaque: &[], seeds: &[] })
}

/// One of two controls is linear: its rate replaces it, and it is a state after those of the model,
/// before the integral.
#[test]
fn states_are_behind_those_of_the_model() {
    let item = "/// - `u[1]`: N\n/// - `t`: s\nfn f(x: f64, u: [f64; 2], p: f64, t: f64) -> f64 { x * u[1] + u[0] * p + t }";
    let model =
        model(Form::Ode, "linear = u[1], integrals(work = u[0] * u[1] * x + t)", item).expect("a model");
    assert_eq!(model.variables.x, ["x", "u[1]", "work"]);
    assert_eq!(model.variables.u, ["u[0]", "du[1]"]);
    assert_eq!((&model.units.x[1][..], &model.units.u[1][..]), ("N", "N/s"));
    assert_eq!(model.extra, Extra { linear: vec![1], integrals: 1, ..Extra::default() });
    let [a, b, c, x, push, work, u, rate, p, t] = [0.3, -0.2, 0.9, 1.5, 0.7, 4.0, 2.0, 3.0, 0.25, 1.25];
    let found = values(&model, &[a, b, c, x, push, work, u, rate, p, t]);
    assert_eq!(found, [a - (x * push + u * p + t), b - rate, c - (u * push * x + t)]);
    let Analysis { explicit, .. } = analyse(model).expect("it has index 1");
    assert_eq!(explicit, Some(vec![(0, 1.0), (1, 1.0), (2, 1.0)]));
}

/// A function has the control, its rate and the integrals as arguments.
#[test]
fn functions_have_rates_and_integrals() {
    let item = "fn f(x: f64, z: f64, u: [f64; 2], du: [f64; 2], q: f64, p: f64) -> [f64; 3] {
        [x + z * u[1], u[0] * du[1], q * p] }";
    let model = model(Form::Function, "linear = u[1], integrals(work)", item).expect("a function");
    let [x, push, work, z, u, rate, p, t] = [1.5, 0.7, 4.0, -0.3, 2.0, 3.0, 0.25, 1.25];
    let found = values(&model, &[0.0, 0.0, 0.0, x, push, work, z, u, rate, p, t]);
    assert_eq!(found, [x + z * push, u * rate, work * p]);
    assert_eq!(analyse_function(model).model.residual.len(), 3);
}

/// The polynomial in Bernstein form replaces a control, also in a function, with its rate; time is
/// that of the integrator.
#[test]
fn coefficients_replace_controls() {
    let item = "/// - `u`: N\n/// - `t`: s\nfn f(x: f64, u: [f64; 2], p: f64, t: f64) -> f64 { x * u[0] + u[1] * t }";
    let model = model(Form::Ode, "degree(u[0] = 2), linear = u[1], duration = p", item).expect("a model");
    assert_eq!(model.variables.u, ["u[0][0]", "u[0][1]", "u[0][2]", "du[1]"]);
    assert_eq!(model.variables.p, ["p", "interval.start", "interval.length"]);
    let extra = Extra { linear: vec![3], degrees: vec![2, 0], is_timed: true, ..Extra::default() };
    assert_eq!(model.extra, extra);
    let [a, b, x, c, duration, start, length, tau] = [0.3, -0.2, 1.5, 0.7, 2.0, 0.25, 0.5, 0.375];
    let found = values(&model, &[a, b, x, c, 4.0, 5.0, 7.0, 3.0, duration, start, length, tau]);
    let u = 0.5625 * 4.0 + 0.375 * 5.0 + 0.0625 * 7.0;
    assert_eq!(found, [a - duration * (x * u + c * duration * tau), b - duration * 3.0]);
}

#[test]
fn rates_of_polynomials() {
    let item = "fn f(x: f64, u: f64, du: f64) -> [f64; 2] { [x * u, du] }";
    let model = model(Form::Function, "degree(u = 1)", item).expect("a function");
    let found = values(&model, &[0.0, 1.5, 4.0, 6.0, 1.0, 0.5, 1.25]);
    assert_eq!(found, [1.5 * 5.0, 4.0]);
    assert!(!model.extra.is_timed);
}

#[test]
fn mistakes() {
    let item = "fn f(x: f64, u: [f64; 2]) -> f64 { x * u[0] + u[1] }";
    let refused = |attribute: &str| model(Form::Ode, attribute, item).err().expect("it is refused");
    assert_eq!(refused("linear = v"), "`v` is no control of the model: these are `u[0]`, `u[1]`");
    assert_eq!(refused("linear = [u[0], u]"), "`u` is linear already");
    assert_eq!(refused("degree(v = 1)"), "`v` is no control of the model: these are `u[0]`, `u[1]`");
    assert_eq!(refused("degree(u[0] = 1, u = 2)"), "`u` has a degree already");
    assert!(refused("degree(u[0] = 10)").starts_with("the degree of a control is from 1 to 9"));
    assert!(refused("degree(u[0])").starts_with("a control and its degree"));
    assert!(refused("degree(u = 1), linear = u[1]").starts_with("`u` is linear and continuous already"));
    assert!(refused("integrals(work)").contains("the integrand of `work` is missing"));
    assert!(refused("integrals(work = x, work = u[0])").contains("`work` is given twice"));
    let function =
        |attribute: &str, item: &str| model(Form::Function, attribute, item).err().expect("refused");
    let rate = "fn f(x: f64, u: [f64; 2], du: [f64; 2]) -> f64 { x * u[0] + du[0] }";
    assert!(function("", rate).contains("say which ones, as in `linear = u`"));
    assert!(function("linear = u[1]", rate).contains("the rate of a piecewise constant control"));
    let short = "fn f(x: f64, u: [f64; 2], du: f64) -> f64 { x * u[0] + du }";
    assert_eq!(function("linear = u", short), "`du` has 1 number and `u` has 2 numbers");
    let integrals = "fn f(x: f64, u: f64, q: [f64; 2]) -> f64 { x * u + q[1] }";
    assert_eq!(function("integrals(work)", integrals), "`q` has 2 numbers, and there are 1 integrals");
}
