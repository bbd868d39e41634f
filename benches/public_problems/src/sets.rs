//! The sets: public problems, the twenty of `examples/models/ocps`, and variations of these.

use crate::ocps::{self, Failure, Grid};
use crate::variations::{ORIGINAL, VARIATIONS, Variation};
use crate::{Entry, Facts, families};
use casados::ocp::{Formulation, HeapOcp, SecondOrder};

/// A problem of the twenty, varied.
fn varied<P>(
    name: &str,
    variation: &'static Variation,
    make: fn(Grid) -> Result<HeapOcp<P>, Failure>,
) -> Entry
where
    P: Formulation<f64, Dynamics: SecondOrder<f64>> + Send + 'static,
{
    let name = format!("{name}{}", variation.name);
    let source = "examples/models/ocps";
    let facts = Facts { name, source, published: None, precision: 0.0, tags: &["tuned on"] };
    Entry::new(facts, move || {
        let mut ocp = make(variation.grid)?;
        variation.apply_variation(&mut ocp)?;
        Ok(ocp)
    })
}

macro_rules! entries {
    ($($theme:ident::$name:ident),* $(,)?) => {
        fn of_collection(variation: &'static Variation, entries: &mut Vec<Entry>) {
            $(entries.push(varied(stringify!($name), variation, ocps::$theme::$name));)*
        }
    };
}
ocps::each_ocp!(entries);

/// The twenty.
#[must_use]
pub fn collection() -> Vec<Entry> {
    let mut entries = Vec::new();
    of_collection(&ORIGINAL, &mut entries);
    entries
}

/// Their variations, fourteen of each.
#[must_use]
pub fn variations() -> Vec<Entry> {
    let mut entries = Vec::new();
    for variation in &VARIATIONS {
        of_collection(variation, &mut entries);
    }
    entries
}

/// Problems of public collections.
#[must_use]
pub fn public() -> Vec<Entry> {
    families::all()
}

/// Every problem.
#[must_use]
pub fn all() -> Vec<Entry> {
    [public(), collection(), variations()].into_iter().flatten().collect()
}

/// A set by its name.
///
/// # Errors
/// If there is none of this name.
pub fn named(name: &str) -> Result<Vec<Entry>, Failure> {
    match name {
        "public" => Ok(public().into_iter().filter(|entry| !entry.facts.is_held_out()).collect()),
        "held-out" => Ok(public().into_iter().filter(|entry| entry.facts.is_held_out()).collect()),
        "collection" => Ok(collection()),
        "variations" => Ok(variations()),
        _ => Err(format!("{name} is none of public, held-out, collection, variations").into()),
    }
}
