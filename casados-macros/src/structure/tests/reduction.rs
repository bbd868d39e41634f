//! Models with index reduction: errors with their reasons, and the aircraft on its tether against
//! the form reduced by hand.

use super::super::{Analysis, analyse};
use crate::graph::EvaluationPoint;
use crate::language::{self, Form};

/// A model, or its error.
fn read(attribute: &str, item: &str) -> Result<Analysis, String> {
    let tokens = |text: &str| text.parse::<proc_macro2::TokenStream>().expect("these are tokens");
    let source =
        language::read(Form::Dae, tokens(attribute), tokens(item)).map_err(|error| error.to_string())?;
    let model = source
        .parts
        .into_iter()
        .next()
        .and_then(|part| part.models.into_iter().next())
        .expect("there is a model");
    analyse(model).map_err(|error| error.to_string())
}

fn read_reduced(item: &str) -> Result<Analysis, String> {
    read("index_reduction", item)
}

fn refusal(item: &str) -> String {
    read_reduced(item).err().expect("the model is refused")
}

#[test]
fn index_one_models_stay() {
    let analysis = read_reduced("fn f(xdot: f64, x: f64, z: f64) -> [f64; 2] { [xdot - z, z + x] }");
    assert!(analysis.is_ok_and(|analysis| analysis.reduction.is_none()));
}

#[test]
fn without_the_argument_the_error_names_it() {
    let item = "fn f(xdot: f64, x: f64, z: f64) -> [f64; 2] { [xdot - z, x - 1.0] }";
    let error = read("", item).err().expect("it has index two");
    assert!(error.contains("or let `#[dae(index_reduction)]` do so"), "{error}");
    let analysis = read_reduced(item).expect("its index can be reduced");
    assert_eq!(analysis.reduction.map(|reduction| reduction.differentiated), Some(vec![(1, 1)]));
}

#[test]
fn a_control_that_would_jump() {
    let error = refusal("fn f(xdot: f64, x: f64, u: f64, z: f64) -> [f64; 2] { [xdot - z, x - u] }");
    assert!(
        error.starts_with("equation 1 must be differentiated but contains `u`")
            && error.contains("make it a state, with its rate as the control"),
        "{error}"
    );
    // It may occur in the highest derivative.
    let velocity = read_reduced(
        "fn f(xdot: [f64; 2], x: [f64; 2], u: f64, z: f64) -> [f64; 3] {
            [xdot[0] - x[1] - u, xdot[1] - z, x[0] * x[0] + x[1] - 1.0]
        }",
    );
    assert!(velocity.is_ok());
}

#[test]
fn constraints_that_repeat_each_other() {
    // Different texts of the same constraint are structurally independent.
    let error = refusal(
        "fn f(xdot: [f64; 4], x: [f64; 4], z: [f64; 2]) -> [f64; 6] {
            [xdot[0] - x[2], xdot[1] - x[3], xdot[2] + z[0] * x[0] + z[1] * x[0], xdot[3] + z[0] * x[1] + z[1] * x[1],
             x[0] * x[0] + x[1] * x[1] - 1.0, (x[0] + x[1]) * (x[0] + x[1]) - 2.0 * x[0] * x[1] - 1.0]
        }",
    );
    assert!(
        error.contains(
            "equations 4, 5 are dependent at every sample point and do not determine `z[0]`, `z[1]`"
        ),
        "{error}"
    );
}

/// The currents into the diodes of a ring add up to zero, though every equation has unknowns of its
/// own: the structural index is 1, and nothing would be differentiated.
#[test]
fn a_constraint_that_is_hidden_in_a_combination() {
    let diodes = |last: &str| {
        format!(
            "fn f(xdot: [f64; 2], x: [f64; 2], z: [f64; 2]) -> [f64; 4] {{
                let current = (z[0] - z[1]).exp();
                [xdot[0] + x[0] - z[0], xdot[1] + x[1] - z[1], x[0] - current, {last}]
            }}"
        )
    };
    let error = refusal(&diodes("x[1] + current"));
    assert!(
        error.contains("equations 2, 3 are dependent at every sample point and do not determine")
            && error.contains("replace one equation by a combination in which the unknowns cancel"),
        "{error}"
    );
    let combined = read_reduced(&diodes("x[0] + x[1]")).expect("the combination shows it");
    assert_eq!(combined.reduction.map(|reduction| reduction.differentiated), Some(vec![(3, 1)]));
}

