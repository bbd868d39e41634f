//! Code generation: from graphs and structure to Rust.

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
mod simultaneous;
mod structure;
#[cfg(test)]
mod tests;
mod text;
mod units;

use crate::language::{self, Instance, Model, Place};
use crate::structure::{Analysis, FunctionAnalysis};
use proc_macro2::TokenStream;
use quote::{ToTokens, quote};

/// The models or functions read from one Rust function.
pub enum ReadItem {
    /// Models, with the name of the Rust function.
    Models(syn::Ident, Vec<Analysis>),
    /// Functions of a model's variables.
    Functions(Vec<FunctionAnalysis>),
}

/// The item as written, the types and their implementations of `Dae` (and `GraphDae`, `Ode`) or of
/// `Function`.
pub fn expand(item: TokenStream, place: Place, parts: &[ReadItem]) -> syn::Result<TokenStream> {
    let (mut types, mut implementations) = (Vec::new(), TokenStream::new());
    let mut krate = None;
    for part in parts {
        match part {
            ReadItem::Models(original, models) => {
                let Some(first) = models.first() else { continue };
                krate = krate.or(Some(&first.model.krate));
                for model in models {
                    implementations.extend(model::write(model)?);
                }
                types.push(Type::of(&first.model, documentation::type_documentation(original, models)));
                implementations.extend(models.iter().filter_map(model::constrained));
                for of in [model::invariants, model::projection] {
                    let functions: Vec<&FunctionAnalysis> = models.iter().filter_map(of).collect();
                    types.extend(self::functions(functions.iter().copied(), &mut implementations)?);
                }
            }
            ReadItem::Functions(functions) => {
                krate = krate.or(functions.first().map(|first| &first.model.krate));
                types.extend(self::functions(functions.iter(), &mut implementations)?);
            }
        }
    }
    let Some(krate) = krate else { return Ok(item) };
    let item = with_elementary_functions(item, krate);
    assemble(item, place, &types, implementations)
}

/// The type of a function; its implementations are appended.
fn functions<'a>(
    functions: impl Iterator<Item = &'a FunctionAnalysis> + Clone,
    implementations: &mut TokenStream,
) -> syn::Result<Option<Type<'a>>> {
    for function in functions.clone() {
        implementations.extend(function::write(function)?);
    }
    let documentation = documentation::function_documentation(functions.clone());
    Ok(functions.clone().next().map(|first| Type::of(&first.model, documentation)))
}

/// As [`expand`], for dual models.
pub fn expand_dual(source: language::dual::Source) -> syn::Result<TokenStream> {
    let language::dual::Source { item, place, models } = source;
    let Some(language::dual::Model { name, visibility, instance, .. }) = models.first() else {
        return Ok(item);
    };
    let documentation = models.first().map(dual::documentation).unwrap_or_default();
    let implementations = models.iter().map(dual::write).collect();
    assemble(item, place, &[Type { name, visibility, documentation, instance }], implementations)
}

/// The item with `sin`, `exp` etc. in scope, which `f64` has with `std` only.
fn with_elementary_functions(item: TokenStream, krate: &syn::Path) -> TokenStream {
    let import = quote! {
        #[allow(unused_imports)]
        use #krate::__private::Float as _;
    };
    language::tokens::insert_in_body(item, &import, &TokenStream::new())
}

/// The type of a model.
struct Type<'a> {
    name: &'a syn::Ident,
    visibility: &'a syn::Visibility,
    documentation: TokenStream,
    instance: &'a [Instance],
}

impl<'a> Type<'a> {
    fn of(model: &'a Model, documentation: TokenStream) -> Self {
        let Model { name, visibility, instance, .. } = model;
        Self { name, visibility, documentation, instance }
    }
}

/// Assembles the item, the types and their implementations.
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
        // The function itself may be unused.
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
            let module = language::tokens::insert_in_body(item, &TokenStream::new(), &inside);
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

/// The item as written with its errors and stubs of its types, so that uses of the models cause no
/// further errors. The first stub contains the first error, which suppresses other errors about it;
/// the others refer to the first.
pub fn with_errors(attribute: TokenStream, item: TokenStream, error: &syn::Error) -> TokenStream {
    let mut errors = error.clone().into_iter().map(|error| error.to_compile_error());
    let Some((name, original)) = named_item(&item) else { return quote!(#item #(#errors)*) };
    let stub = |visibility: &syn::Visibility, generics: &TokenStream, name: &syn::Ident, is: TokenStream| {
        quote! {
            #[doc(hidden)]
            #[allow(dead_code)]
            #visibility type #name #generics = #is;
        }
    };
    let parameters = |of: &syn::Generics| {
        generics(of.const_params().map(|constant| (&constant.ident, &constant.ty))).unwrap_or_default()
    };
    let name = language::model_name(attribute, &name);
    match original {
        // An `impl` block cannot contain a type.
        syn::Item::Fn(function) if function.sig.receiver().is_none() => {
            let first = errors.next();
            let stub = stub(&function.vis, &parameters(&function.sig.generics), &name, quote!([(); #first]));
            quote! { #item #stub #(#errors)* }
        }
        syn::Item::Mod(mut module) => {
            let item = language::tokens::without_attributes(item);
            let first = errors.next();
            let mut stubs = stub(&module.vis, &TokenStream::new(), &name, quote!([(); #first]));
            for (function, attribute) in language::attributed_functions(&mut module) {
                let other = language::model_name(attribute, &function.ident);
                stubs.extend(stub(&module.vis, &parameters(&function.generics), &other, quote!(#name)));
            }
            quote! { #item #stubs #(#errors)* }
        }
        _ => quote!(#item #(#errors)*),
    }
}

/// The function or module of an item, and its name.
fn named_item(item: &TokenStream) -> Option<(syn::Ident, syn::Item)> {
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
