//! From a model function, and the items around it, to a graph: the function is called with the
//! variables, and the returned numbers are the residual.

use super::augmented_states::{AugmentedStates, Extra};
use super::environment::{Names, Scope};
use super::evaluator::{Evaluator, error};
use super::flatten;
use super::label::Label;
use super::mistakes::CollectedErrors;
use super::modules::Module;
use super::place::Place;
use super::signature::{self, Argument, Role};
use super::types::Type;
use super::units::Units;
use super::value::{Function, Generic, Integer, IntegerType, Value};
use super::{Form, Instance, Model, Variables};
use crate::graph::{Binary, Node};
use std::rc::Rc;
use syn::{Error, Item, ItemFn, Result};

/// The data shared by all instances of a model.
pub struct Template<'a> {
    /// The attribute.
    pub form: Form,
    /// The model function.
    pub function: &'a ItemFn,
    /// The items of its module, itself included; none if it stands alone.
    pub items: &'a [Item],
    /// Name of the type.
    pub name: syn::Ident,
    /// Visibility of the type.
    pub visibility: syn::Visibility,
    /// Documentation of the type.
    pub documentation: Vec<syn::Attribute>,
    /// Path of the crate.
    pub krate: syn::Path,
}

impl Template<'_> {
    /// The model for these values of the const parameters.
    pub fn instantiate(&self, instance: Vec<Instance>, extension: &AugmentedStates) -> Result<Model> {
        let arguments = signature::arguments(self.form, self.function)?;
        let mut evaluator = Evaluator::default();
        let items = evaluator.module(self.items.iter(), Module::default())?;
        let turbofish = instance.iter().map(integer).collect::<Result<Vec<_>>>()?;
        let parameters = instance
            .iter()
            .zip(&turbofish)
            .map(|(parameter, value)| {
                (evaluator.symbol(&parameter.name), Place::new(Value::Integer(*value)).cell)
            })
            .collect();
        let scope = Scope::child_scope(&items, Names::Variables(parameters));
        let (variables, units, values) = self.variables(&arguments, &mut evaluator, &scope)?;
        let generics: Vec<Generic> = turbofish.into_iter().map(Generic::Const).collect();
        let callable = |item: &ItemFn| {
            Value::Function(Rc::new(Function {
                item: Rc::new(item.clone()),
                scope: items.clone(),
                turbofish: generics.clone(),
                owner: None,
            }))
        };
        let function = callable(self.function);
        let is_model = self.form != Form::Function;
        let mut rates = Vec::new();
        for integrand in if is_model { extension.integrands(self.function)? } else { Vec::new() } {
            let value = evaluator.call(&callable(&integrand), values.clone(), &integrand.sig.ident)?;
            rates.extend(evaluator.flatten(&value, &integrand.sig.output)?);
        }
        let more = self.extra_argument_lengths(&arguments, &mut evaluator, &scope)?;
        extension.check(self.function, variables.u.len(), more)?;
        let value = evaluator.call(&function, values, &self.function.sig.ident)?;
        let numbers = evaluator.flatten(&value, &self.function.sig.output)?;
        self.check_length(&numbers, &variables)?;
        let spans = flatten::spans(&self.function.block, &value);
        let residual = match self.form {
            Form::Dae | Form::Function => numbers,
            Form::Ode => (0u32..)
                .zip(numbers)
                .map(|(state, rate)| {
                    let xdot = evaluator.graph.variable(state);
                    evaluator.graph.binary(Binary::Sub, xdot, rate)
                })
                .collect(),
        };
        let mut model = Model {
            name: self.name.clone(),
            visibility: self.visibility.clone(),
            documentation: self.documentation.clone(),
            instance,
            variables,
            units,
            samplings: Vec::new(),
            reduction: None,
            duration: None,
            extra: Extra::default(),
            is_model,
            graph: evaluator.graph,
            residual,
            spans,
            opaque: evaluator.opaque,
            tables: evaluator.tables,
            uses: evaluator.uses,
            krate: self.krate.clone(),
        };
        extension.add_states(&mut model, &rates, more)?;
        Ok(model)
    }

    /// The lengths of the arguments `du` and `q`.
    fn extra_argument_lengths(
        &self,
        arguments: &[Argument],
        evaluator: &mut Evaluator,
        scope: &Rc<Scope>,
    ) -> Result<[usize; 2]> {
        let (_, labels) = types_and_labels(arguments, evaluator, scope)?;
        Ok([Role::Du, Role::Q].map(|role| {
            let position = arguments.iter().position(|argument| argument.role == role);
            position.map_or(0, |position| labels[position].len())
        }))
    }

    /// The variables of the model, and the values of the arguments in the order of the function.
    fn variables(
        &self,
        arguments: &[Argument],
        evaluator: &mut Evaluator,
        scope: &Rc<Scope>,
    ) -> Result<(Variables, Units, Vec<Value>)> {
        let (types, labels) = types_and_labels(arguments, evaluator, scope)?;
        let names: Vec<Vec<String>> =
            labels.iter().map(|list| label_texts(list, |label| &label.name)).collect();
        let variables = self.variable_names(arguments, &names)?;
        let units = units(arguments, &labels).with_documentation(&self.documentation, &variables);
        let mut values = Vec::new();
        let of_du = arguments.iter().position(|argument| argument.role == Role::Du);
        let of_du = of_du.map_or(0, |position| names[position].len() as u32);
        for (argument, ty) in arguments.iter().zip(&types) {
            let behind = if argument.role == Role::Q { of_du } else { 0 };
            let mut next = offset(&variables, argument.role) + behind;
            values.push(evaluator.instantiate(
                ty,
                Label::new(argument.role.name()),
                &mut |evaluator, _| {
                    let node = evaluator.graph.variable(next);
                    next += 1;
                    Ok(node)
                },
                &argument.ty,
            )?);
        }
        Ok((variables, units, values))
    }

    /// The variables by their names in each argument.
    fn variable_names(&self, arguments: &[Argument], names: &[Vec<String>]) -> Result<Variables> {
        let names_of = |role: Role| {
            let position = arguments.iter().position(|argument| argument.role == role);
            position.map_or_else(Vec::new, |position| names[position].clone())
        };
        let mut variables = Variables {
            x: names_of(Role::X),
            z: names_of(Role::Z),
            u: names_of(Role::U),
            p: names_of(Role::P),
        };
        for (argument, list) in arguments.iter().zip(names) {
            let after = |names: &[String], prefix: &str| -> Vec<String> {
                names.iter().map(|name| name[prefix.len()..].to_owned()).collect()
            };
            match argument.role {
                Role::T if list.len() != 1 || list[0] != "t" => {
                    return Err(Error::new_spanned(&argument.ty, "the time `t` is one number: `t: f64`"));
                }
                Role::Xdot if variables.x.is_empty() => {
                    variables.x = after(list, "xdot").into_iter().map(|name| format!("x{name}")).collect();
                }
                Role::Xdot if after(list, "xdot") != after(&variables.x, "x") => {
                    return Err(Error::new_spanned(
                        &argument.ty,
                        format!(
                            "`xdot` has {} and `x` has {}: they must have the same type",
                            count_in_words(list.len()),
                            count_in_words(variables.x.len())
                        ),
                    ));
                }
                _ => {}
            }
        }
        if variables.x.is_empty() {
            return Err(Error::new_spanned(
                &self.function.sig.inputs,
                "a model has at least one differential state: an argument `x`",
            ));
        }
        Ok(variables)
    }

    fn check_length(&self, residual: &[Node], variables: &Variables) -> Result<()> {
        let (nx, nz) = (variables.x.len(), variables.z.len());
        let expected = match self.form {
            Form::Dae => nx + nz,
            Form::Ode => nx,
            Form::Function => return Ok(()),
        };
        if residual.len() == expected {
            return Ok(());
        }
        let message = match self.form {
            Form::Dae | Form::Function if nz == 0 => format!(
                "the residual has {}, but `x` has {nx}: return one equation for each state",
                count_in_words(residual.len())
            ),
            Form::Dae | Form::Function => format!(
                "the residual has {}, but `x` and `z` have {nx} + {nz}: return one equation for each state",
                count_in_words(residual.len())
            ),
            Form::Ode => {
                format!("`x` has {}, but {} of `xdot` are returned", count_in_words(nx), residual.len())
            }
        };
        match &self.function.sig.output {
            syn::ReturnType::Type(_, ty) => Err(error(ty, message)),
            syn::ReturnType::Default => Err(Error::new(self.function.sig.ident.span(), message)),
        }
    }
}

