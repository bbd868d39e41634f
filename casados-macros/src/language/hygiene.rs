//! Hygiene of `macro_rules!`.
//!
//! A variable that a macro declares differs from a variable of the same name in the macro's
//! arguments. Identifiers compare by their text, so that variables of different contexts are
//! renamed before a model is executed. Only variables have contexts; items, fields and methods are
//! found by text.

use proc_macro2::{Group, Ident, TokenStream, TokenTree};
use std::collections::{HashMap, HashSet};
use syn::ext::IdentExt;
use syn::visit::{self, Visit};
use syn::visit_mut::{self, VisitMut};

/// The syntax context of an identifier, from its debug output; empty if there is none.
fn context(ident: &Ident) -> String {
    let text = format!("{:?}", ident.span());
    match text.split_once(' ') {
        Some((context, _)) if context.starts_with('#') => context.to_owned(),
        _ => String::new(),
    }
}

/// Renames variables with the same name and different contexts.
pub fn separate_contexts(item: &mut syn::Item) {
    let mut names = ContextCollector::default();
    names.visit_item(item);
    names.bound.retain(|name, _| names.used.get(name).is_some_and(|contexts| contexts.len() > 1));
    if names.bound.is_empty() {
        return;
    }
    ContextRenamer { bound: names.bound }.visit_item_mut(item);
}

#[derive(Default)]
struct ContextCollector {
    /// The contexts in which a name is a variable; names of arguments are not changed.
    bound: HashMap<String, HashSet<String>>,
    /// The contexts in which it occurs.
    used: HashMap<String, HashSet<String>>,
    /// Whether the visitor is in the signature of a function.
    arguments: bool,
}

impl ContextCollector {
    fn uses(&mut self, ident: &Ident) {
        self.used.entry(ident.to_string()).or_default().insert(context(ident));
    }
}

impl<'ast> Visit<'ast> for ContextCollector {
    fn visit_ident(&mut self, ident: &'ast Ident) {
        self.uses(ident);
    }

    fn visit_signature(&mut self, signature: &'ast syn::Signature) {
        self.arguments = true;
        visit::visit_signature(self, signature);
        self.arguments = false;
    }

    fn visit_pat_ident(&mut self, pattern: &'ast syn::PatIdent) {
        self.bound.entry(pattern.ident.to_string()).or_default();
        if !self.arguments {
            let contexts = self.bound.entry(pattern.ident.to_string()).or_default();
            contexts.insert(context(&pattern.ident));
        }
        visit::visit_pat_ident(self, pattern);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        let mut open = vec![call.tokens.clone().into_iter()];
        while let Some(innermost) = open.last_mut() {
            match innermost.next() {
                Some(TokenTree::Group(group)) => open.push(group.stream().into_iter()),
                Some(TokenTree::Ident(ident)) => self.uses(&ident),
                Some(_) => {}
                None => {
                    open.pop();
                }
            }
        }
    }
}

struct ContextRenamer {
    bound: HashMap<String, HashSet<String>>,
}

impl ContextRenamer {
    /// Renames a variable by its context.
    fn rename(&self, ident: &mut Ident) {
        let Some(contexts) = self.bound.get(&ident.to_string()) else { return };
        let context = context(ident);
        if contexts.contains(&context) {
            let text = format!("{}_{}", ident.unraw(), context.trim_start_matches('#'));
            *ident = Ident::new(&text, ident.span());
        }
    }

    /// Renames the identifiers in a macro's arguments, except fields and methods.
    fn tokens(&self, tokens: TokenStream) -> TokenStream {
        let mut is_member = false;
        let renamed = tokens.into_iter().map(|token| {
            let before = std::mem::take(&mut is_member);
            match token {
                TokenTree::Group(group) => {
                    let mut changed = Group::new(group.delimiter(), self.tokens(group.stream()));
                    changed.set_span(group.span());
                    TokenTree::Group(changed)
                }
                TokenTree::Ident(mut ident) if !before => {
                    self.rename(&mut ident);
                    TokenTree::Ident(ident)
                }
                TokenTree::Punct(punct) => {
                    is_member = punct.as_char() == '.';
                    TokenTree::Punct(punct)
                }
                token => token,
            }
        });
        renamed.collect()
    }
}

impl VisitMut for ContextRenamer {
    fn visit_pat_ident_mut(&mut self, pattern: &mut syn::PatIdent) {
        self.rename(&mut pattern.ident);
        visit_mut::visit_pat_ident_mut(self, pattern);
    }

    fn visit_expr_path_mut(&mut self, path: &mut syn::ExprPath) {
        if path.qself.is_none()
            && path.path.leading_colon.is_none()
            && path.path.segments.len() == 1
            && let Some(segment) = path.path.segments.first_mut()
            && segment.arguments.is_none()
        {
            self.rename(&mut segment.ident);
        }
        visit_mut::visit_expr_path_mut(self, path);
    }

    fn visit_macro_mut(&mut self, call: &mut syn::Macro) {
        call.tokens = self.tokens(call.tokens.clone());
    }
}
