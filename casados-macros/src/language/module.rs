//! `#[dae] mod name { .. }`: selects the model function, and the functions with their own
//! attributes.

use super::Form;
use super::signature::Role;
use proc_macro2::TokenStream;
use syn::{Error, FnArg, Item, ItemFn, ItemMod, Meta, Pat, Result};

/// A function of a module with its own attribute.
pub struct AttributedFunction {
    /// Its index among the items.
    pub index: usize,
    /// The attribute.
    pub form: Form,
    /// The arguments of the attribute.
    pub attribute: TokenStream,
}

/// Removes `#[dae]`, `#[ode]` and `#[function]` from the functions of a module.
pub fn take_attributed_functions(module: &mut ItemMod) -> Vec<AttributedFunction> {
    let items = module.content.iter_mut().flat_map(|(_, items)| items);
    let functions = items.enumerate().filter_map(|(index, item)| match item {
        Item::Fn(function) => Some((index, function)),
        _ => None,
    });
    let mut list = Vec::new();
    for (index, function) in functions {
        function.attrs.retain(|attribute| {
            let last = attribute.path().segments.last().map(|segment| segment.ident.to_string());
            let Some(form) = last.as_deref().and_then(Form::by_name) else { return true };
            let attribute = match &attribute.meta {
                Meta::List(list) => list.tokens.clone(),
                _ => TokenStream::new(),
            };
            list.push(AttributedFunction { index, form, attribute });
            false
        });
    }
    list
}

/// Removes the mark `#[model]`, and returns the index of the model function among the items: the
/// marked one; or the only one with the arguments of a model; or, of several, the one named like
/// the module. Functions with their own attribute are excluded; if these are models and there is no
/// other, there is none.
pub fn model_function(
    form: Form,
    module: &mut ItemMod,
    others: &[AttributedFunction],
) -> Result<Option<usize>> {
    let name = module.ident.clone();
    let Some((_, items)) = &mut module.content else {
        return Err(Error::new_spanned(
            &*module,
            "the attribute must see the module's content: write `mod name { .. }` here",
        ));
    };
    let mut marked = None;
    for (index, item) in items.iter_mut().enumerate() {
        let Item::Fn(function) = item else { continue };
        let before = function.attrs.len();
        function.attrs.retain(|attribute| !attribute.path().is_ident("model"));
        if function.attrs.len() < before && marked.replace(index).is_some() {
            return Err(Error::new(
                function.sig.ident.span(),
                "only one function of a module is its `#[model]`",
            ));
        }
    }
    if marked.is_some() {
        return Ok(marked);
    }
    let needed = if form == Form::Dae { Role::Xdot } else { Role::X };
    let kind = if form == Form::Function { "function" } else { "model" };
    let functions = || {
        items.iter().enumerate().filter_map(|(index, item)| match item {
            _ if others.iter().any(|other| other.index == index) => None,
            Item::Fn(function) if roles(function).any(|role| role == Some(needed)) => Some((index, function)),
            _ => None,
        })
    };
    let models: Vec<_> =
        functions().filter(|(_, function)| roles(function).all(|role| role.is_some())).collect();
    // If no function has all arguments, the error is about the closest one.
    let candidates = if models.is_empty() { functions().collect() } else { models };
    match candidates.as_slice() {
        [] if others.iter().any(|other| (other.form == Form::Function) == (form == Form::Function)) => {
            Ok(None)
        }
        [] => Err(Error::new(
            name.span(),
            format!("no {kind} in this module: a function with an argument `{}` is expected", needed.name()),
        )),
        [(index, _)] => Ok(Some(*index)),
        several => match several.iter().find(|(_, function)| function.sig.ident == name) {
            Some((index, _)) => Ok(Some(*index)),
            None => {
                let names: Vec<_> =
                    several.iter().map(|(_, function)| format!("`{}`", function.sig.ident)).collect();
                Err(Error::new(
                    name.span(),
                    format!("{} could each be the {kind}: mark one with `#[model]`", names.join(", ")),
                ))
            }
        },
    }
}

/// The role of each argument of a function in a model.
fn roles(function: &ItemFn) -> impl Iterator<Item = Option<Role>> {
    function.sig.inputs.iter().map(|input| match input {
        FnArg::Typed(input) => match &*input.pat {
            Pat::Ident(pattern) => Role::of(&pattern.ident),
            _ => None,
        },
        FnArg::Receiver(_) => None,
    })
}
