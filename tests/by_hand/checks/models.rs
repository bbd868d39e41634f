//! The checks of models accept a right one and find every kind of fault in a wrong one.

use super::example::*;
use casados_core::testing::{Points, Report, check_derivatives, check_pattern};

fn check<const FAULT: u8>() -> Report {
    check_derivatives::<Example<FAULT>>(&Points::random(10).all(-2.0..=2.0))
}

#[test]
fn correct_model() {
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
fn faults_of_models() {
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
    found(check::<CONSTANT_NOT_WRITTEN>(), "Jacobian", "of equation 1 by level");
    found(check::<FALSELY_LINEAR>(), "Hessian, linear rows", "of equation 1 by angle and angle");
    let pattern = check_pattern::<Example<HESSIAN_PATTERN>>(&Points::random(5));
    found(pattern, "Hessian outside", "by force and angle");
}

#[test]
fn false_declarations() {
    fn faults_found<const FAULT: u8>(quantity: &str) {
        let report = check_pattern::<Example<FAULT>>(&Points::random(5));
        let wrong: Vec<_> = report.rows.iter().filter(|row| row.wrong > 0).map(|row| row.quantity).collect();
        assert_eq!(wrong, [quantity], "{report}");
    }
    faults_found::<FALSELY_CONSTANT>("constant rows");
    faults_found::<DIRECTION_MISSING>("directions");
    faults_found::<NONLINEAR_VARIABLE_MISSING>("curved variables");
    faults_found::<FALSE_QUADRATURE>("quadratures");
    faults_found::<FALSELY_TRIVIAL>("trivial equations");
    faults_found::<FALSELY_LINEAR_IN_STATE>("linear in the state");
    faults_found::<FALSELY_CONSTANT_MATRIX>("constant matrix");
    faults_found::<FALSELY_AUTONOMOUS>("autonomous");
}

#[test]
fn points_outside_of_the_domain() {
    let report = check_derivatives::<Example<NO_FAULT>>(&Points::random(3).all(1e4..=1e5));
    assert!(!report.passed(), "{report}");
}

/// The next block of variables is not what is meant.
#[test]
#[should_panic = "there is no x[1]: `example` has 1 of them"]
fn ranges_of_missing_states() {
    let _ = Points::<Example<NO_FAULT>>::random(1).x(1, 0.0..=1.0);
}

#[test]
#[should_panic = "there is no p[18446744073709551615]: `example` has 1 of them"]
fn ranges_of_absurd_indices() {
    let _ = Points::<Example<NO_FAULT>>::random(1).p(usize::MAX, 0.0..=1.0);
}

/// Nobody holds all points at once.
#[test]
fn lazily_drawn_points() {
    let some: Vec<_> = Points::<Example<NO_FAULT>>::random(usize::MAX).iter().take(3).collect();
    let same: Vec<_> = Points::<Example<NO_FAULT>>::random(3).iter().collect();
    assert_eq!(some, same);
}
