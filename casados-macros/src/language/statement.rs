//! Blocks, `let`, loops, and the supported macros.

use super::evaluator::{Evaluated, Evaluator, Flow, Target, TokenSpan, error, unsupported};
use super::methods::{Receiver, iterator};
use super::pattern::{Subject, Truth};
use super::types::Type;
use super::value::Value;
use quote::ToTokens;
use syn::parse::{ParseStream, Parser};
use syn::punctuated::Punctuated;
use syn::{Expr, Stmt, Token};

impl Evaluator {
    /// Evaluates a block in its own scope.
    pub(super) fn block(&mut self, block: &syn::Block, expected: &Type) -> Evaluated {
        let saved = self.scope.clone();
        let result = self.statements(block, expected);
        self.scope = saved;
        result
    }

    fn statements(&mut self, block: &syn::Block, expected: &Type) -> Evaluated {
        if block.stmts.iter().any(|statement| matches!(statement, Stmt::Item(_))) {
            let parent = self.scope.clone();
            let items = block.stmts.iter().filter_map(|statement| match statement {
                Stmt::Item(item) => Some(item),
                _ => None,
            });
            self.scope = self.items(items, &parent)?;
        }
        let mut value = Value::unit();
        for statement in &block.stmts {
            value = match statement {
                Stmt::Item(_) => continue,
                Stmt::Local(local) => {
                    if let Some(cfg) = local.attrs.iter().find(|attribute| attribute.path().is_ident("cfg")) {
                        return Err(unsupported(cfg, "a statement under a condition of the compiler").into());
                    }
                    self.let_statement(local, &hint(block, local, expected))?;
                    Value::unit()
                }
                Stmt::Expr(expression, None) => self.expression(expression, expected)?,
                Stmt::Expr(expression, Some(_)) => {
                    self.expression(expression, &Type::Unknown)?;
                    Value::unit()
                }
                Stmt::Macro(call) => {
                    let value = self.macro_call(&call.mac, expected)?;
                    if call.semi_token.is_some() { Value::unit() } else { value }
                }
            };
        }
        Ok(value)
    }

    /// `let`
    fn let_statement(&mut self, local: &syn::Local, hint: &Type) -> Evaluated<()> {
        let (pattern, ty) = match &local.pat {
            syn::Pat::Type(pattern) => {
                let scope = self.scope.clone();
                (&*pattern.pat, self.resolve(&pattern.ty, &scope)?)
            }
            pattern => (pattern, Type::Unknown),
        };
        let expected = if matches!(ty, Type::Unknown) { hint } else { &ty };
        let Some(init) = &local.init else {
            let bindings = self.bind(pattern, Subject::Value(Value::Uninitialised))?;
            self.declare(bindings);
            return Ok(());
        };
        let subject = if declares_reference(pattern) {
            match self.place(&init.expr, true)? {
                Receiver::Place(place) => Subject::Place(place, false),
                Receiver::Value(value) => Subject::Value(value),
            }
        } else {
            let value = self.expression(&init.expr, expected)?;
            Subject::Value(self.coerce(value, &ty, &init.expr)?)
        };
        let bindings = match &init.diverge {
            None => self.bind(pattern, subject)?,
            Some((_, otherwise)) => {
                let mut bindings = Vec::new();
                match self.matches(pattern, subject, &mut bindings)? {
                    Truth::Known(true) => bindings,
                    Truth::Known(false) => {
                        self.expression(otherwise, &Type::Unknown)?;
                        return Err(error(otherwise, "the `else` of a `let` must not come to its end").into());
                    }
                    Truth::When(_) => {
                        let what = "a pattern that matches or not depending on model variables";
                        return Err(unsupported(pattern, what).into());
                    }
                }
            }
        };
        self.declare(bindings);
        Ok(())
    }

    pub(super) fn labelled_block(&mut self, block: &syn::ExprBlock, expected: &Type) -> Evaluated {
        let Some(label) = &block.label else { return self.block(&block.block, expected) };
        let label = label.name.ident.to_string();
        let branches = self.open_branch_count();
        self.targets.push((Some(label.clone()), Target::Block, branches));
        let result = self.block(&block.block, expected);
        self.targets.pop();
        match result {
            Err(Flow::Break(Some(target), value)) if target.ident == label => Ok(value),
            other => other,
        }
    }

    /// Executes the body of a loop once: `Some` if `break` ended the loop.
    fn turn(&mut self, label: Option<&String>, body: &syn::Block) -> Evaluated<Option<Value>> {
        let ours = |target: &Option<syn::Lifetime>| match target {
            None => true,
            Some(target) => label.is_some_and(|label| target.ident == label),
        };
        let branches = self.open_branch_count();
        self.targets.push((label.cloned(), Target::Loop, branches));
        let result = self.block(body, &Type::Unknown);
        self.targets.pop();
        match result {
            Ok(_) => Ok(None),
            Err(Flow::Break(target, value)) if ours(&target) => Ok(Some(value)),
            Err(Flow::Continue(target)) if ours(&target) => Ok(None),
            Err(other) => Err(other),
        }
    }

