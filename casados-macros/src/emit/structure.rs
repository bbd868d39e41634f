//! The structure of a model as the constant `Dae::STRUCTURE`.

use super::elimination;
use crate::graph::Node;
use crate::language::Variables;
use crate::structure::{Analysis, Derivatives, Facts, FunctionAnalysis, Operations, Reduction};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// The value of `Dae::STRUCTURE`.
pub fn write(analysis: &Analysis) -> TokenStream {
    let Analysis { model, derivatives, facts, .. } = analysis;
    let Derivatives { jacobian, blocks, constant, hessian, linear, operations, .. } = derivatives;
    let krate = &model.krate;
    let name = model.name.to_string();
    let Variables { x, z, u, p } = &model.variables;
    let width = Literal::usize_unsuffixed(x.len() + u.len() + p.len());
    let diagonal_controls = facts.diagonal_controls.iter().map(|&(entry, direction)| {
        let [entry, direction] = [entry, direction].map(Literal::u32_unsuffixed);
        quote!(#krate::__private::DiagonalControl { entry: #entry, direction: #direction })
    });
    let (jacobian, hessian) = (pattern(krate, jacobian), pattern(krate, hessian));
    let variables = Literal::usize_unsuffixed(2 * x.len() + z.len() + u.len() + p.len());
    let [begin, inputs] = [blocks[1], blocks[5] - blocks[1]].map(Literal::usize_unsuffixed);
    let blocks = blocks.map(Literal::usize_unsuffixed);
    let operations = self::operations(krate, operations);
    let Facts { linear_in_state, constant_matrix, autonomous, constant_rows, .. } = facts;
    let [trivial, quadratures, directions, curved] =
        [&facts.trivial, &facts.quadratures, &facts.directions, &facts.curved]
            .map(|list| index_literals(list));
    let [count, terms] = [curved.len(), analysis.symmetric].map(Literal::usize_unsuffixed);
    let elimination = elimination::write(krate, &analysis.elimination.tables);
    let reduction = reduction(krate, analysis.reduction.as_ref());
    quote! {{
        const JACOBIAN: #krate::__private::Pattern = #jacobian;
        const HESSIAN: #krate::__private::Pattern = #hessian;
        const DIRECTIONS: &[u32] = &[#(#directions),*];
        const CURVED: &[u32; #count] = &[#(#curved),*];
        #krate::__private::Structure {
            name: #name,
            x: &[#(#x),*],
            z: &[#(#z),*],
            u: &[#(#u),*],
            p: &[#(#p),*],
            jacobian: JACOBIAN,
            blocks: [#(#blocks),*],
            by_column: &const { #krate::__private::by_column::<#variables, #inputs>(&JACOBIAN, #begin) },
            constant: &[#(#constant),*],
            hessian: HESSIAN,
            linear: &[#(#linear),*],
            linear_in_state: #linear_in_state,
            constant_matrix: #constant_matrix,
            autonomous: #autonomous,
            constant_rows: &[#(#constant_rows),*],
            trivial: &[#(#trivial),*],
            quadratures: &[#(#quadratures),*],
            directions: DIRECTIONS,
            column_of_direction: &const { #krate::__private::columns::<#width>(DIRECTIONS) },
            curved: CURVED,
            symmetric: &const { #krate::__private::symmetric::<#count, #terms>(&HESSIAN, CURVED) },
            diagonal_controls: &[#(#diagonal_controls),*],
            operations: #operations,
            elimination: #elimination,
            reduction: #reduction,
        }
    }}
}

/// The index reduction of the model.
fn reduction(krate: &syn::Path, reduction: Option<&Reduction>) -> TokenStream {
    let Some(Reduction { differentiated, rates, singular, projection, .. }) = reduction else {
        return quote!(::core::option::Option::None);
    };
    let differentiated = differentiated.iter().map(|&(equation, times)| {
        let [equation, times] = [equation, times].map(Literal::u32_unsuffixed);
        quote!((#equation, #times))
    });
    let singular = singular.map(Literal::u32_unsuffixed);
    let projection = projection.is_some();
    quote! {
        ::core::option::Option::Some(&#krate::__private::Reduction {
            differentiated: &[#(#differentiated),*],
            rates: &[#(#rates),*],
            projection: #projection,
            singular: [#(#singular),*],
        })
    }
}

/// The value of `Function::STRUCTURE`.
pub fn function_structure(analysis: &FunctionAnalysis) -> TokenStream {
    let FunctionAnalysis { model, derivatives, used, .. } = analysis;
    let Derivatives { jacobian, blocks, constant, hessian, linear, operations, .. } = derivatives;
    let krate = &model.krate;
    let name = model.name.to_string();
    let Variables { x, z, u, p } = &model.variables;
    let (jacobian, hessian) = (pattern(krate, jacobian), pattern(krate, hessian));
    let blocks = blocks.map(Literal::usize_unsuffixed);
    let entries = &blocks[4];
    let [rows, begins] = [0, 1].map(|more| Literal::usize_unsuffixed(model.residual.len() + more));
    let operations = self::operations(krate, operations);
    let variables = index_literals(used);
    quote! {{
        const JACOBIAN: #krate::__private::Pattern = #jacobian;
        const BY_ROW: &[u32] = &const { #krate::__private::by_row::<#rows, #entries>(&JACOBIAN) };
        #krate::__private::FunctionStructure {
            name: #name,
            x: &[#(#x),*],
            z: &[#(#z),*],
            u: &[#(#u),*],
            p: &[#(#p),*],
            jacobian: JACOBIAN,
            blocks: [#(#blocks),*],
            by_row: BY_ROW,
            begins: &const { #krate::__private::begins::<#begins>(&JACOBIAN, BY_ROW) },
            constant: &[#(#constant),*],
            hessian: #hessian,
            linear: &[#(#linear),*],
            variables: &[#(#variables),*],
            operations: #operations,
        }
    }}
}

fn operations(krate: &syn::Path, operations: &Operations) -> TokenStream {
    let &Operations { residual, residual_jacobian, adjoint, hessian } = operations;
    let [residual, residual_jacobian, adjoint, hessian] =
        [residual, residual_jacobian, adjoint, hessian].map(Literal::u32_unsuffixed);
    quote! {
        #krate::__private::Operations {
            residual: #residual,
            residual_jacobian: #residual_jacobian,
            adjoint: #adjoint,
            hessian: #hessian,
        }
    }
}

/// Indices as literals.
pub fn index_literals(list: &[u32]) -> Vec<Literal> {
    list.iter().map(|&index| Literal::u32_unsuffixed(index)).collect()
}

fn pattern(krate: &syn::Path, entries: &[(u32, u32, Node)]) -> TokenStream {
    let rows = entries.iter().map(|entry| Literal::u32_unsuffixed(entry.0));
    let columns = entries.iter().map(|entry| Literal::u32_unsuffixed(entry.1));
    quote! {
        #krate::__private::Pattern { rows: &[#(#rows),*], columns: &[#(#columns),*] }
    }
}
