//! A list of expressions as Rust functions: straight-line code, generic over the scalar.

use super::chunk::{self, Chunk, Plan};
use super::divisor;
use super::schedule::{self, Statement, Values};
use super::simultaneous::{self, Function};
use super::text::{binary_text, number_text, unary};
use crate::graph::{Binary, Compare, Graph, Node, Op, Table, Unary};
use crate::language::{self, Variables};
use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;

/// Maximum number of statements of a function. The pieces of a longer routine are not inlined: a
/// single function would take longer to compile, and spill more registers than the calls cost.
const MAX_STATEMENTS: usize = 500;

/// The constants and tables of a model from outside.
#[derive(Clone, Copy)]
pub struct OuterConstants<'a> {
    /// The number of its constants.
    pub constants: usize,
    /// Its tables.
    pub tables: &'a [language::Table],
}

/// A function to be written.
pub struct Routine<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its documentation: one line.
    pub documentation: &'a str,
    /// The arrays it reads: name and length.
    pub inputs: &'a [(&'a str, usize)],
    /// The arrays it writes: name and length.
    pub outputs: &'a [(&'a str, usize)],
    /// The stores: array, element, value.
    pub stores: Vec<(&'a str, usize, Node)>,
}

impl Routine<'_> {
    /// Writes the routine. `S: Scalar` must be in scope.
    pub fn write(&self, graph: &Graph, variables: &Variables, outside: OuterConstants) -> String {
        let outputs: Vec<Node> = self.stores.iter().map(|store| store.2).collect();
        let steps = simultaneous::group_simultaneous_calls(graph, &schedule::schedule(graph, &outputs));
        let operations = steps.iter().copied().flat_map(chunk::computed).count();
        let plan = chunk::plan(graph, &outputs, &steps, MAX_STATEMENTS);
        let mut names = vec![u32::MAX; graph.len()];
        for (name, node) in (0..).zip(steps.iter().copied().flat_map(chunk::computed)) {
            names[node.0 as usize] = name;
        }
        let mut uses = vec![0u32; graph.len()];
        for node in steps.iter().flat_map(|&step| chunk::read(graph, &outputs, step)) {
            uses[node.at()] += 1;
        }
        let writer = RoutineWriter {
            routine: self,
            graph,
            variables,
            outside,
            outputs: &outputs,
            names: &names,
            uses: &uses,
            in_place: HashMap::new(),
        };

        let mut text = String::new();
        let count = if operations == 1 { "operation" } else { "operations" };
        let _ = writeln!(text, "/// {} {operations} {count}.", self.documentation);
        writer.write_driver(&mut text, &plan);
        for (number, piece) in plan.chunks.iter().enumerate() {
            let in_place = writer.read_in_place(&steps[piece.steps.clone()], piece);
            RoutineWriter { in_place, ..writer.clone() }
                .write_piece(&mut text, number, &steps, piece, plan.slots);
        }
        text
    }
}

#[derive(Clone)]
struct RoutineWriter<'a> {
    routine: &'a Routine<'a>,
    graph: &'a Graph,
    variables: &'a Variables,
    outside: OuterConstants<'a>,
    outputs: &'a [Node],
    /// The index of the local variable of each node.
    names: &'a [u32],
    /// The number of reads of each node.
    uses: &'a [u32],
    /// Values of earlier pieces that are read once, directly from their slots.
    in_place: HashMap<Node, usize>,
}