    pub(super) fn for_loop(&mut self, inner: &syn::ExprForLoop) -> Evaluated {
        let label = inner.label.as_ref().map(|label| label.name.ident.to_string());
        let source = self.expression(&inner.expr, &Type::Unknown)?;
        // `for x in &mut iterator` leaves the rest of the iterator in the variable.
        let shared = match &source {
            Value::Reference(place) => {
                let place = self.follow_place(place.clone(), &inner.expr)?;
                matches!(self.read(&place, &inner.expr)?, Value::Iterator(_)).then_some(place)
            }
            _ => None,
        };
        let mut iterator = match &shared {
            Some(place) => {
                let value = self.read(place, &inner.expr)?;
                iterator::into_iter(self, value, &inner.expr)?
            }
            None => iterator::into_iter(self, source, &inner.expr)?,
        };
        loop {
            self.count_steps(1, inner)?;
            let next = iterator.next(self, &inner.expr)?;
            if let Some(place) = &shared {
                self.write(place, Value::iterator(iterator.clone()), &inner.expr)?;
            }
            let Some(element) = next else { break };
            let saved = self.scope.clone();
            let result = self.bind(&inner.pat, Subject::Value(element)).and_then(|bindings| {
                self.declare(bindings);
                self.turn(label.as_ref(), &inner.body)
            });
            self.scope = saved;
            if result?.is_some() {
                break;
            }
        }
        Ok(Value::unit())
    }

    pub(super) fn while_loop(&mut self, inner: &syn::ExprWhile) -> Evaluated {
        let label = inner.label.as_ref().map(|label| label.name.ident.to_string());
        loop {
            self.count_steps(1, inner)?;
            let saved = self.scope.clone();
            let result = match self.condition(&inner.cond) {
                Ok(Truth::Known(true)) => self.turn(label.as_ref(), &inner.body),
                Ok(Truth::Known(false)) => Ok(Some(Value::unit())),
                Ok(Truth::When(_)) => Err(error(
                    &inner.cond,
                    "how often this loop runs depends on model variables: let it run a fixed number of times, \
                     or make the model generic, `fn f<T: DualNum + Copy>(...)`",
                )
                .into()),
                Err(flow) => Err(flow),
            };
            self.scope = saved;
            if result?.is_some() {
                return Ok(Value::unit());
            }
        }
    }

    pub(super) fn endless_loop(&mut self, inner: &syn::ExprLoop, _expected: &Type) -> Evaluated {
        let label = inner.label.as_ref().map(|label| label.name.ident.to_string());
        loop {
            self.count_steps(1, inner)?;
            if let Some(value) = self.turn(label.as_ref(), &inner.body)? {
                return Ok(value);
            }
        }
    }

