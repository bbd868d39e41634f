//! A bound on the nesting of tokens, before any parser recurses into them.

use proc_macro2::{TokenStream, TokenTree};

/// Deeper than any model. Compilers and editors run macros in threads of 8 MiB, and an unoptimised parser
/// needs up to 23 kB for a level.
const DEPTH: usize = 256;

/// Refuses tokens that are nested too deeply to be parsed. Does not recurse itself.
pub fn check(tokens: &TokenStream) -> syn::Result<()> {
    let mut open = vec![tokens.clone().into_iter()];
    while let Some(innermost) = open.last_mut() {
        match innermost.next() {
            Some(TokenTree::Group(group)) if open.len() == DEPTH => {
                let message = format!(
                    "this is nested too deeply: more than {DEPTH} brackets around it; use functions or loops"
                );
                return Err(syn::Error::new(group.span_open(), message));
            }
            Some(TokenTree::Group(group)) => open.push(group.stream().into_iter()),
            Some(_) => {}
            None => {
                open.pop();
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proc_macro2::{Delimiter, Group};

    fn nested(levels: usize) -> TokenStream {
        (0..levels).fold(TokenStream::new(), |inner, _| {
            TokenTree::Group(Group::new(Delimiter::Parenthesis, inner)).into()
        })
    }

    #[test]
    fn nesting_is_bounded() {
        assert!(check(&nested(DEPTH - 1)).is_ok());
        let error = check(&nested(DEPTH)).map_err(|error| error.to_string());
        assert!(error.is_err_and(|message| message.contains("more than 256 brackets")));
    }
}