#[test]
fn equations_that_determine_nothing() {
    let error = refusal("fn f(xdot: f64, x: f64, z: f64) -> [f64; 2] { [xdot - x, x - 1.0] }");
    assert!(error.contains("`z` is determined by no equation"), "{error}");
    assert!(error.contains("no derivatives of these equations determine all states"), "{error}");
}

#[test]
fn derivatives_that_are_not_explicit() {
    // `q̇` is defined by an equation that is not linear in it.
    let error = refusal(
        "fn f(xdot: [f64; 2], x: [f64; 2], z: f64) -> [f64; 3] {
            [xdot[0] + xdot[0] * xdot[0] * xdot[0] - x[1], xdot[1] - z, x[0] - 1.0]
        }",
    );
    assert!(
        error.contains("the derivative of `x[0]` must be differentiated once")
            && error.contains("no equation gives it explicitly: solve one of them for it"),
        "{error}"
    );
    // A contact defined implicitly, and a constraint of velocities at it.
    let contact = |unknowns: &str, names: &str| {
        format!(
            "fn f({unknowns}) -> [f64; 4] {{
                let ({names}) = (x, z);
                [xdot[0] - v, xdot[1] - force + 9.81, c * c * c + c - q, v * (1.0 + c) - 1.0]
            }}"
        )
    };
    let error = refusal(&contact("xdot: [f64; 2], x: [f64; 2], z: [f64; 2]", "[q, v], [force, c]"));
    assert!(
        error.contains("`z[1]` must be differentiated once") && error.contains("make it a state"),
        "{error}"
    );
    let state = read_reduced(&contact("xdot: [f64; 3], x: [f64; 3], z: f64", "[q, v, c], force"));
    let reduction = state.expect("its derivative follows").reduction.expect("it is reduced");
    assert_eq!(reduction.differentiated, [(2, 1), (3, 1)]);
}

/// A spring whose far end moves such that the near end follows a wave, of index 5: the equations of
/// the derivatives are used in turn.
#[test]
fn a_constraint_that_is_differentiated_four_times() {
    let spring = "fn f(xdot: [f64; 4], x: [f64; 4], z: f64, t: f64) -> [f64; 5] {
        let [a, b, va, vb] = x;
        [xdot[0] - va, xdot[1] - vb, xdot[2] - 7.0 * (b - a), xdot[3] + 7.0 * (b - a) - z, a - t.sin()]
    }";
    let reduction = read_reduced(spring).expect("its index can be reduced").reduction.expect("it is reduced");
    assert_eq!(reduction.differentiated, [(4, 4)]);
    // The rate of one end is defined by an equation that is not linear in it: there is no rule for
    // its derivative.
    let error = refusal(&spring.replace("xdot[2] - 7.0 * (b - a)", "xdot[2].sinh() - 7.0 * (b - a)"));
    assert!(
        error.contains("the derivative of `x[2]` must be differentiated twice")
            && error.contains("differentiate the constraint by hand"),
        "{error}"
    );
}

