//! From graphs and structure to Rust.

mod chunk;
mod documentation;
mod model;
mod routine;
mod schedule;
mod structure;
#[cfg(test)]
mod tests;

use crate::language::Place;
use crate::structure::Analysis;
use proc_macro2::TokenStream;
use quote::{ToTokens, quote};

/// The item as written, the model types and their implementations of `Dae` (and `GraphDae`, `Ode`).
pub fn expand(item: TokenStream, place: Place, models: &[Analysis]) -> syn::Result<TokenStream> {
    let Some(first) = models.first() else {
        return Ok(item);
    };
    let original = original(&item).map(|(name, _)| name).unwrap_or_else(|| first.model.name.clone());
    let implementations = models.iter().map(model::write).collect::<syn::Result<TokenStream>>()?;

    let name = &first.model.name;
    let visibility = &first.model.visibility;
    let documentation = documentation::of_type(&original, models);
    let generics = generics(first.model.instance.iter().map(|instance| (&instance.name, &instance.ty)));
    let declaration = quote! {
        #documentation
        #[derive(Clone, Copy, Debug)]
    };
    match place {
        // A model may be all that its function is for.
        Place::Beside => Ok(quote! {
            #[allow(dead_code)]
            #item
            #declaration
            #visibility struct #name #generics;
            #implementations
        }),
        Place::Inside => {
            let mut module: syn::ItemMod = syn::parse2(item)?;
            let inside = quote! {
                #declaration
                pub struct #name #generics;
                #implementations
            };
            let Some((_, items)) = &mut module.content else {
                return Err(syn::Error::new_spanned(module, "a model needs a module with its content"));
            };
            items.push(syn::Item::Verbatim(inside));
            let ident = &module.ident;
            Ok(quote! {
                #[allow(dead_code)]
                #module
                #[doc(inline)]
                #visibility use #ident::#name;
            })
        }
    }
}

/// The item as it was written beside its errors, and the type alone: without it, every use of the
/// model would be an error more.
pub fn with_errors(item: TokenStream, error: &syn::Error) -> TokenStream {
    let error = error.to_compile_error();
    let stub = original(&item).map(|(name, item)| {
        let (visibility, parameters) = match &item {
            syn::Item::Fn(function) => (&function.vis, Some(&function.sig.generics)),
            syn::Item::Mod(module) => (&module.vis, None),
            _ => return TokenStream::new(),
        };
        let generics =
            generics(parameters.into_iter().flat_map(syn::Generics::const_params).map(|c| (&c.ident, &c.ty)));
        let name = type_name(&name);
        quote! {
            #[doc(hidden)]
            #[allow(dead_code)]
            #visibility struct #name #generics;
        }
    });
    quote! { #item #stub #error }
}

/// The function or module of an item, and its name.
fn original(item: &TokenStream) -> Option<(syn::Ident, syn::Item)> {
    let item: syn::Item = syn::parse2(item.clone()).ok()?;
    let name = match &item {
        syn::Item::Fn(function) => function.sig.ident.clone(),
        syn::Item::Mod(module) => module.ident.clone(),
        _ => return None,
    };
    Some((name, item))
}

/// `chain_of_masses` as `ChainOfMasses`.
fn type_name(function: &syn::Ident) -> syn::Ident {
    let name: String = syn::ext::IdentExt::unraw(function)
        .to_string()
        .split('_')
        .flat_map(|word| {
            let mut letters = word.chars();
            letters.next().into_iter().flat_map(char::to_uppercase).chain(letters).collect::<Vec<_>>()
        })
        .collect();
    syn::parse_str(&name).map_or_else(
        |_| function.clone(),
        |name: syn::Ident| syn::Ident::new(&name.to_string(), function.span()),
    )
}

/// `<const NX: usize>`, or nothing.
fn generics<'a>(parameters: impl Iterator<Item = (&'a syn::Ident, &'a syn::Type)>) -> Option<TokenStream> {
    let parameters: Vec<TokenStream> =
        parameters.map(|(name, ty)| quote!(const #name: #ty).into_token_stream()).collect();
    (!parameters.is_empty()).then(|| quote!(<#(#parameters),*>))
}
