//! The implementations of `Dae`, `GraphDae` and `Ode` for one model.

use super::routine::Routine;
use super::structure;
use crate::graph::Node;
use crate::language::{Model, Variables};
use crate::structure::Analysis;
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// Writes the implementations for one model.
pub fn write(analysis: &Analysis) -> syn::Result<TokenStream> {
    let Analysis { model, jacobian, hessian, explicit, .. } = analysis;
    let Model { name, variables, opaque, uses, krate, instance, .. } = model;
    let Variables { x, z, u, p } = variables;
    let [nx, nz, nu, np] = [x, z, u, p].map(Vec::len);
    let [nk, nv, nw] = dimensions(variables);
    let (nj, nh, nb) = (jacobian.len(), hessian.len(), analysis.elimination.plan.blocks.len());
    let code: TokenStream = code(analysis).parse()?;

    let values = instance.iter().map(|instance| Literal::u64_unsuffixed(instance.value));
    let ty = if instance.is_empty() { quote!(#name) } else { quote!(#name<#(#values),*>) };
    let [lx, lz, lu, lp, lk, lv, lw, lj, lh, lb, time] =
        [nx, nz, nu, np, nk, nv, nw, nj, nh, nb, nv - 1].map(Literal::usize_unsuffixed);
    let structure = structure::write(analysis);
    // Constants from outside are an argument: the module of the code sees no name of the user's.
    let c = (!opaque.is_empty()).then(|| quote!(&C,));

    let finite = |rows: &&Vec<(u32, f64)>| rows.iter().all(|row| row.1.is_finite());
    let ode = explicit.as_ref().filter(finite).map(|rows| {
        let rows = rows.iter().map(|&(row, coefficient)| {
            let row = Literal::u32_unsuffixed(row);
            quote!((#row, #coefficient))
        });
        quote! {
            #[automatically_derived]
            impl #krate::Ode for #ty {
                const ROWS: &'static [(u32, f64)] = &[#(#rows),*];
            }
        }
    });
    let implementations = quote! {
        #[allow(clippy::all, clippy::pedantic, non_camel_case_types, unused_variables)]
        mod code {
            use #krate::scalar::{Piece, Scalar};
            #code
        }

        #[automatically_derived]
        impl #krate::Dae for #ty {
            type Shape = #krate::Dims<#lx, #lz, #lu, #lp, #lk, #lv, #lw>;
            type Jacobian<T: #krate::shape::Plain> = [T; #lj];
            type Hessian<T: #krate::shape::Plain> = [T; #lh];
            type Factors<B: #krate::shape::Plain> = [B; #lb];
            const STRUCTURE: #krate::model::Structure = #structure;

            #[inline]
            fn residual<S: #krate::Lanes>(v: &[S::Cell; #lv], f: &mut [S::Cell; #lk]) {
                code::residual::<S>(#c v, f);
            }

            #[inline]
            fn jacobian_constants<S: #krate::Lanes>(jacobian: &mut [S::Cell; #lj]) {
                code::jacobian_constants::<S>(#c jacobian);
            }

            #[inline]
            fn residual_jacobian<S: #krate::Lanes>(
                v: &[S::Cell; #lv],
                f: &mut [S::Cell; #lk],
                jacobian: &mut [S::Cell; #lj],
            ) {
                code::residual_jacobian::<S>(#c v, f, jacobian);
            }

            #[inline]
            fn adjoint<S: #krate::Lanes>(v: &[S::Cell; #lv], mu: &[S::Cell; #lk], gradient: &mut [S::Cell; #lv]) {
                code::adjoint::<S>(#c v, mu, gradient);
                S::from_f64(0.0).store(&mut gradient[#time]);
            }

            #[inline]
            fn hessian<S: #krate::Lanes>(v: &[S::Cell; #lv], mu: &[S::Cell; #lk], hessian: &mut [S::Cell; #lh]) {
                code::hessian::<S>(#c v, mu, hessian);
            }
        }

        #[automatically_derived]
        impl #krate::GraphDae for #ty {
            fn residual_of<S: #krate::Scalar<Cell = S>>(v: &[S], f: &mut [S]) {
                if let (Some(v), Some(f)) = (v.first_chunk(), f.first_chunk_mut()) {
                    code::residual::<S>(#c v, f);
                }
            }

            fn adjoint_of<S: #krate::Scalar<Cell = S>>(v: &[S], mu: &[S], gradient: &mut [S]) {
                if let (Some(v), Some(mu), Some(gradient)) =
                    (v.first_chunk(), mu.first_chunk(), gradient.first_chunk_mut())
                {
                    code::adjoint::<S>(#c v, mu, gradient);
                    S::from_f64(0.0).store(&mut gradient[#time]);
                }
            }
        }

        #ode
    };
    Ok(if opaque.is_empty() {
        quote! {
            const _: () = { #implementations };
        }
    } else {
        let length = Literal::usize_unsuffixed(opaque.len());
        let parameters = instance.iter().map(|instance| {
            let (name, ty, value) = (&instance.name, &instance.ty, Literal::u64_unsuffixed(instance.value));
            quote!(#[allow(dead_code)] const #name: #ty = #value;)
        });
        quote! {
            const _: () = {
                #[allow(unused_imports)]
                const CASADOS_CONSTANTS: [f64; #length] = {
                    #(#uses)*
                    #(#parameters)*
                    [#(#opaque),*]
                };
                const _: () = {
                    const C: [f64; #length] = CASADOS_CONSTANTS;
                    #implementations
                };
            };
        }
    })
}

/// The functions that compute, as text: they are long and simple, and a parser is faster than a quote.
fn code(analysis: &Analysis) -> String {
    let Analysis { model, jacobian, constant, gradient, hessian, .. } = analysis;
    let Model { variables, graph, residual, opaque, .. } = model;
    let [nk, nv, ..] = dimensions(variables);
    let (nj, nh) = (jacobian.len(), hessian.len());
    let entries = || jacobian.iter().zip(constant).enumerate();
    let equations = || residual.iter().enumerate().map(|(row, &node)| ("f", row, node));
    let write = |routine: Routine| routine.write(graph, variables, opaque.len());

    let code_residual = write(Routine {
        name: "residual",
        documentation: "`f(v)`:",
        inputs: &[("v", nv)],
        outputs: &[("f", nk)],
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
    // Row after row: what an equation and its derivatives share is used soon.
    let mut rows: Vec<Vec<(&str, usize, Node)>> = equations().map(|store| vec![store]).collect();
    for (index, ((row, _, node), constant)) in entries() {
        if let (false, Some(stores)) = (*constant, rows.get_mut(*row as usize)) {
            stores.push(("jacobian", index, *node));
        }
    }
    let code_jacobian = write(Routine {
        name: "residual_jacobian",
        documentation: "`f(v)` and the entries of its Jacobian that are not constant:",
        inputs: &[("v", nv)],
        outputs: &[("f", nk), ("jacobian", nj)],
        stores: rows.concat(),
    });
    let code_adjoint = write(Routine {
        name: "adjoint",
        documentation: "`∇(μᵀ f)`:",
        inputs: &[("v", nv), ("mu", nk)],
        outputs: &[("gradient", nv)],
        stores: gradient.iter().take(nv - 1).enumerate().map(|(i, &node)| ("gradient", i, node)).collect(),
    });
    let code_hessian = write(Routine {
        name: "hessian",
        documentation: "The lower triangle of `∇²(μᵀ f)`:",
        inputs: &[("v", nv), ("mu", nk)],
        outputs: &[("hessian", nh)],
        stores: hessian.iter().enumerate().map(|(i, entry)| ("hessian", i, entry.2)).collect(),
    });
    [code_residual, code_constants, code_jacobian, code_adjoint, code_hessian].concat()
}

/// `NK`, `NV` and `NW`.
fn dimensions(variables: &Variables) -> [usize; 3] {
    let Variables { x, z, u, p } = variables;
    let [nx, nz, nu, np] = [x, z, u, p].map(Vec::len);
    [nx + nz, 2 * nx + nz + nu + np + 1, nx + nu + np]
}