impl RoutineWriter<'_> {
    /// The arguments of a piece: name and type, with or without a lifetime. Tables are values of
    /// types of size zero.
    fn arguments(&self, slots: usize, lifetime: &str) -> Vec<(String, String)> {
        let Routine { inputs, outputs, .. } = self.routine;
        let OuterConstants { constants, tables } = self.outside;
        let mut arguments = Vec::new();
        arguments.extend((constants > 0).then(|| ("c".into(), format!("&{lifetime}[f64; {constants}]"))));
        arguments.extend((0..tables.len()).map(|k| (format!("table_{k}"), format!("Table{k}"))));
        let named = |(name, ty): (&str, String)| (name.to_owned(), ty);
        arguments
            .extend(inputs.iter().map(|(name, n)| (*name, format!("&{lifetime}[S::Cell; {n}]"))).map(named));
        arguments.extend((slots > 0).then(|| ("w", format!("&{lifetime}mut [S; {slots}]"))).map(named));
        let cells = |n: usize| format!("&{lifetime}mut [S::Cell; {n}]");
        arguments.extend(outputs.iter().map(|&(name, n)| (name, cells(n))).map(named));
        arguments
    }

    /// The generic parameters of a routine and its pieces.
    fn parameters(&self) -> String {
        let mut parameters = String::from("S: Scalar");
        for (k, table) in self.outside.tables.iter().enumerate() {
            let _ = write!(parameters, ", Table{k}: Table<{}> + Copy", table.variables);
        }
        parameters
    }

    /// The generic arguments of these.
    fn generic_arguments(&self) -> String {
        let mut types = String::from("S");
        for k in 0..self.outside.tables.len() {
            let _ = write!(types, ", Table{k}");
        }
        types
    }

    /// The name of the type of a piece.
    fn name(&self, number: usize) -> String {
        format!("Piece_{}_{number}", self.routine.name)
    }

    /// Writes the function that calls the pieces.
    fn write_driver(&self, text: &mut String, plan: &Plan) {
        // Callers name the scalar only.
        let mut parameters: Vec<String> =
            self.arguments(0, "").iter().map(|(name, ty)| format!("{name}: {ty}")).collect();
        for (k, table) in self.outside.tables.iter().enumerate() {
            let at = usize::from(self.outside.constants > 0) + k;
            parameters[at] = format!("table_{k}: impl Table<{}> + Copy", table.variables);
        }
        let name = self.routine.name;
        let _ = writeln!(text, "#[inline]\npub fn {name}<S: Scalar>({}) {{", parameters.join(", "));
        if plan.slots > 0 {
            let _ = writeln!(text, "let mut w = S::zeros::<{}>();", plan.slots);
        }
        let names: Vec<String> = self
            .arguments(plan.slots, "")
            .into_iter()
            .map(|(name, _)| if name == "w" { String::from("&mut w") } else { name })
            .collect();
        let (names, types) = (names.join(", "), format!("S{}", ", _".repeat(self.outside.tables.len())));
        for number in 0..plan.chunks.len() {
            let _ = writeln!(text, "S::vectorize({}::<{types}>({names}));", self.name(number));
        }
        text.push_str("}\n");
    }

    fn write_piece(
        &self,
        text: &mut String,
        number: usize,
        steps: &[Statement],
        piece: &Chunk,
        slots: usize,
    ) {
        let name = self.name(number);
        let (names, types): (Vec<String>, Vec<String>) = self.arguments(slots, "'a ").into_iter().unzip();
        let generics = self.parameters();
        let _ = writeln!(text, "struct {name}<'a, {generics}>({});", types.join(", "));
        let _ = writeln!(text, "impl<{generics}> Piece for {name}<'_, {}> {{", self.generic_arguments());
        let _ = writeln!(text, "#[inline(always)]\nfn run(self) {{\nlet Self({}) = self;", names.join(", "));
        let steps = &steps[piece.steps.clone()];

        self.write_loads(text, steps, piece);
        let mut steps = steps.iter().copied().peekable();
        while let Some(step) = steps.next() {
            // A value that is only stored needs no name.
            if let Statement::Compute(node) = step
                && let Some(Statement::Store(output)) =
                    steps.next_if(|next| self.uses[node.at()] == 1 && self.stores(*next, node))
            {
                self.write_store(text, output, &self.expression_text(node));
                continue;
            }
            self.write_step(text, step);
            self.write_spills(text, step, piece);
        }
        text.push_str("}\n}\n");
    }

    /// Whether a statement stores a node.
    fn stores(&self, step: Statement, node: Node) -> bool {
        matches!(step, Statement::Store(output) if self.outputs[output] == node)
    }

    /// Values of earlier pieces that are read once, in slots that the piece does not write.
    fn read_in_place(&self, steps: &[Statement], piece: &Chunk) -> HashMap<Node, usize> {
        let mut uses: HashMap<Node, usize> = HashMap::new();
        for node in steps.iter().flat_map(|&step| chunk::read(self.graph, self.outputs, step)) {
            *uses.entry(node).or_default() += 1;
        }
        let written: BTreeSet<usize> = piece.spills.values().copied().collect();
        let once = |&(node, slot): &(Node, usize)| {
            uses.get(&node) == Some(&1) && !written.contains(&slot) && !self.is_condition(node)
        };
        piece.loads.iter().copied().filter(once).collect()
    }

    /// Writes the loads of a piece: variables, seeds, and values of earlier pieces.
    fn write_loads(&self, text: &mut String, steps: &[Statement], piece: &Chunk) {
        let read = steps.iter().flat_map(|&step| chunk::read(self.graph, self.outputs, step));
        let (mut variables, mut seeds) = (BTreeSet::new(), BTreeSet::new());
        for node in read {
            match self.graph.op(node) {
                Op::Variable(index) => variables.insert(index),
                Op::Seed(row) => seeds.insert(row),
                _ => false,
            };
        }
        for index in variables {
            let _ = writeln!(text, "let {} = S::load(&v[{index}]);", self.variable(index));
        }
        for row in seeds {
            let _ = writeln!(text, "let mu_{row} = S::load(&mu[{row}]);");
        }
        for &(node, slot) in piece.loads.iter().filter(|(node, _)| !self.in_place.contains_key(node)) {
            let name = self.names[node.0 as usize];
            if self.is_condition(node) {
                let _ = writeln!(text, "let v{name} = S::eq(w[{slot}], S::from_f64(1.0));");
            } else {
                let _ = writeln!(text, "let v{name} = w[{slot}];");
            }
        }
    }

    /// Writes one statement.
    fn write_step(&self, text: &mut String, step: Statement) {
        match step {
            Statement::Compute(node) => {
                let _ = writeln!(text, "let {} = {};", self.operand_text(node), self.expression_text(node));
            }
            Statement::SinCos(sin, cos) => {
                let argument = self.graph.op(sin).operands().map(|a| self.operand_text(a)).next();
                let _ = writeln!(
                    text,
                    "let ({}, {}) = {}.sin_cos();",
                    self.operand_text(sin),
                    self.operand_text(cos),
                    argument.unwrap_or_default()
                );
            }
            Statement::Together(values) => self.write_simultaneous_call(text, values),
            Statement::Store(output) => {
                self.write_store(text, output, &self.operand_text(self.outputs[output]))
            }
        }
    }

    fn write_store(&self, text: &mut String, output: usize, value: &str) {
        let (array, index, _) = &self.routine.stores[output];
        let _ = writeln!(text, "S::store({value}, &mut {array}[{index}]);");
    }

    /// Writes a call of a function with several arguments in lanes.
    fn write_simultaneous_call(&self, text: &mut String, values: [Option<Values>; 4]) {
        let values: Vec<_> = values.into_iter().flatten().collect();
        let function = values.first().and_then(|&values| simultaneous::function_of(self.graph, values));
        let Some(function) = function else { return };
        let list = |nodes: &mut dyn Iterator<Item = Node>| {
            let atoms: Vec<String> = nodes.map(|node| self.operand_text(node)).collect();
            format!("[{}]", atoms.join(", "))
        };
        let results: Vec<_> =
            values.iter().map(|(node, other)| list(&mut [*node].into_iter().chain(*other))).collect();
        let arguments: Vec<_> =
            values.iter().map(|(node, _)| list(&mut self.graph.op(*node).operands())).collect();
        let function = match function {
            Function::Unary(function) => unary(function),
            Function::Binary(function) => binary_text(function),
            Function::SinCos => "sin_cos",
        };
        let _ = writeln!(
            text,
            "let [{}] = S::together::<elementary::{function}, _, _, _>([{}]);",
            results.join(", "),
            arguments.join(", ")
        );
    }

    /// Writes the values that later pieces read.
    fn write_spills(&self, text: &mut String, step: Statement, piece: &Chunk) {
        for node in chunk::computed(step) {
            let Some(slot) = piece.spills.get(&node) else { continue };
            let atom = self.operand_text(node);
            if self.is_condition(node) {
                let _ = writeln!(text, "w[{slot}] = S::select({atom}, S::from_f64(1.0), S::from_f64(0.0));");
            } else {
                let _ = writeln!(text, "w[{slot}] = {atom};");
            }
        }
    }

    fn is_condition(&self, node: Node) -> bool {
        matches!(self.graph.op(node), Op::Compare(..) | Op::And(..) | Op::Or(..) | Op::Not(_))
    }

    /// The local variable of a variable of the model.
    fn variable(&self, index: u32) -> String {
        let Variables { x, z, u, p } = self.variables;
        let mut index = index as usize;
        for (name, list) in [("xdot", x), ("x", x), ("z", z), ("u", u), ("p", p)] {
            if index < list.len() {
                return format!("{name}_{index}");
            }
            index -= list.len();
        }
        String::from("t")
    }

    /// A node as an operand: a local variable or a constant.
    fn operand_text(&self, node: Node) -> String {
        if let Some(slot) = self.in_place.get(&node) {
            return format!("w[{slot}]");
        }
        match self.graph.op(node) {
            Op::Constant(bits) => format!("S::from_f64({})", number_text(f64::from_bits(bits))),
            Op::Opaque(index) => format!("S::from_f64(c[{index}])"),
            Op::Variable(index) => self.variable(index),
            Op::Seed(row) => format!("mu_{row}"),
            _ => format!("v{}", self.names[node.0 as usize]),
        }
    }

    /// A constant divisor whose quotients are products, and its reciprocal.
    fn reciprocal_text(&self, node: Node) -> Option<[String; 3]> {
        let Op::Constant(bits) = self.graph.op(node) else { return None };
        let c = f64::from_bits(bits);
        divisor::reciprocal(c).map(|[high, low]| [c, high, low].map(number_text))
    }

    /// The expression that computes a node.
    fn expression_text(&self, node: Node) -> String {
        let atom = |node: Node| self.operand_text(node);
        match self.graph.op(node) {
            Op::Unary(Unary::Neg, a) => format!("-{}", atom(a)),
            Op::Unary(Unary::Table(Table { index, orders, .. }), a) => {
                format!("table_{index}.partial([{}], {orders:?})", atom(a))
            }
            Op::Binary(Binary::Table(Table { index, orders, .. }), a, b) => {
                format!("table_{index}.partial([{}, {}], {orders:?})", atom(a), atom(b))
            }
            Op::Unary(function, a) => format!("{}.{}()", atom(a), unary(function)),
            Op::Binary(function, a, b) => {
                if function == Binary::Div
                    && let Some([c, high, low]) = self.reciprocal_text(b)
                {
                    return format!("{}.over({c}, [{high}, {low}])", atom(a));
                }
                let (a, b) = (atom(a), atom(b));
                match function {
                    Binary::Add | Binary::Sub | Binary::Mul | Binary::Div => {
                        format!("{a} {} {b}", binary_text(function))
                    }
                    _ => format!("{a}.{}({b})", binary_text(function)),
                }
            }
            Op::Powi(a, n) => format!("{}.powi({n})", atom(a)),
            Op::Select(condition, a, b) => {
                format!("S::select({}, {}, {})", atom(condition), atom(a), atom(b))
            }
            Op::Compare(comparison, a, b) => {
                let name = match comparison {
                    Compare::Lt => "lt",
                    Compare::Le => "le",
                    Compare::Eq => "eq",
                };
                format!("S::{name}({}, {})", atom(a), atom(b))
            }
            Op::And(a, b) => format!("S::and({}, {})", atom(a), atom(b)),
            Op::Or(a, b) => format!("S::or({}, {})", atom(a), atom(b)),
            Op::Not(a) => format!("S::not({})", atom(a)),
            Op::Constant(_) | Op::Variable(_) | Op::Opaque(_) | Op::Seed(_) => atom(node),
        }
    }
}
