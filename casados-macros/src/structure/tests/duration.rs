//! Models with a duration parameter: their equations, and errors.

use super::super::{Analysis, analyse};
use crate::graph::EvaluationPoint;
use crate::language::{self, Form};

fn read(form: Form, attribute: &str, item: &str) -> Result<Analysis, String> {
    let tokens = |text: &str| text.parse::<proc_macro2::TokenStream>().expect("these are tokens");
    let source = language::read(form, tokens(attribute), tokens(item)).map_err(|error| error.to_string())?;
    let part = source.parts.into_iter().next();
    let model = part.and_then(|part| part.models.into_iter().next()).expect("there is a model");
    analyse(model).map_err(|error| error.to_string())
}

/// Values of the equations at `(ẋ, x, z, u, p, t)`.
fn values(analysis: &Analysis, v: &[f64]) -> Vec<f64> {
    let point = EvaluationPoint { variables: v, opaque: &[], seeds: &[] };
    analysis.model.graph.evaluate(&analysis.model.residual, point)
}

/// Explicit models remain explicit, with the same coefficients.
#[test]
fn explicit_models_stay_explicit() {
    let item = "fn f(x: [f64; 2], u: f64, p: [f64; 2], t: f64) -> [f64; 2] { [x[1], u * t - p[0] * x[0]] }";
    let analysis = read(Form::Ode, "duration = p[1]", item).expect("a model");
    assert_eq!(analysis.model.duration, Some(1));
    assert_eq!(analysis.explicit, Some(vec![(0, 1.0), (1, 1.0)]));
    let [a, b, x0, x1, u, p, t, tau] = [0.3, -0.2, 1.5, 0.7, 2.0, 3.0, 4.0, 0.25];
    let found = values(&analysis, &[a, b, x0, x1, u, p, t, tau]);
    assert_eq!(found, [a - t * x1, b - t * (u * (t * tau) - p * x0)]);
}

/// Equations with rates are multiplied, others are not; rates may occur anywhere.
#[test]
fn equations_of_rates_are_multiplied() {
    let item = "fn f(xdot: [f64; 2], x: [f64; 2], z: f64, p: f64, t: f64) -> [f64; 3] {
        [x[0] * xdot[0] + 2.0 * xdot[1] - z, xdot[1] + xdot[1] * xdot[1] * xdot[1] - x[1], z - x[0] * t]
    }";
    let analysis = read(Form::Dae, "duration = p", item).expect("a model");
    let [a, b, x0, x1, z, p, tau] = [0.3, -0.2, 1.5, 0.7, 2.0, 4.0, 0.25];
    let found = values(&analysis, &[a, b, x0, x1, z, p, tau]);
    let rate = b / p;
    let expected = [x0 * a + 2.0 * b - p * z, p * (rate + rate * rate * rate - x1), z - x0 * (p * tau)];
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
}

#[test]
fn mistakes() {
    let item = "fn f(xdot: f64, x: f64, z: f64, p: [f64; 2]) -> [f64; 2] { [xdot - z, x - p[0]] }";
    let refused = |attribute: &str| read(Form::Dae, attribute, item).err().expect("it is refused");
    assert_eq!(refused("duration = q"), "`q` is no parameter of the model: these are `p[0]`, `p[1]`");
    assert_eq!(refused("duration = p"), "`p` is no parameter of the model: these are `p[0]`, `p[1]`");
    assert!(refused("duration = p[0], duration = p[1]").contains("`duration` is given twice"));
    assert!(refused("index_reduction, duration = p[0]").contains("does not support `index_reduction`"));
    let none = read(Form::Ode, "duration = p", "fn f(x: f64) -> f64 { x }").err().expect("no parameter");
    assert_eq!(none, "`p` is no parameter of the model: it has none");
}
