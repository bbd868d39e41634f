//! What is known about a model before it runs, as the constant `Dae::STRUCTURE`.

use crate::graph::Node;
use crate::language::Variables;
use crate::structure::{Analysis, Operations};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// The value of `Dae::STRUCTURE`.
pub fn write(analysis: &Analysis) -> TokenStream {
    let Analysis { model, jacobian, blocks, constant, hessian, linear, operations, .. } = analysis;
    let krate = &model.krate;
    let name = model.name.to_string();
    let Variables { x, z, u, p } = &model.variables;
    let (jacobian, hessian) = (pattern(krate, jacobian), pattern(krate, hessian));
    let blocks = blocks.map(Literal::usize_unsuffixed);
    let &Operations { residual, residual_jacobian, adjoint, hessian: second } = operations;
    let [residual, residual_jacobian, adjoint, second] =
        [residual, residual_jacobian, adjoint, second].map(Literal::u32_unsuffixed);
    quote! {
        #krate::model::Structure {
            name: #name,
            x: &[#(#x),*],
            z: &[#(#z),*],
            u: &[#(#u),*],
            p: &[#(#p),*],
            jacobian: #jacobian,
            blocks: [#(#blocks),*],
            constant: &[#(#constant),*],
            hessian: #hessian,
            linear: &[#(#linear),*],
            operations: #krate::model::Operations {
                residual: #residual,
                residual_jacobian: #residual_jacobian,
                adjoint: #adjoint,
                hessian: #second,
            },
        }
    }
}

fn pattern(krate: &syn::Path, entries: &[(u32, u32, Node)]) -> TokenStream {
    let rows = entries.iter().map(|entry| Literal::u32_unsuffixed(entry.0));
    let columns = entries.iter().map(|entry| Literal::u32_unsuffixed(entry.1));
    quote! {
        #krate::model::Pattern { rows: &[#(#rows),*], columns: &[#(#columns),*] }
    }
}
