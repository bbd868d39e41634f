//! Resolution of paths: variables, items, associated functions and constants, built-in functions.

use super::environment::{Names, Scope};
use super::evaluator::{Evaluated, Evaluator, TokenSpan};
use super::implementation::Implementation;
use super::items::{Symbol, TypeItem, ValueItem};
use super::methods;
use super::modules::{MAX_USE_LINKS, PathTarget, VisitedModules, from_outermost, module_path, used_path};
use super::place::Cell;
use super::types::Type;
use super::value::{Builtin, Definition, Function, Generic, Struct, Style, Value};
use proc_macro2::{Span, TokenStream};
use quote::ToTokens;
use std::rc::Rc;
use syn::Result;
use syn::ext::IdentExt;
use syn::parse::Parser;

/// The meaning of a path.
pub enum PathMeaning {
    /// A variable.
    Variable(Cell),
    /// A value: a constant or a function in the macro's input.
    Value(Value),
    /// Anything else: part of the language, or from outside.
    Builtin(Builtin),
}

impl Evaluator {
    /// The meaning of a path in an expression.
    pub(super) fn path_meaning(&mut self, path: &syn::ExprPath) -> Evaluated<PathMeaning> {
        let scope = self.scope.clone();
        let Some(last) = path.path.segments.last() else {
            return Ok(PathMeaning::Builtin(Builtin {
                owner: None,
                path: Vec::new(),
                turbofish: Vec::new(),
            }));
        };
        let name = self.symbol(&last.ident);
        if let Some(qself) = &path.qself {
            let ty = self.resolve(&qself.ty, &scope)?;
            let turbofish = self.generic_arguments(&last.arguments, &scope)?;
            let of_trait = qself.position > 0;
            return Ok(self.member(&ty, of_trait, &last.ident, turbofish, path)?);
        }
        if path.path.segments.len() == 1 {
            if last.arguments.is_none()
                && let Some(cell) = scope.variable(name)
            {
                return Ok(PathMeaning::Variable(cell));
            }
            let turbofish = self.generic_arguments(&last.arguments, &scope)?;
            return Ok(self.item_meaning(name, &last.ident, turbofish, &scope, &mut Vec::new())?);
        }
        let turbofish = self.generic_arguments(&last.arguments, &scope)?;
        let count = path.path.segments.len();
        let modules: Vec<_> =
            path.path.segments.iter().take(count - 1).map(|module| module.ident.to_string()).collect();
        if let PathTarget::Module(module) = self.resolve_module_path(&modules, &scope, &mut Vec::new()) {
            return Ok(match self.item_meaning(name, &last.ident, turbofish, &module, &mut Vec::new())? {
                PathMeaning::Builtin(builtin) if builtin.path.len() == 1 => {
                    PathMeaning::Builtin(Builtin { path: self.full_path(&path.path, &scope), ..builtin })
                }
                named => named,
            });
        }
        // Types.
        let mut prefix = path.path.clone();
        prefix.segments.pop();
        let ty = self.resolve_path(&prefix, &scope, 0)?;
        if !matches!(ty, Type::Unknown) {
            return Ok(match self.member(&ty, false, &last.ident, turbofish, path)? {
                PathMeaning::Builtin(builtin) => {
                    PathMeaning::Builtin(Builtin { path: self.full_path(&path.path, &scope), ..builtin })
                }
                named => named,
            });
        }
        let full = self.full_path(&path.path, &scope);
        Ok(PathMeaning::Builtin(Builtin { owner: None, path: full, turbofish }))
    }

    /// The segments of a path from the outermost module in the macro's input, with a local `use` of
    /// the first one resolved.
    fn full_path(&mut self, path: &syn::Path, scope: &Rc<Scope>) -> Vec<String> {
        let mut segments = path.segments.iter().map(|segment| segment.ident.to_string());
        let first = segments.next().unwrap_or_default();
        let symbol = self.symbol_of(&first);
        let (mut full, place) = used_path(scope, symbol).unwrap_or_else(|| (vec![first], scope.clone()));
        full.extend(segments);
        from_outermost(full, &place)
    }

