//! The domain of a model: initial guesses of Newton's method, and ranges.

use crate::language::{Sampling, Variables};
use proc_macro2::TokenStream;
use quote::quote;

/// The constants `Dae::START` and `Dae::RANGES`, as far as the attribute sets them. `is_nonlinear`
/// tells whether equations may be nonlinear in an unknown `(ẋ, z)`.
pub fn write(
    krate: &syn::Path,
    variables: &Variables,
    samplings: &[Sampling],
    is_nonlinear: impl Fn(usize) -> bool,
) -> TokenStream {
    let (nx, nz) = (variables.x.len(), variables.z.len());
    let sampling = |variable: usize| samplings.get(variable).copied().unwrap_or_default();
    // The value of a derivative matters only if it selects a root; otherwise it is zero, so that
    // states are `x₀` at all stages.
    let starts: Vec<f64> = (0..nx + nz)
        .map(|unknown| match unknown {
            derivative if derivative < nx && !is_nonlinear(derivative) => 0.0,
            derivative if derivative < nx => start(sampling(derivative)),
            algebraic => start(sampling(nx + algebraic)),
        })
        .collect();
    let starts = starts
        .iter()
        .any(|start| *start != 0.0)
        .then(|| quote!(const START: &'static [f64] = &[#(#starts),*];));
    let ranges = samplings.iter().any(|sampling| sampling.range.is_some()).then(|| {
        let ranges = samplings.iter().map(|sampling| match sampling.range {
            Some((low, high)) => quote!(#krate::__private::Range { low: #low, high: #high }),
            None => quote!(#krate::__private::Range::ANY),
        });
        quote!(const RANGES: &'static [#krate::__private::Range] = &[#(#ranges),*];)
    });
    quote!(#starts #ranges)
}

/// The nominal value; without one zero or, if a range excludes zero, its geometric mean.
fn start(Sampling { nominal, range }: Sampling) -> f64 {
    match (nominal, range) {
        (Some(nominal), _) => nominal,
        (None, Some((low, high))) if low > 0.0 => low.sqrt() * high.sqrt(),
        (None, Some((low, high))) if high < 0.0 => -((-low).sqrt() * (-high).sqrt()),
        _ => 0.0,
    }
}
