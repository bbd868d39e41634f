//! The tape of accepted steps, of variable length.

use crate::error::Error;
use crate::memory::{extend, push};
use crate::scalar::Real;
use alloc::vec::Vec;

/// An accepted step.
#[derive(Clone, Copy, Debug)]
pub struct TapeEntry<T> {
    /// The start time.
    pub t: T,
    /// The length.
    pub h: T,
    /// The index of its method in the family.
    pub order_index: usize,
    /// The offset of its numbers.
    offset: usize,
}

/// Successive steps and their numbers: the states at the start, followed by the unknowns of the
/// stages.
#[derive(Debug)]
pub struct Tape<T> {
    entries: Vec<TapeEntry<T>>,
    /// The entries at the time of freezing.
    frozen_entries: Vec<TapeEntry<T>>,
    numbers: Vec<T>,
    /// The numbers of the steps of a replay.
    replayed_numbers: Vec<T>,
}

impl<T> Default for Tape<T> {
    fn default() -> Self {
        Self {
            entries: Vec::new(),
            frozen_entries: Vec::new(),
            numbers: Vec::new(),
            replayed_numbers: Vec::new(),
        }
    }
}

impl<T: Real> Tape<T> {
    pub fn clear(&mut self) {
        self.entries.clear();
        self.numbers.clear();
    }

    pub fn entries(&self) -> &[TapeEntry<T>] {
        &self.entries
    }

    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn push(&mut self, t: T, h: T, level: usize, x: &[T], stages: &[T]) -> Result<(), Error> {
        let begin = self.numbers.len();
        extend(&mut self.numbers, x)?;
        extend(&mut self.numbers, stages)?;
        push(&mut self.entries, TapeEntry { t, h, order_index: level, offset: begin })
    }

    /// The states at the start of a step, and the unknowns of its stages.
    pub fn step_numbers(&self, step: usize, states: usize) -> (&[T], &[T]) {
        let begin = self.entries.get(step).map_or(self.numbers.len(), |entry| entry.offset);
        let end = self.entries.get(step + 1).map_or(self.numbers.len(), |entry| entry.offset);
        let numbers = self.numbers.get(begin..end).unwrap_or_default();
        numbers.split_at(states.min(numbers.len()))
    }

    /// Replaces the length and the stages of the last step.
    pub fn replace_last_step(&mut self, h: T, states: usize, stages: &[T]) {
        let Some(entry) = self.entries.last_mut() else { return };
        entry.h = h;
        let numbers = self.numbers.iter_mut().skip(entry.offset + states);
        for (to, from) in numbers.zip(stages) {
            *to = *from;
        }
    }

    /// Stores the lengths of the steps.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn freeze(&mut self) -> Result<(), Error> {
        self.frozen_entries.clear();
        extend(&mut self.frozen_entries, &self.entries)
    }

    /// Scales the frozen steps, as stored, to another interval.
    pub fn stretch(&mut self, start: T, end: T) {
        let (Some(first), Some(last)) = (self.frozen_entries.first(), self.frozen_entries.last()) else {
            return;
        };
        let (begin, length) = (first.t, last.t + last.h - first.t);
        let factor = (end - start) / length;
        if factor.is_finite() {
            for (entry, kept) in self.entries.iter_mut().zip(&self.frozen_entries) {
                (entry.t, entry.h) = (start + factor * (kept.t - begin), factor * kept.h);
            }
        }
    }

    /// Begins a replay of the steps.
    pub fn begin_replay(&mut self) {
        self.replayed_numbers.clear();
    }

    /// Adds the next step of a replay; all lengths are unchanged.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`]
    pub fn write_replayed_step(&mut self, x: &[T], stages: &[T]) -> Result<(), Error> {
        extend(&mut self.replayed_numbers, x)?;
        extend(&mut self.replayed_numbers, stages)
    }

    /// Replaces the numbers by those of a complete replay.
    pub fn commit_replay(&mut self) {
        if self.replayed_numbers.len() == self.numbers.len() {
            core::mem::swap(&mut self.replayed_numbers, &mut self.numbers);
        }
    }

    /// The index of the step that contains a time: the last one that starts before it.
    pub fn find_step(&self, t: T) -> usize {
        let forward = self.entries.first().is_none_or(|entry| entry.h >= T::ZERO);
        let after = self.entries.partition_point(|entry| if forward { entry.t <= t } else { entry.t >= t });
        after.saturating_sub(1)
    }
}
