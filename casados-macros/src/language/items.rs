//! Items in the macro's input: functions, constants, types, `impl` blocks, `use`.

use super::environment::{Names, Scope};
use super::evaluator::{Evaluator, error, unsupported};
use super::modules::{Module, module_of, module_path};
use super::units;
use super::value::{Definition, Style, Value, Variant};
use std::cell::{OnceCell, RefCell};
use std::collections::HashMap;
use std::rc::Rc;
use syn::Result;

/// An interned name.
pub type Symbol = u32;

/// The items of a block or module.
#[derive(Debug, Default)]
pub struct Items {
    /// Functions and constants.
    pub values: HashMap<Symbol, ValueItem>,
    /// Structs, enums and aliases.
    pub types: HashMap<Symbol, TypeItem>,
    /// Nested modules.
    pub modules: HashMap<Symbol, Rc<Scope>>,
    /// `use` of single names.
    pub uses: HashMap<Symbol, Vec<String>>,
    /// Glob imports.
    pub globs: Vec<Vec<String>>,
    /// The module; nothing for a block.
    pub module: Option<Module>,
}

/// The value item of a name.
#[derive(Clone, Debug)]
pub enum ValueItem {
    /// A function.
    Function(Rc<syn::ItemFn>),
    /// A `const` or `static`.
    Constant(Rc<Constant>),
}

/// The type item of a name.
#[derive(Clone, Debug)]
pub enum TypeItem {
    /// A struct or enum.
    Definition(Rc<Definition>),
    /// A type alias.
    Alias(Rc<syn::ItemType>),
}

/// A `const` or `static`, evaluated on first use.
#[derive(Debug)]
pub struct Constant {
    /// Its name, for errors.
    pub name: syn::Ident,
    /// Its type.
    pub ty: syn::Type,
    /// Its expression.
    pub expression: syn::Expr,
    /// Its value.
    pub state: RefCell<State>,
}

/// The progress of the evaluation of a constant.
#[derive(Clone, Debug)]
pub enum State {
    /// Not evaluated.
    Written,
    /// In evaluation: a use is a cycle.
    Begun,
    /// Evaluated.
    Done(Value),
}

impl Evaluator {
    /// The index of a name.
    pub fn symbol(&mut self, name: &syn::Ident) -> Symbol {
        self.symbol_of(&name.to_string())
    }

    /// The index of a name.
    pub fn symbol_of(&mut self, name: &str) -> Symbol {
        if let Some(&symbol) = self.symbols.get(name) {
            return symbol;
        }
        let symbol = self.symbols.len() as Symbol;
        self.symbols.insert(name.to_owned(), symbol);
        symbol
    }

