//! Dual models: functions that are generic over `DualNum`. Only their signatures are parsed.

use super::attribute::Arguments;
use super::signature::{self, Role};
use super::units::Units;
use super::{Form, Instance, Place, Sampling, Variables, module};
use proc_macro2::{Ident, TokenStream};
use quote::ToTokens;
use std::cell::RefCell;
use std::collections::HashMap;
use syn::{Error, Expr, GenericParam, Item, ItemFn, Result, Type};

/// The item of an attribute, if it is a dual model.
pub struct Source {
    /// The item as written, without casados attributes.
    pub item: TokenStream,
    /// The place of the generated items.
    pub place: Place,
    /// One model, or several for the values of const generics.
    pub models: Vec<Model>,
}

/// A dual model.
pub struct Model {
    /// The attribute.
    pub form: Form,
    /// The name of the type.
    pub name: Ident,
    /// The name of the function.
    pub function: Ident,
    /// Visibility of the function or module.
    pub visibility: syn::Visibility,
    /// Documentation attributes of the item.
    pub documentation: Vec<syn::Attribute>,
    /// Values of the const parameters.
    pub instance: Vec<Instance>,
    /// Names of the variables.
    pub variables: Variables,
    /// The units of the variables, from the documentation.
    pub units: Units,
    /// The nominal values and ranges of the variables `(ẋ, x, z, u, p, t)`.
    pub samplings: Vec<Sampling>,
    /// The arguments of the function, in its order.
    pub arguments: Vec<Argument>,
    /// Its generic arguments, in its order: the type is `CasadosT`.
    pub generics: Vec<TokenStream>,
    /// The number of returned equations.
    pub equations: usize,
    /// Whether it returns a number, not an array of one.
    pub scalar: bool,
    /// Path of the crate.
    pub krate: syn::Path,
}

/// An argument of a dual model.
pub struct Argument {
    /// The role of the argument.
    pub role: Role,
    /// Its length; `None` for a number.
    pub length: Option<usize>,
    /// Whether it is taken by reference.
    pub reference: bool,
}

/// Parses an item, if it is a dual model.
pub fn read(form: Form, attribute: TokenStream, item: TokenStream) -> Result<Option<Source>> {
    let (item, place, function, items, name, visibility, attributes) = match syn::parse2(item.clone())? {
        Item::Fn(function) => {
            let (name, visibility) = (function.sig.ident.clone(), function.vis.clone());
            let attributes = function.attrs.clone();
            (item, Place::Beside, function, Vec::new(), name, visibility, attributes)
        }
        Item::Mod(mut module) => {
            let marked = module::take_attributed_functions(&mut module);
            let Ok(Some(index)) = module::model_function(form, &mut module, &marked) else { return Ok(None) };
            let items = module.content.as_ref().map(|(_, items)| items.clone()).unwrap_or_default();
            let Some(Item::Fn(function)) = items.get(index).cloned() else { return Ok(None) };
            let (name, visibility) = (module.ident.clone(), module.vis.clone());
            let attributes = module.attrs.clone();
            (super::tokens::without_marks(item), Place::Inside, function, items, name, visibility, attributes)
        }
        _ => return Ok(None),
    };
    if !signature::is_dual(&function) {
        return Ok(None);
    }
    if form == Form::Function {
        return Err(Error::new_spanned(
            &function.sig.generics,
            "a function of a model's variables is written with `f64` and without type parameters: its derivatives are \
             found at compile time",
        ));
    }
    require_feature(&function, cfg!(feature = "num-dual"))?;
    let arguments = Arguments::read(attribute)?;
    if let Some(reduction) = &arguments.reduction {
        let message = "`index_reduction` needs a graph model: write the model with `f64`";
        return Err(Error::new(reduction.span, message));
    }
    if let Some(duration) = &arguments.duration {
        let message = "`duration` needs a graph model: write the model with `f64`";
        return Err(Error::new(duration.span, message));
    }
    if !arguments.extension.is_empty() {
        let message = "`linear`, `degree` and `integrals` need a graph model: write the model with `f64`";
        return Err(Error::new_spanned(&function.sig.ident, message));
    }
    let mut consts = function.sig.generics.clone();
    consts.params =
        consts.params.into_iter().filter(|parameter| !matches!(parameter, GenericParam::Type(_))).collect();
    let models = arguments
        .instances(&consts)?
        .into_iter()
        .map(|instance| {
            let signature = Signature::read(
                form,
                &function,
                &Lengths { instance: &instance, items: &items, known: RefCell::default() },
            )?;
            let documentation = super::documentation(&attributes);
            Ok(Model {
                form,
                units: Units::default().with_documentation(&documentation, &signature.variables),
                name: arguments.name.clone().unwrap_or_else(|| signature::type_name(&name)),
                function: function.sig.ident.clone(),
                visibility: visibility.clone(),
                documentation,
                generics: generics(&function, &instance)?,
                instance,
                samplings: arguments.samplings(&signature.variables)?,
                variables: signature.variables,
                arguments: signature.arguments,
                equations: signature.equations,
                scalar: signature.scalar,
                krate: arguments.path(),
            })
        })
        .collect::<Result<_>>()?;
    Ok(Some(Source { item, place, models }))
}

