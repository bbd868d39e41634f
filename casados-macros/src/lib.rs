//! The attributes `#[dae]`, `#[ode]` and `#[function]`.
//!
//! The entry is these few lines; everything else is an ordinary library over `proc_macro2`:
//! `language` executes the model function symbolically and yields a graph, `graph` differentiates
//! it, `structure` finds out what can be known before it runs, `emit` writes Rust.

mod emit;
mod graph;
mod language;
mod record;
mod structure;

#[cfg(test)]
mod fuzz;

use proc_macro::TokenStream;

/// Bytes of the stack that an expansion has; pages that nobody touches cost nothing. An unoptimised
/// parser takes up to 23 kB for a level, and [`language::tokens::check`] bounds the levels.
const STACK: usize = 1 << 29;

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
/// Beside the function, which stays as it is, stands a type of its name in upper camel case.
///
/// | arguments | by name, in any order, only those that there are |
/// | --- | --- |
/// | `xdot`, `x`, `z`, `u`, `p`, `t` | derivatives, states, algebraic states, controls, parameters, time |
/// | types | `f64`, arrays, tuples, nalgebra vectors and matrices, structs; as many results as there are `x` and `z` |
///
/// | attribute | |
/// | --- | --- |
/// | `nominal(x = [900.0, 2e6], z = 0.1)` | typical values. Those of `z` are where Newton's method starts: of several roots they decide for one; without one it is zero, or the geometric mean of a range that zero is not in |
/// | `range(z = 1e-3..=10.0)` | from where to where values may be |
/// | `N = [3, 5]` | sizes of a model with const parameters |
/// | `name = Type`, `crate = path` | another name of the type; where casados is |
/// | `index_reduction`, with `(baumgarte = [2.0, 1.0])` or `(projection)` | constraints are differentiated until the model has index 1, and its invariants are a function |
///
/// On a `mod` it takes structs, constants and helper functions as well. The body may be any
/// computation that can be unrolled while it compiles: loops, closures, iterators, generics, `if`
/// and `match` on model variables. In `f64` the residual has the bits of the function, but
/// structural zeros are zeros: `0.0 * y`, `0.0 / y` and `y - y` are dropped, whatever `y` is when
/// it runs, NaN too. Conditions of the compiler (`#[cfg]`) are refused inside of a model.
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
/// What holds for [`macro@dae`] holds here, with the arguments `x`, `u`, `p`, `t` and a result for
/// each state.
///
/// [What a model may contain](https://docs.rs/casados/latest/casados/guide/language/index.html) ·
/// [The guide](https://docs.rs/casados/latest/casados/guide/index.html)
#[proc_macro_attribute]
pub fn ode(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Ode, attribute.into(), item.into()).into()
}

/// A function `y(x, z, u, p, t)` of a model's variables: an integrand, an event, a cost, a
/// constraint.
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
/// It has the arguments of its model, those too that it does not use (`_u`), but no `xdot`, and
/// fits to every model of the same dimensions. It is written in the language of [`macro@dae`].
///
/// [What a model may contain](https://docs.rs/casados/latest/casados/guide/language/index.html) ·
/// [The guide](https://docs.rs/casados/latest/casados/guide/index.html)
#[proc_macro_attribute]
pub fn function(attribute: TokenStream, item: TokenStream) -> TokenStream {
    expand(language::Form::Function, attribute.into(), item.into()).into()
}

/// The trait `casados::Record`: a struct as the numbers of an argument of a model, in their order.
#[proc_macro_derive(Record)]
pub fn record(item: TokenStream) -> TokenStream {
    record::derive(item.into()).into()
}

/// The item as it was written and, beside it, its type or the errors: an editor stays alive on a
/// model that is being written.
fn expand(
    form: language::Form,
    attribute: proc_macro2::TokenStream,
    item: proc_macro2::TokenStream,
) -> proc_macro2::TokenStream {
    // What is long without brackets (sums, chains of methods, `else if`) nests in the syntax tree.
    stacker::grow(STACK, || expand_on_thread(form, attribute, item))
}

fn expand_on_thread(
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
