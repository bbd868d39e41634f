//! Checks and changes of items as tokens, without a parser.
//!
//! The user's own tokens are emitted. The compiler ignores groups without delimiters, which
//! `macro_rules!` puts around its arguments, once a macro has processed them: `x * $e` would become
//! `x * 1.0 + 2.0`. Groups that contain an operation therefore get parentheses.

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};

/// Maximum nesting of brackets.
const MAX_NESTING: usize = 256;

/// Maximum number of tokens of one statement or element; each may be a level of the syntax tree
/// (prefix signs, `else if`, method calls).
const MAX_STATEMENT_TOKENS: usize = 20_000;

/// Maximum number of terms of a sum without parentheses: half of what the compiler supports.
const MAX_SUM_TERMS: usize = 4096;

/// Rejects tokens that must not be parsed: too deep nesting, too long statements, and conditional
/// compilation. Not recursive.
pub fn check(tokens: &TokenStream) -> syn::Result<()> {
    let mut open = vec![Level::new(tokens)];
    loop {
        let depth = open.len();
        let Some(innermost) = open.last_mut() else { return Ok(()) };
        let Some(token) = innermost.tokens.get(innermost.next) else {
            open.pop();
            continue;
        };
        innermost.next += 1;
        let TokenTree::Group(group) = token else { continue };
        let is_attribute = group.delimiter() == Delimiter::Bracket && innermost.follows_hash();
        let tests = is_attribute && is_test(group) && innermost.is_before_module();
        if is_attribute && !tests {
            reject_cfg(group)?;
        }
        if depth == MAX_NESTING {
            let message = format!(
                "this is nested too deeply: more than {MAX_NESTING} brackets around it; use functions or loops"
            );
            return Err(syn::Error::new(group.span_open(), message));
        }
        let level = Level::new(&group.stream());
        level.check_length()?;
        open.push(level);
    }
}

/// The tokens between two brackets, and the number of those visited.
struct Level {
    tokens: Vec<TokenTree>,
    next: usize,
}

impl Level {
    fn new(tokens: &TokenStream) -> Self {
        Self { tokens: tokens.clone().into_iter().collect(), next: 0 }
    }

    /// Rejects statements and elements that are too long.
    fn check_length(&self) -> syn::Result<()> {
        let (mut length, mut terms) = (0, 0);
        for token in &self.tokens {
            length += 1;
            match token {
                TokenTree::Punct(punct) if matches!(punct.as_char(), ';' | ',') => (length, terms) = (0, 0),
                TokenTree::Punct(punct) if matches!(punct.as_char(), '+' | '-') => terms += 1,
                _ => {}
            }
            if length > MAX_STATEMENT_TOKENS || terms > MAX_SUM_TERMS {
                let message = format!(
                    "this expression has more than {MAX_SUM_TERMS} terms or {MAX_STATEMENT_TOKENS} tokens without brackets as far as here: \
                     split it into statements, functions or loops"
                );
                return Err(syn::Error::new(token.span(), message));
            }
        }
        Ok(())
    }

    /// Whether `#` or `#!` precedes the last token.
    fn follows_hash(&self) -> bool {
        let before = |back: usize| self.next.checked_sub(back).and_then(|index| self.tokens.get(index));
        match before(2) {
            Some(TokenTree::Punct(punct)) if punct.as_char() == '!' => is_punct(before(3), '#'),
            token => is_punct(token, '#'),
        }
    }

    /// Whether the last attribute belongs to a module.
    fn is_before_module(&self) -> bool {
        let rest = self.tokens.get(self.next..).unwrap_or_default();
        module_end(rest).is_some()
    }
}

fn is_punct(token: Option<&TokenTree>, character: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == character)
}

fn is_ident(token: Option<&TokenTree>, name: &str) -> bool {
    matches!(token, Some(TokenTree::Ident(ident)) if ident == name)
}

/// `#[cfg(test)]`
fn is_test(attribute: &Group) -> bool {
    let tokens: Vec<TokenTree> = attribute.stream().into_iter().collect();
    let [first, TokenTree::Group(condition)] = tokens.as_slice() else { return false };
    is_ident(Some(first), "cfg") && condition.stream().to_string() == "test"
}

