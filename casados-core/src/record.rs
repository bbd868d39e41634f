//! Structs as arguments of a model.

use crate::scalar::Real;
use crate::shape::Matrix;
use bytemuck::Zeroable;
use nalgebra::SMatrix;

/// A struct that is an argument of a model, converted to numbers in the order of the model;
/// implemented by `#[derive(Record)]`.
///
/// Fields are of the types of arguments: `f64`, arrays, tuples, fixed-size nalgebra vectors and
/// matrices, and other records. The order is that of `STRUCTURE`: fields in the order of their
/// declaration, elements of arrays by index, matrices in column-major order.
///
/// # Example
/// ```
/// use casados::prelude::*;
/// use casados::Record;
/// use nalgebra::{Vector1, Vector2};
///
/// #[ode]
/// mod crane {
///     use casados::Record;
///     use nalgebra::Vector2;
///
///     #[derive(Clone, Debug, PartialEq, Record)]
///     pub struct State { pub load: Vector2<f64>, pub swing: [f64; 2] }
///
///     pub fn crane(x: &State, u: f64) -> State {
///         State { load: Vector2::new(x.swing[0], u), swing: [x.swing[1], -x.swing[0]] }
///     }
/// }
///
/// let start = crane::State { load: Vector2::new(1.0, 2.0), swing: [0.0, 0.5] };
/// let mut irk = Irk::<Crane, Gauss<2>>::new(Options::default())?;
/// let end = irk.solve(&start.to_vector(), &Vector1::new(3.0), 0.1)?;
/// let end = crane::State::from_vector(&end.x);
/// assert!((end.load.y - 2.3).abs() < 1e-14);
/// # Ok::<(), casados::Error>(())
/// ```
pub trait Record: Sized {
    /// Number of numbers.
    const NUMBERS: usize;

    /// Writes the numbers in order.
    fn write(&self, to: &mut dyn FnMut(f64));

    /// Reads the numbers in order.
    fn read(from: &mut dyn FnMut() -> f64) -> Self;

    /// Returns a vector: `x0`, `u` or `p` of an integrator. A wrong length is a compile-time error.
    #[must_use]
    fn to_vector<T: Real, V: Matrix<T>>(&self) -> V {
        const { assert!(Self::NUMBERS == V::ROWS * V::COLUMNS, "the record has as many numbers as the vector") };
        let mut vector = V::zeroed();
        let mut places = vector.as_mut_slice().iter_mut();
        self.write(&mut |value| {
            if let Some(place) = places.next() {
                *place = T::from_f64(value);
            }
        });
        vector
    }

    /// Converts a vector: a result of an integrator. A wrong length is a compile-time error.
    #[must_use]
    fn from_vector<T: Real, V: Matrix<T>>(vector: &V) -> Self {
        const { assert!(Self::NUMBERS == V::ROWS * V::COLUMNS, "the record has as many numbers as the vector") };
        record_from_slice(vector.as_slice())
    }

    /// Converts a slice: a stage of a solution. `None` if the length is wrong.
    #[must_use]
    fn from_slice<T: Real>(values: &[T]) -> Option<Self> {
        (values.len() == Self::NUMBERS).then(|| record_from_slice(values))
    }

    /// Returns the numbers in order.
    #[cfg(feature = "alloc")]
    #[must_use]
    fn numbers(&self) -> alloc::vec::Vec<f64> {
        let mut numbers = alloc::vec::Vec::new();
        self.write(&mut |value| numbers.push(value));
        numbers
    }
}

fn record_from_slice<T: Real, R: Record>(values: &[T]) -> R {
    let mut values = values.iter();
    R::read(&mut || values.next().map_or(0.0, |value| value.to_f64()))
}

impl Record for f64 {
    const NUMBERS: usize = 1;
    fn write(&self, to: &mut dyn FnMut(f64)) {
        to(*self);
    }
    fn read(from: &mut dyn FnMut() -> f64) -> Self {
        from()
    }
}

impl<R: Record, const N: usize> Record for [R; N] {
    const NUMBERS: usize = N * R::NUMBERS;
    fn write(&self, to: &mut dyn FnMut(f64)) {
        self.iter().for_each(|element| element.write(to));
    }
    fn read(from: &mut dyn FnMut() -> f64) -> Self {
        core::array::from_fn(|_| R::read(from))
    }
}

impl<const R: usize, const C: usize> Record for SMatrix<f64, R, C> {
    const NUMBERS: usize = R * C;
    fn write(&self, to: &mut dyn FnMut(f64)) {
        self.as_slice().iter().for_each(|&element| to(element));
    }
    fn read(from: &mut dyn FnMut() -> f64) -> Self {
        let mut matrix: Self = Zeroable::zeroed();
        matrix.as_mut_slice().iter_mut().for_each(|element| *element = from());
        matrix
    }
}

macro_rules! tuples {
    ($(($($part:ident $index:tt),*))*) => { $(
        impl<$($part: Record),*> Record for ($($part,)*) {
            const NUMBERS: usize = 0 $(+ $part::NUMBERS)*;
            fn write(&self, to: &mut dyn FnMut(f64)) {
                $(self.$index.write(to);)*
            }
            fn read(from: &mut dyn FnMut() -> f64) -> Self {
                ($($part::read(from),)*)
            }
        }
    )* };
}
tuples! { (A 0) (A 0, B 1) (A 0, B 1, C 2) (A 0, B 1, C 2, D 3) }

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector1, Vector2, Vector3};

    type Nested = (f64, [Vector2<f64>; 2], Matrix2<f64>, (Vector1<f64>, [f64; 0]));

    /// Each number is its position.
    #[test]
    fn order_of_numbers() {
        let value: Nested = (
            0.0,
            [Vector2::new(1.0, 2.0), Vector2::new(3.0, 4.0)],
            Matrix2::new(5.0, 7.0, 6.0, 8.0),
            (Vector1::new(9.0), []),
        );
        let vector: SMatrix<f64, 10, 1> = value.to_vector();
        assert_eq!(vector, SMatrix::<f64, 10, 1>::from_fn(|i, _| i as f64));
        assert_eq!(Nested::from_vector(&vector), value);
        let single: SMatrix<f32, 10, 1> = value.to_vector();
        assert_eq!(Nested::from_slice(single.as_slice()), Some(value));
        assert_eq!(Nested::from_slice(&[1.0; 9]), None);
        assert_eq!(<[f64; 3]>::from_vector(&Vector3::new(1.0, 2.0, 3.0)), [1.0, 2.0, 3.0]);
    }
}
