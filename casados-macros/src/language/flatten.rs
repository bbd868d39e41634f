//! Types of arguments as trees of numbers, and the order and names of these numbers.
//!
//! Numbers come in the order of declaration: elements of arrays by index, fields of structs as they are
//! declared, matrices column after column.

use std::collections::HashMap;
use syn::spanned::Spanned;
use syn::{Error, Expr, GenericArgument, GenericParam, PathArguments, Result, Type};

/// More numbers than this in one argument are taken for a mistake.
const MAX_NUMBERS: usize = 100_000;

/// Types that arguments can have.
const POSSIBLE: &str = "arguments are `f64`, arrays and tuples, nalgebra vectors and matrices of `f64`, \
    and structs with named fields of these (declared in a `#[dae] mod`)";

/// A tree of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `f64`
    Number,
    /// `[element; length]`
    Array(Box<Layout>, usize),
    /// `(a, b, ..)`
    Tuple(Vec<Layout>),
    /// A struct with named fields.
    Struct(String, Vec<(String, Layout)>),
    /// A nalgebra matrix of `(rows, columns)`; a vector has one column.
    Matrix(usize, usize),
}

impl Layout {
    /// How many numbers.
    pub fn len(&self) -> usize {
        match self {
            Self::Number => 1,
            Self::Array(element, length) => element.len().saturating_mul(*length),
            Self::Tuple(elements) => elements.iter().map(Self::len).fold(0, usize::saturating_add),
            Self::Struct(_, fields) => {
                fields.iter().map(|(_, field)| field.len()).fold(0, usize::saturating_add)
            }
            Self::Matrix(rows, columns) => rows.saturating_mul(*columns),
        }
    }

    /// The name of each number of an argument: `x[3]`, `x.cart.position`, `q[0][2]`, `r[(0, 1)]`.
    pub fn names(&self, prefix: &str) -> Vec<String> {
        let mut names = Vec::with_capacity(self.len());
        self.push_names(prefix, &mut names);
        names
    }

    fn push_names(&self, prefix: &str, names: &mut Vec<String>) {
        match self {
            Self::Number => names.push(prefix.to_owned()),
            Self::Array(element, length) => {
                for i in 0..*length {
                    element.push_names(&format!("{prefix}[{i}]"), names);
                }
            }
            Self::Tuple(elements) => {
                for (i, element) in elements.iter().enumerate() {
                    element.push_names(&format!("{prefix}.{i}"), names);
                }
            }
            Self::Struct(_, fields) => {
                for (name, field) in fields {
                    field.push_names(&format!("{prefix}.{name}"), names);
                }
            }
            Self::Matrix(rows, 1) => names.extend((0..*rows).map(|row| format!("{prefix}[{row}]"))),
            Self::Matrix(rows, columns) => {
                for column in 0..*columns {
                    names.extend((0..*rows).map(|row| format!("{prefix}[({row}, {column})]")));
                }
            }
        }
    }
}

/// Evaluates a const expression to a length, under values of the const parameters of a struct.
pub type Length<'a> = dyn FnMut(&Expr, &HashMap<String, u64>) -> Result<u64> + 'a;

/// The types that an argument can name.
pub struct Types<'a> {
    /// Structs in sight.
    pub structs: HashMap<String, &'a syn::ItemStruct>,
    /// Type aliases in sight.
    pub aliases: HashMap<String, &'a syn::ItemType>,
}

impl<'a> Types<'a> {
    /// The structs and aliases among some items.
    pub fn new(items: &'a [syn::Item]) -> Self {
        let mut types = Self { structs: HashMap::new(), aliases: HashMap::new() };
        for item in items {
            match item {
                syn::Item::Struct(item) => {
                    types.structs.insert(item.ident.to_string(), item);
                }
                syn::Item::Type(item) => {
                    types.aliases.insert(item.ident.to_string(), item);
                }
                _ => {}
            }
        }
        types
    }

    /// The layout of a type, references to it included.
    pub fn layout(&self, ty: &Type, length: &mut Length) -> Result<Layout> {
        let layout = self.resolve(ty, &HashMap::new(), length, &mut Vec::new())?;
        if layout.len() > MAX_NUMBERS {
            return Err(Error::new(ty.span(), format!("these are more than {MAX_NUMBERS} numbers")));
        }
        Ok(layout)
    }

