//! Expressions.

use super::arithmetic::{Comparison, Operator, wrap};
use super::evaluator::{At, Evaluated, Evaluator, Flow, Target, error, opaque, unsupported};
use super::methods::Receiver;
use super::path::Named;
use super::pattern::{Subject, Truth};
use super::place::{Place, Projection};
use super::types::Type;
use super::value::{Integer, IntegerType, Range, Struct, Value};
use quote::{ToTokens, quote};
use std::rc::Rc;
use syn::{Expr, Result};

impl Evaluator {
    /// The value of an expression of which the context expects a type.
    pub(super) fn expression(&mut self, expression: &Expr, expected: &Type) -> Evaluated {
        self.deeper(expression, |evaluator| evaluator.expression_within(expression, expected))
    }

    fn expression_within(&mut self, expression: &Expr, expected: &Type) -> Evaluated {
        match expression {
            Expr::Lit(literal) => self.literal(literal, expected),
            Expr::Path(path) => self.path_value(path),
            Expr::Paren(inner) => self.expression(&inner.expr, expected),
            Expr::Group(inner) => self.expression(&inner.expr, expected),
            Expr::Binary(binary) => self.binary_expression(binary, expected),
            Expr::Unary(unary) => self.unary_expression(unary, expected),
            Expr::Field(_) | Expr::Index(_) => {
                let place = self.place(expression, false)?;
                Ok(place.value(self, expression)?)
            }
            Expr::Call(call) => self.call_expression(call, expected),
            Expr::MethodCall(call) => self.method_call(call, expected),
            Expr::Array(array) => self.array_expression(array, expected),
            Expr::Repeat(repeat) => self.repeat_expression(repeat, expected),
            Expr::Tuple(tuple) => {
                let mut parts = Vec::with_capacity(tuple.elems.len());
                for (index, part) in tuple.elems.iter().enumerate() {
                    parts.push(self.expression(part, &expected.part(index))?);
                }
                Ok(Value::tuple(parts))
            }
            Expr::Struct(literal) => self.struct_expression(literal, expected),
            Expr::Block(block) => self.labelled_block(block, expected),
            Expr::Const(block) => self.block(&block.block, expected),
            Expr::If(branch) => self.if_expression(branch, expected),
            Expr::Match(choice) => self.match_expression(choice, expected),
            Expr::ForLoop(inner) => self.for_loop(inner),
            Expr::While(inner) => self.while_loop(inner),
            Expr::Loop(inner) => self.endless_loop(inner, expected),
            Expr::Assign(assign) => self.assignment(assign),
            Expr::Reference(reference) => self.reference_expression(reference, expected),
            Expr::Cast(cast) => self.cast_expression(cast),
            Expr::Range(range) => self.range_expression(range, expected),
            Expr::Closure(closure) => self.closure_expression(closure),
            Expr::Return(inner) => self.return_expression(inner),
            Expr::Break(inner) => self.break_expression(inner),
            Expr::Continue(inner) => {
                let label = inner.label.as_ref().map(|label| label.ident.to_string());
                self.check_target(label, false, inner)?;
                Err(Flow::Continue(inner.label.clone()))
            }
            Expr::Macro(call) => self.macro_call(&call.mac, expected),
            Expr::Let(_) => match self.condition(expression)? {
                Truth::Known(value) => Ok(Value::Bool(value)),
                Truth::When(node) => Ok(Value::Condition(node)),
            },
            Expr::Try(inner) => {
                let value = self.expression(&inner.expr, &Type::Option(Rc::new(expected.clone())))?;
                match self.load(value, expression)? {
                    Value::Option(Some(value)) => Ok(*value),
                    Value::Option(None) => {
                        self.check_return(expression)?;
                        Err(Flow::Return(Value::Option(None)))
                    }
                    other => Err(error(expression, format!("there is no `?` of {}", other.kind())).into()),
                }
            }
            Expr::Infer(_) => Err(error(expression, "`_` is no value").into()),
            Expr::Unsafe(_) => Err(unsupported(expression, "unsafe code").into()),
            _ => Err(unsupported(expression, "this kind of expression").into()),
        }
    }

    /// A literal.
    pub(super) fn literal(&mut self, literal: &syn::ExprLit, expected: &Type) -> Evaluated {
        match &literal.lit {
            syn::Lit::Float(float) => self.float_literal(float.base10_digits(), float.suffix(), literal),
            syn::Lit::Int(int) if int.suffix().starts_with('f') => {
                self.float_literal(int.base10_digits(), int.suffix(), literal)
            }
            syn::Lit::Int(int) => {
                let value = int
                    .base10_parse::<i128>()
                    .map_err(|_| error(literal, "this integer does not fit into an `i128`"))?;
                let ty = match (int.suffix(), expected) {
                    ("", Type::Integer(ty)) => Some(*ty),
                    ("", _) => None,
                    (suffix, _) => IntegerType::named(suffix),
                };
                Ok(Value::Integer(Integer { value, ty }))
            }
            syn::Lit::Bool(value) => Ok(Value::Bool(value.value)),
            syn::Lit::Byte(byte) => {
                let value = i128::from(byte.value());
                Ok(Value::Integer(Integer { value, ty: Some(IntegerType::U8) }))
            }
            _ => Err(unsupported(literal, "text").into()),
        }
    }

