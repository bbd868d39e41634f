//! The signature of a model: its arguments, identified by name.

use super::Form;
use super::mistakes::CollectedErrors;
use proc_macro2::Ident;
use syn::spanned::Spanned;
use syn::{Error, FnArg, ItemFn, Pat, Result};

/// The role of an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// `ẋ`
    Xdot,
    /// Differential states.
    X,
    /// Algebraic states.
    Z,
    /// Controls.
    U,
    /// Parameters.
    P,
    /// Time.
    T,
    /// Rates of linear controls, in a function.
    Du,
    /// Integrals, in a function.
    Q,
}

impl Role {
    /// The role of a name. Unused arguments may start with an underscore.
    pub fn of(name: &Ident) -> Option<Self> {
        let name = name.to_string();
        Some(match name.strip_prefix('_').unwrap_or(&name) {
            "xdot" => Self::Xdot,
            "x" => Self::X,
            "z" => Self::Z,
            "u" => Self::U,
            "p" => Self::P,
            "t" => Self::T,
            _ => return None,
        })
    }

    /// Its name in a signature.
    pub fn name(self) -> &'static str {
        match self {
            Self::Xdot => "xdot",
            Self::X => "x",
            Self::Z => "z",
            Self::U => "u",
            Self::P => "p",
            Self::T => "t",
            Self::Du => "du",
            Self::Q => "q",
        }
    }
}

/// An argument of a model.
pub struct Argument {
    /// The role.
    pub role: Role,
    /// Its type as written.
    pub ty: syn::Type,
}

/// The arguments of a model function, in its order.
pub fn arguments(form: Form, function: &ItemFn) -> Result<Vec<Argument>> {
    check_qualifiers(form, function)?;
    let mut arguments = Vec::<Argument>::new();
    let mut mistakes = CollectedErrors::default();
    for input in &function.sig.inputs {
        match argument(form, input, &arguments) {
            Ok(argument) => arguments.push(argument),
            Err(error) => mistakes.note(error),
        }
    }
    mistakes.into_result()?;
    let has = |role: Role| arguments.iter().any(|argument| argument.role == role);
    if form == Form::Dae && !has(Role::Xdot) {
        return Err(Error::new(
            function.sig.ident.span(),
            "a `#[dae]` has an argument `xdot`, of the type of `x`; a function that returns `xdot` is an `#[ode]`",
        ));
    }
    if form != Form::Dae && !has(Role::X) {
        let message = match form {
            Form::Function => {
                "a function has the arguments of its model, those that it does not use as well: `_x` has the type of the \
                 model's `x`"
            }
            _ => "a model has differential states: an argument `x`",
        };
        return Err(Error::new(function.sig.ident.span(), message));
    }
    Ok(arguments)
}

/// Parses an argument, given the preceding ones.
fn argument(form: Form, input: &FnArg, before: &[Argument]) -> Result<Argument> {
    let FnArg::Typed(input) = input else {
        return Err(Error::new_spanned(
            input,
            "a model is a function without `self`: write it outside of the `impl`",
        ));
    };
    let role = role(form, &input.pat)?;
    if before.iter().any(|argument| argument.role == role) {
        return Err(Error::new_spanned(&input.pat, format!("the argument `{}` is given twice", role.name())));
    }
    check_type(&input.ty)?;
    Ok(Argument { role, ty: (*input.ty).clone() })
}

/// Rejects types that are invalid regardless of the items in scope.
fn check_type(ty: &syn::Type) -> Result<()> {
    let syn::Type::Reference(reference) = ty else { return Ok(()) };
    if reference.mutability.is_some() {
        return Err(Error::new_spanned(
            reference,
            "a model does not change its arguments: take them by value or by `&`",
        ));
    }
    if let syn::Type::Slice(slice) = &*reference.elem {
        return Err(Error::new_spanned(
            slice,
            "the length of a slice is not known at compile time: write an array, as in `&[f64; 4]`",
        ));
    }
    check_type(&reference.elem)
}

