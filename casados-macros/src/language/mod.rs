//! From Rust tokens to a graph: the signature of a model, and the partial evaluator of its body.

mod access;
mod arithmetic;
mod assignment;
mod attribute;
mod augmented_states;
mod branch;
mod call;
mod closure;
mod coercion;
mod division;
pub mod dual;
mod duration;
mod environment;
mod evaluator;
mod expression;
mod flatten;
mod function;
mod generics;
mod hygiene;
mod implementation;
mod items;
mod label;
mod literal;
mod methods;
pub mod mistakes;
mod model;
mod module;
mod modules;
mod operator;
mod path;
mod pattern;
mod place;
mod polynomial_controls;
mod reduction;
mod sampling;
mod select;
pub mod signature;
mod statement;
#[cfg(test)]
mod tests;
pub mod tokens;
mod types;
pub mod units;
mod user;
mod value;

use crate::graph::{Graph, Node};
use attribute::Arguments;
pub use augmented_states::Extra;
use model::Template;
use proc_macro2::{Span, TokenStream};
pub use reduction::{Rates, Reduction};
pub use sampling::Sampling;
use units::Units;

/// The attribute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The function returns the residual `f(ẋ, x, u, z, p, t)`.
    Dae,
    /// The function returns `ẋ`; the graph's residual is `ẋ − g(x, u, p, t)`.
    Ode,
    /// The function returns any numbers `y(x, u, z, p, t)`, which are stored as the residual.
    Function,
}

impl Form {
    /// The attribute with this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Some(match name {
            "dae" => Self::Dae,
            "ode" => Self::Ode,
            "function" => Self::Function,
            _ => return None,
        })
    }

    /// The description of the function, with an article.
    pub fn description(self) -> &'static str {
        match self {
            Self::Dae | Self::Ode => "a model",
            Self::Function => "a function of a model's variables",
        }
    }
}

/// The place of the generated items.
#[derive(Clone, Debug)]
pub enum Place {
    /// Beside the item (a function).
    Beside,
    /// Inside the module, with a re-export beside it: `pub use name::Type;`.
    Inside,
}

/// The parsed item of an attribute.
pub struct Source {
    /// The item as written, without casados attributes.
    pub item: TokenStream,
    /// The place of the generated items.
    pub place: Place,
    /// The function; for a module also those with their own attributes.
    pub parts: Vec<ModelOrFunctions>,
    /// Items that cause compiler warnings about valid, but probably unintended code.
    pub warnings: TokenStream,
}

/// The models or functions read from a Rust function.
pub struct ModelOrFunctions {
    /// The attribute.
    pub form: Form,
    /// The name of the function, or of its module.
    pub original: syn::Ident,
    /// One model, or several for the values of const generics.
    pub models: Vec<Model>,
}

/// A model as a graph.
pub struct Model {
    /// The name of the type: that of the function or module in upper camel case.
    pub name: syn::Ident,
    /// Visibility of the function or module.
    pub visibility: syn::Visibility,
    /// Documentation attributes of the item.
    pub documentation: Vec<syn::Attribute>,
    /// The values of the const parameters, if any: `impl Dae for Chain<9>`.
    pub instance: Vec<Instance>,
    /// Names of the variables.
    pub variables: Variables,
    /// The units of the variables, from the documentation.
    pub units: Units,
    /// The nominal values and ranges of the variables `(ẋ, x, z, u, p, t)`.
    pub samplings: Vec<Sampling>,
    /// The index reduction, if requested.
    pub reduction: Option<Reduction>,
    /// The parameter that scales time, if any.
    pub duration: Option<u32>,
    /// The augmented states.
    pub extra: Extra,
    /// Whether it has equations, unlike a function.
    pub is_model: bool,
    /// The graph of expressions.
    pub graph: Graph,
    /// `f`, one node per equation.
    pub residual: Vec<Node>,
    /// The source position of each equation, for errors.
    pub spans: Vec<Span>,
    /// Constants from outside, as Rust expressions of type `f64`; `Op::Opaque` is an index into
    /// this list.
    pub opaque: Vec<TokenStream>,
    /// The tables; `graph::Table` has an index into this list.
    pub tables: Vec<Table>,
    /// `use` items in the body, which opaque constants may need.
    pub uses: Vec<syn::ItemUse>,
    /// The path of the crate: `::casados` unless the attribute has `crate = path`.
    pub krate: syn::Path,
}

/// A table of a model.
#[derive(Clone, Debug)]
pub struct Table {
    /// A constant expression of a type of `casados::tables`, which it calls `casados_tables`.
    pub expression: TokenStream,
    /// The number of its variables.
    pub variables: usize,
}

/// A const parameter and its value in this model.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Its name.
    pub name: syn::Ident,
    /// Its type, usually `usize`.
    pub ty: syn::Type,
    /// Its value.
    pub value: u64,
}

/// The names of the variables, flattened: `x[3]`, `cart.position`. Their numbers are the
/// dimensions. The order of indices in the graph is `ẋ`, `x`, `z`, `u`, `p`, `t`; `t` is always the
/// last, even if unused.
#[derive(Clone, Debug, Default)]
pub struct Variables {
    /// Differential states (and their derivatives).
    pub x: Vec<String>,
    /// Algebraic states.
    pub z: Vec<String>,
    /// Controls.
    pub u: Vec<String>,
    /// Parameters.
    pub p: Vec<String>,
}

