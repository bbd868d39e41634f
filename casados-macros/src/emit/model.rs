//! The implementations of `Dae`, `GraphDae` and `Ode` for one model.

use super::code::{self, MODEL, dimensions, model_type};
use super::routine::Routine;
use super::{domain, structure, units};
use crate::language::{Model, Variables};
use crate::structure::{Analysis, Derivatives, FunctionAnalysis};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// Writes the implementations for one model.
pub fn write(analysis: &Analysis) -> syn::Result<TokenStream> {
    let Analysis { model, derivatives, branches, .. } = analysis;
    let (which, [_, nv, ..]) = ("branches", dimensions(&model.variables));
    let (inputs, outputs) = ([("v", nv)], [(which, 2)]);
    let routine = branches.as_ref().map(|branches| Routine {
        name: which,
        documentation: "Which branches `f` takes:",
        inputs: &inputs,
        outputs: &outputs,
        stores: vec![(which, 0, branches.kinks), (which, 1, branches.knots)],
    });
    let code = code::module(model, derivatives, &MODEL, routine)?;
    let c = code::outer_arguments(model);
    let (dae, graph_dae, ode) = (dae(analysis, &c), graph_dae(model, &c), ode(analysis));
    Ok(code::enclose(model, &quote!(#code #dae #graph_dae #ode)))
}

fn dae(analysis: &Analysis, c: &Option<TokenStream>) -> TokenStream {
    let Analysis { model, derivatives, .. } = analysis;
    let Derivatives { jacobian, hessian, .. } = derivatives;
    let Model { variables, krate, .. } = model;
    let Variables { x, z, u, p } = variables;
    let [nx, nz, nu, np] = [x, z, u, p].map(Vec::len);
    let [nk, nv, nw, nc] = dimensions(variables);
    let (nj, nh, nb) = (jacobian.len(), hessian.len(), analysis.elimination.plan.blocks.len());
    let [lx, lz, lu, lp, lk, lv, lw, lc, lj, lh, lb, time] =
        [nx, nz, nu, np, nk, nv, nw, nc, nj, nh, nb, nv - 1].map(Literal::usize_unsuffixed);
    let (ty, structure) = (model_type(model), structure::write(analysis));
    let branches = analysis.branches.as_ref().map(|branches| {
        let count = Literal::usize_unsuffixed(branches.count);
        quote! {
            const BRANCHES: usize = #count;
            #[inline]
            fn branches<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_branches: &mut [S::Cell; 2]) {
                code::branches::<S>(#c casados_v, casados_branches);
            }
        }
    });
    let duration = model.duration.map(|index| {
        let index = Literal::u32_unsuffixed(index);
        quote!(const DURATION: ::core::option::Option<usize> = ::core::option::Option::Some(#index);)
    });
    let (linear, integrals) = (&model.extra.linear, model.extra.integrals);
    let linear = (!linear.is_empty()).then(|| {
        let controls = structure::index_literals(linear);
        quote!(const LINEAR: &'static [u32] = &[#(#controls),*];)
    });
    let degrees = (!model.extra.degrees.is_empty()).then(|| {
        let degrees = structure::index_literals(&model.extra.degrees);
        quote!(const DEGREES: &'static [u32] = &[#(#degrees),*];)
    });
    let integrals = (integrals > 0).then(|| {
        let count = Literal::usize_unsuffixed(integrals);
        quote!(const INTEGRALS: usize = #count;)
    });
    let domain = domain::write(krate, variables, &model.samplings, |unknown| analysis.nonlinear[unknown]);
    let units = units::write(krate, &model.units);
    quote! {
        #[automatically_derived]
        impl #krate::__private::Dae for #ty {
            type Shape = #krate::__private::Dims<#lx, #lz, #lu, #lp, #lk, #lv, #lw, #lc>;
            type Jacobian<T: #krate::__private::Plain> = [T; #lj];
            type Hessian<T: #krate::__private::Plain> = [T; #lh];
            type Factors<B: #krate::__private::Plain> = [B; #lb];
            const STRUCTURE: #krate::__private::Structure = #structure;
            #duration
            #linear
            #degrees
            #integrals
            #domain
            #units
            #branches

            #[inline]
            fn residual<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_f: &mut [S::Cell; #lk]) {
                code::residual::<S>(#c casados_v, casados_f);
            }

            #[inline]
            fn jacobian_constants<S: #krate::__private::Lanes>(casados_jacobian: &mut [S::Cell; #lj]) {
                code::jacobian_constants::<S>(#c casados_jacobian);
            }

            #[inline]
            fn residual_jacobian<S: #krate::__private::Lanes>(
                casados_v: &[S::Cell; #lv],
                casados_f: &mut [S::Cell; #lk],
                casados_jacobian: &mut [S::Cell; #lj],
            ) {
                code::residual_jacobian::<S>(#c casados_v, casados_f, casados_jacobian);
            }

            #[inline]
            fn tangent<S: #krate::__private::Lanes>(casados_v: &[#krate::__private::Tangent<S>; #lv], casados_f: &mut [#krate::__private::Tangent<S>; #lk]) {
                code::residual::<#krate::__private::Tangent<S>>(#c casados_v, casados_f);
            }

            #[inline]
            fn adjoint<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_mu: &[S::Cell; #lk], casados_gradient: &mut [S::Cell; #lv]) {
                code::adjoint::<S>(#c casados_v, casados_mu, casados_gradient);
                S::from_f64(0.0).store(&mut casados_gradient[#time]);
            }

            #[inline]
            fn hessian<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_mu: &[S::Cell; #lk], casados_hessian: &mut [S::Cell; #lh]) {
                code::hessian::<S>(#c casados_v, casados_mu, casados_hessian);
            }
        }
    }
}

/// The functions over any scalar, with slices as arguments.
fn graph_dae(model: &Model, c: &Option<TokenStream>) -> TokenStream {
    let (krate, ty, [_, nv, ..]) = (&model.krate, model_type(model), dimensions(&model.variables));
    let time = Literal::usize_unsuffixed(nv - 1);
    quote! {
        #[automatically_derived]
        impl #krate::__private::GraphDae for #ty {
            fn residual_of<S: #krate::__private::Scalar<Cell = S>>(casados_v: &[S], casados_f: &mut [S]) {
                if let (::core::option::Option::Some(casados_v), ::core::option::Option::Some(casados_f)) = (casados_v.first_chunk(), casados_f.first_chunk_mut()) {
                    code::residual::<S>(#c casados_v, casados_f);
                }
            }

            fn adjoint_of<S: #krate::__private::Scalar<Cell = S>>(casados_v: &[S], casados_mu: &[S], casados_gradient: &mut [S]) {
                if let (::core::option::Option::Some(casados_v), ::core::option::Option::Some(casados_mu), ::core::option::Option::Some(casados_gradient)) =
                    (casados_v.first_chunk(), casados_mu.first_chunk(), casados_gradient.first_chunk_mut())
                {
                    code::adjoint::<S>(#c casados_v, casados_mu, casados_gradient);
                    S::from_f64(0.0).store(&mut casados_gradient[#time]);
                }
            }
        }
    }
}

/// The implementation of `Ode` of an explicit model, with its rows.
fn ode(analysis: &Analysis) -> Option<TokenStream> {
    let Analysis { model, explicit, .. } = analysis;
    let (krate, ty) = (&model.krate, model_type(model));
    let finite = |rows: &&Vec<(u32, f64)>| rows.iter().all(|row| row.1.is_finite());
    explicit.as_ref().filter(finite).map(|rows| {
        let rows = rows.iter().map(|&(row, coefficient)| {
            let row = Literal::u32_unsuffixed(row);
            quote!((#row, #coefficient))
        });
        quote! {
            #[automatically_derived]
            impl #krate::__private::Ode for #ty {
                const ROWS: &'static [(u32, f64)] = &[#(#rows),*];
            }
        }
    })
}

/// The function of the invariants of an index-reduced model.
pub fn invariants(analysis: &Analysis) -> Option<&FunctionAnalysis> {
    analysis.reduction.as_ref().map(|reduction| &reduction.invariants)
}

/// The equations of the projection onto the invariants.
pub fn projection(analysis: &Analysis) -> Option<&FunctionAnalysis> {
    analysis.reduction.as_ref().and_then(|reduction| reduction.projection.as_ref())
}

/// Associates a model with the functions of its invariants.
pub fn constrained(analysis: &Analysis) -> Option<TokenStream> {
    let (model, invariants) = (model_type(&analysis.model), model_type(&invariants(analysis)?.model));
    let krate = &analysis.model.krate;
    let projectable = projection(analysis).map(|projection| {
        let projection = model_type(&projection.model);
        quote! {
            #[automatically_derived]
            impl #krate::__private::Projectable for #model {
                type Projection = #projection;
            }
        }
    });
    Some(quote! {
        #[automatically_derived]
        impl #krate::__private::Constrained for #model {
            type Invariants = #invariants;
        }
        #projectable
    })
}
