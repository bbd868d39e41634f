//! Rooms of the core import each other in one direction: what `use` lines and paths say is held
//! against the list of arrows in this file.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Who imports whom: each room with those that it builds on, which stand before it, so that no
/// circle can be written down.
const ARROWS: &[(&str, &str)] = &[
    ("shape", ""),
    ("statistics", ""),
    ("structure", ""),
    ("tableau", ""),
    ("error", "tableau"),
    ("memory", "error"),
    ("options", "error"),
    ("scalar", "shape"),
    ("tables", "scalar"),
    ("record", "shape scalar"),
    ("function", "shape structure scalar"),
    ("model", "shape structure scalar"),
    ("qp", "scalar"),
    ("dual", "shape scalar model"),
    ("linalg", "shape tableau memory scalar model"),
    ("result", "shape model"),
    ("finite", "error shape scalar model linalg result"),
    ("quadrature", "error shape memory scalar function model linalg result finite"),
    ("integrator", "error shape statistics memory scalar model linalg result finite quadrature"),
    (
        "constrained",
        "error shape statistics structure memory scalar function model result finite quadrature integrator",
    ),
    (
        "erk",
        "error shape statistics tableau memory options scalar model linalg result finite quadrature integrator",
    ),
    (
        "irk",
        "error shape statistics structure tableau memory options scalar model linalg result finite quadrature \
         integrator",
    ),
    (
        "adaptive",
        "error shape statistics tableau memory options scalar function model linalg result finite quadrature \
         integrator erk irk",
    ),
    (
        "batch",
        "error shape statistics tableau memory options scalar model linalg result finite integrator erk irk",
    ),
    ("testing", "error shape memory scalar model result integrator"),
    (
        "ocp",
        "error shape structure memory scalar record function model qp linalg result finite quadrature integrator \
         constrained irk batch",
    ),
    ("plot", "structure scalar ocp"),
    (
        "casadi",
        "error shape structure tableau memory options function model qp result quadrature integrator adaptive batch \
         ocp",
    ),
];

/// A room is a folder of `src`, or a file in it.
type Rooms = BTreeMap<String, BTreeSet<String>>;

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("its entries too").path();
        if path.is_dir() {
            if !path.ends_with("tests") {
                files(&path, found);
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The names that follow `prefix` in the code of a text, without comments and unit tests.
fn names_after<'a>(text: &'a str, prefix: &'a str) -> impl Iterator<Item = &'a str> {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    code.flat_map(move |line| line.split(prefix).skip(1)).map(|rest| {
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        &rest[..end]
    })
}

/// The rooms of a folder, each with those that it imports by paths that begin with `outside`, or,
/// of a file of the folder itself, with `super::`.
fn rooms(folder: &Path, outside: &str) -> Rooms {
    let mut found = Vec::new();
    files(folder, &mut found);
    let room = |path: &Path| {
        let first = path.strip_prefix(folder).ok()?.components().next()?;
        Some(first.as_os_str().to_str()?.trim_end_matches(".rs").to_owned())
    };
    let mut rooms = Rooms::new();
    for own in found.iter().filter_map(|path| room(path)) {
        rooms.entry(own).or_default();
    }
    let faces = ["lib", "mod"];
    rooms.retain(|name, _| !faces.contains(&name.as_str()));
    let known: BTreeSet<_> = rooms.keys().cloned().collect();
    for path in &found {
        let text = fs::read_to_string(path).expect("a source file is text");
        let Some(own) = room(path) else { continue };
        let Some(imports) = rooms.get_mut(&own) else { continue };
        let direct = path.parent() == Some(folder);
        let beside = names_after(&text, "super::").filter(|_| direct);
        for name in names_after(&text, outside).chain(beside) {
            if known.contains(name) && name != own {
                imports.insert(name.to_owned());
            }
        }
    }
    rooms
}

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Takes away rooms that import nothing else, until none is left or those of circles.
fn circles(mut rooms: Rooms) -> Rooms {
    loop {
        let done: BTreeSet<_> =
            rooms.iter().filter(|(_, to)| to.is_empty()).map(|(name, _)| name.clone()).collect();
        if done.is_empty() {
            return rooms;
        }
        rooms.retain(|name, _| !done.contains(name));
        for to in rooms.values_mut() {
            to.retain(|name| !done.contains(name));
        }
    }
}

#[test]
fn rooms_import_what_the_list_says() {
    let mut before = BTreeSet::new();
    let mut listed = Rooms::new();
    for (room, imports) in ARROWS {
        let imports: BTreeSet<_> = imports.split_whitespace().map(str::to_owned).collect();
        assert!(imports.is_subset(&before), "`{room}` stands before what it builds on");
        before.insert((*room).to_owned());
        listed.insert((*room).to_owned(), imports);
    }
    let found = rooms(&source(), "crate::");
    for (room, imports) in &found {
        let allowed = listed.get(room).unwrap_or_else(|| panic!("`{room}` is no room of the list"));
        let forbidden: Vec<_> = imports.difference(allowed).collect();
        assert!(forbidden.is_empty(), "`{room}` imports {forbidden:?}, which the list does not allow");
        let gone: Vec<_> = allowed.difference(imports).collect();
        assert!(gone.is_empty(), "`{room}` no longer imports {gone:?}: strike it from the list");
    }
    assert_eq!(found.len(), listed.len(), "a room of the list is gone");
}

#[test]
fn engines_have_no_circles() {
    let engines = [
        "adaptive",
        "batch",
        "erk",
        "irk",
        "linalg",
        "ocp",
        "ocp/collocation",
        "ocp/ipm",
        "ocp/sqp",
        "qp",
        "qp/interior",
        "quadrature",
        "structure",
    ];
    for room in engines {
        let left = circles(rooms(&source().join(room), &format!("crate::{}::", room.replace('/', "::"))));
        assert!(left.is_empty(), "a circle in `{room}`: {left:?}");
    }
}

#[test]
fn a_circle_is_found() {
    let rooms = |arrows: [(&str, &str); 3]| -> Rooms {
        arrows.map(|(from, to)| (from.to_owned(), BTreeSet::from([to.to_owned()]))).into()
    };
    let left = circles(rooms([("a", "b"), ("b", "a"), ("c", "a")]));
    assert_eq!(left.keys().collect::<Vec<_>>(), ["a", "b", "c"]);
    let mut open = rooms([("a", "b"), ("b", "c"), ("c", "a")]);
    open.insert("c".to_owned(), BTreeSet::new());
    assert!(circles(open).is_empty());
}