    /// `values` are those of const parameters, `outer` the names that are being resolved.
    fn resolve(
        &self,
        ty: &Type,
        values: &HashMap<String, u64>,
        length: &mut Length,
        outer: &mut Vec<String>,
    ) -> Result<Layout> {
        match ty {
            Type::Group(ty) => self.resolve(&ty.elem, values, length, outer),
            Type::Paren(ty) => self.resolve(&ty.elem, values, length, outer),
            Type::Reference(reference) => {
                if reference.mutability.is_some() {
                    return Err(Error::new_spanned(
                        reference,
                        "a model does not change its arguments; take them by value or by `&`",
                    ));
                }
                if let Type::Slice(slice) = &*reference.elem {
                    return Err(Error::new_spanned(
                        slice,
                        "the length of a slice is not known at compile time; write an array, as in `&[f64; 4]`",
                    ));
                }
                self.resolve(&reference.elem, values, length, outer)
            }
            Type::Array(array) => {
                let element = self.resolve(&array.elem, values, length, outer)?;
                let size = size(length(&array.len, values)?, &array.len)?;
                Ok(Layout::Array(Box::new(element), size))
            }
            Type::Tuple(tuple) => tuple
                .elems
                .iter()
                .map(|element| self.resolve(element, values, length, outer))
                .collect::<Result<_>>()
                .map(Layout::Tuple),
            Type::Path(path) if path.qself.is_none() => self.path(&path.path, values, length, outer),
            other => Err(Error::new_spanned(other, POSSIBLE)),
        }
    }

    fn path(
        &self,
        path: &syn::Path,
        values: &HashMap<String, u64>,
        length: &mut Length,
        outer: &mut Vec<String>,
    ) -> Result<Layout> {
        let Some(last) = path.segments.last() else {
            return Err(Error::new_spanned(path, POSSIBLE));
        };
        let name = last.ident.to_string();
        let arguments: Vec<&GenericArgument> = match &last.arguments {
            PathArguments::AngleBracketed(arguments) => arguments.args.iter().collect(),
            _ => Vec::new(),
        };
        let own = path.segments.len() == 1
            || path.segments.len() == 2 && path.segments[0].ident == "self";
        if own && (self.structs.contains_key(&name) || self.aliases.contains_key(&name)) {
            if outer.contains(&name) {
                return Err(Error::new_spanned(path, format!("the type `{name}` contains itself")));
            }
            outer.push(name.clone());
            let layout = if let Some(item) = self.structs.get(&name) {
                let inner = parameters(&item.generics, &arguments, path, values, length)?;
                self.fields(item, &inner, length, outer)
            } else {
                let item = self.aliases[&name];
                let inner = parameters(&item.generics, &arguments, path, values, length)?;
                self.resolve(&item.ty, &inner, length, outer)
            };
            outer.pop();
            return layout;
        }
        match name.as_str() {
            "f64" if arguments.is_empty() => return Ok(Layout::Number),
            "f32" => {
                return Err(Error::new_spanned(
                    path,
                    "a model is written with `f64`; its code is generated for `f32` too",
                ));
            }
            _ => {}
        }
        let (known, mut sizes) = match name.as_str() {
            "SVector" => (Some((None, Some(1))), arguments.get(1..2).unwrap_or_default()),
            "RowSVector" => (Some((Some(1), None)), arguments.get(1..2).unwrap_or_default()),
            "SMatrix" => (Some((None, None)), arguments.get(1..3).unwrap_or_default()),
            _ => (matrix_alias(&name).map(|(rows, columns)| (Some(rows), Some(columns))), &[][..]),
        };
        let Some((rows, columns)) = known else {
            return Err(Error::new_spanned(path, format!("unknown type `{name}`: {POSSIBLE}")));
        };
        let of_numbers = matches!(arguments.first(), Some(GenericArgument::Type(Type::Path(ty))) if ty.path.is_ident("f64"));
        if !of_numbers {
            return Err(Error::new_spanned(path, format!("a model is written with `f64`, as in `{name}<f64, ..>`")));
        }
        let mut dimension = |known: Option<usize>| match known {
            Some(known) => Ok(known),
            None => {
                let Some((first, rest)) = sizes.split_first() else {
                    return Err(Error::new_spanned(path, format!("`{name}` needs its dimensions")));
                };
                sizes = rest;
                let expression = expression(first)?;
                size(length(&expression, values)?, &expression)
            }
        };
        Ok(Layout::Matrix(dimension(rows)?, dimension(columns)?))
    }

    fn fields(
        &self,
        item: &syn::ItemStruct,
        values: &HashMap<String, u64>,
        length: &mut Length,
        outer: &mut Vec<String>,
    ) -> Result<Layout> {
        let syn::Fields::Named(fields) = &item.fields else {
            return Err(Error::new_spanned(item, "a struct of model variables has named fields"));
        };
        let mut layouts = Vec::new();
        for field in &fields.named {
            if let Some(name) = &field.ident {
                layouts.push((name.to_string(), self.resolve(&field.ty, values, length, outer)?));
            }
        }
        Ok(Layout::Struct(item.ident.to_string(), layouts))
    }
}

/// Values of the const parameters of a struct or an alias.
fn parameters(
    generics: &syn::Generics,
    arguments: &[&GenericArgument],
    path: &syn::Path,
    values: &HashMap<String, u64>,
    length: &mut Length,
) -> Result<HashMap<String, u64>> {
    let mut inner = HashMap::new();
    let mut given =
        arguments.iter().filter(|argument| !matches!(argument, GenericArgument::Lifetime(_)));
    for parameter in &generics.params {
        match parameter {
            GenericParam::Lifetime(_) => {}
            GenericParam::Type(parameter) => {
                return Err(Error::new_spanned(
                    parameter,
                    "a struct of model variables has no type parameters; write `f64`",
                ));
            }
            GenericParam::Const(parameter) => {
                let value = match (given.next(), &parameter.default) {
                    (Some(argument), _) => length(&expression(argument)?, values)?,
                    (None, Some((_, default))) => length(default, &inner)?,
                    (None, None) => {
                        return Err(Error::new_spanned(
                            path,
                            format!("the value of `{}` is missing", parameter.ident),
                        ));
                    }
                };
                inner.insert(parameter.ident.to_string(), value);
            }
        }
    }
    Ok(inner)
}

