//! Units of the variables, as the constant `UNITS`, and of outputs, as `UNIT`.

use crate::language::units::Units;
use proc_macro2::TokenStream;
use quote::quote;

/// Both constants, as far as there is something in them.
pub fn write(krate: &syn::Path, units: &Units) -> TokenStream {
    let Units { x, z, u, p, t, .. } = units;
    let [x, z, u, p] = [x, z, u, p].map(|list| {
        let list = if list.iter().all(String::is_empty) { &[][..] } else { list };
        quote!(&[#(#list),*])
    });
    let all = [&units.x, &units.z, &units.u, &units.p];
    (all.into_iter().flatten().chain([t]).any(|unit| !unit.is_empty()))
        .then(|| {
            quote! {
                const UNITS: #krate::__private::Units = #krate::__private::Units { x: #x, z: #z, u: #u, p: #p, t: #t };
            }
        })
        .unwrap_or_default()
}

/// Of the outputs of a function, if there is one.
pub fn of_outputs(units: &Units) -> Option<TokenStream> {
    let unit = &units.outputs;
    (!unit.is_empty()).then(|| quote!(const UNIT: &'static str = #unit;))
}
