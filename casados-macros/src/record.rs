//! `#[derive(Record)]`: a struct as the numbers of an argument.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Data, DeriveInput, Error, Result, parse_quote};

/// The implementation of `Record`, or an error.
pub fn derive(input: TokenStream) -> TokenStream {
    record_impl(input).unwrap_or_else(|error| error.to_compile_error())
}

fn record_impl(input: TokenStream) -> Result<TokenStream> {
    let DeriveInput { ident, mut generics, data, .. } = syn::parse2(input)?;
    let Data::Struct(data) = data else {
        return Err(Error::new(
            ident.span(),
            "`Record` can be derived for structs only: they have a fixed list of numbers",
        ));
    };
    for parameter in generics.type_params_mut() {
        parameter.bounds.push(parse_quote!(::casados::Record));
    }
    let (of, to, condition) = generics.split_for_impl();
    let types = data.fields.iter().map(|field| &field.ty);
    let members: Vec<_> = data.fields.members().collect();
    Ok(quote! {
        impl #of ::casados::Record for #ident #to #condition {
            const NUMBERS: usize = 0 #(+ <#types as ::casados::Record>::NUMBERS)*;
            fn write(&self, to: &mut dyn ::core::ops::FnMut(f64)) {
                #(::casados::Record::write(&self.#members, to);)*
            }
            fn read(from: &mut dyn ::core::ops::FnMut() -> f64) -> Self {
                Self { #(#members: ::casados::Record::read(from)),* }
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expanded_text(input: TokenStream) -> String {
        match syn::parse2(derive(input)) {
            Ok(file) => prettyplease::unparse(&file),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn named_and_numbered_fields() {
        let named = expanded_text(quote!(
            pub struct State<T, const N: usize> {
                pub load: [T; N],
                mass: f64,
            }
        ));
        for part in [
            "impl<T: ::casados::Record, const N: usize> ::casados::Record for State<T, N> {",
            "<[T; N] as ::casados::Record>::NUMBERS",
            "load: ::casados::Record::read(from),",
        ] {
            assert!(named.contains(part), "{part}\n{named}");
        }
        assert!(
            expanded_text(quote!(
                struct Pair(f64, f64);
            ))
            .contains("1: ::casados::Record::read(from),")
        );
    }

    #[test]
    fn enums_have_no_list_of_numbers() {
        assert!(
            expanded_text(quote!(
                enum Mode {
                    A,
                    B,
                }
            ))
            .contains("`Record` can be derived for structs only")
        );
    }
}