/// A const argument as an expression: `N` looks like a type to a parser.
fn expression(argument: &GenericArgument) -> Result<Expr> {
    match argument {
        GenericArgument::Const(expression) => Ok(expression.clone()),
        GenericArgument::Type(Type::Path(path)) if path.qself.is_none() => {
            let path = &path.path;
            Ok(syn::parse_quote!(#path))
        }
        other => Err(Error::new_spanned(other, "expected an integer")),
    }
}

fn size(value: u64, at: &Expr) -> Result<usize> {
    usize::try_from(value)
        .ok()
        .filter(|&value| value <= MAX_NUMBERS)
        .ok_or_else(|| Error::new(at.span(), format!("the length {value} is more than {MAX_NUMBERS}")))
}

/// Rows and columns of nalgebra's aliases: `Vector3`, `RowVector4`, `Matrix2`, `Matrix2x3`.
pub fn matrix_alias(name: &str) -> Option<(usize, usize)> {
    let digit = |text: &str| text.parse::<usize>().ok().filter(|n| text.len() == 1 && (1..=6).contains(n));
    if let Some(n) = name.strip_prefix("RowVector") {
        return Some((1, digit(n)?));
    }
    if let Some(n) = name.strip_prefix("Vector") {
        return Some((digit(n)?, 1));
    }
    let dimensions = name.strip_prefix("Matrix")?;
    match dimensions.split_once('x') {
        Some((rows, columns)) => Some((digit(rows)?, digit(columns)?)),
        None => digit(dimensions).map(|n| (n, n)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(items: &str, ty: &str) -> std::result::Result<Layout, String> {
        let file: syn::File = syn::parse_str(items).unwrap();
        let ty: Type = syn::parse_str(ty).unwrap();
        let mut length = |expression: &Expr, values: &HashMap<String, u64>| match expression {
            Expr::Lit(literal) => match &literal.lit {
                syn::Lit::Int(value) => value.base10_parse(),
                other => Err(Error::new(other.span(), "no integer")),
            },
            Expr::Path(path) => path
                .path
                .get_ident()
                .and_then(|name| values.get(&name.to_string()).copied())
                .ok_or_else(|| Error::new(path.span(), "unknown")),
            other => Err(Error::new(other.span(), "no length")),
        };
        Types::new(&file.items).layout(&ty, &mut length).map_err(|error| error.to_string())
    }

    #[test]
    fn order_is_that_of_declaration() {
        let items = "struct State<const N: usize> { cart: Cart, q: [[f64; 2]; N], r: SMatrix<f64, 2, N>, t: (f64, Vector2<f64>) }
                     struct Cart { position: f64, velocity: f64 }";
        let layout = layout(items, "&State<2>").unwrap();
        assert_eq!(
            layout.names("x"),
            [
                "x.cart.position", "x.cart.velocity", "x.q[0][0]", "x.q[0][1]", "x.q[1][0]", "x.q[1][1]",
                "x.r[(0, 0)]", "x.r[(1, 0)]", "x.r[(0, 1)]", "x.r[(1, 1)]", "x.t.0", "x.t.1[0]", "x.t.1[1]",
            ]
        );
        assert_eq!(layout.len(), 13);
    }

    #[test]
    fn wrong_types_are_named() {
        assert!(layout("", "Quaternion").unwrap_err().contains("unknown type `Quaternion`"));
        assert!(layout("", "[f32; 3]").unwrap_err().contains("written with `f64`"));
        assert!(layout("", "&[f64]").unwrap_err().contains("slice"));
        assert!(layout("", "Vector3<f32>").unwrap_err().contains("`f64`"));
        assert!(layout("struct A { a: [A; 1] }", "A").unwrap_err().contains("contains itself"));
        assert!(layout("", "[f64; 1000000]").unwrap_err().contains("more than"));
        assert!(layout("", "[[f64; 1000]; 1000]").unwrap_err().contains("more than"));
    }

    #[test]
    fn aliases_of_nalgebra() {
        assert_eq!(matrix_alias("Vector6"), Some((6, 1)));
        assert_eq!(matrix_alias("RowVector2"), Some((1, 2)));
        assert_eq!(matrix_alias("Matrix3"), Some((3, 3)));
        assert_eq!(matrix_alias("Matrix2x5"), Some((2, 5)));
        assert_eq!(matrix_alias("Vector7"), None);
        assert_eq!(matrix_alias("Matrix"), None);
        assert_eq!(matrix_alias("VectorX"), None);
    }
}
