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
    ("options", "error"),
    ("scalar", "shape"),
    ("tables", "scalar"),
    ("record", "shape scalar"),
    ("function", "shape structure scalar"),
    ("model", "shape structure scalar"),
    ("plan", "shape structure model"),
    ("memory", "error model plan"),
    ("qp", "scalar"),
    ("dual", "shape scalar model"),
    ("linalg", "shape tableau memory scalar model plan"),
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
        "error shape statistics structure tableau memory options scalar model plan linalg result finite \
         quadrature integrator",
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
         constrained erk irk batch",
    ),
    ("plot", "structure scalar ocp"),
    (
        "casadi",
        "error shape structure tableau memory options function model qp result quadrature integrator erk irk \
         adaptive batch ocp",
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

/// The code of a text, without comments and unit tests.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    text.lines().flat_map(|line| [line.split("//").next().unwrap_or_default(), "\n"]).collect()
}

/// The paths of a tree of imports, `a::{b, c::{d, e}}`, each after `prefix`.
fn expand(prefix: &str, tree: &str, paths: &mut Vec<String>) {
    let (mut depth, mut begin) = (0, 0);
    for (at, c) in tree.char_indices().chain([(tree.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let branch = tree[begin..at].trim();
                begin = at + 1;
                match branch.split_once('{') {
                    Some((path, inner)) => {
                        let inner = inner.trim_end();
                        let inner = inner.strip_suffix('}').unwrap_or(inner);
                        expand(&format!("{prefix}{path}"), inner, paths);
                    }
                    None => paths.push(format!("{prefix}{branch}")),
                }
            }
            _ => {}
        }
    }
}

/// All paths of a file that begin with `crate` or `super`, as those from the root of the crate;
/// `module` is the path of the file.
fn paths(text: &str, module: &[String]) -> Vec<Vec<String>> {
    let code = code(text);
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::").chain(code.match_indices("super::")) {
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
            continue;
        }
        let rest = &code[at..];
        let is_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
        let end = rest.find(|c| !is_path(c)).unwrap_or(rest.len());
        let has_braces = rest[..end].ends_with("::") && rest[end..].starts_with('{');
        let end = if has_braces { rest.find(';').unwrap_or(rest.len()) } else { end };
        expand("", &rest[..end], &mut found);
    }
    let absolute = |path: String| {
        let mut from = module.to_vec();
        for part in path.split("::").map(str::trim) {
            match part {
                "crate" => from.clear(),
                "super" => _ = from.pop(),
                name => from.push(name.to_owned()),
            }
        }
        from
    };
    found.into_iter().map(absolute).collect()
}

/// The rooms of a folder, each with those that it imports.
fn rooms(folder: &Path) -> Rooms {
    let mut found = Vec::new();
    files(folder, &mut found);
    let source = source();
    let module = |path: &Path| -> Vec<String> {
        let path = path.strip_prefix(&source).expect("it is in the sources").with_extension("");
        let parts = path.iter().map(|part| part.to_str().expect("a name in UTF-8").to_owned());
        parts.filter(|part| !["lib", "mod"].contains(&part.as_str())).collect()
    };
    let depth = module(folder).len();
    let modules: Vec<_> = found.iter().map(|path| module(path)).collect();
    let mut rooms: Rooms =
        modules.iter().filter_map(|module| Some((module.get(depth)?.clone(), BTreeSet::new()))).collect();
    let known: BTreeSet<_> = rooms.keys().cloned().collect();
    for (path, module) in found.iter().zip(&modules) {
        let text = fs::read_to_string(path).expect("a source file is text");
        let Some(imports) = module.get(depth).and_then(|own| rooms.get_mut(own)) else { continue };
        for path in paths(&text, module).iter().filter(|path| path.get(..depth) == module.get(..depth)) {
            if let Some(name) = path.get(depth).filter(|&name| known.contains(name) && *name != module[depth])
            {
                imports.insert(name.clone());
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
    let found = rooms(&source());
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
        "adaptive/integrator",
        "adaptive/methods",
        "adaptive/methods/collocation",
        "adaptive/methods/explicit",
        "adaptive/piecewise",
        "adaptive/step",
        "batch",
        "erk",
        "irk",
        "linalg",
        "ocp",
        "ocp/assembly",
        "ocp/batch",
        "ocp/dynamics",
        "ocp/dynamics/collocation",
        "ocp/feedback",
        "ocp/formulation",
        "ocp/formulation/functions",
        "ocp/formulation/instance",
        "ocp/nlp",
        "ocp/nlp/ipm",
        "ocp/nlp/ipm/kkt",
        "ocp/nlp/ipm/restoration",
        "ocp/nlp/sqp",
        "ocp/solution",
        "ocp/solution/sensitivities",
        "ocp/solution/trajectory",
        "qp",
        "qp/interior",
        "qp/lanes",
        "quadrature",
        "structure",
    ];
    for room in engines {
        let left = circles(rooms(&source().join(room)));
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

#[test]
fn imports_in_braces_are_seen() {
    let module = ["a", "b"].map(str::to_owned);
    let text = "use super::{c, d::{e, f}};\nuse crate::{g, h::I};\nfn j() { super::k::l() } // super::m\n";
    let mut found: Vec<_> = paths(text, &module).iter().map(|path| path.join("::")).collect();
    found.sort();
    assert_eq!(found, ["a::c", "a::d::e", "a::d::f", "a::k::l", "g", "h::I"]);
}

#[test]
fn rooms_of_ocp_are_small() {
    let mut folders = vec![source().join("ocp")];
    while let Some(folder) = folders.pop() {
        let entries: Vec<_> = fs::read_dir(&folder)
            .expect("it can be read")
            .map(|entry| entry.expect("an entry").path())
            .collect();
        let count = entries.iter().filter(|path| path.is_file()).count();
        assert!(count <= 15, "{} has {count} files", folder.display());
        folders.extend(entries.into_iter().filter(|path| path.is_dir()));
    }
}