    fn float_literal(&mut self, digits: &str, suffix: &str, at: At) -> Evaluated {
        if !suffix.is_empty() && suffix != "f64" {
            return Err(error(at, format!("models are computed in `f64`, not in `{suffix}`")).into());
        }
        match digits.parse::<f64>() {
            Ok(value) => Ok(Value::Real(self.graph.constant(value))),
            Err(_) => Err(error(at, "this is no number").into()),
        }
    }

    /// The value of a path.
    pub(super) fn path_value(&mut self, path: &syn::ExprPath) -> Evaluated {
        match self.named(path)? {
            Named::Variable(cell) => Ok(cell.borrow().clone()),
            Named::Value(value) => Ok(value),
            Named::Builtin(builtin) => Ok(self.builtin_value(builtin, path)),
        }
    }

    /// Sums of many terms nest to the left: they are walked in a loop.
    fn binary_expression(&mut self, binary: &syn::ExprBinary, expected: &Type) -> Evaluated {
        let mut spine = vec![binary];
        while let Expr::Binary(left) = &*spine[spine.len() - 1].left {
            if operator(&left.op).is_none() || operator(&spine[spine.len() - 1].op).is_none() {
                break;
            }
            spine.push(left);
        }
        let innermost = spine[spine.len() - 1];
        if operator(&innermost.op).is_none() {
            return self.other_binary(innermost);
        }
        let expected = expected.scalar();
        let mut value = self.expression(&innermost.left, &expected)?;
        for binary in spine.into_iter().rev() {
            self.tick(1, binary)?;
            let operator = operator(&binary.op).unwrap_or(Operator::Add);
            let shift = matches!(operator, Operator::Shl | Operator::Shr);
            let hint = match (&value, &expected) {
                _ if shift => Type::Unknown,
                (Value::Integer(Integer { ty: Some(ty), .. }), _) => Type::Integer(*ty),
                _ => expected.clone(),
            };
            let right = self.expression(&binary.right, &hint)?;
            value = self.binary(operator, &value, &right, binary)?;
        }
        Ok(value)
    }

    /// Comparisons, `&&`, `||`, compound assignments.
    fn other_binary(&mut self, binary: &syn::ExprBinary) -> Evaluated {
        if let Some(operator) = assignment_operator(&binary.op) {
            return self.compound_assignment(operator, binary);
        }
        let comparison = match &binary.op {
            syn::BinOp::And(_) | syn::BinOp::Or(_) => return self.logical(binary),
            syn::BinOp::Eq(_) => Comparison::Eq,
            syn::BinOp::Ne(_) => Comparison::Ne,
            syn::BinOp::Lt(_) => Comparison::Lt,
            syn::BinOp::Le(_) => Comparison::Le,
            syn::BinOp::Gt(_) => Comparison::Gt,
            syn::BinOp::Ge(_) => Comparison::Ge,
            _ => return Err(unsupported(binary, "this operator").into()),
        };
        let left = self.expression(&binary.left, &Type::Unknown)?;
        let hint = self.type_of(&left).scalar();
        let right = self.expression(&binary.right, &hint)?;
        Ok(self.compare(comparison, &left, &right, binary)?)
    }

    fn logical(&mut self, binary: &syn::ExprBinary) -> Evaluated {
        let and = matches!(binary.op, syn::BinOp::And(_));
        let left = self.expression(&binary.left, &Type::Bool)?;
        match self.truth(&left, &binary.left)? {
            Truth::Known(known) if known != and => Ok(Value::Bool(known)),
            Truth::Known(_) => {
                let right = self.expression(&binary.right, &Type::Bool)?;
                Ok(self.load(right, &binary.right)?)
            }
            Truth::When(node) => {
                // The right side is executed only if the left one says so; what it changes depends on that.
                let saved = self.scope.clone();
                let result = self.branch(|evaluator| evaluator.expression(&binary.right, &Type::Bool));
                self.scope = saved;
                let (right, changes) = result?;
                let right = self.load(right, &binary.right)?;
                let taken = if and { node } else { self.graph.not(node) };
                self.merge(taken, changes, Vec::new(), binary)?;
                let left = Value::Condition(node);
                Ok(if and { self.and(&left, &right, binary)? } else { self.or(&left, &right, binary)? })
            }
        }
    }

