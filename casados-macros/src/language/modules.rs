//! Modules in the macro's input: resolution of paths and `use`.

use super::environment::{Names, Scope};
use super::evaluator::Evaluator;
use super::items::{Items, Symbol, TypeItem};
use std::cell::OnceCell;
use std::rc::{Rc, Weak};

/// A module in the macro's input.
#[derive(Debug, Default)]
pub struct Module {
    /// The path to it from the outermost module.
    pub names: Vec<String>,
    /// The enclosing module, if it is in the macro's input.
    pub around: OnceCell<Weak<Scope>>,
}

/// The target of a path to a module.
pub(super) enum PathTarget {
    /// A module in the macro's input.
    Module(Rc<Scope>),
    /// Anything else: a crate, a type.
    Elsewhere,
}

/// The modules visited by a search, so that it ends for circular uses.
pub(super) type VisitedModules = Vec<*const Scope>;

/// Maximum number of `use` items in a chain.
pub(super) const MAX_USE_LINKS: usize = 64;

/// The items of a scope, if it has any.
fn items(scope: &Scope) -> Option<&Items> {
    match &scope.names {
        Names::Items(items) => Some(items),
        _ => None,
    }
}

/// The innermost module around a scope.
pub(super) fn module_of(scope: &Rc<Scope>) -> Option<&Rc<Scope>> {
    scope.enclosing_scopes().find(|scope| items(scope).is_some_and(|items| items.module.is_some()))
}

/// The path from the outermost module in the macro's input to the one around a scope.
pub(super) fn module_path(scope: &Rc<Scope>) -> &[String] {
    let module = module_of(scope).and_then(|module| items(module)).and_then(|items| items.module.as_ref());
    module.map_or(&[], |module| &module.names)
}

/// The module that encloses the innermost one.
fn around(scope: &Rc<Scope>) -> Option<Rc<Scope>> {
    let module = items(module_of(scope)?)?.module.as_ref()?;
    module.around.get()?.upgrade()
}

/// The full path of a name imported by a `use`, and the scope of the `use`.
pub(super) fn used_path(scope: &Rc<Scope>, name: Symbol) -> Option<(Vec<String>, Rc<Scope>)> {
    scope.enclosing_scopes().find_map(|scope| Some((items(scope)?.uses.get(&name)?.clone(), scope.clone())))
}

/// The path from the outermost module in the macro's input, for one that starts with `self` or
/// `super` in an inner one.
pub(super) fn from_outermost(path: Vec<String>, scope: &Rc<Scope>) -> Vec<String> {
    let names = module_path(scope);
    let steps = path.iter().take_while(|name| matches!(name.as_str(), "self" | "super")).count();
    if names.is_empty() || steps == 0 {
        return path;
    }
    let up = path[..steps].iter().filter(|name| *name == "super").count();
    let mut full = match names.len().checked_sub(up) {
        Some(left) => ["self".to_owned()].into_iter().chain(names[..left].iter().cloned()).collect(),
        None => vec!["super".to_owned(); up - names.len()],
    };
    full.extend_from_slice(&path[steps..]);
    full
}

impl Evaluator {
    /// The target of a path written in a scope.
    pub(super) fn resolve_module_path(
        &mut self,
        names: &[String],
        scope: &Rc<Scope>,
        trail: &mut VisitedModules,
    ) -> PathTarget {
        let mut current: Option<Rc<Scope>> = None;
        let mut names = names;
        while let Some((first, rest)) = names.split_first() {
            let next = match first.as_str() {
                "self" => module_of(current.as_ref().unwrap_or(scope)).cloned(),
                "super" => around(current.as_ref().unwrap_or(scope)),
                "crate" => None,
                _ => break,
            };
            let Some(next) = next else { return PathTarget::Elsewhere };
            (current, names) = (Some(next), rest);
        }
        for name in names {
            let symbol = self.symbol_of(name);
            let place = current.as_ref().unwrap_or(scope);
            let module =
                place.enclosing_scopes().find_map(|scope| items(scope)?.modules.get(&symbol).cloned());
            let next = match (module, used_path(place, symbol)) {
                (Some(module), _) => module,
                (None, Some((full, place))) if trail.len() < MAX_USE_LINKS => {
                    trail.push(Rc::as_ptr(&place));
                    match self.resolve_module_path(&full, &place, trail) {
                        PathTarget::Module(module) => module,
                        PathTarget::Elsewhere => return PathTarget::Elsewhere,
                    }
                }
                _ => return PathTarget::Elsewhere,
            };
            current = Some(next);
        }
        current.map_or(PathTarget::Elsewhere, PathTarget::Module)
    }

