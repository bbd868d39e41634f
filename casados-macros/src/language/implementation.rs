//! `impl` blocks, and the defaults of traits.

use super::environment::Scope;
use super::evaluator::Evaluator;
use super::items::{Constant, Symbol, constant};
use std::collections::HashMap;
use std::rc::Rc;

/// An `impl` block, or the defaults of a trait.
#[derive(Debug)]
pub struct Implementation {
    /// Its generic parameters.
    pub generics: syn::Generics,
    /// The implementing type; `None` for the defaults of a trait.
    pub self_type: Option<Rc<syn::Type>>,
    /// The trait and its generic arguments.
    pub of: Option<syn::Path>,
    /// The functions.
    pub functions: HashMap<Symbol, Rc<syn::ItemFn>>,
    /// The constants; those of generic blocks depend on the type.
    pub constants: HashMap<Symbol, Rc<Constant>>,
    /// The enclosing scope.
    pub scope: Rc<Scope>,
}

/// A member of an `impl` block or a trait.
enum Member {
    /// A function: its modifiers, signature and body.
    Function(syn::FnModifiers, Box<syn::Signature>, Box<syn::Block>),
    /// A constant.
    Constant(Rc<Constant>),
}

impl Evaluator {
    /// Registers an `impl` block.
    pub(super) fn register_impl(&mut self, item: &syn::ItemImpl, scope: &Rc<Scope>) {
        let members = item.items.iter().filter_map(|entry| match entry {
            syn::ImplItem::Fn(function) => Some(Member::Function(
                function.modifiers.clone(),
                Box::new(function.sig.clone()),
                Box::new(function.block.clone()),
            )),
            syn::ImplItem::Const(item) => Some(Member::Constant(constant(&item.ident, &item.ty, &item.expr))),
            _ => None,
        });
        let self_type = Some(Rc::new((*item.self_ty).clone()));
        let of = item.trait_.as_ref().map(|(path, _)| path.clone());
        self.members(members, (item.generics.clone(), self_type, of), scope);
    }

    /// Registers the defaults of a trait.
    pub(super) fn defaults(&mut self, item: &syn::ItemTrait, scope: &Rc<Scope>) {
        let members = item.items.iter().filter_map(|entry| match entry {
            syn::TraitItem::Fn(function) => {
                let block = function.default.clone()?;
                let (sig, block) = (Box::new(function.sig.clone()), Box::new(block));
                Some(Member::Function(function.modifiers.clone(), sig, block))
            }
            syn::TraitItem::Const(item) => {
                let (_, expression) = item.default.as_ref()?;
                Some(Member::Constant(constant(&item.ident, &item.ty, expression)))
            }
            _ => None,
        });
        self.members(members, (item.generics.clone(), None, Some(item.ident.clone().into())), scope);
    }

    fn members(
        &mut self,
        members: impl Iterator<Item = Member>,
        (generics, self_type, of): (syn::Generics, Option<Rc<syn::Type>>, Option<syn::Path>),
        scope: &Rc<Scope>,
    ) {
        let (mut functions, mut constants) = (HashMap::new(), HashMap::new());
        for member in members {
            match member {
                Member::Function(modifiers, sig, block) => {
                    let name = self.symbol(&sig.ident);
                    let (vis, sig) = (syn::Visibility::Inherited, *sig);
                    let function = syn::ItemFn { attrs: Vec::new(), vis, modifiers, sig, block };
                    functions.insert(name, Rc::new(function));
                }
                Member::Constant(constant) => {
                    constants.insert(self.symbol(&constant.name), constant);
                }
            }
        }
        let scope = scope.clone();
        let implementation = Implementation { generics, self_type, of, functions, constants, scope };
        self.implementations.push(Rc::new(implementation));
    }
}
