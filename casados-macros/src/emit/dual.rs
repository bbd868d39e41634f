//! Dual models: `Dae` by the arithmetic of dual numbers at run time.

use super::code::panel_columns;
use super::{domain, units};
use crate::language::dual::{Argument, Model};
use crate::language::signature::Role;
use crate::language::{Form, Variables};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// The rustdoc text of the model.
pub fn documentation(model: &Model) -> TokenStream {
    let Model { documentation, function, variables, .. } = model;
    let separator = (!documentation.is_empty()).then(|| quote!(#[doc = ""]));
    let text = format!(
        " The model of `{function}`, over dual numbers: {} differential states, {} algebraic states, {} controls, {} \
         parameters.",
        variables.x.len(),
        variables.z.len(),
        variables.u.len(),
        variables.p.len(),
    );
    // The dimensions of one instance are not those of all.
    let text = if model.instance.is_empty() {
        text
    } else {
        format!(" The model of `{function}`, over dual numbers.")
    };
    quote!(#(#documentation)* #separator #[doc = #text])
}

/// The dimensions of a dense model.
struct DenseSizes {
    nx: usize,
    nz: usize,
    nu: usize,
    np: usize,
    /// The number of equations.
    nk: usize,
    /// The number of variables.
    nv: usize,
    /// The number of directions.
    nw: usize,
    /// The number of entries of the Jacobian.
    nj: usize,
    /// The number of entries of the Hessian.
    nh: usize,
}

impl DenseSizes {
    fn of(Variables { x, z, u, p }: &Variables) -> Self {
        let [nx, nz, nu, np] = [x, z, u, p].map(Vec::len);
        let (nk, nv, nw) = (nx + nz, 2 * nx + nz + nu + np + 1, nx + nu + np);
        Self { nx, nz, nu, np, nk, nv, nw, nj: nk * (nv - 1), nh: (nv - 1) * nv / 2 }
    }

    /// The type of the dimensions.
    fn shape(&self, krate: &syn::Path) -> TokenStream {
        let &Self { nx, nz, nu, np, nk, nv, nw, .. } = self;
        let numbers = [nx, nz, nu, np, nk, nv, nw, panel_columns(nw)].map(Literal::usize_unsuffixed);
        quote!(#krate::__private::Dims<#(#numbers),*>)
    }
}

/// Writes the implementations for one model.
pub fn write(model: &Model) -> TokenStream {
    let Model { form, name, instance, variables, krate, .. } = model;
    let sizes = DenseSizes::of(variables);
    let values = instance.iter().map(|instance| Literal::u64_unsuffixed(instance.value));
    let ty = if instance.is_empty() { quote!(#name) } else { quote!(#name<#(#values),*>) };
    let (dual_model, dae) = (dual_model(model, &sizes, &ty), dae(model, &sizes, &ty));
    let ode = (*form == Form::Ode).then(|| {
        let rows = (0..sizes.nx).map(Literal::usize_unsuffixed);
        quote! {
            #[automatically_derived]
            impl #krate::__private::Ode for #ty {
                const ROWS: &'static [(u32, f64)] = &[#((#rows, 1.0)),*];
            }
        }
    });
    quote! {
        const _: () = { #dual_model #dae #ode };
    }
}

/// The call of the function, with any dual number type.
fn dual_model(model: &Model, sizes: &DenseSizes, ty: &TokenStream) -> TokenStream {
    let Model { form, function, krate, generics, .. } = model;
    let &DenseSizes { nx, nz, nu, nv, .. } = sizes;
    let starts = [0, nx, 2 * nx, 2 * nx + nz, 2 * nx + nz + nu, nv - 1];
    let arguments = model.arguments.iter().map(|argument| self::argument(argument, starts));
    let call = quote!(#function::<#(#generics),*>(#(#arguments),*));
    let returned = if model.scalar { quote!([#call]) } else { quote!(::core::convert::Into::into(#call)) };
    let value = match form {
        Form::Dae | Form::Function => quote!(casados_value),
        Form::Ode => quote!(casados_variable(casados_row) - casados_value),
    };
    let equations = Literal::usize_unsuffixed(model.equations);
    quote! {
            #[automatically_derived]
            impl #krate::__private::dual::DualModel for #ty {
                fn evaluate<CasadosT>(
                    casados_variable: impl Fn(usize) -> CasadosT,
                    mut casados_equation: impl FnMut(usize, CasadosT),
                )
                where
                    CasadosT: #krate::__private::dual::DualNum<Primitive = f64> + #krate::__private::dual::DualNumCopy,
                {
                    let casados_residual: [CasadosT; #equations] = #returned;
                    for (casados_row, casados_value) in casados_residual.into_iter().enumerate() {
                        casados_equation(casados_row, #value);
                    }
                }

                fn passes() -> &'static ::std::sync::OnceLock<#krate::__private::dual::Passes> {
                    static PASSES: ::std::sync::OnceLock<#krate::__private::dual::Passes> = ::std::sync::OnceLock::new();
                    &PASSES
                }
            }
    }
}

fn dae(model: &Model, sizes: &DenseSizes, ty: &TokenStream) -> TokenStream {
    let Model { variables, krate, .. } = model;
    let &DenseSizes { nk, nv, nj, nh, .. } = sizes;
    let [lk, lv, lj, lh] = [nk, nv, nj, nh].map(Literal::usize_unsuffixed);
    let shape = sizes.shape(krate);
    let domain = domain::write(krate, variables, &model.samplings, |_| true);
    let units = units::write(krate, &model.units);
    let structure = structure(model, sizes);
    quote! {
        #[automatically_derived]
        impl #krate::__private::Dae for #ty {
            type Shape = #shape;
            type Jacobian<T: #krate::__private::Plain> = [T; #lj];
            type Hessian<T: #krate::__private::Plain> = [T; #lh];
            type Factors<B: #krate::__private::Plain> = [B; 0];
            #domain
            #units
            const STRUCTURE: #krate::__private::Structure = {
                    const JACOBIAN: ([u32; #lj], [u32; #lj]) = #krate::__private::dual::jacobian_pattern::<
                        #shape,
                        #lj,
                    >();
                    const HESSIAN: ([u32; #lh], [u32; #lh]) = #krate::__private::dual::hessian_pattern();
                    #structure
            };

                fn residual<CasadosS: #krate::__private::Lanes>(variables: &[CasadosS::Cell; #lv], residual: &mut [CasadosS::Cell; #lk]) {
                    #krate::__private::dual::residual::<Self, CasadosS>(variables, residual);
                }

                fn jacobian_constants<CasadosS: #krate::__private::Lanes>(_: &mut [CasadosS::Cell; #lj]) {}

                fn residual_jacobian<CasadosS: #krate::__private::Lanes>(
                    variables: &[CasadosS::Cell; #lv],
                    residual: &mut [CasadosS::Cell; #lk],
                    jacobian: &mut [CasadosS::Cell; #lj],
                ) {
                    #krate::__private::dual::residual_jacobian::<Self, CasadosS>(variables, residual, jacobian);
                }

                fn tangent<CasadosS: #krate::__private::Lanes>(
                    variables: &[#krate::__private::Tangent<CasadosS>; #lv],
                    residual: &mut [#krate::__private::Tangent<CasadosS>; #lk],
                ) {
                    #krate::__private::dual::tangent::<Self, CasadosS>(variables, residual);
                }

                fn adjoint<CasadosS: #krate::__private::Lanes>(
                    variables: &[CasadosS::Cell; #lv],
                    seeds: &[CasadosS::Cell; #lk],
                    gradient: &mut [CasadosS::Cell; #lv],
                ) {
                    #krate::__private::dual::adjoint::<Self, CasadosS>(variables, seeds, gradient);
                }

                fn hessian<CasadosS: #krate::__private::Lanes>(
                    variables: &[CasadosS::Cell; #lv],
                    seeds: &[CasadosS::Cell; #lk],
                    hessian: &mut [CasadosS::Cell; #lh],
                ) {
                    #krate::__private::dual::hessian::<Self, CasadosS>(variables, seeds, hessian);
                }
        }
    }
}

/// The structure of a model without known properties: dense.
fn structure(model: &Model, sizes: &DenseSizes) -> TokenStream {
    let Model { name, variables, krate, .. } = model;
    let &DenseSizes { nx, nz, nu, np, nk, nv, nw, nj, .. } = sizes;
    let mut begin = 0;
    let blocks = [nx, nx, nz, nu, np, 0].map(|width| {
        let block = Literal::usize_unsuffixed(begin);
        begin += nk * width;
        block
    });
    let [lk, lw, lj, lcurved, lterms] =
        [nk, nw, nj, nv - 1, (nv - 1) * (nv - 1)].map(Literal::usize_unsuffixed);
    let [first, linputs] = [nk * nx, nk * (nx + nz + nu + np)].map(Literal::usize_unsuffixed);
    let text = name.to_string();
    let Variables { x, z, u, p } = variables;
    quote! {
                    #krate::__private::Structure {
                        name: #text,
                        x: &[#(#x),*],
                        z: &[#(#z),*],
                        u: &[#(#u),*],
                        p: &[#(#p),*],
                        jacobian: #krate::__private::Pattern { rows: &JACOBIAN.0, columns: &JACOBIAN.1 },
                        blocks: [#(#blocks),*],
                        by_column: &const {
                            #krate::__private::by_column::<#lcurved, #linputs>(
                                &#krate::__private::Pattern { rows: &JACOBIAN.0, columns: &JACOBIAN.1 },
                                #first,
                            )
                        },
                        constant: &[false; #lj],
                        hessian: #krate::__private::Pattern { rows: &HESSIAN.0, columns: &HESSIAN.1 },
                        linear: &[false; #lk],
                        linear_in_state: false,
                        constant_matrix: false,
                        autonomous: false,
                        constant_rows: &[false; #lk],
                        trivial: &[],
                        quadratures: &[],
                        directions: &const { #krate::__private::all::<#lw>() },
                        column_of_direction: &const { #krate::__private::all::<#lw>() },
                        curved: &const { #krate::__private::all::<#lcurved>() },
                        symmetric: &const {
                            #krate::__private::symmetric::<#lcurved, #lterms>(
                                &#krate::__private::Pattern { rows: &HESSIAN.0, columns: &HESSIAN.1 },
                                &#krate::__private::all(),
                            )
                        },
                        diagonal_controls: &[],
                        operations: #krate::__private::Operations {
                            residual: 0,
                            residual_jacobian: 0,
                            adjoint: 0,
                            hessian: 0,
                        },
                        elimination: #krate::__private::Elimination::NONE,
                        reduction: ::core::option::Option::None,
                    }
    }
}

/// An argument of the call: an array of its variables, or a value built from it.
fn argument(argument: &Argument, starts: [usize; 6]) -> TokenStream {
    let start = match argument.role {
        Role::Xdot => starts[0],
        Role::X => starts[1],
        Role::Z => starts[2],
        Role::U => starts[3],
        Role::P => starts[4],
        Role::T | Role::Du | Role::Q => starts[5],
    };
    let start = Literal::usize_unsuffixed(start);
    let value = match argument.length {
        None => quote!(casados_variable(#start)),
        Some(length) => {
            let length = Literal::usize_unsuffixed(length);
            quote! {
                ::core::convert::Into::into(::core::array::from_fn::<CasadosT, #length, _>(|casados_index| {
                    casados_variable(#start + casados_index)
                }))
            }
        }
    };
    if argument.reference { quote!(&#value) } else { value }
}
