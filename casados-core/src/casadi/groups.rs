//! Groups of states and controls by their names in the model.

use crate::qp::StageDims;
use alloc::ffi::CString;
use alloc::string::String;
use alloc::vec::Vec;
use core::ops::Range;

/// The states or controls of one name: `x_q` for `x.q[0]`, `x.q[1]`, ….
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// The name, with letters, digits and underscores.
    pub name: CString,
    /// Whether these are controls.
    pub controls: bool,
    /// The indices of the states or controls.
    pub rows: Range<usize>,
}

impl Group {
    /// The indices among the variables of a stage.
    pub fn variable_range(&self, dims: &StageDims) -> Range<usize> {
        let (first, count) = if self.controls { (dims.nx, dims.nu) } else { (0, dims.nx) };
        first + self.rows.start.min(count)..first + self.rows.end.min(count)
    }
}

/// The groups of states and of controls; names without a part of their own, `x[0]` or `u[0]`, have
/// no group.
pub fn groups(names: [&[&str]; 2]) -> Vec<Group> {
    let mut groups = Vec::<Group>::new();
    for (controls, names) in [false, true].into_iter().zip(names) {
        for (row, name) in names.iter().enumerate() {
            let name = identifier(name.split('[').next().unwrap_or_default());
            let Ok(name) = CString::new(name) else { continue };
            let goes_on = groups.last().is_some_and(|last| last.name == name && last.rows.end == row);
            let is_there = groups.iter().any(|group| group.name == name);
            if !name.as_bytes().contains(&b'_') || is_there && !goes_on {
                continue;
            }
            match groups.last_mut() {
                Some(last) if goes_on => last.rows.end += 1,
                _ => groups.push(Group { name, controls, rows: row..row + 1 }),
            }
        }
    }
    groups
}

/// Keeps letters and digits, with one underscore for everything between them.
fn identifier(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_")
}
