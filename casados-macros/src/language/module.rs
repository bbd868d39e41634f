//! `#[dae] mod name { .. }`: which of the functions is the model, and which have attributes of
//! their own.

use super::Form;
use super::signature::Role;
use proc_macro2::TokenStream;
use syn::{Error, FnArg, Item, ItemFn, ItemMod, Meta, Pat, Result};

/// A function of a module with an attribute of its own.
pub struct AttributedFunction {
    /// Its index among the items.
    pub index: usize,
    /// Which attribute.
    pub form: Form,
    /// What stands in the brackets of the attribute.
    pub attribute: TokenStream,
}

/// Takes `#[dae]`, `#[ode]` and `#[function]` off the functions of a module that bear them.
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

/// Takes the mark `#[model]` off the function that bears it, and returns the index of the model
/// function among the items: the marked one; or the only one whose arguments are those of a model;
/// or, of several, the one that is named like the module. Functions with an attribute of their own
/// are not meant; where they are models and no other is, there is none.
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
    // If none fits in all arguments, the error is about those of the nearest one.
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

/// What each argument of a function would be in a model.
fn roles(function: &ItemFn) -> impl Iterator<Item = Option<Role>> {
    function.sig.inputs.iter().map(|input| match input {
        FnArg::Typed(input) => match &*input.pat {
            Pat::Ident(pattern) => Role::of(&pattern.ident),
            _ => None,
        },
        FnArg::Receiver(_) => None,
    })
}