    /// An item of a scope.
    fn item_meaning(
        &mut self,
        name: Symbol,
        ident: &syn::Ident,
        turbofish: Vec<Generic>,
        scope: &Rc<Scope>,
        trail: &mut VisitedModules,
    ) -> Result<PathMeaning> {
        if ident == "Self" {
            // `Self` of a unit or tuple struct.
            let path: syn::Path = ident.clone().into();
            if let Type::Struct(definition, arguments) = self.resolve_path(&path, scope, 0)? {
                return Ok(PathMeaning::Value(constructor(definition, arguments, 0)));
            }
        }
        for around in scope.enclosing_scopes() {
            let Names::Items(items) = &around.names else { continue };
            match items.values.get(&name) {
                Some(ValueItem::Function(item)) => {
                    let function =
                        Function { item: item.clone(), scope: around.clone(), turbofish, owner: None };
                    return Ok(PathMeaning::Value(Value::Function(Rc::new(function))));
                }
                Some(ValueItem::Constant(constant)) => {
                    let constant = constant.clone();
                    return self.constant_value(&constant, around).map(PathMeaning::Value);
                }
                None => {}
            }
            match items.types.get(&name) {
                Some(TypeItem::Definition(definition)) if !definition.is_enum => {
                    return Ok(PathMeaning::Value(constructor(definition.clone(), Rc::new(turbofish), 0)));
                }
                Some(TypeItem::Alias(_)) => {
                    let path: syn::Path = ident.clone().into();
                    if let Type::Struct(definition, arguments) = self.resolve_path(&path, scope, 0)? {
                        return Ok(PathMeaning::Value(constructor(definition, arguments, 0)));
                    }
                }
                _ => {}
            }
            if let Some(full) = items.uses.get(&name) {
                return self.used_path(full.clone(), turbofish, around, trail);
            }
            for glob in &items.globs {
                if let Some(named) = self.glob(glob, ident, &turbofish, around, trail)? {
                    return Ok(named);
                }
            }
        }
        Ok(PathMeaning::Builtin(Builtin { owner: None, path: vec![ident.to_string()], turbofish }))
    }

    /// The name, if `use path::*;` imports it.
    fn glob(
        &mut self,
        path: &[String],
        ident: &syn::Ident,
        turbofish: &[Generic],
        scope: &Rc<Scope>,
        trail: &mut VisitedModules,
    ) -> Result<Option<PathMeaning>> {
        if let PathTarget::Module(module) = self.resolve_module_path(path, scope, trail) {
            if trail.contains(&Rc::as_ptr(&module)) {
                return Ok(None);
            }
            trail.push(Rc::as_ptr(&module));
            let symbol = self.symbol(ident);
            let named = self.item_meaning(symbol, ident, turbofish.to_vec(), &module, trail)?;
            return Ok(Some(named).filter(|named| !matches!(named, PathMeaning::Builtin(_))));
        }
        // `use Mode::*;`
        if let Some((TypeItem::Definition(definition), _)) = self.resolve_type(path, scope, &mut Vec::new())
            && definition.is_enum
            && let Some(variant) = variant_index(&definition, &ident.to_string())
        {
            return Ok(Some(PathMeaning::Value(constructor(
                definition,
                Rc::new(turbofish.to_vec()),
                variant,
            ))));
        }
        let path = path.iter().cloned().chain([ident.to_string()]).collect();
        let builtin = Builtin { owner: None, path, turbofish: Vec::new() };
        Ok(methods::constant(self, &builtin).map(PathMeaning::Value))
    }