    /// The scope of a module; registers its `impl` blocks.
    pub fn module<'a>(
        &mut self,
        items: impl Iterator<Item = &'a syn::Item> + Clone,
        module: Module,
    ) -> Result<Rc<Scope>> {
        // A module does not see the items around it.
        self.declare_items(items, &Rc::default(), Some(module))
    }

    /// The scope of the items of a block; registers its `impl` blocks.
    pub fn items<'a>(
        &mut self,
        items: impl Iterator<Item = &'a syn::Item> + Clone,
        parent: &Rc<Scope>,
    ) -> Result<Rc<Scope>> {
        self.declare_items(items, parent, None)
    }

    fn declare_items<'a>(
        &mut self,
        items: impl Iterator<Item = &'a syn::Item> + Clone,
        parent: &Rc<Scope>,
        module: Option<Module>,
    ) -> Result<Rc<Scope>> {
        let mut names = Items { module, ..Items::default() };
        let mut definitions = Vec::new();
        for item in items.clone() {
            self.item(item, parent, &mut names, &mut definitions)?;
        }
        let scope = Scope::child_scope(parent, Names::Items(Box::new(names)));
        if let Names::Items(names) = &scope.names
            && let Some(around) = module_of(&scope)
        {
            for inner in names.modules.values() {
                if let Names::Items(inner) = &inner.names
                    && let Some(module) = &inner.module
                {
                    let _ = module.around.set(Rc::downgrade(around));
                }
            }
        }
        for item in items.clone() {
            if let syn::Item::Use(item) = item
                && !self.is_local(&item.tree, &scope)
                && let Some(item) = self.emitted_use(item, &scope)
                && !self.uses.contains(&item)
            {
                self.uses.push(item);
            }
        }
        for definition in definitions {
            let _ = definition.scope.set(Rc::downgrade(&scope));
        }
        self.scopes.push(scope.clone());
        for item in items {
            match item {
                syn::Item::Impl(item) => self.register_impl(item, &scope),
                syn::Item::Trait(item) => self.defaults(item, &scope),
                _ => {}
            }
        }
        Ok(scope)
    }

    fn item(
        &mut self,
        item: &syn::Item,
        parent: &Rc<Scope>,
        names: &mut Items,
        definitions: &mut Vec<Rc<Definition>>,
    ) -> Result<()> {
        match item {
            syn::Item::Fn(item) => {
                let name = self.symbol(&item.sig.ident);
                names.values.insert(name, ValueItem::Function(Rc::new(item.clone())));
            }
            syn::Item::Const(item) => {
                let name = self.symbol(&item.ident);
                let constant = constant(&item.ident, &item.ty, &item.expr);
                names.values.insert(name, ValueItem::Constant(constant));
            }
            syn::Item::Static(item) => {
                if let syn::StaticMutability::Mut(token) = &item.mutability {
                    return Err(unsupported(token, "a mutable static"));
                }
                let name = self.symbol(&item.ident);
                let constant = constant(&item.ident, &item.ty, &item.expr);
                names.values.insert(name, ValueItem::Constant(constant));
            }
            syn::Item::Struct(item) => {
                let name = item.ident.to_string();
                let definition = Rc::new(Definition {
                    name: name.clone(),
                    is_enum: false,
                    variants: vec![variant(name, &item.fields, None)],
                    generics: item.generics.clone(),
                    scope: OnceCell::new(),
                });
                definitions.push(definition.clone());
                let name = self.symbol(&item.ident);
                names.types.insert(name, TypeItem::Definition(definition));
            }
            syn::Item::Enum(item) => {
                let variants = item.variants.iter().map(|entry| {
                    let discriminant = entry.discriminant.as_ref().map(|(_, value)| value.clone());
                    variant(entry.ident.to_string(), &entry.fields, discriminant)
                });
                let definition = Rc::new(Definition {
                    name: item.ident.to_string(),
                    is_enum: true,
                    variants: variants.collect(),
                    generics: item.generics.clone(),
                    scope: OnceCell::new(),
                });
                definitions.push(definition.clone());
                let name = self.symbol(&item.ident);
                names.types.insert(name, TypeItem::Definition(definition));
            }
            syn::Item::Type(item) => {
                let name = self.symbol(&item.ident);
                names.types.insert(name, TypeItem::Alias(Rc::new(item.clone())));
            }
            syn::Item::Mod(item) => {
                let Some((_, content)) = &item.content else {
                    return Err(unsupported(item, "a module in another file"));
                };
                let around =
                    names.module.as_ref().map_or_else(|| module_path(parent), |module| &module.names);
                let path = around.iter().cloned().chain([item.ident.to_string()]).collect();
                let scope = self.module(content.iter(), Module { names: path, ..Module::default() })?;
                let name = self.symbol(&item.ident);
                names.modules.insert(name, scope);
            }
            syn::Item::Use(item) => {
                self.use_tree(&item.tree, &mut Vec::new(), names);
            }
            syn::Item::Impl(_) | syn::Item::Trait(_) => {}
            other => return Err(unsupported(other, "an item of this kind in a model")),
        }
        Ok(())
    }

    fn use_tree(&mut self, tree: &syn::UseTree, path: &mut Vec<String>, names: &mut Items) {
        match tree {
            syn::UseTree::Path(tree) => {
                path.push(tree.ident.to_string());
                self.use_tree(&tree.tree, path, names);
                path.pop();
            }
            syn::UseTree::Name(tree) if tree.ident == "self" => {
                if let Some(last) = path.last().cloned() {
                    let symbol = self.symbol_of(&last);
                    names.uses.insert(symbol, path.clone());
                }
            }
            syn::UseTree::Name(tree) => {
                let symbol = self.symbol(&tree.ident);
                let full = path.iter().cloned().chain([tree.ident.to_string()]).collect();
                names.uses.insert(symbol, full);
            }
            syn::UseTree::Rename(tree) => {
                let symbol = self.symbol(&tree.rename);
                let mut full = path.clone();
                if tree.ident != "self" {
                    full.push(tree.ident.to_string());
                }
                names.uses.insert(symbol, full);
            }
            syn::UseTree::Glob(_) => names.globs.push(path.clone()),
            syn::UseTree::Group(tree) => {
                for tree in &tree.items {
                    self.use_tree(tree, path, names);
                }
            }
        }
    }

    /// Whether a `use` refers to an item in the macro's input, which generated code does not need.
    fn is_local(&mut self, tree: &syn::UseTree, scope: &Rc<Scope>) -> bool {
        let syn::UseTree::Path(tree) = tree else { return false };
        let first = self.symbol(&tree.ident);
        scope.enclosing_scopes().any(|scope| match &scope.names {
            Names::Items(items) => items.types.contains_key(&first) || items.modules.contains_key(&first),
            _ => false,
        })
    }

    /// The value of a constant, evaluated in its own scope.
    pub fn constant_value(&mut self, constant: &Constant, scope: &Rc<Scope>) -> Result<Value> {
        let state = constant.state.borrow().clone();
        match state {
            State::Done(value) => return Ok(value),
            State::Begun => {
                return Err(error(&constant.name, "this constant is defined in terms of itself"));
            }
            State::Written => {}
        }
        *constant.state.borrow_mut() = State::Begun;
        let value = self.constant_expression(&constant.expression, &constant.ty, scope);
        *constant.state.borrow_mut() = match &value {
            Ok(value) => State::Done(value.clone()),
            Err(_) => State::Written,
        };
        value
    }

    /// Evaluates a constant expression of a type in a scope.
    pub fn constant_expression(
        &mut self,
        expression: &syn::Expr,
        ty: &syn::Type,
        scope: &Rc<Scope>,
    ) -> Result<Value> {
        let ty = self.resolve(ty, scope)?;
        let saved = std::mem::replace(&mut self.scope, scope.clone());
        let value = self.expression(expression, &ty);
        self.scope = saved;
        let value = self.require_value(value, expression)?;
        self.coerce(value, &ty, expression)
    }
}

pub(super) fn constant(name: &syn::Ident, ty: &syn::Type, expression: &syn::Expr) -> Rc<Constant> {
    Rc::new(Constant {
        name: name.clone(),
        ty: ty.clone(),
        expression: expression.clone(),
        state: RefCell::new(State::Written),
    })
}

fn variant(name: String, fields: &syn::Fields, discriminant: Option<syn::Expr>) -> Variant {
    let style = match fields {
        syn::Fields::Named(_) => Style::Named,
        syn::Fields::Unnamed(_) => Style::Tuple,
        syn::Fields::Unit => Style::Unit,
    };
    let units = fields.iter().map(|field| units::of_attributes(&field.attrs)).collect();
    let fields = fields.iter().enumerate().map(|(index, field)| {
        let name = field.ident.as_ref().map_or_else(|| index.to_string(), ToString::to_string);
        (name, field.ty.clone())
    });
    Variant { name, fields: fields.collect(), units, style, discriminant }
}
