//! Numbers in JSON, nested lists flattened.

use serde_json::Value;
use std::path::{Path, PathBuf};

/// A file of the repository.
#[must_use]
pub fn repository_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

/// Reads a JSON file of the repository.
///
/// # Errors
/// What is wrong with it, and where it is.
pub fn load(name: &str) -> Result<Value, String> {
    let path = repository_path(name);
    let text = std::fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// All numbers of a value, in order.
#[must_use]
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().flat_map(numbers).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}

/// Replaces what stands between the lines `<!-- name -->` and `<!-- end of name -->` of a file.
///
/// # Errors
/// If the file cannot be read or written, or lacks one of the lines.
pub fn insert_between_markers(file: &Path, name: &str, text: &str) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: {e}", file.display());
    let old = std::fs::read_to_string(file).map_err(failed)?;
    let (begin, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let lost = || format!("{} has no line {}", file.display(), begin.trim());
    let (head, rest) = old.split_once(&begin).ok_or_else(lost)?;
    let (_, tail) = rest.split_once(&end).ok_or_else(lost)?;
    std::fs::write(file, format!("{head}{begin}\n{text}\n{end}{tail}")).map_err(failed)
}
