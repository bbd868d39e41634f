//! Derivative code three ways: what the attributes emit, `num-dual`, and complex step or
//! differences of order 8; on the example models and on random models that cover every function of
//! the language.

use casados::GraphDae;
use casados::testing::{Points, Report, check_derivatives, check_pattern};
use std::path::Path;

#[allow(clippy::all, dead_code, unused_parens, unused_variables)]
#[path = "../generated/models.rs"]
mod generated;
#[path = "../generator/mod.rs"]
mod generator;
#[allow(dead_code)] // Each program takes a part.
#[path = "../../examples/models"]
mod models {
    pub mod awe;
    pub mod chain;
    pub mod ivp;
    pub mod pendulum;
}

mod examples;
mod ivp;

/// The file of random models is what the generator writes, and it covers the language.
#[test]
fn generated_models_file() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("generated/models.rs");
    let text = generator::generated_file();
    if std::env::var_os("CASADOS_WRITE").is_some() {
        std::fs::write(&path, &text).expect("tests/generated can be written");
    }
    for function in generator::FUNCTIONS {
        assert!(text.contains(&format!(".{function}(")), "no random model uses {function}");
    }
    let stored = std::fs::read_to_string(&path).expect("tests/generated/models.rs is there");
    // A formatter may have passed over the file: only the tokens count.
    let tokens = |text: &str| text.chars().filter(|c| !c.is_whitespace() && *c != ',').collect::<String>();
    assert!(
        tokens(&text) == tokens(&stored),
        "run `CASADOS_WRITE=1 cargo test --test derivatives generated_file`"
    );
}

/// Every comparison passes, and at most a tenth of the entries are near a kink or a singularity,
/// where differences say nothing.
fn check<M: GraphDae>(points: &Points<M>) {
    let report: Report = check_derivatives(points);
    report.assert();
    for row in &report.rows {
        assert!(row.inconclusive * 10 <= row.entries, "{report}");
    }
    check_pattern(points).assert();
    assert!(!M::STRUCTURE.jacobian.is_empty(), "{} depends on nothing", M::STRUCTURE.name);
}

macro_rules! random_models {
    ($($test:ident: $model:ident),* $(,)?) => {
        $(
            #[test]
            fn $test() {
                check::<generated::$model>(&Points::random(6).all(-1.5..=1.5));
            }
        )*
        #[test]
        fn all_random_models_are_checked() {
            let count = [$(stringify!($model)),*].len();
            assert_eq!(count, generator::MODELS);
        }
    };
}

random_models! {
    random0: Random0, random1: Random1, random2: Random2, random3: Random3, random4: Random4, random5: Random5,
    random6: Random6, random7: Random7, random8: Random8, random9: Random9, random10: Random10, random11: Random11,
}
