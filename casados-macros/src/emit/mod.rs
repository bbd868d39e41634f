//! From graphs and structure to Rust.

mod chunk;
mod code;
mod divisor;
mod documentation;
mod domain;
mod dual;
mod elimination;
mod function;
mod model;
mod routine;
mod schedule;
mod structure;
#[cfg(test)]
mod tests;
mod text;
mod together;

use crate::language::{self, Instance, Model, Place};
use crate::structure::{Analysis, FunctionAnalysis};
use proc_macro2::TokenStream;
use quote::{ToTokens, quote};

/// The item as written, the model types and their implementations of `Dae` (and `GraphDae`, `Ode`).
pub fn expand(item: TokenStream, place: Place, models: &[Analysis]) -> syn::Result<TokenStream> {
    let Some(first) = models.first() else {
        return Ok(item);
    };
    let original = original(&item).map(|(name, _)| name).unwrap_or_else(|| first.model.name.clone());
    let mut implementations = models.iter().map(model::write).collect::<syn::Result<TokenStream>>()?;
    let documentation = documentation::of_type(&original, models);
    let Model { name, visibility, instance, krate, .. } = &first.model;
    let mut types = vec![Type { name, visibility, documentation, instance }];
    implementations.extend(models.iter().filter_map(model::constrained));
    for of in [model::invariants, model::projection] {
        let functions: Vec<&FunctionAnalysis> = models.iter().filter_map(of).collect();
        let Some(first) = functions.first() else { continue };
        for function in &functions {
            implementations.extend(function::write(function)?);
        }
        let documentation = documentation::of_function(functions.iter().copied());
        types.push(Type { name: &first.model.name, visibility, documentation, instance });
    }
    let item = with_elementary_functions(item, krate);
    assemble(item, place, &types, implementations)
}

/// The same for functions, whose types implement `Function`.
pub fn expand_functions(
    item: TokenStream,
    place: Place,
    functions: &[FunctionAnalysis],
) -> syn::Result<TokenStream> {
    let Some(first) = functions.first() else {
        return Ok(item);
    };
    let implementations = functions.iter().map(function::write).collect::<syn::Result<TokenStream>>()?;
    let documentation = documentation::of_function(functions.iter());
    let Model { name, visibility, instance, krate, .. } = &first.model;
    let item = with_elementary_functions(item, krate);
    assemble(item, place, &[Type { name, visibility, documentation, instance }], implementations)
}

/// The same for dual models.
pub fn expand_dual(source: language::dual::Source) -> syn::Result<TokenStream> {
    let language::dual::Source { item, place, models } = source;
    let Some(language::dual::Model { name, visibility, instance, .. }) = models.first() else {
        return Ok(item);
    };
    let documentation = models.first().map(dual::documentation).unwrap_or_default();
    let implementations = models.iter().map(dual::write).collect();
    assemble(item, place, &[Type { name, visibility, documentation, instance }], implementations)
}

/// The item with `sin`, `exp` and the like in scope, which `f64` has only where there is `std`.
fn with_elementary_functions(item: TokenStream, krate: &syn::Path) -> TokenStream {
    let import = quote! {
        #[allow(unused_imports)]
        use #krate::scalar::Float as _;
    };
    language::tokens::with(item, &import, &TokenStream::new())
}

/// The type of a model.
struct Type<'a> {
    name: &'a syn::Ident,
    visibility: &'a syn::Visibility,
    documentation: TokenStream,
    instance: &'a [Instance],
}

/// The item, the types and their implementations, where they belong.
fn assemble(
    item: TokenStream,
    place: Place,
    types: &[Type],
    implementations: TokenStream,
) -> syn::Result<TokenStream> {
    let declaration = |ty: &Type, visibility: &TokenStream| {
        let Type { name, documentation, instance, .. } = ty;
        let generics = generics(instance.iter().map(|instance| (&instance.name, &instance.ty)));
        quote! {
            #documentation
            #[derive(Clone, Copy, Debug)]
            #visibility struct #name #generics;
        }
    };
    match place {
        // A model may be all that its function is for.
        Place::Beside => {
            let declarations = types.iter().map(|ty| declaration(ty, &ty.visibility.to_token_stream()));
            Ok(quote! {
                #[allow(dead_code)]
                #item
                #(#declarations)*
                #implementations
            })
        }
        Place::Inside => {
            let syn::ItemMod { ident, .. } = syn::parse2(item.clone())?;
            let declarations = types.iter().map(|ty| declaration(ty, &quote!(pub)));
            let inside = quote! {
                #(#declarations)*
                #implementations
            };
            let module = language::tokens::with(item, &TokenStream::new(), &inside);
            let exports = types.iter().map(|Type { name, visibility, .. }| {
                quote! {
                    #[doc(inline)]
                    #[allow(unused_imports)]
                    #visibility use #ident::#name;
                }
            });
            Ok(quote! {
                #[allow(dead_code)]
                #module
                #(#exports)*
            })
        }
    }
}

/// The item as it was written beside its errors, and its name: without it, every use of the model
/// would be an error more. It stands for a type that has the first error inside of itself, of which
/// the compiler says nothing else.
pub fn with_errors(attribute: TokenStream, item: TokenStream, error: &syn::Error) -> TokenStream {
    let errors: Vec<TokenStream> = error.clone().into_iter().map(|error| error.to_compile_error()).collect();
    let mut first = errors.first();
    let stub = original(&item).map(|(name, item)| {
        let (visibility, parameters) = match &item {
            // In an `impl` there is no place for a type.
            syn::Item::Fn(function) if function.sig.receiver().is_some() => return TokenStream::new(),
            syn::Item::Fn(function) => (&function.vis, Some(&function.sig.generics)),
            syn::Item::Mod(module) => (&module.vis, None),
            _ => return TokenStream::new(),
        };
        let generics =
            generics(parameters.into_iter().flat_map(syn::Generics::const_params).map(|c| (&c.ident, &c.ty)));
        let name = language::model_name(attribute, &name);
        let error = first.take();
        quote! {
            #[doc(hidden)]
            #[allow(dead_code)]
            #visibility type #name #generics = [(); #error];
        }
    });
    // What the type has is not said twice.
    let others = errors.iter().skip(usize::from(first.is_none()));
    quote! { #item #stub #(#others)* }
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

/// `<const NX: usize>`, or nothing.
fn generics<'a>(parameters: impl Iterator<Item = (&'a syn::Ident, &'a syn::Type)>) -> Option<TokenStream> {
    let parameters: Vec<TokenStream> =
        parameters.map(|(name, ty)| quote!(const #name: #ty).into_token_stream()).collect();
    (!parameters.is_empty()).then(|| quote!(<#(#parameters),*>))
}
