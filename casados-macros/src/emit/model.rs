//! The implementations of `Dae`, `GraphDae` and `Ode` for one model.

use super::routine::{Code, Routine};
use crate::graph::{Graph, Node, Op};
use crate::language::{Model, Variables};
use crate::structure::Analysis;
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// A model as Rust, and what is said about it in its documentation.
pub struct Written {
    /// The implementations.
    pub tokens: TokenStream,
    /// Numbers of operations.
    pub operations: Operations,
    /// How many entries of the Jacobian are constant.
    pub constant: usize,
}

/// Numbers of operations of one evaluation.
pub struct Operations {
    pub residual: u32,
    pub residual_jacobian: u32,
    pub adjoint: u32,
    pub hessian: u32,
}

/// Writes the implementations for one model.
pub fn write(analysis: &Analysis) -> syn::Result<Written> {
    let Analysis { model, jacobian, blocks, gradient, hessian, linear, explicit } = analysis;
    let Model { name, variables, graph, residual, opaque, uses, krate, instance, .. } = model;
    let Variables { x, z, u, p } = variables;
    let [nx, nz, nu, np] = [x.len(), z.len(), u.len(), p.len()];
    let (nk, nv, nw) = (nx + nz, 2 * nx + nz + nu + np + 1, nx + nu + np);
    let (nj, nh) = (jacobian.len(), hessian.len());

    let constant = constant(graph, jacobian.iter().map(|entry| entry.2));
    let entries = || jacobian.iter().zip(&constant).enumerate();
    let stores_residual = || residual.iter().enumerate().map(|(row, &node)| ("f", row, node));
    let write = |routine: Routine| routine.write(graph, variables, opaque.len());

    let code_residual = write(Routine {
        name: "residual",
        documentation: "`f(v)`:",
        inputs: &[("v", nv)],
        outputs: &[("f", nk)],
        stores: stores_residual().collect(),
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
    let mut rows: Vec<Vec<(&str, usize, Node)>> = stores_residual().map(|store| vec![store]).collect();
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
    let operations = Operations {
        residual: code_residual.operations,
        residual_jacobian: code_jacobian.operations,
        adjoint: code_adjoint.operations,
        hessian: code_hessian.operations,
    };
    let code = [code_residual, code_constants, code_jacobian, code_adjoint, code_hessian];
    let code = code.iter().map(tokens).collect::<syn::Result<TokenStream>>()?;

    let values = instance.iter().map(|instance| Literal::u64_unsuffixed(instance.value));
    let ty = if instance.is_empty() { quote!(#name) } else { quote!(#name<#(#values),*>) };
    let [lx, lz, lu, lp, lk, lv, lw, lj, lh, time] =
        [nx, nz, nu, np, nk, nv, nw, nj, nh, nv - 1].map(Literal::usize_unsuffixed);
    let structure = structure(
        krate,
        &name.to_string(),
        variables,
        jacobian,
        blocks,
        &constant,
        hessian,
        linear,
        &operations,
    );
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
        #[allow(clippy::all, clippy::pedantic, unused_variables)]
        mod code {
            use #krate::Scalar;
            #code
        }

        #[automatically_derived]
        impl #krate::Dae for #ty {
            type Shape = #krate::Dims<#lx, #lz, #lu, #lp, #lk, #lv, #lw>;
            type Jacobian<T: #krate::shape::Plain> = [T; #lj];
            type Hessian<T: #krate::shape::Plain> = [T; #lh];
            const STRUCTURE: #krate::model::Structure = #structure;

            #[inline]
            fn residual<S: #krate::Lanes>(v: &[S; #lv], f: &mut [S; #lk]) {
                code::residual(#c v, f);
            }

            #[inline]
            fn jacobian_constants<S: #krate::Lanes>(jacobian: &mut [S; #lj]) {
                code::jacobian_constants(#c jacobian);
            }

            #[inline]
            fn residual_jacobian<S: #krate::Lanes>(
                v: &[S; #lv],
                f: &mut [S; #lk],
                jacobian: &mut [S; #lj],
            ) {
                code::residual_jacobian(#c v, f, jacobian);
            }

            #[inline]
            fn adjoint<S: #krate::Lanes>(v: &[S; #lv], mu: &[S; #lk], gradient: &mut [S; #lv]) {
                code::adjoint(#c v, mu, gradient);
                gradient[#time] = S::from_f64(0.0);
            }

            #[inline]
            fn hessian<S: #krate::Lanes>(v: &[S; #lv], mu: &[S; #lk], hessian: &mut [S; #lh]) {
                code::hessian(#c v, mu, hessian);
            }
        }

        #[automatically_derived]
        impl #krate::GraphDae for #ty {
            fn residual_of<S: #krate::Scalar>(v: &[S], f: &mut [S]) {
                if let (Some(v), Some(f)) = (v.first_chunk(), f.first_chunk_mut()) {
                    code::residual(#c v, f);
                }
            }

            fn adjoint_of<S: #krate::Scalar>(v: &[S], mu: &[S], gradient: &mut [S]) {
                if let (Some(v), Some(mu), Some(gradient)) =
                    (v.first_chunk(), mu.first_chunk(), gradient.first_chunk_mut())
                {
                    code::adjoint(#c v, mu, gradient);
                    gradient[#time] = S::from_f64(0.0);
                }
            }
        }

        #ode
    };
    let tokens = if opaque.is_empty() {
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
    };
    Ok(Written { tokens, operations, constant: constant.iter().filter(|&&constant| constant).count() })
}

/// Which of the nodes depend on no variable of the model.
fn constant(graph: &Graph, nodes: impl Iterator<Item = Node>) -> Vec<bool> {
    let mut varies = vec![false; graph.len()];
    for index in 0..graph.len() {
        let op = graph.op(Node(index as u32));
        varies[index] = matches!(op, Op::Variable(_) | Op::Seed(_))
            || super::schedule::operands(op).any(|operand| varies[operand.0 as usize]);
    }
    nodes.map(|node| !varies[node.0 as usize]).collect()
}

fn tokens(code: &Code) -> syn::Result<TokenStream> {
    code.text.parse().map_err(syn::Error::from)
}

#[allow(clippy::too_many_arguments)]
fn structure(
    krate: &syn::Path,
    name: &str,
    variables: &Variables,
    jacobian: &[(u32, u32, Node)],
    blocks: &[usize; 6],
    constant: &[bool],
    hessian: &[(u32, u32, Node)],
    linear: &[bool],
    operations: &Operations,
) -> TokenStream {
    let Variables { x, z, u, p } = variables;
    let (jacobian, hessian) = (pattern(krate, jacobian), pattern(krate, hessian));
    let blocks = blocks.map(Literal::usize_unsuffixed);
    let Operations { residual, residual_jacobian, adjoint, hessian: second } = operations;
    let [residual, residual_jacobian, adjoint, second] =
        [residual, residual_jacobian, adjoint, second].map(|&n| Literal::u32_unsuffixed(n));
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
