//! The rustdoc text of a model.

use crate::structure::{Analysis, Derivatives, FunctionAnalysis, times};
use proc_macro2::TokenStream;
use quote::quote;

/// The user's text, followed by the properties of the model: a table with one row for each
/// instance.
pub fn type_documentation(original: &syn::Ident, models: &[Analysis]) -> TokenStream {
    let Some(first) = models.first() else {
        return TokenStream::new();
    };
    let documentation = &first.model.documentation;
    let separator = (!documentation.is_empty()).then(|| quote!(#[doc = ""]));

    let parameters: Vec<String> = first.model.instance.iter().map(|i| format!("`{}`", i.name)).collect();
    let mut lines = vec![format!(
        "The model of `{original}`: dimensions, structural non-zeros of its Jacobian (constant ones among \
         them) and of the lower triangle of its Hessian, and operations per evaluation."
    )];
    lines.push(String::new());
    let head = ["nx", "nz", "nu", "np", "Jacobian", "constant", "Hessian", "`f`", "`f` and Jacobian"];
    let head = head.into_iter().chain(["`∇(μᵀf)`", "`∇²(μᵀf)`"]).map(String::from);
    let head: Vec<String> = parameters.into_iter().chain(head).collect();
    lines.push(row(&head));
    lines.push(row(&vec![String::from("---"); head.len()]));
    for Analysis { model, derivatives, .. } in models {
        let Derivatives { jacobian, constant, hessian, operations, .. } = derivatives;
        let variables = &model.variables;
        let numbers = [
            variables.x.len(),
            variables.z.len(),
            variables.u.len(),
            variables.p.len(),
            jacobian.len(),
            constant.iter().filter(|&&constant| constant).count(),
            hessian.len(),
            operations.residual as usize,
            operations.residual_jacobian as usize,
            operations.adjoint as usize,
            operations.hessian as usize,
        ];
        let instance = model.instance.iter().map(|instance| instance.value.to_string());
        lines.push(row(&instance.chain(numbers.map(|n| n.to_string())).collect::<Vec<_>>()));
    }
    if let Some(text) = reduction_documentation(first) {
        lines.extend([String::new(), text]);
    }
    let lines = lines.into_iter().map(|line| if line.is_empty() { line } else { format!(" {line}") });
    quote! {
        #(#documentation)*
        #separator
        #(#[doc = #lines])*
    }
}

/// The differentiated equations, and the sample points at which the result is singular.
fn reduction_documentation(analysis: &Analysis) -> Option<String> {
    let reduction = analysis.reduction.as_ref()?;
    let list = reduction.differentiated.iter();
    let list: Vec<String> =
        list.map(|&(equation, count)| format!("equation {equation} {}", times(count as usize))).collect();
    let invariants = reduction.differentiated.iter().map(|entry| entry.1).sum::<u32>();
    let mut text = format!(
        "Index reduction differentiated {}; the {invariants} invariants are [`{}`].",
        list.join(", "),
        reduction.invariants.model.name
    );
    let [singular, points] = reduction.singular;
    if singular > 0 {
        text += &format!(
            " The matrix `∂f/∂(ẋ, z)` has full rank at {} of {points} sample points, which need not satisfy the \
             constraints.",
            points - singular
        );
    }
    Some(text)
}

/// The user's text, followed by the properties of the function.
pub fn function_documentation<'a>(functions: impl Iterator<Item = &'a FunctionAnalysis>) -> TokenStream {
    let functions: Vec<_> = functions.collect();
    let Some(first) = functions.first() else {
        return TokenStream::new();
    };
    let documentation = &first.model.documentation;
    let separator = (!documentation.is_empty()).then(|| quote!(#[doc = ""]));
    let parameters = first.model.instance.iter().map(|i| format!("`{}`", i.name));
    let head = ["outputs", "Jacobian", "constant", "Hessian", "`y`", "`∇(μᵀy)`", "`∇²(μᵀy)`"];
    let head: Vec<String> = parameters.chain(head.map(String::from)).collect();
    let mut lines = vec![
        String::from(
            "A function of the variables of a model: its outputs, structural non-zeros of its Jacobian (constant ones \
             among them) and of the lower triangle of its Hessian, and operations per evaluation.",
        ),
        String::new(),
        row(&head),
        row(&vec![String::from("---"); head.len()]),
    ];
    for FunctionAnalysis { model, derivatives, .. } in functions {
        let Derivatives { jacobian, constant, hessian, operations, .. } = derivatives;
        let numbers = [
            model.residual.len(),
            jacobian.len(),
            constant.iter().filter(|&&constant| constant).count(),
            hessian.len(),
            operations.residual as usize,
            operations.adjoint as usize,
            operations.hessian as usize,
        ];
        let instance = model.instance.iter().map(|instance| instance.value.to_string());
        lines.push(row(&instance.chain(numbers.map(|n| n.to_string())).collect::<Vec<_>>()));
    }
    let lines = lines.into_iter().map(|line| if line.is_empty() { line } else { format!(" {line}") });
    quote! {
        #(#documentation)*
        #separator
        #(#[doc = #lines])*
    }
}

fn row(cells: &[String]) -> String {
    format!("| {} |", cells.join(" | "))
}
