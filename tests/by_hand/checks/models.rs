//! The checks of models accept a right one and find every kind of fault in a wrong one.

use super::example::*;
use casados_core::testing::{Points, Report, check_derivatives, check_pattern};

fn check<const FAULT: u8>() -> Report {
    check_derivatives::<Example<FAULT>>(&Points::random(10).all(-2.0..=2.0))
}

#[test]
fn right_model_passes() {
    check::<NO_FAULT>().assert();
    check_pattern::<Example<NO_FAULT>>(&Points::random(5)).assert();
    let report = check::<NO_FAULT>();
    // Nothing remains unsaid, and the largest difference is rounding.
    for row in &report.rows {
        assert_eq!(row.inconclusive, 0, "{report}");
        assert!(row.difference < 1e-11, "{report}");
    }
}

#[test]
fn faults_are_found_and_named() {
    let found = |report: Report, quantity: &str, entry: &str| {
        assert!(!report.passed(), "{report}");
        assert!(
            report.wrong.iter().any(|wrong| wrong.quantity == quantity && wrong.entry == entry),
            "{report}"
        );
        assert!(report.to_string().contains(entry));
    };
    found(check::<JACOBIAN_SIGN>(), "Jacobian", "of equation 0 by angle");
    found(check::<ADJOINT_LAST_DIGITS>(), "adjoint", "by torque");
    found(check::<HESSIAN_TERM>(), "Hessian", "by angle and angle");
    found(check::<HESSIAN_PATTERN>(), "Hessian", "by force and angle");
    found(check::<CONSTANT_FORGOTTEN>(), "Jacobian", "of equation 1 by level");
    found(check::<LINEAR_DECLARED>(), "Hessian, linear rows", "of equation 1 by angle and angle");
    let pattern = check_pattern::<Example<HESSIAN_PATTERN>>(&Points::random(5));
    found(pattern, "Hessian outside", "by force and angle");
}

#[test]
fn false_facts_are_found() {
    fn found<const FAULT: u8>(quantity: &str) {
        let report = check_pattern::<Example<FAULT>>(&Points::random(5));
        let wrong: Vec<_> = report.rows.iter().filter(|row| row.wrong > 0).map(|row| row.quantity).collect();
        assert_eq!(wrong, [quantity], "{report}");
    }
    found::<CONSTANT_DECLARED>("constant rows");
    found::<DIRECTION_LEFT_OUT>("directions");
    found::<CURVED_LEFT_OUT>("curved variables");
    found::<QUADRATURE_DECLARED>("quadratures");
    found::<TRIVIAL_DECLARED>("trivial equations");
    found::<STRAIGHT_DECLARED>("linear in the state");
    found::<MATRIX_DECLARED>("constant matrix");
    found::<TIME_FORGOTTEN>("autonomous");
}

#[test]
fn points_outside_of_the_domain_do_not_pass() {
    let report = check_derivatives::<Example<NO_FAULT>>(&Points::random(3).all(1e4..=1e5));
    assert!(!report.passed(), "{report}");
}

/// The next block of variables is not what is meant.
#[test]
#[should_panic = "there is no x[1]: `example` has 1 of them"]
fn ranges_of_states_that_are_not_there() {
    let _ = Points::<Example<NO_FAULT>>::random(1).x(1, 0.0..=1.0);
}

#[test]
#[should_panic = "there is no p[18446744073709551615]: `example` has 1 of them"]
fn ranges_of_absurd_indices() {
    let _ = Points::<Example<NO_FAULT>>::random(1).p(usize::MAX, 0.0..=1.0);
}

/// Nobody holds all points at once.
#[test]
fn points_are_drawn_one_by_one() {
    let some: Vec<_> = Points::<Example<NO_FAULT>>::random(usize::MAX).iter().take(3).collect();
    let same: Vec<_> = Points::<Example<NO_FAULT>>::random(3).iter().collect();
    assert_eq!(some, same);
}
