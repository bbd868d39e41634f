//! The implementations of `Function` and `GraphFunction` for one function.

use super::code::{self, FUNCTION, dimensions, model_type};
use super::routine::Routine;
use super::{structure, units};
use crate::language::{Model, Variables};
use crate::structure::{Derivatives, FunctionAnalysis};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// Writes the implementations for one function.
pub fn write(analysis: &FunctionAnalysis) -> syn::Result<TokenStream> {
    let FunctionAnalysis { model, derivatives, time, .. } = analysis;
    let (rate, [_, nv, ..]) = ("rate", dimensions(&model.variables));
    let routine = Routine {
        name: "time_derivative",
        documentation: "`∂y/∂t`, of the outputs that depend on it:",
        inputs: &[("v", nv)],
        outputs: &[(rate, model.residual.len())],
        stores: time.iter().map(|&(row, node)| (rate, row as usize, node)).collect(),
    };
    let code = code::module(model, derivatives, &FUNCTION, Some(routine))?;
    let c = code::outer_arguments(model);
    let (function, graph_function) = (self::function(analysis, &c), graph_function(model, &c));
    Ok(code::enclose(model, &quote!(#code #function #graph_function)))
}

fn function(analysis: &FunctionAnalysis, c: &Option<TokenStream>) -> TokenStream {
    let FunctionAnalysis { model, derivatives, .. } = analysis;
    let Derivatives { jacobian, hessian, .. } = derivatives;
    let Model { variables, krate, residual, .. } = model;
    let Variables { x, z, u, p } = variables;
    let [nx, nz, nu, np] = [x, z, u, p].map(Vec::len);
    let [nk, nv, nw, nc] = dimensions(variables);
    let numbers = [nx, nz, nu, np, nk, nv, nw, nc, residual.len(), jacobian.len(), hessian.len(), nv - 1];
    let [lx, lz, lu, lp, lk, lv, lw, lc, ly, lj, lh, last] = numbers.map(Literal::usize_unsuffixed);
    let (ty, structure) = (model_type(model), structure::function_structure(analysis));
    let (units, unit) = (units::write(krate, &model.units), units::output_unit(&model.units));
    let depends_on_time = model.extra.degrees.is_empty() || model.extra.is_timed;
    let is_timed = !analysis.time.is_empty() && model.duration.is_none() && depends_on_time;
    let timed = is_timed.then(|| {
        quote!(
            const IS_TIMED: bool = true;
        )
    });
    quote! {
        #[automatically_derived]
        impl #krate::__private::Function for #ty {
            type Shape = #krate::__private::Dims<#lx, #lz, #lu, #lp, #lk, #lv, #lw, #lc>;
            type Outputs = #krate::__private::Count<#ly>;
            type Jacobian<T: #krate::__private::Plain> = [T; #lj];
            type Hessian<T: #krate::__private::Plain> = [T; #lh];
            const STRUCTURE: #krate::__private::FunctionStructure = #structure;
            #units
            #unit
            #timed

            #[inline]
            fn value<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_y: &mut [S::Cell; #ly]) {
                code::value::<S>(#c casados_v, casados_y);
            }

            #[inline]
            fn jacobian_constants<S: #krate::__private::Lanes>(casados_jacobian: &mut [S::Cell; #lj]) {
                code::jacobian_constants::<S>(#c casados_jacobian);
            }

            #[inline]
            fn value_jacobian<S: #krate::__private::Lanes>(
                casados_v: &[S::Cell; #lv],
                casados_y: &mut [S::Cell; #ly],
                casados_jacobian: &mut [S::Cell; #lj],
            ) {
                code::value_jacobian::<S>(#c casados_v, casados_y, casados_jacobian);
            }

            #[inline]
            fn adjoint<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_mu: &[S::Cell; #ly], casados_gradient: &mut [S::Cell; #lv]) {
                code::adjoint::<S>(#c casados_v, casados_mu, casados_gradient);
                S::from_f64(0.0).store(&mut casados_gradient[#last]);
            }

            #[inline]
            fn time_derivative<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_rate: &mut [S::Cell; #ly]) {
                for casados_rate in casados_rate.iter_mut() {
                    S::from_f64(0.0).store(casados_rate);
                }
                code::time_derivative::<S>(#c casados_v, casados_rate);
            }

            #[inline]
            fn hessian<S: #krate::__private::Lanes>(casados_v: &[S::Cell; #lv], casados_mu: &[S::Cell; #ly], casados_hessian: &mut [S::Cell; #lh]) {
                code::hessian::<S>(#c casados_v, casados_mu, casados_hessian);
            }
        }
    }
}

/// The functions over any scalar, with slices as arguments.
fn graph_function(model: &Model, c: &Option<TokenStream>) -> TokenStream {
    let (krate, ty, [_, nv, ..]) = (&model.krate, model_type(model), dimensions(&model.variables));
    let last = Literal::usize_unsuffixed(nv - 1);
    quote! {
        #[automatically_derived]
        impl #krate::__private::GraphFunction for #ty {
            fn value_of<S: #krate::__private::Scalar<Cell = S>>(casados_v: &[S], casados_y: &mut [S]) {
                if let (::core::option::Option::Some(casados_v), ::core::option::Option::Some(casados_y)) = (casados_v.first_chunk(), casados_y.first_chunk_mut()) {
                    code::value::<S>(#c casados_v, casados_y);
                }
            }

            fn adjoint_of<S: #krate::__private::Scalar<Cell = S>>(casados_v: &[S], casados_mu: &[S], casados_gradient: &mut [S]) {
                if let (::core::option::Option::Some(casados_v), ::core::option::Option::Some(casados_mu), ::core::option::Option::Some(casados_gradient)) =
                    (casados_v.first_chunk(), casados_mu.first_chunk(), casados_gradient.first_chunk_mut())
                {
                    code::adjoint::<S>(#c casados_v, casados_mu, casados_gradient);
                    S::from_f64(0.0).store(&mut casados_gradient[#last]);
                }
            }
        }
    }
}