    fn unary_expression(&mut self, unary: &syn::ExprUnary, expected: &Type) -> Evaluated {
        match unary.op {
            syn::UnOp::Neg(_) => {
                let value = self.expression(&unary.expr, &expected.scalar())?;
                Ok(self.negate(&value, unary)?)
            }
            syn::UnOp::Not(_) => {
                let value = self.expression(&unary.expr, expected)?;
                Ok(self.invert(&value, unary)?)
            }
            syn::UnOp::Deref(_) => match self.expression(&unary.expr, expected)? {
                Value::Reference(place) => Ok(self.read(&place, unary)?),
                value => Ok(value),
            },
            _ => Err(unsupported(unary, "this operator").into()),
        }
    }

    fn array_expression(&mut self, array: &syn::ExprArray, expected: &Type) -> Evaluated {
        let hint = expected.element();
        let mut elements = Vec::with_capacity(array.elems.len());
        for element in &array.elems {
            elements.push(self.expression(element, &hint)?);
        }
        Ok(Value::array(elements))
    }

    fn repeat_expression(&mut self, repeat: &syn::ExprRepeat, expected: &Type) -> Evaluated {
        let value = self.expression(&repeat.expr, &expected.element())?;
        let length = match (&*repeat.len, expected) {
            (Expr::Infer(_), Type::Array(_, Some(length))) => *length,
            (Expr::Infer(_), _) => {
                return Err(error(&repeat.len, "write the length: nothing here tells it").into());
            }
            (length, _) => {
                let value = self.expression(length, &Type::Integer(IntegerType::Usize))?;
                self.usize(&value, length)?
            }
        };
        self.tick(length, repeat)?;
        Ok(Value::array(vec![value; length]))
    }

    fn struct_expression(&mut self, literal: &syn::ExprStruct, expected: &Type) -> Evaluated {
        let scope = self.scope.clone();
        let name = literal.path.to_token_stream().to_string();
        let mut variant = 0;
        let mut ty = self.resolve_path(&literal.path, &scope, 0)?;
        if !matches!(ty, Type::Struct(..)) && literal.path.segments.len() > 1 {
            let mut prefix = literal.path.clone();
            let last = prefix.segments.pop();
            ty = self.resolve_path(&prefix, &scope, 0)?;
            if let (Type::Struct(definition, _), Some(last)) = (&ty, last) {
                match super::path::position(definition, &last.ident.to_string()) {
                    Some(index) => variant = index,
                    None => return Err(error(&literal.path, format!("`{name}` is no variant")).into()),
                }
            }
        }
        if !matches!(ty, Type::Struct(..)) {
            // A variant that a `use` has brought here.
            let path = syn::ExprPath { attrs: Vec::new(), qself: None, path: literal.path.clone() };
            if let Named::Value(Value::Constructor(owner, index)) = self.named(&path)? {
                (ty, variant) = (owner, index);
            }
        }
        let Type::Struct(definition, mut arguments) = ty else {
            return Err(error(
                &literal.path,
                format!(
                    "the macro does not see the definition of `{name}`: define it in the body, or put it beside \
                     the model in a `#[dae] mod`"
                ),
            )
            .into());
        };
        if let Type::Struct(same, known) = expected
            && Rc::ptr_eq(same, &definition)
            && arguments.is_empty()
        {
            arguments = known.clone();
        }
        let types = self.field_types(&definition, variant, &arguments)?;
        let declared = &definition.variants[variant].fields;
        let mut fields = match &literal.rest {
            Some(rest) => {
                let value = self.expression(rest, expected)?;
                match self.load(value, rest)? {
                    Value::Struct(structure) if Rc::ptr_eq(&structure.definition, &definition) => {
                        structure.fields.clone()
                    }
                    other => {
                        let message = format!("expected a `{}`, found {}", definition.name, other.kind());
                        return Err(error(rest, message).into());
                    }
                }
            }
            None => vec![Value::Uninitialised; declared.len()],
        };
        for field in &literal.fields {
            let member = field.member.to_token_stream().to_string();
            let Some(index) = declared.iter().position(|(name, _)| *name == member) else {
                return Err(error(field, format!("`{}` has no field `{member}`", definition.name)).into());
            };
            let value = self.expression(&field.expr, &types[index])?;
            fields[index] = self.coerce(value, &types[index], &field.expr)?;
        }
        if fields.iter().any(|field| matches!(field, Value::Uninitialised)) {
            return Err(error(literal, format!("fields of `{}` are missing", definition.name)).into());
        }
        Ok(Value::Struct(Rc::new(Struct { definition, variant, fields })))
    }

    fn reference_expression(&mut self, reference: &syn::ExprReference, expected: &Type) -> Evaluated {
        if reference.mutability.is_none() {
            let value = self.expression(&reference.expr, expected)?;
            return Ok(self.load(value, reference)?);
        }
        match self.place_expected(&reference.expr, true, expected)? {
            Receiver::Place(place) => Ok(Value::Reference(self.follow(place, reference)?)),
            Receiver::Value(value @ Value::Reference(_)) => Ok(value),
            Receiver::Value(value) => Ok(Value::Reference(Place::new(value))),
        }
    }

