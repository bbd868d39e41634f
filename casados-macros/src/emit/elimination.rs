//! The constant `Structure::elimination`: the tables of the elimination of the Newton matrix, as
//! tokens.

use super::structure::index_literals;
use crate::structure::tables::{Assembly, KinematicDependence, Pivot, Tables, Update};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// The value of `Structure::elimination`.
pub fn write(krate: &syn::Path, tables: &Tables) -> TokenStream {
    let pivots = tables.pivots.iter().map(pivot);
    let left = tables.left.iter().map(|pair| constructor_call("left", pair));
    let updates = tables.updates.iter().map(update);
    let assembly = tables.assembly.iter().map(assembly);
    let supernodes = tables.supernodes.iter().map(|pair| constructor_call("supernode", pair));
    let kinematic = tables.kinematic.iter().map(|state| constructor_call("kinematic", state));
    let dependents = tables.dependents.iter().map(dependent);
    let [slots, slot_of_equation] =
        [&tables.slots, &tables.slot_of_equation].map(|table| index_literals(table));
    let constructors = constructors();
    quote! {{
        use #krate::__private::{Assembly, Dependent, Kinematic, Left, Pivot, Supernode, Update};
        #constructors
        #krate::__private::Elimination {
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

/// Functions with short names, which build the tables.
fn constructors() -> TokenStream {
    quote! {
        const fn pivot(
            [slot, equation]: [u32; 2],
            [block, upper, end]: [u32; 3],
            left: [u32; 2],
            identity: bool,
        ) -> Pivot {
            Pivot { slot, equation, block, upper, end, left, identity }
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
    }
}

/// A call with integer arguments.
fn constructor_call(constructor: &str, values: &[u32]) -> TokenStream {
    let constructor = quote::format_ident!("{constructor}");
    let values = index_literals(values);
    quote!(#constructor(#(#values),*))
}

fn pivot(pivot: &Pivot) -> TokenStream {
    let &Pivot { slot, equation, range, left, identity } = pivot;
    let [slot, equation] = [slot, equation].map(Literal::u32_unsuffixed);
    let (range, left) = (range.map(Literal::u32_unsuffixed), left.map(Literal::u32_unsuffixed));
    quote!(pivot([#slot, #equation], [#(#range),*], [#(#left),*], #identity))
}

fn update(update: &Update) -> TokenStream {
    let (block, first) = (Literal::u32_unsuffixed(update.block), update.first);
    quote!(update(#block, #first))
}

fn assembly(assembly: &Assembly) -> TokenStream {
    let &Assembly { block, term, first } = assembly;
    let [block, entry, by, order] =
        [block, term.entry, term.by.unwrap_or(u32::MAX), term.order].map(Literal::u32_unsuffixed);
    quote!(assembly(#block, #entry, #by, #order, #first))
}

fn dependent(dependent: &KinematicDependence) -> TokenStream {
    let &KinematicDependence { entry, state, first, last } = dependent;
    let [entry, state] = [entry, state].map(Literal::u32_unsuffixed);
    quote!(dependent(#entry, #state, #first, #last))
}