    /// The meaning of a path written in a `use`.
    fn used_path(
        &mut self,
        full: Vec<String>,
        turbofish: Vec<Generic>,
        scope: &Rc<Scope>,
        trail: &mut VisitedModules,
    ) -> Result<PathMeaning> {
        if let Some((name, owner)) = full.split_last()
            && trail.len() < MAX_USE_LINKS
        {
            if let Some((TypeItem::Definition(definition), _)) =
                self.resolve_type(owner, scope, &mut Vec::new())
                && definition.is_enum
                && let Some(variant) = variant_index(&definition, name)
            {
                return Ok(PathMeaning::Value(constructor(definition, Rc::new(turbofish), variant)));
            }
            if let PathTarget::Module(module) = self.resolve_module_path(owner, scope, &mut Vec::new()) {
                trail.push(Rc::as_ptr(scope));
                let symbol = self.symbol_of(name);
                let ident = quote::format_ident!("{name}");
                match self.item_meaning(symbol, &ident, turbofish.clone(), &module, trail)? {
                    PathMeaning::Builtin(builtin) if builtin.path.len() == 1 => {}
                    named => return Ok(named),
                }
            }
        }
        Ok(PathMeaning::Builtin(Builtin { owner: None, path: from_outermost(full, scope), turbofish }))
    }

    /// An associated function or constant, or a variant.
    fn member(
        &mut self,
        ty: &Type,
        of_trait: bool,
        ident: &syn::Ident,
        turbofish: Vec<Generic>,
        at: TokenSpan,
    ) -> Result<PathMeaning> {
        let name = self.symbol(ident);
        let hidden = !of_trait && self.is_hidden(ty, &ident.to_string());
        if let Type::Struct(definition, arguments) = ty
            && definition.is_enum
            && let Some(variant) = variant_index(definition, &ident.to_string())
        {
            return Ok(PathMeaning::Value(constructor(definition.clone(), arguments.clone(), variant)));
        }
        if !hidden && let Some((implementation, item)) = self.find_function(name, ty) {
            let scope = implementation.scope.clone();
            let owner = Some((implementation, ty.clone()));
            return Ok(PathMeaning::Value(Value::Function(Rc::new(Function {
                item,
                scope,
                turbofish,
                owner,
            }))));
        }
        for implementation in self.implementations.clone().iter().rev() {
            let Some(constant) = implementation.constants.get(&name) else { continue };
            let Some(scope) = self.matching_impl_scope(implementation, ty) else { continue };
            let scope =
                Scope::child_scope(&scope, Names::SelfType(ty.clone(), implementation.self_type.clone()));
            let value = if implementation.generics.params.is_empty() && implementation.self_type.is_some() {
                self.constant_value(constant, &scope)
            } else {
                self.deeper(at, |evaluator| {
                    Ok(evaluator.constant_expression(&constant.expression, &constant.ty, &scope)?)
                })
                .or_else(|flow| self.require_value(Err(flow), at))
            };
            return value.map(PathMeaning::Value);
        }
        Ok(PathMeaning::Builtin(Builtin {
            owner: Some(ty.clone()),
            path: vec![ident.to_string()],
            turbofish,
        }))
    }

    /// The scope of an implementation for a type; nothing if it does not apply.
    pub(super) fn matching_impl_scope(
        &mut self,
        implementation: &Rc<Implementation>,
        ty: &Type,
    ) -> Option<Rc<Scope>> {
        let scope = self.generic_scope(&implementation.generics, &implementation.scope);
        match &implementation.self_type {
            Some(pattern) => self.unify(pattern, ty, &scope).then_some(scope),
            None => {
                // Defaults of a trait apply to the types that implement it.
                let of = implementation.of.as_ref()?.segments.last()?.ident.clone();
                let implementors = self.implementations.clone();
                let implemented = implementors.iter().any(|other| {
                    other.self_type.as_ref().is_some_and(|pattern| {
                        other.of.as_ref().and_then(|path| path.segments.last()).is_some_and(|s| s.ident == of)
                            && {
                                let scope = self.generic_scope(&other.generics, &other.scope);
                                self.unify(pattern, ty, &scope)
                            }
                    })
                });
                implemented.then_some(scope)
            }
        }
    }