/// Dual models need the feature `num-dual`.
pub(super) fn require_feature(function: &ItemFn, enabled: bool) -> Result<()> {
    if enabled {
        return Ok(());
    }
    Err(Error::new_spanned(
        &function.sig.generics,
        "a model over `DualNum` needs the feature `num-dual` of casados: enable it in Cargo.toml, or write the \
         model with `f64` and without type parameters, so that its derivatives are found at compile time",
    ))
}

/// The generic arguments of a call.
fn generics(function: &ItemFn, instance: &[Instance]) -> Result<Vec<TokenStream>> {
    let mut types = 0;
    let mut arguments = Vec::new();
    for parameter in &function.sig.generics.params {
        match parameter {
            GenericParam::Lifetime(_) => {}
            GenericParam::Type(parameter) => {
                types += 1;
                if types > 1 {
                    return Err(Error::new_spanned(
                        parameter,
                        "a dual model has one type parameter: `T: DualNum + Copy`",
                    ));
                }
                arguments.push(quote::quote!(CasadosT));
            }
            GenericParam::Const(parameter) => {
                let value = instance.iter().find(|instance| instance.name == parameter.ident);
                let value = value.map(|instance| proc_macro2::Literal::u64_unsuffixed(instance.value));
                arguments.push(value.to_token_stream());
            }
        }
    }
    Ok(arguments)
}

/// The contents of a signature.
struct Signature {
    variables: Variables,
    arguments: Vec<Argument>,
    equations: usize,
    scalar: bool,
}

impl Signature {
    fn read(form: Form, function: &ItemFn, lengths: &Lengths) -> Result<Self> {
        let (mut variables, mut arguments) = (Variables::default(), Vec::new());
        let mut xdot = None;
        for argument in signature::arguments(form, function)? {
            let (ty, reference) = match &argument.ty {
                Type::Reference(reference) => (&*reference.elem, true),
                ty => (ty, false),
            };
            let length = lengths.of_type(function, ty)?;
            let role = argument.role;
            if role == Role::T && length.is_some() {
                return Err(Error::new_spanned(ty, "the time `t` is a number"));
            }
            let names = names(role.name(), length);
            match role {
                Role::Xdot => xdot = Some((ty.clone(), names.len())),
                Role::X => variables.x = names,
                Role::Z => variables.z = names,
                Role::U => variables.u = names,
                Role::P => variables.p = names,
                Role::T | Role::Du | Role::Q => {}
            }
            arguments.push(Argument { role, length, reference });
        }
        if let Some((ty, length)) = xdot
            && length != variables.x.len()
        {
            if !variables.x.is_empty() {
                return Err(Error::new_spanned(ty, "`xdot` and `x` have different lengths"));
            }
            variables.x = names("x", Some(length));
        }
        let syn::ReturnType::Type(_, ty) = &function.sig.output else {
            return Err(Error::new_spanned(&function.sig, "a model returns numbers"));
        };
        let length = lengths.of_type(function, ty)?;
        let equations = length.unwrap_or(1);
        let expected = variables.x.len() + variables.z.len();
        if equations != expected {
            return Err(Error::new_spanned(
                ty,
                format!(
                    "the model returns {}, but has {expected} unknowns: return one for each differential and \
                     algebraic state",
                    super::model::count_in_words(equations)
                ),
            ));
        }
        Ok(Self { variables, arguments, equations, scalar: length.is_none() })
    }
}

/// `x[0]`, `x[1]`, ...; for a number, its name.
fn names(name: &str, length: Option<usize>) -> Vec<String> {
    match length {
        None => vec![name.to_string()],
        Some(length) => (0..length).map(|index| format!("{name}[{index}]")).collect(),
    }
}