#[test]
fn rates_have_to_fit() {
    let item = "fn f(xdot: f64, x: f64, z: f64) -> [f64; 2] { [xdot - z, x - 1.0] }";
    let refused = |attribute: &str| read(attribute, item).err().expect("the rates are refused");
    assert!(refused("index_reduction(baumgarte = [1.0, 2.0])").contains("once, but there are 2 rates"));
    assert!(refused("index_reduction(baumgarte = 0.0)").contains("must be positive"));
    assert!(
        refused("index_reduction(baumgarte = [])")
            .contains("`index_reduction(baumgarte = 2.0)` with one rate")
    );
    assert!(
        refused("index_reduction(other = 1.0)")
            .contains("write `index_reduction`, `index_reduction(baumgarte")
    );
    assert!(
        refused("index_reduction = true").contains("write `index_reduction`, `index_reduction(baumgarte")
    );
    assert!(
        refused("index_reduction(projection, baumgarte = 1.0)").contains("or `index_reduction(projection)`")
    );
    assert!(refused("index_reduction, index_reduction").contains("given twice"));
    let analysis = read("index_reduction(baumgarte = 2)", item).expect("one rate for all");
    assert_eq!(analysis.reduction.map(|reduction| reduction.rates), Some(vec![2.0]));
}

/// Two constraints `sin a = sin b`, `cos a + cos b = c`: their rows vanish at `a = b = 0` only.
#[test]
fn rank_that_is_lost_at_some_points() {
    let item = "fn f(xdot: [f64; 4], x: [f64; 4], z: [f64; 2], p: f64) -> [f64; 6] {
        let (sa, ca, sb, cb) = (x[0].sin(), x[0].cos(), x[1].sin(), x[1].cos());
        [xdot[0] - x[2], xdot[1] - x[3], xdot[2] + z[0] * ca - z[1] * sa, xdot[3] - z[0] * cb - z[1] * sb,
         sa - sb, ca + cb - p]
    }";
    let singular = |attribute: &str| {
        let reduction = read(attribute, item).expect("it is regular elsewhere").reduction;
        reduction.expect("it is reduced").singular
    };
    let [anywhere, points] = singular("index_reduction");
    assert!(anywhere < points && points >= 12);
    assert_eq!(singular("index_reduction, nominal(x = 0.0)")[0], singular("index_reduction")[0].max(1));
}

/// The aircraft with its tether as the constraint `c = 0`: its reduced equations equal those
/// derived by hand, in value and in work.
#[test]
fn the_aircraft_from_its_constraint() {
    let text = include_str!("../../../../examples/models/awe.rs");
    let begin = text.find("pub mod awe {").expect("the model is a module");
    let end = text.find("\nimpl From").expect("conversions follow it");
    let by_hand = &text[begin..end];
    let constraint =
        "tether: (ddc + 2.0 * TETHER_DAMPING * dc + TETHER_DAMPING * TETHER_DAMPING * c) / CONSTRAINT";
    assert!(by_hand.contains(constraint));
    let lagrange = by_hand.replace(constraint, "tether: c / CONSTRAINT");
    let reduced = read("index_reduction(baumgarte = 0.1)", &lagrange).expect("its index can be reduced");
    let by_hand = read("", by_hand).expect("it has index one");
    let reduction = reduced.reduction.as_ref().expect("it was reduced");
    assert_eq!(reduction.differentiated, [(22, 2)]);

    let entries = |analysis: &Analysis| -> Vec<(u32, u32)> {
        analysis.derivatives.jacobian.iter().map(|entry| (entry.0, entry.1)).collect()
    };
    assert_eq!(entries(&reduced), entries(&by_hand));
    let values = |analysis: &Analysis, point: &[f64]| {
        let jacobian = analysis.derivatives.jacobian.iter().map(|entry| entry.2);
        let nodes: Vec<_> = analysis.model.residual.iter().copied().chain(jacobian).collect();
        analysis.model.graph.evaluate(&nodes, EvaluationPoint { variables: point, opaque: &[], seeds: &[] })
    };
    for draw in 0..20 {
        let wave = |index: usize| (1.7 * (draw * 52 + index) as f64).sin();
        let mut point: Vec<f64> = (0..52).map(wave).collect();
        // A position of some hundred metres and a velocity of some ten metres a second.
        (23..26).for_each(|index| point[index] = 200.0 + 100.0 * point[index]);
        (26..29).for_each(|index| point[index] *= 30.0);
        for (a, b) in values(&reduced, &point).into_iter().zip(values(&by_hand, &point)) {
            // The terms of the constraint are up to 3e5 over a scale of 1.1e6, those of its
            // derivatives smaller; a few rounding errors.
            assert!((a - b).abs() <= 16.0 * f64::EPSILON * (1.0 + a.abs()), "{a} {b}");
        }
    }
    let work = |analysis: &Analysis| {
        let operations = analysis.derivatives.operations;
        [operations.residual, operations.residual_jacobian, operations.adjoint, operations.hessian]
    };
    for (reduced, by_hand) in work(&reduced).into_iter().zip(work(&by_hand)) {
        assert!(f64::from(reduced) <= 1.05 * f64::from(by_hand), "{reduced} operations, {by_hand} by hand");
    }
}