    fn cast_expression(&mut self, cast: &syn::ExprCast) -> Evaluated {
        let scope = self.scope.clone();
        let ty = self.resolve(&cast.ty, &scope)?;
        let hint = if matches!(ty, Type::Real) { Type::Unknown } else { ty.scalar() };
        let hint = if matches!(&*cast.expr, Expr::Lit(_)) { hint } else { Type::Unknown };
        let value = self.expression(&cast.expr, &hint)?;
        let value = self.load(value, cast)?;
        Ok(match (ty, value) {
            (Type::Real, Value::Integer(integer)) => Value::Real(self.graph.constant(integer.value as f64)),
            (Type::Real, value @ Value::Real(_)) => value,
            (Type::Real, Value::Opaque(tokens)) => Value::Opaque(Rc::new(quote!((#tokens as f64)))),
            (Type::Integer(ty), Value::Integer(integer)) => Value::Integer(wrap(integer.value, ty)),
            (Type::Integer(ty), Value::Bool(value)) => {
                Value::Integer(Integer { value: i128::from(value), ty: Some(ty) })
            }
            (Type::Integer(ty), Value::Real(node)) => match self.graph.value(node) {
                Some(value) => {
                    // As `as` does it: towards zero, saturating, NaN is 0.
                    let value = (value as i128).clamp(ty.min(), ty.max());
                    Value::Integer(Integer { value, ty: Some(ty) })
                }
                None => {
                    return Err(unsupported(
                        cast,
                        "an integer that is computed from model quantities, which has no derivative,",
                    )
                    .into());
                }
            },
            (Type::Integer(ty), Value::Struct(structure)) if structure.definition.is_enum => {
                let mut value = 0;
                for (index, variant) in structure.definition.variants.iter().enumerate() {
                    if let Some(discriminant) = &variant.discriminant {
                        let discriminant = self.expression(discriminant, &Type::Unknown)?;
                        value = self.integer(&discriminant, cast)?.value;
                    }
                    if index == structure.variant {
                        break;
                    }
                    value += 1;
                }
                Value::Integer(wrap(value, ty))
            }
            (Type::Integer(_), Value::Opaque(_)) => return Err(opaque(cast, "an integer").into()),
            (Type::Bool, value @ (Value::Bool(_) | Value::Condition(_))) => value,
            (Type::Unknown, value) => value,
            (_, value) => {
                return Err(error(cast, format!("{} cannot be cast to this type", value.kind())).into());
            }
        })
    }

    fn range_expression(&mut self, range: &syn::ExprRange, _expected: &Type) -> Evaluated {
        let mut start = match &range.start {
            Some(start) => {
                let value = self.expression(start, &Type::Unknown)?;
                Some(self.load(value, start)?)
            }
            None => None,
        };
        let mut end = match &range.end {
            Some(end) => {
                let value = self.expression(end, &Type::Unknown)?;
                Some(self.load(value, end)?)
            }
            None => None,
        };
        // `0..n` is a range of the type of `n`.
        if let (Some(Value::Integer(a)), Some(Value::Integer(b))) = (&mut start, &mut end) {
            let ty = a.ty.or(b.ty);
            (a.ty, b.ty) = (ty, ty);
        }
        let inclusive = matches!(range.limits, syn::RangeLimits::Closed(_));
        Ok(Value::Range(Rc::new(Range { start, end, inclusive })))
    }

    fn return_expression(&mut self, inner: &syn::ExprReturn) -> Evaluated {
        let expected = self.returns.clone();
        let value = match &inner.expr {
            Some(expression) => self.expression(expression, &expected)?,
            None => Value::unit(),
        };
        self.check_return(inner)?;
        Err(Flow::Return(value))
    }

    /// `return` must not depend on model quantities.
    fn check_return(&mut self, at: At) -> Result<()> {
        if self.branches() > self.function_branches {
            return Err(error(
                at,
                "whether the function returns here depends on model quantities: write the condition as \
                 `if ... { a } else { b }` with the value as its result",
            ));
        }
        Ok(())
    }

    fn break_expression(&mut self, inner: &syn::ExprBreak) -> Evaluated {
        let value = match &inner.expr {
            Some(expression) => self.expression(expression, &Type::Unknown)?,
            None => Value::unit(),
        };
        let label = inner.label.as_ref().map(|label| label.ident.to_string());
        self.check_target(label, true, inner)?;
        Err(Flow::Break(inner.label.clone(), value))
    }

    /// `break` and `continue` must not depend on model quantities.
    fn check_target(&mut self, label: Option<String>, _is_break: bool, at: At) -> Result<()> {
        let target = self.targets.iter().rev().find(|(name, target, _)| match &label {
            Some(_) => *name == label,
            None => *target == Target::Loop,
        });
        match target {
            None => Err(error(at, "there is no loop around this")),
            Some((.., branches)) if self.branches() > *branches => Err(error(
                at,
                "how often the loop runs depends on model quantities: let it run a fixed number of times and \
                 choose the results by `if ... { a } else { b }`",
            )),
            Some(_) => Ok(()),
        }
    }

    /// The place an expression refers to, if it is one; its value otherwise.
    pub(super) fn place(&mut self, expression: &Expr, mutable: bool) -> Evaluated<Receiver> {
        self.place_expected(expression, mutable, &Type::Unknown)
    }

    fn place_expected(&mut self, expression: &Expr, mutable: bool, expected: &Type) -> Evaluated<Receiver> {
        match expression {
            Expr::Path(path) => Ok(match self.named(path)? {
                Named::Variable(cell) => Receiver::Place(Place { cell, path: Vec::new() }),
                Named::Value(value) => Receiver::Value(value),
                Named::Builtin(builtin) => Receiver::Value(self.builtin_value(builtin, path)),
            }),
            Expr::Paren(inner) => {
                self.deeper(expression, |e| e.place_expected(&inner.expr, mutable, expected))
            }
            Expr::Group(inner) => {
                self.deeper(expression, |e| e.place_expected(&inner.expr, mutable, expected))
            }
            Expr::Field(field) => self.deeper(expression, |e| e.field_place(field, mutable)),
            Expr::Index(index) => self.deeper(expression, |e| e.index_place(index, mutable)),
            Expr::Unary(unary) if matches!(unary.op, syn::UnOp::Deref(_)) => {
                let inner = self.deeper(expression, |e| e.place_expected(&unary.expr, mutable, expected))?;
                Ok(match inner {
                    Receiver::Place(place) => match self.read(&place, expression)? {
                        Value::Reference(target) => Receiver::Place(target),
                        _ => Receiver::Place(place),
                    },
                    Receiver::Value(Value::Reference(place)) => Receiver::Place(place),
                    value => value,
                })
            }
            other => Ok(Receiver::Value(self.expression(other, expected)?)),
        }
    }

    fn field_place(&mut self, field: &syn::ExprField, mutable: bool) -> Evaluated<Receiver> {
        let base = self.place(&field.base, mutable)?;
        let base = self.dereferenced(base, field)?;
        let value = base.value(self, field)?;
        match (field_projection(&value, &field.member), base) {
            (Ok(projection), Receiver::Place(place)) => {
                Ok(Receiver::Place(self.project(&place, projection, field)?))
            }
            (Ok(projection), Receiver::Value(value)) => {
                Ok(Receiver::Value(self.part(&value, projection, field)?))
            }
            (Err(_), _) => match (&value, &field.member) {
                (Value::Opaque(tokens), member) => {
                    Ok(Receiver::Value(Value::Opaque(Rc::new(quote!(#tokens.#member)))))
                }
                (Value::Range(range), syn::Member::Named(name)) => {
                    let part = if name == "start" { &range.start } else { &range.end };
                    match part {
                        Some(value) => Ok(Receiver::Value(value.clone())),
                        None => Err(error(field, "this range has no such end").into()),
                    }
                }
                (value, member) => {
                    let name = member.to_token_stream();
                    Err(error(field, format!("{} has no field `{name}`", value.kind())).into())
                }
            },
        }
    }

    /// With mutable references followed.
    pub(super) fn dereferenced(&mut self, receiver: Receiver, at: At) -> Result<Receiver> {
        Ok(match receiver {
            Receiver::Place(place) => Receiver::Place(self.follow(place, at)?),
            Receiver::Value(Value::Reference(place)) => Receiver::Place(self.follow(place, at)?),
            value => value,
        })
    }

    fn index_place(&mut self, index: &syn::ExprIndex, mutable: bool) -> Evaluated<Receiver> {
        let base = self.place(&index.expr, mutable)?;
        let base = self.dereferenced(base, index)?;
        let value = base.value(self, index)?;
        let hint = match &value {
            Value::Struct(_) => Type::Unknown,
            _ => Type::Integer(IntegerType::Usize),
        };
        let position = match &*index.index {
            // Literals in a range or tuple get their type too, but it does not matter for them.
            Expr::Range(_) | Expr::Tuple(_) => self.expression(&index.index, &Type::Unknown)?,
            expression => self.expression(expression, &hint)?,
        };
        let position = self.load(position, &index.index)?;
        let projection = match (&value, &position) {
            (Value::Struct(_), _) => {
                let name = if mutable { "index_mut" } else { "index" };
                let receiver = match (&base, mutable) {
                    (Receiver::Place(place), true) => Value::Reference(place.clone()),
                    _ => value.clone(),
                };
                let result = self.user_method("Index", name, &receiver, vec![position.clone()], index)?;
                return match result {
                    Some(Value::Reference(place)) => Ok(Receiver::Place(place)),
                    Some(value) => Ok(Receiver::Value(value)),
                    None => Err(error(index, "this struct cannot be indexed").into()),
                };
            }
            (Value::Opaque(tokens), Value::Integer(integer)) => {
                let position = proc_macro2::Literal::i128_unsuffixed(integer.value);
                return Ok(Receiver::Value(Value::Opaque(Rc::new(quote!(#tokens[#position])))));
            }
            (Value::Opaque(_), _) => return Err(opaque(&index.expr, "an array").into()),
            (_, Value::Real(_) | Value::Condition(_)) => {
                return Err(error(
                    &index.index,
                    "which element this is depends on model quantities: a graph model needs indices that are known \
                     at compile time",
                )
                .into());
            }
            (Value::Array(elements), Value::Range(range)) => {
                let (start, end) = self.bounds(range, elements.len(), &index.index)?;
                Projection::Slice(start, end)
            }
            (Value::Array(_), position) => Projection::Index(self.usize(position, &index.index)?),
            (Value::Matrix(_), Value::Tuple(parts)) if parts.len() == 2 => {
                let row = self.usize(&parts[0], &index.index)?;
                Projection::Element(row, self.usize(&parts[1], &index.index)?)
            }
            (Value::Matrix(matrix), position) => {
                let position = self.usize(position, &index.index)?;
                let rows = matrix.rows.max(1);
                if position >= matrix.elements.len() {
                    let length = matrix.elements.len();
                    return Err(error(
                        index,
                        format!("index out of range: the length is {length} but the index is {position}"),
                    )
                    .into());
                }
                Projection::Element(position % rows, position / rows)
            }
            (value, _) => return Err(error(index, format!("{} cannot be indexed", value.kind())).into()),
        };
        match base {
            Receiver::Place(place) => Ok(Receiver::Place(self.project(&place, projection, index)?)),
            Receiver::Value(value) => Ok(Receiver::Value(self.part(&value, projection, index)?)),
        }
    }

    /// First and end of a range of indices.
    pub fn bounds(&mut self, range: &Range, length: usize, at: At) -> Result<(usize, usize)> {
        let start = match &range.start {
            Some(start) => self.usize(start, at)?,
            None => 0,
        };
        let end = match &range.end {
            Some(end) => self.usize(end, at)?.saturating_add(usize::from(range.inclusive)),
            None => length,
        };
        Ok((start, end))
    }

    fn assignment(&mut self, assign: &syn::ExprAssign) -> Evaluated {
        match &*assign.left {
            Expr::Infer(_) => {
                self.expression(&assign.right, &Type::Unknown)?;
            }
            Expr::Tuple(_) | Expr::Array(_) | Expr::Struct(_) | Expr::Call(_) => {
                let value = self.expression(&assign.right, &Type::Unknown)?;
                self.assign_parts(&assign.left, value)?;
            }
            left => {
                let Receiver::Place(place) = self.place(left, true)? else {
                    return Err(error(left, "this cannot be assigned to").into());
                };
                let old = self.read(&place, left)?;
                let expected = self.type_of(&old);
                let value = self.expression(&assign.right, &expected)?;
                let value = self.coerce(value, &expected, &assign.right)?;
                self.write(&place, value, assign)?;
            }
        }
        Ok(Value::unit())
    }

    /// Destructuring assignment.
    fn assign_parts(&mut self, left: &Expr, value: Value) -> Evaluated<()> {
        self.deeper(left, |evaluator| evaluator.assign_parts_within(left, value))
    }

    fn assign_parts_within(&mut self, left: &Expr, value: Value) -> Evaluated<()> {
        let parts: Vec<&Expr> = match left {
            Expr::Infer(_) => return Ok(()),
            Expr::Paren(inner) => return self.assign_parts(&inner.expr, value),
            Expr::Tuple(tuple) => tuple.elems.iter().collect(),
            Expr::Array(array) => array.elems.iter().collect(),
            Expr::Call(call) => call.args.iter().collect(),
            Expr::Struct(literal) => {
                let Value::Struct(structure) = &value else {
                    return Err(error(left, format!("expected a struct, found {}", value.kind())).into());
                };
                let names: Vec<String> = structure.definition.variants[structure.variant]
                    .fields
                    .iter()
                    .map(|f| f.0.clone())
                    .collect();
                for field in &literal.fields {
                    let member = field.member.to_token_stream().to_string();
                    match names.iter().position(|name| *name == member) {
                        Some(index) => self.assign_parts(&field.expr, structure.fields[index].clone())?,
                        None => return Err(error(field, format!("there is no field `{member}`")).into()),
                    }
                }
                return Ok(());
            }
            left => {
                let Receiver::Place(place) = self.place(left, true)? else {
                    return Err(error(left, "this cannot be assigned to").into());
                };
                return Ok(self.write(&place, value, left)?);
            }
        };
        let value = self.load(value, left)?;
        let values: Vec<Value> = match &value {
            Value::Tuple(values) | Value::Array(values) => values.to_vec(),
            Value::Struct(structure) => structure.fields.clone(),
            other => return Err(error(left, format!("{} has no such parts", other.kind())).into()),
        };
        let is_rest =
            |part: &&Expr| matches!(part, Expr::Range(range) if range.start.is_none() && range.end.is_none());
        let rest = parts.iter().position(is_rest);
        let count = parts.len() - usize::from(rest.is_some());
        if count > values.len() || rest.is_none() && count != values.len() {
            let length = values.len();
            return Err(
                error(left, format!("there are {count} parts on the left, but {length} values")).into()
            );
        }
        for (index, part) in parts.iter().enumerate() {
            let position = match rest {
                Some(rest) if index == rest => continue,
                Some(rest) if index > rest => values.len() - (parts.len() - index),
                _ => index,
            };
            self.assign_parts(part, values[position].clone())?;
        }
        Ok(())
    }

    fn compound_assignment(&mut self, operator: Operator, binary: &syn::ExprBinary) -> Evaluated {
        let place = match self.place(&binary.left, true)? {
            Receiver::Place(place) => self.follow(place, binary)?,
            Receiver::Value(Value::Reference(place)) => place,
            Receiver::Value(_) => {
                return Err(error(&binary.left, "this cannot be assigned to").into());
            }
        };
        let before = self.read(&place, binary)?;
        let shift = matches!(operator, Operator::Shl | Operator::Shr);
        let hint = if shift { Type::Unknown } else { self.type_of(&before).scalar() };
        let right = self.expression(&binary.right, &hint)?;
        let (of, method) = operator.method();
        let name = format!("{method}_assign");
        if matches!(before, Value::Struct(_))
            && self
                .user_method(
                    &format!("{of}Assign"),
                    &name,
                    &Value::Reference(place.clone()),
                    vec![right.clone()],
                    binary,
                )?
                .is_some()
        {
            return Ok(Value::unit());
        }
        let before = self.read(&place, binary)?;
        let value = self.binary(operator, &before, &right, binary)?;
        self.write(&place, value, binary)?;
        Ok(Value::unit())
    }

    /// `if`: where the condition is known, the branch taken; otherwise both, and a selection.
    fn if_expression(&mut self, branch: &syn::ExprIf, expected: &Type) -> Evaluated {
        let saved = self.scope.clone();
        let truth = self.condition(&branch.cond);
        let truth = match truth {
            Ok(truth) => truth,
            Err(flow) => {
                self.scope = saved;
                return Err(flow);
            }
        };
        match truth {
            Truth::Known(true) => {
                let value = self.block(&branch.then_branch, expected);
                self.scope = saved;
                value
            }
            Truth::Known(false) => {
                self.scope = saved;
                match &branch.else_branch {
                    Some((_, otherwise)) => self.expression(otherwise, expected),
                    None => Ok(Value::unit()),
                }
            }
            Truth::When(node) => {
                let then = self.branch(|evaluator| evaluator.block(&branch.then_branch, expected));
                self.scope = saved;
                let (then, then_changes) = then?;
                let (otherwise, else_changes) = match &branch.else_branch {
                    Some((_, otherwise)) => {
                        self.branch(|evaluator| evaluator.expression(otherwise, expected))?
                    }
                    None => (Value::unit(), Vec::new()),
                };
                self.merge(node, then_changes, else_changes, &branch.cond)?;
                let at: At = match (&branch.else_branch, branch.then_branch.stmts.last()) {
                    (Some(_), Some(last)) => last,
                    _ => &branch.cond,
                };
                Ok(self.select(node, &then, &otherwise, at)?)
            }
        }
    }

    /// The condition of `if` and `while`: what `let` in it declares is in the scope afterwards.
    pub(super) fn condition(&mut self, expression: &Expr) -> Evaluated<Truth> {
        match expression {
            Expr::Let(inner) => {
                let subject = match self.place(&inner.expr, false)? {
                    Receiver::Place(place) => Subject::Place(place, false),
                    Receiver::Value(value) => Subject::Value(value),
                };
                let mut bindings = Vec::new();
                let truth = self.matches(&inner.pat, subject, &mut bindings)?;
                if truth != Truth::Known(false) {
                    self.declare(bindings);
                }
                Ok(truth)
            }
            Expr::Binary(binary) if matches!(binary.op, syn::BinOp::And(_)) && has_let(expression) => {
                match self.condition(&binary.left)? {
                    Truth::Known(false) => Ok(Truth::Known(false)),
                    Truth::Known(true) => self.condition(&binary.right),
                    Truth::When(left) => Ok(match self.condition(&binary.right)? {
                        Truth::Known(true) => Truth::When(left),
                        Truth::Known(false) => Truth::Known(false),
                        Truth::When(right) => Truth::When(self.graph.and(left, right)),
                    }),
                }
            }
            _ => {
                let value = self.expression(expression, &Type::Bool)?;
                self.truth(&value, expression)
            }
        }
    }

    fn match_expression(&mut self, choice: &syn::ExprMatch, expected: &Type) -> Evaluated {
        let subject = match self.place(&choice.expr, false)? {
            Receiver::Place(place) => Subject::Place(place, false),
            Receiver::Value(value) => Subject::Value(value),
        };
        self.match_arms(choice, &choice.arms, &subject, expected)
    }

    fn match_arms(
        &mut self,
        choice: &syn::ExprMatch,
        arms: &[syn::Arm],
        subject: &Subject,
        expected: &Type,
    ) -> Evaluated {
        let mut arms = arms;
        while let [arm, rest @ ..] = arms {
            arms = rest;
            let mut bindings = Vec::new();
            let mut truth = self.matches(&arm.pat, subject.clone(), &mut bindings)?;
            // The arms of a `match` are exhaustive: the last one is taken if no other is.
            if rest.is_empty() && matches!(truth, Truth::When(_)) && !matches!(arm.pat, syn::Pat::Guard(_)) {
                truth = Truth::Known(true);
            }
            if truth == Truth::Known(false) {
                continue;
            }
            let saved = self.scope.clone();
            if let Truth::When(node) = truth {
                let then = self.branch(|evaluator| {
                    evaluator.declare(bindings);
                    evaluator.expression(&arm.body, expected)
                });
                self.scope = saved;
                let (then, then_changes) = then?;
                let (otherwise, else_changes) = self.branch(|evaluator| {
                    evaluator
                        .deeper(choice, |evaluator| evaluator.match_arms(choice, rest, subject, expected))
                })?;
                self.merge(node, then_changes, else_changes, arm)?;
                return Ok(self.select(node, &then, &otherwise, arm)?);
            }
            self.declare(bindings);
            let value = self.expression(&arm.body, expected);
            self.scope = saved;
            return value;
        }
        Err(error(&choice.expr, "no arm of this `match` is for this value").into())
    }
}

/// The operators that yield numbers.
fn operator(op: &syn::BinOp) -> Option<Operator> {
    Some(match op {
        syn::BinOp::Add(_) => Operator::Add,
        syn::BinOp::Sub(_) => Operator::Sub,
        syn::BinOp::Mul(_) => Operator::Mul,
        syn::BinOp::Div(_) => Operator::Div,
        syn::BinOp::Rem(_) => Operator::Rem,
        syn::BinOp::BitXor(_) => Operator::BitXor,
        syn::BinOp::BitAnd(_) => Operator::BitAnd,
        syn::BinOp::BitOr(_) => Operator::BitOr,
        syn::BinOp::Shl(_) => Operator::Shl,
        syn::BinOp::Shr(_) => Operator::Shr,
        _ => return None,
    })
}

fn assignment_operator(op: &syn::BinOp) -> Option<Operator> {
    Some(match op {
        syn::BinOp::AddAssign(_) => Operator::Add,
        syn::BinOp::SubAssign(_) => Operator::Sub,
        syn::BinOp::MulAssign(_) => Operator::Mul,
        syn::BinOp::DivAssign(_) => Operator::Div,
        syn::BinOp::RemAssign(_) => Operator::Rem,
        syn::BinOp::BitXorAssign(_) => Operator::BitXor,
        syn::BinOp::BitAndAssign(_) => Operator::BitAnd,
        syn::BinOp::BitOrAssign(_) => Operator::BitOr,
        syn::BinOp::ShlAssign(_) => Operator::Shl,
        syn::BinOp::ShrAssign(_) => Operator::Shr,
        _ => return None,
    })
}

fn has_let(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) if matches!(binary.op, syn::BinOp::And(_)) => {
            has_let(&binary.left) || has_let(&binary.right)
        }
        _ => false,
    }
}

/// The way from a value to its field.
fn field_projection(value: &Value, member: &syn::Member) -> std::result::Result<Projection, ()> {
    match (value, member) {
        (Value::Tuple(_), syn::Member::Unnamed(index)) => Ok(Projection::Field(index.index as usize)),
        (Value::Struct(structure), member) => {
            let name = member.to_token_stream().to_string();
            let fields = &structure.definition.variants[structure.variant].fields;
            fields.iter().position(|(field, _)| *field == name).map(Projection::Field).ok_or(())
        }
        (Value::Matrix(matrix), syn::Member::Named(name)) => {
            let name = name.to_string();
            if matrix.rows == 1 || matrix.columns == 1 {
                let index =
                    ["x", "y", "z", "w", "a", "b"].iter().position(|field| *field == name).ok_or(())?;
                return Ok(if matrix.columns == 1 {
                    Projection::Element(index, 0)
                } else {
                    Projection::Element(0, index)
                });
            }
            let digits: Vec<usize> = match name.strip_prefix('m') {
                Some(digits) => digits.chars().filter_map(|c| c.to_digit(10)).map(|d| d as usize).collect(),
                None => return Err(()),
            };
            match digits.as_slice() {
                &[row, column] if row > 0 && column > 0 => Ok(Projection::Element(row - 1, column - 1)),
                _ => Err(()),
            }
        }
        _ => Err(()),
    }
}
