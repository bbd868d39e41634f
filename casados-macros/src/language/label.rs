//! Names and units of the numbers of an argument.

/// What a number of an argument is called, and its unit.
#[derive(Clone, Debug)]
pub struct Label {
    /// Its name: `x.cart.place[1]`.
    pub name: String,
    /// Its unit, if the documentation of a field says it.
    pub unit: String,
}

impl Label {
    /// Of an argument.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), unit: String::new() }
    }
    /// Of a part, which has the unit of the whole.
    pub(super) fn part(&self, part: &str) -> Self {
        Self { name: format!("{}{part}", self.name), unit: self.unit.clone() }
    }
    /// With the unit of a field, if that has one.
    pub(super) fn with_unit(self, unit: &str) -> Self {
        if unit.is_empty() { self } else { Self { unit: unit.to_owned(), ..self } }
    }
}