/// Andrews' squeezer with its six loops as constraints: where the derivatives of the velocities
/// equal the accelerations, its equations equal those differentiated by hand.
#[test]
fn the_squeezer_from_its_constraints() {
    let text = include_str!("../../../../examples/models/ivp/mechanics.rs");
    let begin = text.find("pub fn squeezer").expect("the model is a function");
    let by_hand = &text[begin..];
    let mut lagrange = by_hand.to_string();
    let loops = [
        ("moved_x - SS * cg * ag + SS * sg * vg * vg,", "RR * cb - D * cbt - SS * sg - XB,"),
        ("moved_y - SS * sg * ag - SS * cg * vg * vg,", "RR * sb - D * sbt + SS * cg - YB,"),
        (
            "moved_x - E * cpd * (ap + ad) + E * spd * vpd * vpd + ZT * sd * ad + ZT * cd * vd * vd,",
            "RR * cb - D * cbt - E * spd - ZT * cd + 0.06934,",
        ),
        (
            "moved_y - E * spd * (ap + ad) - E * cpd * vpd * vpd - ZT * cd * ad + ZT * sd * vd * vd,",
            "RR * sb - D * sbt + E * cpd - ZT * sd + 0.00227,",
        ),
        (
            "moved_x + ZF * soe * (ao + ae) + ZF * coe * voe * voe - U * ce * ae + U * se * ve * ve,",
            "RR * cb - D * cbt - ZF * coe - U * se + 0.06934,",
        ),
        (
            "moved_y - ZF * coe * (ao + ae) + ZF * soe * voe * voe - U * se * ae - U * ce * ve * ve,",
            "RR * sb - D * sbt - ZF * soe + U * ce + 0.00227,",
        ),
    ];
    for (differentiated, constraint) in loops {
        assert!(lagrange.contains(differentiated));
        lagrange = lagrange.replace(differentiated, constraint);
    }
    let reduced = read_reduced(&lagrange).expect("its index can be reduced");
    let by_hand = read("", by_hand).expect("it has index one");
    let reduction = reduced.reduction.as_ref().expect("it was reduced");
    assert_eq!(reduction.differentiated, [(21, 2), (22, 2), (23, 2), (24, 2), (25, 2), (26, 2)]);
    let values = |analysis: &Analysis, point: &[f64]| {
        let point = EvaluationPoint { variables: point, opaque: &[], seeds: &[] };
        analysis.model.graph.evaluate(&analysis.model.residual, point)
    };
    for draw in 0..20 {
        // (ẋ, x, z, t), where the derivatives of the rates are the accelerations.
        let mut point: Vec<f64> = (0..42).map(|index| (1.7 * (draw * 42 + index) as f64).sin()).collect();
        (0..7).for_each(|body| point[7 + body] = point[28 + body]);
        for (row, (a, b)) in values(&reduced, &point).into_iter().zip(values(&by_hand, &point)).enumerate() {
            // Lengths are below 0.1, angles, rates and accelerations below two.
            assert!((a - b).abs() <= 16.0 * f64::EPSILON * (0.1 + a.abs()), "{row}: {a} {b}");
        }
    }
}
