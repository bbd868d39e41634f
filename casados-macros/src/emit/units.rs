//! The units of the variables as the constant `UNITS`, and of outputs as `UNIT`.

use crate::language::units::Units;
use proc_macro2::TokenStream;
use quote::quote;

/// Both constants, unless they are empty.
pub fn write(krate: &syn::Path, units: &Units) -> TokenStream {
    let Units { x, z, u, p, t, .. } = units;
    let [x, z, u, p] = [x, z, u, p].map(|list| {
        let list = if list.iter().all(String::is_empty) { &[][..] } else { list };
        quote!(&[#(#list),*])
    });
    let mut all = [&units.x, &units.z, &units.u, &units.p].into_iter().flatten().chain([t]);
    if all.all(String::is_empty) {
        return TokenStream::new();
    }
    quote! {
        const UNITS: #krate::__private::Units = #krate::__private::Units { x: #x, z: #z, u: #u, p: #p, t: #t };
    }
}

/// The unit of the outputs of a function, if any.
pub fn output_unit(units: &Units) -> Option<TokenStream> {
    let unit = &units.outputs;
    (!unit.is_empty()).then(|| quote!(const UNIT: &'static str = #unit;))
}
