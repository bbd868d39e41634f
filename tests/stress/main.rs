//! Stress: forty things that break integrators, and must not break here. The name of a test begins
//! with its number: `cargo test t07`. What was measured is in `docs/accuracy.md`.
//!
//! | number | what | where |
//! | --- | --- | --- |
//! | 1, 2 | constants of tableaux, order conditions | `tests/methods/tableaux` |
//! | 3 | stability functions to `\|z\| = 1e12` | `tests/methods/stability` |
//! | 4 | order of convergence, and the floor | `tests/methods/order` |
//! | 5, 6 | order reduction, stiffness of 1e12 | `tests/methods/stiffness` |
//! | 7, 8, 9 | energy, angular momentum, compensated sums | `tests/methods/invariants`; a million steps in `tests/optimised/long_runs.rs` |
//! | 10, 11 | the way back, linear invariants | `tests/methods/invariants` |
//! | 12 | relative accuracy over decades | `tests/methods/stiffness` |
//! | 13, 15, 16, 18, 19 | derivatives: adjoint and forward, the complex step, symmetry, cancellation, iterations that stop early | `sensitivities` |
//! | 14, 17 | derivatives against references | `tests/ivp/sensitivities`; exact zeros in `sensitivities` |
//! | 20, 21, 23, 35 | singular and nearly singular matrices, rank-deficient mass matrices | `elimination`, `failures` |
//! | 22 | index two | `failures`, `adaptive`; at compile time `tests/ui/cases/structurally_singular.rs` |
//! | 24, 25, 33 | inconsistent start values, branches, warm starts | `starts`, `adaptive` |
//! | 26, 29, 30, 31, 32 | models without a value, jumps, blow-up, divergence, quality of Newton's method | `failures`, `adaptive` |
//! | 27, 28, 36 | powers of two, denormal numbers, lengths of steps | `scaling`, `adaptive` |
//! | 34 | threads | `tests/batch` |
//! | 37, 38, 40 | nothing at all, ends of steps, polynomials | `tests/methods/endpoints` |
//! | 39 | rounding of the data | `tests/methods/stiffness` |
//!
//! Besides: random equations with known solutions (`tests/methods/properties`), anything into every
//! entry (`tests/fuzz/`, which is compiled beside; into the macro in `casados-macros/src/fuzz.rs`),
//! single precision (`precision`).

#[path = "../interval/mod.rs"]
mod interval;
#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models/ivp"]
mod models {
    pub mod chemistry;
    pub mod circuits;
    pub mod oscillators;
}

mod adaptive;
mod elimination;
mod everything;
mod failures;
mod identities;
mod jumps;
mod precision;
mod roots;
mod roots_of_plants;
mod scaling;
mod sensitivities;
mod start_values;

#[test]
fn numbering_of_the_tests() {
    fn read(directory: &std::path::Path, sources: &mut String) {
        for entry in std::fs::read_dir(directory).expect("a directory") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                read(&path, sources);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                *sources += &std::fs::read_to_string(path).expect("a text");
            }
        }
    }
    let mut sources = String::new();
    read(std::path::Path::new(env!("CARGO_MANIFEST_DIR")), &mut sources);
    for number in 1..=40 {
        let name = format!("t{number:02}_");
        assert!(sources.contains(&format!("fn {name}")) || sources.contains(&format!("({name}")), "{name}");
    }
}
