//! The common part of the implementations for models and functions: a module with the computing
//! functions.

use super::routine::{OuterConstants, Routine};
use crate::graph::Node;
use crate::language::{Model, Table, Variables};
use crate::structure::Derivatives;
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// The names of the computing functions.
pub struct Names {
    /// The function that computes the values.
    pub value: &'static str,
    /// The function that computes the values and the Jacobian.
    pub value_jacobian: &'static str,
    /// The array of the values.
    pub output: &'static str,
    /// The symbol in the documentation.
    pub symbol: &'static str,
}

/// The names for a model.
pub const MODEL: Names =
    Names { value: "residual", value_jacobian: "residual_jacobian", output: "f", symbol: "f" };

/// The names for a function.
pub const FUNCTION: Names =
    Names { value: "value", value_jacobian: "value_jacobian", output: "y", symbol: "y" };

/// The type, with the values of its const parameters.
pub fn model_type(model: &Model) -> TokenStream {
    let Model { name, instance, .. } = model;
    let values = instance.iter().map(|instance| Literal::u64_unsuffixed(instance.value));
    if instance.is_empty() { quote!(#name) } else { quote!(#name<#(#values),*>) }
}

/// The module `code`, with an optional additional function.
pub fn module(
    model: &Model,
    derivatives: &Derivatives,
    names: &Names,
    more: Option<Routine>,
) -> syn::Result<TokenStream> {
    let Model { krate, variables, graph, .. } = model;
    let mut text = functions_as_text(model, derivatives, names);
    if let Some(routine) = more {
        text += &routine.write(graph, variables, of(model));
    }
    let code: TokenStream = text.parse()?;
    let tables = (!model.tables.is_empty()).then(|| quote!(use #krate::__private::tables::Table;));
    Ok(quote! {
        #[allow(clippy::all, clippy::pedantic, non_camel_case_types, unused_imports, unused_variables)]
        mod code {
            use #krate::__private::{Piece, Scalar, elementary};
            #tables
            #code
        }
    })
}

fn of(model: &Model) -> OuterConstants<'_> {
    OuterConstants { constants: model.opaque.len(), tables: &model.tables }
}

/// The constants and tables passed to the computing functions: their module does not see the user's
/// names.
pub fn outer_arguments(model: &Model) -> Option<TokenStream> {
    let constants = (!model.opaque.is_empty()).then(|| quote!(&C,));
    let tables = (0..model.tables.len()).map(type_of_table);
    (constants.is_some() || !model.tables.is_empty()).then(|| quote!(#constants #(#tables,)*))
}

fn type_of_table(index: usize) -> syn::Ident {
    quote::format_ident!("CasadosTable{index}")
}

/// Encloses the implementations, so that their names do not collide with the user's; constants from
/// outside are `C`.
pub fn enclose(model: &Model, implementations: &TokenStream) -> TokenStream {
    let Model { opaque, uses, instance, tables, .. } = model;
    if opaque.is_empty() && tables.is_empty() {
        return quote! {
            const _: () = { #implementations };
        };
    }
    let parameters = instance.iter().map(|instance| {
        let (name, ty, value) = (&instance.name, &instance.ty, Literal::u64_unsuffixed(instance.value));
        quote!(#[allow(dead_code)] const #name: #ty = #value;)
    });
    let names = quote!(#(#uses)* #(#parameters)*);
    let length = Literal::usize_unsuffixed(opaque.len());
    let constants = (!opaque.is_empty()).then(|| {
        quote! {
            #[allow(unused_imports)]
            const CASADOS_CONSTANTS: [f64; #length] = {
                #names
                [#(#opaque),*]
            };
        }
    });
    let tables = tables.iter().enumerate().map(|(index, table)| self::table(model, index, table, &names));
    let own = (!opaque.is_empty()).then(|| quote!(const C: [f64; #length] = CASADOS_CONSTANTS;));
    quote! {
        const _: () = {
            #constants
            #(#tables)*
            const _: () = {
                #own
                #implementations
            };
        };
    }
}

/// A type that represents a table. A generic function would repeat its numbers for each scalar.
fn table(model: &Model, index: usize, table: &Table, names: &TokenStream) -> TokenStream {
    let (krate, ty, expression) = (&model.krate, type_of_table(index), &table.expression);
    let variables = Literal::usize_unsuffixed(table.variables);
    quote! {
        #[derive(Clone, Copy)]
        struct #ty;
        impl #ty {
            #[allow(unused_imports)]
            fn table() -> &'static (impl #krate::__private::tables::Table<#variables> + 'static) {
                #names
                use #krate::__private::tables as casados_tables;
                const { &#expression }
            }
        }
        impl #krate::__private::tables::Table<#variables> for #ty {
            #[inline(always)]
            fn partial<S: #krate::__private::Scalar>(&self, at: [S; #variables], orders: [u32; #variables]) -> S {
                #krate::__private::tables::Table::partial(Self::table(), at, orders)
            }
        }
    }
}

/// The computing functions as text: they are long and simple, and parsing is faster than `quote`.
fn functions_as_text(model: &Model, derivatives: &Derivatives, names: &Names) -> String {
    let Derivatives { jacobian, constant, gradient, hessian, .. } = derivatives;
    let Model { variables, graph, residual, .. } = model;
    let [_, nv, ..] = dimensions(variables);
    let (ny, Names { value, value_jacobian, output, symbol }) = (residual.len(), names);
    let (nj, nh) = (jacobian.len(), hessian.len());
    let entries = || jacobian.iter().zip(constant).enumerate();
    let equations = || residual.iter().enumerate().map(|(row, &node)| (*output, row, node));
    let write = |routine: Routine| routine.write(graph, variables, of(model));

    let code_residual = write(Routine {
        name: value,
        documentation: &format!("`{symbol}(v)`:"),
        inputs: &[("v", nv)],
        outputs: &[(output, ny)],
        stores: equations().collect(),
    });
    let code_constants = write(Routine {
        name: "jacobian_constants",
        documentation: "The constant entries of the Jacobian:",
        inputs: &[],
        outputs: &[("jacobian", nj)],
        stores: entries()
            .filter(|(_, (_, constant))| **constant)
            .map(|(index, ((_, _, node), _))| ("jacobian", index, *node))
            .collect(),
    });
    // Row by row: values shared by an equation and its derivatives are used soon.
    let mut rows: Vec<Vec<(&str, usize, Node)>> = equations().map(|store| vec![store]).collect();
    for (index, ((row, _, node), constant)) in entries() {
        if let (false, Some(stores)) = (*constant, rows.get_mut(*row as usize)) {
            stores.push(("jacobian", index, *node));
        }
    }
    let code_jacobian = write(Routine {
        name: value_jacobian,
        documentation: &format!("`{symbol}(v)` and the entries of its Jacobian that are not constant:"),
        inputs: &[("v", nv)],
        outputs: &[(output, ny), ("jacobian", nj)],
        stores: rows.concat(),
    });
    let code_adjoint = write(Routine {
        name: "adjoint",
        documentation: &format!("`∇(μᵀ {symbol})`:"),
        inputs: &[("v", nv), ("mu", ny)],
        outputs: &[("gradient", nv)],
        stores: gradient.iter().take(nv - 1).enumerate().map(|(i, &node)| ("gradient", i, node)).collect(),
    });
    let code_hessian = write(Routine {
        name: "hessian",
        documentation: &format!("The lower triangle of `∇²(μᵀ {symbol})`:"),
        inputs: &[("v", nv), ("mu", ny)],
        outputs: &[("hessian", nh)],
        stores: hessian.iter().enumerate().map(|(i, entry)| ("hessian", i, entry.2)).collect(),
    });
    [code_residual, code_constants, code_jacobian, code_adjoint, code_hessian].concat()
}

/// The width of panels of directions.
const PANEL_WIDTH: usize = 8;

/// `NK`, `NV`, `NW` and `NC`.
pub fn dimensions(variables: &Variables) -> [usize; 4] {
    let Variables { x, z, u, p } = variables;
    let [nx, nz, nu, np] = [x, z, u, p].map(Vec::len);
    let nw = nx + nu + np;
    [nx + nz, 2 * nx + nz + nu + np + 1, nw, panel_columns(nw)]
}

/// `NC` for `nw` directions: whole panels.
pub fn panel_columns(nw: usize) -> usize {
    nw.next_multiple_of(PANEL_WIDTH)
}