    /// The type that a path denotes, and its scope.
    pub(super) fn resolve_type(
        &mut self,
        path: &[String],
        scope: &Rc<Scope>,
        trail: &mut VisitedModules,
    ) -> Option<(TypeItem, Rc<Scope>)> {
        let (last, modules) = path.split_last()?;
        let symbol = self.symbol_of(last);
        let place = match self.resolve_module_path(modules, scope, trail) {
            PathTarget::Module(module) => module,
            PathTarget::Elsewhere if modules.is_empty() => scope.clone(),
            PathTarget::Elsewhere => return None,
        };
        let places: Vec<_> = place.enclosing_scopes().cloned().collect();
        places.iter().find_map(|place| self.type_in(symbol, place, trail))
    }

    /// The type of a name among the items of a scope, or imported by a `use`.
    pub(super) fn type_in(
        &mut self,
        symbol: Symbol,
        scope: &Rc<Scope>,
        trail: &mut VisitedModules,
    ) -> Option<(TypeItem, Rc<Scope>)> {
        let items = items(scope)?;
        if let Some(item) = items.types.get(&symbol) {
            return Some((item.clone(), scope.clone()));
        }
        if trail.len() >= MAX_USE_LINKS {
            return None;
        }
        if let Some(full) = items.uses.get(&symbol) {
            trail.push(Rc::as_ptr(scope));
            return self.resolve_type(full, scope, trail);
        }
        for glob in &items.globs {
            let PathTarget::Module(module) = self.resolve_module_path(glob, scope, trail) else { continue };
            if trail.contains(&Rc::as_ptr(&module)) {
                continue;
            }
            trail.push(Rc::as_ptr(&module));
            if let Some(found) = self.type_in(symbol, &module, trail) {
                return Some(found);
            }
        }
        None
    }

    /// A `use` for generated code, which is in the outermost module: of inner modules only globs,
    /// since other names have full paths.
    pub(super) fn emitted_use(&mut self, item: &syn::ItemUse, scope: &Rc<Scope>) -> Option<syn::ItemUse> {
        let names = module_path(scope);
        if names.is_empty() {
            return Some(item.clone());
        }
        if !has_glob(&item.tree) {
            return None;
        }
        let mut up = 0;
        let mut tree = &item.tree;
        while let syn::UseTree::Path(path) = tree
            && (path.ident == "self" || path.ident == "super")
        {
            up += usize::from(path.ident == "super");
            tree = &path.tree;
        }
        if std::ptr::eq(tree, &raw const item.tree) {
            return Some(item.clone());
        }
        // The names of modules in the macro's input are known.
        let up = up.checked_sub(names.len()).filter(|up| *up > 0)?;
        let above = std::iter::repeat_n(quote::quote!(super::), up);
        syn::parse2(quote::quote!(use #(#above)* #tree;)).ok()
    }
}

/// Whether a `use` has a glob.
fn has_glob(tree: &syn::UseTree) -> bool {
    match tree {
        syn::UseTree::Path(path) => has_glob(&path.tree),
        syn::UseTree::Group(group) => group.items.iter().any(has_glob),
        syn::UseTree::Glob(_) => true,
        _ => false,
    }
}
