//! Types, as far as they are needed: lengths and shapes, which determine values.

use super::environment::{Names, Scope};
use super::evaluator::{Evaluator, error, unsupported};
use super::items::TypeItem;
use super::modules::PathTarget;
use super::value::{Definition, Generic, Integer, IntegerType, Value};
use quote::quote;
use std::rc::Rc;
use syn::Result;

/// A type. References are transparent.
#[derive(Clone, Debug, Default)]
pub enum Type {
    /// To be inferred.
    #[default]
    Unknown,
    /// `f64`
    Real,
    /// An integer type.
    Integer(IntegerType),
    /// `bool`
    Bool,
    /// A tuple; the empty one is `()`.
    Tuple(Rc<Vec<Type>>),
    /// An array; its length is unknown for `_` and slices.
    Array(Rc<Type>, Option<usize>),
    /// A struct or enum of the user with its generic arguments.
    Struct(Rc<Definition>, Rc<Vec<Generic>>),
    /// A nalgebra matrix or vector, with its known numbers of rows and columns.
    Matrix(Option<usize>, Option<usize>),
    /// An `Option`.
    Option(Rc<Type>),
}

impl Type {
    /// The type of elements, if it has any.
    pub fn element(&self) -> Type {
        match self {
            Type::Array(element, _) | Type::Option(element) => (**element).clone(),
            Type::Matrix(..) => Type::Real,
            _ => Type::Unknown,
        }
    }

    /// The type of a tuple's element.
    pub fn tuple_element(&self, index: usize) -> Type {
        match self {
            Type::Tuple(parts) => parts.get(index).cloned().unwrap_or_default(),
            _ => Type::Unknown,
        }
    }

    /// The type of a number, which operators pass to their operands.
    pub fn scalar(&self) -> Type {
        match self {
            Type::Real | Type::Integer(_) => self.clone(),
            _ => Type::Unknown,
        }
    }
}

/// Shapes of nalgebra's aliases, by name: `Vector3`, `Matrix2x4`, `RowVector2`.
fn matrix_alias(name: &str) -> Option<(usize, usize)> {
    let digit = |text: &str| text.parse::<usize>().ok().filter(|n| (1..=6).contains(n) && text.len() == 1);
    if let Some(rest) = name.strip_prefix("RowVector") {
        return Some((1, digit(rest)?));
    }
    if let Some(rest) = name.strip_prefix("Vector") {
        return Some((digit(rest)?, 1));
    }
    let rest = name.strip_prefix("Matrix")?;
    match rest.split_once('x') {
        Some((rows, columns)) => Some((digit(rows)?, digit(columns)?)),
        None => digit(rest).map(|n| (n, n)),
    }
}

impl Evaluator {
    /// The type of tokens in a scope. Unknown types (unbound type parameters, types from outside,
    /// `impl Fn`) are `Unknown`: values determine them.
    pub fn resolve(&mut self, ty: &syn::Type, scope: &Rc<Scope>) -> Result<Type> {
        self.resolve_nested(ty, scope, 0)
    }

    fn resolve_nested(&mut self, ty: &syn::Type, scope: &Rc<Scope>, depth: usize) -> Result<Type> {
        if depth > 64 {
            return Err(error(&ty, "this type is nested too deeply, or defined in terms of itself"));
        }
        Ok(match ty {
            syn::Type::Array(array) => {
                let element = self.resolve_nested(&array.elem, scope, depth + 1)?;
                Type::Array(Rc::new(element), self.length(&array.len, scope)?)
            }
            syn::Type::Slice(slice) => {
                Type::Array(Rc::new(self.resolve_nested(&slice.elem, scope, depth + 1)?), None)
            }
            syn::Type::Tuple(tuple) => {
                let mut parts = Vec::with_capacity(tuple.elems.len());
                for part in &tuple.elems {
                    parts.push(self.resolve_nested(part, scope, depth + 1)?);
                }
                Type::Tuple(Rc::new(parts))
            }
            syn::Type::Reference(inner) => self.resolve_nested(&inner.elem, scope, depth + 1)?,
            syn::Type::Paren(inner) => self.resolve_nested(&inner.elem, scope, depth + 1)?,
            syn::Type::Group(inner) => self.resolve_nested(&inner.elem, scope, depth + 1)?,
            syn::Type::Path(path) if path.qself.is_none() => {
                self.resolve_path(&path.path, scope, depth + 1)?
            }
            syn::Type::Ptr(_) => return Err(unsupported(&ty, "a raw pointer")),
            _ => Type::Unknown,
        })
    }