fn reject_cfg(attribute: &Group) -> syn::Result<()> {
    match attribute.stream().into_iter().next() {
        Some(TokenTree::Ident(ident)) if ident == "cfg" || ident == "cfg_attr" => Err(syn::Error::new(
            ident.span(),
            "`#[cfg]` inside a model is not supported: write one model for each case, with `#[cfg]` above its \
             attribute, or use a constant or a parameter",
        )),
        _ => Ok(()),
    }
}

/// The number of tokens of a module, with further attributes and visibility, if they start with
/// one.
fn module_end(tokens: &[TokenTree]) -> Option<usize> {
    let mut index = 0;
    loop {
        match tokens.get(index)? {
            TokenTree::Punct(punct) if punct.as_char() == '#' => index += 2,
            TokenTree::Ident(ident) if ident == "pub" => {
                index += 1;
                if matches!(tokens.get(index), Some(TokenTree::Group(_))) {
                    index += 1;
                }
            }
            TokenTree::Ident(ident) if ident == "mod" => {
                let end = tokens
                    .iter()
                    .skip(index)
                    .position(|token| matches!(token, TokenTree::Group(_)) || is_punct(Some(token), ';'))?;
                return Some(index + end + 1);
            }
            _ => return None,
        }
    }
}

/// The item without its test modules, which a model cannot use.
pub fn without_tests(item: TokenStream) -> TokenStream {
    remove_attributes(item, |attribute, rest| if is_test(attribute) { module_end(rest) } else { None })
}

/// A module without the marks `#[model]` of its functions.
pub fn without_marks(item: TokenStream) -> TokenStream {
    remove_attributes(item, |attribute, _| (attribute.stream().to_string() == "model").then_some(0))
}

/// A module without the marks `#[model]` and the casados attributes of its functions.
pub fn without_attributes(item: TokenStream) -> TokenStream {
    remove_attributes(item, |attribute, rest| {
        let path = attribute.stream().into_iter().take_while(|token| !matches!(token, TokenTree::Group(_)));
        let last = path.last().map(|token| token.to_string())?;
        let ours = last == "model" || super::Form::by_name(&last).is_some();
        (ours && module_end(rest).is_none()).then_some(0)
    })
}

/// The item without attributes in its body, and without as many tokens after each as `removed`
/// returns for the attribute and its successors.
fn remove_attributes(
    item: TokenStream,
    removed: impl Fn(&Group, &[TokenTree]) -> Option<usize>,
) -> TokenStream {
    change_body(item, |tokens| {
        let (mut kept, mut rest) = (TokenStream::new(), tokens);
        while let [token, behind @ ..] = rest {
            if is_punct(Some(token), '#')
                && let [TokenTree::Group(attribute), behind @ ..] = behind
                && let Some(count) = removed(attribute, behind)
            {
                rest = behind.get(count..).unwrap_or_default();
                continue;
            }
            kept.extend([token.clone()]);
            rest = behind;
        }
        kept
    })
}

/// The item with tokens inserted at the start of its body, after inner attributes, and at its end.
pub fn insert_in_body(item: TokenStream, first: &TokenStream, last: &TokenStream) -> TokenStream {
    change_body(item, |tokens| {
        let mut inner = 0;
        while is_punct(tokens.get(inner), '#') && is_punct(tokens.get(inner + 1), '!') {
            inner += 3;
        }
        let (attributes, rest) = tokens.split_at(inner.min(tokens.len()));
        let mut body: TokenStream = attributes.iter().cloned().collect();
        body.extend(first.clone());
        body.extend(rest.iter().cloned());
        body.extend(last.clone());
        body
    })
}

/// Changes the tokens between the braces at the end of a function or module.
fn change_body(item: TokenStream, change: impl FnOnce(&[TokenTree]) -> TokenStream) -> TokenStream {
    let mut tokens: Vec<TokenTree> = item.into_iter().collect();
    if let Some(TokenTree::Group(body)) = tokens.last_mut()
        && body.delimiter() == Delimiter::Brace
    {
        let inside: Vec<TokenTree> = parenthesise_groups(body.stream()).into_iter().collect();
        let mut changed = Group::new(Delimiter::Brace, change(&inside));
        changed.set_span(body.span());
        *body = changed;
    }
    tokens.into_iter().collect()
}