/// The role of an argument, by its name.
fn role(form: Form, pattern: &Pat) -> Result<Role> {
    let arguments = match form {
        Form::Dae => "`xdot`, `x`, `z`, `u`, `p` and `t`",
        Form::Ode => "`x`, `u`, `p` and `t`",
        Form::Function => "`x`, `z`, `u`, `p` and `t`",
    };
    let Pat::Ident(identifier) = pattern else {
        return Err(Error::new(
            pattern.span(),
            format!(
                "arguments of {} are recognised by their names, {arguments}; take this one apart in the body",
                form.description()
            ),
        ));
    };
    // The second state of a function of two states.
    if form == Form::Function && identifier.ident.to_string().trim_start_matches('_') == "x0" {
        return Ok(Role::Z);
    }
    if form == Form::Function {
        match identifier.ident.to_string().trim_start_matches('_') {
            "du" => return Ok(Role::Du),
            "q" => return Ok(Role::Q),
            _ => {}
        }
    }
    match (Role::of(&identifier.ident), form) {
        (Some(Role::Xdot), Form::Ode) => Err(Error::new_spanned(
            &identifier.ident,
            "an `#[ode]` returns `xdot`; a model with the argument `xdot` is a `#[dae]` and returns its residual",
        )),
        (Some(Role::Xdot), Form::Function) => Err(Error::new_spanned(
            &identifier.ident,
            "a `#[function]` has no argument `xdot`: make the derivative an algebraic state",
        )),
        (Some(Role::Z), Form::Ode) => Err(Error::new_spanned(
            &identifier.ident,
            "an `#[ode]` has no algebraic states; write the model as a `#[dae]` with an equation for each of them",
        )),
        (Some(role), _) => Ok(role),
        (None, _) => Err(Error::new_spanned(
            &identifier.ident,
            format!(
                "unknown argument `{}`: the arguments of {} are {arguments}",
                identifier.ident,
                form.description()
            ),
        )),
    }
}

/// Rejects functions with qualifiers.
fn check_qualifiers(form: Form, function: &ItemFn) -> Result<()> {
    let sig = &function.sig;
    let plain = "a model is a plain function of numbers";
    if let Some(token) = &sig.asyncness {
        return Err(Error::new_spanned(token, format!("{plain}: it cannot be `async`")));
    }
    if let Some(token) = &sig.variadic {
        return Err(Error::new_spanned(token, format!("{plain}: it cannot be variadic")));
    }
    if matches!(sig.output, syn::ReturnType::Default) {
        let message = match form {
            Form::Function => "a function returns its outputs, as in `-> [f64; 2]`",
            _ => "a model returns numbers: its residual (`#[dae]`) or `xdot` (`#[ode]`)",
        };
        return Err(Error::new(sig.ident.span(), message));
    }
    Ok(())
}

/// Whether a function is a dual model: `fn f<T: DualNum + Copy>(..)`, with the bound in either
/// place.
pub fn is_dual(function: &ItemFn) -> bool {
    let has = |bounds: &syn::punctuated::Punctuated<syn::TypeParamBound, syn::Token![+]>| {
        bounds.iter().any(|bound| {
            matches!(bound, syn::TypeParamBound::Trait(bound)
                if bound.path.segments.last().is_some_and(|last| last.ident == "DualNum"))
        })
    };
    let generics = &function.sig.generics;
    generics.type_params().any(|parameter| has(&parameter.bounds))
        || generics.where_clause.iter().flat_map(|clause| &clause.predicates).any(
            |predicate| matches!(predicate, syn::WherePredicate::Type(predicate) if has(&predicate.bounds)),
        )
}

/// `pendulum_on_cart` in upper camel case: `PendulumOnCart`.
pub fn type_name(name: &Ident) -> Ident {
    let text = name.to_string();
    let text = text.strip_prefix("r#").unwrap_or(&text);
    let mut camel = String::with_capacity(text.len());
    for word in text.split('_') {
        let mut letters = word.chars();
        if let Some(first) = letters.next() {
            // Two numbers separated by an underscore remain separated.
            if first.is_ascii_digit() && camel.ends_with(|last: char| last.is_ascii_digit()) {
                camel.push('_');
            }
            camel.extend(first.to_uppercase());
            camel.push_str(letters.as_str());
        }
    }
    // In scripts without upper case the name would equal that of the function.
    let has_no_case = |first: char| first.is_alphabetic() && !first.is_uppercase() && !first.is_lowercase();
    if !camel.starts_with(|first: char| first.is_alphabetic()) || camel.starts_with(has_no_case) {
        camel.insert(0, 'M');
    }
    Ident::new(&camel, name.span())
}