    /// The type of a path.
    pub fn resolve_path(&mut self, path: &syn::Path, scope: &Rc<Scope>, depth: usize) -> Result<Type> {
        let Some(last) = path.segments.last() else { return Ok(Type::Unknown) };
        if depth > 64 {
            return Err(error(&path, "this type is nested too deeply, or defined in terms of itself"));
        }
        let symbol = self.symbol(&last.ident);
        let name = last.ident.to_string();
        let modules: Vec<_> = path
            .segments
            .iter()
            .take(path.segments.len() - 1)
            .map(|module| module.ident.to_string())
            .collect();
        let place = match self.resolve_module_path(&modules, scope, &mut Vec::new()) {
            PathTarget::Module(module) => module,
            PathTarget::Elsewhere if modules.is_empty() => scope.clone(),
            // Types in modules outside of the macro's input are not the user's own.
            PathTarget::Elsewhere => return self.resolve_builtin_type(path, last, &name, scope),
        };
        let mut renamed = None;
        for around in place.enclosing_scopes() {
            match &around.names {
                Names::SelfType(ty, _) if name == "Self" => return Ok(ty.clone()),
                Names::Types(types) => {
                    if let Some((_, ty)) = types.iter().find(|(parameter, _)| *parameter == symbol) {
                        return Ok(ty.borrow().clone());
                    }
                }
                Names::Items(items) => {
                    match self.type_in(symbol, around, &mut Vec::new()) {
                        Some((TypeItem::Definition(definition), _)) => {
                            let arguments = self.generic_arguments(&last.arguments, scope)?;
                            return Ok(Type::Struct(definition, Rc::new(arguments)));
                        }
                        Some((TypeItem::Alias(alias), around)) => {
                            let arguments = self.generic_arguments(&last.arguments, scope)?;
                            let inner = self.generic_scope(&alias.generics, &around);
                            self.bind_turbofish(&alias.generics, &arguments, &inner);
                            return self.resolve_nested(&alias.ty, &inner, depth + 1);
                        }
                        None => {}
                    }
                    if let Some(full) = items.uses.get(&symbol) {
                        renamed = full.last().cloned();
                    }
                }
                _ => {}
            }
        }
        self.resolve_builtin_type(path, last, &renamed.unwrap_or(name), scope)
    }

    /// The type of a name of the language, or of nalgebra.
    fn resolve_builtin_type(
        &mut self,
        path: &syn::Path,
        last: &syn::PathSegment,
        name: &str,
        scope: &Rc<Scope>,
    ) -> Result<Type> {
        Ok(match name {
            "f64" => Type::Real,
            "f32" => return Err(error(path, "models are computed in `f64`: write `f64` instead of `f32`")),
            "bool" => Type::Bool,
            "Option" => {
                let arguments = self.generic_arguments(&last.arguments, scope)?;
                match arguments.into_iter().next() {
                    Some(Generic::Type(inner)) => Type::Option(Rc::new(inner)),
                    _ => Type::Option(Rc::new(Type::Unknown)),
                }
            }
            "SVector" | "SMatrix" | "RowSVector" | "Matrix" | "OMatrix" => {
                let arguments = self.generic_arguments(&last.arguments, scope)?;
                let lengths: Vec<_> = arguments
                    .iter()
                    .skip(1)
                    .map(|argument| match argument {
                        Generic::Const(integer) => usize::try_from(integer.value).ok(),
                        Generic::Type(_) => None,
                    })
                    .collect();
                let length = |index: usize| lengths.get(index).copied().flatten();
                match name {
                    "SVector" => Type::Matrix(length(0), Some(1)),
                    "RowSVector" => Type::Matrix(Some(1), length(0)),
                    "SMatrix" => Type::Matrix(length(0), length(1)),
                    _ => Type::Matrix(None, None),
                }
            }
            _ => {
                if name == "u128" {
                    return Err(error(
                        last,
                        "a model has no `u128`, whose values exceed `i128`: write `f64` or `i128`",
                    ));
                } else if let Some(ty) = IntegerType::by_name(name) {
                    Type::Integer(ty)
                } else if let Some((rows, columns)) = matrix_alias(name) {
                    Type::Matrix(Some(rows), Some(columns))
                } else {
                    Type::Unknown
                }
            }
        })
    }

