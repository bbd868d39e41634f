//! The choice of kinematic states, and the Newton matrix without them.

use super::super::kinematic::Kinematic;
use super::super::newton_matrix;
use super::super::samples::{NewtonEntry, Term};
use super::{Analysis, accepted, model, mul, sub};
use crate::graph::{Graph, Node, Unary};

fn found(analysis: &Analysis) -> (Vec<Kinematic>, Vec<NewtonEntry>) {
    let Analysis { model, derivatives, facts, .. } = analysis;
    newton_matrix(model, &derivatives.jacobian, derivatives.blocks, &facts.trivial)
}

/// `q̇` equals a state or a control, and three equations depend on `q`; the second one may be
/// trivial as well.
#[test]
fn kinematic_states() {
    type Row = fn(&mut Graph, &[Node]) -> Node;
    let analysis = |own: Row, second: Option<Row>, other: Row| {
        accepted(model([4, 0, 1, 0], move |g, v| {
            let first = own(g, v);
            let mut f = vec![sub(g, v[0], first)];
            for derivative in &v[1..4] {
                let (force, product) = (other(g, v), mul(g, v[5], v[6]));
                let (rest, product) = (sub(g, *derivative, force), mul(g, product, v[7]));
                f.push(sub(g, rest, product));
            }
            if let Some(second) = second {
                let second = second(g, v);
                f[1] = sub(g, v[1], second);
            }
            f
        }))
    };
    let kinematic = |own: Row, second: Option<Row>, other: Row| {
        let (found, _) = found(&analysis(own, second, other));
        found.into_iter().map(|of| (of.state, of.entry, of.velocity, of.dependents)).collect::<Vec<_>>()
    };
    let sine: Row = |g, v| g.unary(Unary::Sin, v[4]);
    // After four entries of f_ẋ (0, 5); three equations depend on q.
    assert_eq!(kinematic(|_, v| v[5], None, sine), [(0, 4, 5, vec![5, 9, 13])]);
    // The control, after the entries of f_x.
    assert_eq!(kinematic(|_, v| v[8], None, sine), [(0, 16, 8, vec![4, 8, 12])]);
    // No equation depends on q.
    assert_eq!(kinematic(|_, v| v[5], None, |_, v| v[8]), [(0, 4, 5, vec![])]);
    // The equation varies; it has a constant; a function of time.
    assert_eq!(kinematic(|_, v| v[4], None, sine), []);
    let shifted: Row = |g, v| {
        let constant = g.constant(-0.5);
        sub(g, v[5], constant)
    };
    assert_eq!(kinematic(shifted, None, sine), []);
    // A difference of constants from outside is excluded, and so is a factor from outside.
    let unknown: Row = |g, v| {
        let (a, b) = (g.opaque(0), g.opaque(1));
        let difference = sub(g, a, b);
        sub(g, v[5], difference)
    };
    assert_eq!(kinematic(unknown, None, sine), []);
    let scaled: Row = |g, v| {
        let factor = g.opaque(0);
        mul(g, factor, v[5])
    };
    assert_eq!(kinematic(scaled, None, sine), [(0, 4, 5, vec![5, 9, 13])]);
    let timed: Row = |g, v| {
        let time = g.unary(Unary::Sin, v[9]);
        sub(g, v[5], time)
    };
    assert_eq!(kinematic(timed, None, sine), []);
    // The others depend on its derivative: after seven entries of f_ẋ.
    let with_derivative: Row = |g, v| {
        let sine = g.unary(Unary::Sin, v[4]);
        sub(g, sine, v[0])
    };
    let dependents = vec![1, 3, 5, 8, 12, 16];
    assert_eq!(kinematic(|_, v| v[5], None, with_derivative), [(0, 7, 5, dependents)]);
    // One of two successive states, or of a chain.
    for second in [(|_, v| v[4]) as Row, |_, v| v[6], |_, v| v[8]] {
        let found = kinematic(|_, v| v[5], Some(second), sine);
        assert_eq!(found.iter().map(|of| of.0).collect::<Vec<_>>(), [0]);
    }
    // The others are the unknowns of the plan: the column of q is added to that of its velocity.
    let analysis = analysis(|_, v| v[5], None, sine);
    let ((_, positions), plan) = (found(&analysis), &analysis.elimination.plan);
    assert!(plan.pivots.len() == 3 && !plan.pivots.iter().any(|pivot| pivot.0 == 0 || pivot.1 == 0));
    let of_velocity = positions.iter().find(|position| (position.row, position.column) == (2, 1));
    let terms = of_velocity.map(|position| position.terms.clone());
    let (own, through) = (Term { entry: 10, by: None, order: 1 }, Term { entry: 9, by: Some(4), order: 2 });
    assert_eq!(terms, Some(vec![own, through]));
}

/// Of a chain of four whose last velocity is a control, every other one: the maximum set.
#[test]
fn velocities_are_not_kinematic() {
    let analysis = accepted(model([4, 0, 1, 0], |g, v| {
        vec![sub(g, v[0], v[5]), sub(g, v[1], v[6]), sub(g, v[2], v[7]), sub(g, v[3], v[8])]
    }));
    let found: Vec<_> = found(&analysis).0.iter().map(|of| (of.state, of.velocity)).collect();
    assert_eq!(found, [(0, 5), (2, 7)]);
}

/// Entries with respect to positions are ordered by the velocities, here in the opposite order.
#[test]
fn dependents_are_by_velocities() {
    let analysis = accepted(model([4, 0, 0, 0], |g, v| {
        let (first, second) = (sub(g, v[0], v[7]), sub(g, v[1], v[6]));
        let (third, fourth) = (mul(g, v[4], v[5]), g.unary(Unary::Sin, v[4]));
        vec![first, second, sub(g, v[2], third), sub(g, v[3], fourth)]
    }));
    let dependents = &analysis.elimination.tables.dependents;
    let states: Vec<_> = dependents.iter().map(|of| of.state).collect();
    assert_eq!(states, [1, 0, 0]);
}
