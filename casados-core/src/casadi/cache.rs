//! A cache of results: values, derivatives and stages for the last inputs.
//!
//! IPOPT requests all constraints, then their Jacobian, then the Hessian at the same iterate, each
//! by its own graph over the same intervals. There is one entry for each of the inputs, found by
//! their bits.
//!
//! With known stages, derivatives require no solve, and are rarely requested twice. They are
//! therefore stored only after a repeated request: writing to memory that has left the CPU cache
//! costs more than copying a Jacobian.

use alloc::vec::Vec;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Values, if computed. Their memory is reused.
#[derive(Clone, Debug, Default)]
pub struct Part<V = Vec<f64>> {
    values: V,
    valid: bool,
}

impl<V> Part<V> {
    /// The values, if computed.
    pub fn get(&self) -> Option<&V> {
        self.valid.then_some(&self.values)
    }

    /// Marks the values as computed and returns their storage.
    pub fn open(&mut self) -> &mut V {
        self.valid = true;
        &mut self.values
    }

    /// Discards the values.
    pub fn clear(&mut self) {
        self.valid = false;
    }

    fn swap_if_missing(&mut self, other: &mut Self) {
        if other.valid {
            core::mem::swap(self, other);
        }
    }
}

impl Part {
    /// Returns storage for this number of values, all of which must be written.
    pub fn set(&mut self, len: usize) -> &mut [f64] {
        let values = self.open();
        values.resize(len, 0.0);
        values
    }
}

/// The results for an interval with given inputs.
#[derive(Clone, Debug, Default)]
pub struct IntervalResults<T> {
    /// `y`
    pub value: Part,
    /// `∂y/∂w`, column by column.
    pub jacobian: Part,
    /// The multipliers `λ` of the next two.
    pub lambda: Part,
    /// `∇(λᵀy)`
    pub gradient: Part,
    /// `∇²(λᵀy)`
    pub hessian: Part,
    /// The stages.
    pub tape: Part<T>,
    /// Whether values and Jacobian include algebraic states.
    pub algebraic: [bool; 2],
}

impl<T> IntervalResults<T> {
    /// Discards all results.
    pub fn clear(&mut self) {
        for part in
            [&mut self.value, &mut self.jacobian, &mut self.lambda, &mut self.gradient, &mut self.hessian]
        {
            part.clear();
        }
        self.tape.clear();
        self.algebraic = [false; 2];
    }

    /// Takes values and stages of another result for the same inputs.
    fn merge_stages(&mut self, other: &mut Self) {
        if other.value.valid {
            self.algebraic[0] = other.algebraic[0];
        }
        self.value.swap_if_missing(&mut other.value);
        self.tape.swap_if_missing(&mut other.tape);
    }

    /// Takes all results of another one for the same inputs.
    fn merge(&mut self, other: &mut Self) {
        for (part, is_new) in [other.value.valid, other.jacobian.valid].into_iter().enumerate() {
            if is_new {
                self.algebraic[part] = other.algebraic[part];
            }
        }
        self.value.swap_if_missing(&mut other.value);
        self.jacobian.swap_if_missing(&mut other.jacobian);
        if other.lambda.valid {
            self.lambda.swap_if_missing(&mut other.lambda);
            self.gradient.clear();
            self.hessian.clear();
            self.gradient.swap_if_missing(&mut other.gradient);
            self.hessian.swap_if_missing(&mut other.hessian);
        }
        self.tape.swap_if_missing(&mut other.tape);
    }
}

/// The results for the last inputs.
#[derive(Debug)]
pub struct Cache<T> {
    entries: Vec<Entry<T>>,
    /// The index of the entry of each key.
    places: HashMap<u64, usize, BuildHasherDefault<PrecomputedHash>>,
    capacity: usize,
    /// The oldest entry, once the capacity is reached.
    oldest: usize,
    /// Whether derivatives are stored.
    derivatives: bool,
}

#[derive(Debug)]
struct Entry<T> {
    key: u64,
    inputs: Vec<f64>,
    answer: IntervalResults<T>,
    given: ComputedDerivatives,
}

/// The derivatives that were computed, stored or not.
#[derive(Clone, Copy, Debug, Default)]
pub struct ComputedDerivatives {
    pub jacobian: bool,
    /// The key of the multipliers of second-order derivatives.
    pub second: Option<u64>,
}

