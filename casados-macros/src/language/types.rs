//! Types, as far as they are needed: lengths and shapes flow from them into the values.

use super::environment::{Names, Scope};
use super::evaluator::{At, Evaluator, Flow, error, unsupported};
use super::items::{Symbol, TypeItem};
use super::value::{Definition, Generic, Integer, IntegerType, Struct, Value};
use crate::graph::Node;
use quote::quote;
use std::cell::RefCell;
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
    /// An array; of unknown length where it is `_`, or a slice.
    Array(Rc<Type>, Option<usize>),
    /// A struct or enum of the user with its generic arguments.
    Struct(Rc<Definition>, Rc<Vec<Generic>>),
    /// A nalgebra matrix or vector, with the rows and columns that are known.
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
    pub fn part(&self, index: usize) -> Type {
        match self {
            Type::Tuple(parts) => parts.get(index).cloned().unwrap_or_default(),
            _ => Type::Unknown,
        }
    }

    /// A number: what operators hand down to their operands.
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
    /// The type that tokens stand for in a scope. What is not known (type parameters that nothing
    /// has fixed yet, types from outside, `impl Fn`) is `Unknown`: values bring their own.
    pub fn resolve(&mut self, ty: &syn::Type, scope: &Rc<Scope>) -> Result<Type> {
        self.resolve_within(ty, scope, 0)
    }

    fn resolve_within(&mut self, ty: &syn::Type, scope: &Rc<Scope>, depth: usize) -> Result<Type> {
        if depth > 64 {
            return Err(error(&ty, "this type is nested too deeply, or defined in terms of itself"));
        }
        Ok(match ty {
            syn::Type::Array(array) => {
                let element = self.resolve_within(&array.elem, scope, depth + 1)?;
                Type::Array(Rc::new(element), self.length(&array.len, scope)?)
            }
            syn::Type::Slice(slice) => {
                Type::Array(Rc::new(self.resolve_within(&slice.elem, scope, depth + 1)?), None)
            }
            syn::Type::Tuple(tuple) => {
                let mut parts = Vec::with_capacity(tuple.elems.len());
                for part in &tuple.elems {
                    parts.push(self.resolve_within(part, scope, depth + 1)?);
                }
                Type::Tuple(Rc::new(parts))
            }
            syn::Type::Reference(inner) => self.resolve_within(&inner.elem, scope, depth + 1)?,
            syn::Type::Paren(inner) => self.resolve_within(&inner.elem, scope, depth + 1)?,
            syn::Type::Group(inner) => self.resolve_within(&inner.elem, scope, depth + 1)?,
            syn::Type::Path(path) if path.qself.is_none() => {
                self.resolve_path(&path.path, scope, depth + 1)?
            }
            syn::Type::Ptr(_) => return Err(unsupported(&ty, "a raw pointer")),
            _ => Type::Unknown,
        })
    }

    /// The type that a path stands for.
    pub fn resolve_path(&mut self, path: &syn::Path, scope: &Rc<Scope>, depth: usize) -> Result<Type> {
        let Some(last) = path.segments.last() else { return Ok(Type::Unknown) };
        if depth > 64 {
            return Err(error(&path, "this type is nested too deeply, or defined in terms of itself"));
        }
        let mut scope = scope.clone();
        for segment in path.segments.iter().take(path.segments.len() - 1) {
            let name = self.symbol(&segment.ident);
            let module = scope.chain().find_map(|scope| match &scope.names {
                Names::Items(items) => items.modules.get(&name).cloned(),
                _ => None,
            });
            if let Some(module) = module {
                scope = module;
            }
        }
        let symbol = self.symbol(&last.ident);
        let name = last.ident.to_string();
        let mut renamed = None;
        for around in scope.clone().chain() {
            match &around.names {
                Names::SelfType(ty, _) if name == "Self" => return Ok(ty.clone()),
                Names::Types(types) => {
                    if let Some((_, ty)) = types.iter().find(|(parameter, _)| *parameter == symbol) {
                        return Ok(ty.borrow().clone());
                    }
                }
                Names::Items(items) => {
                    match items.types.get(&symbol) {
                        Some(TypeItem::Definition(definition)) => {
                            let arguments = self.generic_arguments(&last.arguments, &scope)?;
                            return Ok(Type::Struct(definition.clone(), Rc::new(arguments)));
                        }
                        Some(TypeItem::Alias(alias)) => {
                            let arguments = self.generic_arguments(&last.arguments, &scope)?;
                            let inner = self.generic_scope(&alias.generics, around);
                            self.bind_turbofish(&alias.generics, &arguments, &inner);
                            return self.resolve_within(&alias.ty, &inner, depth + 1);
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
        let name = renamed.unwrap_or(name);
        Ok(match name.as_str() {
            "f64" => Type::Real,
            "f32" => return Err(error(&path, "models are computed in `f64`: write `f64` instead of `f32`")),
            "bool" => Type::Bool,
            "Option" => {
                let arguments = self.generic_arguments(&last.arguments, &scope)?;
                match arguments.into_iter().next() {
                    Some(Generic::Type(inner)) => Type::Option(Rc::new(inner)),
                    _ => Type::Option(Rc::new(Type::Unknown)),
                }
            }
            "SVector" | "SMatrix" | "RowSVector" | "Matrix" | "OMatrix" => {
                let arguments = self.generic_arguments(&last.arguments, &scope)?;
                let lengths: Vec<_> = arguments
                    .iter()
                    .skip(1)
                    .map(|argument| match argument {
                        Generic::Const(integer) => usize::try_from(integer.value).ok(),
                        Generic::Type(_) => None,
                    })
                    .collect();
                let length = |index: usize| lengths.get(index).copied().flatten();
                match name.as_str() {
                    "SVector" => Type::Matrix(length(0), Some(1)),
                    "RowSVector" => Type::Matrix(Some(1), length(0)),
                    "SMatrix" => Type::Matrix(length(0), length(1)),
                    _ => Type::Matrix(None, None),
                }
            }
            _ => {
                if let Some(ty) = IntegerType::named(&name) {
                    Type::Integer(ty)
                } else if let Some((rows, columns)) = matrix_alias(&name) {
                    Type::Matrix(Some(rows), Some(columns))
                } else {
                    Type::Unknown
                }
            }
        })
    }

    /// The length of an array type; `None` where it is `_` or a parameter that nothing has fixed yet.
    fn length(&mut self, length: &syn::Expr, scope: &Rc<Scope>) -> Result<Option<usize>> {
        if matches!(length, syn::Expr::Infer(_)) {
            return Ok(None);
        }
        let saved = std::mem::replace(&mut self.scope, scope.clone());
        let value = self.expression(length, &Type::Integer(IntegerType::Usize));
        self.scope = saved;
        match self.finished(value, length)? {
            Value::Uninitialised => Ok(None),
            value => self.usize(&value, length).map(Some),
        }
    }

    /// Generic arguments of a path segment, lifetimes left out.
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

    /// Generic arguments, lifetimes left out.
    pub fn turbofish(
        &mut self,
        arguments: &syn::AngleBracketedGenericArguments,
        scope: &Rc<Scope>,
    ) -> Result<Vec<Generic>> {
        let mut generics = Vec::new();
        for argument in &arguments.args {
            match argument {
                syn::GenericArgument::Type(syn::Type::Path(path)) if path.path.get_ident().is_some() => {
                    // `N` may be a type or a constant: syntax does not tell.
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
                    match self.finished(value, expression)? {
                        Value::Integer(integer) => generics.push(Generic::Const(integer)),
                        Value::Bool(value) => {
                            let value = i128::from(value);
                            generics.push(Generic::Const(Integer { value, ty: None }));
                        }
                        Value::Uninitialised => generics.push(Generic::Type(Type::Unknown)),
                        other => {
                            let kind = other.kind();
                            return Err(error(expression, format!("expected an integer, found {kind}")));
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(generics)
    }

    /// A scope in which generic parameters are declared, and not known yet.
    pub fn generic_scope(&mut self, generics: &syn::Generics, parent: &Rc<Scope>) -> Rc<Scope> {
        if generics.params.is_empty() {
            return parent.clone();
        }
        let mut constants = Vec::new();
        let mut types = Vec::new();
        for parameter in &generics.params {
            match parameter {
                syn::GenericParam::Const(parameter) => {
                    let name = self.symbol(&parameter.ident);
                    constants.push((name, Rc::new(RefCell::new(Value::Uninitialised))));
                }
                syn::GenericParam::Type(parameter) => {
                    let name = self.symbol(&parameter.ident);
                    types.push((name, RefCell::new(Type::Unknown)));
                }
                _ => {}
            }
        }
        let scope = Scope::inside(parent, Names::Variables(constants));
        if types.is_empty() { scope } else { Scope::inside(&scope, Names::Types(types)) }
    }

    /// Gives generic parameters their explicit arguments.
    pub fn bind_turbofish(&mut self, generics: &syn::Generics, arguments: &[Generic], scope: &Rc<Scope>) {
        let parameters = generics.params.iter().filter_map(|parameter| match parameter {
            syn::GenericParam::Const(parameter) => Some(&parameter.ident),
            syn::GenericParam::Type(parameter) => Some(&parameter.ident),
            syn::GenericParam::Lifetime(_) => None,
        });
        for (parameter, argument) in parameters.zip(arguments) {
            let name = self.symbol(parameter);
            bind(scope, name, argument);
        }
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
                let arguments = self.bound(&definition.generics, &scope);
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

    /// An error if there is a const parameter that nothing has told.
    pub(super) fn check_known(
        &mut self,
        generics: &syn::Generics,
        scope: &Rc<Scope>,
        name: &syn::Ident,
        at: At,
    ) -> Result<()> {
        for parameter in generics.const_params() {
            let symbol = self.symbol(&parameter.ident);
            if let Some(cell) = scope.variable(symbol)
                && matches!(*cell.borrow(), Value::Uninitialised)
            {
                let parameter = &parameter.ident;
                return Err(error(
                    at,
                    format!(
                        "nothing before this tells `{parameter}`: write the type of the result, or `{name}::<...>(...)`"
                    ),
                ));
            }
        }
        Ok(())
    }

    /// What generic parameters are bound to.
    fn bound(&mut self, generics: &syn::Generics, scope: &Rc<Scope>) -> Vec<Generic> {
        let mut arguments = Vec::new();
        for parameter in &generics.params {
            match parameter {
                syn::GenericParam::Const(parameter) => {
                    let name = self.symbol(&parameter.ident);
                    let value = scope.variable(name).map(|cell| cell.borrow().clone());
                    arguments.push(match value {
                        Some(Value::Integer(integer)) => Generic::Const(integer),
                        _ => Generic::Type(Type::Unknown),
                    });
                }
                syn::GenericParam::Type(parameter) => {
                    let name = self.symbol(&parameter.ident);
                    arguments.push(Generic::Type(parameter_type(scope, name).unwrap_or_default()));
                }
                syn::GenericParam::Lifetime(_) => {}
            }
        }
        arguments
    }

    /// Whether the type can be written like this; generic parameters declared in the scope are bound
    /// on the way. What is not known fits everything.
    pub fn unify(&mut self, pattern: &syn::Type, ty: &Type, scope: &Rc<Scope>) -> bool {
        match (pattern, ty) {
            (syn::Type::Reference(inner), _) => self.unify(&inner.elem, ty, scope),
            (syn::Type::Paren(inner), _) => self.unify(&inner.elem, ty, scope),
            (syn::Type::Group(inner), _) => self.unify(&inner.elem, ty, scope),
            (_, Type::Unknown) => true,
            (syn::Type::Array(array), Type::Array(element, length)) => {
                self.unify(&array.elem, element, scope)
                    && match length {
                        Some(length) => self.unify_length(&array.len, *length, scope),
                        None => true,
                    }
            }
            (syn::Type::Slice(slice), Type::Array(element, _)) => self.unify(&slice.elem, element, scope),
            (syn::Type::Tuple(tuple), Type::Tuple(parts)) => {
                tuple.elems.len() == parts.len()
                    && tuple
                        .elems
                        .iter()
                        .zip(parts.iter())
                        .all(|(pattern, part)| self.unify(pattern, part, scope))
            }
            (syn::Type::Path(path), _) if path.qself.is_none() => {
                self.unify_path(pattern, &path.path, ty, scope)
            }
            (syn::Type::Array(_) | syn::Type::Slice(_) | syn::Type::Tuple(_), _) => false,
            _ => true,
        }
    }

    fn unify_path(&mut self, pattern: &syn::Type, path: &syn::Path, ty: &Type, scope: &Rc<Scope>) -> bool {
        if let Some(name) = path.get_ident() {
            if name == "Self" {
                let written = scope.chain().find_map(|around| match &around.names {
                    Names::SelfType(known, written) => Some((known.clone(), written.clone())),
                    _ => None,
                });
                return match written {
                    Some((_, Some(written))) => self.unify(&written, ty, scope),
                    Some((known, None)) => fits(&known, ty),
                    None => true,
                };
            }
            let name = self.symbol(name);
            if let Some(known) = parameter_type(scope, name) {
                if matches!(known, Type::Unknown) {
                    bind(scope, name, &Generic::Type(ty.clone()));
                    return true;
                }
                return fits(&known, ty);
            }
        }
        let Ok(known) = self.resolve(pattern, scope) else { return false };
        if let (Type::Struct(a, _), Type::Struct(b, arguments)) = (&known, ty) {
            if !Rc::ptr_eq(a, b) {
                return false;
            }
            if let Some(last) = path.segments.last()
                && let syn::PathArguments::AngleBracketed(written) = &last.arguments
            {
                return self.unify_arguments(written, arguments, 0, scope);
            }
            return true;
        }
        if let (Type::Matrix(..), Type::Matrix(rows, columns)) = (&known, ty)
            && let Some(last) = path.segments.last()
            && let syn::PathArguments::AngleBracketed(written) = &last.arguments
            && (last.ident == "SMatrix" || last.ident == "SVector" || last.ident == "RowSVector")
        {
            let length = |length: &Option<usize>| match length {
                Some(length) => Generic::Const(usize_integer(*length)),
                None => Generic::Type(Type::Unknown),
            };
            let arguments = match last.ident.to_string().as_str() {
                "SVector" if *columns == Some(1) => vec![length(rows)],
                "RowSVector" if *rows == Some(1) => vec![length(columns)],
                "SMatrix" => vec![length(rows), length(columns)],
                _ => return false,
            };
            return self.unify_arguments(written, &arguments, 1, scope);
        }
        if let (Type::Option(_), Type::Option(inner)) = (&known, ty)
            && let Some(last) = path.segments.last()
            && let syn::PathArguments::AngleBracketed(written) = &last.arguments
        {
            return self.unify_arguments(written, &[Generic::Type((**inner).clone())], 0, scope);
        }
        fits(&known, ty)
    }

    fn unify_arguments(
        &mut self,
        written: &syn::AngleBracketedGenericArguments,
        arguments: &[Generic],
        skip: usize,
        scope: &Rc<Scope>,
    ) -> bool {
        let written =
            written.args.iter().filter(|argument| !matches!(argument, syn::GenericArgument::Lifetime(_)));
        written.skip(skip).zip(arguments).all(|(written, argument)| match (written, argument) {
            (syn::GenericArgument::Type(pattern), Generic::Type(ty)) => self.unify(pattern, ty, scope),
            (syn::GenericArgument::Type(syn::Type::Path(path)), Generic::Const(integer)) => {
                let expression = syn::Expr::Path(syn::ExprPath {
                    attrs: Vec::new(),
                    qself: None,
                    path: path.path.clone(),
                });
                usize::try_from(integer.value)
                    .is_ok_and(|length| self.unify_length(&expression, length, scope))
            }
            (syn::GenericArgument::Const(expression), Generic::Const(integer)) => {
                usize::try_from(integer.value)
                    .is_ok_and(|length| self.unify_length(expression, length, scope))
            }
            _ => true,
        })
    }

    fn unify_length(&mut self, written: &syn::Expr, length: usize, scope: &Rc<Scope>) -> bool {
        let mut expression = written;
        while let syn::Expr::Block(block) = expression {
            match block.block.stmts.as_slice() {
                [syn::Stmt::Expr(inner, None)] => expression = inner,
                _ => break,
            }
        }
        if let syn::Expr::Path(path) = expression
            && let Some(name) = path.path.get_ident()
        {
            let name = self.symbol(name);
            if let Some(cell) = scope.variable(name)
                && matches!(*cell.borrow(), Value::Uninitialised)
            {
                bind(scope, name, &Generic::Const(usize_integer(length)));
                return true;
            }
        }
        match self.length(expression, scope) {
            Ok(Some(known)) => known == length,
            Ok(None) => true,
            Err(_) => false,
        }
    }

    /// The value as one of the type: opaque constants are taken apart, integers get their type, `&mut`
    /// stays what it is. An error if the shapes do not fit.
    pub fn coerce(&mut self, value: Value, ty: &Type, at: At) -> Result<Value> {
        Ok(match (ty, &value) {
            (Type::Unknown, _) | (_, Value::Reference(_)) => value,
            (Type::Real, Value::Opaque(_)) => Value::Real(self.real(&value, at)?),
            (Type::Integer(ty), Value::Integer(integer)) if integer.ty.is_none() => {
                match super::arithmetic::fit(Some(integer.value), Some(*ty)) {
                    Some(integer) => Value::Integer(integer),
                    None => {
                        let message = format!("{} is out of the range of `{}`", integer.value, ty.name());
                        return Err(error(at, message));
                    }
                }
            }
            (Type::Integer(_), Value::Opaque(_)) => return Err(super::evaluator::opaque(at, "an integer")),
            (Type::Bool, Value::Opaque(_)) => return Err(super::evaluator::opaque(at, "a `bool`")),
            (Type::Array(_, Some(length)), Value::Array(elements)) if *length != elements.len() => {
                let found = elements.len();
                return Err(error(
                    at,
                    format!("expected an array of {length} elements, found one of {found}"),
                ));
            }
            (Type::Array(element, _), Value::Array(elements)) => {
                if elements.iter().all(|element| matches!(element, Value::Real(_))) {
                    return Ok(value);
                }
                let mut result = Vec::with_capacity(elements.len());
                for value in elements.iter() {
                    result.push(self.coerce(value.clone(), element, at)?);
                }
                Value::array(result)
            }
            (Type::Tuple(types), Value::Tuple(parts)) if types.len() == parts.len() => {
                let mut result = Vec::with_capacity(parts.len());
                for (ty, value) in types.iter().zip(parts.iter()) {
                    result.push(self.coerce(value.clone(), ty, at)?);
                }
                Value::tuple(result)
            }
            (Type::Matrix(rows, columns), Value::Matrix(matrix)) => {
                if rows.is_some_and(|rows| rows != matrix.rows)
                    || columns.is_some_and(|columns| columns != matrix.columns)
                {
                    let (r, c) = (matrix.rows, matrix.columns);
                    return Err(error(
                        at,
                        format!("this matrix is {r}x{c}, which is not the expected shape"),
                    ));
                }
                value
            }
            (Type::Option(inner), Value::Option(Some(content))) => {
                let content = (**content).clone();
                Value::some(self.coerce(content, inner, at)?)
            }
            (
                Type::Array(_, Some(_)) | Type::Tuple(_) | Type::Matrix(Some(_), Some(_)) | Type::Struct(..),
                Value::Opaque(tokens),
            ) => self.take_apart(tokens, ty, at)?,
            _ => value,
        })
    }

    /// An opaque constant of a known shape, as a value of opaque parts.
    fn take_apart(&mut self, tokens: &proc_macro2::TokenStream, ty: &Type, at: At) -> Result<Value> {
        match ty {
            Type::Real => self.real(&Value::Opaque(Rc::new(tokens.clone())), at).map(Value::Real),
            Type::Array(element, Some(length)) => {
                self.tick(*length, at)?;
                let part = |index: usize| {
                    let index = proc_macro2::Literal::usize_unsuffixed(index);
                    quote!(#tokens[#index])
                };
                (0..*length)
                    .map(|index| self.take_apart(&part(index), element, at))
                    .collect::<Result<_>>()
                    .map(Value::array)
            }
            Type::Tuple(parts) => {
                let part = |index: usize| {
                    let index = proc_macro2::Literal::usize_unsuffixed(index);
                    quote!(#tokens.#index)
                };
                let parts = parts.iter().enumerate();
                parts
                    .map(|(index, ty)| self.take_apart(&part(index), ty, at))
                    .collect::<Result<_>>()
                    .map(Value::tuple)
            }
            Type::Matrix(Some(rows), Some(columns)) => {
                self.tick(rows.saturating_mul(*columns), at)?;
                let part = |index: usize| {
                    let index = proc_macro2::Literal::usize_unsuffixed(index);
                    quote!(#tokens[#index])
                };
                let elements: Result<_> =
                    (0..rows * columns).map(|index| self.take_apart(&part(index), &Type::Real, at)).collect();
                Ok(Value::matrix(*rows, *columns, elements?))
            }
            Type::Struct(definition, arguments) if !definition.is_enum => {
                let types = self.field_types(definition, 0, arguments)?;
                let mut fields = Vec::new();
                for ((name, _), ty) in definition.variants[0].fields.iter().zip(&types) {
                    let part = match name.parse::<usize>() {
                        Ok(index) => {
                            let index = proc_macro2::Literal::usize_unsuffixed(index);
                            quote!(#tokens.#index)
                        }
                        Err(_) => {
                            let name = quote::format_ident!("{name}");
                            quote!(#tokens.#name)
                        }
                    };
                    fields.push(self.take_apart(&part, ty, at)?);
                }
                Ok(Value::Struct(Rc::new(Struct { definition: definition.clone(), variant: 0, fields })))
            }
            _ => Err(super::evaluator::opaque(at, "a value of this type")),
        }
    }

    /// Types of the fields of a struct or variant.
    pub fn field_types(
        &mut self,
        definition: &Rc<Definition>,
        variant: usize,
        arguments: &[Generic],
    ) -> Result<Vec<Type>> {
        let scope = self.generic_scope(&definition.generics, &definition.scope());
        self.bind_turbofish(&definition.generics, arguments, &scope);
        definition.variants[variant].fields.iter().map(|(_, ty)| self.resolve(ty, &scope)).collect()
    }

    /// A value of the type, whose numbers are made by `leaf` from their names (`name[3].position`).
    pub fn instantiate(
        &mut self,
        ty: &Type,
        name: String,
        leaf: &mut dyn FnMut(&mut Evaluator, String) -> Result<Node>,
        at: At,
    ) -> Result<Value> {
        self.deeper(at, |evaluator| evaluator.instantiate_within(ty, name, leaf, at).map_err(Flow::from))
            .map_err(|flow| match flow {
                Flow::Error(error) => error,
                _ => error(at, "this type has no end"),
            })
    }

    fn instantiate_within(
        &mut self,
        ty: &Type,
        name: String,
        leaf: &mut dyn FnMut(&mut Evaluator, String) -> Result<Node>,
        at: At,
    ) -> Result<Value> {
        match ty {
            Type::Real => Ok(Value::Real(leaf(self, name)?)),
            Type::Array(element, Some(length)) => {
                let mut elements = Vec::new();
                for index in 0..*length {
                    elements.push(self.instantiate(element, format!("{name}[{index}]"), leaf, at)?);
                }
                Ok(Value::array(elements))
            }
            Type::Matrix(Some(rows), Some(columns)) => {
                let mut elements = Vec::new();
                for column in 0..*columns {
                    for row in 0..*rows {
                        let name = if *columns == 1 {
                            format!("{name}[{row}]")
                        } else {
                            format!("{name}[({row}, {column})]")
                        };
                        self.tick(1, at)?;
                        elements.push(Value::Real(leaf(self, name)?));
                    }
                }
                Ok(Value::matrix(*rows, *columns, elements))
            }
            Type::Tuple(parts) => {
                let mut elements = Vec::new();
                for (index, part) in parts.iter().enumerate() {
                    elements.push(self.instantiate(part, format!("{name}.{index}"), leaf, at)?);
                }
                Ok(Value::tuple(elements))
            }
            Type::Struct(definition, arguments) if !definition.is_enum => {
                let types = self.field_types(definition, 0, arguments)?;
                let mut fields = Vec::new();
                for ((field, _), ty) in definition.variants[0].fields.iter().zip(&types) {
                    fields.push(self.instantiate(ty, format!("{name}.{field}"), leaf, at)?);
                }
                Ok(Value::Struct(Rc::new(Struct { definition: definition.clone(), variant: 0, fields })))
            }
            Type::Unknown | Type::Array(_, None) | Type::Matrix(..) => Err(error(
                at,
                format!(
                    "the type of `{name}` is not visible to the macro: use `f64`, arrays, tuples, nalgebra vectors \
                     and matrices, or structs that are defined in the same `#[dae] mod`"
                ),
            )),
            _ => Err(error(at, format!("`{name}` must consist of `f64` values"))),
        }
    }
}

fn usize_integer(value: usize) -> Integer {
    Integer { value: value as i128, ty: Some(IntegerType::Usize) }
}

/// What a type parameter is bound to, if there is one of that name.
fn parameter_type(scope: &Rc<Scope>, name: Symbol) -> Option<Type> {
    scope.chain().find_map(|scope| match &scope.names {
        Names::Types(types) => {
            types.iter().find(|(parameter, _)| *parameter == name).map(|(_, ty)| ty.borrow().clone())
        }
        _ => None,
    })
}

/// Binds a generic parameter.
fn bind(scope: &Rc<Scope>, name: Symbol, argument: &Generic) {
    match argument {
        Generic::Const(integer) => {
            if let Some(cell) = scope.variable(name) {
                cell.replace(Value::Integer(*integer));
            }
        }
        Generic::Type(ty) => {
            for scope in scope.chain() {
                if let Names::Types(types) = &scope.names
                    && let Some((_, slot)) = types.iter().find(|(parameter, _)| *parameter == name)
                {
                    slot.replace(ty.clone());
                    return;
                }
            }
        }
    }
}

/// Whether two types may be the same, as far as they are known.
fn fits(a: &Type, b: &Type) -> bool {
    match (a, b) {
        (Type::Unknown, _) | (_, Type::Unknown) => true,
        (Type::Real, Type::Real) | (Type::Bool, Type::Bool) => true,
        (Type::Integer(a), Type::Integer(b)) => a == b,
        (Type::Tuple(a), Type::Tuple(b)) => {
            a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| fits(a, b))
        }
        (Type::Array(a, n), Type::Array(b, m)) => fits(a, b) && (n.is_none() || m.is_none() || n == m),
        (Type::Struct(a, x), Type::Struct(b, y)) => {
            Rc::ptr_eq(a, b)
                && x.iter().zip(y.iter()).all(|(x, y)| match (x, y) {
                    (Generic::Type(x), Generic::Type(y)) => fits(x, y),
                    (Generic::Const(x), Generic::Const(y)) => x.value == y.value,
                    _ => true,
                })
        }
        (Type::Matrix(r, c), Type::Matrix(s, d)) => {
            (r.is_none() || s.is_none() || r == s) && (c.is_none() || d.is_none() || c == d)
        }
        (Type::Option(a), Type::Option(b)) => fits(a, b),
        _ => false,
    }
}
