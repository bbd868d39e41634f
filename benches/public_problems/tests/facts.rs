//! What is written about the problems.

use public_problems::{Facts, sets};
use std::collections::BTreeSet;

#[test]
fn names_are_unique_and_sources_are_said() {
    let all = sets::all();
    let names: BTreeSet<_> = all.iter().map(|entry| &entry.facts.name).collect();
    assert_eq!(names.len(), all.len());
    for entry in sets::public() {
        let facts = &entry.facts;
        assert!(facts.published.is_some() && !facts.source.is_empty() && !facts.tags.is_empty());
    }
}

/// Half of them, as the rule happens to divide the names.
#[test]
fn about_half_is_held_out() {
    let all = sets::public();
    let held_out = all.iter().filter(|entry| entry.facts.is_held_out()).count();
    assert!(all.len() >= 40 && (0.4..=0.6).contains(&(held_out as f64 / all.len() as f64)));
}

#[test]
fn other_minima_are_no_optima() {
    // Its second minimum is at 0.2446.
    let all = sets::public();
    let cstr: Vec<&Facts> =
        all.iter().map(|entry| &entry.facts).filter(|facts| facts.name == "cstr").collect();
    assert!(cstr.iter().all(|facts| facts.is_optimum(0.133094) && !facts.is_optimum(0.2446)));
    assert_eq!(cstr.len(), 1);
}