    /// The length of an array type; `None` for `_` or an unbound parameter.
    pub(super) fn length(&mut self, length: &syn::Expr, scope: &Rc<Scope>) -> Result<Option<usize>> {
        if matches!(length, syn::Expr::Infer(_)) {
            return Ok(None);
        }
        let saved = std::mem::replace(&mut self.scope, scope.clone());
        let value = self.expression(length, &Type::Integer(IntegerType::Usize));
        self.scope = saved;
        match self.require_value(value, length)? {
            Value::Uninitialised => Ok(None),
            value => self.usize(&value, length).map(Some),
        }
    }

    /// The generic arguments of a path segment, without lifetimes.
    pub fn generic_arguments(
        &mut self,
        arguments: &syn::PathArguments,
        scope: &Rc<Scope>,
    ) -> Result<Vec<Generic>> {
        match arguments {
            syn::PathArguments::AngleBracketed(arguments) => self.turbofish(arguments, scope),
            _ => Ok(Vec::new()),
        }
    }

    /// Generic arguments, without lifetimes.
    pub fn turbofish(
        &mut self,
        arguments: &syn::AngleBracketedGenericArguments,
        scope: &Rc<Scope>,
    ) -> Result<Vec<Generic>> {
        let mut generics = Vec::new();
        for argument in &arguments.args {
            match argument {
                syn::GenericArgument::Type(syn::Type::Path(path)) if path.path.get_ident().is_some() => {
                    // `N` may be a type or a constant, with the same syntax.
                    let ty = self.resolve_path(&path.path, scope, 0)?;
                    let constant = match (&ty, path.path.get_ident()) {
                        (Type::Unknown, Some(name)) => self.named_constant(name, scope)?,
                        _ => None,
                    };
                    generics.push(match constant {
                        Some(Value::Integer(integer)) => Generic::Const(integer),
                        _ => Generic::Type(ty),
                    });
                }
                syn::GenericArgument::Type(ty) => generics.push(Generic::Type(self.resolve(ty, scope)?)),
                syn::GenericArgument::Const(expression) => {
                    let saved = std::mem::replace(&mut self.scope, scope.clone());
                    let value = self.expression(expression, &Type::Unknown);
                    self.scope = saved;
                    match self.require_value(value, expression)? {
                        Value::Integer(integer) => generics.push(Generic::Const(integer)),
                        Value::Bool(value) => {
                            let value = i128::from(value);
                            generics.push(Generic::Const(Integer { value, ty: None }));
                        }
                        Value::Uninitialised => generics.push(Generic::Type(Type::Unknown)),
                        other => {
                            let kind = other.description();
                            return Err(error(expression, format!("expected an integer, found {kind}")));
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(generics)
    }

    /// The type of a value.
    pub fn type_of(&mut self, value: &Value) -> Type {
        match value {
            Value::Real(_) => Type::Real,
            Value::Integer(Integer { ty: Some(ty), .. }) => Type::Integer(*ty),
            Value::Bool(_) | Value::Condition(_) => Type::Bool,
            Value::Tuple(parts) => {
                Type::Tuple(Rc::new(parts.iter().map(|part| self.type_of(part)).collect()))
            }
            Value::Array(elements) => {
                let element = elements.first().map(|element| self.type_of(element)).unwrap_or_default();
                Type::Array(Rc::new(element), Some(elements.len()))
            }
            Value::Matrix(matrix) => Type::Matrix(Some(matrix.rows), Some(matrix.columns)),
            Value::Option(inner) => {
                let inner = inner.as_ref().map(|inner| self.type_of(inner)).unwrap_or_default();
                Type::Option(Rc::new(inner))
            }
            Value::Struct(structure) => {
                let definition = structure.definition.clone();
                if definition.generics.params.is_empty() {
                    return Type::Struct(definition, Rc::new(Vec::new()));
                }
                let scope = self.generic_scope(&definition.generics, &definition.scope());
                for ((_, ty), field) in
                    definition.variants[structure.variant].fields.iter().zip(&structure.fields)
                {
                    let field = self.type_of(field);
                    self.unify(ty, &field, &scope);
                }
                let arguments = self.bound_arguments(&definition.generics, &scope);
                Type::Struct(definition, Rc::new(arguments))
            }
            Value::Reference(place) => {
                let place = place.clone();
                match self.read(&place, &quote!()) {
                    Ok(value) => self.type_of(&value),
                    Err(_) => Type::Unknown,
                }
            }
            _ => Type::Unknown,
        }
    }
}
