//! What is known about a model before it runs, as the constant `Dae::STRUCTURE`.

use crate::graph::Node;
use crate::language::Variables;
use crate::structure::supernodes;
use crate::structure::{
    Analysis, Derivatives, Elimination, Facts, FunctionAnalysis, Kinematic, Operations, Plan, Position, Term,
};
use proc_macro2::{Literal, TokenStream};
use quote::quote;
use std::collections::{BTreeSet, HashMap, HashSet};

/// The value of `Dae::STRUCTURE`.
pub fn write(analysis: &Analysis) -> TokenStream {
    let Analysis { model, derivatives, facts, .. } = analysis;
    let Derivatives { jacobian, blocks, constant, hessian, linear, operations, .. } = derivatives;
    let krate = &model.krate;
    let name = model.name.to_string();
    let Variables { x, z, u, p } = &model.variables;
    let width = Literal::usize_unsuffixed(x.len() + u.len() + p.len());
    let of_curved = hessian.iter().filter(|entry| facts.curved.contains(&entry.0));
    let terms = of_curved.map(|entry| if entry.0 == entry.1 { 1 } else { 2 }).sum::<usize>();
    let lone = facts.lone.iter().map(|&(entry, direction)| {
        let [entry, direction] = [entry, direction].map(Literal::u32_unsuffixed);
        quote!(#krate::model::Lone { entry: #entry, direction: #direction })
    });
    let (jacobian, hessian) = (pattern(krate, jacobian), pattern(krate, hessian));
    let variables = Literal::usize_unsuffixed(2 * x.len() + z.len() + u.len() + p.len());
    let [begin, inputs] = [blocks[1], blocks[5] - blocks[1]].map(Literal::usize_unsuffixed);
    let blocks = blocks.map(Literal::usize_unsuffixed);
    let operations = self::operations(krate, operations);
    let Facts { linear_in_state, constant_matrix, autonomous, constant_rows, .. } = facts;
    let [trivial, quadratures, directions, curved] =
        [&facts.trivial, &facts.quadratures, &facts.directions, &facts.curved].map(|list| numbers(list));
    let [count, terms] = [curved.len(), terms].map(Literal::usize_unsuffixed);
    let elimination = elimination(analysis);
    quote! {{
        const JACOBIAN: #krate::model::Pattern = #jacobian;
        const HESSIAN: #krate::model::Pattern = #hessian;
        const DIRECTIONS: &[u32] = &[#(#directions),*];
        const CURVED: &[u32; #count] = &[#(#curved),*];
        #krate::model::Structure {
            name: #name,
            x: &[#(#x),*],
            z: &[#(#z),*],
            u: &[#(#u),*],
            p: &[#(#p),*],
            jacobian: JACOBIAN,
            blocks: [#(#blocks),*],
            by_column: &const { #krate::model::by_column::<#variables, #inputs>(&JACOBIAN, #begin) },
            constant: &[#(#constant),*],
            hessian: HESSIAN,
            linear: &[#(#linear),*],
            linear_in_state: #linear_in_state,
            constant_matrix: #constant_matrix,
            autonomous: #autonomous,
            constant_rows: &[#(#constant_rows),*],
            trivial: &[#(#trivial),*],
            quadratures: &[#(#quadratures),*],
            directions: DIRECTIONS,
            column_of_direction: &const { #krate::model::columns::<#width>(DIRECTIONS) },
            curved: CURVED,
            symmetric: &const { #krate::model::symmetric::<#count, #terms>(&HESSIAN, CURVED) },
            lone: &[#(#lone),*],
            operations: #operations,
            elimination: #elimination,
        }
    }}
}

/// The value of `Function::STRUCTURE`.
pub fn of_function(analysis: &FunctionAnalysis) -> TokenStream {
    let FunctionAnalysis { model, derivatives, .. } = analysis;
    let Derivatives { jacobian, blocks, constant, hessian, linear, operations, .. } = derivatives;
    let krate = &model.krate;
    let name = model.name.to_string();
    let Variables { x, z, u, p } = &model.variables;
    let (jacobian, hessian) = (pattern(krate, jacobian), pattern(krate, hessian));
    let blocks = blocks.map(Literal::usize_unsuffixed);
    let entries = &blocks[4];
    let [rows, begins] = [0, 1].map(|more| Literal::usize_unsuffixed(model.residual.len() + more));
    let operations = self::operations(krate, operations);
    let variables: BTreeSet<u32> = derivatives.jacobian.iter().map(|entry| entry.1).collect();
    let variables = numbers(&variables.into_iter().collect::<Vec<_>>());
    quote! {{
        const JACOBIAN: #krate::model::Pattern = #jacobian;
        const BY_ROW: &[u32] = &const { #krate::function::by_row::<#rows, #entries>(&JACOBIAN) };
        #krate::function::FunctionStructure {
            name: #name,
            x: &[#(#x),*],
            z: &[#(#z),*],
            u: &[#(#u),*],
            p: &[#(#p),*],
            jacobian: JACOBIAN,
            blocks: [#(#blocks),*],
            by_row: BY_ROW,
            begins: &const { #krate::function::begins::<#begins>(&JACOBIAN, BY_ROW) },
            constant: &[#(#constant),*],
            hessian: #hessian,
            linear: &[#(#linear),*],
            variables: &[#(#variables),*],
            operations: #operations,
        }
    }}
}

fn operations(krate: &syn::Path, operations: &Operations) -> TokenStream {
    let &Operations { residual, residual_jacobian, adjoint, hessian } = operations;
    let [residual, residual_jacobian, adjoint, hessian] =
        [residual, residual_jacobian, adjoint, hessian].map(Literal::u32_unsuffixed);
    quote! {
        #krate::model::Operations {
            residual: #residual,
            residual_jacobian: #residual_jacobian,
            adjoint: #adjoint,
            hessian: #hessian,
        }
    }
}

/// The tables by which the Newton matrix is eliminated. A slot is an unknown and the equation that
/// is its pivot.
fn elimination(analysis: &Analysis) -> TokenStream {
    let Analysis { model, elimination: Elimination { plan, positions, kinematic, .. }, .. } = analysis;
    let krate = &model.krate;
    let mut slot_of_equation = vec![0; model.residual.len()];
    let determined = kinematic.iter().map(|of| (of.equation, of.state)).chain(plan.pivots.iter().copied());
    for (row, column) in determined {
        slot_of_equation[row as usize] = column;
    }
    let slots: Vec<u32> = plan
        .ranges
        .iter()
        .flat_map(|&[block, upper, end]| (block..end).map(move |index| (index, index < upper)))
        .map(|(index, lower)| {
            let (row, column) = plan.blocks[index as usize];
            if lower { slot_of_equation[row as usize] } else { column }
        })
        .collect();
    let [pivots, left, supernodes] = pivots(&analysis.elimination, &slots);
    let positions: HashMap<_, _> =
        positions.iter().map(|position| ((position.row, position.column), position)).collect();
    let assembly = assembly(plan, &positions);
    let updates = updates(plan, &positions);
    let [kinematic, dependents] = self::kinematic(model.variables.x.len(), kinematic);
    let [slots, slot_of_equation] = [&slots, &slot_of_equation].map(|table| numbers(table));
    quote! {{
        use #krate::model::{Assembly, Dependent, Kinematic, Left, Pivot, Supernode, Update};
        const fn pivot(
            [slot, equation]: [u32; 2],
            [block, upper, end]: [u32; 3],
            left: [u32; 2],
            identity: bool,
            supernode: u32,
        ) -> Pivot {
            Pivot { slot, equation, block, upper, end, left, identity, supernode }
        }
        const fn supernode(first: u32, count: u32) -> Supernode {
            Supernode { first, count }
        }
        const fn update(block: u32, first: bool) -> Update {
            Update { block, first }
        }
        const fn left(block: u32, slot: u32) -> Left {
            Left { block, slot }
        }
        const fn assembly(block: u32, entry: u32, by: u32, order: u32, first: bool) -> Assembly {
            Assembly { block, entry, by, order, first }
        }
        const fn kinematic(equation: u32, entry: u32, velocity: u32) -> Kinematic {
            Kinematic { equation, entry, velocity }
        }
        const fn dependent(entry: u32, state: u32, first: bool, last: bool) -> Dependent {
            Dependent { entry, state, first, last }
        }
        #krate::model::Elimination {
            pivots: &const { [#(#pivots),*] },
            slots: &[#(#slots),*],
            left: &const { [#(#left),*] },
            updates: &const { [#(#updates),*] },
            assembly: &const { [#(#assembly),*] },
            slot_of_equation: &[#(#slot_of_equation),*],
            supernodes: &const { [#(#supernodes),*] },
            kinematic: &const { [#(#kinematic),*] },
            dependents: &const { [#(#dependents),*] },
        }
    }}
}

/// The rows of three tables: of pivots, of the blocks of `L` row by row, and of supernodes.
fn pivots(elimination: &Elimination, slots: &[u32]) -> [Vec<TokenStream>; 3] {
    let Elimination { plan, identity, .. } = elimination;
    let mut rows: HashMap<u32, Vec<[u32; 2]>> = HashMap::new();
    for (&(_, slot), &[block, upper, _]) in plan.pivots.iter().zip(&plan.ranges) {
        for block in block + 1..upper {
            rows.entry(slots[block as usize]).or_default().push([block, slot]);
        }
    }
    let (mut left, mut pivots, mut supernodes) = (Vec::new(), Vec::new(), Vec::new());
    let counts = supernodes::find(plan);
    for (index, (&(row, slot), range)) in plan.pivots.iter().zip(&plan.ranges).enumerate() {
        let begin = left.len();
        left.extend(rows.get(&slot).into_iter().flatten().map(|pair| {
            let [block, slot] = pair.map(Literal::u32_unsuffixed);
            quote!(left(#block, #slot))
        }));
        let ends = [begin, left.len()].map(Literal::usize_unsuffixed);
        let [slot, row, block, upper, end] =
            [slot, row, range[0], range[1], range[2]].map(Literal::u32_unsuffixed);
        let (identity, count) = (identity[index], Literal::u32_unsuffixed(counts[index]));
        pivots.push(quote! {
            pivot([#slot, #row], [#block, #upper, #end], [#(#ends),*], #identity, #count)
        });
        if counts[index] > 0 {
            let first = Literal::usize_unsuffixed(index);
            supernodes.push(quote!(supernode(#first, #count)));
        }
    }
    [pivots, left, supernodes]
}

/// What blocks are made of, those of a kind one after the other, fill first: what is done to them
/// then has no branches that nobody can foresee.
fn assembly(plan: &Plan, positions: &HashMap<(u32, u32), &Position>) -> Vec<TokenStream> {
    let mut rows = Vec::new();
    for (place, block) in plan.blocks.iter().zip(0u32..) {
        let terms = positions.get(place).map_or(&[][..], |position| &position.terms);
        if terms.is_empty() {
            rows.push((None, true, block));
        }
        rows.extend(terms.iter().enumerate().map(|(index, &term)| (Some(term), index == 0, block)));
    }
    rows.sort_by_key(|&(term, first, block)| {
        (term.map(|term| (term.order, term.by.is_some())), !first, block)
    });
    let none = Term { entry: u32::MAX, by: None, order: 0 };
    rows.into_iter()
        .map(|(term, first, block)| {
            let Term { entry, by, order } = term.unwrap_or(none);
            let [block, entry, by, order] =
                [block, entry, by.unwrap_or(u32::MAX), order].map(Literal::u32_unsuffixed);
            quote!(assembly(#block, #entry, #by, #order, #first))
        })
        .collect()
}

/// For each update its block, and whether nothing is there before.
fn updates(plan: &Plan, positions: &HashMap<(u32, u32), &Position>) -> Vec<TokenStream> {
    let mut empty: HashSet<u32> = (0..plan.blocks.len() as u32)
        .filter(|&block| !positions.contains_key(&plan.blocks[block as usize]))
        .collect();
    let updates = plan.updates.iter().map(|&block| {
        let (first, block) = (empty.remove(&block), Literal::u32_unsuffixed(block));
        quote!(update(#block, #first))
    });
    updates.collect()
}

/// A row for each state, none if no state is kinematic; and the entries by which others depend on
/// them.
fn kinematic(nx: usize, kinematic: &[Kinematic]) -> [Vec<TokenStream>; 2] {
    let (mut rows, mut all) = (Vec::new(), Vec::new());
    for state in 0..if kinematic.is_empty() { 0 } else { nx as u32 } {
        let of = kinematic.iter().find(|of| of.state == state);
        let row = of.map_or([u32::MAX; 3], |of| [of.equation, of.entry, of.velocity]);
        let row = row.map(Literal::u32_unsuffixed);
        rows.push(quote!(kinematic(#(#row),*)));
        let dependents = of.map_or(&[][..], |of| &of.dependents);
        all.extend(dependents.iter().enumerate().map(|(index, &entry)| {
            let [entry, state] = [entry, state].map(Literal::u32_unsuffixed);
            let [first, last] = [index == 0, index + 1 == dependents.len()];
            quote!(dependent(#entry, #state, #first, #last))
        }));
    }
    [rows, all]
}

fn numbers(list: &[u32]) -> Vec<Literal> {
    list.iter().map(|&index| Literal::u32_unsuffixed(index)).collect()
}

fn pattern(krate: &syn::Path, entries: &[(u32, u32, Node)]) -> TokenStream {
    let rows = entries.iter().map(|entry| Literal::u32_unsuffixed(entry.0));
    let columns = entries.iter().map(|entry| Literal::u32_unsuffixed(entry.1));
    quote! {
        #krate::model::Pattern { rows: &[#(#rows),*], columns: &[#(#columns),*] }
    }
}
