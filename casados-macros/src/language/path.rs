//! What paths stand for: variables, items, associated functions and constants, built-in functions.

use super::environment::{Names, Scope};
use super::evaluator::{At, Evaluated, Evaluator};
use super::items::{Implementation, Symbol, TypeItem, ValueItem};
use super::methods;
use super::place::Cell;
use super::types::Type;
use super::value::{Builtin, Definition, Function, Generic, Struct, Style, Value};
use quote::ToTokens;
use std::rc::Rc;
use syn::Result;

/// What a path stands for.
pub enum Named {
    /// A variable.
    Variable(Cell),
    /// A value: a constant or a function that the macro sees.
    Value(Value),
    /// Something that the macro does not see: part of the language, or from outside.
    Builtin(Builtin),
}

impl Evaluator {
    /// What a path in an expression stands for.
    pub(super) fn named(&mut self, path: &syn::ExprPath) -> Evaluated<Named> {
        let scope = self.scope.clone();
        let Some(last) = path.path.segments.last() else {
            return Ok(Named::Builtin(Builtin { owner: None, path: Vec::new(), turbofish: Vec::new() }));
        };
        let name = self.symbol(&last.ident);
        if let Some(qself) = &path.qself {
            let ty = self.resolve(&qself.ty, &scope)?;
            let turbofish = self.generic_arguments(&last.arguments, &scope)?;
            return Ok(self.member(&ty, name, &last.ident, turbofish, path)?);
        }
        if path.path.segments.len() == 1 {
            if last.arguments.is_none()
                && let Some(cell) = scope.variable(name)
            {
                return Ok(Named::Variable(cell));
            }
            let turbofish = self.generic_arguments(&last.arguments, &scope)?;
            return Ok(self.item_named(name, &last.ident, turbofish, &scope)?);
        }
        let turbofish = self.generic_arguments(&last.arguments, &scope)?;
        // Modules that the macro sees.
        let mut inner = scope.clone();
        let mut seen = 0;
        let count = path.path.segments.len();
        for segment in path.path.segments.iter().take(count - 1) {
            if segment.ident == "self" || segment.ident == "super" {
                seen += 1;
                continue;
            }
            let segment = self.symbol(&segment.ident);
            match module(&inner, segment) {
                Some(module) => inner = module,
                None => break,
            }
            seen += 1;
        }
        if seen == count - 1 {
            return Ok(self.item_named(name, &last.ident, turbofish, &inner)?);
        }
        // Types.
        let mut prefix = path.path.clone();
        prefix.segments.pop();
        let ty = self.resolve_path(&prefix, &scope, 0)?;
        if !matches!(ty, Type::Unknown) {
            return Ok(match self.member(&ty, name, &last.ident, turbofish, path)? {
                Named::Builtin(builtin) => {
                    Named::Builtin(Builtin { path: self.full_path(&path.path, &scope), ..builtin })
                }
                named => named,
            });
        }
        let full = self.full_path(&path.path, &scope);
        Ok(Named::Builtin(Builtin { owner: None, path: full, turbofish }))
    }

    /// The segments of a path, with a local `use` of the first one resolved.
    fn full_path(&mut self, path: &syn::Path, scope: &Rc<Scope>) -> Vec<String> {
        let mut segments = path.segments.iter();
        let mut full = Vec::new();
        if let Some(first) = segments.next() {
            let symbol = self.symbol(&first.ident);
            match used(scope, symbol) {
                Some(path) => full = path,
                None => full.push(first.ident.to_string()),
            }
        }
        full.extend(segments.map(|segment| segment.ident.to_string()));
        full
    }

