//! Names and units of the numbers of an argument.

/// The name of a number in an argument, and its unit.
#[derive(Clone, Debug)]
pub struct Label {
    /// Its name: `x.cart.place[1]`.
    pub name: String,
    /// Its unit, from the documentation of a field.
    pub unit: String,
}

impl Label {
    /// The label of an argument.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), unit: String::new() }
    }
    /// The label of a part, with the unit of the whole.
    pub(super) fn part(&self, part: &str) -> Self {
        Self { name: format!("{}{part}", self.name), unit: self.unit.clone() }
    }
    /// The label with the unit of a field, if that has one.
    pub(super) fn with_unit(self, unit: &str) -> Self {
        if unit.is_empty() { self } else { Self { unit: unit.to_owned(), ..self } }
    }
}
