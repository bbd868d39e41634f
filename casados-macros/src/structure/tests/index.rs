//! Numbers of equations and unknowns, and their matching.

use super::{accepted, model, mul, reason, refusal, sub};
use crate::graph::{Binary, Graph, Node};

#[test]
fn number_of_equations() {
    assert_eq!(
        refusal(model([2, 1, 0, 0], |_, v| vec![v[0], v[1]])),
        "the residual has 2 equations where the model needs 3 (2 states and 1 algebraic state)"
    );
    assert_eq!(
        refusal(model([1, 0, 0, 0], |_, v| vec![v[0], v[1]])),
        "the residual has 2 equations where the model needs 1 (one per state)"
    );
    assert!(refusal(model([1, 0, 0, 0], |_, _| Vec::new())).contains("0 equations"));
}

/// The pendulum in Cartesian coordinates: no equation can determine the multiplier.
#[test]
fn index_three() {
    let pendulum = |g: &mut Graph, v: &[Node]| {
        let (dx, x, z) = (&v[0..4], &v[4..8], v[8]);
        let (fx, fy) = (mul(g, z, x[0]), mul(g, z, x[1]));
        let (xx, yy) = (mul(g, x[0], x[0]), mul(g, x[1], x[1]));
        let square = g.binary(Binary::Add, xx, yy);
        let one = g.constant(1.0);
        vec![
            sub(g, dx[0], x[2]),
            sub(g, dx[1], x[3]),
            sub(g, dx[2], fx),
            sub(g, dx[3], fy),
            sub(g, square, one),
        ]
    };
    assert_eq!(
        reason(model([4, 1, 0, 0], pendulum)),
        "equation 4 contains neither a derivative nor an algebraic state; `xdot[2]`, `xdot[3]` and `z[0]` are \
         determined only by equations 2 and 3"
    );
}

#[test]
fn over_and_underdetermined() {
    // Two equations for ẋ₀, none for z₀.
    let twice = |g: &mut Graph, v: &[Node]| vec![sub(g, v[0], v[1]), sub(g, v[1], v[0])];
    assert_eq!(
        reason(model([1, 1, 0, 0], twice)),
        "equations 0 and 1 determine only `xdot[0]`; `z[0]` is determined by no equation"
    );
    // The matching exists only through an entry that cancels.
    let cancels = |g: &mut Graph, v: &[Node]| {
        let sum = g.binary(Binary::Add, v[0], v[1]);
        let (rest, first) = (sub(g, sum, v[1]), sub(g, v[0], v[2]));
        vec![first, rest]
    };
    assert!(reason(model([2, 0, 0, 0], cancels)).starts_with("equations 0 and 1 determine only `xdot[0]`"));
    // Two separate parts, each named separately.
    let two = |g: &mut Graph, v: &[Node]| {
        vec![sub(g, v[0], v[4]), sub(g, v[0], v[5]), sub(g, v[1], v[4]), sub(g, v[1], v[5])]
    };
    assert_eq!(
        reason(model([4, 0, 0, 0], two)),
        "equations 0 and 1 determine only `xdot[0]`; equations 2 and 3 determine only `xdot[1]`; `xdot[2]` is \
         determined by no equation; `xdot[3]` is determined by no equation"
    );
}

/// The matching requires an augmenting path through all equations: equation i has ẋᵢ and ẋᵢ₋₁, the
/// last one only the second-to-last rate.
#[test]
fn long_augmenting_path() {
    let n = 300;
    let chain = |closed: bool| {
        model([n, 0, 0, 0], move |g, v| {
            (0..n)
                .map(
                    |i| if i == n - 1 { v[0] } else { sub(g, v[i], v[i + usize::from(closed || i + 2 < n)]) },
                )
                .collect()
        })
    };
    assert!(accepted(chain(true)).explicit.is_none());
    assert!(reason(chain(false)).contains("`xdot[299]` is determined by no equation"));
}

#[test]
fn derivatives_of_named_states() {
    let mut model = model([1, 1, 0, 0], |g, v| vec![sub(g, v[1], v[2]), v[2]]);
    model.variables.x[0] = "cart.position".into();
    assert!(reason(model).contains("the derivative of `cart.position` is determined by no equation"));
}