    /// An item of a scope.
    fn item_named(
        &mut self,
        name: Symbol,
        ident: &syn::Ident,
        turbofish: Vec<Generic>,
        scope: &Rc<Scope>,
    ) -> Result<Named> {
        if ident == "Self" {
            // `Self` of a unit or tuple struct.
            let path: syn::Path = ident.clone().into();
            if let Type::Struct(definition, arguments) = self.resolve_path(&path, scope, 0)? {
                return Ok(Named::Value(constructor(definition, arguments, 0)));
            }
        }
        for around in scope.chain() {
            let Names::Items(items) = &around.names else { continue };
            match items.values.get(&name) {
                Some(ValueItem::Function(item)) => {
                    let function =
                        Function { item: item.clone(), scope: around.clone(), turbofish, owner: None };
                    return Ok(Named::Value(Value::Function(Rc::new(function))));
                }
                Some(ValueItem::Constant(constant)) => {
                    let constant = constant.clone();
                    return self.constant_value(&constant, around).map(Named::Value);
                }
                None => {}
            }
            match items.types.get(&name) {
                Some(TypeItem::Definition(definition)) if !definition.is_enum => {
                    return Ok(Named::Value(constructor(definition.clone(), Rc::new(turbofish), 0)));
                }
                Some(TypeItem::Alias(_)) => {
                    let path: syn::Path = ident.clone().into();
                    if let Type::Struct(definition, arguments) = self.resolve_path(&path, scope, 0)? {
                        return Ok(Named::Value(constructor(definition, arguments, 0)));
                    }
                }
                _ => {}
            }
            if let Some(full) = items.uses.get(&name) {
                let full = full.clone();
                return self.used_path(full, turbofish, scope);
            }
            for glob in &items.globs {
                // `use Mode::*;`
                if let Some(last) = glob.last() {
                    let last = self.symbol_of(last);
                    if let Some(definition) = enumeration(scope, last)
                        && let Some(variant) = position(&definition, &ident.to_string())
                    {
                        return Ok(Named::Value(constructor(definition, Rc::new(turbofish), variant)));
                    }
                }
                let mut full = glob.clone();
                full.push(ident.to_string());
                let builtin = Builtin { owner: None, path: full, turbofish: Vec::new() };
                if let Some(value) = methods::constant(self, &builtin) {
                    return Ok(Named::Value(value));
                }
            }
        }
        Ok(Named::Builtin(Builtin { owner: None, path: vec![ident.to_string()], turbofish }))
    }

    /// What a path that was written in a `use` stands for.
    fn used_path(&mut self, full: Vec<String>, turbofish: Vec<Generic>, scope: &Rc<Scope>) -> Result<Named> {
        if let [.., owner, name] = full.as_slice() {
            let owner = self.symbol_of(owner);
            if let Some(definition) = enumeration(scope, owner)
                && let Some(variant) = position(&definition, name)
            {
                return Ok(Named::Value(constructor(definition, Rc::new(turbofish), variant)));
            }
            if let Some(inner) = module(scope, owner) {
                let symbol = self.symbol_of(name);
                let ident = quote::format_ident!("{name}");
                return self.item_named(symbol, &ident, turbofish, &inner);
            }
        }
        if full.first().is_some_and(|first| first == "self" || first == "super")
            && let Some(name) = full.last()
        {
            let symbol = self.symbol_of(name);
            for around in scope.chain() {
                let Names::Items(items) = &around.names else { continue };
                if items.values.contains_key(&symbol) || items.types.contains_key(&symbol) {
                    let ident = quote::format_ident!("{name}");
                    return self.item_named(symbol, &ident, turbofish, around);
                }
            }
        }
        Ok(Named::Builtin(Builtin { owner: None, path: full, turbofish }))
    }

    /// An associated function or constant, or a variant.
    fn member(
        &mut self,
        ty: &Type,
        name: Symbol,
        ident: &syn::Ident,
        turbofish: Vec<Generic>,
        at: At,
    ) -> Result<Named> {
        if let Type::Struct(definition, arguments) = ty
            && definition.is_enum
            && let Some(variant) = position(definition, &ident.to_string())
        {
            return Ok(Named::Value(constructor(definition.clone(), arguments.clone(), variant)));
        }
        if let Some((implementation, item)) = self.find_function(name, ty) {
            let scope = implementation.scope.clone();
            let owner = Some((implementation, ty.clone()));
            return Ok(Named::Value(Value::Function(Rc::new(Function { item, scope, turbofish, owner }))));
        }
        for implementation in self.implementations.clone().iter().rev() {
            let Some(constant) = implementation.constants.get(&name) else { continue };
            let Some(scope) = self.fitting(implementation, ty) else { continue };
            let scope = Scope::inside(&scope, Names::SelfType(ty.clone(), implementation.self_type.clone()));
            let value = if implementation.generics.params.is_empty() && implementation.self_type.is_some() {
                self.constant_value(constant, &scope)
            } else {
                self.deeper(at, |evaluator| {
                    Ok(evaluator.constant_expression(&constant.expression, &constant.ty, &scope)?)
                })
                .or_else(|flow| self.finished(Err(flow), at))
            };
            return value.map(Named::Value);
        }
        Ok(Named::Builtin(Builtin { owner: Some(ty.clone()), path: vec![ident.to_string()], turbofish }))
    }

