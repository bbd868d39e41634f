//! Generic parameters: declared in a scope, bound to their arguments, inferred from the types of
//! values.

use super::environment::{Names, Scope};
use super::evaluator::{Evaluator, Flow, TokenSpan, error};
use super::items::Symbol;
use super::label::Label;
use super::types::Type;
use super::value::{Definition, Generic, Integer, IntegerType, Struct, Value, Variant};
use crate::graph::Node;
use std::cell::RefCell;
use std::rc::Rc;
use syn::Result;

impl Evaluator {
    /// A scope that declares generic parameters, unbound.
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
        let scope = Scope::child_scope(parent, Names::Variables(constants));
        if types.is_empty() { scope } else { Scope::child_scope(&scope, Names::Types(types)) }
    }

    /// Binds generic parameters to explicit arguments.
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

    /// Rejects const parameters that are not determined.
    pub(super) fn check_known(
        &mut self,
        generics: &syn::Generics,
        scope: &Rc<Scope>,
        name: &syn::Ident,
        at: TokenSpan,
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
                        "`{parameter}` cannot be inferred: write the type of the result, or `{name}::<...>(...)`"
                    ),
                ));
            }
        }
        Ok(())
    }

    /// The arguments of generic parameters.
    pub(super) fn bound_arguments(&mut self, generics: &syn::Generics, scope: &Rc<Scope>) -> Vec<Generic> {
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

    /// Whether a type matches a pattern; binds generic parameters of the scope. Unknown types match
    /// everything.
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
                let written = scope.enclosing_scopes().find_map(|around| match &around.names {
                    Names::SelfType(known, written) => Some((known.clone(), written.clone())),
                    _ => None,
                });
                return match written {
                    Some((_, Some(written))) => self.unify(&written, ty, scope),
                    Some((known, None)) => may_be_equal(&known, ty),
                    None => true,
                };
            }
            let name = self.symbol(name);
            if let Some(known) = parameter_type(scope, name) {
                if matches!(known, Type::Unknown) {
                    bind(scope, name, &Generic::Type(ty.clone()));
                    return true;
                }
                return may_be_equal(&known, ty);
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
        may_be_equal(&known, ty)
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

    /// The types of the fields of a struct or variant.
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

    /// A value of the type whose numbers `leaf` creates from their names (`name[3].position`).
    pub fn instantiate(
        &mut self,
        ty: &Type,
        label: Label,
        leaf: &mut dyn FnMut(&mut Evaluator, Label) -> Result<Node>,
        at: TokenSpan,
    ) -> Result<Value> {
        self.deeper(at, |evaluator| evaluator.instantiate_nested(ty, label, leaf, at).map_err(Flow::from))
            .map_err(|flow| match flow {
                Flow::Error(error) => error,
                _ => error(at, "this type has no end"),
            })
    }

    fn instantiate_nested(
        &mut self,
        ty: &Type,
        label: Label,
        leaf: &mut dyn FnMut(&mut Evaluator, Label) -> Result<Node>,
        at: TokenSpan,
    ) -> Result<Value> {
        match ty {
            Type::Real => Ok(Value::Real(leaf(self, label)?)),
            Type::Array(element, Some(length)) => {
                let mut elements = Vec::new();
                for index in 0..*length {
                    elements.push(self.instantiate(element, label.part(&format!("[{index}]")), leaf, at)?);
                }
                Ok(Value::array(elements))
            }
            Type::Matrix(Some(rows), Some(columns)) => {
                let mut elements = Vec::new();
                for column in 0..*columns {
                    for row in 0..*rows {
                        let part =
                            if *columns == 1 { format!("[{row}]") } else { format!("[({row}, {column})]") };
                        self.count_steps(1, at)?;
                        elements.push(Value::Real(leaf(self, label.part(&part))?));
                    }
                }
                Ok(Value::matrix(*rows, *columns, elements))
            }
            Type::Tuple(parts) => {
                let mut elements = Vec::new();
                for (index, part) in parts.iter().enumerate() {
                    elements.push(self.instantiate(part, label.part(&format!(".{index}")), leaf, at)?);
                }
                Ok(Value::tuple(elements))
            }
            Type::Struct(definition, arguments) if !definition.is_enum => {
                let types = self.field_types(definition, 0, arguments)?;
                let mut fields = Vec::new();
                let Variant { fields: declared, units, .. } = &definition.variants[0];
                for (((field, _), unit), ty) in declared.iter().zip(units).zip(&types) {
                    let label = label.part(&format!(".{field}")).with_unit(unit);
                    fields.push(self.instantiate(ty, label, leaf, at)?);
                }
                Ok(Value::Struct(Rc::new(Struct { definition: definition.clone(), variant: 0, fields })))
            }
            Type::Unknown | Type::Array(_, None) | Type::Matrix(..) => Err(error(
                at,
                format!(
                    "the type of `{}` is not visible to the macro: use `f64`, arrays, tuples, nalgebra vectors \
                     and matrices, or structs that are defined in the same `#[dae] mod`",
                    label.name
                ),
            )),
            _ => Err(error(at, format!("`{}` must consist of `f64` values", label.name))),
        }
    }
}

fn usize_integer(value: usize) -> Integer {
    Integer { value: value as i128, ty: Some(IntegerType::Usize) }
}

/// The type bound to a type parameter, if there is one of that name.
fn parameter_type(scope: &Rc<Scope>, name: Symbol) -> Option<Type> {
    scope.enclosing_scopes().find_map(|scope| match &scope.names {
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
            for scope in scope.enclosing_scopes() {
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

/// Whether two types may be equal, as far as they are known.
fn may_be_equal(a: &Type, b: &Type) -> bool {
    match (a, b) {
        (Type::Unknown, _) | (_, Type::Unknown) => true,
        (Type::Real, Type::Real) | (Type::Bool, Type::Bool) => true,
        (Type::Integer(a), Type::Integer(b)) => a == b,
        (Type::Tuple(a), Type::Tuple(b)) => {
            a.len() == b.len() && a.iter().zip(b.iter()).all(|(a, b)| may_be_equal(a, b))
        }
        (Type::Array(a, n), Type::Array(b, m)) => {
            may_be_equal(a, b) && (n.is_none() || m.is_none() || n == m)
        }
        (Type::Struct(a, x), Type::Struct(b, y)) => {
            Rc::ptr_eq(a, b)
                && x.iter().zip(y.iter()).all(|(x, y)| match (x, y) {
                    (Generic::Type(x), Generic::Type(y)) => may_be_equal(x, y),
                    (Generic::Const(x), Generic::Const(y)) => x.value == y.value,
                    _ => true,
                })
        }
        (Type::Matrix(r, c), Type::Matrix(s, d)) => {
            (r.is_none() || s.is_none() || r == s) && (c.is_none() || d.is_none() || c == d)
        }
        (Type::Option(a), Type::Option(b)) => may_be_equal(a, b),
        _ => false,
    }
}
