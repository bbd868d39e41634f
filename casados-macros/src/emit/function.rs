//! The implementations of `Function` and `GraphFunction` for one function.

use super::code::{self, FUNCTION, dimensions, ty};
use super::structure;
use crate::language::{Model, Variables};
use crate::structure::{Derivatives, FunctionAnalysis};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// Writes the implementations for one function.
pub fn write(analysis: &FunctionAnalysis) -> syn::Result<TokenStream> {
    let FunctionAnalysis { model, derivatives, time } = analysis;
    let Derivatives { jacobian, hessian, .. } = derivatives;
    let Model { variables, opaque, krate, residual, .. } = model;
    let Variables { x, z, u, p } = variables;
    let [nx, nz, nu, np] = [x, z, u, p].map(Vec::len);
    let [nk, nv, nw] = dimensions(variables);
    let (code, ty) = (code::module(model, derivatives, &FUNCTION, Some(time))?, ty(model));
    let numbers = [nx, nz, nu, np, nk, nv, nw, residual.len(), jacobian.len(), hessian.len(), nv - 1];
    let [lx, lz, lu, lp, lk, lv, lw, ly, lj, lh, last] = numbers.map(Literal::usize_unsuffixed);
    let structure = structure::of_function(analysis);
    // Constants from outside are an argument: the module of the code sees no name of the user's.
    let c = (!opaque.is_empty()).then(|| quote!(&C,));
    let implementations = quote! {
        #code

        #[automatically_derived]
        impl #krate::Function for #ty {
            type Shape = #krate::Dims<#lx, #lz, #lu, #lp, #lk, #lv, #lw>;
            type Outputs = #krate::shape::Count<#ly>;
            type Jacobian<T: #krate::shape::Plain> = [T; #lj];
            type Hessian<T: #krate::shape::Plain> = [T; #lh];
            const STRUCTURE: #krate::function::FunctionStructure = #structure;

            #[inline]
            fn value<S: #krate::Lanes>(v: &[S::Cell; #lv], y: &mut [S::Cell; #ly]) {
                code::value::<S>(#c v, y);
            }

            #[inline]
            fn jacobian_constants<S: #krate::Lanes>(jacobian: &mut [S::Cell; #lj]) {
                code::jacobian_constants::<S>(#c jacobian);
            }

            #[inline]
            fn value_jacobian<S: #krate::Lanes>(
                v: &[S::Cell; #lv],
                y: &mut [S::Cell; #ly],
                jacobian: &mut [S::Cell; #lj],
            ) {
                code::value_jacobian::<S>(#c v, y, jacobian);
            }

            #[inline]
            fn adjoint<S: #krate::Lanes>(v: &[S::Cell; #lv], mu: &[S::Cell; #ly], gradient: &mut [S::Cell; #lv]) {
                code::adjoint::<S>(#c v, mu, gradient);
                S::from_f64(0.0).store(&mut gradient[#last]);
            }

            #[inline]
            fn time_derivative<S: #krate::Lanes>(v: &[S::Cell; #lv], rate: &mut [S::Cell; #ly]) {
                for rate in rate.iter_mut() {
                    S::from_f64(0.0).store(rate);
                }
                code::time_derivative::<S>(#c v, rate);
            }

            #[inline]
            fn hessian<S: #krate::Lanes>(v: &[S::Cell; #lv], mu: &[S::Cell; #ly], hessian: &mut [S::Cell; #lh]) {
                code::hessian::<S>(#c v, mu, hessian);
            }
        }

        #[automatically_derived]
        impl #krate::GraphFunction for #ty {
            fn value_of<S: #krate::Scalar<Cell = S>>(v: &[S], y: &mut [S]) {
                if let (Some(v), Some(y)) = (v.first_chunk(), y.first_chunk_mut()) {
                    code::value::<S>(#c v, y);
                }
            }

            fn adjoint_of<S: #krate::Scalar<Cell = S>>(v: &[S], mu: &[S], gradient: &mut [S]) {
                if let (Some(v), Some(mu), Some(gradient)) =
                    (v.first_chunk(), mu.first_chunk(), gradient.first_chunk_mut())
                {
                    code::adjoint::<S>(#c v, mu, gradient);
                    S::from_f64(0.0).store(&mut gradient[#last]);
                }
            }
        }
    };
    Ok(code::enclose(model, &implementations))
}
