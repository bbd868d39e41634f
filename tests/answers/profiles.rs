//! The profile that README, the first chapter and the template recommend.

use crate::Test;

/// In debug builds an integrator is compiled with the user's crate: without its line it runs
/// unoptimised, ten times as long (`docs/guide/performance.md`).
const PROFILE: &str = "[profile.dev]\nopt-level = 1\n[profile.dev.package.casados-core]\nopt-level = 3\n";

#[test]
fn recommended_profiles_optimise_the_package_itself() -> Test {
    for (name, text) in [
        ("README.md", include_str!("../../README.md")),
        ("docs/guide/first_model.md", include_str!("../../docs/guide/first_model.md")),
        ("docs/guide/performance.md", include_str!("../../docs/guide/performance.md")),
        ("template/Cargo.toml", include_str!("../../template/Cargo.toml")),
    ] {
        let profiles = text.matches("[profile.dev]").count();
        if profiles != 1 || !text.contains(PROFILE) {
            return Err(format!("{name} recommends another profile").into());
        }
    }
    Ok(())
}