    /// The function of a name implemented for a type: inherent ones first, then those of traits.
    pub(super) fn find_function(
        &mut self,
        name: Symbol,
        ty: &Type,
    ) -> Option<(Rc<Implementation>, Rc<syn::ItemFn>)> {
        if self.implementations.is_empty() {
            return None;
        }
        let with_name: Vec<_> = self
            .implementations
            .iter()
            .rev()
            .filter(|implementation| implementation.functions.contains_key(&name))
            .cloned()
            .collect();
        let rank = |implementation: &Implementation| match (&implementation.of, &implementation.self_type) {
            (None, _) => 0,
            (Some(_), Some(_)) => 1,
            _ => 2,
        };
        for wanted in 0..3 {
            for implementation in with_name.iter().filter(|implementation| rank(implementation) == wanted) {
                if self.matching_impl_scope(implementation, ty).is_some() {
                    return Some((implementation.clone(), implementation.functions[&name].clone()));
                }
            }
        }
        None
    }

    /// The value of the constant or const parameter with this name, if any.
    pub(super) fn named_constant(&mut self, ident: &syn::Ident, scope: &Rc<Scope>) -> Result<Option<Value>> {
        let name = self.symbol(ident);
        if let Some(cell) = scope.variable(name) {
            return Ok(Some(cell.borrow().clone()));
        }
        for around in scope.enclosing_scopes() {
            if let Names::Items(items) = &around.names
                && let Some(ValueItem::Constant(constant)) = items.values.get(&name)
            {
                let constant = constant.clone();
                return self.constant_value(&constant, around).map(Some);
            }
        }
        Ok(None)
    }

    /// A value from outside of the macro's input: a constant of the language, or an opaque one.
    pub(super) fn builtin_value(&mut self, builtin: Builtin, path: &syn::ExprPath) -> Value {
        if let Some(value) = methods::constant(self, &builtin) {
            return value;
        }
        if builtin.path.last().is_some_and(|name| name == "None") {
            return Value::Option(None);
        }
        let Some(name) = builtin.path.last() else {
            return Value::Opaque(Rc::new(path.to_token_stream()));
        };
        let from_here = builtin.path.len() == 1 || matches!(builtin.path[0].as_str(), "crate" | "super");
        // A value of the surrounding module is more often a constant than a function.
        let constant = builtin.owner.is_none()
            && from_here
            && !name.starts_with(char::is_uppercase)
            && name != "from_fn"
            && name != "identity";
        // By convention functions and methods are in snake case, constants are not.
        if !constant && name.chars().any(char::is_lowercase) {
            return Value::Builtin(Rc::new(builtin));
        }
        Value::Opaque(Rc::new(self.emitted_path(&builtin, path)))
    }

    /// The path by which generated code, in the outermost module, refers to an item outside of the
    /// macro's input.
    pub(super) fn emitted_path(&self, builtin: &Builtin, path: &syn::ExprPath) -> TokenStream {
        if module_path(&self.scope).is_empty() || builtin.owner.is_some() || builtin.path.len() < 2 {
            return path.to_token_stream();
        }
        let span = path.path.segments.last().map_or_else(Span::call_site, |last| last.ident.span());
        let names = builtin.path.iter().map(|name| {
            syn::Ident::parse_any.parse_str(name).map_or_else(
                |_| syn::Ident::new("_", span),
                |mut name| {
                    name.set_span(span);
                    name
                },
            )
        });
        quote::quote!(#(#names)::*)
    }
}

/// The index of a variant by its name.
pub fn variant_index(definition: &Definition, name: &str) -> Option<usize> {
    definition.variants.iter().position(|variant| variant.name == name)
}

/// A unit struct or variant, or the constructor of a tuple struct or variant.
fn constructor(definition: Rc<Definition>, arguments: Rc<Vec<Generic>>, variant: usize) -> Value {
    match definition.variants[variant].style {
        Style::Unit => Value::Struct(Rc::new(Struct { definition, variant, fields: Vec::new() })),
        _ => Value::Constructor(Type::Struct(definition, arguments), variant),
    }
}
