//! The attributes `#[dae]`, `#[ode]` and `#[function]`.
//!
//! This file is the entry; the rest is an ordinary library over `proc_macro2`: `language` executes
//! the model function symbolically and returns a graph, `graph` differentiates it, `structure`
//! analyses it at compile time, `emit` writes Rust.

mod emit;
mod graph;
mod language;
mod record;
mod structure;

#[cfg(test)]
mod fuzz;

use proc_macro::TokenStream;

/// Stack size of the thread that expands a model, in bytes; untouched pages use no memory. An
/// unoptimised parser takes up to 23 kB per nesting level; [`language::tokens::check`] limits the
/// levels.
const STACK_BYTES: usize = 1 << 29;

/// A differential-algebraic model `0 = f(ẋ, x, u, z, p, t)`.
///
/// ```
/// use casados::prelude::*;
///
/// /// A mass on a spring, whose force is an algebraic state.
/// #[dae(nominal(z = 0.1), range(x = -1.0..=1.0))]
/// fn spring(xdot: [f64; 2], x: [f64; 2], z: f64, p: f64) -> [f64; 3] {
///     [xdot[0] - x[1], xdot[1] + z, z - p * x[0].sinh()]
/// }
/// let irk = Irk::<Spring, RadauIIA<3>>::new(Options::default());
/// ```
///
/// The attribute keeps the function and adds a type with its name in upper camel case.
///
/// | arguments | identified by name, in any order; only those that the model has |
/// | --- | --- |
/// | `xdot`, `x`, `z`, `u`, `p`, `t` | derivatives, states, algebraic states, controls, parameters, time |
/// | types | `f64`, arrays, tuples, nalgebra vectors and matrices, structs |
/// | result | as many residuals as there are `x` and `z` |
///
/// | attribute | meaning |
/// | --- | --- |
/// | `nominal(x = [900.0, 2e6], z = 0.1)` | typical values; those of `z` are the initial guess of Newton's method and select one of several roots (default: zero, or the geometric mean of a range without zero) |
/// | `range(z = 1e-3..=10.0)` | range of admissible values |
/// | `N = [3, 5]` | sizes for which a model with const parameters is generated |
/// | `name = Type`, `crate = path` | another name of the type; path of casados |
/// | `index_reduction`, with `(baumgarte = [2.0, 1.0])` or `(projection)` | differentiates constraints until the model has index 1, and adds a function that returns its invariants |
///
/// On a `mod` the attribute also reads structs, constants and helper functions. The body may be any
/// computation that can be unrolled at compile time: loops, closures, iterators, generics, `if` and
/// `match` on model variables. In `f64` the residual is bitwise equal to that of the function,
/// except for structural zeros: `0.0 * y`, `0.0 / y` and `y - y` become zero, even if `y` is NaN at
/// run time. `#[cfg]` inside of a model is an error.
///
/// [What a model may contain](https://docs.rs/casados/latest/casados/guide/language/index.html) ·
/// [The guide](https://docs.rs/casados/latest/casados/guide/index.html)
#[proc_macro_attribute]
pub fn dae(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Dae, attribute.into(), item.into()).into()
}

/// An explicit model `ẋ = g(x, u, p, t)`.
///
/// ```
/// use casados::prelude::*;
///
/// /// A pendulum that is pushed.
/// #[ode]
/// fn pendulum(x: [f64; 2], u: f64) -> [f64; 2] {
///     [x[1], u - 9.81 * x[0].sin()]
/// }
/// let irk = Irk::<Pendulum, Gauss<2>>::new(Options::default());
/// let erk = Erk::<Pendulum, Rk4>::new(Options::default());
/// ```
///
/// The arguments are `x`, `u`, `p`, `t`, and the result is the derivative of each state. Everything
/// else is as in [`macro@dae`].
///
/// [What a model may contain](https://docs.rs/casados/latest/casados/guide/language/index.html) ·
/// [The guide](https://docs.rs/casados/latest/casados/guide/index.html)
#[proc_macro_attribute]
pub fn ode(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Ode, attribute.into(), item.into()).into()
}

/// A function `y(x, z, u, p, t)` of a model's variables: an integrand, an event function, a cost or
/// a constraint.
///
/// ```
/// use casados::prelude::*;
///
/// /// Kinetic and potential energy of a mass on a spring.
/// #[function]
/// fn energy(x: [f64; 2], p: f64) -> [f64; 2] {
///     [0.5 * x[1] * x[1], 0.5 * p * x[0] * x[0]]
/// }
/// let integral = Quadrature::<Energy>::new();
/// ```
///
/// It has the arguments of its model, unused ones included (`_u`), without `xdot`, and applies to
/// every model of the same dimensions. The body is written in the language of [`macro@dae`].
///
/// [What a model may contain](https://docs.rs/casados/latest/casados/guide/language/index.html) ·
/// [The guide](https://docs.rs/casados/latest/casados/guide/index.html)
#[proc_macro_attribute]
pub fn function(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Function, attribute.into(), item.into()).into()
}

/// Derives the trait `casados::Record`: the struct becomes an argument of a model, an array of its
/// numbers in the order of the fields.
#[proc_macro_derive(Record)]
pub fn record(item: TokenStream) -> TokenStream {
    record::derive(item.into()).into()
}

/// Returns the item unchanged, followed by its type or by the errors: editors keep completing an
/// unfinished model.
fn expand(
    form: language::Form,
    attribute: proc_macro2::TokenStream,
    item: proc_macro2::TokenStream,
) -> proc_macro2::TokenStream {
    // Long sums, chains of methods and `else if` nest deeply in the syntax tree.
    stacker::grow(STACK_BYTES, || expand_on_thread(form, attribute, item))
}

fn expand_on_thread(
    form: language::Form,
    attribute: proc_macro2::TokenStream,
    item: proc_macro2::TokenStream,
) -> proc_macro2::TokenStream {
    let checks = [language::tokens::check(&attribute), language::tokens::check(&item)];
    if let Some(error) = checks.into_iter().find_map(Result::err) {
        // Items that are nested too deeply or too long overflow the compiler itself.
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
        let mut expansion = expand_source(source)?;
        expansion.extend(warnings);
        Ok(expansion)
    });
    expansion.unwrap_or_else(|error| emit::with_errors(attribute, item, &error))
}

fn expand_source(source: language::Source) -> syn::Result<proc_macro2::TokenStream> {
    let mut parts = Vec::new();
    let mut mistakes = language::mistakes::CollectedErrors::default();
    for language::ModelOrFunctions { form, original, models } in source.parts {
        if form == language::Form::Function {
            let functions = models.into_iter().map(structure::analyse_function).collect();
            parts.push(emit::ReadItem::Functions(functions));
            continue;
        }
        let mut analysed = Vec::new();
        for model in models {
            match structure::analyse(model) {
                Ok(model) => analysed.push(model),
                Err(error) => mistakes.note(error),
            }
        }
        parts.push(emit::ReadItem::Models(original, analysed));
    }
    mistakes.into_result()?;
    emit::expand(source.item, source.place, &parts)
}
