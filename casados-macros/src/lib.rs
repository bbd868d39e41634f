//! The attributes `#[dae]`, `#[ode]` and `#[function]`.
//!
//! The entry is these few lines; everything else is an ordinary library over `proc_macro2`:
//! `language` executes the model function symbolically and yields a graph, `graph` differentiates
//! it, `structure` finds out what can be known before it runs, `emit` writes Rust.

mod emit;
mod graph;
mod language;
mod structure;

#[cfg(test)]
mod fuzz;

use proc_macro::TokenStream;

/// Bytes of the stack that an expansion has; pages that nobody touches cost nothing. An unoptimised
/// parser takes up to 23 kB for a level, and [`language::tokens::check`] bounds the levels.
const STACK: usize = 1 << 29;

/// A differential-algebraic model `f(ẋ, x, u, z, p, t) = 0`.
///
/// What a model may contain is in `docs/language.md`. In `f64` the residual has the bits of the
/// function, but structural zeros are zeros: `0.0 * y`, `0.0 / y` and `y - y` are dropped, whatever
/// `y` is when it runs, NaN too. Conditions of the compiler (`#[cfg]`) are refused inside of a
/// model.
///
/// `#[dae(nominal(x = [900.0, 2e6], z = 0.1), range(z = 1e-3..=10.0))]` says where it lives.
/// Algebraic states start Newton's method at their nominal values where a call gives no others
/// (`set_start`), without one at zero, or at the geometric mean of a range that zero is not in.
/// Where the equations have several roots, that decides for one; where they have no value or a
/// singular matrix at `z = 0`, as those with `z.ln()` or `z * z - x[0]`, there is no solution
/// without it.
///
/// `#[dae(index_reduction)]` differentiates constraints in time until the model has index 1, and
/// makes its invariants a function; `#[dae(index_reduction(baumgarte = [2.0, 1.0]))]` lets what
/// constraints are off by decay, `#[dae(index_reduction(projection))]` is for `casados::Projected`.
#[proc_macro_attribute]
pub fn dae(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Dae, attribute.into(), item.into()).into()
}

/// An explicit model `ẋ = g(x, u, p, t)`.
///
/// What holds for [`macro@dae`] holds here: what a model may contain is in `docs/language.md`,
/// structural zeros are zeros, and conditions of the compiler are refused.
#[proc_macro_attribute]
pub fn ode(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Ode, attribute.into(), item.into()).into()
}

/// A function `y(x, z, u, p, t)` of a model's variables: an integrand, an event, a cost, a
/// constraint.
///
/// It is written in the language of [`macro@dae`]: structural zeros are zeros, and conditions of
/// the compiler are refused.
#[proc_macro_attribute]
pub fn function(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Function, attribute.into(), item.into()).into()
}

/// The item as it was written and, beside it, its type or the errors: an editor stays alive on a
/// model that is being written.
fn expand(
    form: language::Form,
    attribute: proc_macro2::TokenStream,
    item: proc_macro2::TokenStream,
) -> proc_macro2::TokenStream {
    // What is long without brackets (sums, chains of methods, `else if`) nests in the syntax tree.
    stacker::grow(STACK, || expand_within(form, attribute, item))
}

fn expand_within(
    form: language::Form,
    attribute: proc_macro2::TokenStream,
    item: proc_macro2::TokenStream,
) -> proc_macro2::TokenStream {
    let checks = [language::tokens::check(&attribute), language::tokens::check(&item)];
    if let Some(error) = checks.into_iter().find_map(Result::err) {
        // The compiler itself does not bear what is nested too deeply or too long.
        return error.to_compile_error();
    }
    match language::dual::read(form, attribute.clone(), item.clone()) {
        Ok(None) => {}
        Ok(Some(source)) => {
            return emit::expand_dual(source)
                .unwrap_or_else(|error| emit::with_errors(attribute, item, &error));
        }
        Err(error) => return emit::with_errors(attribute, item, &error),
    }
    let expansion = language::read(form, attribute.clone(), item.clone()).and_then(|source| {
        let warnings = source.warnings.clone();
        let mut expansion = expand_source(form, source)?;
        expansion.extend(warnings);
        Ok(expansion)
    });
    expansion.unwrap_or_else(|error| emit::with_errors(attribute, item, &error))
}

fn expand_source(form: language::Form, source: language::Source) -> syn::Result<proc_macro2::TokenStream> {
    if form == language::Form::Function {
        let functions: Vec<_> = source.models.into_iter().map(structure::analyse_function).collect();
        return emit::expand_functions(source.item, source.place, &functions);
    }
    let mut models = Vec::new();
    let mut mistakes = language::mistakes::Mistakes::default();
    for model in source.models {
        match structure::analyse(model) {
            Ok(model) => models.push(model),
            Err(error) => mistakes.note(error),
        }
    }
    mistakes.none()?;
    emit::expand(source.item, source.place, &models)
}