impl<T: Default> Cache<T> {
    /// A cache with at most this number of entries, allocated on demand; derivatives are stored
    /// from the start, or after a repeated request.
    pub fn new(capacity: usize, derivatives: bool) -> Self {
        Self { entries: Vec::new(), places: HashMap::default(), capacity, oldest: 0, derivatives }
    }

    /// The results for inputs with this [`key`].
    pub fn find(&self, key: u64, inputs: &[f64]) -> Option<&IntervalResults<T>> {
        self.entry(key, inputs).map(|entry| &entry.answer)
    }

    fn entry(&self, key: u64, inputs: &[f64]) -> Option<&Entry<T>> {
        self.entries.get(*self.places.get(&key)?).filter(|entry| equal(&entry.inputs, inputs))
    }

    /// Whether derivatives are stored.
    pub fn keeps_derivatives(&self) -> bool {
        self.derivatives
    }

    /// Records a request for derivatives that are not stored: the Jacobian, or second-order
    /// derivatives for multipliers. If they were computed before, derivatives are stored from now
    /// on.
    pub fn record_miss(&mut self, key: u64, inputs: &[f64], jacobian: bool, lambda: Option<&[f64]>) {
        if self.derivatives {
            return;
        }
        let Some(Entry { given, .. }) = self.entry(key, inputs) else { return };
        let again = lambda.is_some_and(|lambda| given.second == Some(self::key(lambda)));
        self.derivatives = again || jacobian && given.jacobian;
    }

    /// Stores results for these inputs, and swaps other memory into their place. At capacity the
    /// oldest inputs are replaced. `given` are the derivatives that were computed.
    pub fn store(
        &mut self,
        key: u64,
        inputs: &[f64],
        answer: &mut IntervalResults<T>,
        given: ComputedDerivatives,
    ) {
        if self.capacity == 0 {
            return;
        }
        // An entry with another key has other inputs, which are not read, to avoid cache misses.
        let (place, same) = match self.places.get(&key) {
            Some(&place) => (place, self.entry(key, inputs).is_some()),
            None if self.entries.len() < self.capacity => {
                let (answer, given) = (IntervalResults::default(), ComputedDerivatives::default());
                self.entries.push(Entry { key, inputs: inputs.to_vec(), answer, given });
                (self.entries.len() - 1, true)
            }
            None => {
                let oldest = self.oldest;
                self.oldest = (oldest + 1) % self.capacity;
                (oldest, false)
            }
        };
        let Some(entry) = self.entries.get_mut(place) else { return };
        if !same {
            if entry.key != key {
                self.places.remove(&entry.key);
            }
            entry.inputs.copy_from_slice(inputs);
            entry.answer.clear();
            (entry.key, entry.given) = (key, ComputedDerivatives::default());
        }
        if self.derivatives {
            entry.answer.merge(answer);
        } else {
            entry.given.jacobian |= given.jacobian;
            entry.given.second = given.second.or(entry.given.second);
            entry.answer.merge_stages(answer);
        }
        self.places.insert(key, place);
    }
}

/// Whether the bits are equal: positive and negative zero differ.
pub fn equal(one: &[f64], other: &[f64]) -> bool {
    one.len() == other.len() && one.iter().zip(other).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// The hash of inputs: four interleaved products, and the finaliser of `splitmix64` (S. Vigna,
/// public domain).
pub fn key(inputs: &[f64]) -> u64 {
    let mut lanes: [u64; 4] =
        [0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03, 0xaef1_7502_108e_f2d9, 0xf135_7aea_2e62_a9c5];
    for chunk in inputs.chunks(4) {
        for (lane, input) in lanes.iter_mut().zip(chunk) {
            *lane = (*lane ^ input.to_bits()).wrapping_mul(0xff51_afd7_ed55_8ccd).rotate_left(29);
        }
    }
    lanes.into_iter().fold(inputs.len() as u64, |hash, lane| {
        let mut mixed = hash.rotate_left(23) ^ lane;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    })
}

/// Returns a precomputed hash.
#[derive(Debug, Default)]
struct PrecomputedHash(u64);

impl Hasher for PrecomputedHash {
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = self.0.rotate_left(8) ^ u64::from(*byte);
        }
    }
    fn write_u64(&mut self, hash: u64) {
        self.0 = hash;
    }
    fn finish(&self) -> u64 {
        self.0
    }
}