/// Adds parentheses to operations in groups without delimiters, at every level.
fn parenthesise_groups(tokens: TokenStream) -> TokenStream {
    let changed = tokens.into_iter().map(|token| {
        let TokenTree::Group(group) = token else { return token };
        let stream = parenthesise_groups(group.stream());
        let delimiter = match group.delimiter() {
            Delimiter::None if is_operation(stream.clone()) => Delimiter::Parenthesis,
            delimiter => delimiter,
        };
        let mut changed = Group::new(delimiter, stream);
        changed.set_span(group.span());
        TokenTree::Group(changed)
    });
    changed.collect()
}

/// Whether tokens are an expression that an adjacent operator could split.
fn is_operation(tokens: TokenStream) -> bool {
    use syn::Expr::{Assign, Binary, Break, Cast, Closure, Range, Reference, Return, Unary};
    matches!(
        syn::parse2(tokens),
        Ok(Assign(_)
            | Binary(_)
            | Break(_)
            | Cast(_)
            | Closure(_)
            | Range(_)
            | Reference(_)
            | Return(_)
            | Unary(_))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nested(levels: usize) -> TokenStream {
        (0..levels).fold(TokenStream::new(), |inner, _| {
            TokenTree::Group(Group::new(Delimiter::Parenthesis, inner)).into()
        })
    }

    #[test]
    fn nesting_is_bounded() {
        assert!(check(&nested(MAX_NESTING - 1)).is_ok());
        let error = check(&nested(MAX_NESTING)).map_err(|error| error.to_string());
        assert!(error.is_err_and(|message| message.contains("more than 256 brackets")));
    }

    #[test]
    fn conditions_are_found_wherever_they_are() {
        for source in [
            "fn m(x: f64) -> f64 { let mut s = x; #[cfg(feature = \"drag\")] { s -= x; } s }",
            "fn m(x: f64) -> f64 { #[cfg(all())] let s = x; s }",
            "mod m { #[cfg(all())] const K: f64 = 1.0; fn m(x: f64) -> f64 { x } }",
            "mod m { struct A { #[cfg(unix)] a: f64 } fn m(x: f64) -> f64 { x } }",
            "fn m(x: f64) -> f64 { match 1 { #[cfg(unix)] 1 => x, _ => 2.0 * x } }",
            "fn m(x: [f64; 1]) -> [f64; 1] { [#[cfg(unix)] x[0]] }",
            "fn m(#[cfg(unix)] x: f64, #[cfg(not(unix))] x: f64) -> f64 { x }",
            "mod m { #[cfg_attr(unix, inline)] fn m(x: f64) -> f64 { x } }",
            "mod m { #![cfg(unix)] fn m(x: f64) -> f64 { x } }",
            "mod m { #[cfg(test)] const K: f64 = 1.0; fn m(x: f64) -> f64 { x } }",
            "#[cfg(unix)] fn m(x: f64) -> f64 { x }",
        ] {
            let tokens: TokenStream = source.parse().unwrap();
            let message = check(&tokens).map_err(|error| error.to_string());
            assert!(message.is_err_and(|message| message.contains("`#[cfg]` inside a model")), "{source}");
        }
        let tests = "mod m { fn m(x: f64) -> f64 { x } #[cfg(test)] mod tests { fn t() {} } }";
        let tokens: TokenStream = tests.parse().unwrap();
        assert!(check(&tokens).is_ok());
        assert_eq!(without_tests(tokens).to_string(), "mod m { fn m (x : f64) -> f64 { x } }");
    }

    #[test]
    fn operations_without_delimiters_get_parentheses() {
        let group = |source: &str| -> TokenStream {
            TokenTree::Group(Group::new(Delimiter::None, source.parse().unwrap())).into()
        };
        let sum = group("1.0 + 2.0");
        let (ty, negative) = (group("f64"), group("- y"));
        let item = quote::quote! { fn m(x: #ty) -> #ty { [x * #sum, (#negative).abs()] } };
        assert_eq!(
            insert_in_body(item, &TokenStream::new(), &TokenStream::new()).to_string(),
            "fn m (x : f64) -> f64 { [x * (1.0 + 2.0) , ((- y)) . abs ()] }"
        );
    }

    #[test]
    fn bodies_begin_behind_inner_attributes() {
        let item: TokenStream = "mod m { #![allow(dead_code)] #[model] fn m() {} }".parse().unwrap();
        let (first, last) = ("use a;".parse().unwrap(), "struct B;".parse().unwrap());
        assert_eq!(
            insert_in_body(without_marks(item), &first, &last).to_string(),
            "mod m { #! [allow (dead_code)] use a ; fn m () { } struct B ; }"
        );
    }
}