fn label_texts(labels: &[Label], text: impl Fn(&Label) -> &String) -> Vec<String> {
    labels.iter().map(text).cloned().collect()
}

/// The units of fields of the arguments.
fn units(arguments: &[Argument], labels: &[Vec<Label>]) -> Units {
    let of = |role: Role| {
        let position = arguments.iter().position(|argument| argument.role == role)?;
        Some(label_texts(labels.get(position)?, |label| &label.unit))
    };
    let all = |role: Role| of(role).unwrap_or_default();
    let x = of(Role::X).unwrap_or_else(|| all(Role::Xdot));
    Units { x, z: all(Role::Z), u: all(Role::U), p: all(Role::P), ..Units::default() }
}

/// The types of arguments and the labels of their numbers, from a dry run: the index of a variable
/// depends on all dimensions.
fn types_and_labels(
    arguments: &[Argument],
    evaluator: &mut Evaluator,
    scope: &Rc<Scope>,
) -> Result<(Vec<Type>, Vec<Vec<Label>>)> {
    let mut types = Vec::new();
    let mut labels = Vec::new();
    let mut mistakes = CollectedErrors::default();
    for argument in arguments {
        let ty = match evaluator.resolve(&argument.ty, scope) {
            Ok(ty) => ty,
            Err(error) => {
                mistakes.note(error);
                continue;
            }
        };
        let mut list = Vec::new();
        let instance = evaluator.instantiate(
            &ty,
            Label::new(argument.role.name()),
            &mut |evaluator, label| {
                list.push(label);
                Ok(evaluator.graph.variable(0))
            },
            &argument.ty,
        );
        if let Err(error) = instance {
            mistakes.note(error);
        }
        types.push(ty);
        labels.push(list);
    }
    mistakes.into_result()?;
    Ok((types, labels))
}

