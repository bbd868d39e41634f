//! Reads the reference values beside this file: JSON objects of numbers and (nested) lists of them.
//!
//! The parser may be off by one unit in the last place of a double, which is far below every
//! tolerance.

use nalgebra::{SMatrix, SVector};
use serde_json::Value;
use std::path::Path;

/// A JSON object.
pub struct Record(Value);

impl From<Value> for Record {
    fn from(value: Value) -> Self {
        Self(value)
    }
}

impl Record {
    /// Reads a file of `tests/data`.
    pub fn load(name: &str) -> Result<Self, String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name);
        let text =
            std::fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
        let value = serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self(value))
    }

    /// The objects of a list.
    pub fn records(&self, key: &str) -> Result<Vec<Self>, String> {
        let list = self.0[key].as_array().ok_or_else(|| format!("`{key}` is not a list"))?;
        Ok(list.iter().cloned().map(Self).collect())
    }

    /// An object.
    pub fn record(&self, key: &str) -> Result<Self, String> {
        match &self.0[key] {
            value @ Value::Object(_) => Ok(Self(value.clone())),
            _ => Err(format!("`{key}` is not an object")),
        }
    }

    /// A text.
    pub fn text(&self, key: &str) -> Result<&str, String> {
        self.0[key].as_str().ok_or_else(|| format!("`{key}` is not a text"))
    }

    /// A number.
    pub fn number(&self, key: &str) -> Result<f64, String> {
        self.0[key].as_f64().ok_or_else(|| format!("`{key}` is not a number"))
    }

    /// A list of numbers.
    pub fn vector<const N: usize>(&self, key: &str) -> Result<SVector<f64, N>, String> {
        Ok(SVector::from_column_slice(&self.numbers(key, N)?))
    }

    /// A list of numbers of any length.
    pub fn list(&self, key: &str) -> Result<Vec<f64>, String> {
        let list = self.0[key].as_array().ok_or_else(|| format!("`{key}` is not a list"))?;
        let numbers: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
        if numbers.len() == list.len() {
            Ok(numbers)
        } else {
            Err(format!("`{key}` is not a list of numbers"))
        }
    }

    /// A list of lists of numbers of any length.
    pub fn vectors(&self, key: &str) -> Result<Vec<Vec<f64>>, String> {
        let list = self.0[key].as_array().ok_or_else(|| format!("`{key}` is not a list"))?;
        list.iter().map(|row| Self(serde_json::json!({ "row": row })).list("row")).collect()
    }

    /// A list of rows.
    pub fn matrix<const R: usize, const C: usize>(&self, key: &str) -> Result<SMatrix<f64, R, C>, String> {
        Ok(SMatrix::from_row_slice(&self.numbers(key, R * C)?))
    }

    /// A symmetric matrix from its lower triangle, row by row.
    pub fn symmetric<const N: usize>(&self, key: &str) -> Result<SMatrix<f64, N, N>, String> {
        let lower = self.numbers(key, N * (N + 1) / 2)?;
        Ok(SMatrix::from_fn(|i, j| {
            let (i, j) = (i.max(j), i.min(j));
            lower[i * (i + 1) / 2 + j]
        }))
    }

    /// Numbers, nested lists flattened.
    pub fn numbers(&self, key: &str, length: usize) -> Result<Vec<f64>, String> {
        fn collect(value: &Value, numbers: &mut Vec<f64>) {
            match value {
                Value::Array(list) => list.iter().for_each(|value| collect(value, numbers)),
                other => numbers.extend(other.as_f64()),
            }
        }
        let mut numbers = Vec::with_capacity(length);
        collect(&self.0[key], &mut numbers);
        if numbers.len() == length {
            Ok(numbers)
        } else {
            Err(format!("`{key}` has {} numbers instead of {length}", numbers.len()))
        }
    }
}