/// Parses an item.
pub fn read(form: Form, attribute: TokenStream, item: TokenStream) -> syn::Result<Source> {
    let arguments = Arguments::read(attribute)?;
    let written = item.clone();
    let mut parsed = syn::parse2(tokens::without_tests(item))?;
    hygiene::separate_contexts(&mut parsed);
    let warnings = division::warnings(&parsed);
    match parsed {
        syn::Item::Fn(function) => {
            let template = Template {
                form,
                function: &function,
                items: &[],
                name: arguments.name.clone().unwrap_or_else(|| signature::type_name(&function.sig.ident)),
                visibility: function.vis.clone(),
                documentation: documentation(&function.attrs),
                krate: arguments.path(),
            };
            let models = models(&arguments, &template)?;
            let part = ModelOrFunctions { form, original: function.sig.ident.clone(), models };
            Ok(Source { item: written, place: Place::Beside, parts: vec![part], warnings })
        }
        syn::Item::Mod(module) => {
            let parts = model_and_functions(form, &arguments, module)?;
            let item = tokens::without_attributes(written);
            Ok(Source { item, place: Place::Inside, parts, warnings })
        }
        other => Err(syn::Error::new_spanned(
            other,
            format!("{} is a function, or a module with a function in it", form.description()),
        )),
    }
}

/// The model of a module, and its functions with their own attributes.
fn model_and_functions(
    form: Form,
    arguments: &Arguments,
    mut module: syn::ItemMod,
) -> syn::Result<Vec<ModelOrFunctions>> {
    let marked = module::take_attributed_functions(&mut module);
    let index = module::model_function(form, &mut module, &marked)?;
    let items = module.content.as_ref().map_or(&[][..], |(_, items)| items);
    let template = |form, index: usize, named: Option<&syn::ItemMod>, own: &Arguments| match items.get(index)
    {
        Some(syn::Item::Fn(function)) => Ok(Template {
            form,
            function,
            items,
            name: own.name.clone().unwrap_or_else(|| {
                signature::type_name(named.map_or(&function.sig.ident, |module| &module.ident))
            }),
            visibility: module.vis.clone(),
            documentation: documentation(named.map_or(&function.attrs, |module| &module.attrs)),
            krate: own.krate.clone().unwrap_or_else(|| arguments.path()),
        }),
        _ => Err(syn::Error::new_spanned(&module, "no model in this module")),
    };
    let mut parts = Vec::new();
    match index {
        Some(index) => {
            let models = models(arguments, &template(form, index, Some(&module), arguments)?)?;
            parts.push(ModelOrFunctions { form, original: module.ident.clone(), models });
        }
        None => arguments.reject_model_arguments(&module.ident)?,
    }
    let mut mistakes = mistakes::CollectedErrors::default();
    for module::AttributedFunction { index, form, attribute } in marked {
        let part = Arguments::read(attribute).and_then(|own| {
            let Some(syn::Item::Fn(function)) = items.get(index) else { return Ok(None) };
            let mut own = own;
            if form == Form::Function {
                own.extension = own.extension.or(&arguments.extension);
                own.extension.polynomials.duration.clone_from(&arguments.duration);
            }
            let models = models(&own, &template(form, index, None, &own)?)?;
            Ok(Some(ModelOrFunctions { form, original: function.sig.ident.clone(), models }))
        });
        match part {
            Ok(part) => parts.extend(part),
            Err(error) => mistakes.note(error),
        }
    }
    mistakes.into_result()?;
    Ok(parts)
}

fn models(arguments: &Arguments, template: &Template) -> syn::Result<Vec<Model>> {
    if template.form == Form::Function {
        arguments.reject_settings("a function")?;
    }
    if template.form != Form::Dae
        && let Some(reduction) = &arguments.reduction
    {
        return Err(syn::Error::new(
            reduction.span,
            "only the equations of a `#[dae]` have an index to reduce",
        ));
    }
    let instances = arguments.instances(&template.function.sig.generics)?;
    let model = |instance| {
        let mut model = template.instantiate(instance, &arguments.extension)?;
        model.reduction.clone_from(&arguments.reduction);
        if let Some(duration) = &arguments.duration {
            duration.scale(&mut model, template.form == Form::Function)?;
        }
        arguments.extension.polynomials.expand(&mut model)?;
        model.samplings = arguments.samplings(&model.variables)?;
        Ok(model)
    };
    instances.into_iter().map(model).collect()
}

/// The functions of a module with their own attributes, and the arguments of these.
pub fn attributed_functions(module: &mut syn::ItemMod) -> Vec<(syn::Signature, TokenStream)> {
    let marked = module::take_attributed_functions(module);
    let items = module.content.as_ref().map_or(&[][..], |(_, items)| items);
    let signature = |marked: module::AttributedFunction| match items.get(marked.index) {
        Some(syn::Item::Fn(function)) => Some((function.sig.clone(), marked.attribute)),
        _ => None,
    };
    marked.into_iter().filter_map(signature).collect()
}

/// The name of a model's type, as far as its attribute can be parsed.
pub fn model_name(attribute: TokenStream, item: &syn::Ident) -> syn::Ident {
    let named = Arguments::read(attribute).ok().and_then(|arguments| arguments.name);
    named.unwrap_or_else(|| signature::type_name(item))
}

fn documentation(attributes: &[syn::Attribute]) -> Vec<syn::Attribute> {
    attributes.iter().filter(|attribute| attribute.path().is_ident("doc")).cloned().collect()
}