    /// The scope of an implementation for a type, or nothing if it is for others.
    pub(super) fn fitting(&mut self, implementation: &Rc<Implementation>, ty: &Type) -> Option<Rc<Scope>> {
        let scope = self.generic_scope(&implementation.generics, &implementation.scope);
        match &implementation.self_type {
            Some(pattern) => self.unify(pattern, ty, &scope).then_some(scope),
            None => {
                // Defaults of a trait: for the types that implement it.
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

    /// The function of a name that is implemented for a type: inherent ones first, then those of
    /// traits.
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
                if self.fitting(implementation, ty).is_some() {
                    return Some((implementation.clone(), implementation.functions[&name].clone()));
                }
            }
        }
        None
    }

    /// The value of a constant or const parameter of a name, if there is one.
    pub(super) fn named_constant(&mut self, ident: &syn::Ident, scope: &Rc<Scope>) -> Result<Option<Value>> {
        let name = self.symbol(ident);
        if let Some(cell) = scope.variable(name) {
            return Ok(Some(cell.borrow().clone()));
        }
        for around in scope.chain() {
            if let Names::Items(items) = &around.names
                && let Some(ValueItem::Constant(constant)) = items.values.get(&name)
            {
                let constant = constant.clone();
                return self.constant_value(&constant, around).map(Some);
            }
        }
        Ok(None)
    }

    /// A value that the macro does not see: a constant of the language, or an opaque one.
    pub(super) fn builtin_value(&mut self, builtin: Builtin, path: &syn::ExprPath) -> Value {
        if let Some(value) = methods::constant(self, &builtin) {
            return value;
        }
        match builtin.path.last() {
            Some(name) if name == "None" => Value::Option(None),
            // A name of the surrounding module: as a value it is more often a constant than a
            // function.
            Some(_)
                if builtin.owner.is_none()
                    && (builtin.path.len() == 1
                        || builtin.path[0] == "crate"
                        || builtin.path[0] == "super")
                    && builtin.path.last().is_some_and(|name| !name.starts_with(char::is_uppercase))
                    && builtin.path.last().is_some_and(|name| name != "from_fn" && name != "identity") =>
            {
                Value::Opaque(Rc::new(path.to_token_stream()))
            }
            // By convention functions and methods are in snake case, constants are not.
            Some(name) if name.chars().any(char::is_lowercase) => Value::Builtin(Rc::new(builtin)),
            _ => Value::Opaque(Rc::new(path.to_token_stream())),
        }
    }
}

fn module(scope: &Rc<Scope>, name: Symbol) -> Option<Rc<Scope>> {
    scope.chain().find_map(|scope| match &scope.names {
        Names::Items(items) => items.modules.get(&name).cloned(),
        _ => None,
    })
}

fn used(scope: &Rc<Scope>, name: Symbol) -> Option<Vec<String>> {
    scope.chain().find_map(|scope| match &scope.names {
        Names::Items(items) => items.uses.get(&name).cloned(),
        _ => None,
    })
}

fn enumeration(scope: &Rc<Scope>, name: Symbol) -> Option<Rc<Definition>> {
    scope.chain().find_map(|scope| match &scope.names {
        Names::Items(items) => match items.types.get(&name) {
            Some(TypeItem::Definition(definition)) if definition.is_enum => Some(definition.clone()),
            _ => None,
        },
        _ => None,
    })
}

/// Index of the variant of a name.
pub fn position(definition: &Definition, name: &str) -> Option<usize> {
    definition.variants.iter().position(|variant| variant.name == name)
}

/// A unit struct or variant, or the constructor of a tuple struct or variant.
fn constructor(definition: Rc<Definition>, arguments: Rc<Vec<Generic>>, variant: usize) -> Value {
    match definition.variants[variant].style {
        Style::Unit => Value::Struct(Rc::new(Struct { definition, variant, fields: Vec::new() })),
        _ => Value::Constructor(Type::Struct(definition, arguments), variant),
    }
}