/// Evaluates the lengths of arrays.
struct Lengths<'a> {
    instance: &'a [Instance],
    items: &'a [Item],
    /// The evaluated constants, by their expressions.
    known: RefCell<HashMap<*const Expr, usize>>,
}

impl Lengths<'_> {
    /// The length of `[T; n]` or of a nalgebra vector; `None` for `T`.
    fn of_type(&self, function: &ItemFn, ty: &Type) -> Result<Option<usize>> {
        let is_number = |ty: &Type| {
            let Type::Path(path) = ty else { return false };
            function.sig.generics.type_params().any(|parameter| path.path.is_ident(&parameter.ident))
        };
        match ty {
            ty if is_number(ty) => return Ok(None),
            Type::Array(array) if is_number(&array.elem) => return self.of(&array.len, 0).map(Some),
            Type::Paren(inner) => return self.of_type(function, &inner.elem),
            Type::Path(path) => {
                if let Some(last) = path.path.segments.last()
                    && let syn::PathArguments::AngleBracketed(arguments) = &last.arguments
                {
                    let name = last.ident.to_string();
                    let mut arguments = arguments.args.iter();
                    let element =
                        matches!(arguments.next(), Some(syn::GenericArgument::Type(ty)) if is_number(ty));
                    let length = match (name.strip_prefix("Vector").map(str::parse), arguments.next()) {
                        (Some(Ok(length)), None) => Some(length),
                        (None, Some(syn::GenericArgument::Const(length))) if name == "SVector" => {
                            Some(self.of(length, 0)?)
                        }
                        (None, Some(syn::GenericArgument::Type(Type::Path(length)))) if name == "SVector" => {
                            let path =
                                syn::ExprPath { attrs: Vec::new(), qself: None, path: length.path.clone() };
                            Some(self.of(&Expr::Path(path), 0)?)
                        }
                        _ => None,
                    };
                    if let (true, Some(length)) = (element, length) {
                        return Ok(Some(length));
                    }
                }
            }
            _ => {}
        }
        Err(Error::new_spanned(
            ty,
            "arguments and result of a dual model are numbers `T`, arrays `[T; n]` or vectors `SVector<T, n>`; \
             structs are for models written with `f64`",
        ))
    }

    /// The value of a length.
    fn of(&self, length: &Expr, depth: usize) -> Result<usize> {
        let unknown = || {
            Error::new_spanned(
                length,
                "the length must be known here: write an integer, a const parameter, or a const of the same module",
            )
        };
        if depth > 64 {
            return Err(unknown());
        }
        let value = match length {
            Expr::Lit(syn::ExprLit { lit: syn::Lit::Int(literal), .. }) => Some(literal.base10_parse()?),
            Expr::Paren(inner) => Some(self.of(&inner.expr, depth + 1)?),
            Expr::Group(inner) => Some(self.of(&inner.expr, depth + 1)?),
            Expr::Block(block) => match block.block.stmts.as_slice() {
                [syn::Stmt::Expr(inner, None)] => Some(self.of(inner, depth + 1)?),
                _ => None,
            },
            Expr::Binary(binary) => {
                let (a, b) = (self.of(&binary.left, depth + 1)?, self.of(&binary.right, depth + 1)?);
                match binary.op {
                    syn::BinOp::Add(_) => a.checked_add(b),
                    syn::BinOp::Sub(_) => a.checked_sub(b),
                    syn::BinOp::Mul(_) => a.checked_mul(b),
                    syn::BinOp::Div(_) => a.checked_div(b),
                    _ => None,
                }
            }
            Expr::Path(path) => {
                let instance = self.instance.iter().find(|instance| path.path.is_ident(&instance.name));
                let item = self.items.iter().find_map(|item| match item {
                    Item::Const(item) if path.path.is_ident(&item.ident) => Some(&item.expr),
                    _ => None,
                });
                match (instance, item) {
                    (Some(instance), _) => usize::try_from(instance.value).ok(),
                    (None, Some(expression)) => {
                        let known = self.known.borrow().get(&std::ptr::from_ref(&**expression)).copied();
                        let value = known.map_or_else(|| self.of(expression, depth + 1), Ok)?;
                        self.known.borrow_mut().insert(std::ptr::from_ref(&**expression), value);
                        Some(value)
                    }
                    (None, None) => None,
                }
            }
            _ => None,
        };
        // The pattern of a dual model is dense: this limits the size of its tables.
        value.filter(|&value| value <= 10_000).ok_or_else(unknown)
    }
}