    /// `assert!` and its relatives, `matches!`, and nalgebra's `vector!` and `matrix!`.
    pub(super) fn macro_call(&mut self, call: &syn::Macro, _expected: &Type) -> Evaluated {
        let name = call.path.segments.last().map(|last| last.ident.to_string()).unwrap_or_default();
        let tokens = call.tokens.clone();
        let list = Punctuated::<Expr, Token![,]>::parse_terminated;
        match name.as_str() {
            "assert" | "debug_assert" => {
                let arguments = list.parse2(tokens)?;
                let Some(condition) = arguments.first() else {
                    return Err(error(call, "there is nothing to assert").into());
                };
                let value = self.expression(condition, &Type::Bool)?;
                self.check_assertion(call, &value, condition, || assertion_message(&arguments, 1))
            }
            "assert_eq" | "debug_assert_eq" | "assert_ne" | "debug_assert_ne" => {
                let arguments = list.parse2(tokens)?;
                let (Some(a), Some(b)) = (arguments.first(), arguments.get(1)) else {
                    return Err(error(call, "this needs two values").into());
                };
                let x = self.expression(a, &Type::Unknown)?;
                let y = self.expression(b, &Type::Unknown)?;
                let comparison = if name.ends_with("eq") {
                    super::arithmetic::Comparison::Eq
                } else {
                    super::arithmetic::Comparison::Ne
                };
                let value = self.compare(comparison, &x, &y, call)?;
                self.check_assertion(call, &value, call, || assertion_message(&arguments, 2))
            }
            "matches" => {
                let parts = |input: ParseStream| {
                    let subject: Expr = input.parse()?;
                    input.parse::<Token![,]>()?;
                    let pattern: proc_macro2::TokenStream = input.parse()?;
                    syn::parse2::<Expr>(quote::quote!(match #subject { #pattern => true, _ => false }))
                };
                let choice = parts.parse2(tokens)?;
                self.expression(&choice, &Type::Bool)
            }
            "panic" | "unreachable" | "todo" | "unimplemented" => {
                let message = match list.parse2(tokens) {
                    Ok(arguments) => assertion_message(&arguments, 0),
                    Err(_) => DEFAULT_PANIC_MESSAGE.to_owned(),
                };
                Err(error(call, message).into())
            }
            "vector" => {
                let mut elements = Vec::new();
                for element in list.parse2(tokens)? {
                    elements.push(self.expression(&element, &Type::Real)?);
                }
                Ok(Value::matrix(elements.len(), 1, elements))
            }
            "matrix" => self.matrix_of_rows(call, &rows_of_matrix.parse2(tokens)?),
            _ => Err(unsupported(call, format!("the macro `{name}!`")).into()),
        }
    }

    /// An assertion of a known condition; `at` is the position of its error.
    fn check_assertion(
        &mut self,
        call: &syn::Macro,
        value: &Value,
        at: TokenSpan,
        message: impl FnOnce() -> String,
    ) -> Evaluated {
        match self.truth(value, at)? {
            Truth::Known(true) => Ok(Value::unit()),
            Truth::Known(false) => Err(error(at, message()).into()),
            Truth::When(_) => Err(runtime_assertion(call).into()),
        }
    }

    /// `matrix!`, in row-major order.
    fn matrix_of_rows(&mut self, call: &syn::Macro, rows: &[Vec<Expr>]) -> Evaluated {
        let columns = rows.first().map_or(0, Vec::len);
        if rows.iter().any(|row| row.len() != columns) {
            return Err(error(call, "the rows of this matrix differ in length").into());
        }
        let mut elements = vec![Value::Uninitialised; rows.len() * columns];
        for (r, row) in rows.iter().enumerate() {
            for (c, element) in row.iter().enumerate() {
                elements[r + c * rows.len()] = self.expression(element, &Type::Real)?;
            }
        }
        Ok(Value::matrix(rows.len(), columns, elements))
    }
}

/// Elements between commas, rows between semicolons.
fn rows_of_matrix(input: ParseStream) -> syn::Result<Vec<Vec<Expr>>> {
    let mut rows = vec![Vec::new()];
    while !input.is_empty() {
        let element: Expr = input.parse()?;
        if let Some(row) = rows.last_mut() {
            row.push(element);
        }
        if input.peek(Token![;]) {
            input.parse::<Token![;]>()?;
            if !input.is_empty() {
                rows.push(Vec::new());
            }
        } else if !input.is_empty() {
            input.parse::<Token![,]>()?;
        }
    }
    Ok(rows)
}

/// The type of a variable, inferred from the end of a block: in `let mut r = zeros(); ...; r` it is
/// that of the block.
fn hint(block: &syn::Block, local: &syn::Local, expected: &Type) -> Type {
    let (syn::Pat::Ident(name), Some(Stmt::Expr(Expr::Path(tail), None))) = (&local.pat, block.stmts.last())
    else {
        return Type::Unknown;
    };
    let declarations = block.stmts.iter().filter(|statement| {
        matches!(statement, Stmt::Local(syn::Local { pat: syn::Pat::Ident(other), .. }) if other.ident == name.ident)
    });
    if tail.path.is_ident(&name.ident) && declarations.count() == 1 {
        expected.clone()
    } else {
        Type::Unknown
    }
}

/// The error of a `panic!` without a message.
const DEFAULT_PANIC_MESSAGE: &str = "this is reached when the macro evaluates the model";

/// The user's message of a failed assertion, or a default one.
fn assertion_message(arguments: &Punctuated<Expr, Token![,]>, position: usize) -> String {
    match arguments.get(position) {
        Some(Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(text), .. })) => text.value(),
        _ if position == 0 => DEFAULT_PANIC_MESSAGE.to_owned(),
        _ => {
            let text = arguments.first().map(|a| a.to_token_stream().to_string()).unwrap_or_default();
            format!("this assertion does not hold: `{text}`")
        }
    }
}

fn runtime_assertion(call: &syn::Macro) -> syn::Error {
    error(
        call,
        "this assertion depends on model variables, which are not known at compile time: remove it, or make the \
         model generic, `fn f<T: DualNum + Copy>(...)`",
    )
}

/// Whether a pattern contains `ref mut`.
fn declares_reference(pattern: &syn::Pat) -> bool {
    use syn::visit::Visit;
    struct Search(bool);
    impl<'a> Visit<'a> for Search {
        fn visit_pat_ident(&mut self, name: &'a syn::PatIdent) {
            self.0 |= name.by_ref.is_some() && name.mutability.is_some();
            if let Some((_, inner)) = &name.subpat {
                self.visit_pat(inner);
            }
        }
        fn visit_expr(&mut self, _: &'a Expr) {}
    }
    let mut search = Search(false);
    search.visit_pat(pattern);
    search.0
}
