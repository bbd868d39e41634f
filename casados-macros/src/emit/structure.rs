//! What is known about a model before it runs, as the constant `Dae::STRUCTURE`.

use crate::graph::Node;
use crate::language::Variables;
use crate::structure::followers::{Follower, Led};
use crate::structure::supernodes;
use crate::structure::{Analysis, Derivatives, Elimination, Facts, FunctionAnalysis, Operations};
use crate::structure::{Plan, Position};
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
    let folded = facts.folded.iter().map(|&(entry, into, factor)| {
        let [entry, into] = [entry, into].map(Literal::u32_unsuffixed);
        let factor = Literal::f64_unsuffixed(factor);
        quote!(#krate::model::Fold { entry: #entry, into: #into, factor: #factor })
    });
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
            folded: &[#(#folded),*],
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

/// The tables by which the Newton matrix is eliminated. A slot is an unknown and the equation that is its pivot.
fn elimination(analysis: &Analysis) -> TokenStream {
    let krate = &analysis.model.krate;
    let Elimination { plan, positions, identity, scaled, steady, followers, led } = &analysis.elimination;
    let mut slot_of_equation = vec![0; plan.pivots.len()];
    for &(row, column) in &plan.pivots {
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
    // Blocks of `L` row by row: those of scaled pivots behind the others, those of states that follow at both ends.
    let mut rows = vec![[const { Vec::new() }; 4]; plan.pivots.len()];
    for ((&(_, slot), &[block, upper, _]), &scaled) in plan.pivots.iter().zip(&plan.ranges).zip(scaled) {
        let follows = matches!(followers.get(slot as usize), Some(Some(_)));
        let kind = match (scaled, follows) {
            (false, true) => 0,
            (false, false) => 1,
            (true, false) => 2,
            (true, true) => 3,
        };
        for block in block + 1..upper {
            rows[slots[block as usize] as usize][kind].push([block, slot]);
        }
    }
    let (mut left, mut pivots) = (Vec::new(), Vec::new());
    let is_free: Vec<bool> =
        plan.pivots.iter().map(|&(_, slot)| rows[slot as usize][..2].iter().all(Vec::is_empty)).collect();
    let is_steady: Vec<bool> =
        plan.pivots.iter().map(|&(_, slot)| matches!(steady.get(slot as usize), Some(Some(_)))).collect();
    let beside = beside(&plan.ranges, &slots, scaled, &is_free, &is_steady);
    let supernodes = supernodes::find(plan, scaled, followers);
    let groups = beside.into_iter().zip(&supernodes);
    for (((((&(row, slot), range), identity), scaled), (beside, supernode)), steady) in
        plan.pivots.iter().zip(&plan.ranges).zip(identity).zip(scaled).zip(groups).zip(&is_steady)
    {
        let mut ends = [left.len(); 5];
        for (kind, end) in rows[slot as usize].iter().zip(&mut ends[1..]) {
            left.extend(kind.iter().map(|pair| {
                let [block, slot] = pair.map(Literal::u32_unsuffixed);
                quote!(left(#block, #slot))
            }));
            *end = left.len();
        }
        let ends = ends.map(Literal::usize_unsuffixed);
        let [slot, row, block, upper, end] =
            [slot, row, range[0], range[1], range[2]].map(Literal::u32_unsuffixed);
        let groups = [beside, *supernode].map(Literal::u32_unsuffixed);
        let kinds = [identity, scaled, steady];
        pivots.push(quote! {
            pivot([#slot, #row], [#block, #upper, #end], [#(#ends),*], [#(#kinds),*], [#(#groups),*])
        });
    }
    let scaled: HashSet<u32> = plan
        .ranges
        .iter()
        .zip(scaled)
        .filter(|(_, scaled)| **scaled)
        .flat_map(|(&[block, upper, _], _)| block + 1..upper)
        .collect();
    let positions: HashMap<_, _> =
        positions.iter().map(|position| ((position.row, position.column), position)).collect();
    let mut assembly: Vec<_> = plan
        .blocks
        .iter()
        .zip(0u32..)
        .map(|(place, block)| {
            let position = positions.get(place);
            let direct = position.and_then(|position| position.direct);
            (scaled.contains(&block), direct, position.and_then(|position| position.state), block)
        })
        .collect();
    // Those of a kind one after the other: what is done to them then has no branches that nobody can foresee.
    assembly
        .sort_by_key(|(scaled, direct, state, block)| (*scaled, direct.is_some(), state.is_some(), *block));
    let assembly = assembly.into_iter().map(|(scaled, direct, state, block)| {
        let (direct, state, block) = (entry(direct), entry(state), Literal::u32_unsuffixed(block));
        quote!(assembly(#block, #direct, #state, #scaled))
    });
    let updates = updates(plan, &positions, followers, led);
    let led = rows_without(led, &scaled);
    // Nothing where no state is.
    let some = steady.iter().any(Option::is_some);
    let count = if some { plan.pivots.len() as u32 } else { 0 };
    let upper = plan.ranges.iter().flat_map(|&[_, upper, end]| upper..end);
    let asked: HashSet<u32> = upper.map(|block| plan.blocks[block as usize].1).collect();
    let steady = (0..count).map(|slot| {
        let steady = steady.get(slot as usize).copied().flatten();
        let implied = steady.is_some() && !asked.contains(&slot);
        let [entry, first, end] = steady.unwrap_or([u32::MAX, 0, 0]).map(Literal::u32_unsuffixed);
        let turn = plan.pivots.iter().position(|pivot| pivot.1 == slot).unwrap_or_default();
        let turn = Literal::usize_unsuffixed(turn);
        quote!(steady(#entry, #first, #end, #turn, #implied))
    });
    let steady: Vec<_> = steady.collect();
    let is_left_out = |pivot: usize| {
        let follower = followers.get(plan.pivots[pivot].1 as usize);
        matches!(follower, Some(Some(follower)) if !follower.asked)
    };
    let own = supernodes.iter().enumerate().filter(|&(first, &count)| count > 0 && !is_left_out(first));
    let supernodes = own.map(|(first, &count)| {
        let [first, count] = [first as u32, count].map(Literal::u32_unsuffixed);
        quote!(supernode(#first, #count))
    });
    let followers: Vec<_> = match followers.iter().any(Option::is_some) {
        true => followers.iter().map(follower).collect(),
        false => Vec::new(),
    };
    let [slots, slot_of_equation] = [&slots, &slot_of_equation].map(|table| numbers(table));
    quote! {{
        use #krate::model::{Assembly, Follower, Led, Left, Pivot, Steady, Supernode, Update};
        const fn pivot(
            [slot, equation]: [u32; 2],
            [block, upper, end]: [u32; 3],
            left: [u32; 5],
            [identity, scaled, steady]: [bool; 3],
            [beside, supernode]: [u32; 2],
        ) -> Pivot {
            Pivot { slot, equation, block, upper, end, left, identity, scaled, steady, beside, supernode }
        }
        const fn steady(entry: u32, first: u32, end: u32, turn: u32, implied: bool) -> Steady {
            Steady { entry, first, end, turn, implied }
        }
        const fn supernode(first: u32, count: u32) -> Supernode {
            Supernode { first, count }
        }
        const fn follower(entry: u32, first: u32, end: u32, [asked, absorbed]: [bool; 2]) -> Follower {
            Follower { entry, first, end, asked, absorbed }
        }
        const fn update(block: u32, [first, first_led]: [bool; 2]) -> Update {
            Update { block, first, first_led }
        }
        const fn left(block: u32, slot: u32) -> Left {
            Left { block, slot }
        }
        const fn assembly(block: u32, direct: u32, state: u32, scaled: bool) -> Assembly {
            Assembly { block, direct, state, scaled }
        }
        const fn led([block, direct, state]: [u32; 3], scaled: bool, [by, of_direct, of_state]: [u32; 3]) -> Led {
            Led { own: assembly(block, direct, state, scaled), by, direct: of_direct, state: of_state }
        }
        #krate::model::Elimination {
            pivots: &const { [#(#pivots),*] },
            slots: &[#(#slots),*],
            left: &const { [#(#left),*] },
            updates: &const { [#(#updates),*] },
            assembly: &const { [#(#assembly),*] },
            slot_of_equation: &[#(#slot_of_equation),*],
            steady: &const { [#(#steady),*] },
            supernodes: &const { [#(#supernodes),*] },
            followers: &const { [#(#followers),*] },
            led: &const { [#(#led),*] },
        }
    }}
}

/// An entry of the Jacobian, if it is there.
fn entry(entry: Option<u32>) -> Literal {
    Literal::u32_unsuffixed(entry.unwrap_or(u32::MAX))
}

/// What blocks are made of where states that are absorbed are left out, those of a kind one after the other, fill first.
fn rows_without(led: &[Led], scaled: &HashSet<u32>) -> Vec<TokenStream> {
    let mut led: Vec<&Led> = led.iter().collect();
    led.sort_by_key(|Led { block, own: [direct, state], through }| {
        let through = through.map(|through| through.of.map(|entry| entry.is_some()));
        (through, scaled.contains(block), direct.is_some(), state.is_some(), *block)
    });
    led.into_iter()
        .map(|Led { block, own, through }| {
            let scaled = scaled.contains(block);
            let (block, own) = (Literal::u32_unsuffixed(*block), own.map(entry));
            let of = through.map_or([None; 2], |through| through.of).map(entry);
            let by = entry(through.map(|through| through.by));
            quote!(led([#block, #(#own),*], #scaled, [#by, #(#of),*]))
        })
        .collect()
}

/// For each update its block, and whether nothing is there before: with all pivots, and without those of states that are absorbed.
fn updates(
    plan: &Plan,
    positions: &HashMap<(u32, u32), &Position>,
    followers: &[Option<Follower>],
    led: &[Led],
) -> Vec<TokenStream> {
    let mut empty: HashSet<u32> = (0..plan.blocks.len() as u32)
        .filter(|&block| !positions.contains_key(&plan.blocks[block as usize]))
        .collect();
    let mut empty_without: HashSet<u32> =
        led.iter().filter(|led| led.own == [None; 2] && led.through.is_none()).map(|led| led.block).collect();
    let is_absorbed =
        |slot: u32| matches!(followers.get(slot as usize), Some(Some(follower)) if follower.absorbed);
    let by_absorbed = plan.pivots.iter().zip(&plan.ranges).flat_map(|(&(_, slot), &[block, upper, end])| {
        let count = (upper - block - 1) * (end - upper);
        std::iter::repeat_n(is_absorbed(slot), count as usize)
    });
    let updates = plan.updates.iter().zip(by_absorbed).map(|(&block, absorbed)| {
        let first = [empty.remove(&block), !absorbed && empty_without.remove(&block)];
        let block = Literal::u32_unsuffixed(block);
        quote!(update(#block, [#(#first),*]))
    });
    updates.collect()
}

/// A row of the table of states that follow others.
fn follower(of: &Option<Follower>) -> TokenStream {
    let (numbers, kinds) = match of {
        Some(Follower { entry, first, end, asked, absorbed }) => {
            ([*entry, *first, *end], [*asked, *absorbed])
        }
        None => ([u32::MAX, 0, 0], [false; 2]),
    };
    let numbers = numbers.map(Literal::u32_unsuffixed);
    quote!(follower(#(#numbers),*, [#(#kinds),*]))
}

/// How many scaled pivots from each on have the same rows below them; zero for all but the first of them. Their own rows must be
/// finished at the turn of the first: those of the others are free of blocks of `L` that are subtracted at their turn.
fn beside(
    ranges: &[[u32; 3]],
    slots: &[u32],
    scaled: &[bool],
    is_free: &[bool],
    is_steady: &[bool],
) -> Vec<u32> {
    /// So many at most does the engine take together.
    const MOST: usize = 3;
    let below = |pivot: usize| {
        let [block, upper, _] = ranges[pivot];
        &slots[block as usize + 1..upper as usize]
    };
    let mut beside = vec![1; ranges.len()];
    let mut first = 0;
    while first < ranges.len() {
        let same = |&pivot: &usize| {
            let like = scaled[pivot] && is_free[pivot] && is_steady[pivot] == is_steady[first];
            pivot == first || like && below(pivot) == below(first)
        };
        let count = if scaled[first] { (first..ranges.len()).take(MOST).take_while(same).count() } else { 1 };
        beside[first] = count as u32;
        beside[first + 1..first + count].fill(0);
        first += count;
    }
    beside
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

#[cfg(test)]
mod tests {
    use super::beside;

    /// Pivots with so many rows below each, from a first one on.
    fn of(rows: &[(u32, u32)], scaled: &[bool], is_free: &[bool]) -> Vec<u32> {
        let (mut ranges, mut slots) = (Vec::new(), Vec::new());
        for (first, count) in rows {
            let block = slots.len() as u32;
            slots.push(u32::MAX);
            slots.extend(*first..first + count);
            ranges.push([block, slots.len() as u32, slots.len() as u32]);
        }
        beside(&ranges, &slots, scaled, is_free, &vec![false; rows.len()])
    }

    #[test]
    fn scaled_pivots_with_the_same_rows_go_together() {
        assert_eq!(of(&[(7, 3); 5], &[true; 5], &[true; 5]), [3, 0, 0, 2, 0]);
        assert_eq!(of(&[(7, 3), (7, 3), (8, 3), (8, 4)], &[true; 4], &[true; 4]), [2, 0, 1, 1]);
        assert_eq!(of(&[(7, 3); 4], &[true, false, true, true], &[true; 4]), [1, 1, 2, 0]);
        assert_eq!(of(&[(7, 3); 4], &[true; 4], &[false, true, false, true]), [2, 0, 2, 0]);
    }
}
