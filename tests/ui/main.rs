//! Errors are part of the language: each file in `cases/` holds a mistake and is named after it;
//! beside it stands what the compiler says.
//!
//! After a change of a message, `TRYBUILD=overwrite cargo test -p casados-ui-tests` writes
//! the new texts: read them before committing them. The caret belongs under the user's own tokens,
//! and the sentence names the way out.

#[test]
fn mistakes_are_errors() {
    trybuild::TestCases::new().compile_fail("cases/*.rs");
}