/// A number of values, in words.
pub(super) fn count_in_words(n: usize) -> String {
    if n == 1 { "1 number".to_owned() } else { format!("{n} numbers") }
}

/// The index of the first variable with a role among `(ẋ, x, z, u, p, t)`.
fn offset(Variables { x, z, u, p }: &Variables, role: Role) -> u32 {
    let offset = match role {
        Role::Xdot => 0,
        Role::X => x.len(),
        Role::Z => 2 * x.len(),
        Role::U => 2 * x.len() + z.len(),
        Role::P => 2 * x.len() + z.len() + u.len(),
        Role::T => 2 * x.len() + z.len() + u.len() + p.len(),
        Role::Du | Role::Q => 2 * x.len() + z.len() + u.len() + p.len() + 1,
    };
    offset as u32
}

/// The value of a const parameter, as an integer of its type.
fn integer(parameter: &Instance) -> Result<Integer> {
    let ty = match &parameter.ty {
        syn::Type::Path(path) => {
            path.path.get_ident().and_then(|name| IntegerType::by_name(&name.to_string()))
        }
        _ => None,
    };
    let Some(ty) = ty else {
        return Err(Error::new_spanned(&parameter.ty, "a const parameter of a model is an integer"));
    };
    let value = i128::from(parameter.value);
    if value > ty.max() {
        return Err(Error::new(
            parameter.name.span(),
            format!("{value} is out of range for `{}`", ty.name()),
        ));
    }
    Ok(Integer { value, ty: Some(ty) })
}
