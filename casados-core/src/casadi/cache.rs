//! Results of the last inputs: nominal values, derivatives and stages that were asked for once are
//! there for whoever asks next.
//!
//! IPOPT asks for all constraints, then for their Jacobian, then for the Hessian at the same
//! iterate, each by a graph of its own over the same intervals. So there is an entry for each of
//! the inputs, found by their bits.

use alloc::vec::Vec;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Values, if they were computed. Their memory stays.
#[derive(Clone, Debug, Default)]
pub struct Part<V = Vec<f64>> {
    values: V,
    valid: bool,
}

impl<V> Part<V> {
    /// The values, if they were computed.
    pub fn get(&self) -> Option<&V> {
        self.valid.then_some(&self.values)
    }

    /// A place for values.
    pub fn open(&mut self) -> &mut V {
        self.valid = true;
        &mut self.values
    }

    /// Forgets the values.
    pub fn clear(&mut self) {
        self.valid = false;
    }

    fn take(&mut self, other: &mut Self) {
        if other.valid {
            core::mem::swap(self, other);
        }
    }
}

impl Part {
    /// A place for this number of values, which are all to be written.
    pub fn set(&mut self, len: usize) -> &mut [f64] {
        let values = self.open();
        values.resize(len, 0.0);
        values
    }
}

/// What is known about an interval of these inputs.
#[derive(Clone, Debug, Default)]
pub struct Answer<T> {
    /// `y`
    pub value: Part,
    /// `∂y/∂w`, column by column.
    pub jacobian: Part,
    /// Of what the next two are derivatives: `λ`.
    pub lambda: Part,
    /// `∇(λᵀy)`
    pub gradient: Part,
    /// `∇²(λᵀy)`
    pub hessian: Part,
    /// The stages.
    pub tape: Part<T>,
    /// Whether values and Jacobian have algebraic states.
    pub algebraic: [bool; 2],
}

impl<T> Answer<T> {
    /// Forgets everything.
    pub fn clear(&mut self) {
        for part in
            [&mut self.value, &mut self.jacobian, &mut self.lambda, &mut self.gradient, &mut self.hessian]
        {
            part.clear();
        }
        self.tape.clear();
        self.algebraic = [false; 2];
    }

    /// Takes what another one knows about the same inputs.
    fn take(&mut self, other: &mut Self) {
        for (part, is_new) in [other.value.valid, other.jacobian.valid].into_iter().enumerate() {
            if is_new {
                self.algebraic[part] = other.algebraic[part];
            }
        }
        self.value.take(&mut other.value);
        self.jacobian.take(&mut other.jacobian);
        if other.lambda.valid {
            self.lambda.take(&mut other.lambda);
            self.gradient.clear();
            self.hessian.clear();
            self.gradient.take(&mut other.gradient);
            self.hessian.take(&mut other.hessian);
        }
        self.tape.take(&mut other.tape);
    }
}

/// The answers to the last inputs.
#[derive(Debug)]
pub struct Cache<T> {
    entries: Vec<Entry<T>>,
    /// Where the entry of a hash is.
    places: HashMap<u64, usize, BuildHasherDefault<Hashed>>,
    capacity: usize,
    /// The oldest entry, if there are as many as may be.
    oldest: usize,
}

#[derive(Debug)]
struct Entry<T> {
    hash: u64,
    inputs: Vec<f64>,
    answer: Answer<T>,
}

impl<T: Default> Cache<T> {
    /// A cache of at most this number of entries, which have their memory from when they are
    /// needed.
    pub fn new(capacity: usize) -> Self {
        Self { entries: Vec::new(), places: HashMap::default(), capacity, oldest: 0 }
    }

    /// What is known about these inputs.
    pub fn find(&self, inputs: &[f64]) -> Option<&Answer<T>> {
        let entry = self.entries.get(*self.places.get(&hash(inputs))?)?;
        equal(&entry.inputs, inputs).then_some(&entry.answer)
    }

    /// Takes what is known about these inputs, and leaves some other memory in its place. The
    /// oldest inputs are forgotten if there is no place.
    pub fn store(&mut self, inputs: &[f64], answer: &mut Answer<T>) {
        let hash = hash(inputs);
        if let Some(entry) = self.places.get(&hash).and_then(|&place| self.entries.get_mut(place)) {
            if !equal(&entry.inputs, inputs) {
                entry.inputs.copy_from_slice(inputs);
                entry.answer.clear();
            }
            entry.answer.take(answer);
            return;
        }
        if self.capacity == 0 {
            return;
        }
        let place = if self.entries.len() < self.capacity {
            self.entries.push(Entry { hash, inputs: inputs.to_vec(), answer: Answer::default() });
            self.entries.len() - 1
        } else {
            let oldest = self.oldest;
            self.oldest = (oldest + 1) % self.capacity;
            oldest
        };
        if let Some(entry) = self.entries.get_mut(place) {
            if entry.hash != hash {
                self.places.remove(&entry.hash);
                entry.hash = hash;
                entry.inputs.copy_from_slice(inputs);
                entry.answer.clear();
            }
            entry.answer.take(answer);
        }
        self.places.insert(hash, place);
    }
}

/// Whether bits are the same: zeros of both signs are two inputs.
pub fn equal(one: &[f64], other: &[f64]) -> bool {
    one.len() == other.len() && one.iter().zip(other).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// The finaliser of `splitmix64` (S. Vigna, public domain), after each number.
fn hash(inputs: &[f64]) -> u64 {
    inputs.iter().fold(0x9e37_79b9_7f4a_7c15, |hash: u64, input| {
        let mut mixed = hash.rotate_left(23) ^ input.to_bits();
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    })
}

/// What has a hash already.
#[derive(Debug, Default)]
struct Hashed(u64);

impl Hasher for Hashed {
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
