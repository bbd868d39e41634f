//! Guesses of the orbit, from the data of the tests.

use super::problem::INTERVALS;
use reference_data::Record;
use std::error::Error;

/// States at all nodes and controls of all intervals of a guess.
pub fn guess(record: &Record) -> Result<[Vec<Vec<f64>>; 2], Box<dyn Error>> {
    let (states, controls) = (record.vectors("x")?, record.vectors("u")?);
    let node = |k: usize| {
        let mut x = states.get(k % states.len()).cloned().unwrap_or_default();
        x.resize(23, 0.0);
        x
    };
    Ok([(0..=INTERVALS).map(node).collect(), controls])
}
