//! The signature of a model: arguments by name, their types, and what follows for the variables.

use super::flatten::{Layout, Length, Types};
use super::{Form, Variables};
use proc_macro2::Ident;
use syn::spanned::Spanned;
use syn::{Error, FnArg, ItemFn, Pat, Result};

/// What an argument is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// `ẋ`
    Xdot,
    /// Differential states.
    X,
    /// Algebraic states.
    Z,
    /// Controls.
    U,
    /// Parameters.
    P,
    /// Time.
    T,
}

impl Role {
    /// The role that a name stands for. An argument that is not used may begin with an underscore.
    pub fn of(name: &Ident) -> Option<Self> {
        let name = name.to_string();
        Some(match name.strip_prefix('_').unwrap_or(&name) {
            "xdot" => Self::Xdot,
            "x" => Self::X,
            "z" => Self::Z,
            "u" => Self::U,
            "p" => Self::P,
            "t" => Self::T,
            _ => return None,
        })
    }

    /// Its name in a signature.
    pub fn name(self) -> &'static str {
        match self {
            Self::Xdot => "xdot",
            Self::X => "x",
            Self::Z => "z",
            Self::U => "u",
            Self::P => "p",
            Self::T => "t",
        }
    }
}

/// An argument of a model.
#[derive(Debug)]
pub struct Argument {
    /// What it is.
    pub role: Role,
    /// Its pattern: the name, perhaps `mut`.
    pub pattern: Pat,
    /// Its type as a tree of numbers.
    pub layout: Layout,
    /// Its type as written.
    pub ty: syn::Type,
}

/// A signature, understood.
#[derive(Debug)]
pub struct Signature {
    /// Arguments in the order of the function.
    pub arguments: Vec<Argument>,
    /// Names of the variables; their numbers are the dimensions.
    pub variables: Variables,
}

impl Signature {
    /// The argument of a role.
    pub fn argument(&self, role: Role) -> Option<&Argument> {
        self.arguments.iter().find(|argument| argument.role == role)
    }

    /// Where the numbers of a role begin among the variables `(ẋ, x, z, u, p, t)`.
    pub fn offset(&self, role: Role) -> usize {
        let Variables { x, z, u, p } = &self.variables;
        match role {
            Role::Xdot => 0,
            Role::X => x.len(),
            Role::Z => 2 * x.len(),
            Role::U => 2 * x.len() + z.len(),
            Role::P => 2 * x.len() + z.len() + u.len(),
            Role::T => 2 * x.len() + z.len() + u.len() + p.len(),
        }
    }

    /// Reads the signature of a model function.
    pub fn read(form: Form, function: &ItemFn, types: &Types, length: &mut Length) -> Result<Self> {
        check_qualifiers(function)?;
        let mut arguments = Vec::<Argument>::new();
        for input in &function.sig.inputs {
            let FnArg::Typed(input) = input else {
                return Err(Error::new_spanned(input, "a model is a function without `self`"));
            };
            let (role, pattern) = role(form, &input.pat)?;
            if arguments.iter().any(|argument| argument.role == role) {
                return Err(Error::new_spanned(&input.pat, format!("`{}` is given twice", role.name())));
            }
            let layout = types.layout(&input.ty, length)?;
            if role == Role::T && layout != Layout::Number {
                return Err(Error::new_spanned(&input.ty, "the time `t` is one number: `t: f64`"));
            }
            arguments.push(Argument { role, pattern, layout, ty: (*input.ty).clone() });
        }
        let of = |role: Role| arguments.iter().find(|argument| argument.role == role);
        let Some(x) = of(Role::X).or_else(|| of(Role::Xdot)) else {
            return Err(Error::new(
                function.sig.ident.span(),
                "a model has differential states: an argument `x`, and `xdot` of the same type in a `#[dae]`",
            ));
        };
        if form == Form::Dae {
            let Some(xdot) = of(Role::Xdot) else {
                return Err(Error::new(
                    function.sig.ident.span(),
                    "a `#[dae]` has an argument `xdot`, of the type of `x`; a function that returns `xdot` is an `#[ode]`",
                ));
            };
            if xdot.layout != x.layout {
                return Err(Error::new_spanned(
                    &xdot.ty,
                    format!("`xdot` must have the type of `x` ({} numbers in the same order)", x.layout.len()),
                ));
            }
        }
        if x.layout.len() == 0 {
            return Err(Error::new_spanned(&x.ty, "a model has at least one differential state"));
        }
        let names = |role: Role| match of(role) {
            Some(argument) => argument.layout.names(role.name()),
            None => Vec::new(),
        };
        let variables = Variables {
            x: x.layout.names(Role::X.name()),
            z: names(Role::Z),
            u: names(Role::U),
            p: names(Role::P),
        };
        Ok(Self { arguments, variables })
    }
}

/// The role of an argument, from its name.
fn role(form: Form, pattern: &Pat) -> Result<(Role, Pat)> {
    let arguments = match form {
        Form::Dae => "`xdot`, `x`, `z`, `u`, `p` and `t`",
        Form::Ode => "`x`, `u`, `p` and `t`",
    };
    let Pat::Ident(identifier) = pattern else {
        return Err(Error::new(
            pattern.span(),
            format!("arguments of a model are recognised by their names, {arguments}; take this one apart in the body"),
        ));
    };
    match (Role::of(&identifier.ident), form) {
        (Some(Role::Xdot), Form::Ode) => Err(Error::new_spanned(
            &identifier.ident,
            "an `#[ode]` returns `xdot`; a model with the argument `xdot` is a `#[dae]` and returns its residual",
        )),
        (Some(Role::Z), Form::Ode) => Err(Error::new_spanned(
            &identifier.ident,
            "an `#[ode]` has no algebraic states; write the model as a `#[dae]` with an equation for each of them",
        )),
        (Some(role), _) => Ok((role, pattern.clone())),
        (None, _) => Err(Error::new_spanned(
            &identifier.ident,
            format!("unknown argument `{}`: the arguments of a model are {arguments}", identifier.ident),
        )),
    }
}

/// A model is a plain function.
fn check_qualifiers(function: &ItemFn) -> Result<()> {
    let sig = &function.sig;
    let plain = "a model is a plain function of numbers";
    if let Some(token) = &sig.asyncness {
        return Err(Error::new_spanned(token, format!("{plain}: it cannot be `async`")));
    }
    if let Some(token) = &sig.variadic {
        return Err(Error::new_spanned(token, format!("{plain}: it cannot be variadic")));
    }
    if matches!(sig.output, syn::ReturnType::Default) {
        return Err(Error::new(
            sig.ident.span(),
            "a model returns numbers: its residual (`#[dae]`) or `xdot` (`#[ode]`)",
        ));
    }
    Ok(())
}

/// Whether a function is a dual model: `fn f<T: DualNum + Copy>(..)`, the bound in either place.
pub fn is_dual(function: &ItemFn) -> bool {
    let has = |bounds: &syn::punctuated::Punctuated<syn::TypeParamBound, syn::Token![+]>| {
        bounds.iter().any(|bound| {
            matches!(bound, syn::TypeParamBound::Trait(bound)
                if bound.path.segments.last().is_some_and(|last| last.ident == "DualNum"))
        })
    };
    let generics = &function.sig.generics;
    generics.type_params().any(|parameter| has(&parameter.bounds))
        || generics.where_clause.iter().flat_map(|clause| &clause.predicates).any(|predicate| {
            matches!(predicate, syn::WherePredicate::Type(predicate) if has(&predicate.bounds))
        })
}

/// `pendulum_on_cart` in upper camel case: `PendulumOnCart`.
pub fn type_name(name: &Ident) -> Ident {
    let text = name.to_string();
    let text = text.strip_prefix("r#").unwrap_or(&text);
    let mut camel = String::with_capacity(text.len());
    for word in text.split('_') {
        let mut letters = word.chars();
        if let Some(first) = letters.next() {
            // Two numbers that an underscore kept apart stay apart.
            if first.is_ascii_digit() && camel.ends_with(|last: char| last.is_ascii_digit()) {
                camel.push('_');
            }
            camel.extend(first.to_uppercase());
            camel.push_str(letters.as_str());
        }
    }
    if !camel.starts_with(|first: char| first.is_alphabetic()) {
        camel.insert(0, 'M');
    }
    Ident::new(&camel, name.span())
}
